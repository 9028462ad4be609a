"""The stiffest wall that an arm from a file renders at its handle."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import JointPD, compensated
from ..arms.mechanism import STILL, Linear
from ..arms.mjcf_arm import MjcfArm
from ..errors import Bound, ParameterError, Real
from ..model.operator import NO_HAND, Operator
from ..results import Result, Tables
from . import joint_changes
from .client_loop import Delay, Sample, with_hand
from .held_words import hand_words
from .joint_changes import Edge, slopes
from .joint_families import Circle, Family, Limit
from .joint_gains import IGNORED, SMALL, gravity_words, joint_loop
from .joint_loop import JointLoop, even_grid, resonant_grid, timing_words

AXES = ("x", "y", "z")
DAMPINGS = (0.01, 0.1, 1.0, 10.0)  # [N.m.s/rad] of joints that are tried
LINE = 40  # dampings of the line of limits
MOST_B = 2.2  # of mass/(Ts + delay): no wall is stable at more damping
Axis = Literal["x", "y", "z"]
RATES = {"exact": "exact rates", "difference": "rates by difference"}


@named
@dataclass(frozen=True, repr=False, eq=False)
class WallLimit(Result):
    """The stiffest wall at the handle of an arm, along one axis of the world.

    Attributes:
        names: joints, shape (n,).
        axis: axis of the wall.
        K: largest stable stiffness [N/m]; inf for no limit, 0 or NaN if none is stable.
        low: least stable stiffness [N/m], mostly 0.
        frequency: frequency of the buzz there [Hz].
        mass: mass of arm and hand along the axis, as a push on the handle meets it [kg].
        B: damping of the wall [N.s/m].
        Ts: control sample [s].
        delay: from a sample to its torques [s].
        K_change: change of K with rotor inertia and damping of each joint
            [N/m/(kg.m^2), 1/(m^2.s)], shape (n, 2).
        K_per_delay: change of K with the delay [N/m/s].
        line_B: dampings from 0 to that at which no wall is stable [N.s/m].
        line_K: largest stable stiffness at them [N/m]: the Z-width of the arm along the axis.
        assumed: what the verdict rests on, and what it leaves out, a sentence each.
        cause: why no wall is stable, and with what one would be; empty if one is.
    """

    drawn_by = "hapticclay.views.joint_plots:wall_plot"
    written_as = "wall"
    printed = {"wall": ("axis", "largest K [N/m]", "least K [N/m]", "buzz [Hz]", "mass [kg]")}

    def remarks(self) -> Sequence[str]:
        """What the verdict rests on."""
        return [self.headline(), *self.assumed]

    names: tuple[str, ...]
    axis: str
    K: float
    low: float
    frequency: float
    mass: float
    B: float
    Ts: float
    delay: float
    K_change: np.ndarray
    K_per_delay: float
    line_B: np.ndarray
    line_K: np.ndarray
    assumed: tuple[str, ...] = ()
    cause: str = ""

    def headline(self) -> str:
        """The limit in one line."""
        at = f"wall along {self.axis} at {timing_words(self.Ts, self.delay)}, B = {self.B:g} N.s/m"
        return f"{at}: {self.cause or self._room()}"

    def _room(self) -> str:
        """Stable stiffness in words."""
        mass = f"{self.mass:.3g} kg at the handle"
        if math.isinf(self.K):
            least = f"of {self.low:.4g} N/m or more" if self.low > 0.0 else "of any stiffness"
            return f"stable {least} ({mass})"
        least = f"{self.low:.4g} to" if self.low > 0.0 else "up to"
        return f"{least} {self.K:.4g} N/m ({self.frequency:.3g} Hz, {mass})"

    def tables(self) -> Tables:
        """The limit, and what is felt along the axis."""
        row = {
            "axis": self.axis,
            "largest K [N/m]": self.K,
            "least K [N/m]": self.low,
            "buzz [Hz]": self.frequency,
            "mass [kg]": self.mass,
            "B [N.s/m]": self.B,
            "Ts [s]": self.Ts,
            "delay [s]": self.delay,
            "largest K per delay [N/m/s]": self.K_per_delay,
        }
        line: dict[str, Any] = {"B [N.s/m]": self.line_B, "largest K [N/m]": self.line_K}
        moves: dict[str, Any] = {
            "joint": self.names,
            "largest K per rotor inertia [N/m/(kg.m^2)]": self.K_change[:, 0],
            "largest K per damping [1/(m^2.s)]": self.K_change[:, 1],
        }
        wall = {name: [x] for name, x in row.items()}
        return {"wall": wall, "sensitivity": moves, "line": line}


@checked
def wall_limit(
    arm: MjcfArm,
    axis: Axis,
    B: Annotated[Real, Bound(0.0, 1e6, "N.s/m")],
    operator: Operator | None,
    Ts: Sample,
    delay: Delay = 0.0,
    velocity: Literal["exact", "difference"] = "exact",
) -> WallLimit:
    """Exact limit of the stiffness of a wall at the handle of an arm, at its pose.

    The wall pulls with -(K x + B v) along the axis, by torques J' f of the joints, from x = J q and
    v = J w at the samples. The hand acts at the handle along all axes.

    Args:
        arm: the arm at its pose; it has a handle.
        axis: axis of the world along which the wall pushes.
        B: damping of the wall [N.s/m], 0 to 1e6.
        operator: the hand; None for none.
        Ts: control sample [s], 1e-6 to 1.
        delay: from a sample to the torques computed from it [s], 0 to 10.
        velocity: how the rate of the joints is had.

    Raises:
        ParameterError: the arm has no handle, the handle cannot move along the axis, or a value is
            out of its bounds.
    """
    arm.check_handle()
    linear = with_hand(arm.linear(), operator or NO_HAND)
    along = linear.jacobian[AXES.index(axis)]
    if not np.abs(along).max() > STILL:
        raise ParameterError("axis", axis, "must be one along which the handle can move")
    none = (0.0,) * len(arm.names)
    law = JointPD(none, none, velocity=velocity)
    feeds = compensated(arm, law)
    square = np.outer(along, along)

    def rendered(K: float, **changes: Any) -> JointLoop:
        now = {"linear": linear, "law": law, "Ts": Ts, "delay": delay} | changes
        return joint_loop(**now, compensated=feeds).feeding(K * square, B * square)

    loop = joint_loop(linear, law, Ts, delay, feeds)
    mass = float(1.0 / (along @ np.linalg.solve(linear.inertia, along)))
    walls = Line(loop, along)
    limit = walls.limit(B)
    over = [x for numbers in joint_changes.numbers(linear, delay, Ts) for x in numbers]
    *by_arm, by_delay = slopes(Edge(rendered, *limit.upper, 1.0), over).tolist()
    line_B = np.linspace(0.0, max(MOST_B * mass / (Ts + delay), 1.2 * B), LINE)
    line_K = np.array([walls.limit(b).high for b in line_B.tolist()])
    return WallLimit(
        arm.names,
        axis,
        limit.high,
        limit.low,
        limit.frequency(Ts),
        mass,
        B,
        Ts,
        delay,
        np.array(by_arm).reshape(2, -1).T,
        by_delay,
        line_B,
        np.nan_to_num(line_K, nan=0.0, posinf=math.inf),
        (
            *arm.notes,
            gravity_words(feeds),
            f"{SMALL}, the wall never left; {hand_words(operator)} at the handle",
            f"the motors render the wall alone, from {RATES[velocity]}: no gains of the joints act",
            IGNORED,
        ),
        "" if limit.high > 0.0 else _cause(rendered, linear, walls, B),
    )


def _cause(rendered: Callable[..., JointLoop], linear: Linear, walls: Line, B: float) -> str:
    """Why no wall is stable, and with which damping of wall or joints one would be."""
    loop = walls.loop
    if loop.stable():
        why = "nothing damps it" if not B else f"B = {B:g} N.s/m is too much"
    else:
        bare = "" if linear.damping.any() else "without damping in its joints "
        held = ", under gravity that is fed forward and held" if loop.position.any() else ""
        with_B = loop.feeding(0.0 * walls.square, B * walls.square)
        growth = min(loop.growth, with_B.growth) / loop.Ts
        why = f"{bare}the arm grows by itself, by {growth:.3g} 1/s{held}"
    return f"no wall is stable: {why}{_damped_words(rendered, linear, walls, B)}"


def _damped_words(rendered: Callable[..., JointLoop], linear: Linear, walls: Line, B: float) -> str:
    """The first wall among lower dampings of the wall, then higher ones of the joints, in words."""
    for lower in (0.5 * B, 0.25 * B, 0.1 * B) if B else ():
        K = walls.limit(lower).high
        if K > 0.0:
            return f"; with B = {lower:g} N.s/m {_up_to(K)}"
    none = 0.0 * linear.damping
    for more in DAMPINGS:
        damped = linear._replace(damping=linear.damping + more * np.eye(len(none)))
        K = (
            Line(rendered(0.0, linear=damped).feeding(none, -B * walls.square), walls.along)
            .limit(B)
            .high
        )
        if K > 0.0:
            return f"; with {more:g} N.m.s/rad of damping more in each joint {_up_to(K)}"
    return ""


def _up_to(K: float) -> str:
    return "any stiffness" if math.isinf(K) else f"up to {K:.4g} N/m"


class Line:
    """Walls of any damping along a line at the handle of an arm.

    Attributes:
        loop: the arm without a wall.
        along: the Jacobian's row along the line, shape (n,).
        square: torques of the joints per joint motion, of a unit stiffness along it, shape (n, n).
    """

    def __init__(self, loop: JointLoop, along: np.ndarray):
        self.loop, self.along = loop, along
        self.square, self._even = np.outer(along, along), even_grid(loop)
        self._at_even = self.felt(self._even)

    def felt(self, angles: np.ndarray) -> np.ndarray:
        """Position and measured rate per force, all along the line, without a wall: (2, m)."""
        return np.array([self.along @ x @ self.along for x in self.loop.responses(angles)])

    def felt_near(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Angles of a search, those given among them, and what is felt there."""
        every, first = np.unique(np.concatenate([self._even, angles]), return_index=True)
        return every, np.hstack([self._at_even, self.felt(angles)])[:, first]

    def limit(self, B: float) -> Limit:
        """Stable stiffness of a wall with damping B [N/m]."""
        nothing = 0.0 * self.square
        damped = self.loop.feeding(nothing, B * self.square)

        def stiffer(K: float) -> JointLoop:
            return damped.feeding(K * self.square, nothing)

        one = np.ones((1, 1))
        return Family(_Damped(self, damped, B), "position", one, one, 0.0, stiffer).limit()


class _Damped(Circle):
    """Responses along a line to forces along it, with a damping there.

    The damping closes a loop of rank one: a response h becomes h/(1 + B v), v the rate's.
    """

    def __init__(self, line: Line, loop: JointLoop, B: float):
        super().__init__(loop)
        self._line, self._B = line, B

    @cached_property
    def _near(self) -> tuple[np.ndarray, np.ndarray]:
        return self._line.felt_near(resonant_grid(self.loop))

    @cached_property
    def angles(self) -> np.ndarray:
        return self._near[0]

    def _computed(self, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q, v = self._near[1] if angles is self.angles else self._line.felt(angles)
        closed = 1.0 / (1.0 + self._B * v)
        return (q * closed)[:, None, None], (v * closed)[:, None, None]

    def at_rest(self, of: str) -> np.ndarray:
        along = self._line.along
        return np.array([[along @ super().at_rest(of) @ along]])
