"""A run that is told to end keeps what was run: the first part of what the whole run gives."""

import dataclasses
import functools

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.kernel import native
from hapticclay.simulation import record, run

LOOK = 511  # steps between two looks at a run in Python; compiled runs take those of a user
HARDWARE = dataclasses.replace(
    hc.constant_cut(control="sampled", t_max=0.3, start=(0.045, 0.0)),
    hardware=hc.Hardware(jitter=2e-5, delay=1e-4, friction=(0.01, 0.01)),
)
SHORT = hc.constant_cut(t_max=0.4, start=(0.045, 0.0))  # some steps longer than two looks
CUT = hc.constant_cut(t_max=3.0)
SCENES = {  # name: scenario, engine, every, looks
    "fast": (SHORT, "python", 1, 2),
    "fast, some samples": (SHORT, "python", 7, 1),
    "driven": (hc.stability_test(3.0, t_max=0.3), "python", 1, 1),
    "growing": (
        dataclasses.replace(hc.variable_cut(t_max=0.3), start=(0.049, 0.0)), "python", 1, 1
    ),
    "native": (CUT, "native", 1, 2),
    "native, some samples": (CUT, "native", 7, 2),
    "accurate": (
        hc.constant_cut(integrator="accurate", dt=1e-3, t_max=0.6, start=(0.045, 0.0)),
        "python", 1, 1,
    ),
    "accurate, native": (hc.constant_cut(integrator="accurate", t_max=9.5), "native", 3, 2),
    "sampled": (hc.constant_cut(control="sampled", t_max=0.3, start=(0.045, 0.0)), "python", 1, 1),
    "hardware": (HARDWARE, "python", 1, 1),
}  # fmt: skip


@functools.cache
def whole_run(scenario, engine):
    """The run that nothing ends before its time."""
    return hc.simulate(scenario, engine=engine)


@pytest.mark.parametrize("name", SCENES)
def test_an_interrupted_record_is_the_beginning_of_the_whole_one(name, monkeypatch):
    scenario, engine, every, most = SCENES[name]
    if engine == "native" and not native.is_there():
        pytest.skip("needs the compiled kernel")
    if engine == "python":
        monkeypatch.setattr(run, "CHUNK", LOOK + 1)
    looks = []

    def enough(t, x):
        looks.append(t)
        return len(looks) == most

    r = hc.simulate(scenario, engine=engine, every=every, progress=enough)
    whole = whole_run(scenario, engine)
    assert len(looks) == most and r.outcome.code == "interrupted" and not r.outcome.advice
    step = r.outcome.step
    assert LOOK - 1 <= step < len(whole.t) - 1 and r.outcome.time == r.t[-1] == whole.t[step]
    index = sorted({*range(0, step, every), step})  # each every-th, and the last
    for array in record.ARRAYS:
        np.testing.assert_array_equal(
            getattr(r, array), getattr(whole, array)[index], err_msg=array
        )
    assert r.crossings == tuple(c for c in whole.crossings if c.time <= r.t[-1])
    assert (
        abs(r.energy["residual"]) < 1e-5 * r.energy["throughput"]
    )  # whole runs with a hand have 3e-6


def test_an_instability_met_before_is_not_forgotten():
    r = hc.simulate(hc.stability_test(25.0), progress=lambda t, x: t > 2.5)
    assert r.status == f"interrupted at {r.t[-1]:.4f} s (x axis: growing oscillation)"


def test_a_run_that_ends_by_itself_at_the_last_look_says_how():
    r = hc.simulate(hc.constant_cut(t_max=0.5), progress=lambda t, x: True)
    assert r.outcome.code == "time limit"
