"""Clay that yields in a kick: how it resists, and whether it holds the handle."""

from __future__ import annotations

import math

from ..model import controller, flow
from . import grooves, viscous
from .state import Contact, Felt

NO_FORCE = (0.0, 0.0)


def at_rest(parts_flow, w, c):
    """Centripetal acceleration; none of a handle that rests, whatever stopped it."""
    if parts_flow is None:
        return c
    if w[0] == 0.0 and w[1] == 0.0:
        return 0.0, 0.0
    return c


def law_now(present, groove, region, old, L, v):
    """Fy, K, n of x and y in a kick. Half a step of other clay before it counts as steady force."""
    a, b = region.flow, old.flow
    if a == b:
        return a
    R, x, y = 1.0 - L, abs(v[0]), abs(v[1])
    if present.along is not None:
        x = y = math.sqrt(v[0] * v[0] + v[1] * v[1])
    x, y = flow.moving_force(b[0], b[1], b[2], x), flow.moving_force(b[3], b[4], b[5], y)
    return L * x + R * a[0], R * a[1], a[2], L * y + R * a[3], R * a[4], a[5]


def law_in_kick(present, groove, contact, region, old, L, B, v, end):
    """As `law_now`, of any clay that yields."""
    if groove is None:
        return law_now(present, groove, region, old, L, v)
    return grooves.law_in_kick(groove, contact.stuck, B, v, end)


def resist_by(along, B, v, end, law, L):
    if along is None:
        return flow.resist_axes(B, v, end, law, L)
    return flow.resist_along(B, v, end, law, L)


def back(stuck, anchor, place, on):
    """Velocity that leads an axis that rests beside one that slides back to its place [m/s]."""
    if on > 0.0 and stuck > 0.0 and anchor == anchor:
        return 0.5 * (anchor - place) / on
    return 0.0


def anchored(still, stuck, rests, anchor, place):
    if still or stuck == 0.0 or rests == 0.0:
        return math.nan
    if anchor != anchor:
        return place
    return anchor


def resist(parts, s, step, pose, law, load, v, u, c):
    """Velocity after the kick, and what the clay did; as they were where nothing yields."""
    return resist_flow(parts.flow, parts, s, step, pose, law, load, v, u, c)


def resist_flow(present, parts, s, step, pose, law, load, v, u, c):
    if present is None:
        return u, s.clay.felt
    grain, contact = parts.grain, s.clay.felt.contact
    stuck, anchor = contact.stuck, contact.anchor
    # a straight step in the joints bends the path of the handle: its mean velocities are these
    lead, on = step.H * step.L, step.H * (1.0 - step.L)
    ax, ay = v[0] + lead * c[0], v[1] + lead * c[1]
    ex, ey = u[0] - on * c[0], u[1] - on * c[1]
    B = controller.velocity_per_force(law.n, law.W, load.d)
    groovy = law_of_groove(parts.groove, contact, B, (ax, ay), (ex, ey))
    B = turned_matrix(grain, B)
    ax, ay = viscous.along(grain, ax, ay)
    ex, ey = viscous.along(grain, ex, ey)
    place = viscous.along(grain, pose.p[0], pose.p[1])
    ax, ay = 0.0 if stuck[0] > 0.0 else ax, 0.0 if stuck[1] > 0.0 else ay
    # an axis that rests beside one that slides stays where it came to rest: no step leads away
    backx, backy = back(stuck[0], anchor[0], place[0], on), back(stuck[1], anchor[1], place[1], on)
    fyk = law_of_flow(parts.groove, present, groovy, s.clay.region, s.clay.old, step.L, (ax, ay))
    rx, ry, ux, uy, sx, sy, fx, fy, x, y = resist_by(
        present.along, B, (ax, ay), (ex - backx, ey - backy), fyk, step.L
    )
    still = ux == 0.0 and uy == 0.0
    restx = 1.0 if ux == 0.0 and fyk[0] > 0.0 else 0.0
    resty = 1.0 if uy == 0.0 and fyk[3] > 0.0 else 0.0
    after = Contact(
        (restx, resty),
        (
            anchored(still, stuck[0], restx, anchor[0], place[0]),
            anchored(still, stuck[1], resty, anchor[1], place[1]),
        ),
    )
    times = step.H * (x - step.L) if x >= 0.0 else 0.0, step.H * (y - step.L) if y >= 0.0 else 0.0
    if still:  # the force that does it
        px, py = viscous.along(grain, u[0], u[1])
        det = B[0] * B[3] - B[1] * B[2]
        rx, ry = (B[3] * px - B[1] * py) / det, (B[0] * py - B[2] * px) / det
    else:
        ux, uy = ux + backx, uy + backy
    rx, ry = viscous.across(grain, rx, ry)
    ux, uy = viscous.across(grain, ux, uy)
    if not still:
        ux, uy = ux + on * c[0], uy + on * c[1]
    felt = Felt(
        (rx, ry), viscous.across(grain, sx, sy), viscous.across(grain, fx, fy), after,
        1.0 if still else 0.0, times,
    )  # fmt: skip
    return (ux, uy), felt


