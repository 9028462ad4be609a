"""The paper's experiments: dataclasses of their parameters, each of which makes a scenario.

A new experiment costs a subclass of `Experiment` and a line in `EXPERIMENTS`; the command line,
sweeps and plots read its parameters, bounds, units and descriptions from the class.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import inspect
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, radians
from typing import Annotated, Any, ClassVar, Literal, ParamSpec

from ..arguments import checked, function_of, named
from ..errors import Bound, ParameterError, Real
from ..fields import (
    ENTIRE,
    Axis,
    Field,
    Node,
    Seed,
    check_fields,
    dotted_names,
    field_descriptions,
    field_unit,
    make_part,
    merged_values,
    no_field,
    node_of,
    nodes_of,
    values_of,
)
from ..formulas.constants import B_MAX
from ..model import constants
from ..model.cells import Profile
from ..model.clay import Clay, slab
from ..model.flow import Flow
from ..model.operator import Operator
from ..model.signals import Multisine
from .changes import check_added_hand, nested
from .scenario import (
    EXPERIMENTS,
    Control,
    Duration,
    Force,
    Integrator,
    Length,
    Position,
    Render,
    SamplePeriod,
    Scenario,
    StepLength,
    TorqueLimit,
    choose_step,
)

GROWTHS = {  # readings of the growth [N.s/m per s]
    "30/s": constants.GROWTH,
    "0.15/s": constants.GROWTH_EQ25,
    "0.15/sample": constants.GROWTH_EQ25 / constants.TS,
    "none": 0.0,
}
UNIT_FORCE = constants.COUNTERWEIGHT[0] * cos(
    radians(constants.COUNTERWEIGHT[1])
)  # on each axis [N]

Gains = Annotated[tuple[Real, Real], Bound(0.0, 1e6, "1/kg", above=True)]
Damping = Annotated[Real, Bound(0.0, B_MAX, "N.s/m")]


@named
@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Parameters that all experiments share.

    Attributes:
        operator: the operator's arm Th in the loop (Eq. 19); None for a pure force.
        inertia_shaping: let the servo shape the inertia, so that Sh (Eqs. 17, 18) holds at every
            pose.
        dt: physics and control step [s], 1e-6 to 0.02; where it is not given, a part of Ts.
        t_max: longest simulated time [s], > 0, at most 1e5.
        origin: world position of p = 0 [m].
        torque_limit: largest torque of the shoulder and elbow motor [N.m], > 0.
        control: "continuous", part of the differential equation, or "sampled": measured and held
            every Ts.
        Ts: control sample [s], a whole multiple of dt, at most 1; None for dt.
        render: clay of a sampled loop: its force "held" by the motors, or "physical": there all
            the time.
    """

    operator: Operator | None = None
    inertia_shaping: bool = False
    dt: StepLength = constants.TS
    t_max: Duration = 60.0
    origin: Position = constants.ORIGIN
    torque_limit: TorqueLimit = constants.TORQUE_LIMIT
    control: Control = "continuous"
    Ts: SamplePeriod = None
    render: Render = "held"
    _changes: ClassVar[tuple[Mapping[Any, Any], ...]] = ()

    def __post_init__(self):
        choose_step(self)
        check_fields(self)

    def scenario(self) -> Scenario:
        """The scenario of these parameters.

        Raises:
            ParameterError: the path leaves the reach of the arm, or parameters contradict.
        """
        raise NotImplementedError

    @classmethod
    @checked
    def of(cls, words: Mapping[str, Any], *changes: Mapping[str, Any]) -> Scenario:
        """The scenario of an experiment whose parameters are given as in `parameters`.

        Args:
            words: parameters by name; those left out keep their defaults.
            *changes: parameters, and fields of the scenario, by dotted name; the later ones on top.

        Raises:
            ParameterError: as `scenario`; or there is no such parameter or field.
        """
        values, others = dict(words), []
        if "operator" in values:
            values["operator"] = _hand_of_flag(values["operator"])
        split = [_split_names(cls, nested(given)) for given in changes]
        before = values.get("operator", parameters(cls)["operator"].default or None)
        check_added_hand(before, *(own for own, _ in split))
        for own, other in split:
            values = merged_values(cls, own, values)
            others += [other] if other else []
        experiment = cls(**values)
        return experiment.changed(*others) if others else experiment.scenario()

    def build_scenario(self, name: str, **own: Any) -> Scenario:
        """A scenario that takes its fields from the parameters of the same names.

        Args:
            name: label of the scenario.
            **own: fields that differ from the parameters, or that have none.
        """
        known = nodes_of(Scenario)
        shared = {name: x for name, x in values_of(self).items() if name in known}
        values = {"name": name, **shared, **own}
        for changes in self._changes:
            values = merged_values(Scenario, changes, values)
        return Scenario(**values)

    def changed(self, *changes: Mapping[Any, Any]) -> Scenario:
        """The scenario of these parameters with any of its fields changed.

        The changes are made before the scenario is checked, so that another arm may go another way.

        Args:
            *changes: plain data of the fields, the later ones on top.

        Raises:
            ParameterError: as `scenario`; or there is no such field.
        """
        check_added_hand(self.operator, *changes)
        other = copy.copy(self)
        object.__setattr__(other, "_changes", changes)
        scenario = other.scenario()
        for data in changes:  # again, for experiments that do without build_scenario
            scenario = make_part(Scenario, data, values_of(scenario))
        return scenario


