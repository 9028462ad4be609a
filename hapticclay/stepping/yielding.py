"""Clay that yields in a kick: how it resists, and whether it holds the handle."""

from __future__ import annotations

import math

from ..model import controller, flow
from . import grooves, viscous
from .engine_step import put
from .state import Contact, Flow, Handle

NONE = (0.0, 0.0)
NOWHERE = (math.nan, math.nan)


def at_rest(part, w, at):
    """The handle without centripetal acceleration where it rests, whatever stopped it."""
    if part is None:
        return at
    if w[0] == 0.0 and w[1] == 0.0:
        return Handle(at.u, at.p, at.W, at.v, (0.0, 0.0))
    return at


def law_now(part, state, L, v):
    """Fy, K, n of x and y in a kick. Half a step of other clay before it counts as steady force."""
    a, b = state.law, state.old
    if a == b:
        return a
    R, x, y = 1.0 - L, abs(v[0]), abs(v[1])
    if part.along is not None:
        x = y = math.sqrt(v[0] * v[0] + v[1] * v[1])
    x, y = flow.moving_force(b[0], b[1], b[2], x), flow.moving_force(b[3], b[4], b[5], y)
    return L * x + R * a[0], R * a[1], a[2], L * y + R * a[3], R * a[4], a[5]


def law_in_kick(groove, part, clay, L, B, v, u):
    """As `law_now`, of any clay that yields; v along its axes, u in x and y."""
    if groove is None:
        return law_now(part, clay.laws.flow, L, v)
    return grooves.law_in_kick(groove, clay.reaction.contact.stuck, B, v, u)


def resist_by(along, B, v, end, law, L):
    if along is None:
        return flow.resist_axes(B, v, end, law, L)
    return flow.resist_along(B, v, end, law, L)


def back(stuck, anchor, place, on):
    """Velocity that returns an axis at rest beside one that slides to its place [m/s]."""
    if on > 0.0 and stuck > 0.0 and anchor == anchor:
        return 0.5 * (anchor - place) / on
    return 0.0


def anchored(still, stuck, rests, anchor, place):
    if still or stuck == 0.0 or rests == 0.0:
        return math.nan
    if anchor != anchor:
        return place
    return anchor


def flows_freely(groove, state):
    """Whether the clay around a kick does not yield."""
    if groove is None:
        a, b = state.law, state.old
        return a[0] + a[1] + a[3] + a[4] + b[0] + b[1] + b[3] + b[4] == 0.0
    return False


def resist(part, groove, grain, clay, acting, law, load, u):
    """Velocity after the kick, and what the clay did; None where nothing yields."""
    if part is None:
        return u, None
    step, at, contact = acting.step, acting.at, clay.reaction.contact
    stuck, c, v = contact.stuck, at.c, at.v
    if flows_freely(groove, clay.laws.flow):
        s = v[0] + step.L * (u[0] - v[0]), v[1] + step.L * (u[1] - v[1])
        return u, Contact(NONE, s, NONE, NONE, NOWHERE, 0.0, NONE)
    # a straight step in the joints bends the path of the handle: its mean velocities are these
    lead, on = step.H * step.L, step.H * (1.0 - step.L)
    ax, ay = v[0] + lead * c[0], v[1] + lead * c[1]
    ex, ey = u[0] - on * c[0], u[1] - on * c[1]
    B = controller.velocity_per_force(law.n, law.W, load.d)
    ax, ay = viscous.along(grain, ax, ay)
    a = 0.0 if stuck[0] > 0.0 else ax, 0.0 if stuck[1] > 0.0 else ay
    fyk = law_in_kick(groove, part, clay, step.L, B, a, (ex, ey))
    B = rotated_matrix(grain, B)
    ex, ey = viscous.along(grain, ex, ey)
    place = viscous.along(grain, at.p[0], at.p[1])
    # an axis that rests beside one that slides stays where it came to rest: no step leads away
    backx, backy = (
        back(stuck[0], contact.anchor[0], place[0], on),
        back(stuck[1], contact.anchor[1], place[1], on),
    )
    r, w, s, f, stops = split_resist(
        resist_by(part.along, B, a, (ex - backx, ey - backy), fyk, step.L)
    )
    still = w[0] == 0.0 and w[1] == 0.0
    if still:  # the force that does it
        px, py = viscous.along(grain, u[0], u[1])
        det = B[0] * B[3] - B[1] * B[2]
        r = (B[3] * px - B[1] * py) / det, (B[0] * py - B[2] * px) / det
        u = 0.0, 0.0
    else:
        ux, uy = viscous.across(grain, w[0] + backx, w[1] + backy)
        u = ux + on * c[0], uy + on * c[1]
    rests = (
        1.0 if w[0] == 0.0 and fyk[0] > 0.0 else 0.0,
        1.0 if w[1] == 0.0 and fyk[3] > 0.0 else 0.0,
    )
    anchor = (
        anchored(still, stuck[0], rests[0], contact.anchor[0], place[0]),
        anchored(still, stuck[1], rests[1], contact.anchor[1], place[1]),
    )
    return u, Contact(
        viscous.across(grain, r[0], r[1]), viscous.across(grain, s[0], s[1]),
        viscous.across(grain, f[0], f[1]), rests, anchor, 1.0 if still else 0.0,
        (stop_time(step, stops[0]), stop_time(step, stops[1])),
    )  # fmt: skip


