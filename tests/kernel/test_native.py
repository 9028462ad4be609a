"""The compiled kernel beside CPython, and batches beside single runs."""

import dataclasses
import functools
import math
import random
import re
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.kernel import engine
from hapticclay.kernel import native as compiled
from hapticclay.simulation import batch, engines, monitor, run
from hapticclay.simulation.record import Record
from tests.kernel import test_engines
from tests.kernel.test_engines import MORE, WAVE, native, summary_of
from tests.kernel.test_kick import CASES

ALL = CASES | MORE


def same(a, b):
    test_engines.same(a, b, "run")


@functools.cache
def alone(name):
    """The compiled run of a scene by itself."""
    return hc.simulate(ALL[name], engine="native")


@native
def test_a_run_that_ceases_to_be_calm_is_looked_at_from_its_start():
    s = hc.constant_cut(
        gain=(4.2, 0.2),
        inertia_shaping=True,
        operator=hc.Operator(),
        start=(0.05, 0.0),
        force=(0.5, 0.0),
    )
    late, monitored = run.Run(s, 1, "native"), run.Run(s, 1, "native", keep_for_monitor=True)
    for made in (late, monitored):
        made.go(None)
    assert late.judged > 3 * 4095 and late.outcome.code == "diverged"
    same(Record.of(late, 0.0), Record.of(monitored, 0.0))
    assert late.watch.seen == monitored.watch.seen >= late.judged
    thin = hc.simulate(s, every=7, engine="python")
    same(hc.simulate(s, every=7, engine="native"), thin)
    same(hc.simulate_batch([s], every=7)[0], thin)
    assert hc.simulate_batch([s], keep="summaries")["code"][0] == "diverged"
    calm = run.Run(hc.constant_cut(), 1, "native")
    calm.watch.look = None  # is not called
    calm.go(None)
    same(Record.of(calm, 0.0), hc.simulate(hc.constant_cut(), engine="native", every=1))


@native
def test_every_and_progress():
    s = hc.constant_cut(t_max=2.0)
    seen = []
    thin = hc.simulate(s, every=7, engine="native", progress=lambda t, x: seen.append((t, x)))
    full = hc.simulate(s, engine="native")
    np.testing.assert_array_equal(thin.p[:-1], full.p[:-1][::7][: len(thin.p) - 1])
    assert len(seen) >= 2 and seen == sorted(seen)


@native
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_batch_is_the_single_run_bit_for_bit_at_any_number_of_threads_and_order(threads):
    names = list(ALL)
    random.Random(threads).shuffle(names)
    records = hc.simulate_batch([ALL[n] for n in names], threads=threads)
    for name, r in zip(names, records, strict=True):
        same(r, alone(name))


@native
def test_summaries_are_those_of_the_records():
    records = [alone(name) for name in ALL]
    short = hc.simulate_batch(ALL.values(), keep="summaries")
    assert short.dtype == batch.SUMMARY
    for i, r in enumerate(records):
        assert short[i].tobytes() == summary_of(r).tobytes(), list(ALL)[i]
        assert short["code"][i] == r.outcome.code and short["residual"][i] == r.energy["residual"]
        np.testing.assert_array_equal(short["p"][i], r.p[-1])


@native
def test_a_run_that_diverges_changes_no_other():
    good = [hc.constant_cut(b=b, t_max=0.5) for b in (10.0, 50.0, 90.0)]
    alone = hc.simulate_batch(good)
    mixed = hc.simulate_batch(
        [good[0], MORE["diverged"], good[1], MORE["thrown out of reach"], good[2]]
    )
    assert [mixed[i].outcome.code for i in (1, 3)] == ["diverged", "diverged"]
    for a, b in zip(alone, mixed[::2], strict=True):
        same(a, b)


@native
def test_a_batch_takes_every_kind_of_scene(capsys):
    scenes = [
        hc.constant_cut(t_max=0.05, **kw)
        for kw in (dict(control="sampled"), dict(integrator="accurate"))
    ]
    scenes[1] = dataclasses.replace(scenes[1], muscle=WAVE)
    mixed = hc.simulate_batch([*scenes, CASES["plain"]])
    for s, r in zip(scenes, mixed, strict=False):
        same(r, hc.simulate(s, engine="python"))
        same(r, hc.simulate(s, engine="native"))
    assert capsys.readouterr().err == ""


ABSENT = {"not there": None, "of other records": SimpleNamespace(SIZES={"Model": 8})}


@pytest.fixture(params=ABSENT)
def absent(request, monkeypatch):
    """An installation without a kernel that fits; what is said of it."""
    found = ABSENT[request.param]
    monkeypatch.setitem(sys.modules, "hapticclay.native.kernel.machine", found)
    monkeypatch.setattr(engines, "_notice_given", False)
    for cached in (compiled.machine, compiled.why_not):
        cached.cache_clear()
    yield compiled.why_not()
    for cached in (compiled.machine, compiled.why_not):
        cached.cache_clear()


