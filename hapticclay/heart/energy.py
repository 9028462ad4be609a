"""Where the energy of a run comes from and where it goes, kick by kick."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

HARDWARE_WORK = (
    "friction",
    "passivity_controller",
    "coupling",
)  # entries of an interface; the last two are part of motors


def stored_energy(s, r1, r2, p, v):
    """Energy of the arm, and of mass and spring of the operator's arm.

    Args:
        s: state of the run, for the numbers of the arm and of the operator's arm.
        r1: rate of link 1 [rad/s].
        r2: absolute rate of link 2 [rad/s].
        p: handle position, (x, y) [m].
        v: handle velocity, (x, y) [m/s].

    Returns:
        (arm, operator) [J].
    """
    arm, x, y = s["arm"], s["handx"], s["handy"]
    at_hand = 0.5 * (
        both_axes(x[0], y[0], v[0] * v[0], v[1] * v[1])
        + both_axes(x[2], y[2], p[0] * p[0], p[1] * p[1])
    )
    return 0.5 * (arm[2] * r1 * r1 + arm[3] * r2 * r2), at_hand


def both_axes(x, y, ax, ay):
    """x ax + y ay, which for a hand that is the same on both axes is x (ax + ay) to the last bit.

    Args:
        x: factor of x.
        y: factor of y.
        ax: what it multiplies.
        ay: the same, y.
    """
    return x * (ax + ay) + (y - x) * ay


def energy_balance(
    work: Sequence[Any], first: Sequence[Any], last: Sequence[Any]
) -> dict[str, Any]:
    """muscle + motors = clay + hand_damper + kinetic + hand_stored + residual [J].

    Floats, or arrays over runs.

    Args:
        work: of muscle, motors, clay and damper of the hand, and throughput [J].
        first: from `stored_energy`, at the start.
        last: from `stored_energy`, at the end.

    Returns:
        Record.energy.
    """
    muscle, motors, clay, hand, through = work
    kinetic, at_hand = last[0] - first[0], last[1] - first[1]
    return {
        "muscle": muscle,
        "motors": motors,
        "clay": clay,
        "hand_damper": hand,
        "kinetic": kinetic,
        "hand_stored": at_hand,
        "residual": muscle + motors - clay - hand - kinetic - at_hand,
        "throughput": through,
    }


def kick_work(H, k, restx, resty, v0x, v0y, v1x, v1y, t1, t2, w1, w2, damperx, dampery):  # noqa: PLR0913  # plain numbers, for speed
    """Work done in a kick. Floats, or arrays over kicks.

    Args:
        H: length of the kick [s].
        k: from loop.step_inputs.
        restx: clay force beside its dampers, x [N].
        resty: clay force beside its dampers, y [N].
        v0x: handle velocity before the kick, x [m/s].
        v0y: handle velocity before the kick, y [m/s].
        v1x: handle velocity after the kick, x [m/s].
        v1y: handle velocity after the kick, y [m/s].
        t1: torque of the shoulder motor [N.m].
        t2: torque of the elbow motor [N.m].
        w1: mean rate of joint 1 [rad/s].
        w2: mean rate of joint 2 [rad/s].
        damperx: of the operator's arm, x [N.s/m].
        dampery: the same, y [N.s/m].

    Returns:
        (muscle, motors, clay, damper of the hand, throughput) [J].
    """
    vx = 0.5 * (v0x + v1x)
    vy = 0.5 * (v0y + v1y)
    muscle = H * (k[5] * vx + k[6] * vy)
    motors = H * (t1 * w1 + t2 * w2)
    clay = H * ((k[0] * v0x + k[1] * v1x + restx) * vx + (k[2] * v0y + k[3] * v1y + resty) * vy)
    hand = both_axes(H * damperx, H * dampery, vx * vx, vy * vy)
    return muscle, motors, clay, hand, abs(muscle) + abs(motors)
