"""Compiled steps against those in Python, and batches against single runs."""

import dataclasses
import importlib.util
import json
import math
import os
import random
import re
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.model.signals import Multisine
from hapticclay.simulation import batch, engines, record
from hapticclay.simulation.record import Record
from hapticclay.stepping import engine, machine_code, monitor, run, scene
from tests.stepping.test_kick import CASES

fast = pytest.mark.skipif(
    importlib.util.find_spec("numba") is None, reason="needs numba: pip install hapticclay[fast]"
)
FIELDS = ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta")
GROWING = Clay(
    Profile((0.01,), (50.0, 100.0), growth=(0.0, 300.0)),
    Profile((0.01,), (50.0, 100.0), growth=(9.0, 0.0)),
)
WAVE = Multisine(rms=(1.0, 0.5), low=0.2, high=3.0, period=5.0, seed=5)
LAYERS = Clay(
    Profile((0.01, 0.02, 0.03), (0.0, 50.0, 500.0, 5.0)), Profile((0.001,), (10.0, 90.0), along="y")
)
MORE = {
    "whole cut": hc.constant_cut(),
    "muscle": dataclasses.replace(
        hc.free(operator=hc.Operator(), t_max=1.0), clay=GROWING, length=None, muscle=WAVE
    ),
    "command": dataclasses.replace(
        hc.free(t_max=1.0), command=dataclasses.replace(WAVE, rms=(1e-3, 2e-3))
    ),
    "growth": dataclasses.replace(hc.free(t_max=2.0), clay=GROWING),
    "layers": dataclasses.replace(hc.free(t_max=1.0, force=(1.0, 0.3)), clay=LAYERS),
    "at speed": dataclasses.replace(
        hc.constant_cut(b=1e4, t_max=0.3, torque_limit=(1e5, 1e5)), velocity=(2.0, 0.0)
    ),
    "backwards": hc.constant_cut(start=(0.06, 0.0), force=(-1.0, 0.0), t_max=1.0),
    "along a border": hc.constant_cut(start=(0.1501, 0.0), force=(0.0, 1.0), t_max=0.3),
    "diverged": hc.constant_cut(gain=(1.0, 1.0)),
    "thrown out of reach": hc.constant_cut(gain=(1e4, 1e4), torque_limit=(1e6, 1e6)),
    "unstable, goes on": dataclasses.replace(
        hc.constant_cut(gain=(25.0, 0.5), t_max=2.0), stop_when_unstable=False
    ),
    "stretched": hc.constant_cut(force=(1.0, 50.0)),
    "stalled": hc.constant_cut(force=(0.0, 0.0), t_max=2.0),
    "one short step": hc.constant_cut(t_max=1e-5),
    "not on the grid": hc.constant_cut(t_max=0.1001),
    "coarse": hc.constant_cut(dt=0.02, t_max=3.0),
}
ELSEWHERE = ("shaped", "hand on y", "formed", "all", "free", "muscle", "command")  # test_engines
ALL = {name: s for name, s in (CASES | MORE).items() if name not in ELSEWHERE}


def same(a, b):
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(a, field), getattr(b, field), err_msg=field)
    assert (
        a.outcome == b.outcome
        and a.crossings == b.crossings
        and a.steps == b.steps
        and a.energy == b.energy
    )


@fast
@pytest.mark.parametrize("name", ALL)
def test_native_is_python_bit_for_bit(name):
    python, native = (hc.simulate(ALL[name], engine=engine) for engine in ("python", "native"))
    same(native, python)


STILL = {
    "cut": hc.constant_cut(),
    "off axis, origin": hc.constant_cut(force=(1.0, 0.3), t_max=3.0),
    "stiff: substeps": hc.constant_cut(b=2e4, start=(0.049, 0.0), t_max=0.25),
    "not on the grid": hc.constant_cut(t_max=0.9007),
    **{
        name: MORE[name]
        for name in ("layers", "at speed", "backwards", "diverged", "stretched", "one short step")
    },
}


@fast
@pytest.mark.parametrize("name", STILL)
def test_accurate_native_is_accurate_python_bit_for_bit(name):
    s = dataclasses.replace(STILL[name], integrator="accurate", dt=2e-3)
    python, native = (hc.simulate(s, engine=engine) for engine in ("python", "native"))
    same(native, python)


