"""Where the energy of a run comes from and where it goes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..model import arm
from . import hand
from .parts import Parts
from .state import State


def stored(parts: Parts, state: State) -> tuple[float, float]:
    """Energy of the arm, and of mass and spring of the operator's arm, after the last kick [J].

    Args:
        parts: the scene.
        state: of the run.
    """
    (w1, w2), (q1, q2), h = state.body.w, state.body.q, lead(parts.accurate, state.clock.before)
    links, a = parts.arm.links, parts.arm
    u = arm.jacobian(q1 - h * w1, q2 - h * w2, links)  # where that kick was
    x, y = u[1] + u[3] - a.ox, -a.oy - u[0] - u[2]
    vx, vy = arm.handle_velocity(w1, w1 + w2, u)
    (kx, ky), (mx, my) = hand.springs(parts.hand), hand.masses(parts.hand)
    at_hand = 0.5 * (mx * vx * vx + my * vy * vy + kx * x * x + ky * y * y)
    return 0.5 * (links[2] * w1 * w1 + links[3] * (w1 + w2) * (w1 + w2)), at_hand


def lead(accurate, before):
    """Time by which the place of a state leads its rates [s]."""
    if accurate is None:
        return before
    return 0.0


def balance(work: Sequence[Any], first: Sequence[Any], last: Sequence[Any]) -> dict[str, Any]:
    """muscle + motors = clay + hand_damper + kinetic + hand_stored + residual [J].

    Floats, or arrays over runs.

    Args:
        work: of muscle, motors, clay and damper of the hand, and sum of the magnitudes [J].
        first: from `stored`, at the start.
        last: from `stored`, at the end.

    Returns:
        Record.energy.
    """
    muscle, motors, clay, damper, through = work
    kinetic, at_hand = last[0] - first[0], last[1] - first[1]
    return {
        "muscle": muscle,
        "motors": motors,
        "clay": clay,
        "hand_damper": damper,
        "kinetic": kinetic,
        "hand_stored": at_hand,
        "residual": muscle + motors - clay - damper - kinetic - at_hand,
        "throughput": through + first[0] + first[1],
    }
