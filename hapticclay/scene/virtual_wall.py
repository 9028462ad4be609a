"""A virtual wall on a bare device: one axis, sampled, without servo and compensator."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Annotated, Literal

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real, choice, number
from ..fields import make_part
from ..formulas.constants import B_MAX
from ..model.arm import Arm
from ..model.hardware import Hardware
from ..model.operator import NO_HAND, Operator
from ..model.sampled_controller import Controller
from ..model.signals import Signal
from ..model.spring import STIFFNESS_MAX
from .changes import nested
from .files import naming_file, read_settings, write_part
from .scenario import Scenario

LEVER = 0.24  # [m] link 1, which is the device: its motions are much smaller
STRONG = (1e6, 1e6)  # [N.m] motors that no wall saturates
UPRIGHT = 0.5 * math.pi  # [rad] joint 1 where x = 0
WALL_SCHEMA, WALL_SCHEMA_0_2 = "hapticclay-wall-2", "hapticclay-wall-1"
SAMPLE_STEPS = 8  # engine steps per sample: the error of a step is far below that of the hold
MASS_MAX = 1e6  # [kg]


@part("device.")
class Device:
    """A bare device of one axis: a mass behind a physical damper and Coulomb friction.

    Attributes:
        mass: that the hand moves [kg], 1e-4 to 1e4.
        damper: physical damping b [N.s/m], 0 to 1e9.
        friction: Coulomb friction fc [N], 0 to 1e6.
        quantum: of the position that the encoder reads, Delta [m], 0 (exact) to 1e-2.
    """

    mass: Annotated[Real, Bound(1e-4, 1e4, "kg")] = 0.1
    damper: Annotated[Real, Bound(0.0, B_MAX, "N.s/m")] = 0.0
    friction: Annotated[Real, Bound(0.0, 1e6, "N")] = 0.0
    quantum: Annotated[Real, Bound(0.0, 1e-2, "m")] = 0.0


@part("wall.")
class VirtualWall:
    """A virtual spring, damper and mass, rendered by the motor of a bare device every Ts.

    The position is sampled; velocity and acceleration come from it as `velocity` and `window` say;
    the force -(K x + B v + M a), `delay` late, is held for a sample.

    Attributes:
        K: virtual stiffness [N/m], 0 to 1e9.
        B: virtual damping [N.s/m], -1e9 to 1e9.
        M: virtual mass [kg], -1e6 to 1e6; the acceleration is the difference of two velocities as
            they are measured.
        device: what renders it.
        operator: the arm at the handle; None for no hand (Th = 0).
        Ts: control sample [s], 1e-6 to 1.
        delay: from a sample to the force computed from it [s], 0 to 100 Ts.
        velocity: "difference" of measured positions, or "exact" (a tachometer).
        velocity_window: samples that the difference spans, 1 to 10000.
        velocity_filter: first-order low-pass behind the difference [Hz]; None for none.
        unilateral: whether the wall has a surface at x = 0, pushes where x > 0 and never pulls;
            else it acts everywhere and the loop is linear.
    """

    K: Annotated[Real, Bound(0.0, STIFFNESS_MAX, "N/m")] = 0.0
    B: Annotated[Real, Bound(-B_MAX, B_MAX, "N.s/m")] = 0.0
    M: Annotated[Real, Bound(-MASS_MAX, MASS_MAX, "kg")] = 0.0
    device: Device = Device()
    operator: Operator | None = None
    Ts: Annotated[Real, Bound(1e-6, 1.0, "s")] = 1e-3
    delay: Annotated[Real, Bound(0.0, 1.0, "s")] = 0.0
    velocity: Literal["difference", "exact"] = "difference"
    velocity_window: Annotated[int, Bound(1, 10_000)] = 1
    velocity_filter: Annotated[Real | None, Bound(0.0, 1e6, "Hz", above=True)] = None
    unilateral: bool = False

    def __post_init__(self):
        number("wall.delay", self.delay, 0.0, 100.0 * self.Ts, unit="s")
        if self.velocity == "exact" and (
            self.velocity_filter is not None or self.velocity_window != 1
        ):
            bound = "must be 'difference' for a window or a filter"
            raise ParameterError("wall.velocity", self.velocity, bound)

    @classmethod
    @checked
    def load(cls, path: str | os.PathLike[str]) -> VirtualWall:
        """Reads a wall from a file: fields by name, as in `device.mass = 0.1`, `Ts = "1 ms"`.

        Args:
            path: the file, .toml or .json.

        Raises:
            ParameterError: the file cannot be read, or a field was refused.
        """
        with naming_file(path, "wall"):
            data = read_settings(path, "wall")
            del data["name"]
            choice("schema", data.pop("schema", WALL_SCHEMA), (WALL_SCHEMA, WALL_SCHEMA_0_2))
            return make_part(cls, nested(data))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the fields that differ from the defaults.

        Args:
            path: the file, .toml or .json.

        Returns:
            The file.

        Raises:
            ParameterError: it cannot be written.
        """
        return write_part(path, {"schema": WALL_SCHEMA}, self, "wall")

    @property
    def hand(self) -> Operator:
        """The operator's arm, or one of zeros for None."""
        return self.operator or NO_HAND

    def scenario(
        self,
        t_max: float,
        *,
        push: float = 0.0,
        start: float = 0.0,
        muscle: Signal | None = None,
        steps: int = SAMPLE_STEPS,
    ) -> Scenario:
        """Makes a scenario: link 1 of an arm is the device, the wall a sampled controller.

        A motion of 1 cm deviates from a straight line by 3 parts in 1e4 (the square of x over twice
        LEVER squared).

        Args:
            t_max: length of the run [s].
            push: velocity at the start [m/s].
            start: position at the start [m].
            muscle: force of the operator on x over time [N]; None for none.
            steps: engine steps per sample, such that dt = Ts/steps lies within 1e-6 to 0.02 s.
        """
        d, hand, lever, counts = self.device, self.hand, LEVER, None
        if d.quantum:
            counts = 4 * max(1, round(0.5 * math.pi * LEVER / d.quantum))  # x = 0 is one of them
            lever = counts * d.quantum / (2.0 * math.pi)
        differs = self.velocity == "difference"
        damped = Operator(hand.mass, hand.damper + d.damper, hand.spring)
        return Scenario(
            name="virtual wall",
            gain=(0.0, 0.0),
            force=(0.0, 0.0),
            operator=None if damped == NO_HAND else damped,
            dt=self.Ts / steps,
            Ts=self.Ts,
            t_max=t_max,
            length=None,
            start=(start, 0.0),
            velocity=(push, 0.0),
            origin=(lever, lever),
            torque_limit=STRONG,
            control="sampled",
            muscle=muscle,
            stop_when_unstable=False,
            hardware=Hardware(
                encoder=counts,
                velocity=self.velocity,
                velocity_window=self.velocity_window if differs else 1,
                velocity_filter=self.velocity_filter if differs else None,
                delay=self.delay,
                friction=(d.friction * lever, 0.0),
            ),
            arm=Arm(lever, lever, d.mass * lever * lever, d.mass * lever * lever),
            controller=Controller(
                wall_law,
                state=(0.0, 0.0),
                params=(self.K, self.B, self.M, lever, self.Ts, float(self.unilateral)),
            ),
        )


def wall_law(t, q, qd, fh, state, params):
    """Law of a virtual wall for a `Controller`: torque of joint 1, which moves the handle in x."""
    K, B, M, lever, Ts, surface = params
    x, v = lever * (UPRIGHT - q[0]), -lever * qd[0]
    f = K * x + B * v + M * state[1] * (v - state[0]) / Ts
    if surface > 0.0 and (x <= 0.0 or f <= 0.0):
        f = 0.0
    return (lever * f, 0.0), (v, 1.0)
