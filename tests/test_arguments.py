"""Arguments at the door of every public function and class: kinds, names, units."""

import importlib
import inspect
import math
import pickle
import pkgutil
import re
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay import errors, units
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.fields import node_of, nodes_of
from hapticclay.scene.experiments import EXPERIMENTS
from tests.good_values import good_values, required
from tests.public import NAMES

CALLED = ("progress", "announce", "draw", "f", "law")  # functions of the caller's own
MOST_CALLS = 300  # of functions of ours in one call of the test: a longer one is past the door


def junk_function(*args, **given):
    return None


def deep_list():
    value = [1.0]
    for _ in range(3000):
        value = [value]
    return value


JUNK = [1, "x", None, object(), [], {}, math.nan, 10**400, np.array([]), junk_function]
JUNK += [np.array(1.0), np.array(None, dtype=object), deep_list(), "x" * 3000, 1j]


class Enough(BaseException):
    """A call was let in and works."""


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    return good_values(tmp_path_factory.mktemp("good"))


def public_callables():
    for name, made in NAMES.items():
        if callable(made) and made is not hc.Warning:
            yield name.rpartition(".")[2], made


def outcome(made, arguments):
    """What a call ended in: "result", "working", or an exception."""
    calls = 0

    def count(frame, event, _):
        nonlocal calls
        if event == "call" and frame.f_globals.get("__name__", "").startswith("hapticclay"):
            calls += 1
            if calls > MOST_CALLS:
                raise Enough

    sys.setprofile(count)
    try:
        made(**arguments)
    except Enough:
        return "working"
    except Exception as error:
        return error
    finally:
        sys.setprofile(None)
    return "result"


@pytest.mark.filterwarnings("ignore")
def test_junk_is_refused_at_the_door(good, monkeypatch, tmp_path):
    """Junk for each argument in turn gives ParameterError or an answer: no other exception."""
    for module in pkgutil.walk_packages(hc.__path__, "hapticclay."):  # none while calls are counted
        if not re.search(r"views|native|stable_baselines|__main__", module.name):
            importlib.import_module(module.name)
    monkeypatch.chdir(tmp_path)
    wrong, tried, refused = [], 0, 0
    for name, made in public_callables():
        arguments = required(name, made, good)
        for word, p in inspect.signature(made).parameters.items():
            if p.kind in (p.VAR_KEYWORD, p.VAR_POSITIONAL):
                continue
            for junk in JUNK:
                if junk is junk_function and word in CALLED:
                    continue
                ended, tried = outcome(made, {**arguments, word: junk}), tried + 1
                refused += isinstance(ended, ParameterError)
                if isinstance(ended, Exception) and not isinstance(ended, ParameterError):
                    wrong.append(f"{name}({word}={errors._short(junk)}): {ended!r}")
    assert not wrong, "\n".join(wrong)
    assert tried > 4000 and refused > tried / 2


def test_a_folder_that_holds_no_runs_is_refused(tmp_path):
    trials = hc.studies.Trials(
        hc.VirtualWall(K=100.0), {"K": hc.studies.Distribution("uniform", 1.0, 9.0)}
    )
    for out in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(ParameterError, match="holds no runs") as e:
            hc.studies.stored_runs(trials, out)
        assert e.value.field == "out"


# ---- unknown names ------------------------------------------------------------------------------


def test_every_public_name_suggests_the_nearest_argument(good):
    """The last letter twice in the name of each argument of each public function and dataclass."""
    asked = [
        *public_callables(),
        *((f"EXPERIMENTS[{name!r}]", kind) for name, kind in EXPERIMENTS.items()),
        *((f"SCENARIOS[{name!r}]", made) for name, made in hc.SCENARIOS.items()),
    ]
    own = (ParameterError, hc.Bound, hc.Figure, hc.Sample, hc.Signal, hc.ports.DeviceServer)
    own += (hc.ports.PairServers,)
    count = 0
    for name, made in asked:
        if made in own or (isinstance(made, type) and issubclass(made, tuple)):
            continue
        known = inspect.signature(made).parameters
        if any(p.kind is p.VAR_KEYWORD for p in known.values()):
            continue
        for word in known:
            if len(word) < 4:
                continue
            wrong, count = word + word[-1], count + 1
            if wrong in known:
                continue
            with pytest.raises(ParameterError, match=f"unexpected argument of .*{word!r}") as e:
                made(**{**required(name, made, good), wrong: 1})
            assert isinstance(e.value, TypeError) and e.value.field == wrong
            again = pickle.loads(pickle.dumps(e.value))
            assert str(again) == str(e.value)
    assert count > 400


def test_an_argument_far_from_all_lists_those_there_are():
    with pytest.raises(ParameterError, match="there are mass, damper, spring"):
        hc.Operator(qqq=1.0)  # type: ignore[call-arg]


# ---- units --------------------------------------------------------------------------------------

SIZES = {"m": ("mm", "1e-3"), "s": ("ms", "1e-3"), "N": ("kN", "1e3"), "kg": ("g", "1e-3")}


PLACES = [
    (kind, name, node.bound)
    for kind in (*EXPERIMENTS.values(), hc.Scenario, hc.Arm, hc.Operator, hc.Flow, hc.VirtualWall,
                 hc.Device, hc.Hardware, hc.theory.Loop, hc.walls.Press)
    for name, node in nodes_of(kind).items()
    if node.bound.unit and units.parse_unit(node.bound.unit) and node.arity == 1
]  # fmt: skip


