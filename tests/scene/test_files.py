"""Scenarios as files, and their fields by dotted name."""

import dataclasses
import json
import math
import os
import tomllib
from fractions import Fraction
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay import errors, files, units
from hapticclay.errors import Bound, ParameterError
from hapticclay.fields import UNSET, leaves, make_part, nodes_of, plain_data
from hapticclay.model.constants import SecondOrder
from hapticclay.model.controller import Servo
from hapticclay.scene import files as scene_files
from hapticclay.scene.changes import named_values, nested, with_fields
from hapticclay.scene.experiments import EXPERIMENTS, parameter_unit
from tests.hunt import examples


def floats(low, high):
    return st.floats(low, high, allow_subnormal=False)


def pairs(low, high):
    return st.tuples(floats(low, high), floats(low, high))


def each(part):
    """One for both axes, or a pair."""
    return part | st.tuples(part, part)


POSITIVE = floats(1e-3, 1e4)
SECOND_ORDERS = st.builds(SecondOrder, POSITIVE, POSITIVE, POSITIVE)
SERVOS = st.builds(Servo, SECOND_ORDERS, SECOND_ORDERS)
OPERATORS = st.none() | st.builds(hc.Operator, floats(0, 1e3), floats(0, 1e9), floats(0, 1e9))
COEFFICIENTS = st.lists(floats(-1e3, 1e3), max_size=2).map(lambda x: (1.0, *x))
COMPENSATORS = st.builds(hc.Compensator, COEFFICIENTS, COEFFICIENTS.map(lambda x: (*x, 2.0, 3.0)))
MULTISINES = st.builds(
    hc.Multisine,
    pairs(0.0, 1e6),
    floats(0.1, 0.5),
    floats(1.0, 3.0),
    floats(5.0, 9.0),
    st.none() | st.integers(1, 2),
    st.integers(0, 2**32 - 1),
)


@st.composite
def profiles(draw):
    edges = sorted(draw(st.sets(floats(-0.5, 0.5), max_size=4)))
    row = st.lists(floats(0.0, 1e9), min_size=len(edges) + 1, max_size=len(edges) + 1)
    growth = draw(st.just(()) | row)
    return hc.Profile(tuple(edges), tuple(draw(row)), draw(st.sampled_from("xy")), tuple(growth))


@st.composite
def hardwares(draw):
    difference = draw(st.booleans())
    more = dict(velocity_window=draw(st.integers(1, 9))) if difference else {}
    return hc.Hardware(
        dropout_probability=draw(floats(0.0, 0.9)),
        encoder=draw(st.none() | st.integers(4, 2**40)),
        velocity="difference" if difference else "exact",
        dac_range=draw(st.none() | pairs(0.1, 9.0)),
        friction=draw(pairs(0.0, 1.0)),
        passivity=draw(st.booleans()),
        coupling=draw(st.none() | st.builds(hc.Coupling, POSITIVE, POSITIVE)),
        **more,
    )


@st.composite
def scenarios(draw):
    arm = hc.Arm(*draw(pairs(0.2, 3.0)), *draw(pairs(1e-3, 1e3)))
    folded, stretched = arm.reach
    r, a = draw(floats(0.2, 0.8)), draw(floats(0.1, 3.0))
    r = folded + r * (stretched - folded)
    assume(folded + 2e-3 < r < stretched - 2e-3)
    sampled = draw(st.booleans())
    dt = draw(floats(1e-5, 0.0099))  # below 1 over the fastest mode of SERVOS
    loop = dict(control="sampled", Ts=draw(st.none() | st.just(3 * dt))) if sampled else {}
    if sampled:
        loop["hardware"] = draw(st.none() | hardwares())
    return hc.Scenario(
        name=draw(st.text(st.characters(exclude_categories=["Cs"]), min_size=1)),
        clay=draw(st.none() | st.builds(hc.Clay, profiles(), profiles())),
        gain=draw(pairs(0.0, 1e6)),
        force=draw(pairs(-1e6, 1e6)),
        operator=draw(each(OPERATORS)),
        inertia_shaping=draw(st.booleans()),
        dt=dt,
        t_max=draw(floats(1e-3, 1e5)),
        length=None,
        velocity=draw(pairs(-1.0, 1.0)),
        origin=(r * math.cos(a), r * math.sin(a)),
        torque_limit=draw(pairs(1e-3, 1e6)),
        muscle=draw(st.none() | MULTISINES),
        command=draw(st.none() | MULTISINES),
        stop_when_unstable=draw(st.booleans()),
        arm=arm,
        servo=draw(st.tuples(SERVOS, SERVOS)),
        compensator=draw(each(COMPENSATORS)),
        **loop,
    )


def bits(x):
    """Text of a value that tells every bit of its floats."""
    return repr(dataclasses.asdict(x))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("scenarios")