@fast
def test_a_run_that_ceases_to_be_calm_is_looked_at_from_its_start():
    from hapticclay.stepping import compiled

    s = hc.constant_cut(
        gain=(4.2, 0.2),
        inertia_shaping=True,
        operator=hc.Operator(),
        start=(0.05, 0.0),
        force=(0.5, 0.0),
    )
    late, watched = (run.Run(s, 1, compiled.KERNEL) for _ in range(2))
    watched.calm = False
    for made in (late, watched):
        made.go(None)
    assert late.looked > 3 * 4095 and late.outcome.code == "diverged"
    same(Record.of(late, 0.0), Record.of(watched, 0.0))
    assert late.watch.seen == watched.watch.seen >= late.looked
    thin = hc.simulate(s, every=7, engine="python")
    same(hc.simulate(s, every=7, engine="native"), thin)
    same(hc.simulate_batch([s], every=7)[0], thin)
    assert hc.simulate_batch([s], keep="summaries")["code"][0] == "diverged"
    calm = run.Run(hc.constant_cut(), 1, compiled.KERNEL)
    calm.watch.look = None  # is not called
    calm.go(None)
    same(Record.of(calm, 0.0), hc.simulate(hc.constant_cut(), engine="native", every=1))


@fast
def test_every_and_progress():
    s = hc.constant_cut(t_max=2.0)
    seen = []
    thin = hc.simulate(s, every=7, engine="native", progress=lambda t, x: seen.append((t, x)))
    full = hc.simulate(s, engine="native")
    np.testing.assert_array_equal(thin.p[:-1], full.p[:-1][::7][: len(thin.p) - 1])
    assert len(seen) >= 2 and seen == sorted(seen)


@fast
@pytest.mark.parametrize("threads", [1, 2, 5])
def test_batch_is_the_single_run_bit_for_bit_at_any_number_of_threads_and_order(threads):
    names = list(ALL)
    random.Random(threads).shuffle(names)
    records = hc.simulate_batch([ALL[n] for n in names], threads=threads)
    for name, r in zip(names, records, strict=True):
        same(r, hc.simulate(ALL[name], engine="native"))


@fast
def test_summaries_are_those_of_the_records():
    records = hc.simulate_batch(ALL.values())
    short = hc.simulate_batch(ALL.values(), keep="summaries")
    assert short.dtype == batch.SUMMARY
    for i, r in enumerate(records):
        assert (
            short[i].tobytes()
            == np.array([batch.summary_entry(*record.brief(r))], batch.SUMMARY)[0].tobytes()
        ), list(ALL)[i]
        assert short["code"][i] == r.outcome.code and short["residual"][i] == r.energy["residual"]
        np.testing.assert_array_equal(short["p"][i], r.p[-1])


@fast
def test_a_run_that_diverges_changes_no_other():
    good = [hc.constant_cut(b=b, t_max=0.5) for b in (10.0, 50.0, 90.0)]
    alone = hc.simulate_batch(good)
    mixed = hc.simulate_batch(
        [good[0], MORE["diverged"], good[1], MORE["thrown out of reach"], good[2]]
    )
    assert [mixed[i].outcome.code for i in (1, 3)] == ["diverged", "diverged"]
    for a, b in zip(alone, mixed[::2], strict=True):
        same(a, b)


@fast
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


def test_without_numba_python_runs_and_says_so_once(monkeypatch, capsys):
    monkeypatch.setattr(engines.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(hc.ParameterError, match=r"hapticclay\[fast\]"):
        hc.simulate(hc.free(t_max=0.1), engine="native")
    long = hc.free(force=(0.0, 0.0), dt=1e-6, t_max=1.0)
    assert engines.kernel_for(long, "auto") is run.PLAIN
    scenes = [hc.free(t_max=0.1), hc.constant_cut(t_max=0.1)]
    records = hc.simulate_batch(scenes)
    said = capsys.readouterr().err
    assert "hapticclay[fast]" in said and said.count("\n") == 1
    for s, r in zip(scenes, records, strict=True):
        same(r, hc.simulate(s, engine="python"))


@fast
def test_auto_takes_machine_code_once_what_was_run_of_a_kind_repays_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "hapticclay.stepping.compiled", None)
    monkeypatch.setattr(engines, "saved", {})
    monkeypatch.setattr(machine_code, "cache_folder", lambda: tmp_path)  # nothing is kept there
    cut = hc.constant_cut(t_max=5.0)
    kind = machine_code.kind_of(scene.parts_of(cut))
    per_run = 0.5 * engines.saved_in_a_step(cut) * cut.t_max / cut.dt
    asked = [engines.pays(cut, cut.t_max / cut.dt) for _ in range(20)]
    cost = engines.IMPORTING + machine_code.compile_time(kind, started=False)
    assert asked == [(i + 1) * per_run >= cost for i in range(20)]
    assert not engines.pays(hc.free(t_max=0.1), 100.0)  # of another kind
    machine_code.mark(kind).touch()
    monkeypatch.setattr(engines, "saved", {})
    asked = [engines.pays(cut, cut.t_max / cut.dt) for _ in range(20)]
    cost = engines.IMPORTING + machine_code.LOADING
    assert asked == [(i + 1) * per_run >= cost for i in range(20)]
    monkeypatch.setitem(sys.modules, "hapticclay.stepping.compiled", SimpleNamespace(ready=set()))
    monkeypatch.setattr(engines, "saved", {})
    assert not engines.pays(cut, 1000.0) and engines.pays(cut, 300.0)  # 25 ms, 32.5 ms
    assert engines.kernel_for(cut, "python") is run.PLAIN


