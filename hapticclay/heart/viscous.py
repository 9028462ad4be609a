"""Viscous clay in a kick: constant, growing, smooth, turned, and so stiff that a step overshoots."""

from __future__ import annotations

from ..model import arm, clay, controller, regions
from .state import Before, Load, Region, Step, Viscous

NONE = Viscous((0.0, 0.0), (0.0, 0.0), 0.0, (0.0, 0.0), (0.0, 0.0))


def damping(growth, base, rate, t):
    """Damping at a time, (x, y) [N.s/m]."""
    if growth is None:
        return base
    return clay.damping_at(base, rate, t)


def split(parts, s, step):
    """Damping of the clay in a kick."""
    return split_clay(parts.clay, parts, s, step)


def split_clay(present, parts, s, step):
    if present is None:
        return NONE
    b0 = damping(parts.growth, s.clay.old.base, s.clay.old.rate, s.clock.t - 0.25 * step.before)
    b1 = damping(parts.growth, s.clay.region.base, s.clay.region.rate, s.clock.t + 0.25 * step.after)
    return split_stiff(parts.stiff, parts.hand, step, b0, b1)


def split_stiff(stiff, hand, step, b0, b1):
    L, R = step.L, step.R
    if stiff is None:
        none = (0.0, 0.0)
        return Viscous((L * b0[0], L * b0[1]), (R * b1[0], R * b1[1]), 0.0, none, none)
    dx, dy = dampers(hand)
    bx0, bx1, by0, by1, over, sharex, sharey, softx, softy = clay.split_damping(
        b0, b1, step.H, L, R, stiff.mobility, dx, dy
    )
    return Viscous((bx0, by0), (bx1, by1), over, (sharex, sharey), (softx, softy))


def dampers(hand):
    """Dampers of the hand, (x, y) [N.s/m]."""
    if hand is None:
        return 0.0, 0.0
    return hand[0].damper, hand[1].damper


def springs(hand):
    """Springs of the hand, (x, y) [N/m]."""
    if hand is None:
        return 0.0, 0.0
    return hand[0].spring, hand[1].spring


def force(grain, b, v):
    """Force of damping, (x, y) [N]."""
    if grain is None:
        return clay.viscous_force(b[0], b[1], v[0], v[1])
    return clay.turned_force(grain[0], grain[1], b[0], b[1], v[0], v[1])


def tensor(grain, b):
    """Damping tensor, (xx, yy, xy) [N.s/m]."""
    if grain is None:
        return b[0], b[1], 0.0
    return clay.turned_damping(grain[0], grain[1], b[0], b[1])


def with_clay(present, grain, load, k, v):
    """The load with that of viscous clay."""
    if present is None:
        return load
    x, y = force(grain, k.b0, v)
    xx, yy, xy = tensor(grain, k.b1)
    f, d = load.f, load.d
    return Load((f[0] - x, f[1] - y), (d[0] + xx, d[1] + yy, d[2] + xy))


def mean_force(present, grain, k, v, u):
    """Mean force of the dampers in a kick, (x, y) [N]."""
    if present is None:
        return 0.0, 0.0
    ax, ay = force(grain, k.b0, v)
    bx, by = force(grain, k.b1, u)
    return ax + bx, ay + by


def centripetal(stiff, k, step, c, v, u):
    """Centripetal acceleration of a kick: behind the sample the handle stands where clay is stiff."""
    if stiff is None:
        return c
    if k.stiff == 0.0:
        return c
    vx, vy = 0.0 if k.share[0] > 0.0 else v[0], 0.0 if k.share[1] > 0.0 else v[1]
    return arm.centripetal_about_sample(step.L, c[0], c[1], vx, vy, u)


def slow_force(k, W, g, v):
    """clay.slow_force of a kick, (x, y) [N]."""
    b0, b1, share = k.b0, k.b1, k.share
    return clay.slow_force(
        g[0], g[1], W[0], W[1], W[2], share[0], share[1],
        (b0[0] + b1[0]) * v[0], (b0[1] + b1[1]) * v[1],
    )  # fmt: skip


def at_place(smooth, table, region, old, p):
    """Clay now and before at a place, where it is smooth."""
    if smooth is None:
        return region, old
    b, o, r = region.base, old.base, old.rate
    x, y = regions.smooth_clay(table, smooth, p[0], p[1], b[0], b[1])
    if smooth == 1:
        before, rate = (x, o[1]), (0.0, r[1])
    elif smooth == 2:
        before, rate = (o[0], y), (r[0], 0.0)
    else:
        before, rate = (x, y), (0.0, 0.0)
    now = Region(region.index, region.low, region.high, (x, y), region.rate, region.flow)
    return now, Before(before, rate, old.flow)


def velocity_at_sample(stiff, step, k, v, u, rest):
    """Velocity at the sample, (x, y) [m/s]: in stiff clay what its damping feels."""
    x, y = v[0] + step.L * (u[0] - v[0]), v[1] + step.L * (u[1] - v[1])
    if stiff is None:
        return x, y
    if k.soft[0] > 0.0:
        x = k.soft[0] * (k.b0[0] * v[0] + k.b1[0] * u[0] + rest[0])
    if k.soft[1] > 0.0:
        y = k.soft[1] * (k.b0[1] * v[1] + k.b1[1] * u[1] + rest[1])
    return x, y


def along(grain, x, y):
    """Components along the axes of the clay."""
    if grain is None:
        return x, y
    return controller.along_axes(grain[0], grain[1], x, y)


def across(grain, x, y):
    """The inverse of `along`."""
    if grain is None:
        return x, y
    return controller.along_axes(grain[0], -grain[1], x, y)
