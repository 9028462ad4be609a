"""The operator's arm in a kick: fh = uh - Th p."""

from __future__ import annotations

from ..model import operator
from .state import Load


def with_hand(hand, load, step, p, v, c):
    """The load with that of the operator's arm."""
    if hand is None:
        return load
    fx, dx = row(hand[0], step, p[0], v[0], c[0])
    fy, dy = row(hand[1], step, p[1], v[1], c[1])
    f, d = load.f, load.d
    return Load((f[0] - fx, f[1] - fy), (d[0] + dx, d[1] + dy, d[2]))


def row(th, step, p, v, c):
    """Resisting force of one axis without the velocity after the kick, and its part per unit."""
    # at the start and the end the kick is half of one
    h = step.H if step.before > 0.0 and step.after > 0.0 else max(step.before, step.after)
    spring, mass, before, after = operator.operator_coefficients(th, step.H, step.L, step.R, h)
    return operator.operator_force(spring, mass, before, p, c, v), after