@fast
def test_a_law_of_ones_own_is_compiled_in_each_process_which_counts(monkeypatch):
    held = hc.constant_cut(control="sampled")
    own = dataclasses.replace(held, controller=hc.Controller(lambda t, *x: ((0.0, 0.0), ())))
    monkeypatch.setitem(sys.modules, "hapticclay.stepping.compiled", SimpleNamespace(ready=set()))
    held_kind = machine_code.kind_of(scene.parts_of(held))
    compiling = machine_code.compile_time(held_kind, started=False)
    for s, law in ((held, 0.0), (own, machine_code.LAW)):
        kind = machine_code.kind_of(scene.parts_of(s))
        for kept, cost in ((True, machine_code.LOADING + law), (False, compiling + law)):
            monkeypatch.setattr(machine_code, "is_kept", lambda kind, kept=kept: kept)
            assert engines.outweighs(cost, kind) and not engines.outweighs(0.99 * cost, kind)


@fast
@pytest.mark.parametrize("name", ["plain", "hand"])
def test_auto_takes_machine_code_in_the_middle_of_a_run_to_the_same_bits(name, monkeypatch):
    from hapticclay.stepping import compiled

    s = dataclasses.replace(CASES[name], t_max=4.0, length=None)
    kind = machine_code.kind_of(scene.parts_of(s))
    per_step, chunk = engines.saved_in_a_step(s), engines.TRIED
    monkeypatch.setattr(engines, "saved", {})
    monkeypatch.setattr(compiled, "ready", set())
    # half of the run and two chunks repay it
    cost = per_step * (0.5 * s.t_max / s.dt + chunk - 1)
    monkeypatch.setattr(engines, "ready_time", lambda kind, started: cost)
    seen, plainly = [], engines.plainly
    monkeypatch.setattr(engines, "plainly", lambda r, room: (seen.append(r), plainly(r, room)))
    r = hc.simulate(s)
    assert len(seen) == 2 and seen[0].kernel is compiled.KERNEL
    assert engines.saved == {kind: pytest.approx(2 * chunk * per_step)}
    same(r, hc.simulate(s, engine="python"))


@fast
def test_auto_takes_machine_code_that_is_loaded():
    short = hc.free(t_max=0.01)
    hc.simulate(short, engine="native")
    assert engines.pays(short, 1.0)
    assert engines.kernel_for(short, "auto") is not run.PLAIN


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


@fast
def test_an_error_in_a_thread_reaches_the_caller(monkeypatch):
    from hapticclay.stepping import compiled

    def broken(self, room):
        raise RuntimeError("broken")

    monkeypatch.setattr(run.Run, "advance", broken)
    monkeypatch.setattr(compiled, "warm", lambda scenario: None)
    with pytest.raises(RuntimeError, match="broken"):
        hc.simulate_batch([hc.free(t_max=0.1)] * 5, threads=2)


@fast
def test_engine_hears_nothing_and_keeps_nothing():
    """No callback, no warning, and the time step is found where it is."""
    import mujoco

    before = mujoco.get_mju_user_warning()
    hc.simulate_batch([MORE["thrown out of reach"]] * 3)
    assert mujoco.get_mjcb_control() is None and mujoco.get_mju_user_warning() is before
    model = hc.build(hc.free())
    engine.timestep_view(model)[0] = 0.5
    assert model.opt.timestep == 0.5