def law_of_groove(groove, contact, B, v, u):
    if groove is None:
        return 0.0, 0.0, 1.0, 0.0, 0.0, 1.0
    return grooves.law_in_kick(groove, contact.stuck, B, v, u)


def law_of_flow(groove, present, found, region, old, L, v):
    if groove is None:
        return law_now(present, groove, region, old, L, v)
    return found


def turned_matrix(grain, B):
    """A matrix along the axes of the clay, R' B R."""
    if grain is None:
        return B
    xx, yx = viscous.along(grain, B[0], B[2])
    xy, yy = viscous.along(grain, B[1], B[3])
    first, second = viscous.along(grain, xx, xy), viscous.along(grain, yx, yy)
    return first[0], first[1], second[0], second[1]


def mean(felt):
    """Mean force of yielding in a kick, (x, y) [N]."""
    if felt is None:
        return 0.0, 0.0
    return felt.mean


def still(felt):
    """Whether both axes rest behind a kick."""
    if felt is None:
        return False
    return felt.still > 0.0


def creeping(present, groove, s, k, L, g, v):
    """The part of a slow force on stiff clay that its damping bears: what yielding leaves of it."""
    if present is None:
        return g
    fyk = creeping_law(groove, present, s, L, v)
    bx, by = k.b0[0] + k.b1[0], k.b0[1] + k.b1[1]
    gx, gy = abs(g[0]), abs(g[1])
    if present.along is not None:
        gx = gy = math.sqrt(g[0] * g[0] + g[1] * g[1])
        bx = by = 0.5 * (bx + by)
    return creep(gx, bx, fyk[0], fyk[1], fyk[2], g[0]), creep(gy, by, fyk[3], fyk[4], fyk[5], g[1])


def creeping_law(groove, present, s, L, v):
    if groove is None:
        return law_now(present, groove, s.clay.region, s.clay.old, L, v)
    return 0.0, 0.0, 1.0, 0.0, 0.0, 1.0


def creep(size, b, Fy, K, n, g):
    if size > Fy and b > 0.0:  # of what exceeds Fy, b v where b v + K v^n is all of it
        return g / size * b * flow.thinned((size - Fy) / b, K / b, n)
    return 0.0


def at_sample(present, grain, felt, soft, slow, plain):
    """Velocity at the sample: 0.0 where it is against the yield force, which holds the handle."""
    if present is None:
        return slow
    x, y = felt.v
    if soft[0] > 0.0 and x != 0.0:
        x = slow[0]
    if soft[1] > 0.0 and y != 0.0:
        y = slow[1]
    return held(grain, present, felt.f, x, y)


def held(grain, present, f, vx, vy):
    if grain is not None:
        return vx, vy
    px, py = vx * f[0], vy * f[1]
    if present.along is not None:
        px = py = px + py
    return 0.0 if px < 0.0 else vx, 0.0 if py < 0.0 else vy