@pytest.mark.parametrize("end", [".toml", ".json"])
@examples(15)
@given(scenario=scenarios())
def test_a_saved_scenario_comes_back_to_the_last_bit(folder, end, scenario):
    file = scenario.save(folder / f"s{end}")
    again = hc.Scenario.load(file)
    assert again == scenario and bits(again) == bits(scenario)
    assert bits(make_part(hc.Scenario, plain_data(scenario))) == bits(scenario)
    text = json.dumps(plain_data(scenario))  # as records keep it
    assert bits(make_part(hc.Scenario, json.loads(text))) == bits(scenario)


@pytest.mark.parametrize("end", [".toml", ".json"])
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_comes_back(tmp_path, end, name):
    scenario = hc.SCENARIOS[name]()
    assert hc.Scenario.load(scenario.save(tmp_path / f"s{end}")) == scenario


@pytest.mark.parametrize(
    "changes",
    [
        dict(operator=(None, None)),
        dict(operator=(hc.Operator(), None)),
        dict(operator=(hc.Operator(), hc.Operator())),
        dict(compensator=(hc.Compensator(), hc.Compensator())),
        dict(compensator=(hc.Compensator((2.0,)), hc.Compensator())),
        dict(start=(-0.0, 0.0)),
        dict(muscle=hc.Multisine()),
        dict(length=None),
        dict(clay=hc.Clay(hc.Profile((), (5.0,)), hc.Profile((), (0.0,)))),
    ],
)
def test_pairs_defaults_and_nothing_come_back(tmp_path, changes):
    scenario = dataclasses.replace(hc.Scenario(), **changes)
    for end in (".toml", ".json"):
        assert bits(hc.Scenario.load(scenario.save(tmp_path / f"s{end}"))) == bits(scenario)


@given(
    st.recursive(
        st.booleans()
        | st.integers()
        | st.floats(allow_nan=False, allow_infinity=False)
        | st.text(st.characters(exclude_categories=["Cs"])),
        lambda x: (
            st.lists(x, max_size=3)
            | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"])), x, max_size=3)
        ),
        max_leaves=8,
    ).map(lambda x: {"a": x, "b c": [{"d": x}]})
)
def test_the_toml_we_write_is_what_tomllib_reads(data):
    again = tomllib.loads(scene_files.toml_text(data))
    assert _sorted(again) == _sorted(data)  # values stand before tables


def _sorted(x):
    if isinstance(x, dict):
        return repr(sorted((k, _sorted(v)) for k, v in x.items()))
    return repr([_sorted(v) for v in x]) if isinstance(x, list) else repr(x)


def test_a_file_is_short_and_has_units(tmp_path):
    changes = {"arm.l1": 0.3, "servo.x.G.damping": 50.0, "gain.x": 2.0}
    changes["operator.y"] = hc.Operator(0.5)
    scenario = with_fields(hc.free(), {**changes, "operator.x": None, "length": None})
    assert scenario.save(tmp_path / "s.toml").read_text() == (
        'schema = "hapticclay-scenario-2"\n'
        'name = "free"\n'
        "gain = [2.0, 0.5]  # 1/kg\n"
        'length = "none"  # m\n'
        "\n[operator]\n"
        'x = "none"\n'
        "\n[operator.y]\n"
        "mass = 0.5  # kg\n"
        "\n[arm]\n"
        "l1 = 0.3  # m\n"
        "\n[servo.x.G]\n"
        "damping = 50.0  # 1/s\n"
    )


TOML = """
experiment = "constant"
b = "70 N.s/m"
gain = [1, 0.4]
force.x = 2
operator = {mass = "250 g", damper = 2, spring = 6}
clay = ["4 cm", "0.1 m"]
dt = "0.36 ms"
length = 120e-3
torque_limit = 20

[arm]
l1 = "25 cm"

[servo.x.G]
damping = 50

[compensator]
num = [1, 20]
den = [1, 50, 400, 0]

[muscle]
kind = "multisine"
rms.x = 0.5
seed = 3.0
"""


def test_a_file_by_hand_starts_from_an_experiment(tmp_path):
    (tmp_path / "mine.toml").write_text(TOML)
    s = hc.Scenario.load(tmp_path / "mine.toml")
    servo = hc.Scenario().servo
    plain = hc.constant_cut(
        70.0, (1.0, 0.4), (2.0, 0.0), clay=(0.04, 0.1), length=0.12, torque_limit=(20.0, 20.0)
    )
    assert s == dataclasses.replace(
        plain,
        name="mine",
        operator=hc.Operator(0.25),
        arm=hc.Arm(0.25),
        servo=(dataclasses.replace(servo[0], G=SecondOrder(910.19, 50.0, 910.19)), servo[1]),
        compensator=hc.Compensator((1.0, 20.0), (1.0, 50.0, 400.0, 0.0)),
        muscle=hc.Multisine((0.5, 0.0), seed=3),
    )
    assert s.dt == 0.36e-3


