"""The frozen record of one run: scene, controller, person and how to step them."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import JointPD, checked_law
from ..arms.joint_ranges import outside
from ..arms.mjcf_arm import MjcfArm
from ..display import html_table, one_line
from ..errors import Bound, ParameterError, Real, choice, number, numbers_of, quantity
from ..fields import JOINTS, check_fields, dotted_names, merged_values, no_field, values_of
from ..model import samples, shapes  # noqa: F401  # so that files and options know every Signal
from ..model.arm import PAPER, Arm
from ..model.clay import Clay
from ..model.compensator import PRINTED, Compensator
from ..model.constants import AXES, GAIN, ORIGIN, PATH_LENGTH, TORQUE_LIMIT, TS, each_axis
from ..model.controller import SERVO, Servo
from ..model.hardware import Hardware
from ..model.operator import NO_HAND, Operator, mobility_with
from ..model.sampled_controller import Controller
from ..model.signals import Signal
from ..model.support import check_scene
from .changes import check_added_hand, nested
from .files import naming_file, read_settings, write_part
from .text import scenario_rows

SERVO_STEP = 1.0  # radians of the servo's fastest mode in a step: stable below 2, and 4 % off at 1
MOST_JOINTS = 12  # of an arm from a file, in runs
SOFT = 1.0  # share of a handle's velocity that clay may take in a step of such an arm
WHOLE = 1e-6  # tolerance of Ts/dt from a whole number
REACH_MARGIN = 1e-3  # [m] short of the stretched and the folded arm, where no force can be rendered
FOLD_MARGIN = math.radians(1.001)  # of the elbow, likewise: a run ends at 1 degree (`monitor.FOLD`)

# Types of the fields that experiments share with scenarios.
Force = Annotated[tuple[Real, Real], Bound(-1e6, 1e6, "N")]
SpaceForce = Annotated[tuple[Real, Real, Real], Bound(-1e6, 1e6, "N", names=("x", "y", "z"))]
STEP_LEAST = 1e-6  # [s]
StepLength = Annotated[Real, Bound(STEP_LEAST, 0.02, "s")]
Duration = Annotated[Real, Bound(0.0, 1e5, "s", above=True)]
Length = Annotated[Real | None, Bound(-10.0, 10.0, "m")]
Position = Annotated[tuple[Real, Real], Bound(unit="m")]
TorqueLimit = Annotated[tuple[Real, Real], Bound(0.0, 1e6, "N.m", above=True, names=JOINTS)]
SamplePeriod = Annotated[Real | None, Bound("dt", 1.0, "s")]
Integrator = Literal["fast", "accurate"]
Control = Literal["continuous", "sampled"]
Render = Literal["held", "physical"]

FORCE = (1.0, 0.0)  # [N] of this object, as of the next, it is known that it was not given
CONTINUOUS: Any = "".join(("contin", "uous"))
SCENARIO_SCHEMA, SCENARIO_SCHEMA_0_2 = "hapticclay-scenario-2", "hapticclay-scenario-1"
EXPERIMENTS: dict[str, Any] = {}  # classes of `experiments`, by their name in files


@named
@dataclass(frozen=True)
class Scenario:
    """One run, complete: simulate(scenario) needs nothing else.

    Change it with dataclasses.replace, or, by dotted name, with `with_fields`.

    Attributes:
        name: label used in files and plots.
        clay: the virtual clay; None for free space.
        gain: compensator gain K on each axis, 0 to 1e6 [1/kg] for the printed compensator, whose
            virtual mass is 1/K; 0 turns the compensator off.
        force: constant part of the operator's muscle force uh on each axis [N], of two or all axes
            of the handle; none for an arm from a file where it is not given.
        operator: impedance Th of the operator's arm, of both axes or a pair (x, y); None for a
            pure force (Th = 0). That of y acts along z, too, where an arm from a file moves there.
        inertia_shaping: whether the servo shapes the handle's inertia, so that Sh holds at every
            pose.
        dt: physics and control step [s], 1e-6 to 0.02; where it is not given, 0.36 ms, or the
            longest whole part of Ts that is no longer.
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
            from the sample) or "physical" (there all the time).
        muscle: variable part of uh [N], any signal or sum of signals; None for none.
        command: displacement added to the compensator's output [m]: the signal less its value at
            t = 0, so that the run starts without a jump; None for none.
        stop_when_unstable: whether the run ends when an axis is judged unstable; False lets it go
            on against the torque limits.
        hardware: hardware of a sampled loop; None for an ideal one.
        arm: the two-link arm in closed form; or one from a file, which starts at rest at its pose,
            where p = 0, and whose control is sampled. Its x and y are the axes of its `plane`.
        servo: G and Sh of each axis, (x, y).
        compensator: shape of C, of both axes or a pair (x, y); K/(s^2 + 10 s) as printed. Systems
            of python-control and scipy.signal are taken as well.
        controller: your own sampled controller, or laws of the joints, in place of compensator
            and servo; None for those.
    """

    name: str = "free"
    clay: Clay | None = None
    gain: Annotated[tuple[Real, Real], Bound(0.0, 1e6, "1/kg")] = GAIN
    force: Annotated[SpaceForce | tuple[Real, Real], Bound(-1e6, 1e6, "N")] = FORCE
    operator: Operator | None | tuple[Operator | None, Operator | None] = None
    inertia_shaping: bool = False
    dt: StepLength = TS
    t_max: Duration = 60.0
    length: Length = PATH_LENGTH
    start: Position = (0.0, 0.0)
    velocity: Annotated[tuple[Real, Real], Bound(-10.0, 10.0, "m/s")] = (0.0, 0.0)
    origin: Position = ORIGIN
    torque_limit: TorqueLimit = TORQUE_LIMIT
    integrator: Integrator = "fast"
    control: Control = CONTINUOUS
    Ts: SamplePeriod = None
    render: Render = "held"
    muscle: Signal | None = None
    command: Signal | None = None
    stop_when_unstable: bool = True
    hardware: Hardware | None = None
    arm: Arm | MjcfArm = PAPER
    servo: tuple[Servo, Servo] = SERVO
    compensator: Compensator | tuple[Compensator, Compensator] = PRINTED
    controller: Controller | JointPD | None = None

    def __post_init__(self):
        if not isinstance(self.compensator, Compensator):
            object.__setattr__(self, "compensator", _compensators(self.compensator))
        if isinstance(self.arm, MjcfArm):
            _suit_arm(self)
        choose_step(self)
        check_fields(self)
        check_scene(self)
        if isinstance(self.controller, JointPD):
            checked_law(self.controller, self.joints)
        if self.Ts is not None:
            if self.control != "sampled":
                raise ParameterError("Ts", self.Ts, "must be None unless control is 'sampled'")
            n = self.Ts / self.dt
            if abs(n - round(n)) > WHOLE:
                bound = (
                    f"must be a whole multiple of dt = {self.dt:g} s: the nearest is "
                    f"{round(n) * self.dt:.10g} s; or dt = {self.Ts / round(n):.10g} s"
                )
                raise ParameterError("Ts", self.Ts, bound)
        self._check_servo()
        self._check_hardware()
        if not self.is_closed_form:
            _check_arm(self)
            return
        _check_force(self)
        self._check_rotated_axes()
        self._check_soft_clay()
        self._check_reach("start", self.start)
        if self.length is not None:
            if self.length <= self.start[0]:
                raise ParameterError(
                    "length", self.length, f"must lie ahead of start x = {self.start[0]:g} m"
                )
            self._check_reach("length", (self.length, self.start[1]))

    def __repr__(self) -> str:
        rows = ", ".join(f"{name}: {value}" for name, value in scenario_rows(self))
        return f"<Scenario {one_line(self.name)}; {rows}>"

    def _repr_html_(self) -> str:
        return html_table(f"Scenario {self.name}", scenario_rows(self))

    @classmethod
    @checked
    def of(cls, settings: Mapping[str, Any], *changes: Mapping[str, Any]) -> Scenario:
        """Makes a scenario from plain data: fields, or an experiment with parameters and fields.

        Args:
            settings: the data, as in a file (docs/scenarios.md).
            *changes: values by dotted name, the later ones on top.

        Raises:
            ParameterError: there is no such field, or a value was refused.
        """
        data = nested(settings)
        given = data.pop("schema", SCENARIO_SCHEMA)
        choice("schema", given, (SCENARIO_SCHEMA, SCENARIO_SCHEMA_0_2))
        if "experiment" in data:
            name = choice("experiment", data.pop("experiment"), tuple(EXPERIMENTS))
            return EXPERIMENTS[name].of({}, data, *changes)
        values = values_of(cls())
        for name in data:
            if name not in values:
                raise no_field(name, data[name], [*dotted_names(cls), "experiment", "schema"])
        values = merged_values(cls, data, values)
        later = [nested(x) for x in changes]
        check_added_hand(values["operator"], *later)
        for given in later:
            values = merged_values(cls, given, values)
        return cls(**values)

    @classmethod
    @checked
    def load(cls, path: str | os.PathLike[str], *changes: Mapping[str, Any]) -> Scenario:
        """Reads a scenario from a file (docs/scenarios.md).

        Args:
            path: the file, .toml or .json.
            *changes: values by dotted name that go before those of the file, the later ones on
                top.

        Raises:
            ParameterError: the file cannot be read, or a field was refused.
        """
        with naming_file(path):
            settings = read_settings(path)
            cls.of(settings)
        return cls.of(settings, *changes)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the fields that differ from the defaults, whole or not at all.

        Args:
            path: the file, .toml or .json.

        Returns:
            The file.

        Raises:
            ParameterError: the file cannot be written, or a part is no data, as a function.
        """
        return write_part(path, {"schema": SCENARIO_SCHEMA, "name": self.name}, self)

    @property
    def operators(self) -> tuple[Operator | None, Operator | None]:
        """Th of x and of y, None for Th = 0."""
        return each_axis(self.operator)

    @property
    def compensators(self) -> tuple[Compensator, Compensator]:
        """Shape of C of x and of y."""
        return each_axis(self.compensator)

    @property
    def mobility(self) -> float:
        """Largest acceleration of handle and hand per unit of force [1/kg]."""
        mass = min(th.mass if th else 0.0 for th in self.operators)
        return mobility_with(self.free_mobility, mass)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes of the handle, in the order of arrays."""
        return AXES if isinstance(self.arm, Arm) else tuple(self.arm.axes)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints of the arm."""
        return JOINTS if isinstance(self.arm, Arm) else self.arm.names

    @property
    def is_closed_form(self) -> bool:
        """Whether the arm is the two-link arm in closed form, and not one from a file."""
        return isinstance(self.arm, Arm)

    @property
    def planar_arm(self) -> Arm:
        """The two-link arm in closed form.

        Raises:
            ParameterError: the arm is from a file.
        """
        if not isinstance(self.arm, Arm):
            bound = "must be the two-link arm in closed form here"
            raise ParameterError("arm", self.arm, bound)
        return self.arm

    @property
    def file_arm(self) -> MjcfArm:
        """The arm from a file.

        Raises:
            ParameterError: the arm is in closed form.
        """
        if not isinstance(self.arm, MjcfArm):
            raise ParameterError("arm", self.arm, "must be an arm from a file here")
        return self.arm

    @property
    def free_mobility(self) -> float:
        """Largest acceleration of the handle per unit of force, without a hand [1/kg]."""
        if isinstance(self.arm, Arm):
            return self.arm.links[4]
        J = self.arm.jacobian()[["xyz".index(c) for c in self.arm.axes[:2]]]
        return float(np.trace(J @ np.linalg.solve(self.arm.mass_matrix(), J.T)))

    @property
    def driven(self) -> bool:
        """Whether the muscle force or the command varies."""
        return any(x is not None and x.varies for x in (self.muscle, self.command))

    @property
    def hands(self) -> list[Operator]:
        """The operator along each axis of the handle; that of y acts along z, too."""
        return [self.operators[min(i, 1)] or NO_HAND for i in range(len(self.axes))]

    @property
    def steady_force(self) -> tuple[float, ...]:
        """The constant part of the muscle force along all axes [N]: `force`, constant `muscle`."""
        (x, y, *more), muscle = self.force, self.muscle
        if muscle is not None and not muscle.varies:
            mx, my = muscle(0.0)
            x, y = x + mx, y + my
        more += [0.0] * (len(self.axes) - 2 - len(more))
        return float(x), float(y), *more

    def _check_servo(self) -> None:
        """Refuses a servo too fast for the step; the servo alone would diverge."""
        fastest = max(x.stiffness for servo in self.servo for x in (servo.G, servo.S)) ** 0.5
        fast = self.control == "continuous" and self.integrator == "fast"
        if fast and self.dt * fastest >= SERVO_STEP:
            bound = (
                f"must be < {SERVO_STEP / fastest:.3g} s: the servo's fastest mode has "
                f"{fastest:.3g} rad/s; integrator='accurate' divides its steps"
            )
            raise ParameterError("dt", self.dt, bound)

    def _check_hardware(self) -> None:
        given, Ts = self.hardware, self.Ts or self.dt
        if given is None:
            return
        number("hardware.jitter", given.jitter, 0.0, 0.28 * Ts, unit="s")
        number("hardware.delay", given.delay, 0.0, 100.0 * Ts, unit="s")
        turning = [True, True] if self.is_closed_form else self.file_arm.mechanism.turning
        given.check_encoders(turning, self.joints, "hardware.")

    @property
    def rotated(self) -> bool:
        """Whether rotated clay couples the axes."""
        return self.clay is not None and self.clay.angle != 0.0

    def _check_rotated_axes(self) -> None:
        """Refuses rotated axes in stiff clay: see docs/equations.md, section 4."""
        clay = self.clay
        if clay is None or not self.rotated:
            return
        b, most = clay.largest + self.t_max * clay.fastest, self._soft_damping()
        if b > most:
            bound = (
                f"must be 0 where clay is stiff: b grows to {b:.4g} N.s/m in t_max, at dt = "
                f"{self.dt:g} s it may have {most:.4g}; or dt at most {self.dt * most / b:.3g} s, "
                "or integrator 'accurate'"
            )
            raise ParameterError("clay.angle", clay.angle, bound)

    def _soft_damping(self) -> float:
        """Largest damping at which no kick is split: see damping.split_damping [N.s/m]."""
        held = self.control == "sampled" and self.render == "held"
        if held or self.integrator == "accurate":
            return math.inf
        return 2.0 / (self.dt * self.mobility)

    def _check_soft_clay(self) -> None:
        """Refuses stiff clay in which no kick can be split."""
        for b, where, instead in self.clay.soft if self.clay else ():
            most = self._soft_damping()
            if b > most:
                bound = (
                    f"must be at most {self.dt * most / b:.3g} s in {where} where b reaches "
                    f"{b:.4g} N.s/m; at this dt it may reach {most:.4g}{instead}"
                )
                raise ParameterError("dt", self.dt, bound)

    def _check_reach(self, field: str, p: tuple[float, float]) -> None:
        """Refuses p, or a straight path from start to p, out of the arm's reach."""
        x, y = self.origin[0] + p[0], self.origin[1] + p[1]
        r = math.hypot(x, y)
        if field == "length":
            x0 = self.origin[0] + self.start[0]
            if x0 < 0.0 < x:
                r = min(r, abs(y))
        folded, stretched = self.arm.reach
        bent = 4.0 * self.arm.l1 * self.arm.l2 * math.sin(0.5 * FOLD_MARGIN) ** 2  # law of cosines
        low = max(folded + REACH_MARGIN, math.sqrt(folded * folded + bent))
        high = min(stretched - REACH_MARGIN, math.sqrt(stretched * stretched - bent))
        if not low <= r <= high:
            raise ParameterError(
                field,
                getattr(self, field),
                f"unreachable: {r:.4g} m from the shoulder, must be {low:.4g} to {high:.4g} m "
                f"(origin {self.origin[0]:g}, {self.origin[1]:g} m)",
            )