@dataclass(frozen=True, kw_only=True)
class PathExperiment(Experiment):
    """Parameters of the experiments that end where a path ends.

    Attributes:
        length: the run ends when the handle reaches this x [m], -10 to 10; None runs for t_max.
        start: handle position at t = 0, at rest [m].
        integrator: "fast" (second order, any stiffness) or "accurate" (fourth order, slower).
    """

    length: Length = constants.PATH_LENGTH
    start: Position = (0.0, 0.0)
    integrator: Integrator = "fast"


@named
@dataclass(frozen=True)
class ConstantCut(PathExperiment):
    """The cut with constant volume (Sec. 4.1, Figs. 7, 8): along +x through a slab of clay.

    With the default gain the linear loop of the y axis is unstable for 219 < b < 1043 N.s/m
    (251 < b < 1004 with the hand Th); that of the x axis is stable for every b. That holds at the
    nominal pose, and with inertia shaping. Without it other poses couple the axes, and the loop is
    unstable somewhere on the way for 199 < b < 1353 N.s/m (226 < b < 1319 with the hand).

    Attributes:
        b: damping of the clay on both axes [N.s/m], 0 to 1e9 (Eq. 21).
        gain: K of the compensator on each axis [1/kg], > 0 (Eq. 20).
        force: muscle force uh of the operator [N].
        clay: where the slab begins and ends along x [m].
        material: name of a material in place of b, as in "stiff clay" (hapticclay materials); its
            flow is that of a tool of 10 by 5 mm.
    """

    b: Damping = constants.B_CONSTANT
    gain: Gains = constants.GAIN
    force: Force = (1.0, 0.0)
    _: dataclasses.KW_ONLY
    clay: Annotated[tuple[Real, Real], Bound(unit="m", names=("begin", "end"))] = constants.CLAY_X
    material: str | None = None

    def scenario(self) -> Scenario:
        begin, end = self.clay
        if end <= begin:
            raise ParameterError("clay", self.clay, "must end beyond where it begins")
        return self.build_scenario("constant", clay=slab(self._resistance(), begin, end))

    def _resistance(self) -> float | Flow:
        if self.material is None:
            return self.b
        if self.b != constants.B_CONSTANT:
            raise ParameterError("material", self.material, "sets b: give one of the two")
        from ..model.materials import material

        return material(self.material)


