"""Work for one sample is bounded; runs of the accurate method that took no end come to theirs."""

import functools
from dataclasses import replace

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.kernel import modes, pace, path
from tests.hunt import HUNTS

AFTER = hc.Pulse((8.0, 0.0), 0.0, 0.3, 0.6)
NONE = hc.Profile((), (0.0,))
GROWING = hc.Scenario(
    clay=hc.Clay(hc.Profile((), (50.0,), growth=(6e4,)), NONE),
    gain=(1.0, 0.1), force=(3.0, 0.0), inertia_shaping=True, t_max=0.15, integrator="accurate",
)  # fmt: skip
SCENES = {
    # it leaves clay that yields along the motion, and comes back
    "left": hc.Scenario(
        clay=hc.slab(hc.Flow(Fy=1.0, b=5.0), 0.02, 0.1), gain=(0.5, 0.0), force=(-4.0, 0.0),
        muscle=AFTER, t_max=1.5, dt=2e-3, inertia_shaping=True, integrator="accurate",
    ),
    # it slides along a border
    "border": hc.Scenario(
        clay=hc.Clay(
            hc.Profile((), (40.0,)), hc.Profile((0.01,), (1.0, 600.0), "y"), angle=-0.97
        ),
        force=(16.0, 5.0), gain=(1.0, 0.4), dt=3.6e-4, t_max=0.2, integrator="accurate",
    ),
    # clay holds one axis while a motor is at its limit
    "limit": hc.Scenario(
        clay=hc.Clay(
            hc.Profile((), (46.4,), Fy=(9.92,)), hc.Profile((), (31.6,), Fy=(0.231,)), angle=1.19
        ),
        force=(-12.9, -4.06), gain=(0.436, 0.0865), torque_limit=(0.11, 2.38), dt=6.36e-4,
        t_max=0.2, inertia_shaping=True, integrator="accurate", length=None,
    ),
    # a jump of the push falls into a step as short as the slack of its time
    "jump": hc.Scenario(
        clay=hc.slab(hc.Flow(Fy=3.1, b=5.4)), gain=(0.77, 0.29), force=(5.8, -1.9),
        muscle=hc.Pulse((-11.0, 3.0), 0.0, 0.1, 0.2), t_max=0.15,
        dt=4.64e-4, inertia_shaping=True, integrator="accurate",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_runs_end_where_fine_ones_of_the_fast_method_do(name):
    """The oracle is of second order, first where it slides along a border: at dt/6 it is fine."""
    s = SCENES[name]
    r = hc.simulate(s, engine="python")
    fine = hc.simulate(replace(s, integrator="fast", dt=s.dt / 6.0))
    assert r.outcome.code == fine.outcome.code in ("time limit", "saturated")
    away = np.abs(r.p[-1] - fine.p[-1]).max()
    # 2e-7 is 40 times the largest difference measured; the fast method's own error is of this size
    assert away < (1e-6 if name == "border" else 2e-7)


@functools.cache
def fine_growing():
    return hc.simulate(replace(GROWING, integrator="fast", dt=2e-5))


@pytest.mark.parametrize("dt", [2e-3, 1e-3, 3e-4])
def test_steps_follow_clay_as_it_grows(dt):
    r, fine = hc.simulate(replace(GROWING, dt=dt), engine="python"), fine_growing()
    assert r.outcome.code == "time limit"
    # the fast method errs by h^2: 2e-10 at this step
    assert np.abs(r.p[-1] - fine.p[-1]).max() < 1e-9
    assert r.steps > 2 * len(r.t)  # at first one a sample would do


def test_steps_of_clay_that_grows_depend_on_the_sample_alone():
    s = replace(GROWING, dt=1e-3, t_max=0.1)
    r = hc.simulate(s, engine="python")
    with hc.Simulation(s) as sim:
        while sim.outcome is None:
            sim.step()
    np.testing.assert_array_equal(sim.record().p, r.p)
    parts = [pace.parts_of_sample(s, i) for i in range(100)]
    assert parts == sorted(parts) and parts[0] < parts[-1]


def test_clay_that_has_grown_too_stiff_ends_the_run_with_a_status(monkeypatch):
    most = modes.SUBSTEPS if HUNTS else 50
    monkeypatch.setattr(modes, "SUBSTEPS", most)
    growing = hc.Clay(hc.Profile((), (50.0,), growth=(5e5 * most,)), NONE)
    r = hc.simulate(replace(GROWING, clay=growing, dt=1e-4, t_max=0.2), engine="python")
    assert r.outcome.code == "unresolved" and f"more than {most} steps in one sample" in r.status
    assert "fast" in r.outcome.advice
    assert r.t[-1] == pytest.approx(r.outcome.time) and np.isfinite(r.p).all()


def test_a_sample_takes_no_more_than_so_many_steps(monkeypatch):
    """With a bound of one, the first border that is met ends the run, at the sample before it."""
    monkeypatch.setattr(path, "MOST_STEPS", 0)
    s = hc.constant_cut(clay=(0.001, 0.01), t_max=0.3)
    r = hc.simulate(s, engine="python")
    assert r.outcome.code == "unresolved" and not r.crossings
    assert "more than 0 steps in one sample" in r.status
    assert r.outcome.time == r.t[-1] and r.p[-1, 0] < 0.001 < r.p[-1, 0] + 2 * s.dt * r.v[-1, 0]


@pytest.mark.parametrize("error", ["1e-8 m", 1e-8])
def test_an_asked_error_takes_an_integrator_that_the_clay_allows(error):
    springy = hc.Clay(
        hc.Profile((0.005,), (0.0, 20.0), springs=(hc.Spring(), hc.Spring(k=300.0))), NONE
    )
    s = hc.Scenario(clay=springy, force=(3.0, 1.0), t_max=0.12)
    r = hc.simulate(s, error=error, engine="python")
    assert r.error.reached and r.error.integrator == "fast"
