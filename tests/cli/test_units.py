"""Units in every option, and options that would do nothing."""

import json
import math
import re
import shlex
from decimal import Decimal
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay import units
from hapticclay.cli import app
from hapticclay.cli.commands import COMMANDS, load_command
from hapticclay.cli.fields import field_list
from hapticclay.cli.options import Several, options_of
from hapticclay.errors import ParameterError
from hapticclay.fields import leaves
from hapticclay.scene.changes import named_values
from hapticclay.scene.experiments import EXPERIMENTS
from hapticclay.simulation.asked_error import parse_error
from hapticclay.studies.distribution import Distribution
from hapticclay.studies.sampling import Range, parse_grid

SMALLER = {  # of each unit a smaller one, and its size
    "m": ("mm", "1e-3"), "s": ("ms", "1e-3"), "N": ("mN", "1e-3"), "kg": ("g", "1e-3"),
    "N.s/m": ("N.s/mm", "1e3"), "N/m": ("N/mm", "1e3"), "Hz": ("kHz", "1e3"),
    "m/s": ("mm/s", "1e-3"), "1/kg": ("1/g", "1e3"), "1/s": ("1/ms", "1e3"),
    "1/s^2": ("1/ms^2", "1e6"), "rad": ("mrad", "1e-3"), "N.m": ("N.mm", "1e-3"),
    "N.m/rad": ("N.mm/rad", "1e-3"), "N.m.s/rad": ("N.mm.s/rad", "1e-3"),
    "rad/s": ("mrad/s", "1e-3"),
}  # fmt: skip


def scenario_of(words):
    """The scenario that a command line makes."""
    command: Any = app.parse_words(words)
    return command.scenario


def run(capsys, words):
    code = app.main(shlex.split(words))
    out = capsys.readouterr()
    return code, out.out, out.err


@settings(max_examples=200)
@given(
    st.decimals(min_value=1, max_value=999, places=3),
    st.sampled_from([("s", "ms", "1e-3"), ("s", "us", "1e-6"), ("s", "ns", "1e-9"),
                     ("m", "um", "1e-6"), ("m", "nm", "1e-9"), ("m", "mm", "1e-3")]),
    st.sampled_from(["", " "]),
)  # fmt: skip
def test_an_error_is_a_time_or_a_length_in_any_unit(x, kind, space):
    """To the last bit, against decimals."""
    unit, given_unit, size = kind
    exact = x * Decimal(size)
    if 1e-11 <= exact <= 1:
        assert parse_error(f"{x}{space}{given_unit}") == (float(exact), unit)
    else:
        with pytest.raises(ParameterError, match="error = "):
            parse_error(f"{x}{space}{given_unit}")


@pytest.mark.parametrize("text", ["1e-6 kg", "1 Hz", "um", "", ".", "1e-6 s m"])
def test_an_error_of_another_kind_is_refused(text):
    with pytest.raises(ParameterError, match="must be a number of seconds, or of metres"):
        parse_error(text)


def unit_of(node, place):
    """Unit of a number of an option; "" for none."""
    if isinstance(node, Several):
        return node.items[0 if node.many else place].bound.unit
    return node.bound.unit


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_with_units_takes_them(command):
    """Each number of each option in a smaller unit: the number itself."""
    for option in options_of(load_command(command)).values():
        count = 2 if option.node.arity == math.inf else int(option.node.arity)
        own = [unit_of(option.node, i) for i in range(count)]
        if not option.node.takes_numbers or not all(unit in SMALLER for unit in own):
            assert not any(own), (option.name, own)
            continue
        words = [f"12.5 {SMALLER[unit][0]}" for unit in own]
        exact = tuple(float(Decimal("12.5") * Decimal(SMALLER[unit][1])) for unit in own)
        assert option.value(words) == (exact if count > 1 else exact[0]), option.name


@pytest.mark.parametrize("command", COMMANDS)
def test_an_option_whose_help_names_a_unit_takes_it(command):
    for option in options_of(load_command(command)).values():
        shown = [x for unit in re.findall(r"\[([^]]*)\]", option.about) for x in unit.split(", ")]
        if option.node.takes_numbers and all(unit in SMALLER for unit in shown):
            count = 1 if option.node.arity == math.inf else int(option.node.arity)
            own = [unit_of(option.node, i) for i in range(count)]
            assert set(own) == set(shown) or own == [""] * count and not shown, option.name


@given(st.floats(1e-6, 1e6), st.sampled_from(["kg", "s", "s^2"]), st.sampled_from(["", " "]))
def test_a_reciprocal_may_leave_out_its_one(x, unit, space):
    """2/kg is 2 1/kg, for a field in 1/kg alone."""
    assert units.from_unit(f"{x!r}{space}/{unit}", f"1/{unit}") == x
    assert units.from_unit(f"{x!r}/{unit}", "N") is None


