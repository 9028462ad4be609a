"""Baselines: what they know is right, and better knowledge earns more."""

import functools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hapticclay as hc
from benchmarks import gym_scores
from hapticclay.cli import app
from hapticclay.gym import adaptive_gain, baselines, probe_clay, scores


def test_the_robust_gain_is_below_that_of_each_published_hand():
    """A hundred hands from the population, whose corners it is made of."""
    for hand in hc.studies.POPULATIONS["published range"].sample(100, seed=0):
        assert baselines.robust_gain(40.0) <= baselines.oracle_gain(40.0, hand) * (1 + 1e-12)


SEARCHED = json.loads((Path(__file__).parents[2] / "docs" / "gym_scores.json").read_text())


@pytest.mark.parametrize("family", gym_scores.FAMILIES)
def test_scores_0_and_1_are_the_best_of_all_shares_that_were_searched(family):
    """By the returns of each episode, not by the means that the search kept."""
    found = SEARCHED["families"][family]
    means = {
        x: math.fsum(r) / len(r) for x, r in zip(found["shares"], found["returns"], strict=True)
    }
    best = max(means, key=means.__getitem__)
    policy = baselines.BASELINES[scores.ID][family]
    assert policy == gym_scores.FAMILIES[family](best) and found["share"] == best
    assert {round(best + 0.01 * k, 2) for k in (-2, -1, 1, 2)} <= means.keys()
    assert min(means) < 0.75 < 1.15 < max(means)  # no end of the search is near the best
    assert all(len(r) == len(gym_scores.SEEDS) == SEARCHED["seeds"] for r in found["returns"])


@pytest.mark.parametrize("family, share", [("best fixed gain", 1.08), ("best oracle", 0.84)])
def test_returns_of_the_search_are_those_of_its_episodes(family, share):
    """Of one seed; the file holds four decimals, so half of the last."""
    found = SEARCHED["families"][family]
    again = gym_scores.search(family, [share], [3], around=0, engine="auto")
    told = found["returns"][found["shares"].index(share)][3]
    assert again.totals == pytest.approx(told, abs=5.1e-5) and again.best == share


def test_no_fixed_gain_that_was_searched_scores_above_0_nor_oracle_above_1():
    """The gain of 1.2 times the robust one, 1.08 of the limit, is score 0 itself."""
    means = {
        (name, x): float(np.mean(r))
        for name, found in SEARCHED["families"].items()
        for x, r in zip(found["shares"], found["returns"], strict=True)
    }
    zero, one = (
        means[name, SEARCHED["families"][name]["share"]] for name in scores.ANCHORS[scores.ID]
    )
    told = {f"{name} {x}": mean for (name, x), mean in means.items()}
    score = scores.scores_of(scores.ID, {"best fixed gain": zero, "best oracle": one, **told})
    assert score["best fixed gain"] == 0.0 and score["best oracle"] == 1.0
    assert max(x for name, x in score.items() if "fixed" in name) == 0.0
    assert max(score.values()) == 1.0
    assert score["best fixed gain 0.9"] < -1.0


def test_scores_need_the_returns_of_both_anchors():
    with pytest.raises(hc.ParameterError, match="best oracle"):
        scores.scores_of(scores.ID, {"best fixed gain": -10.0})
    assert scores.scores_of("CutLine-v0", {"random": 1.0}) == {}
    with pytest.raises(hc.ParameterError, match="best oracle"):
        gym_scores.search("oracle")


def test_a_hand_is_identified_from_its_own_equation():
    """A mass on a damper and a spring under known tones, solved by SciPy to 1e-10.

    The device at its other side grows lighter from 0.5 to 0.7 s, as where K rises: tones alone
    cannot tell the hand from its muscle. Trapezoids of 10 ms err by h^2 w^2/12, 0.5 % at the 25
    rad/s of the fastest transient; the fit may amplify that sixfold.
    """
    m, d, k, dt = 0.4, 4.0, 60.0, 0.01
    tones = [2.0 * math.pi * f for f in adaptive_gain.TONES]

    def push(t):
        return sum(3.0 * np.sin(w * t + i) for i, w in enumerate(tones))

    def lightness(t):
        return 1.0 + 3.0 * np.clip((t - 0.5) / 0.2, 0.0, 1.0)  # K [1/kg]

    def acceleration(t, x, v):
        K = lightness(t)
        return (push(t) - (d + 10.0 / K) * v - k * x) / (m + 1.0 / K)

    t = np.arange(150) * dt
    x, v = solve_ivp(
        lambda t, y: (y[1], acceleration(t, *y)), (0.0, t[-1]), (0.0, 0.0), t_eval=t,
        rtol=1e-10, atol=1e-12, max_step=dt,
    ).y  # fmt: skip
    fh = push(t) - m * acceleration(t, x, v) - d * v - k * x
    found = baselines.hand_from(v, fh, dt)
    assert found.mass == pytest.approx(m, rel=0.03)
    assert found.damper == pytest.approx(d, rel=0.03)
    assert found.spring == pytest.approx(k, rel=0.03)


def test_an_answer_names_the_clay_exactly():
    """log10 and powers of 10, to rounding of some eps."""
    x, y = probe_clay.answer_of(87.0, 2.2)
    assert 50.0 * 10.0 ** (0.8 * x) == pytest.approx(87.0, rel=1e-14)
    assert 1.5 * 10.0 ** (0.8 * y) == pytest.approx(2.2, rel=1e-14)


def test_the_pd_law_follows_the_line_where_random_actions_do_not(monkeypatch, capsys):
    """And the command prints what each earns."""
    returns = functools.cache(baselines.returns)
    found = {
        name: returns("CutLine-v0", maker, range(2), engine="auto")
        for name, maker in baselines.BASELINES["CutLine-v0"].items()
    }
    monkeypatch.setattr(baselines, "returns", returns)
    line = ["gym", "baselines", "CutLine-v0", "--seeds", "2", "--engine", "auto"]
    assert app.main(line) == 0
    rows = capsys.readouterr().out.splitlines()
    for name, seen in found.items():
        (row,) = [row for row in rows if name in row]
        assert f"{seen.total.mean():.2f}" in row
    assert found["PD along the line"].info["is_success"].all()
    assert not found["random"].info["is_success"].any()


def test_least_squares_names_the_clay_within_a_tenth():
    """Finite differences of velocities that are calm; both numbers, in two episodes."""
    found = baselines.returns("ProbeClay-v0", baselines.least_squares, range(2), engine="auto")
    assert (found.total > -0.2).all()


def test_means_have_intervals_of_the_normal_law():
    mean, half = baselines.mean_of(np.array([1.0, 2.0, 3.0, 4.0]))
    assert mean == 2.5
    assert half == pytest.approx(1.96 * math.sqrt(5.0 / 3.0) / 2.0, rel=1e-15)
