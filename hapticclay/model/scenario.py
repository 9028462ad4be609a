"""Every printed number once, with its equation, and the frozen records that carry them.

Source: M.-G. Her, K.-S. Hsu, T.-S. Lan, M. Karkoub, "Haptic Direct-Drive Robot Control Scheme
in Virtual Reality", J. Intelligent and Robotic Systems 35 (2002) 247-264. SI units throughout;
axes are always ordered (x, y).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from ..errors import ParameterError, choice, flag, integer, number, numbers_of, pair
from .hardware import Interface

AXES = ("x", "y")
INTEGRATORS = ("fast", "accurate")
CONTROLS = ("continuous", "sampled")
RENDERS = ("held", "implicit")


class SecondOrder(NamedTuple):
    """gain / (s^2 + damping s + stiffness); damping in 1/s, stiffness in 1/s^2."""

    gain: float
    damping: float
    stiffness: float


CM = 1e-2  # the paper prints lengths in centimetres

L1 = 0.24  # link lengths [m], Sec. 4
L2 = 0.35
TS = 0.36e-3  # sampling period [s], Sec. 4

G = (SecondOrder(910.19, 41.8, 910.19), SecondOrder(765.5, 30.3, 765.5))  # [m/m], Eqs. 15, 16
S = (SecondOrder(79.19 * CM, 41.1, 432.0), SecondOrder(13.1 * CM, 32.4, 492.46))  # [m/N], Eqs. 17, 18

C_POLE = 10.0  # C = K/(s^2 + 10 s) [m/N], Eqs. 20, 22, 27: virtual mass 1/K, damper 10/K
B_CONSTANT = 90.0  # clay of the constant cut [N.s/m], Eq. 21
CLAY_X = (0.05, 0.15)  # the clay lies 5 cm ahead of the tool and is 10 cm long [m], Sec. 4.1
PATH_LENGTH = 0.20  # the records of Fig. 8 run to 20 cm [m]
B_VARIABLE = (50.0, 100.0)  # clay of the variable cut, before and after its border [N.s/m], Eqs. 23-26
BORDER = 0.05  # that border, on each axis by its own coordinate [m], Sec. 4.2
GROWTH = 30.0  # "(100 + 30t)" in x: we take t in s since entry [N.s/m per s], Sec. 4.2
GROWTH_EQ25 = 0.15  # "(100 + 0.15t)", t not said: per second or per sample, Eq. 25
COUNTERWEIGHT = (1.0, 45.0)  # force of the variable cut [N] and its angle to both axes [degrees], Sec. 4.2
GAINS_FIG11 = (2.0, 3.0, 25.0)  # K of Fig. 11: 2 in its caption, 3 in the text, 25 in both
B_STABILITY = 100.0  # clay of the stability test [N.s/m], Eq. 28
GAIN_LIMIT_PRINTED = 5.0  # "should not exceed 5C", Sec. 4.3

# Not printed. The middle of the 20 cm path is put at the nominal pose (elbow square, handle at
# (L2, L1)): 20 cm of +x travel from the nominal pose itself would leave the reach of 0.59 m.
ORIGIN = (0.25, 0.24)  # (L2 - PATH_LENGTH / 2, L1)
NOMINAL = (L2, L1)  # handle at the nominal pose: link 1 along y, link 2 along x
ORIGIN_VARIABLE = (0.30, 0.19)  # NOMINAL is the middle of a 10 cm square that the variable cut begins in the corner of
GAIN = (1.0, 0.5)  # K = 1 on y is unstable in the printed model for 62 < b < 3900 N.s/m
TORQUE_LIMIT = (40.0, 40.0)  # [N.m], ours: the class of direct-drive motors that carry such inertias

B_MAX = 1e9  # [N.s/m]; the engine refuses controls above 1e10


@dataclass(frozen=True)
class Operator:
    """The arm of the person at the handle: Th = mass s^2 + damper s + spring (Eq. 19).

    Attributes:
        mass: kg. damper: N.s/m. spring: N/m, pulling towards p = 0.
    """

    mass: float = 0.25
    damper: float = 2.0
    spring: float = 6.0

    def __post_init__(self):
        for field, high, unit in (("mass", 1e3, "kg"), ("damper", B_MAX, "N.s/m"), ("spring", 1e9, "N/m")):
            value = number(f"operator.{field}", getattr(self, field), 0.0, high, unit=unit)
            object.__setattr__(self, field, value)


NO_HAND = Operator(0.0, 0.0, 0.0)  # Th = 0


@dataclass(frozen=True)
class Profile:
    """Damping b of one axis as a piecewise constant function of one coordinate.

    Attributes:
        edges: borders [m], ascending, shape (n,).
        values: b in each region [N.s/m], shape (n + 1,); region i lies between edges i - 1 and i.
        along: coordinate that decides, "x" or "y".
        growth: rate at which b of each region grows from when the handle first enters it
            [N.s/m per s], shape (n + 1,); empty for none (Sec. 4.2).
    """

    edges: tuple[float, ...]
    values: tuple[float, ...]
    along: str = "x"
    growth: tuple[float, ...] = ()

    def __post_init__(self):
        edges = numbers_of("clay.edges", self.edges, [str(i) for i in range(_len("clay.edges", self.edges))], unit="m")
        values = numbers_of(
            "clay.values", self.values, [str(i) for i in range(len(edges) + 1)], 0.0, B_MAX, unit="N.s/m"
        )
        names = [str(i) for i in range(len(values))] if _len("clay.growth", self.growth) else []
        growth = numbers_of("clay.growth", self.growth, names, 0.0, B_MAX, unit="N.s/m per s")
        if any(b <= a for a, b in zip(edges, edges[1:], strict=False)):
            raise ParameterError("clay.edges", self.edges, "must be strictly ascending")
        choice("clay.along", self.along, AXES)
        object.__setattr__(self, "edges", edges)
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "growth", growth if any(growth) else ())


def _len(field: str, value: object) -> int:
    try:
        return len(value)  # type: ignore[arg-type]
    except TypeError:
        raise ParameterError(field, value, "must be a sequence of numbers") from None


@dataclass(frozen=True)
class Clay:
    """Viscous clay: fe = b(p) v on each axis (Eqs. 3, 4 with m = k = 0)."""

    x: Profile
    y: Profile

    def __post_init__(self):
        for field in AXES:
            if not isinstance(getattr(self, field), Profile):
                raise ParameterError(f"clay.{field}", getattr(self, field), "must be a Profile")


@dataclass(frozen=True)
class Multisine:
    """A periodic signal of random phases: sum of cosines at multiples of 1/period between low and high.

    All lines have one amplitude; the phases follow from the seed (Pintelon, Schoukens, System Identification,
    2012, sec. 2.3).

    Attributes:
        rms: root mean square on each axis, in the unit of what the signal adds to.
        low, high: band [Hz]. period: [s].
        lines: number of lines, spread evenly over the logarithm of frequency; None for every multiple.
        seed: of the phases.
    """

    rms: tuple[float, float] = (1.0, 0.0)
    low: float = 0.1
    high: float = 2.0
    period: float = 20.0
    lines: int | None = None
    seed: int = 0

    def __post_init__(self):
        put = lambda field, value: object.__setattr__(self, field, value)  # noqa: E731
        put("rms", pair("multisine.rms", self.rms, 0.0, 1e6))
        put("period", number("multisine.period", self.period, 1e-3, 1e5, unit="s"))
        put("low", number("multisine.low", self.low, 0.0, above=True, unit="Hz"))
        put("high", number("multisine.high", self.high, self.low, 1e6, unit="Hz"))
        put("seed", integer("multisine.seed", self.seed, 0, 2**32 - 1))
        most = math.floor(self.high * self.period + 1e-9) - math.ceil(self.low * self.period - 1e-9) + 1
        if not 1 <= most <= 100_000:
            bound = f"the band must hold 1 to 100000 multiples of 1/period = {1.0 / self.period:g} Hz, not {most}"
            raise ParameterError("multisine.high", self.high, bound)
        if self.lines is not None:
            put("lines", integer("multisine.lines", self.lines, 1, most))


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
            raise ParameterError("integrator", self.integrator, "must be 'fast' where control is 'sampled'")
        put("dt", number("dt", self.dt, 1e-6, 0.02, unit="s"))
        if self.Ts is not None:
            put("Ts", number("Ts", self.Ts, self.dt, 1.0, unit="s"))
            if self.control != "sampled":
                raise ParameterError("Ts", self.Ts, "must be None unless control is 'sampled'")
            if abs(self.Ts / self.dt - round(self.Ts / self.dt)) > 1e-6:
                raise ParameterError("Ts", self.Ts, f"must be a whole multiple of dt = {self.dt:g} s")
        self._check_interface()
        put("t_max", number("t_max", self.t_max, 0.0, 1e5, above=True, unit="s"))
        put("start", pair("start", self.start, unit="m"))
        put("velocity", pair("velocity", self.velocity, -10.0, 10.0, unit="m/s"))
        put("origin", pair("origin", self.origin, unit="m"))
        limit = numbers_of("torque_limit", self.torque_limit, ("shoulder", "elbow"), 0.0, 1e6, above=True, unit="N.m")
        put("torque_limit", limit)
        self._check_reach("start", self.start)
        if self.length is not None:
            put("length", number("length", self.length, -10.0, 10.0, unit="m"))
            if self.length <= self.start[0]:
                raise ParameterError("length", self.length, f"must lie ahead of start x = {self.start[0]:g} m")
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
            raise ParameterError("render", self.render, "must be 'held' for a passivity controller or a coupling")
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