def _suit_arm(s: Scenario) -> None:
    """Sets what was not given to what an arm from a file can have."""
    suited = {
        "control": (CONTINUOUS, "sampled"),
        "length": (PATH_LENGTH, None),
        "force": (FORCE, (0.0, 0.0)),
    }
    for name, (default, value) in suited.items():
        if getattr(s, name) is default:
            object.__setattr__(s, name, value)


def _check_force(s: Scenario) -> None:
    """Refuses a force along an axis that the handle does not have."""
    if len(s.force) > len(s.axes):
        numbers_of("force", s.force, s.axes)


def _check_pose(arm: MjcfArm) -> None:
    """Refuses a pose beyond the range of a joint, where a run would end at once."""
    for i in outside(arm.q, arm.ranges):
        low, high = arm.ranges[i]
        bound = f"must be within the range of the joint, {low:.4g} to {high:.4g}"
        raise ParameterError(f"arm.pose.{arm.names[i]}", float(arm.q[i]), bound)


def _check_arm(s: Scenario) -> None:
    """Refuses what an arm from a file cannot have, beyond the table of support."""
    arm, law, io = s.arm, s.controller, s.hardware
    assert isinstance(arm, MjcfArm)
    arm.check_handle()
    _check_force(s)
    _check_pose(arm)
    with_arm = "with an arm from a file"
    given = {
        "controller": (law is None, f"must be given {with_arm}: a JointPD, or your own"),
        "command": (s.command is not None, f"must be None {with_arm}, which has no compensator"),
    }
    for name, default in (("start", (0.0, 0.0)), ("velocity", (0.0, 0.0)), ("origin", ORIGIN)):
        bound = f"must be left out {with_arm}, which starts at rest at its pose"
        given[name] = (getattr(s, name) != default, bound)
    bound = f"must be left out {with_arm}, which has its own: MjcfArm(torque_limit)"
    given["torque_limit"] = (s.torque_limit != TORQUE_LIMIT, bound)
    for name, (is_wrong, bound) in given.items():
        if is_wrong:
            raise ParameterError(name, getattr(s, name), bound)
    if len(arm.names) > MOST_JOINTS:
        raise ParameterError("arm", arm.name, f"must have at most {MOST_JOINTS} joints in runs")
    if isinstance(law, JointPD) and law.drive_rate is not None:
        bound = (
            "must be None in runs: a drive that samples runs as a host of its rate, "
            f"JointPD(..., runs='host') with Ts={1.0 / law.drive_rate:g}"
        )
        raise ParameterError("controller.drive_rate", law.drive_rate, bound)
    limits: Any = arm.torque_limit
    if isinstance(law, JointPD) and law.runs == "drive" and any(map(math.isfinite, limits)):
        bound = (
            "must be none where drives run the law, whose limits are not simulated: "
            f"MjcfArm(torque_limit={[math.inf] * len(arm.names)})"
        )
        raise ParameterError("arm.torque_limit", limits, bound)
    if io is not None and io.dac_bits and not all(map(math.isfinite, limits)):
        bound = "must be finite where a converter gives the torques, whose range it is"
        raise ParameterError("arm.torque_limit", limits, bound)
    if io is not None and io.dac_range is not None:
        bound = f"must be None {with_arm}: its torque limits are the range"
        raise ParameterError("hardware.dac_range", io.dac_range, bound)
    _check_arm_in_clay(s)


