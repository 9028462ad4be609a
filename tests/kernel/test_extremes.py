"""Stiff and extreme scenes beside a reference with a verdict of its own."""

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest

import hapticclay as hc
from benchmarks import extremes, pages, reference
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.model.signals import Multisine
from tests.oracles import piecewise_linear, shaken, store

CASES = extremes.cases()
LISTED = (
    "clay b",
    "speed",
    "hand",
    "gain K",
    "step dt",
    "torque limits",
    "start",
    "borders",
    "reach",
    "force",
    "time",
    "sampled",
    "accurate",
)


def tolerance(case):
    """Bound of the position error [m].

    A few um beside stiff borders; more where motors reach their limits between samples.
    """
    s = case.scenario
    if (
        case.group == "reach" or s.gain[0] > 1e3
    ):  # thrown into the singularity, where any torque is too little
        return 2e-4
    return 5e-5 if s.dt > 1e-3 or min(s.torque_limit) < 1.0 else 1e-5


def stored(case, s, times):
    """The reference solution of a case, from the disk."""
    name = re.sub(r"\W+", "-", f"{case.group} {case.name}")
    if s.muscle:
        return store.solution(f"extremes-{name}", shaken.solve, *shaken.case(s, times))
    return store.solution(f"extremes-{name}", reference.solve, s, times)


@pytest.mark.parametrize(
    "case", [c for c in CASES if c.quick], ids=lambda c: f"{c.group}: {c.name}"
)
def test_verdict_is_the_reference_s_and_energy_is_bounded(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    row = extremes.run(case, lambda *at: stored(case, *at))
    assert row["agree"], row
    assert row["nan"] == 0 and row["warnings"] == 0 and not list(tmp_path.iterdir())
    if row["reference"] not in ("unstable", "limit cycle"):
        assert (
            row["energy"] is None
            and "force: none" in f"{case.group}: {case.name}"
            or row["energy"] < 1.01
        ), row
        assert row["position"] < tolerance(case), row
    if case.scenario.operator is None and case.scenario.integrator == "fast":
        assert row["residual"] < 1e-10, row


def test_registry_covers_the_list():
    assert tuple(dict.fromkeys(c.group for c in CASES)) == LISTED
    assert len({(c.group, c.name) for c in CASES}) == len(CASES)
    s = [c.scenario for c in CASES]
    b = [v for x in s if x.clay for v in x.clay.x.values]
    assert min(b) == 0.0 and max(b) == 1e9
    assert max(math.hypot(*x.velocity) for x in s) == pytest.approx(2.0)
    hands = [x.operator for x in s if x.operator]
    assert max(h.spring for h in hands) == 1e7 and {0.0, 100.0} <= {h.mass for h in hands}
    assert min(x.gain[0] for x in s) == 1e-6 and max(x.gain[0] for x in s) == 1e4
    assert min(x.dt for x in s) == 1e-5 and max(x.dt for x in s) == 1e-2
    assert min(x.torque_limit[0] for x in s) == 0.1 and max(x.t_max for x in s) == 3600.0


def test_published_verdicts_agree_and_nothing_escaped():
    rows = pages.load(Path(__file__).parents[2] / "docs" / "bench")["extremes"]["rows"]
    assert [(r["group"], r["name"]) for r in rows] == [(c.group, c.name) for c in CASES]
    for r in rows:
        assert r["nan"] == 0 and r["warnings"] == 0 and r["ours"] != "raised", r
        assert r["energy"] is None or r["energy"] < 1.05, r
    assert {r["ours"] for r in rows} == {
        "finished",
        "time limit",
        "stalled",
        "saturated",
        "diverged",
        "limit cycle",
        "out of reach",
        "singular",
    }


def test_a_scene_that_raises_is_a_row(monkeypatch):
    monkeypatch.setattr(hc, "simulate", lambda *a, **k: 1 / 0)
    row = extremes.run(CASES[0])
    assert row["ours"] == "raised" and not row["agree"] and "ZeroDivisionError" in row["note"]
    assert "ZeroDivisionError" in "\n".join(extremes.sections({"rows": [row]}))


# The reference is checked too, by what is simpler still


def test_reference_is_the_matrix_exponential_where_the_loop_is_linear():
    s = hc.constant_cut(inertia_shaping=True, operator=hc.Operator(), force=(2.0, 0.0), t_max=3.0)
    t = np.linspace(0.0, 2.9, 50)
    x = reference.solve(s, t)
    crossings, position = piecewise_linear(
        (0.05, 0.15), (0.0, 90.0), 1.0, 2.0, (0.25, 2.0, 6.0), t_max=3.0
    )
    assert x.crossings[0][2] == pytest.approx(crossings[0], abs=1e-9)
    np.testing.assert_allclose(x.p[:, 0], position(t), atol=1e-9)


def test_reference_finds_the_poles_of_the_linear_loop():
    s = hc.constant_cut(gain=(1.0, 1.0), origin=(0.35, 0.24), start=(0.0, 0.0), length=0.1)
    loop = reference.Loop(s)
    sigma = loop.growth(loop.start(), (90.0, 90.0))
    poles = np.concatenate([hc.theory.closed_loop_poles(a, 1.0, 90.0) for a in ("x", "y")])
    assert sigma == pytest.approx(max(p.real for p in poles if abs(p) > 0.5), rel=1e-5)


def test_reference_crosses_borders_both_ways():
    clay = Clay(Profile((0.0,), (0.0, 500.0)), Profile((), (0.0,)))
    muscle = Multisine(rms=(2.0, 0.0), low=1.0, high=3.0, period=4.0, seed=3)
    s = dataclasses.replace(
        hc.free(force=(0.0, 0.0), t_max=2.0), clay=clay, muscle=muscle, length=None
    )
    t = np.linspace(0.0, 1.99, 2000)
    x = store.solution("extremes-both-ways", shaken.solve, *shaken.case(s, t))
    ways = [
        float(np.interp(u + 1e-3, t, x.p[:, 0]) - np.interp(u - 1e-3, t, x.p[:, 0]))
        for *_, u in x.crossings[1:-1]
    ]
    assert min(ways) < 0.0 < max(ways)
    r = hc.simulate(s)
    assert np.max(np.abs(np.interp(t, r.t, r.p[:, 0]) - x.p[:, 0])) < 1e-5


def test_sliding_is_where_the_bounces_on_a_border_tend_to(monkeypatch):
    """Said to slide from a bounce of 0.1 um on, the handle stays where it bounces."""
    s = next(c.scenario for c in CASES if c.name == "along the border, from on it")
    s = dataclasses.replace(s, t_max=0.6)
    t = np.linspace(0.0, 0.599, 600)
    bounces = reference.solve(s, t)
    monkeypatch.setattr(reference, "BOUNCE", 1e-7)
    slides = reference.solve(s, t)
    assert not bounces.slides and slides.slides and len(slides.crossings) < len(bounces.crossings)
    assert np.max(np.abs(slides.p - bounces.p)) < 2e-5