@fast
def test_compiled_code_is_kept_on_disk(tmp_path):
    """A second process is faster, a terminal is told of the wait."""
    code = (
        "import time, hapticclay as hc; hc.simulate(hc.free(t_max=0.01)); a = time.process_time(); "
        "hc.simulate(hc.free(t_max=0.01), engine='native'); print(time.process_time() - a); "
        "from hapticclay.stepping import compiled; "
        "print(sum(compiled.WHOLE_STEPS.stats.cache_hits.values()))"
    )
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    took, said = [], []
    for hits in (0, 1):
        terminal, end = os.openpty()
        out = subprocess.run(
            [sys.executable, "-c", code], env=env, stdout=subprocess.PIPE, stderr=end, check=True
        )
        os.write(end, b".")  # a terminal without a word holds its reader up
        said.append(b"")
        while not said[-1].endswith(b"."):
            said[-1] += os.read(terminal, 1000)
        os.close(terminal)
        os.close(end)
        took.append(float(out.stdout.split()[0]))
        assert out.stdout.split()[1] == str(hits).encode()
    begin = rb"\rhapticclay: compiling runs of this kind, this once: about \d+ s"
    end = rb"\d+ s\r\n\."
    assert re.match(begin, said[0]) and re.search(rb"\rhapticclay: compiled in " + end, said[0])
    assert said[1] == b"."
    assert took[1] < 0.5 * took[0]


@fast
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


@fast
def test_nothing_that_a_scene_lacks_is_compiled(tmp_path):
    """Of the functions that machine code was made of, none belongs to a part that is None.

    Only the entry is turned into machine code, with all that it calls: no function twice.
    """
    code = (
        "import json, os, sys, hapticclay as hc\n"
        "from hapticclay.stepping import lacking, compiled\n"
        "from numba.core.codegen import JITCodeLibrary as Library\n"
        "plain, made, finish, alone = lacking.without, set(), Library._finalize_specific, []\n"
        "Library._finalize_specific = lambda x: alone.append(x.name) or finish(x)\n"
        "name = lambda f: (f.__module__.rpartition('.')[2], f.__name__)\n"
        "lacking.without = lambda f, *rest: made.add(name(f)) or plain(f, *rest)\n"
        "def show(scene):\n"
        "    alone.clear()\n"
        "    hc.simulate(eval(scene), engine='native')\n"
        "    print(json.dumps([sorted(made), alone]), flush=True)\n"
        "show(sys.argv[1])\n"
        "for scene in sys.argv[2:]:  # each beside the first alone\n"
        "    if os.fork() == 0:\n"
        "        show(scene)\n"
        "        os._exit(0)\n"
        "    assert os.wait()[1] == 0\n"
    )
    scenes = (
        "hc.constant_cut(t_max=0.1)",
        "hc.constant_cut(t_max=0.1, operator=hc.Operator())",
        "hc.Scenario(t_max=0.1, control='sampled', hardware=hc.Hardware(force_filter=30.0))",
    )
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    words = [sys.executable, "-c", code, *scenes]
    out = subprocess.run(words, env=env, capture_output=True, text=True, check=True)
    found = []
    for made, alone in map(json.loads, out.stdout.splitlines()):
        assert [x for x in alone if x in {name for _, name in made}] == ["run_whole_steps"]
        found.append(({module for module, _ in made}, len(made)))
    (used, count), (with_hand, more), (hardware, _) = found
    lacks = "sampled", "hardware", "friction", "yielding", "springs", "grooves", "stiff", "laws"
    lacks += "march", "instant", "modes", "ends", "search", "borders", "hand", "flow", "spring"
    assert used.isdisjoint(lacks), used
    assert "hand" in with_hand and more > count
    assert with_hand - used <= {"hand", "operator"}
    assert {"sampled", "hardware"} <= hardware and hardware.isdisjoint(lacks[3:])


numbers = st.floats(-25.0, 25.0) | st.sampled_from([0.0, math.nan, math.inf, 1e-12, 1e-6])


@fast
@given(st.data())
def test_what_the_filter_passes_the_monitor_passes(data):
    """The compiled filter spares the monitor rows with nothing to report, and no others."""
    from hapticclay.stepping import compiled

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
    swings, seen = np.zeros((2, monitor.QUIET)), np.array([0, -1, -1, 0])
    watch = monitor.StabilityMonitor(s)
    parts = sorted({0, n, data.draw(st.integers(0, n), "cut")})
    for first, last in zip(parts, parts[1:], strict=False):
        quiet = compiled.KERNEL.quiet
        if not quiet(rows[first:last], last - first, *s.torque_limit, swings, seen):
            return
        assert watch.look(rows[first:last, :12].T, first) == (last - first, None)
    assert [watch.seen, watch.moved, watch.unbound, watch.often] == seen.tolist()