def _check_arm_in_clay(s: Scenario) -> None:
    """Refuses clay too stiff for such an arm, and yielding clay beside joint friction."""
    if s.clay is None or s.render == "held":
        return
    share = s.clay.largest * s.dt * s.free_mobility
    if share > SOFT:
        bound = (
            f"must be at most {s.dt * SOFT / share:.3g} s, where b reaches {s.clay.largest:.4g} "
            "N.s/m at the handle of an arm from a file"
        )
        raise ParameterError("dt", s.dt, bound)
    if s.clay.yields and any(s.arm.friction):  # type: ignore[union-attr, arg-type]
        bound = "must be 'held' where clay yields and joints have friction"
        raise ParameterError("render", s.render, bound)


def choose_step(part: Any) -> None:
    """Makes a dt that was not given a whole part of Ts; `is` recognises the default."""
    if not isinstance(part.control, str) or part.control != "sampled" or part.dt is not TS:
        return
    Ts = quantity("Ts", part.Ts, "s") if isinstance(part.Ts, str) else part.Ts
    if isinstance(Ts, float | int) and STEP_LEAST <= Ts <= 1.0:
        object.__setattr__(part, "dt", Ts / math.ceil(Ts / TS - WHOLE))


def _compensators(given: Any) -> Any:
    """Converts one compensator, or a pair, from systems of other packages."""
    if isinstance(given, tuple) and len(given) == 2 and not isinstance(given[0], list | tuple):
        return Compensator.of(given[0]), Compensator.of(given[1])
    return Compensator.of(given)
