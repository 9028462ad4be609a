"""Labs: their runs find what theory says, and their commands and results behave."""

import functools
import json

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app, console
from hapticclay.errors import ParameterError
from hapticclay.results import Result, plain
from hapticclay.studies import labs


@functools.cache
def made(name):
    told = []
    lab = hc.studies.lab(name, quick=True, tell=told.append)
    assert told and lab.name == name
    return lab


@pytest.fixture(params=tuple(labs.LABS))
def found(request):
    return made(request.param)


def not_again(name, monkeypatch):
    """The command takes the lab that is there, if it asks for its quick form."""
    lab = made(name)
    monkeypatch.setitem(labs.LABS, name, lambda quick, tell: quick and lab)


def test_a_lab_has_a_table_questions_figures_and_a_run(found, tmp_path):
    assert len(found.questions) == 3 and len({len(x) for x in found.columns.values()}) == 1
    assert found.title in repr(found) and found._repr_html_().startswith("<table")
    assert found.to_frame().shape[1] == len(found.columns)
    assert found.plot().axes and isinstance(found.scene, hc.Scenario | hc.Pair)
    again = Result.load(found.save(tmp_path / "lab.json"))
    assert plain(again) == plain(found)


def test_its_runs_find_what_theory_says(found):
    c = {name.partition(" [")[0]: np.array(x) for name, x in found.columns.items()}
    if found.name == "wall":
        # growth ends within 0.2 %, the step of the engine takes 0.1 %
        assert c["stable K by runs"] == pytest.approx(c["exact"], rel=3e-3)
        assert c["passive K by runs"] * c["Ts"] == pytest.approx(1e3 * 2.0 * labs.DAMPER, rel=5e-3)
    elif found.name == "zwidth":
        assert c["stable K by runs"] == pytest.approx(c["exact"], rel=3e-3)
    elif found.name == "delay":
        assert c["stable K by runs"] == pytest.approx(c["rule"], rel=0.01)  # of first order
        assert np.all(c["passive K by runs"] <= 1.001 * c["stable K by runs"])
    elif found.name == "pair":
        step = 0.5e3 * labs.ARM_TS  # runs are tried at whole steps: the last stable one
        assert np.all((c["delay by runs"] <= c["exact"]) & (c["exact"] < c["delay by runs"] + step))
        # opposed arms of two springs Kp at each end of a mass: to the damping's share, 2 %
        assert c["frequency"] == pytest.approx(np.sqrt(2.0 * c["Kp"] / 1.0) / 2.0 / np.pi, rel=0.02)
    else:
        # a step's share of the spread, and four standard errors
        gap = np.abs(c["by staircases"] - c["of the observer"])
        assert np.all(gap < 0.006 + 4.0 * c["standard error"])
        assert c["noticed"][:2] == pytest.approx([70.7, 79.4], abs=0.05)


def test_what_is_felt_is_the_stiffness_that_is_rendered():
    exact = labs.felt_changes(hc.Device(0.1, 2.0))
    # force over indentation at rest; what still swings after 0.3 s is below 1e-3
    assert exact == pytest.approx(labs.CHANGES, abs=2e-3)
    rough = labs.felt_changes(labs.ROUGH)
    # the spring holds within half a quantum: 0.05 mm of 4 mm of indentation, twice
    assert 1e-4 < np.max(np.abs(rough - exact)) < 2.0 * 0.5 * 1e-4 / 4e-3 * 1.5


def test_command_prints_questions_and_writes_numbers_and_figures(tmp_path, capsys, monkeypatch):
    not_again("jnd", monkeypatch)
    assert app.main(["lab", "jnd", "--quick", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "1 up, 2 down" in out and "3. An encoder" in out
    data = json.loads((tmp_path / "lab.json").read_text())
    assert data["lab"] == "jnd" and len(data["tables"]["jnd"]["rule"]) == 3
    assert (tmp_path / "staircase.png").is_file() and (tmp_path / "observer.png").is_file()


def test_an_unknown_lab_is_refused(capsys):
    assert app.main(["lab", "zwith"]) == 2 and "zwidth" in capsys.readouterr().err
    with pytest.raises(ParameterError, match="did you mean 'wall'"):
        hc.studies.lab("walls")


def test_view_shows_the_run_of_the_lab(tmp_path, monkeypatch):
    from hapticclay.cli import view

    not_again("jnd", monkeypatch)
    monkeypatch.setattr(console, "deliver", lambda *given: None)
    shown = []
    monkeypatch.setattr(view, "replay", lambda record, tool: shown.append((record, tool)))
    assert app.main(["lab", "jnd", "--quick", "--view", "--out", str(tmp_path)]) == 0
    (((record, tool),),) = (shown,)
    assert record.scenario.name == "virtual wall" and tool.width > 0.0


@pytest.mark.parametrize("Kp", [4e3, 1.6e4])
def test_the_rule_of_delay_is_the_limit_of_stiff_pairs(Kp, monkeypatch):
    """Of first order: what is left is a twelfth of the squared angle of the delay, to a quarter."""
    monkeypatch.setattr(labs, "ARM_TS", 1e-5)
    limits = hc.theory.pair_limits(labs.pushed_pair(Kp, 0))
    angle = 2.0 * np.pi * limits.frequency * limits.delay
    left = labs.delay_rule(Kp) / limits.delay - 1.0
    assert left == pytest.approx(angle**2 / 12.0, rel=0.25)


def test_view_shows_the_pair_of_the_lab(tmp_path, monkeypatch):
    from hapticclay.cli import view

    not_again("pair", monkeypatch)
    monkeypatch.setattr(console, "deliver", lambda *given: None)
    shown = []
    monkeypatch.setattr(view, "show_pair", shown.append)
    assert app.main(["lab", "pair", "--quick", "--view", "--out", str(tmp_path)]) == 0
    assert shown[0].link.delay == pytest.approx(11e-3)
