"""Clay so stiff that a step may overshoot: how a kick splits it, and the impulse it owes."""

from __future__ import annotations

from ..model import arm
from ..model import damping as law
from . import hand as hands
from .servo import added
from .state import Handle

NONE = (0.0, 0.0)


def behind_sample(stiff, split, step, at):
    """The handle in a kick; after the sample it is at rest along axes of stiff clay."""
    if stiff is None or split.over == 0.0:
        return at
    v, c, share = at.v, at.c, split.share
    vx, vy = 0.0 if share[0] > 0.0 else v[0], 0.0 if share[1] > 0.0 else v[1]
    return Handle(
        at.u, at.p, at.W, v, arm.centripetal_about_sample(step.L, c[0], c[1], vx, vy, at.u)
    )


def slow_force(stiff, hand, acting, law_, pull):
    """The force that stiff clay bears in slow motion, (x, y) [N]; see damping.slow_force."""
    if stiff is None or acting.split.over == 0.0:
        return NONE
    at, k, uh, share = acting.at, acting.viscous, acting.uh, acting.split.share
    (kx, ky), p, v, W, a = hands.springs(hand), at.p, at.v, law_.W, law_.rest
    hx, hy = uh[0] - kx * p[0] - pull[0], uh[1] - ky * p[1] - pull[1]
    gx, gy = a[0] + W[0] * hx + W[1] * hy, a[1] + W[1] * hx + W[2] * hy
    fx, fy = (k.b0[0] + k.b1[0]) * v[0], (k.b0[1] + k.b1[1]) * v[1]
    return law.slow_force((gx, gy), W, share, (fx, fy))


def with_owed(stiff, hand, acting, load, owed, g):
    """The load with what stiff clay owes from the step before, and owes to the next kick.

    Args:
        stiff: the part.
        hand: the operator's arm.
        acting: what acts in the kick.
        load: the load.
        owed: impulse from the step before [N.s].
        g: the slow force [N].

    Returns:
        The load; force returned [N]; force owed [N], and its part per unit of the velocity after
        the kick [N.s/m].
    """
    if stiff is None or acting.split.over == 0.0:
        return load, NONE, NONE, NONE
    step, share, (kx, ky) = acting.step, acting.split.share, hands.springs(hand)
    back = owed[0] / step.H, owed[1] / step.H
    owes = share[0] * g[0], share[1] * g[1]
    soft = 0.5 * step.after * kx * share[0], 0.5 * step.after * ky * share[1]
    load = added(load, (owes[0] - back[0], owes[1] - back[1]), (soft[0], soft[1], 0.0))
    return load, back, owes, soft


def still_owed(stiff, acting, back, owes, soft, u):
    """Clay force beside its dampers [N], and impulse owed to the next kick [N.s].

    Args:
        back: force returned in the kick, from `with_owed` [N].
        owes: force owed to the next, from `with_owed` [N].
    """
    if stiff is None or acting.split.over == 0.0:
        return NONE, NONE
    H, x, y = acting.step.H, owes[0] - soft[0] * u[0], owes[1] - soft[1] * u[1]
    return (back[0] - x, back[1] - y), (H * x, H * y)


def at_sample(stiff, split, k, v, u, beside, slow):
    """Velocity at the sample, (x, y) [m/s]: in stiff clay what its damping feels."""
    if stiff is None:
        return slow
    (x, y), b0, b1, soft = slow, k.b0, k.b1, split.soft
    if soft[0] > 0.0:
        x = soft[0] * (b0[0] * v[0] + b1[0] * u[0] + beside[0])
    if soft[1] > 0.0:
        y = soft[1] * (b0[1] * v[1] + b1[1] * u[1] + beside[1])
    return x, y