def within(bound, share):
    low = bound.low if isinstance(bound.low, float) and bound.low > -1e3 else 1e-6
    return low + (min(bound.high, low + 10.0) - low) * share


def made_of(kind, **fields):
    """A part, or why it was refused."""
    try:
        return kind(**fields)
    except ParameterError as error:
        return error.field, error.bound


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(PLACES), st.floats(0.001, 1.0))
def test_a_number_with_its_unit_is_that_number(place, share):
    """In Python, in a file, and on the command line: to the last bit."""
    kind, name, bound = place
    x = within(bound, share)
    text = f"{x!r} {bound.unit}"
    extra = {"control": "sampled"} if name == "Ts" and "control" in nodes_of(kind) else {}
    plain = made_of(kind, **extra, **{name: x})
    assert made_of(kind, **extra, **{name: text}) == plain
    if not isinstance(plain, tuple):
        assert hc.with_fields(kind(**extra), {name: text}) == plain


@settings(max_examples=100, deadline=None)
@given(st.sampled_from(list(SIZES)), st.decimals(1, 999, places=3))
def test_units_of_one_kind_are_taken(unit, x):
    """Against decimals."""
    given_unit, size = SIZES[unit]
    exact = float(x * type(x)(size))
    assert errors.number("f", f"{x} {given_unit}", unit=unit) == exact
    rows = node_of(tuple[tuple[float, ...], ...], errors.Bound(unit=unit))
    table = rows.check("f", [[f"{x} {given_unit}", 1.0], (2, f"{x}{given_unit}")])
    assert table == ((exact, 1.0), (2.0, exact))
    assert errors.pair("f", [f"{x} {given_unit}", 1.0], unit=unit) == (exact, 1.0)


@pytest.mark.parametrize(
    "ask,told",
    [
        (lambda: hc.constant_cut(b="90 kg"), "b = '90 kg': must be a number in N.s/m, not in kg"),
        (lambda: hc.constant_cut(b="90"), "b = '90': must be a finite number"),
        (lambda: hc.slab("90 m"), "must be a number in N.s/m, not in m"),
        (lambda: hc.variable_cut(growth="30 N"), "must be a number in N.s/m per s, not in N"),
        (lambda: hc.variable_cut(growth="30/d"), "did you mean '30/s'"),
        (lambda: hc.Scenario(dt="1 furlong"), "must be a number in s; unknown unit 'furlong'"),
        (lambda: hc.Compensator((1.0,), (1.0, "3 m")), "must be a number without a unit"),
        (lambda: hc.studies.drift_map("8 s"), "spacing = '8 s': must be a number in m, not in s"),
    ],
)
def test_another_kind_of_unit_is_refused_everywhere(ask, told):
    with pytest.raises(ParameterError) as e:
        ask()
    assert told in str(e.value)


def test_parts_functions_and_experiments_take_units():
    slab = hc.slab("0.09 N.s/mm", "5 cm", "150 mm")
    assert slab == hc.slab(90.0, 0.05, 0.15)
    assert hc.variable_cut(growth="30 N.s/m per s") == hc.variable_cut(growth=30.0)
    cut = hc.constant_cut(control="sampled", Ts="1 ms")
    assert cut == hc.constant_cut(control="sampled", Ts=1e-3) and cut.dt < 1e-3
    assert hc.theory.Box(mass=("100 g", 1.0)) == hc.theory.Box(mass=(0.1, 1.0))
    assert hc.theory.gain_limit("x", b="90 N.s/m") == hc.theory.gain_limit("x", b=90.0)
    wall = hc.VirtualWall(K=100.0)
    trials = hc.studies.Trials(
        wall, {"K": hc.studies.Distribution("uniform", 1.0, 9.0)}, push="1 mm/s"
    )
    assert trials.push == 1e-3


@pytest.mark.parametrize(
    "words,same",
    [
        ("run constant --b 0.09N.s/mm --t-max 2000ms", "run constant --b 90 --t-max 2"),
        ("run constant --force 1e-3kN -5N", "run constant --force 1 -5"),
        ("run constant --clay=5cm 15cm", "run constant --clay=0.05 0.15"),
        ("run constant --start -5mm 0", "run constant --start -0.005 0"),
        ("stability --b=90N.s/m --delay 1ms", "stability --b=90 --delay 0.001"),
        ("mbk --hand 250g 2N.s/m 6N/m", "mbk --hand 0.25 2 6"),
        ("impedance --band 0.5Hz 30Hz", "impedance --band 0.5 30"),
        ("materials --tool-width 1cm", "materials --tool-width 0.01"),
    ],
)
def test_options_take_units(words, same):
    found, plain = (app.parse_words(x.split()) for x in (words, same))
    for name in vars(plain):
        a, b = getattr(found, name), getattr(plain, name)
        a, b = (getattr(x, "keywords", x) for x in (a, b))
        assert repr(a) == repr(b), name


@pytest.mark.parametrize("words", ["run constant --b 90kg", "stability --b 90kg"])
def test_options_refuse_another_kind_of_unit(words):
    with pytest.raises(ParameterError, match="--b = '90kg': must be a number in N.s/m, not in kg"):
        app.parse_words(words.split())


@given(st.floats(allow_nan=False), st.sampled_from(["", "e", ".3e", "E", "+.2E", "g"]))
def test_a_number_in_any_notation_has_no_unit(x, notation):
    """ "1e-5" is no unit e-5."""
    text = format(x, notation) if notation else repr(x)
    assert not units.is_quantity(text)
    if math.isfinite(x):
        assert units.is_quantity(f"{text} mm") and units.is_quantity(f"{text}mm")