@settings(max_examples=50)
@given(st.integers(1, 900), st.integers(2, 9))
def test_ranges_and_laws_take_units(low, ratio):
    """Against decimals."""
    a, b = (float(Decimal(x) / 1000) for x in (low, low * ratio))
    assert parse_grid(f"dt={low}ms:{low * ratio}ms:5log") == {"dt": Range(a, b, 5, True)}
    assert Range.parse("dt", f"{low}ms,{b!r}", "s") == Range(a, b, 2, False, (a, b))
    law = Distribution.parse("delay", f"uniform:{low}ms:{b!r}", "s")
    assert (law.first, law.second) == (a, b)
    with pytest.raises(ParameterError, match="must be a number in s, not in mm"):
        parse_grid(f"dt={low}mm:2:5")
    with pytest.raises(ParameterError, match="must be a number in s, not in mm"):
        Distribution.parse("delay", f"uniform:{low}mm:2", "s")


def test_clay_and_a_hand_take_units(capsys):
    from hapticclay.cli.device import trajectory_of
    from hapticclay.cli.stability import clay_of

    assert clay_of(["Fy=5000mN", "b=0.03N.s/mm"]) == clay_of(["Fy=5", "b=30"])
    found, plain = (
        trajectory_of(tuple(x.split())) for x in ("1cm 0 3cm 0 50mm/s", ".01 0 .03 0 .05")
    )
    assert found == plain
    for ask in (lambda: clay_of(["Fy=5m"]), lambda: trajectory_of(("1kg", "0"))):
        with pytest.raises(ParameterError, match="must be a number in (N|m), not in (m|kg)"):
            ask()


# ---- what an option takes, --set takes too -------------------------------------------------------


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_what_fields_shows_as_a_default_can_be_set(experiment):
    """Of each field of the built scenario: its own value, given again, changes nothing."""
    base = EXPERIMENTS[experiment].of({})
    lines = [x for x in field_list(leaves(hc.Scenario, part=base)).splitlines() if x[0] != " "]
    tried = 0
    for line in lines:
        name, _, rest = line.partition(" = ")
        value, part = re.split(r"  (?=\S)|$", rest)[0].strip(), base
        for step in name.split(".")[:-1]:
            part = part["xy".index(step)] if isinstance(part, tuple) else getattr(part, step, None)
        of_another = part is not None and not hasattr(part, name.rpartition(".")[2])
        if part is None or of_another or value == "(to be given)":
            continue  # of a part that the scenario lacks, or of another class than its own
        if name.startswith(("name", "muscle")):
            continue
        made = EXPERIMENTS[experiment].of({}, named_values("--set", [f"{name}={value}"]))
        for field in ("length", "gain", "t_max", "dt", "force", "start", "origin", "torque_limit"):
            old, new = getattr(base, field), getattr(made, field)
            assert new == old or new == pytest.approx(old, rel=1e-5), line  # six digits are printed
        tried += 1
    assert tried > 30


@pytest.mark.parametrize("words", ["--length none", "--length None", "--set length=none"])
def test_a_run_without_a_length_goes_on_for_its_time(capsys, tmp_path, words):
    code, out, _ = run(capsys, f"run free --t-max 20ms --no-plots --out {tmp_path} {words}")
    assert code == 0 and "time limit at 0.0200 s" in out
    assert hc.Record.load(tmp_path).scenario.length is None


@pytest.mark.parametrize("name,x", [("gain", 0.5), ("force", 2.0), ("torque-limit", 30.0)])
def test_one_number_sets_both_axes_of_an_option_as_of_a_field(name, x):
    one, two, field = (
        scenario_of(["run", "free", *more])
        for more in ([f"--{name}", str(x)], [f"--{name}", str(x), str(x)],
                     ["--set", f"{name.replace('-', '_')}={x}"])
    )  # fmt: skip
    assert one == two == field == scenario_of(["run", "free", f"--{name}={x}"])


def test_one_number_for_two_quantities_is_refused(capsys):
    code, _, err = run(capsys, "view constant --device ws://127.0.0.1:1 --coupling 300")
    assert code == 2 and "must be 2 numbers" in err


# ---- options that would do nothing ---------------------------------------------------------------


