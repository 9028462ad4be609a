"""The operator's arm in a kick: fh = uh - Th p."""

from __future__ import annotations

from .state import Load


def with_hand(hand, load, step, at):
    """The load with that of the operator's arm."""
    if hand is None:
        return load
    p, v, c, f, d = at.p, at.v, at.c, load.f, load.d
    fx, dx = resisting(hand[0], step, p[0], v[0], c[0])
    fy, dy = resisting(hand[1], step, p[1], v[1], c[1])
    return Load((f[0] - fx, f[1] - fy), (d[0] + dx, d[1] + dy, d[2]))


def resisting(part, step, p, v, c):
    """Resisting force of one axis without the velocity after the kick, and its part per unit.

    Mass and damping act as those of the handle. The spring acts at the place of the sample; a
    quarter of k h^2 added to the mass makes its energy exact in even steps.
    """
    h = span(part.longer, step)
    mass = part.mass + 0.25 * part.spring * h * h
    before, after = part.damper * step.L - mass / step.H, part.damper * step.R + mass / step.H
    return part.spring * p - mass * c + before * v, after


def span(longer, step):
    """Length of the steps by which a kick counts the spring [s]."""
    if longer is None:  # at the start and the end the kick is half of one
        return step.H if step.before > 0.0 and step.after > 0.0 else max(step.before, step.after)
    return max(step.before, step.after)


def with_hand_now(hand, load, at):
    """The load at an instant with that of the operator's arm."""
    if hand is None:
        return load
    (hx, hy), f, p, v, c = hand, load.f, at.p, at.v, at.c
    fx = hx.spring * p[0] - hx.mass * c[0] + hx.damper * v[0]
    fy = hy.spring * p[1] - hy.mass * c[1] + hy.damper * v[1]
    return Load((f[0] - fx, f[1] - fy), (hx.mass, hy.mass, 0.0))


def dampers(hand):
    """Dampers of the hand, (x, y) [N.s/m]."""
    if hand is None:
        return 0.0, 0.0
    return hand[0].damper, hand[1].damper


def damping_force(hand, step, v, u):
    """Force of the dampers in a kick, as `resisting` counts it, (x, y) [N].

    Args:
        hand: the operator's arm.
        step: around the sample.
        v: velocity before the kick, (x, y) [m/s].
        u: velocity after it, (x, y) [m/s].
    """
    (dx, dy), L, R = dampers(hand), step.L, step.R
    return dx * (L * v[0] + R * u[0]), dy * (L * v[1] + R * u[1])


def springs(hand):
    """Springs of the hand, (x, y) [N/m]."""
    if hand is None:
        return 0.0, 0.0
    return hand[0].spring, hand[1].spring


def masses(hand):
    """Masses of the hand, (x, y) [kg]."""
    if hand is None:
        return 0.0, 0.0
    return hand[0].mass, hand[1].mass