@named
@dataclass(frozen=True)
class VariableCut(PathExperiment):
    """The cut with variable volume (Sec. 4.2, Figs. 9, 10): along x and y at the same time.

    The clay of each axis depends on the coordinate of that axis.

    Attributes:
        growth: rate at which the second clay grows in x from when the handle enters it
            [N.s/m per s], 0 to 1e9; or a reading of the paper: "30/s", "0.15/s", "0.15/sample"
            (of 0.36 ms), "none".
        gain: K of the compensator on each axis [1/kg], > 0 (Eq. 22).
        force: muscle force uh of the operator [N]; 1 N at 45 degrees by default.
        as_printed: take K = 1 on both axes, with which y is unstable.
        b: damping before and after the border, on both axes [N.s/m], 0 to 1e9 (Eqs. 23-26).
        border: coordinate at which the second clay begins, on each axis [m].
        length: as in PathExperiment [m]; 10 cm by default.
        origin: as in Experiment [m]; the nominal pose is the middle of the square by default.
    """

    growth: Annotated[
        Real | Literal["30/s", "0.15/s", "0.15/sample", "none"], Bound(0.0, B_MAX, "N.s/m per s")
    ] = constants.GROWTH
    gain: Gains = constants.GAIN
    force: Force = (UNIT_FORCE, UNIT_FORCE)
    _: dataclasses.KW_ONLY
    as_printed: bool = False
    b: Annotated[tuple[Real, Real], Bound(0.0, B_MAX, "N.s/m")] = constants.B_VARIABLE
    border: Annotated[Real, Bound(unit="m")] = constants.BORDER
    length: Length = 0.10
    origin: Position = constants.ORIGIN_VARIABLE

    def scenario(self) -> Scenario:
        if self.as_printed and self.gain != constants.GAIN:
            raise ParameterError("as_printed", True, "sets gain to (1, 1): give one of the two")
        growth = GROWTHS[self.growth] if isinstance(self.growth, str) else self.growth
        x = Profile((self.border,), self.b, "x", (0.0, growth))
        y = Profile((self.border,), self.b, "y")
        gain = (1.0, 1.0) if self.as_printed else self.gain
        return self.build_scenario("variable", clay=Clay(x, y), gain=gain)


@named
@dataclass(frozen=True)
class StabilityTest(Experiment):
    """The stability test (Sec. 4.3, Fig. 11): an arbitrary maneuver through clay.

    The maneuver is a muscle force of 0.1 to 2 Hz with random phases, and clay is everywhere. An
    unstable run continues to its end; only the torque limits of the motors bound it.

    Attributes:
        gain: K of the compensator on the axis [1/kg], > 0 (1 in Eq. 27; 2 or 3, and 25 in
            Fig. 11).
        b: damping of the clay [N.s/m], 0 to 1e9 (Eq. 28).
        axis: axis of the maneuver; the other one keeps its default gain.
        rms: root mean square of the muscle force [N], 0 to 1e6.
        seed: seed of its phases, 0 to 2^32 - 1.
        operator: as in Experiment; the nominal hand by default.
        t_max: as in Experiment [s]; 20 s by default.
        origin: as in Experiment [m]; the nominal pose by default.
    """

    gain: Annotated[Real, Bound(0.0, 1e6, "1/kg", above=True)] = constants.GAINS_FIG11[1]
    b: Damping = constants.B_STABILITY
    axis: Axis = "x"
    rms: Annotated[Real, Bound(0.0, 1e6, "N")] = 1.0
    seed: Seed = 0
    _: dataclasses.KW_ONLY
    operator: Operator | None = Operator()
    t_max: Duration = 20.0
    origin: Position = constants.NOMINAL

    def scenario(self) -> Scenario:
        i = constants.AXES.index(self.axis)
        everywhere = Profile((), (self.b,))
        return self.build_scenario(
            "stability",
            clay=Clay(everywhere, everywhere),
            gain=(self.gain, constants.GAIN[1]) if i == 0 else (constants.GAIN[0], self.gain),
            force=(0.0, 0.0),
            muscle=Multisine((self.rms, 0.0) if i == 0 else (0.0, self.rms), seed=self.seed),
            length=None,
            stop_when_unstable=False,
        )


