"""SimulationBatch: each run gives the numbers of a Simulation under the same actions."""

import os
import signal
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.kernel import native
from hapticclay.simulation import run, vectored
from hapticclay.simulation.stepwise import Sample
from tests.hunt import some
from tests.simulation.test_stepwise import CUT, HARD, HELD, SCENES, fast

SAMPLED = replace(CUT, control="sampled", Ts=7.2e-4)
YIELDS = replace(CUT, clay=hc.slab(hc.Flow(Fy=0.5, K=2.0, n=0.5), 0.001, 0.02))
SOFT = hc.Groove((-0.03, 0.07), (-0.03, 0.03), 5e3, cells=(100, 60), tool=hc.Tool(0.01, 0.005))
GROOVE = replace(CUT, clay=hc.Clay.of_groove(SOFT))
KINDS = {
    "operator": [HELD, replace(HELD, operator=hc.Operator(0.5, 5.0, 9.0))],
    "yields": [YIELDS, replace(YIELDS, clay=hc.slab(hc.Flow(Fy=0.8, K=1.0, n=0.8), 0.002, 0.02))],
    "hardware": [
        replace(SAMPLED, hardware=HARD),
        replace(SAMPLED, hardware=replace(HARD, seed=5, delay=1.4e-3)),
    ],
    "groove": [GROOVE, replace(GROOVE, clay=hc.Clay.of_groove(replace(SOFT, cells=(90, 54))))],
}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_a_fork_has_threads_of_its_own():
    """Those of its parent do not survive, and would be waited for in vain."""
    batch, alone = (hc.SimulationBatch([CUT] * 4, workers=2) for _ in range(2))
    batch.advance(10)
    alone.advance(20)
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        batch.advance(10)
        os._exit(0 if np.array_equal(batch.numbers(), alone.numbers()) else 1)
    assert os.waitpid(child, 0)[1] == 0
    batch.advance(10)
    assert np.array_equal(batch.numbers(), alone.numbers())


def assert_alike(batch, single):
    for name in Sample._fields:
        want = np.array([getattr(x.state, name) for x in single])
        assert np.array_equal(getattr(batch, name), want, equal_nan=True), name
    assert batch.outcomes == [x.outcome for x in single]
    assert np.array_equal(batch.diverging, [x.diverging for x in single])
    assert np.array_equal(batch.ended, [x.outcome is not None for x in single])


def go_on(batch, single, seed, calls, most):
    """The same random pushes for both, now and then a reset and other numbers."""
    rng = np.random.default_rng(seed)
    for call in range(calls):
        n, force = int(rng.integers(1, most)), rng.uniform(-2.0, 4.0, (len(batch), 2))
        mask = rng.random(len(batch)) < 0.8
        batch.advance(n, force=force, mask=mask)
        for k in np.flatnonzero(mask):
            single[k].advance(n, force=force[k])
        assert_alike(batch, single)
        if call % 4 == 3:
            for k in (1, *np.flatnonzero(batch.ended)):
                single[k].reset()
            batch.reset(1)
            batch.reset(batch.ended)
        if call % 6 == 2:
            batch.set([0], gain=(2.0, 1.5), b=1.7)
            single[0].set(gain=(2.0, 1.5), b=1.7)
        if call % 4 == 1:  # the gain alone
            gains = rng.uniform(0.3, 1.5, (len(batch), 2))
            batch.set(gain=gains)
            for k in np.flatnonzero(~batch.ended):
                single[k].set(gain=tuple(gains[k].tolist()))
    assert_alike(batch, single)


@fast
@pytest.mark.parametrize("name", some(KINDS, 3))  # clay that stays cut yields, too
def test_compiled_runs_of_one_kind_are_those_of_simulations(name):
    scenes = 2 * KINDS[name]
    single = [hc.Simulation(s, engine="python") for s in scenes]
    with hc.SimulationBatch(scenes, engine="native", workers=2) as batch:
        go_on(batch, single, 1, 14, 40)


@fast
@pytest.mark.parametrize("there", [True, False])
def test_a_batch_is_compiled_where_there_is_a_kernel(there, monkeypatch):
    for module in (run, vectored):
        monkeypatch.setattr(module, "CHUNK", 1024)  # rows between two looks
    if not there:
        monkeypatch.setattr(native, "why_not", lambda: "it is not built")
    scenes = KINDS["operator"]
    single = [hc.Simulation(s, engine="python") for s in scenes]
    with hc.SimulationBatch(scenes) as batch:
        assert {x.row.engine for x in batch._run.runs} == {"native" if there else "python"}
        go_on(batch, single, 3, 9, 400)


@fast
def test_more_arms_than_a_batch_keeps():
    """Of each run its own: some are drawn anew at a reset, and two threads make steps."""
    scenes = [replace(HELD, arm=hc.Arm(l1=0.25 + 1e-4 * k)) for k in range(24)]
    with hc.SimulationBatch(scenes, engine="native", workers=2) as batch:
        for k in range(40):
            batch.reset(k % 7, replace(HELD, arm=hc.Arm(l1=0.26 + 1e-4 * k)))
        single = [hc.Simulation(s, engine="python") for s in batch.scenarios]
        for n in (40, 1):
            batch.advance(n)
            for sim in single:
                sim.advance(n)
            assert_alike(batch, single)