def test_without_the_compiled_kernel_python_runs_and_says_so_once(absent, capsys):
    assert absent
    with pytest.raises(hc.ParameterError, match=f"{re.escape(absent)}.*install"):
        hc.simulate(hc.free(t_max=0.1), engine="native")
    scenes = [hc.free(t_max=0.1), hc.constant_cut(t_max=0.1)]
    single = [hc.simulate(s) for s in scenes]
    assert capsys.readouterr().err == ""  # they take no time
    records = hc.simulate_batch(scenes)
    ends = hc.simulate_batch(scenes, keep="summaries")
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and absent in said and "install" in said
    for s, r, one, end in zip(scenes, records, single, ends, strict=True):
        same(r, hc.simulate(s, engine="python"))
        same(r, one)
        np.testing.assert_array_equal(end["p"], r.p[-1])


def test_a_long_run_in_python_says_so(absent, capsys, monkeypatch):
    monkeypatch.setattr(engines, "LONG", 100)
    hc.simulate(hc.free(t_max=0.1))
    assert capsys.readouterr().err.count("\n") == 1


@native
def test_auto_takes_the_compiled_kernel(capsys):
    assert engines.engine_for("auto", 1e9) == engines.engine_for("native") == "native"
    assert engines.engine_for("python", 1e9) == "python" and not capsys.readouterr().err


@pytest.mark.parametrize("kw", [dict(threads=0), dict(every=0), dict(keep="all")])
def test_batch_refuses_what_makes_no_sense(kw):
    with pytest.raises(hc.ParameterError, match=next(iter(kw))):
        hc.simulate_batch([hc.free(t_max=0.01)], **kw)


def test_batch_names_what_is_no_scenario():
    with pytest.raises(hc.ParameterError, match=r"scenarios\[1\]"):
        hc.simulate_batch([hc.free(), "constant"])  # type: ignore[list-item]
    with pytest.raises(hc.ParameterError, match="engine"):
        hc.simulate(hc.free(), engine="nativ")


def test_empty_batch():
    assert hc.simulate_batch([]) == []
    assert len(hc.simulate_batch(iter(()), keep="summaries")) == 0


@native
def test_an_error_in_a_thread_reaches_the_caller(monkeypatch):
    def broken(self, room=None):
        raise RuntimeError("broken")

    monkeypatch.setattr(run.Run, "advance", broken)
    with pytest.raises(RuntimeError, match="broken"):
        hc.simulate_batch([hc.free(t_max=0.1)] * 5, threads=2)


@native
def test_engine_hears_nothing_and_keeps_nothing():
    """No callback, no warning, and the time step is found where it is."""
    import mujoco

    before = mujoco.get_mju_user_warning()
    hc.simulate_batch([MORE["thrown out of reach"]] * 3)
    assert mujoco.get_mjcb_control() is None and mujoco.get_mju_user_warning() is before
    model = hc.build(hc.free())
    engine.timestep_view(model)[0] = 0.5
    assert model.opt.timestep == 0.5


@native
@pytest.mark.perf
def test_native_is_faster():
    """A guard, not the measurement, which is in docs/bench."""
    s = hc.constant_cut(start=(0.06, 0.0), t_max=3.0)
    hc.simulate(s, engine="native")
    ratio = []
    for _ in range(3):
        begin = time.process_time()
        hc.simulate(s, engine="python")
        middle = time.process_time()
        hc.simulate(s, engine="native")
        ratio.append((middle - begin) / (time.process_time() - middle))
    assert max(ratio) > 1.5


numbers = st.floats(-25.0, 25.0) | st.sampled_from([0.0, math.nan, math.inf, 1e-12, 1e-6])
WORKSPACE = run.Workspace()


@pytest.mark.parametrize("engine", ["python", pytest.param("native", marks=native)])
@given(st.data())
def test_what_the_quick_test_passes_the_monitor_passes(engine, data):
    """It spares the monitor rows with nothing to report, and no others."""
    n = data.draw(st.integers(1, 60))
    rows = np.zeros((n, 16))
    rows[:, 1] = -1.5
    kind = data.draw(st.sampled_from(["any", "swings", "limits"]))
    size, factor = data.draw(st.floats(1e-8, 1.0)), data.draw(st.floats(0.5, 2.0))
    for j in range(n):
        swing = size * factor ** (j // 6) * (-1) ** (j // data.draw(st.integers(1, 6), f"turn {j}"))
        for i in (4, 5):
            rows[j, i] = data.draw(numbers, f"v {j}") if kind == "any" else swing
    if kind == "limits":
        rows[:, 8:10] = 40.0 * np.sign(rows[:, 4:6])
    if data.draw(st.booleans(), "bent"):
        rows[data.draw(st.integers(0, n - 1)), 1] = data.draw(st.floats(-3.2, 0.0))
    s = hc.constant_cut(gain=(data.draw(st.sampled_from([0.1, 30.0])), 0.2))
    watch, row = monitor.StabilityMonitor(s), run.Run(s, 1, engine, WORKSPACE).row
    WORKSPACE.buffers.rows[:n] = rows
    parts = sorted({0, n, data.draw(st.integers(0, n), "cut")})
    for first, last in zip(parts, parts[1:], strict=False):
        if not row.is_quiet(first, last):
            return
        assert watch.look(rows[first:last, :12].T, first) == (last - first, None)
    seen = [watch.seen, watch.moved, watch.unbound, watch.often]
    assert seen == list(row.s.watch.seen)
