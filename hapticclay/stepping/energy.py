"""Where the energy of a run comes from and where it goes, kick by kick."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..model import arm
from ..model.operator import NO_HAND, Operator
from ..model.scenario import Scenario

HARDWARE_WORK = (
    "friction",
    "passivity_controller",
    "coupling",
)  # entries of an interface; the last two are part of motors


def stored_energy(
    th: Operator, r1: float, r2: float, p: Sequence[float], v: Sequence[float]
) -> tuple[float, float]:
    """Energy of the arm, and of mass and spring of the operator's arm.

    Args:
        th: the operator's arm.
        r1: rate of link 1 [rad/s].
        r2: absolute rate of link 2 [rad/s].
        p: handle position, (x, y) [m].
        v: handle velocity, (x, y) [m/s].

    Returns:
        (arm, operator) [J].
    """
    at_hand = 0.5 * (
        th.mass * (v[0] * v[0] + v[1] * v[1]) + th.spring * (p[0] * p[0] + p[1] * p[1])
    )
    return 0.5 * float(arm.I1 * r1 * r1 + arm.I2 * r2 * r2), float(at_hand)


def energy_balance(
    work: Sequence[float], first: tuple[float, float], last: tuple[float, float]
) -> dict[str, float]:
    """muscle + motors = clay + hand_damper + kinetic + hand_stored + residual [J].

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


def kick_work(H, k, restx, resty, v0x, v0y, v1x, v1y, t1, t2, w1, w2, damper):  # noqa: PLR0913  # compiled and inlined: plain numbers
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
        damper: of the operator's arm [N.s/m].

    Returns:
        (muscle, motors, clay, damper of the hand, throughput) [J].
    """
    vx = 0.5 * (v0x + v1x)
    vy = 0.5 * (v0y + v1y)
    muscle = H * (k[5] * vx + k[6] * vy)
    motors = H * (t1 * w1 + t2 * w2)
    clay = H * ((k[0] * v0x + k[1] * v1x + restx) * vx + (k[2] * v0y + k[3] * v1y + resty) * vy)
    hand = H * damper * (vx * vx + vy * vy)
    return muscle, motors, clay, hand, abs(muscle) + abs(motors)


class EnergyLedger:
    """Sums the work done in the kicks of a run: force times the mean of the velocities around it.

    The kinetic energy of the arm comes from the rates of the engine, so the balance also shows
    whether the engine did what the loop computed.

    Args:
        scenario: the scenario.
        extra: list that gets the forces of the hardware in each kick; None for an ideal loop.
    """

    def __init__(self, scenario: Scenario, extra: list[tuple[float, ...]] | None = None):
        self.scenario = scenario
        self.extra = extra  # of each kick, where there is an interface: see `_memo`
        self.memo = np.zeros(len(HARDWARE_WORK))
        self.work = np.zeros(5)  # muscle, motors, clay, hand's damper, throughput
        self.first: tuple[float, float] | None = None  # energy of arm and hand at the start
        self.last = (0.0, 0.0)

    def add(self, raw: np.ndarray, k: np.ndarray, rest: np.ndarray, H: np.ndarray) -> None:
        """Enters kicks.

        Args:
            raw: shape (14, n), as leapfrog.glide_constant keeps them.
            k: loop.step_inputs of each kick, shape (12, n) or (12, 1).
            rest: clay force beside its dampers [N], shape (2, n) or (2, 1).
            H: length of each kick [s], shape (n,) or (1,).
        """
        if not raw.shape[1]:
            return
        th = self.scenario.operator or NO_HAND
        q, p, before, after, tau = raw[0:2], raw[2:4], raw[4:6], raw[6:8], raw[10:12]
        v = 0.5 * (before + after)
        u = arm.jacobians(q[0], q[1])
        r1, r2 = arm.joint_velocity(v[0], v[1], u, 1.0)
        around = before[0], before[1], after[0], after[1]
        self.work += [
            x.sum()
            for x in kick_work(
                H, k, rest[0], rest[1], *around, tau[0], tau[1], r1, r2 - r1, th.damper
            )
        ]
        if self.extra is not None:
            self._memo(H, v, r1, r2)

        def held(v: np.ndarray, j: int) -> tuple[float, float]:
            r = arm.joint_velocity(v[0, j], v[1, j], [x[j] for x in u], 1.0)
            return stored_energy(th, r[0], r[1], p[:, j].tolist(), v[:, j].tolist())

        if self.first is None:
            self.first = held(before, 0)
        self.last = held(after, -1)

    def _memo(self, H: np.ndarray, v: np.ndarray, r1: np.ndarray, r2: np.ndarray) -> None:
        """Enters what an interface takes in each kick.

        Its extra row: torques of the friction [N.m], force added by the passivity controller [N],
        force of the coupling [N], velocity of its tool [m/s]; two axes each.
        """
        assert self.extra is not None
        e = np.array(self.extra[: v.shape[1]]).T
        self.extra.clear()
        friction = -H * (e[0] * r1 + e[1] * (r2 - r1))
        guard = H * (e[2:4] * v).sum(axis=0)
        coupling = H * (e[4:6] * (v - e[6:8])).sum(axis=0)
        self.memo += [x.sum() for x in (friction, guard, coupling)]

    def close(self) -> dict[str, float]:
        """The balance of all kicks entered."""
        out = energy_balance(self.work.tolist(), self.first or self.last, self.last)
        parts = self.scenario.interface
        if parts:
            used = (any(parts.friction), parts.passivity, parts.coupling is not None)
            out |= {
                name: float(x)
                for name, x, on in zip(HARDWARE_WORK, self.memo, used, strict=True)
                if on
            }
            out["residual"] -= out.get("friction", 0.0)
        return out
