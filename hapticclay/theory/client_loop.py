"""The sampled loop of an arm, a hand at it, and a program that renders a wall through a port.

The handle moves in the plane: M p'' + D p' + S p = n f, with M the inertia of arm and hand at a
pose; or the joints of an arm from a file move, with J' n in the place of n. The program reads
position and velocity every Ts. Its force f = -(K n.p + B n.v) acts after `delay` and is held for
one Ts (zero-order hold). Between samples the motion is linear, so the loop is a matrix: exact for
small motions about the pose. The model has no friction, no torque limits and no wall surface.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Annotated

import numpy as np

from .. import matrices
from ..arguments import checked
from ..arms.joint_law import compensated
from ..arms.mechanism import STILL, Linear
from ..display import brief
from ..errors import Bound, ParameterError, Real, number
from ..model.operator import NO_HAND, Operator
from ..scene.scenario import Scenario
from . import linear_loop, roots
from .joint_loop import JointLoop

STIFFEST = 1e9  # [N/m] end of the search for a limit
SCANNED = 240  # values of K in the search, spaced evenly in log K
SOFTEST = 1e-3  # [N/m] start of the search
AT_REST = 1e-6  # modes this near to z = 1 are rigid motion of the handle, which may have no spring
ROUNDING = 1e-12  # of an eigenvalue
PERIODS = 199  # in the search for the longest one


@dataclass(frozen=True)
class Handle:
    """Arm and hand at a pose, as seen by the force of the wall.

    Attributes:
        inertia: inertia of arm and hand at the handle [kg], shape (2, 2).
        damping: damping of the hand [N.s/m], shape (2,).
        stiffness: stiffness of the hand [N/m], shape (2,).
        normal: unit normal of the wall, shape (2,).
    """

    def __repr__(self) -> str:
        return brief(self)

    inertia: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    normal: np.ndarray

    @classmethod
    @checked
    def of(
        cls,
        scenario: Scenario,
        place: Annotated[tuple[Real, Real], Bound(-10.0, 10.0, "m")] = (0.0, 0.0),
        normal: tuple[float, float] = (1.0, 0.0),
    ) -> Handle:
        """The handle of a scenario's arm and operator."""
        size = math.hypot(*normal)
        if not (size > 0.0 and math.isfinite(size)):
            raise ParameterError("normal", normal, "must have a direction")
        x, y = scenario.origin[0] + place[0], scenario.origin[1] + place[1]
        low, high = scenario.planar_arm.reach
        if not low < math.hypot(x, y) < high:
            raise ParameterError("place", place, "must lie within the reach of the arm")
        inertia = np.linalg.inv(linear_loop.mobility_at(scenario.planar_arm, x, y))
        mass, damping, stiffness = np.array([astuple(hand) for hand in scenario.hands]).T
        return cls(inertia + np.diag(mass), damping, stiffness, np.array(normal) / size)

    def loop(self, K: float, B: float, Ts: float, delay: float) -> JointLoop:
        """The loop with a wall."""
        along = np.outer(self.normal, self.normal)
        hand = np.diag(self.damping), np.diag(self.stiffness)
        return JointLoop(self.inertia, *hand, K * along, B * along, Ts, delay)

    @property
    def mass(self) -> float:
        """Mass of arm and hand along the normal [kg]."""
        return float(1.0 / (self.normal @ np.linalg.inv(self.inertia) @ self.normal))


def with_hand(linear: Linear, hand: Operator | Sequence[Operator]) -> Linear:
    """The arm with a hand at its handle: mass, damper and spring along x, y and z.

    Gravity, along z where the masses differ, acts on them, too: they are held as the arm's own
    weight is.
    """
    hands = [hand] * 3 if isinstance(hand, Operator) else hand
    J = linear.jacobian
    mass, damper, spring = (J.T @ (x[:, None] * J) for x in np.array([astuple(h) for h in hands]).T)
    weight = hands[-1].mass * linear.weight_stiffness
    return linear._replace(
        inertia=linear.inertia + mass,
        damping=linear.damping + damper,
        stiffness=linear.stiffness + spring,
        gravity_stiffness=linear.gravity_stiffness + weight,
    )


def with_hands_of(scenario: Scenario) -> Linear:
    """A scenario's arm from a file, at its pose, with the hand of each axis at its handle."""
    hands = dict(zip(scenario.axes, scenario.hands, strict=True))
    return with_hand(scenario.file_arm.linear(), [hands.get(axis, NO_HAND) for axis in "xyz"])