@named
@dataclass(frozen=True)
class Free(PathExperiment):
    """The path of the constant cut without clay: the steady speed is K f/10.

    Attributes:
        gain: K of the compensator on each axis [1/kg], > 0 (Eq. 20).
        force: muscle force uh of the operator [N].
    """

    gain: Gains = constants.GAIN
    force: Force = (1.0, 0.0)

    def scenario(self) -> Scenario:
        return self.build_scenario("free")


EXPERIMENTS |= {
    "constant": ConstantCut,
    "variable": VariableCut,
    "stability": StabilityTest,
    "free": Free,
}


@functools.cache
def parameters(kind: type[Experiment]) -> dict[str, Field]:
    """Parameters of an experiment by name; `operator` is a flag: true for the arm of the paper."""
    nodes, about, out = nodes_of(kind), field_descriptions(kind), {}
    for name, given in inspect.signature(kind).parameters.items():
        out[name] = Field(name, nodes[name], given.default, about[name])
        if name == "operator":
            about_hand = "put the operator's arm Th (Eq. 19) in the loop."
            out[name] = Field(name, node_of(bool), given.default is not None, about_hand)
    return out


def _hand_of_flag(given: Any) -> Any:
    """The arm of the paper, or none, where a flag stands for it; a sweep gives flags as floats."""
    if isinstance(given, bool) or (isinstance(given, float) and given in (0.0, 1.0)):
        return Operator() if given else None
    return given


def _split_names(
    kind: type[Experiment], data: dict[Any, Any]
) -> tuple[dict[Any, Any], dict[Any, Any]]:
    """Plain data of the parameters of an experiment, and of other fields of the scenario."""
    nodes, known = nodes_of(kind), nodes_of(Scenario)
    data, own, other = dict(data), {}, {}
    if "operator" in data:
        given = data["operator"]
        hand = given if isinstance(given, Mapping) else {ENTIRE: given}
        data["operator"] = {k: _hand_of_flag(v) if k is ENTIRE else v for k, v in hand.items()}
    for name, value in data.items():
        if name in nodes and (name not in known or _reaches(nodes[name], value)):
            own[name] = value
        elif name in known:
            other[name] = value
        else:
            raise no_field(name, value, parameter_names(kind))
    return own, other


def _reaches(node: Node, value: Any, *names: str) -> bool:
    """Whether all that plain data names lies below a parameter, and has as many numbers."""
    if isinstance(value, Mapping):
        return all(
            _reaches(node, x, *names, *([] if key is ENTIRE else [key])) for key, x in value.items()
        )
    one = not names and node.takes_numbers and node.arity == 1
    return bool(node.bounds_at(names)) and not (one and isinstance(value, list | tuple))


def parameter_names(kind: type[Experiment] | None) -> list[str]:
    """Names of what can be set: parameters of an experiment, if any, and fields of the scenario."""
    own = parameters(kind) if kind else {}
    return list(dict.fromkeys([*own, *dotted_names(Scenario)]))


def parameter_unit(name: str) -> str:
    """Unit of a parameter of any experiment, or of a field of a scenario; "" for none."""
    return field_unit(name, *EXPERIMENTS.values(), Scenario)


P = ParamSpec("P")


def scenario_factory(kind: Callable[P, Experiment]) -> Callable[P, Scenario]:
    """A function with the parameters of an experiment that returns its scenario."""
    assert isinstance(kind, type)
    name = re.sub(r"(?<=.)(?=[A-Z])", "_", kind.__name__).lower()
    refused = "a value is out of its bounds, or the path out of reach."
    return function_of(kind, name, kind.scenario, refused)


constant_cut = scenario_factory(ConstantCut)
variable_cut = scenario_factory(VariableCut)
stability_test = scenario_factory(StabilityTest)
free = scenario_factory(Free)
SCENARIOS = {name: scenario_factory(kind) for name, kind in EXPERIMENTS.items()}
