"""The frozen record of one run: scene, controller, person and how to step them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from ..errors import Bound, ParameterError, check_fields, number
from .clay import Clay
from .constants import GAIN, L1, L2, ORIGIN, PATH_LENGTH, TORQUE_LIMIT, TS
from .hardware import JOINTS, Interface
from .operator import Operator
from .signals import Multisine

REACH_MARGIN = 1e-3  # [m] short of the stretched and the folded arm, where no force can be rendered

# Types of the fields that experiments share with scenarios.
Force = Annotated[tuple[float, float], Bound(-1e6, 1e6, "N")]
Step = Annotated[float, Bound(1e-6, 0.02, "s")]
Duration = Annotated[float, Bound(0.0, 1e5, "s", above=True)]
Length = Annotated[float, Bound(-10.0, 10.0, "m")]
Position = Annotated[tuple[float, float], Bound(unit="m")]
TorqueLimit = Annotated[tuple[float, float], Bound(0.0, 1e6, "N.m", above=True, names=JOINTS)]
SamplePeriod = Annotated[float | None, Bound("dt", 1.0, "s")]
Integrator = Literal["fast", "accurate"]
Control = Literal["continuous", "sampled"]
Render = Literal["held", "implicit"]
RENDERS = get_args(Render)


@dataclass(frozen=True)
class Scenario:
    """One run, complete: simulate(scenario) needs nothing else.

    Change it with dataclasses.replace.

    Attributes:
        name: label used in files and plots.
        clay: the virtual clay; None for free space.
        gain: compensator gain K on each axis [1/kg], C = K/(s^2 + 10 s), 0 to 1e6; 0 turns the
            compensator off.
        force: constant part of the operator's muscle force uh on each axis [N].
        operator: impedance Th of the operator's arm; None for a pure force (Th = 0).
        shaping: whether the servo shapes the handle's inertia, so that Sh holds at every pose.
        dt: physics and control step [s], 1e-6 to 0.02.
        t_max: the run ends at this time [s], > 0, at most 1e5 ...
        length: ... or when p_x reaches this [m]; None to run for t_max.
        start: handle position p at t = 0 [m].
        velocity: handle velocity at t = 0 [m/s], -10 to 10; compensator and servo start as if the
            handle had long moved at it.
        origin: world position of p = 0 [m].
        torque_limit: largest torque of the shoulder and elbow motor [N.m], > 0.
        integrator: "fast", second order, one engine step a sample, any stiffness; or "accurate",
            fourth order, slower: Runge-Kutta, with the engine's acceleration at each stage.
        control: "continuous", the paper's analysis: the controller is part of the differential
            equation; or "sampled", the paper's hardware: measured, computed and held every Ts.
        Ts: control sample [s], a whole multiple of dt, at most 1; None for dt.
        render: where control is sampled, the clay is "held" (the motors hold its force, computed
            from the sample) or "implicit" (physical, there all the time).
        muscle: variable part of uh [N]; None for none.
        command: displacement added to the compensator's output [m]: the multisine less its value
            at t = 0, so that the run starts without a jump; None for none.
        stop: whether the run ends when an axis is judged unstable; False lets it go on against
            the torque limits.
        interface: hardware of a sampled loop; None for an ideal one.
    """

    name: str = "free"
    clay: Clay | None = None
    gain: Annotated[tuple[float, float], Bound(0.0, 1e6, "1/kg")] = GAIN
    force: Force = (1.0, 0.0)
    operator: Operator | None = None
    shaping: bool = False
    dt: Step = TS
    t_max: Duration = 60.0
    length: Annotated[float | None, Bound(-10.0, 10.0, "m")] = PATH_LENGTH
    start: Position = (0.0, 0.0)
    velocity: Annotated[tuple[float, float], Bound(-10.0, 10.0, "m/s")] = (0.0, 0.0)
    origin: Position = ORIGIN
    torque_limit: TorqueLimit = TORQUE_LIMIT
    integrator: Integrator = "fast"
    control: Control = "continuous"
    Ts: SamplePeriod = None
    render: Render = "held"
    muscle: Multisine | None = None
    command: Multisine | None = None
    stop: bool = True
    interface: Interface | None = None

    def __post_init__(self):
        check_fields(self)
        if self.control == "sampled" and self.integrator != "fast":
            raise ParameterError(
                "integrator", self.integrator, "must be 'fast' where control is 'sampled'"
            )
        if self.Ts is not None:
            if self.control != "sampled":
                raise ParameterError("Ts", self.Ts, "must be None unless control is 'sampled'")
            if abs(self.Ts / self.dt - round(self.Ts / self.dt)) > 1e-6:
                raise ParameterError(
                    "Ts", self.Ts, f"must be a whole multiple of dt = {self.dt:g} s"
                )
        self._check_interface()
        self._check_reach("start", self.start)
        if self.length is not None:
            if self.length <= self.start[0]:
                raise ParameterError(
                    "length", self.length, f"must lie ahead of start x = {self.start[0]:g} m"
                )
            self._check_reach("length", (self.length, self.start[1]))

    def _check_interface(self) -> None:
        given, Ts = self.interface, self.Ts or self.dt
        if given is None:
            return
        if self.control != "sampled":
            raise ParameterError("interface", given, "must be None unless control is 'sampled'")
        if (given.passivity or given.coupling) and self.render != "held":
            raise ParameterError(
                "render", self.render, "must be 'held' for a passivity controller or a coupling"
            )
        number("interface.jitter", given.jitter, 0.0, 0.28 * Ts, unit="s")
        number("interface.delay", given.delay, 0.0, 100.0 * Ts, unit="s")

    def _check_reach(self, field: str, p: tuple[float, float]) -> None:
        """Refuses p, or a straight path from start to p, out of the arm's reach."""
        x, y = self.origin[0] + p[0], self.origin[1] + p[1]
        r = math.hypot(x, y)
        if field == "length":
            x0 = self.origin[0] + self.start[0]
            if x0 < 0.0 < x:
                r = min(r, abs(y))
        low, high = abs(L2 - L1) + REACH_MARGIN, L1 + L2 - REACH_MARGIN
        if not low <= r <= high:
            raise ParameterError(
                field,
                getattr(self, field),
                f"unreachable: {r:.4g} m from the shoulder, must be {low:.4g} to {high:.4g} m "
                f"(origin {self.origin[0]:g}, {self.origin[1]:g} m)",
            )