@dataclass(frozen=True)
class JointHandle:
    """Joints of an arm from a file at its pose, with a hand at the handle, as a wall moves them.

    Its weight is held all the time if gravity is compensated: the arm's own loop is far faster
    than that of a program.

    Attributes:
        inertia: inertia of joints and hand [kg.m^2], shape (n, n).
        damping: their damping [N.m.s/rad], shape (n, n).
        stiffness: their stiffness, with that of a weight that acts [N.m/rad], shape (n, n).
        along: way of the handle along the normal of the wall per joint position [m], shape (n,).
    """

    def __repr__(self) -> str:
        return brief(self)

    inertia: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    along: np.ndarray

    @classmethod
    @checked
    def of(cls, scenario: Scenario, normal: tuple[float, ...]) -> JointHandle:
        """The handle of a scenario's arm from a file, at its pose."""
        arm = scenario.file_arm
        linear = with_hands_of(scenario)
        stiffness = linear.stiffness
        if not compensated(arm, None):
            stiffness = stiffness + linear.gravity_stiffness
        rows = ["xyz".index(axis) for axis in scenario.axes]
        along = np.array(normal) / math.hypot(*normal) @ linear.jacobian[rows]
        if not np.abs(along).max() > STILL:
            raise ParameterError("normal", normal, "must be one along which the handle can move")
        return cls(linear.inertia, linear.damping, stiffness, along)

    def loop(self, K: float, B: float, Ts: float, delay: float) -> JointLoop:
        """The loop with a wall."""
        square = np.outer(self.along, self.along)
        return JointLoop(
            self.inertia, self.damping, self.stiffness, K * square, B * square, Ts, delay
        )

    @property
    def mass(self) -> float:
        """Mass of arm and hand along the normal [kg]."""
        return float(1.0 / (self.along @ np.linalg.solve(self.inertia, self.along)))


AnyHandle = Handle | JointHandle


def client_map(handle: AnyHandle, K: float, B: float, Ts: float, delay: float) -> np.ndarray:
    """State matrix of the sampled loop, x(k+1) = A x(k): position, velocity, delayed forces."""
    return handle.loop(K, B, Ts, delay).map()


def holds(handle: AnyHandle, K: float, B: float, Ts: float, delay: float) -> bool:
    """Whether the loop is stable: all modes but rigid motion lie within the unit circle."""
    return bool(_stable(client_map(handle, K, B, Ts, delay)))


def _stable(loops: np.ndarray) -> np.ndarray:
    """Whether maps of shape (..., n, n) are stable."""
    z = matrices.eigenvalues(loops)
    moving = np.where(np.abs(z - 1.0) > AT_REST, np.abs(z), 0.0)
    return moving.max(axis=-1) < 1.0 + ROUNDING


Sample = Annotated[Real, Bound(1e-6, 1.0, "s")]
Delay = Annotated[Real, Bound(0.0, 10.0, "s")]


@checked
def rendered_stiffness_limit(handle: AnyHandle, B: float, Ts: Sample, delay: Delay = 0.0) -> float:
    """Largest stable stiffness of a wall rendered by a program [N/m]."""
    (limit,) = rendered_stiffness_limits(handle, (B,), Ts, delay)
    return limit


@checked
def rendered_stiffness_limits(
    handle: AnyHandle, B: Sequence[float], Ts: Sample, delay: Delay = 0.0
) -> tuple[float, ...]:
    """Largest stable stiffness by damping of the wall: the Z-width of a program's loop."""
    dampings = np.array([number("B", b, -1e6, 1e6) for b in B])[:, None, None]
    free = client_map(handle, 0.0, 0.0, Ts, delay)  # the loop is linear in K and B
    by_K = client_map(handle, 1.0, 0.0, Ts, delay) - free
    by_B = client_map(handle, 0.0, 1.0, Ts, delay) - free
    soft = free + dampings * by_B

    def stable(which: np.ndarray, K: np.ndarray) -> np.ndarray:
        return _stable(soft[which] + K[:, None, None] * by_K)

    grid = np.geomspace(SOFTEST, STIFFEST, SCANNED)
    low, high = roots.first_failures(stable, len(soft), grid, 1e-9)
    return tuple(np.where(high < math.inf, low, math.inf).tolist())


@checked
def slowest_period(handle: AnyHandle, K: float, B: float, late: float, Ts: float) -> float:
    """Longest sampling period, up to which a wall rendered by a program is stable [s].

    The wall is stable at this and at every shorter period that is tested: 33 in each factor of ten.
    """
    grid = np.geomspace(1e-3 * Ts, 1e3 * Ts, PERIODS).tolist()

    def stable(period: float) -> bool:
        return holds(handle, K, B, period, late * period)

    low, high = roots.first_failure(stable, grid, rtol=1e-9)
    return low if high < math.inf else math.inf
