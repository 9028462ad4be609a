"""Staircases on observers whose psychometric function is known."""

import math
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.studies.staircase import Observer, Staircase, run_staircase, staircase_mean

SEEN = Observer(threshold=1.0, spread=0.3)
FINE = Staircase(down=2, fall=0.05, rise=0.05, start=1.2, reversals=120, skipped=20)


def mean_turn(rule, observer):
    """Mean level at the turns, of the Markov chain of level, row of noticed and last direction.

    Independent of any run: the stationary distribution by a linear solve. Steps must be equal.
    """
    levels = rule.start + rule.rise * np.arange(-40, 41)
    levels, n = levels[levels >= 0.0], rule.down
    states = [(i, k, d) for i in range(len(levels)) for k in range(n) for d in (-1, 1)]
    at = {s: j for j, s in enumerate(states)}
    P, turn = np.zeros((len(states),) * 2), np.zeros(len(states))
    for (i, k, d), j in at.items():
        p, up = observer.notices(levels[i]), min(i + 1, len(levels) - 1)
        P[j, at[up, 0, 1]] += 1.0 - p
        turn[j] += (1.0 - p) * (d < 0)
        if k + 1 < n:
            P[j, at[i, k + 1, d]] += p
        else:
            P[j, at[max(i - 1, 0), 0, -1]] += p
            turn[j] += p * (d > 0)
    A = np.vstack((P.T - np.eye(len(states)), np.ones(len(states))))
    share = np.linalg.lstsq(A, np.append(np.zeros(len(states)), 1.0))[0]
    weight = share * turn
    return float(weight @ [levels[i] for i, _, _ in states] / weight.sum())


@pytest.mark.parametrize("down", [1, 2, 3])
def test_the_mean_of_staircases_is_that_of_their_markov_chain(down):
    rule = replace(FINE, down=down)
    mean, error = staircase_mean(rule, SEEN, 60)
    assert abs(mean - mean_turn(rule, SEEN)) < 4.0 * error  # 4 sigma, seeded
    assert error < 0.02


@pytest.mark.parametrize(("down", "share"), [(1, 0.5), (2, 0.7071), (3, 0.7937)])
def test_small_steps_end_where_levitt_says(down, share):
    """Levitt's table: 50, 70.7 and 79.4 %; the chain's own turns, as the steps go to nothing."""
    rule = replace(FINE, down=down)
    assert rule.share == pytest.approx(share, abs=5e-5)
    known = SEEN.difference(rule.share)
    steps = (0.1, 0.05, 0.025)
    off = [
        mean_turn(replace(rule, fall=s, rise=s, start=round(known / s) * s), SEEN) - known
        for s in steps
    ]
    assert abs(off[-1]) < 0.3 * steps[-1] + 0.01 and abs(off[-1]) <= abs(off[0]) + 1e-3


def test_weighted_steps_end_where_kaernbach_says():
    rule = Staircase(down=1, fall=0.01, rise=0.03, start=1.2, reversals=400, skipped=40)
    assert rule.share == 0.75
    mean, error = staircase_mean(rule, SEEN, 30)
    # turns lie within a step of where the walk has no drift
    assert abs(mean - SEEN.difference(0.75)) < 4.0 * error + rule.rise


def test_the_psychometric_function_is_that_of_a_gaussian():
    assert SEEN.notices(1.0) == 0.5
    assert SEEN.notices(1.3) == pytest.approx(0.5 * (1.0 + math.erf(1.0 / math.sqrt(2.0))))
    for lapse in (0.0, 0.1):
        one = replace(SEEN, lapse=lapse)
        assert one.notices(one.difference(0.7)) == pytest.approx(0.7, rel=1e-12)
    assert replace(SEEN, lapse=0.1).notices(1e3) == pytest.approx(0.95)
    with pytest.raises(ParameterError, match="between 0.05 and 0.95"):
        replace(SEEN, lapse=0.1).difference(0.97)


def test_a_run_follows_its_rule_and_is_repeatable():
    run = run_staircase(FINE, SEEN, seed=4)
    again = run_staircase(FINE, SEEN, seed=4)
    assert np.array_equal(run.levels, again.levels) and len(run.turns) == FINE.reversals
    row = 0
    for before, after, seen in zip(run.levels, run.levels[1:], run.noticed, strict=False):
        row = row + 1 if seen else 0
        way = -1 if row == FINE.down else 0 if seen else 1
        assert after == pytest.approx(before + 0.05 * way)
        row = 0 if way else row
    assert run.estimate == np.mean(run.levels[run.turns[FINE.skipped :]])


def test_a_staircase_that_never_turns_is_refused():
    never = Staircase(start=0.0, fall=1.0, rise=1e-9, reversals=10_000, skipped=0)
    with pytest.raises(ParameterError, match="within 100000 trials"):
        run_staircase(replace(never, down=1), Observer(1e5, 1.0))
    with pytest.raises(ParameterError, match="staircase.skipped"):
        Staircase(reversals=4, skipped=4)
    assert hc.studies.Staircase is Staircase
