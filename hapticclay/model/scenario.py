"""Every printed number once, with its equation, and the frozen records that carry them.

Source: M.-G. Her, K.-S. Hsu, T.-S. Lan, M. Karkoub, "Haptic Direct-Drive Robot Control Scheme
in Virtual Reality", J. Intelligent and Robotic Systems 35 (2002) 247-264. SI units throughout;
axes are always ordered (x, y).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import ParameterError, choice, flag, number, numbers_of, pair
from .clay import Clay
from .constants import GAIN, L1, L2, ORIGIN, PATH_LENGTH, TORQUE_LIMIT, TS
from .hardware import Interface
from .operator import Operator
from .signals import Multisine

INTEGRATORS = ("fast", "accurate")
CONTROLS = ("continuous", "sampled")
RENDERS = ("held", "implicit")


@dataclass(frozen=True)
class Scenario:
    """One run, complete: simulate(scenario) needs nothing else. Change it with dataclasses.replace.

    Attributes:
        name: label used in files and plots.
        clay: the virtual clay; None for free space.
        gain: compensator gain K on each axis, C = K/(s^2 + 10 s); 0 turns the compensator off.
        force: the operator's muscle force uh on each axis [N], its constant part.
        muscle: the part of uh that varies [N]; None for none.
        command: displacement added to the compensator's output [m], counted from t = 0: the multisine less its value
            there, so that the run starts without a jump; None for none.
        operator: impedance Th of the operator's arm; None for a pure force (Th = 0).
        shaping: True lets the servo shape the handle's inertia, so that Sh holds at every pose.
        dt: physics and control step [s].
        t_max: the run ends then [s] ...
        length: ... or when p_x reaches this [m]; None to run for t_max.
        start: handle position p at t = 0 [m].
        velocity: of the handle at t = 0 [m/s]; compensator and servo as if it had moved so for long.
        stop: the run ends when an axis is judged unstable; False lets it go on against the torque limits.
        origin: world position of p = 0 [m].
        torque_limit: of the shoulder and elbow motor [N.m].
        integrator: "fast", second order, one engine step a sample, any stiffness; or "accurate", fourth
            order, the controller's states integrated by the engine with the arm's, slower.
        control: "continuous", the paper's analysis: the controller is part of the differential equation;
            or "sampled", the paper's hardware: measured, computed and held every Ts.
        Ts: control sample [s], a whole multiple of dt; None for dt.
        render: where control is sampled, the clay is "held" (its force computed from the sample and held by
            the motors) or "implicit" (physical, there all the time).
        interface: the hardware of a sampled loop; None for an ideal one.
    """

    name: str = "free"
    clay: Clay | None = None
    gain: tuple[float, float] = GAIN
    force: tuple[float, float] = (1.0, 0.0)
    operator: Operator | None = None
    shaping: bool = False
    dt: float = TS
    t_max: float = 60.0
    length: float | None = PATH_LENGTH
    start: tuple[float, float] = (0.0, 0.0)
    velocity: tuple[float, float] = (0.0, 0.0)
    origin: tuple[float, float] = ORIGIN
    torque_limit: tuple[float, float] = TORQUE_LIMIT
    integrator: str = "fast"
    control: str = "continuous"
    Ts: float | None = None
    render: str = "held"
    muscle: Multisine | None = None
    command: Multisine | None = None
    stop: bool = True
    interface: Interface | None = None

    def __post_init__(self):
        def put(field, value):
            object.__setattr__(self, field, value)

        if not isinstance(self.name, str) or not self.name:
            raise ParameterError("name", self.name, "must be a non-empty string")
        if self.clay is not None and not isinstance(self.clay, Clay):
            raise ParameterError("clay", self.clay, "must be a Clay or None")
        if self.operator is not None and not isinstance(self.operator, Operator):
            raise ParameterError("operator", self.operator, "must be an Operator or None")
        for field in ("muscle", "command"):
            if not isinstance(getattr(self, field), Multisine | None):
                raise ParameterError(field, getattr(self, field), "must be a Multisine or None")
        flag("shaping", self.shaping)
        flag("stop", self.stop)
        put("gain", pair("gain", self.gain, 0.0, 1e6))
        put("force", pair("force", self.force, -1e6, 1e6, unit="N"))
        choice("integrator", self.integrator, INTEGRATORS)
        choice("control", self.control, CONTROLS)
        choice("render", self.render, RENDERS)
        if self.control == "sampled" and self.integrator != "fast":
            raise ParameterError(
                "integrator", self.integrator, "must be 'fast' where control is 'sampled'"
            )
        put("dt", number("dt", self.dt, 1e-6, 0.02, unit="s"))
        if self.Ts is not None:
            put("Ts", number("Ts", self.Ts, self.dt, 1.0, unit="s"))
            if self.control != "sampled":
                raise ParameterError("Ts", self.Ts, "must be None unless control is 'sampled'")
            if abs(self.Ts / self.dt - round(self.Ts / self.dt)) > 1e-6:
                raise ParameterError(
                    "Ts", self.Ts, f"must be a whole multiple of dt = {self.dt:g} s"
                )
        self._check_interface()
        put("t_max", number("t_max", self.t_max, 0.0, 1e5, above=True, unit="s"))
        put("start", pair("start", self.start, unit="m"))
        put("velocity", pair("velocity", self.velocity, -10.0, 10.0, unit="m/s"))
        put("origin", pair("origin", self.origin, unit="m"))
        limit = numbers_of(
            "torque_limit",
            self.torque_limit,
            ("shoulder", "elbow"),
            0.0,
            1e6,
            above=True,
            unit="N.m",
        )
        put("torque_limit", limit)
        self._check_reach("start", self.start)
        if self.length is not None:
            put("length", number("length", self.length, -10.0, 10.0, unit="m"))
            if self.length <= self.start[0]:
                raise ParameterError(
                    "length", self.length, f"must lie ahead of start x = {self.start[0]:g} m"
                )
            self._check_reach("length", (self.length, self.start[1]))

    def _check_interface(self) -> None:
        given, Ts = self.interface, self.Ts or self.dt
        if given is None:
            return
        if not isinstance(given, Interface):
            raise ParameterError("interface", given, "must be an Interface or None")
        if self.control != "sampled":
            raise ParameterError("interface", given, "must be None unless control is 'sampled'")
        if (given.passivity or given.coupling) and self.render != "held":
            raise ParameterError(
                "render", self.render, "must be 'held' for a passivity controller or a coupling"
            )
        number("interface.jitter", given.jitter, 0.0, 0.28 * Ts, unit="s")
        number("interface.delay", given.delay, 0.0, 100.0 * Ts, unit="s")

    def _check_reach(self, field: str, p: tuple[float, float]) -> None:
        """Refuses p, or a straight path from start to p, beyond the reach or too near the shoulder."""
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


REACH_MARGIN = 1e-3  # [m] short of the stretched and the folded arm, where no force can be rendered
