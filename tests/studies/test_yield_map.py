"""Limit cycles and sticking in runs, against the describing function and the exact cycles."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import stability
from hapticclay.studies import yield_map as study
from hapticclay.studies.boundary import PushedLoop
from hapticclay.studies.yield_map import measured_cycle, yielding_run
from hapticclay.theory.relay_cycle import critical_push
from hapticclay.views.stability_map_plots import yield_map_plot
from tests.hunt import some

Y = PushedLoop("y", K=1.0, inertia_shaping=True)


def cycle_of(flow, speed, dt=3.6e-4, t_max=6.0):
    """The cycle of a run that begins at a speed."""
    run = yielding_run(replace(Y, b=flow.b, push=speed), flow, t_max)
    record = hc.simulate(replace(run, dt=dt))
    assert record.outcome.code in ("time limit", "diverged")  # the verdict on an even oscillation
    return measured_cycle(record, "y")


CYCLES = [  # not in 100 N and 50 N.s/m: 10 m/s, 0.3 m to either side, is out of the arm's reach
    (Fy, b) for Fy in (0.1, 1.0, 10.0, 100.0) for b in (0.0, 30.0, 50.0) if Fy * b < 5000.0
]


@pytest.mark.parametrize("Fy, b", some(CYCLES, 6))
def test_runs_end_in_the_predicted_cycle(Fy, b):
    flow = hc.Flow(Fy=Fy, b=b)
    predicted = next(x for x in hc.theory.limit_cycles(Y.linear, flow) if x.kind == "limit cycle")
    exact = next(x for x in hc.theory.exact_cycles(Y.linear, flow) if x.stable)
    run = cycle_of(flow, 1.2 * exact.speed)
    assert run is not None and predicted.trusted
    assert run.fundamental == pytest.approx(predicted.speed, rel=0.10)
    assert run.omega == pytest.approx(predicted.omega, rel=0.05)
    # what is left of the start after 33 periods, at b = 50 0.91^66, and (dt omega)^2
    assert run.speed == pytest.approx(exact.speed, rel=1e-3)
    assert run.amplitude == pytest.approx(exact.amplitude, rel=1e-3)
    assert run.omega == pytest.approx(exact.omega, rel=2e-4)


def test_a_cycle_in_a_run_is_of_the_order_of_the_method():
    flow = hc.Flow(Fy=1.0)
    exact = next(x for x in hc.theory.exact_cycles(Y.linear, flow) if x.stable)
    coarse, fine = (
        abs(cycle_of(flow, exact.speed, dt).amplitude / exact.amplitude - 1.0)
        for dt in (4e-3, 2.5e-4)
    )
    # between them the ends of the way fall beside samples, more or less
    assert math.log(coarse / fine, 16.0) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("flow", [hc.Flow(K=5.0, n=0.5, b=10.0), hc.Flow(Fy=2.0, K=5.0, n=0.3)])
def test_runs_in_thinning_clay_end_in_the_predicted_cycle(flow):
    predicted = next(x for x in hc.theory.limit_cycles(Y.linear, flow) if x.kind == "limit cycle")
    run = cycle_of(flow, 1.2 * predicted.speed, t_max=8.0)
    assert run is not None and predicted.trusted
    assert run.fundamental == pytest.approx(predicted.speed, rel=0.10)
    assert run.omega == pytest.approx(predicted.omega, rel=0.05)
    shifted = predicted.speed * (1.0 + predicted.speed_shift)
    assert run.fundamental == pytest.approx(shifted, rel=5e-3)  # second order in the shift


@pytest.mark.parametrize("K", [0.8, 1.0, 2.5])
def test_the_edge_of_sticking_is_that_of_runs(K):
    loop, flow = replace(Y, K=K, b=30.0), hc.Flow(Fy=10.0, b=30.0)
    push = critical_push(loop.linear, flow=flow)
    below, above = (
        hc.simulate(yielding_run(replace(loop, push=share * push), flow, 2.0))
        for share in (0.98, 1.02)
    )
    assert not np.any(below.v[-100:, 1])  # at rest, exactly
    assert np.any(above.v[-100:, 1])


def test_a_push_that_cannot_go_on():
    assert critical_push(Y.linear, flow=hc.Flow(Fy=1.0, b=5000.0)) == math.inf
    assert critical_push("x", hc.Flow(Fy=1.0), 1.0) == math.inf


def test_no_clay_stops_a_loop_that_is_unstable_when_it_is_held():
    unstable = hc.Compensator((1.0, 1.0), (1.0, -5.0, 0.0))
    flow = hc.Flow(Fy=1.0)
    assert hc.theory.push_outcomes("x", flow, 0.1, compensator=unstable)[0] != "sticks"
    assert critical_push("x", flow, 0.1, compensator=unstable) == 0.0


@pytest.fixture(scope="module")
def small_map():
    patch = pytest.MonkeyPatch()
    patch.setattr(study, "YIELD_FORCES", (0.5, 60.0))
    chart = study.yield_map(replace(Y, b=30.0), quick=True)
    patch.undo()
    return chart


def test_runs_of_the_map_do_what_theory_says(small_map):
    assert 0.5 < small_map.least < 0.6 and small_map.limit == pytest.approx(1.789, rel=1e-3)
    assert {c.simulated for c in small_map.cells} == {"sticks", "limit cycle", "grows"}
    for c in small_map.cells:
        assert c.simulated == c.expected
        if c.expected == "limit cycle":
            assert c.speed == pytest.approx(c.exact, rel=0.02)  # settled to 1 % a quarter
    assert "0 of 16 runs" in small_map.text()


def test_the_map_is_drawn(small_map):
    ax, bar = yield_map_plot(small_map).axes
    assert ax.get_xlabel() == "yield force Fy [N]" and ax.get_ylabel() == "gain K [1/kg]"
    assert "[mm/s]" in bar.get_ylabel()
    wrong = replace(small_map.cells[0], simulated="grows")
    text = replace(small_map, cells=(wrong,)).text()
    assert "1 of 1 runs end otherwise" in text
    labels = yield_map_plot(replace(small_map, cells=(wrong, *small_map.cells[1:]))).axes[0]
    assert "unlike theory" in labels.get_legend_handles_labels()[1]


def test_coulomb_clay_has_a_map_too(monkeypatch):
    monkeypatch.setattr(study, "YIELD_FORCES", (1.0, 10.0))
    monkeypatch.setattr(study, "GAINS", (0.5, 2.0))
    monkeypatch.setattr(study, "classify_push", lambda loop, flow: ("sticks", math.nan))
    monkeypatch.setattr(study, "critical_push", lambda loop, flow: 1.0)
    chart = study.yield_map(replace(Y, b=0.0), quick=True)
    assert chart.limit == math.inf and 0.5 < chart.least < 0.65
    assert all(math.isfinite(x) for x in chart.speed)
    assert len(yield_map_plot(chart).axes[0].get_legend_handles_labels()[1]) >= 3


def test_a_loop_that_never_buzzes_has_no_map(monkeypatch):
    monkeypatch.setattr(study, "GAINS", (1e-3, 1e-2))
    with pytest.raises(hc.ParameterError, match="no gain gives a limit cycle"):
        study.yield_map(Y)


# ---- the command ---------------------------------------------------------------------------------


def test_the_command_predicts(tmp_path, capsys):
    folder = tmp_path / ("long" * 20)  # a path has the length that it has
    command = stability.StabilityCommand(
        "y", gain=1.0, operator=False, clay=("Fy=5", "b=30"), out=folder
    )
    assert command() == 0
    out = capsys.readouterr().out
    assert out.startswith("Linear loop in clay of b = 30 N.s/m alone (yield force left out)\n")
    assert "Bingham clay, Fy = 5, b = 30; in continuous time without delay:\n" in out
    assert "the linear loop is unstable at a damping of 62.06 to 3903 N.s/m\n" in out
    assert "a small push: sticks, a large one: limit cycle" in out
    told, _, paths = out[out.index("Bingham") :].partition("written to ")
    assert all(len(line) <= 80 for line in told.splitlines()) and paths.startswith(str(folder))
    clay = json.loads((folder / "stability.json").read_text())["clay"]
    assert [x["kind"] for x in clay["predicted"]] == ["threshold", "limit cycle"]
    threshold, cycle = clay["predicted"]
    assert cycle["speed"] == pytest.approx(4.0 * 5.0 / (math.pi * (62.06292 - 30.0)), rel=1e-5)
    assert cycle["trusted"] and not threshold["trusted"]
    assert len(clay["exact"]) == 2


def test_the_command_without_clay_that_yields(tmp_path, capsys):
    assert stability.StabilityCommand(out=tmp_path)() == 0
    assert json.loads((tmp_path / "stability.json").read_text())["clay"] is None
    out = capsys.readouterr().out
    assert "describing" not in out and "alone" not in out
    assert json.loads((tmp_path / "stability.json").read_text())["asked"]["b"] == 90.0


def test_the_command_takes_no_damping_that_is_not_given(tmp_path, capsys):
    for words, b, shown in (("Fy=5", None, 0.0), ("Fy=5", 30.0, 30.0), ("Fy=5 b=30", None, 30.0)):
        stability.StabilityCommand("x", gain=0.1, b=b, clay=(words,), out=tmp_path)()
        asked = json.loads((tmp_path / "stability.json").read_text())
        assert asked["asked"]["b"] == asked["clay"]["flow"]["b"] == shown
        assert "the linear loop is stable at any damping" in capsys.readouterr().out
    stability.StabilityCommand("x", gain=0.1, clay=("Fy=5 K=2 n=0.5",), out=tmp_path)()
    head = "Linear loop in clay of b = 0 N.s/m alone (yield force and consistency left out)"
    assert head in capsys.readouterr().out


def test_clay_of_words():
    assert stability.clay_of(("Fy=5", "K=2", "n=0.5"), 9.0) == hc.Flow(5.0, 2.0, 0.5, 9.0)
    assert stability.clay_of(("Fy=5 b=30",)) == stability.clay_of(("Fy=5",), 30.0)
    assert stability.clay_of(("Fy=5",)) == hc.Flow(Fy=5.0)
    assert stability.clay_of(("stiff", "clay")) == hc.materials.material("stiff clay")


@pytest.mark.parametrize(
    ("words", "b", "told"),
    [
        ("Fx=5", None, "one of Fy, K, n, b"),
        ("Fy=a", None, "a number"),
        ("Fy=5 K", None, "names"),
        ("", None, "a material"),
        ("Fy=5 Fy=6", None, "given once"),
        ("Fy=5 b=30", 9.0, "given once"),
        ("Fy=5 n=0.5", None, "beside K > 0"),
        ("stiff clay", 9.0, "which has its own"),
    ],
)
def test_clay_of_words_that_say_nothing(words, b, told):
    with pytest.raises(hc.ParameterError, match=told):
        stability.clay_of((words,), b)