@pytest.mark.parametrize(
    "words,told",
    [
        ("run constant --error 1e-6 --dt 5e-3", "dt = '5e-3': is chosen by --error"),
        ("run constant --error 1e-6 --set dt=5ms", "dt = '5ms': is chosen by --error"),
        ("run constant --error 1e-6 --integrator accurate", "integrator = 'accurate': is chosen"),
        (
            "run constant --control sampled --Ts 1ms --dt 0.1ms --error 1e-6",
            "dt = '0.1ms': is chosen by --error",
        ),
        (
            "run constant --no-plots --format svg",
            "format = 'svg': is for figures, which --no-plots",
        ),
        ("run constant --render physical", "render = 'physical': is of sampled control"),
        ("run constant --set render=physical", "render = 'physical': is of sampled control"),
        ("sweep --grid b=1:5:2 --fixed b=3", "b = 3.0: is varied: leave it out of the fixed ones"),
        ("run constant --b 5 --set b=6", "--b, --set b: give one once"),
        ("accuracy constant --integrator fast", "integrator = 'fast': is varied by this command"),
        ("accuracy constant --dt 1e-3", "dt = '1e-3': is varied by this command"),
        ("view constant --force 2 0", "force = '2 0': does not apply to a session"),
        ("view constant --t-max 2", "t-max = '2': does not apply to a session"),
        ("view constant --port 8090", "port = '8090': is of the page: give --web too"),
        ("view constant --web --coupling 300 5", "coupling = '300 5': is of your device"),
        ("view constant --web --device-port 1", "is of the server: give --device-server too"),
        ("view somewhere/record --every 5", "every = '5': is for sessions"),
        ("stability --quick", "quick = True: is for a map: give --map too"),
        ("stability --map none --dpi 50", "dpi = '50': is for a map"),
        ("sweep spec.toml --fixed t_max=2", "fixed = 't_max=2': must stand in the SPEC.toml"),
        ("sweep spec.toml --grid b=1:2:2", "grid = 'b=1:2:2': must stand in the SPEC.toml"),
        ("sweep --grid b=1:2:2 --seed 3", "seed = '3': is of a sample: give --design lhs"),
        ("sweep --grid b=1:2:2 --no-maps --dpi 50", "dpi = '50': is for figures, which --no-maps"),
        ("gym dataset --seeds 5", "seeds = '5': is for baselines"),
        ("gym baselines --noise 0.2", "noise = '0.2': is for a data set"),
        ("bench --check --quick", "quick = True: is for measuring"),
        ("zwidth --B 1 2 --quick", "quick = True: tries fewer dampings"),
        ("robustness --b 50", "b = 50.0: is varied by --grid"),
        ("robustness --grid K=1:2:2 --gain 2/kg", "gain = 2.0: is varied by --grid"),
        ("compare a.toml b.toml --axis y", "axis = 'y': is for the arm"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(capsys, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    for i, name in enumerate("ab"):
        hc.VirtualWall(K=100.0 + i).save(tmp_path / f"{name}.toml")
    code, out, err = run(capsys, words)
    assert (code, out) == (2, "") and err.count("\n") == 1
    assert told in err


@pytest.mark.parametrize(
    "words,said",
    [
        ("run free --length 0.1 --length 0.2", "--length is given twice: the last counts"),
        ("run free --no-plots --plots", "--plots is given beside --no-plots: the last counts"),
        ("run free --set t_max=1 --set dt=1ms", ""),
    ],
)
def test_an_option_given_twice_is_said(capsys, words, said):
    """A script may add its own behind those of another; the last counts, as in other programs."""
    assert app.parse_words(shlex.split(words)) is not None
    err = capsys.readouterr().err
    assert err == (f"hapticclay: {said}\n" if said else "")


def test_under_sampled_control_dt_is_the_sample_of_a_requested_error():
    words = "run free --control sampled --dt 1ms --error 1um".split()
    assert scenario_of(words).dt == 1e-3


def test_a_push_that_tries_no_loop_is_said(capsys, tmp_path):
    code, _, err = run(capsys, f"zwidth --B 1 --force 2N --out {tmp_path}")
    assert code == 0 and "--force did not count: no push tries a loop that is linear" in err
    assert json.loads((tmp_path / "zwidth.json").read_text())["press"]["force"] == 2.0


@pytest.mark.parametrize(
    "words,told",
    [
        ("run constant -b 50", "-b: no option of run constant; did you mean --b?"),
        (
            "run constant -operator",
            "-operator: no option of run constant; did you mean --operator?",
        ),
        ("run constant b=50", "unexpected argument 'b=50' of run constant; did you mean --b 50?"),
        ("run constant x=50", "unexpected argument 'x=50' of run constant\n"),
        ("sweep --grid b=9:5:3", "from low to high"),
    ],
)
def test_a_slip_is_told_what_was_meant(capsys, words, told):
    code, out, err = run(capsys, words)
    assert (code, out) == (2, "") and err.count("\n") == 1 and told in err


@pytest.mark.parametrize(
    "text,plain",
    [
        ("Ns/m", "N.s/m"), ("N s/m", "N.s/m"), ("N * s / m", "N.s/m"), ("Nm", "N.m"),
        ("Ns^2/m^2", "N.s^2/m^2"), ("kg m^2", "kg.m^2"), ("mN s/m", "mN.s/m"),
        ("N.s/m per s", "N.s/m/s"),
    ],
)  # fmt: skip
def test_a_unit_may_be_written_as_in_a_paper(text, plain):
    assert units.parse_unit(text) == units.parse_unit(plain) is not None


@pytest.mark.parametrize("text", ["Nss", "Na", "N,s", "ms m s x", "", "N/", "N..s"])
def test_other_texts_are_no_units(text):
    assert units.parse_unit(text) is None


# ---- files of another kind -----------------------------------------------------------------------


@pytest.mark.parametrize("command", ["view", "video", "run"])
def test_a_file_of_another_kind_is_told_what_is_taken(capsys, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my.xml").write_text("<mujoco/>")
    code, _, err = run(capsys, f"{command} my.xml")
    assert code == 2 and "file = 'my.xml': must be a scenario file, .toml or .json" in err
    assert ("folder of a record" in err) == (command != "run") and "npz" not in err
