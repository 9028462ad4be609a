"""Runs of random pairs are those of the exact map, within a share of gain or delay."""

from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from benchmarks import pair_agreement
from hapticclay.theory.pair_build import Build


@pytest.fixture(autouse=True)
def short_runs(monkeypatch):
    """Half as long as in the study; what a map leaves of them is the same."""
    monkeypatch.setattr(pair_agreement, "SAMPLES", 200)


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_random_pairs_run_as_their_maps_say(seed):
    """One of each kind, a percent to both sides of its limits."""
    for what, pair in pair_agreement.cases(pair_agreement.drawn(seed)):
        found = pair_agreement.seen(what, pair)
        assert found.verdict == "agree", found
        assert abs(found.off) < 2e-3  # steps of a run, and how uneven 1 % to both sides is


def test_another_map_is_told():
    """Modes of a pair with 2 % more gain leave more of a run than those of its own."""
    pair = pair_agreement.drawn(0)
    record = hc.simulate(replace(pair, t_max=300 * pair.Ts))
    moved = np.diff(np.hstack([record.leader, record.follower]), axis=0)[50:]
    own, other = (
        pair_agreement.unexplained(moved, z[np.abs(z) > 0.7])
        for z in (Build(pair).loop(gain=x).eigenvalues for x in (1.0, 1.02))
    )
    assert own < 0.05 * other


def test_a_measured_force_that_is_a_sample_older_shows_in_runs():
    """Position-force at 1 kHz: 45.0 ms is unstable, 45.5 ms is not, by map and run alike."""
    hand, thing = hc.Operator(2.0, 2.0, 10.0), hc.Contact(50.0, 1.0, 3.0)
    device, law = hc.Device(6.0, 0.1), hc.JointPD((400.0,), (50.0,))
    for late in (45.0e-3, 45.5e-3):
        pair = hc.Pair(device, device, law, hc.Link("position-force", late),
                       leader_operator=hand, follower_clay=thing)  # fmt: skip
        found = pair_agreement.seen("delay", pair)
        assert (found.growth > 0.0) is (late == 45.0e-3)
        assert found.verdict == "agree" and abs(found.off) < 1e-3