def test_a_pair_may_be_a_list_of_tables(tmp_path):
    (tmp_path / "s.toml").write_text("[[compensator]]\nnum = [2.0]\n[[compensator]]\n")
    s = hc.Scenario.load(tmp_path / "s.toml")
    assert s.compensator == (hc.Compensator((2.0,)), hc.Compensator())
    with pytest.raises(ParameterError, match="must be a pair"):
        (tmp_path / "s.toml").write_text("[[compensator]]\nnum = [2.0]\n")
        hc.Scenario.load(tmp_path / "s.toml")


@pytest.mark.parametrize(
    "text,said",
    [
        ("l1 = 0.3", "l1 = 0.3: no such field; did you mean 'arm.l1'?"),
        ("[arm]\nl3 = 0.3", "arm.l3 = 0.3: no such field; there are l1, l2, I1, I2; did you"),
        ("[servo.x.G]\ndampin = 1", "servo.x.G.dampin = 1: no such field"),
        ("[servo.x.G]\ndampin = 1", "did you mean 'servo.x.G.damping'?"),
        ("[servo.z]\nG = 1", "servo.x.z.G = 1: no such field; there are G, S"),
        ("[servo.x.G]\ndamping = -1", "servo.x.G.damping = -1: must be a finite number > 0"),
        ("[arm]\nl1 = -1", "arm.l1 = -1: must be a finite number >= 0.001 and <= 100 m (in "),
        ("[arm]\nl1 = true", "arm.l1 = True: must be a finite number >= 0.001 and <= 100 m"),
        ("[arm]\nl1 = 'wide'", "arm.l1 = 'wide': must be a finite number >= 0.001"),
        ("[arm]\nl1 = '3'", "arm.l1 = '3': must be a finite number"),
        ("[arm]\nl1 = '3 kg'", "arm.l1 = '3 kg': must be a number in m, not in kg"),
        ("[arm]\nl1 = '3 ells'", "arm.l1 = '3 ells': must be a number in m; unknown unit 'ells'"),
        ("[arm]\nl1 = 1979-05-27", "arm.l1 = datetime.date(1979, 5, 27): must be a finite"),
        ("arm = 3", "arm = 3: must be an Arm"),
        ("[[arm]]\nl1 = 3", "arm = [{'l1': 3}]: must be an Arm"),
        ("dt = nan", "dt = nan: must be a finite number"),
        ("shaping = 1", "shaping = 1: must be True or False"),
        ("integrator = 'fats'", "did you mean 'fast'?"),
        ("gain = [1, 2, 3]", "gain = (1, 2, 3): must be 2 numbers (x, y), got 3"),
        ("gain = [1, '2 kg']", "gain.1 = '2 kg': must be a number in 1/kg, not in kg"),
        ("gain.z = 1", "gain.z = 1: no such field"),
        ("start = [5, 5]", "unreachable"),
        ("[clay.x]\nedges = [0]\nvalues = [1, 2]", "clay = {'x': "),
        ("[clay.x]\nedges = [0]\nvalues = [1, 2]", "lacks clay.y"),
        ("[clay.x]\nedges = [0]\nvalues = [-1, 2]", "clay.x.values[0] = -1: must be"),
        ("[clay.x]\nvalues.1 = 2", "clay.x.values.1 = 2: no such entry: clay.x.values is not"),
        ("[compensator]\nden = []", "compensator.den = (): must be 1 to 5 numbers"),
        ("[muscle]\nkind = 'multisin'", "did you mean 'multisine'?"),
        ("[muscle]\nlow = 0", "muscle.low = 0: must be a finite number > 0 Hz"),
        ("experiment = 'constnat'", "did you mean 'constant'?"),
        ("experiment = 3", "experiment = 3: must be one of constant, variable"),
        ("experiment = 'constant'\nbb = 3", "bb = 3: no such field; did you mean 'b'?"),
        ("experiment = 'constant'\nb = -3", "b = -3: must be a finite number >= 0"),
        ("b = 3", "b = 3: no such field"),
        (
            "schema = 'hapticclay-record-1'",
            "must be a scenario; its schema is 'hapticclay-record-1'",
        ),
        ("schema = 'hapticclay-scenario-9'", "must be one of hapticclay-scenario-2"),
        ("dt.x = 3", "dt.x = 3: no such field: dt has no parts"),
        ("'' = 3", " = 3: no such field"),
        ("x.''.'y.z' = 3", "no such field"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path, text, said):
    file = tmp_path / "s.toml"
    file.write_text(text)
    with pytest.raises(ParameterError) as e:
        hc.Scenario.load(file)
    assert said in str(e.value) and "\n" not in str(e.value)
    (tmp_path / "s.json").write_text(json.dumps(tomllib.loads(text), default=str))
    with pytest.raises(ParameterError):
        hc.Scenario.load(tmp_path / "s.json")


@pytest.mark.parametrize(
    "name,raw,said",
    [
        ("s.toml", b"a = = 3", "must be TOML: Invalid value (at line 1, column 5)"),
        ("s.toml", b"dt = 1\ndt = 2", "must be TOML: Cannot overwrite a value"),
        ("s.toml", b"name = '\xff'", "must be TOML: byte 8 is not UTF-8"),
        ("s.json", b'{"a": }', "must be JSON: Expecting value: line 1 column 7"),
        ("s.json", b'{"dt": 1, "dt": 2}', "must be JSON: 'dt' is given twice"),
        ("s.json", b"[1]", "must be JSON: it holds no table"),
        ("s.json", b'{"dt": NaN}', "dt = nan"),
        ("s.json", b"[" * 100_000, "must be JSON: "),
        ("s.toml", b"a = " + b"[" * 100_000, "must be TOML: "),
        ("s.yaml", b"", "must be a .toml or a .json file"),
        ("s", b"", "must be a .toml or a .json file"),
    ],
)
def test_what_is_no_scenario_file_is_named(tmp_path, name, raw, said):
    (tmp_path / name).write_bytes(raw)
    with pytest.raises(ParameterError) as e:
        hc.Scenario.load(tmp_path / name)
    assert said in str(e.value) and "\n" not in str(e.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    (tmp_path / "d.toml").mkdir()
    for name, said in (("none.toml", "No such file"), ("d.toml", "not a regular file")):
        with pytest.raises(ParameterError, match=said):
            hc.Scenario.load(tmp_path / name)
    with pytest.raises(ParameterError, match="must be a regular file, is a folder"):
        hc.Scenario().save(tmp_path / "d.toml")
    with pytest.raises(ParameterError, match=r"must be a .toml or a .json file"):
        hc.Scenario().save(tmp_path / "s.txt")
    with pytest.raises(ParameterError, match="name = .*UTF-8"):
        hc.Scenario(name="\ud800").save(tmp_path / "s.toml")
    assert os.listdir(tmp_path) == ["d.toml"]


def test_a_file_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    file = hc.Scenario().save(tmp_path / "s.toml")
    before = file.read_text()

    def full(*args):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(ParameterError, match="No space left"):
        hc.Scenario(dt=1e-3).save(file)
    assert file.read_text() == before and os.listdir(tmp_path) == ["s.toml"]


@examples(15)
@given(scenarios(), st.data())
def test_any_number_of_any_part_is_changed_by_name(scenario, data):
    """The same change made with dataclasses.replace, part by part, is the oracle."""
    axis = data.draw(st.sampled_from([0, 1]))
    a, other = "xy"[axis], 1 - axis
    part = data.draw(st.sampled_from(["G", "S"]))
    x = data.draw(POSITIVE)
    got = with_fields(scenario, {f"servo.{a}.{part}.damping": x})
    servo = list(scenario.servo)
    block = dataclasses.replace(getattr(servo[axis], part), damping=x)
    servo[axis] = dataclasses.replace(servo[axis], **{part: block})
    assert got == dataclasses.replace(scenario, servo=tuple(servo))
    hands = list(scenario.operators)
    hands[axis] = dataclasses.replace(hands[axis] or hc.Operator(), mass=0.5)
    entry = {".mass": 0.5} if scenario.operators[axis] else {"": hands[axis]}
    changes = {f"operator.{a}{name}": value for name, value in entry.items()}
    got = with_fields(scenario, {f"gain.{a}": x, **changes})
    assert got.operators == tuple(hands)
    assert (got.gain[axis], got.gain[other]) == (x, scenario.gain[other])
    got = with_fields(scenario, {f"compensator.{a}.den.1": x})
    den = list(scenario.compensators[axis].den)
    den[1] = x
    assert got.compensators[axis].den == tuple(den)
    assert got.compensators[other] == scenario.compensators[other]
    if scenario.clay:
        got = with_fields(scenario, {f"clay.{a}.values.0": x})
        assert getattr(got.clay, a).values == (x, *getattr(scenario.clay, a).values[1:])
    assert with_fields(scenario, {}) == scenario


@pytest.mark.parametrize(
    "changes,expected",
    [
        ({"gain": 2}, dict(gain=(2.0, 2.0))),
        ({"gain": 2, "gain.x": 1}, dict(gain=(1.0, 2.0))),
        ({"gain.x": 1.5, "gain": 2}, dict(gain=(1.5, 2.0))),
        ({"gain.0": 1.5}, dict(gain=(1.5, 0.5))),
        ({"torque_limit.elbow": 5}, dict(torque_limit=(40.0, 5.0))),
        ({"torque_limit.y": 5}, dict(torque_limit=(40.0, 5.0))),
        ({"operator": {}}, dict(operator=hc.Operator())),
        ({"operator": "none"}, dict(operator=None)),
        (
            {"operator.x": {"mass": 1, "damper": 2, "spring": 6}},
            dict(operator=(hc.Operator(1.0), None)),
        ),
        (
            {"operator": {"mass": 1.0, "damper": 2.0, "spring": 6.0}, "operator.x.damper": 3.0},
            dict(operator=(hc.Operator(1.0, 3.0), hc.Operator(1.0))),
        ),
        ({"compensator.den": [1, 5, 0]}, dict(compensator=hc.Compensator(den=(1.0, 5.0, 0.0)))),
        ({"compensator": hc.Compensator((3.0,))}, dict(compensator=hc.Compensator((3.0,)))),
        (
            {"compensator": ([1.0], [1.0, 2.0])},
            dict(compensator=hc.Compensator((1.0,), (1.0, 2.0))),
        ),
        ({"arm": {"l1": 0.3}, "arm.l2": "40 cm"}, dict(arm=hc.Arm(0.3, 0.4))),
        ({"muscle.rms.y": 1.0}, dict(muscle=hc.Multisine((1.0, 1.0)))),
        ({"servo": hc.Scenario().servo[1]}, dict(servo=(hc.Scenario().servo[1],) * 2)),
        ({"length": "None"}, dict(length=None)),
        ({"inertia_shaping": 1.0}, dict(inertia_shaping=True)),
    ],
)
def test_changes_by_name(changes, expected):
    assert with_fields(hc.Scenario(), changes) == dataclasses.replace(hc.Scenario(), **expected)


def test_one_part_for_both_axes_changes_both_of_a_pair():
    s = dataclasses.replace(hc.Scenario(), operator=(hc.Operator(1.0), hc.Operator(2.0)))
    got = with_fields(s, {"operator.spring": 9.0})
    assert got.operator == (hc.Operator(1.0, spring=9.0), hc.Operator(2.0, spring=9.0))
    both = with_fields(hc.Scenario(), {"servo.G.damping": 40.0})
    assert [v.G.damping for v in both.servo] == [40.0, 40.0]
    assert [v.G.gain for v in both.servo] == [v.G.gain for v in hc.Scenario().servo]


def test_an_experiment_takes_parameters_and_fields_at_once():
    kind = EXPERIMENTS["constant"]
    small = {"arm.l1": 0.05, "arm.l2": 0.05, "origin": [0.05, 0.03], "length": "2 cm"}
    s = kind.of({"b": 50.0}, {**small, "clay.x.values.1": 7.0})  # no reach without
    assert s.arm == hc.Arm(0.05, 0.05) and s.length == 0.02
    assert (s.clay.x.values, s.clay.y.values) == ((0.0, 7.0, 0.0), (0.0, 50.0, 0.0))
    s = kind.of({}, {"clay.begin": 0.06, "operator": True, "operator.mass": 1.0})
    assert s.clay.x.edges == (0.06, 0.15) and s.operator == hc.Operator(1.0)
    s = EXPERIMENTS["stability"].of({}, {"gain": 3.0, "gain.y": 0.2, "muscle.seed": 5.0})
    assert s.gain == (3.0, 0.2) and s.muscle.seed == 5
    s = kind.of({}, {"gain": 3.0, "gain.y": 0.2}, {"gain": 1.0})
    assert s.gain == (1.0, 1.0)  # the later goes before
    s = EXPERIMENTS["variable"].of({}, {"growth": "none", "name": "mine"})
    assert s == dataclasses.replace(hc.variable_cut("none"), name="mine")


@pytest.mark.parametrize("none", [False, 0.0, "none", None])
def test_a_hand_that_is_there_by_default_can_be_taken_away(none):
    """`--set operator=false` put the hand of the paper there."""
    kind = EXPERIMENTS["stability"]
    assert kind.of({}, {}).operator == hc.Operator()
    assert kind.of({}, {"operator": none}).operator is None
    assert hc.Scenario.of({"experiment": "stability", "operator": none}).operator is None


def test_units_of_names():
    for name, unit in (
        ("b", "N.s/m"),
        ("gain.x", "1/kg"),
        ("operator.mass", "kg"),
        ("operator.y.mass", "kg"),
        ("servo.x.G.damping", "1/s"),
        ("clay.x.values.1", "N.s/m"),
        ("hardware.friction.x", "N.m"),
        ("muscle.low", "Hz"),
        ("nothing.at.all", ""),
    ):
        assert parameter_unit(name) == unit


# Parts of several classes, as a user may add them


class Wave:
    pass


@dataclasses.dataclass(frozen=True)
class Multisine(Wave):  # usual by its name
    rms: float = 1.0


@dataclasses.dataclass(frozen=True)
class Kick(Wave):
    """A kick.

    Attributes:
        at: when [s].
    """

    at: Annotated[float, Bound(0.0, unit="s")]
    size: tuple[tuple[float, ...], ...] = ((1.0,), (2.0, 3.0))


@dataclasses.dataclass(frozen=True)
class Louder(Wave):
    wave: Wave


@dataclasses.dataclass(frozen=True)
class Together(Wave):
    waves: tuple[Wave, ...] = ()


@dataclasses.dataclass(frozen=True)
class Formula(Wave):
    f: object = math.sin


@dataclasses.dataclass(frozen=True)
class Drum:
    wave: Wave | None = None
    two: Kick | Together = Kick(1.0)
    table: Annotated[tuple[float, ...], Bound()] = ()


@pytest.mark.parametrize(
    "wave,data",
    [
        (Multisine(2.0), {"kind": "multisine", "rms": 2.0}),
        (Kick(3.0), {"kind": "kick", "at": 3.0}),
        (Louder(Kick(3.0)), {"kind": "louder", "wave": {"kind": "kick", "at": 3.0}}),
        (Together((Kick(3.0), Multisine())), [{"kind": "kick", "at": 3.0}, {"kind": "multisine"}]),
        (Together(), []),
    ],
)
def test_a_part_of_several_classes_names_its_kind(wave, data):
    drum = Drum(wave)
    assert make_part(Drum, {"wave": data}) == drum
    for full in (True, False):
        text = scene_files.toml_text(plain_data(drum, full), {})
        assert make_part(Drum, tomllib.loads(text)) == drum, text
        assert make_part(Drum, json.loads(json.dumps(plain_data(drum, full)))) == drum


def test_without_a_kind_a_part_is_of_the_usual_class():
    assert make_part(Drum, {"wave": {"rms": 3.0}}) == Drum(Multisine(3.0))
    assert make_part(Drum, {"two": {"at": 3.0}}) == Drum(two=Kick(3.0))
    assert with_fields(Drum(Kick(3.0)), {"wave.at": 4.0}) == Drum(Kick(4.0))
    assert with_fields(Drum(Kick(3.0)), {"wave.kind": "multisine"}) == Drum(Multisine())
    got = with_fields(Drum(two=Kick(1.0)), {"two.size.1.0": 9.0})
    assert got.two.size == ((1.0,), (9.0, 3.0))
    band = Drum(Together((Kick(1.0), Multisine())))
    assert with_fields(band, {"wave.waves.0.at": 2.0}).wave.waves == (Kick(2.0), Multisine())
    changed = with_fields(Drum(Together((Kick(1.0),))), {"wave": Louder(Kick(2.0))})
    assert changed == Drum(Louder(Kick(2.0)))
    for data, said in (
        ({"wave": {"kind": "kik"}}, "did you mean 'kick'?"),
        ({"wave": {"kind": "kick"}}, "lacks wave.at"),
        ({"wave": {"at": 3.0}}, "wave.at = 3.0: no such field; there are rms"),
        (
            {"wave": [{"kind": "kick", "at": "3 kg"}]},
            "wave.waves.0.at = '3 kg': must be a number in s",
        ),
    ):
        with pytest.raises(ParameterError) as e:
            make_part(Drum, data)
        assert said in str(e.value)
    names = [f.name for f in leaves(Drum)]
    assert "wave.rms" in names and "wave.at" in names and "two.at" in names


def test_a_function_is_no_data():
    with pytest.raises(ParameterError, match="wave.f = .*cannot be written to a file"):
        plain_data(Drum(Formula()))
    left_out: list[str] = []
    assert plain_data(Drum(Formula()), left_out=left_out)["wave"] is None and left_out == ["wave"]


PREFIXES = {"u": -6, "m": -3, "c": -2, "": 0, "k": 3, "M": 6}


@given(
    st.decimals(-1000, 1000, places=5),
    st.sampled_from(list(PREFIXES)),
    st.sampled_from(["m", "s", "N", "N.s/m", "N/m", "1/m"]),
)
def test_a_prefix_is_a_power_of_ten_rounded_once(x, prefix, unit):
    """Against exact fractions; the prefix stands before the first metre, second or newton."""
    given_unit = f"1/{prefix}m" if unit == "1/m" else prefix + unit
    exact = Fraction(x) * Fraction(10) ** (PREFIXES[prefix] * (-1 if unit == "1/m" else 1))
    assert units.from_unit(f"{x} {given_unit}", unit) == float(exact)


@pytest.mark.parametrize(
    "text,unit,value",
    [
        ("5cm", "m", 0.05),
        ("0.36 ms", "s", 0.36e-3),
        ("90 N.s/m", "N.s/m", 90.0),
        ("90 N*s/m", "N.s/m", 90.0),
        ("90 kg/s", "N.s/m", 90.0),
        ("0.09 N.s/mm", "N.s/m", 90.0),
        ("30 N.s/m per s", "N.s/m per s", 30.0),
        ("2 1/kg", "1/kg", 2.0),
        ("500 g", "kg", 0.5),
        ("3 kN", "N", 3000.0),
        ("3 µm", "m", 3e-6),
        ("4 kg.cm^2", "kg.m^2", 4e-4),
        ("1 Hz", "rad/s", math.tau),
        (f"{math.tau!r} rad/s", "Hz", 1.0),
        ("180 deg", "rad", math.pi),
        ("1e999 m", "m", math.inf),
        ("5", "m", None),
        ("five m", "m", None),
        ("", "m", None),
    ],
)
def test_quantities(text, unit, value):
    assert units.from_unit(text, unit) == value


@pytest.mark.parametrize(
    "text,unit", [("5 kg", "m"), ("5 m", ""), ("5 m/s", "m"), ("1 1/s", "Hz"), ("1 furlong", "m")]
)
def test_another_kind_of_unit_is_refused(text, unit):
    with pytest.raises(ParameterError) as e:
        errors.quantity("f", text, unit)
    assert text.split()[1] in str(e.value) and unit in str(e.value)


def test_every_unit_of_a_bound_is_known():
    for kind in (hc.Scenario, *EXPERIMENTS.values()):
        for field in leaves(kind):
            unit = field.unit
            if unit.endswith("^n"):  # of a consistency, which depends on n
                assert units.parse_unit(unit) is None
                continue
            assert not unit or units.parse_unit(unit), field.name
    assert nodes_of(hc.Scenario)["dt"].bound.unit == "s"


def test_words():
    words = [
        "arm.l1=0.3",
        "gain=1,0.5",
        "inertia_shaping=TRUE",
        "dt=0.1ms",
        "growth=30/s",
        "clay=4cm,6cm",
    ]
    assert named_values("--set", words) == {
        "arm.l1": 0.3,
        "gain": [1.0, 0.5],
        "inertia_shaping": True,
        "dt": "0.1ms",
        "growth": "30/s",
        "clay": ["4cm", "6cm"],
    }
    for words in (["b"], ["=3"], ["b=1", "b=2"], ["b:3"]):
        with pytest.raises(ParameterError, match="must be name=value, each name once"):
            named_values("--set", words)


def test_nested_names():
    assert nested({"a.b": 1, "a": 2, "c": {"d.e": 3}}) == {
        "a": {"b": 1, None: 2},
        "c": {"d": {"e": 3}},
    }


NOT_GIVEN = ("muscle.", "command.", "hardware.", "controller.", "clay.groove.")


def test_the_fields_of_a_scenario_are_all_there():
    """By name, each holds what the scenario itself holds there."""
    scenario = hc.Scenario(
        clay=hc.Clay(
            hc.Profile((0.0,), (1.0, 2.0), springs=(hc.Spring(), hc.Spring(k=3.0))),
            hc.Profile((), (1.0,)),
        ),
        operator=hc.Operator(),
    )
    for field in leaves(hc.Scenario, part=scenario):
        if field.default is UNSET or field.name.startswith(NOT_GIVEN):
            continue
        x = scenario
        for name in field.name.split("."):
            if isinstance(x, hc.Arm) and name not in hc.Arm.__dataclass_fields__:
                break  # of an arm from a file
            if isinstance(x, tuple):
                x = x[int(name)] if name.isdecimal() else x[("x", "y").index(name)]
            else:
                x = getattr(x, name)
        else:
            assert x == field.default or np.all(x == field.default)


def test_an_array_of_tables_is_a_sum(tmp_path):
    path = tmp_path / "sum.toml"
    path.write_text(
        """[[muscle]]
rms = [0.3, 0.0]

[[muscle]]
kind = "step"
value = [1.0, 0.0]
time = "20 ms"
"""
    )
    scenario = hc.Scenario.load(path)
    assert scenario.muscle == hc.Multisine((0.3, 0.0)) + hc.Step((1.0, 0.0), 0.02)
    text = scenario.save(path).read_text()
    assert text.count("[[muscle]]") == 2 and "parts" not in text
    assert hc.Scenario.load(path) == scenario
    scaled = dataclasses.replace(scenario, muscle=2.0 * scenario.muscle)
    assert hc.Scenario.load(scaled.save(path)) == scaled


@pytest.mark.parametrize("Ts", [1e-3, 1e-4, 3.6e-4, 7.3e-4, 0.02, 1e-6])
def test_a_step_that_is_not_given_divides_the_sample(Ts, tmp_path):
    s = hc.Scenario(control="sampled", Ts=Ts)
    assert s.dt <= hc.Scenario().dt * (1 + 1e-6)
    assert s.Ts / s.dt == pytest.approx(round(s.Ts / s.dt), abs=1e-6)
    assert (round(s.Ts / s.dt) - 1) * hc.Scenario().dt < Ts  # no more parts than that takes
    file = tmp_path / "a.toml"
    file.write_text(f'control = "sampled"\nTs = {Ts!r}\n')
    words = {"control": "sampled", "Ts": Ts}
    made = (
        hc.Scenario.load(file), hc.constant_cut(**words), with_fields(hc.Scenario(), words),
        EXPERIMENTS["free"].of(words), dataclasses.replace(hc.Scenario(), **words),
    )  # fmt: skip
    assert [x.dt for x in made] == [s.dt] * len(made)
    s.save(tmp_path / "b.toml")
    assert hc.Scenario.load(tmp_path / "b.toml") == s


@pytest.mark.parametrize("dt", [3.6e-4, 3e-4])
def test_a_step_that_is_given_stays_and_the_nearest_sample_is_named(dt):
    n = round(1e-3 / dt)
    with pytest.raises(hc.ParameterError, match=f"nearest is {n * dt:.10g} s; or dt = 0.000333"):
        hc.Scenario(control="sampled", Ts=1e-3, dt=dt)


@pytest.mark.parametrize(
    ("given", "path"),
    [
        ({"operator.mass": 0.3}, "operator.mass"),
        ({"operator": {"mass": 0.3, "spring": 2.0}}, "operator.mass"),
        ({"operator.y.damper": 1.0}, "operator.y.damper"),
        ({"operator": "none", "operator.mass": 0.3}, "operator.mass"),
    ],
)
def test_a_hand_is_added_whole_or_not_at_all(given, path, tmp_path):
    """A mass alone took damper and spring of the paper along."""
    file = tmp_path / "a.toml"
    file.write_text('experiment = "constant"\n')
    for make in (
        lambda: with_fields(hc.constant_cut(), given),
        lambda: EXPERIMENTS["constant"].of({}, given),
        lambda: hc.Scenario.load(file, given),
    ):
        with pytest.raises(hc.ParameterError, match="adds a hand") as caught:
            make()
        assert caught.value.field == path
    hand = hc.Operator(0.3, 0.0, 4.0)
    whole = {"operator.mass": 0.3, "operator.damper": 0.0, "operator.spring": 4.0}
    assert with_fields(hc.constant_cut(), whole).operator == hand
    mass = {"operator.mass": whole.pop("operator.mass")}
    assert hc.Scenario.load(file, mass, whole).operator == hand
    s = dataclasses.replace(hc.constant_cut(), operator=hc.Operator())
    assert with_fields(s, {"operator.mass": 0.3}).operator == hc.Operator(0.3)


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path):
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbft_max = 2.0\n")
    assert hc.Scenario.load(tmp_path / "a.toml").t_max == 2.0


def test_a_pipe_is_refused_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.toml")
    os.mkfifo(tmp_path / "record.npz")
    for load, file in ((hc.Scenario.load, "a.toml"), (hc.Record.load, "record.npz")):
        with pytest.raises(ParameterError, match="not a regular file"):
            load(tmp_path / file)


def test_plain_data_is_of_the_class_that_has_its_names():
    """Without a kind: an arm from a file has `file`, a law of joints has gains."""
    data = {"arm": {"file": "planar_2r"}, "controller": {"Kp": [1.0, 2.0], "Kd": [0.1, 0.1]}}
    s = hc.Scenario.of({**data, "Ts": "2 ms"})
    assert s.arm.names == ("shoulder", "elbow") and s.controller.Kp == (1.0, 2.0)
    assert hc.Scenario.of({"arm": {"l1": 0.3}}).arm == hc.Arm(l1=0.3)
    with pytest.raises(hc.ParameterError, match="no such field"):
        hc.Scenario.of({"arm": {"l1": 0.3, "file": "planar_2r"}})


def test_a_scene_of_an_arm_from_a_file_returns_from_its_file(tmp_path):
    arm = hc.MjcfArm("leader_7", armature={"joint3": 0.2}, pose={"joint4": 0.5})
    law = hc.JointPD((1.0,) * 7, (0.1,) * 7, friction=[(0.1, 2.0, 0.0)] * 7)
    s = hc.Scenario(arm=arm, controller=law, Ts=2e-3, operator=hc.Operator())
    t = hc.Scenario.load(s.save(tmp_path / "arm.toml"))
    assert t.controller == law and t.arm.armature == arm.armature and t.arm.pose == arm.pose
    assert np.array_equal(t.arm.mass_matrix(), arm.mass_matrix())


def test_an_arm_is_found_beside_the_scenario_that_names_it(tmp_path, monkeypatch):
    """From any folder; a file of the same name in the present one is not taken in its place."""
    arms = Path(hc.__file__).parents[1] / "mjcf" / "arms"
    (tmp_path / "rig").mkdir()
    (tmp_path / "rig" / "arm.xml").write_text((arms / "haptic_3.xml").read_text())
    (tmp_path / "arm.xml").write_text((arms / "planar_2r.xml").read_text())
    (tmp_path / "rig" / "run.toml").write_text(
        'control = "sampled"\n[arm]\nfile = "arm.xml"\n'
        "[controller]\nKp = [1, 1, 1]\nKd = [0.01, 0.01, 0.01]\n"
    )
    monkeypatch.chdir(tmp_path)
    assert len(hc.Scenario.load("rig/run.toml").arm.names) == 3
    monkeypatch.chdir(tmp_path / "rig")
    assert hc.Scenario.load("run.toml").arm.file == "arm.xml"