def split_resist(x):
    """Mean force, velocity after, velocity and force at the sample, stops; a pair each."""
    rx, ry, ux, uy, sx, sy, fx, fy, a, b = x
    return (rx, ry), (ux, uy), (sx, sy), (fx, fy), (a, b)


def stop_time(step, share):
    return step.H * (share - step.L) if share >= 0.0 else 0.0


def rotated_matrix(grain, B):
    """A matrix along the axes of the clay, R' B R."""
    if grain is None:
        return B
    xx, yx = viscous.along(grain, B[0], B[2])
    xy, yy = viscous.along(grain, B[1], B[3])
    first, second = viscous.along(grain, xx, xy), viscous.along(grain, yx, yy)
    return first[0], first[1], second[0], second[1]


def mean(part, contact):
    """Mean force of yielding in a kick, (x, y) [N]."""
    if part is None:
        return 0.0, 0.0
    return contact.mean


def is_still(part, contact):
    """Whether both axes rest behind a kick."""
    if part is None:
        return False
    return contact.still > 0.0


def creeping(part, stiff, groove, state, acting, g):
    """The part of a slow force on stiff clay that its damping bears: what yielding leaves of it."""
    if part is None:
        return g
    if stiff is None:
        return g
    return creeping_flow(groove, part, state, acting, g)


def creeping_flow(groove, part, state, acting, g):
    if groove is None:
        return crept(part, law_now(part, state, acting.step.L, acting.at.v), acting.viscous, g)
    return g


def crept(part, law, k, g):
    """The part of a slow force that damping bears under Fy, K, n of x and y."""
    bx, by = k.b0[0] + k.b1[0], k.b0[1] + k.b1[1]
    gx, gy = abs(g[0]), abs(g[1])
    if part.along is not None:
        gx = gy = math.sqrt(g[0] * g[0] + g[1] * g[1])
        bx = by = 0.5 * (bx + by)
    return creep(gx, bx, law[0], law[1], law[2], g[0]), creep(gy, by, law[3], law[4], law[5], g[1])


def creep(size, b, Fy, K, n, g):
    """The same of one axis, where the force has a length of its own.

    Args:
        size: length of the force [N].
        Fy: yield force [N].
    """
    if size > Fy and b > 0.0:  # of what exceeds Fy, b v where b v + K v^n is all of it
        return g / size * b * flow.thinned((size - Fy) / b, K / b, n)
    return 0.0


def at_sample(part, stiff, grain, state, slow):
    """Velocity at the sample: 0.0 where it is against the yield force, which holds the handle."""
    if part is None:
        return slow
    contact = state.contact
    x, y = over_stiff(stiff, state.split, contact.v, slow)
    if grain is not None:
        return x, y
    px, py = x * contact.f[0], y * contact.f[1]
    if part.along is not None:
        px = py = px + py
    return 0.0 if px < 0.0 else x, 0.0 if py < 0.0 else y


def over_stiff(stiff, split, v, slow):
    if stiff is None:
        return v
    (x, y), soft = v, split.soft
    if soft[0] > 0.0 and x != 0.0:
        x = slow[0]
    if soft[1] > 0.0 and y != 0.0:
        y = slow[1]
    return x, y


def behind(part, state):
    """The state after a step: the clay before the sample is the present one."""
    if part is None:
        return state
    return Flow(state.law, state.law)


def noted(part, e, contact, before, t, n):
    """Notes where yielding clay stops or releases the handle; returns the number then noted."""
    if part is None:
        return n
    now, was, times = contact.stuck, before.stuck, contact.times
    if now[0] != was[0]:
        axis = 2.0 if part.along is not None else 0.0
        n = note(e.stops, n, axis, now[0], t + times[0] if now[0] > 0.0 else t)
    if part.along is None and now[1] != was[1]:
        n = note(e.stops, n, 1.0, now[1], t + times[1] if now[1] > 0.0 else t)
    return n


def note(stops, n, axis, starts, t):
    """Notes a stop; returns the number then noted.

    Args:
        axis: 0.0 for x, 1.0 for y.
        starts: 1.0 where the stop begins, 0.0 where it ends.
    """
    put(stops, 3 * n, (axis, starts, t))
    return n + 1
