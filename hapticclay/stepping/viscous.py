"""Viscous clay in a kick: constant, growing, with rotated axes, smooth."""

from __future__ import annotations

from ..model import controller, regions
from ..model import damping as law
from . import hand as hands
from .state import Clay, Growth, Load, Split, Viscous

NONE = (0.0, 0.0)


def damping(part, special, clay, t, hand, step):
    """Damping of the clay in a kick, and how stiff clay splits it."""
    if part is None:
        return Viscous(NONE, NONE), None
    b0, b1 = around(part.growth, clay, t, step)
    return special_damping(special, step, hand, b0, b1)


def around(growth, clay, t, step):
    """Damping in the middle of the halves of a kick, (x, y) each [N.s/m]."""
    if growth is None:
        return clay.old, clay.b
    b0 = law.damping_at(clay.old, clay.growth.old, t - 0.25 * step.before)
    return b0, law.damping_at(clay.b, clay.growth.rate, t + 0.25 * step.after)


def special_damping(special, step, hand, b0, b1):
    if special is None:
        return weighted(step, b0, b1), None
    return split_damping(special.stiff, step, hand, b0, b1)


def weighted(step, b0, b1):
    """Damping in a kick that no step can overshoot."""
    before, after = law.halved_damping(b0, b1, step.L, step.R)
    return Viscous(before, after)


def split_damping(stiff, step, hand, b0, b1):
    """Damping in a kick, see damping.split_damping, and the split."""
    if stiff is None:
        return weighted(step, b0, b1), None
    dx, dy = hands.dampers(hand)
    x0, x1, y0, y1, over, sharex, sharey, softx, softy = law.split_damping(
        b0, b1, step.H, step.L, step.R, stiff.mobility, dx, dy
    )
    return Viscous((x0, y0), (x1, y1)), Split(over, (sharex, sharey), (softx, softy))


def grown(part, b, growth, before, t):
    """Damping at a time, now or before the sample, (x, y) [N.s/m]."""
    if part is None:
        return b
    return law.damping_at(b, growth.old if before else growth.rate, t)


def now(part, clay, before, t):
    """Damping at a sample, or that before it, (x, y) [N.s/m]."""
    if part is None:
        return clay.b
    if before:
        return grown(part.growth, clay.old, clay.growth, 1, t)
    return grown(part.growth, clay.b, clay.growth, 0, t)


def force(grain, b, v):
    """Force of damping, (x, y) [N]."""
    if grain is None:
        return b[0] * v[0], b[1] * v[1]
    return law.rotated_force(grain[0], grain[1], b[0], b[1], v[0], v[1])


def tensor(grain, b):
    """Damping tensor, (xx, yy, xy) [N.s/m]."""
    if grain is None:
        return b[0], b[1], 0.0
    return law.rotated_damping(grain[0], grain[1], b[0], b[1])


def with_clay(part, grain, load, k, v):
    """The load with that of viscous clay; of it the force [N] and the damping (xx, yy, xy)."""
    if part is None:
        return load, NONE, (0.0, 0.0, 0.0)
    f, d = load.f, load.d
    x, y = force(grain, k.b0, v)
    xx, yy, xy = tensor(grain, k.b1)
    load = Load((f[0] - x, f[1] - y), (d[0] + xx, d[1] + yy, d[2] + xy))
    return load, (x, y), (xx, yy, xy)


def at_instant(part, special, table, clay, t, p):
    """Damping at an instant, (x, y) [N.s/m]."""
    if part is None:
        return clay.b
    return placed(special, table, grown(part.growth, clay.b, clay.growth, 0, t), p)


def placed(special, table, b, p):
    if special is None:
        return b
    return smooth_damping(special.smooth, table, b, p)


def smooth_damping(smooth, table, b, p):
    """Damping at a place, (x, y) [N.s/m]."""
    if smooth is None:
        return b
    return regions.smooth_clay(table, smooth, p[0], p[1], b[0], b[1])


def same_growth(part, growth):
    """Growth after a step: the clay before the sample is the present one."""
    if part is None:
        return growth
    return Growth(growth.rate, growth.rate)


def at_place(smooth, table, clay, p):
    """The clay at a place, where it is smooth: that before the sample too."""
    if smooth is None:
        return clay
    x, y = smooth_damping(smooth, table, clay.b, p)
    o = clay.old
    old = (x, o[1]) if smooth == 1 else (o[0], y) if smooth == 2 else (x, y)
    growth, c = without_growth(clay.growth, smooth), clay
    return Clay(c.region, (x, y), old, growth, c.hit, c.reaction, c.laws)


def without_growth(growth, smooth):
    if growth is None:
        return growth
    r = growth.old
    old = (0.0, r[1]) if smooth == 1 else (r[0], 0.0) if smooth == 2 else (0.0, 0.0)
    return Growth(growth.rate, old)


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
