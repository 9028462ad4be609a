"""A run of a pair beside the verdict of theory: why they differ, and a run where they do not."""

import math
import re
from dataclasses import replace

import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.studies.pair_disagreement import disagreement, push

DEVICE = hc.Device(0.5, 1.0)
LAW = hc.JointPD((900.0,), (5.0,))
PAIR = hc.Pair(DEVICE, DEVICE, LAW, hc.Link(delay=30e-3), Ts=1e-3, t_max=1.0)


def words(pair):
    return disagreement(pair, hc.theory.pair_limits(pair), hc.simulate(pair))


def test_nothing_is_said_where_run_and_theory_agree():
    assert not hc.theory.pair_limits(PAIR).stable and words(PAIR) == ""
    assert words(replace(PAIR, link=hc.Link())) == ""


@pytest.mark.parametrize("friction", [2.0, 5.0])
def test_friction_that_holds_a_push_is_named_and_the_push_that_is_offered_grows(friction):
    rubs = replace(DEVICE, friction=friction)
    pair = replace(PAIR, leader=rubs, follower=rubs)
    text = words(pair)
    assert f"friction (up to {friction:g} N, at x) holds this push" in text
    newtons = float(re.search(r"--push (\d+)", text)[1])
    assert newtons > 1.0 and words(replace(pair, muscle=push(newtons))) == ""


def test_growth_too_slow_for_the_run_is_said_and_the_run_that_is_offered_shows_it():
    """A whole sample beyond the largest delay of the link."""
    late = math.ceil(hc.theory.pair_limits(PAIR).delay / PAIR.Ts) * PAIR.Ts
    slow = replace(PAIR, link=hc.Link(delay=late))
    pair = replace(slow, t_max=0.2)
    text = words(pair)
    assert "it would grow by" in text
    span = float(re.search(r"--run (\d+)", text)[1])
    assert words(replace(pair, t_max=span)) == ""


def test_a_pair_that_nothing_pushes():
    assert "give --push" in words(replace(PAIR, muscle=None))


def test_the_command_offers_a_push_that_can_be_given(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pair.toml").write_text(
        'Ts = "1 ms"\n[leader]\nmass = 0.5\ndamper = 1.0\nfriction = 2.0\n'
        '[law]\nKp = [900.0]\nKd = [5.0]\n[link]\ndelay = "30 ms"\n'
    )
    assert app.main(["pair", "pair.toml", "--run", "1"]) == 0
    note = capsys.readouterr().out.splitlines()[-1]
    assert note.startswith("note: theory says unstable, the run does not grow")
    more = re.search(r"--push \d+", note)[0].split()
    assert app.main(["pair", "pair.toml", "--run", "1", *more]) == 0
    assert "note:" not in capsys.readouterr().out
