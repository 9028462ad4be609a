"""Laws of the clay beside plain damping: a line each, in the order in which they act.

| law | module | enter | load | resist | moved | force |
|---|---|---|---|---|---|---|
| yields | `yielding` | its numbers | | after the kick is solved | ages | on a moving handle |
| springs back | `springs` | rest and dent | x | | x | x |
| stays cut | `groove` | damping of the groove | | by `yielding` | cuts | by `yielding` |
| of a user | `own_laws` | | x | | x | x |
"""

from ..formulas import flow
from . import groove, own_laws, springs, viscous, yielding


def enter(m, s, px, py, crossed):
    """Begins in a region entered over a border of coordinate `crossed`; -1 at the start."""
    if m.flow and not m.groove:
        yielding.enter(m, s)
    if m.springs:
        springs.enter(m, s, px, py, crossed)
    if m.groove:
        groove.enter(m, s)
    if m.smooth:
        viscous.smoothed(m, s, px, py)


def moved(m, s, px, py, vx, vy, h):
    """Their states after a step of length h to a place and velocity."""
    if m.springs:
        springs.move(m, s, px, py, h)
    if m.groove:
        groove.move(m, s, px, py, vx, vy)
    if m.laws:
        own_laws.move(m, px, py, vx, vy, h)
    if m.flow:
        yielding.age(s)
    if m.smooth:
        viscous.smoothed(m, s, px, py)


# ---- at an instant -------------------------------------------------------------------------------


def without_clay(m, s, k, fx, fy):
    """A force on the handle less that of the clay before the sample that does not yield [N]."""
    x, y = k.x, k.y
    bx, by = viscous.force(m, viscous.damping(m, s, 0, 1), viscous.damping(m, s, 1, 1), x.v, y.v)
    fx, fy = fx - bx, fy - by
    if m.special and (m.springs or m.laws):
        ax = ay = gx = gy = 0.0
        if m.springs:
            ax, ay = springs.beside(m, s, 0, bx), springs.beside(m, s, 1, by)
        if m.laws:
            gx, gy = own_laws.force(m, x.p, y.p, x.v, y.v, 0.0)
        fx, fy = fx - (ax + gx), fy - (ay + gy)
    return fx, fy


def force_for_controller(m, s, k):
    """Force of the clay as the controller evaluates it at the handle in k, (x, y) [N]."""
    if not m.clay:
        return 0.0, 0.0
    px, py, vx, vy = k.x.p, k.y.p, k.x.v, k.y.v
    x, y = viscous.force(m, viscous.damping(m, s, 0, 0), viscous.damping(m, s, 1, 0), vx, vy)
    if not m.special:
        return x, y
    fx = fy = 0.0
    if m.flow:
        fx, fy = motion_force(m, s, vx, vy, k.x.pull, k.y.pull)
    if m.springs:
        gx = springs.force_for_controller(m, s, 0, px)
        gy = springs.force_for_controller(m, s, 1, py)
        gx = -x if springs.pulls(m, s.x, x + gx) else gx
        gy = -y if springs.pulls(m, s.y, y + gy) else gy
        fx, fy = fx + gx, fy + gy
    if m.laws:
        gx, gy = own_laws.force(m, px, py, vx, vy, 0.0)
        fx, fy = fx + gx, fy + gy
    return x + fx, y + fy


def motion_force(m, s, vx, vy, pullx, pully):
    """Force of yielding clay, in addition to b v, on a moving handle; none at rest, (x, y) [N].

    For physical clay this is the force that holds the handle, which is given.
    """
    if m.acts:
        return pullx, pully
    law = yielding.laws_of_motion(m, s, vx, vy)
    ax, ay = viscous.along(m, vx, vy)
    ax, ay = flow.motion_force(law, m.flow == 2, ax, ay)
    return viscous.across(m, ax, ay)