@fast
def test_verdicts_come_when_a_simulation_has_them(monkeypatch):
    """Over several looks of the monitor: an unstable run, one that grows slowly, one that ends."""
    for module in (run, vectored):
        monkeypatch.setattr(module, "CHUNK", 1024)  # rows between two looks
    cut = replace(CUT, operator=hc.Operator(0.3, 0.0, 0.0), t_max=6.0, length=None, dt=4 * CUT.dt)
    scenes = [replace(cut, gain=(K, K)) for K in (300.0, 55.0, 1.0)]
    scenes += [replace(scenes[0], stop_when_unstable=False), replace(cut, length=0.01)]
    single = [hc.Simulation(s, engine="python") for s in scenes]
    with hc.SimulationBatch(scenes, engine="native") as batch:
        for _ in range(4):
            batch.advance(525)
            for sim in single:
                sim.advance(525)
            assert_alike(batch, single)
    assert {o.code for o in batch.outcomes if o} >= {"diverged", "finished"}


@pytest.mark.parametrize("engine", ["python", pytest.param("native", marks=fast)])
def test_runs_of_any_kinds_stand_in_one_batch(engine):
    """With signals and controllers of one's own too, which are advanced one by one."""
    law = hc.Controller(lambda t, q, qd, fh, state, params: ((-qd[0], -qd[1]), ()))
    scenes = [HELD, YIELDS, SCENES["driven"]]
    if engine == "python":
        scenes += [SCENES[x] for x in ("cut", "hand", "driven sampled", "unstable")]
        scenes += [replace(SAMPLED, controller=law, render="physical")]
    single = [hc.Simulation(s, engine="python") for s in scenes]
    with hc.SimulationBatch(scenes, engine=engine) as batch:
        go_on(batch, single, 2, 8, 30)


def test_a_reset_takes_other_scenarios_and_leaves_the_other_runs():
    others = [SCENES["hand"], replace(CUT, gain=(2.0, 2.0))]
    batch = hc.SimulationBatch([CUT] * 3, engine="python")
    batch.advance(20)
    batch.reset([0, 2], others)
    assert batch.t.tolist() == [0.0, 20 * CUT.dt, 0.0]
    batch.advance(30)
    for k, (s, n) in enumerate([(others[0], 30), (CUT, 50), (others[1], 30)]):
        single = hc.Simulation(s, engine="python")
        single.advance(n)
        assert np.array_equal(batch.p[k], single.state.p)
        assert batch.scenarios[k] == s
    batch.reset()
    assert not batch.t.any()


def test_what_is_told_is_a_copy():
    batch = hc.SimulationBatch([CUT] * 2, engine="python")
    for name in (*Sample._fields, "ended", "diverging"):
        before = getattr(batch, name)
        before += 1 if before.dtype != bool else True
        assert not np.shares_memory(before, getattr(batch, name))
        assert not np.array_equal(before, getattr(batch, name))


@pytest.mark.parametrize(
    ("field", "call"),
    [
        ("scenarios", lambda b: hc.SimulationBatch([])),
        ("scenarios[1]", lambda b: hc.SimulationBatch([CUT, None])),  # type: ignore[list-item]
        ("workers", lambda b: hc.SimulationBatch([CUT], workers=0)),
        ("force", lambda b: b.advance(force=[1.0, 2.0])),
        ("force[1, y]", lambda b: b.advance(force=[[1.0, 2.0], [0.0, np.nan]])),
        ("force", lambda b: b.advance(force="much")),
        ("mask", lambda b: b.advance(mask=[1, 0])),
        ("n", lambda b: b.advance(0)),
        ("runs", lambda b: b.reset(2)),
        ("runs", lambda b: b.reset(0.5)),
        ("scenario", lambda b: b.reset([0, 1], [CUT])),
        ("scenarios[0]", lambda b: b.reset([0], [None])),
        ("operator", lambda b: b.set(operator=hc.Operator())),
        ("b[0]", lambda b: b.set(0, b=-1.0)),
        ("gain", lambda b: b.set(gain=[[1.0, 1.0]])),
        ("gain[y]", lambda b: b.set(gain=[[1.0, 1.0], [1.0, -1.0]])),
    ],
)
def test_bad_arguments_are_refused_at_the_door(field, call):
    batch = hc.SimulationBatch([CUT] * 2, engine="python")
    with pytest.raises(ParameterError) as error:
        call(batch)
    assert error.value.field == field


@pytest.mark.parametrize("bad", [{"b": [1e4, -1.0]}, {"operator": [hc.Operator(0.5), "none"]}])
def test_a_set_that_refuses_one_run_changes_none(bad):
    scenario = replace(CUT, operator=hc.Operator(0.25, 2.0, 6.0), clay=hc.slab(9.0, 0.0, 0.2))
    batch, other = (hc.SimulationBatch([scenario] * 2, engine="python") for _ in range(2))
    for runs in (batch, other):
        runs.advance(300)
    with pytest.raises(ParameterError):
        batch.set(**bad)
    for runs in (batch, other):
        runs.advance(300)
    np.testing.assert_array_equal(batch.numbers(), other.numbers())


def test_forces_of_runs_that_rest_are_not_looked_at():
    batch = hc.SimulationBatch([CUT] * 2, engine="python")
    batch.advance(9, force=[[np.nan, 0.0], [2.0, 0.0]], mask=[False, True])
    assert batch.t.tolist() == [0.0, 9 * CUT.dt]


def test_a_closed_batch_makes_no_step():
    with hc.SimulationBatch([CUT], engine="python") as batch:
        batch.advance()
    with pytest.raises(RuntimeError, match="closed"):
        batch.advance()
