"""Clay that springs back, in runs: walls, dents, relaxation, energy, engines, files."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.linalg import expm

import hapticclay as hc
from hapticclay.theory import linear_loop
from tests.kernel.test_yield import V0, M, slider
from tests.oracles import touched_pairs

HIT = 0.01 / V0  # when the slider comes to the wall [s]


def wall(spring, b=0.0, edges=(0.03,), **more):
    """Clay along x behind the last border."""
    n = len(edges)
    law = hc.Profile(edges, (0.0,) * n + (b,), springs=(hc.Spring(),) * n + (spring,), **more)
    return hc.Clay(law, hc.Profile((), (0.0,)))


@pytest.mark.parametrize("k", [1e3, 1e5, 1e8])
def test_a_wall_throws_the_slider_back(k):
    omega = math.sqrt(k / M)
    back = HIT + math.pi / omega
    errors = []
    for dt in (1e-3, 3.6e-4, 1e-4):
        r = hc.simulate(slider(wall(hc.Spring(k=k)), dt, back + 0.01))
        assert [c.border for c in r.crossings] == [0.03, 0.03]
        # a step takes at most 0.2 of the time of a radian: 0.2^2/24 of the contact's length, and
        # the servo's least stiffness
        h = min(dt, 0.2 / math.sqrt(k * r.scenario.mobility))
        errors.append(abs(r.crossings[1].time - back))
        assert errors[-1] < math.pi / omega * (omega * h) ** 2 / 12.0 + 1e-7
        assert r.v[-1, 0] == pytest.approx(-V0, rel=1e-3)
        assert r.energy["springs_stored"] == 0.0 and r.energy["springs_dissipated"] < 1e-20
        assert abs(r.energy["clay"]) < 1e-3 * M * V0**2
        assert abs(r.energy["residual"]) < 1e-14
    if k == 1e3:
        assert np.log2(errors[0] / errors[2]) / np.log2(10.0) == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("b", [3.0, 60.0])
def test_a_damped_wall_never_pulls(b):
    """Against SciPy from touch to letting go; of second order in the step, the same in Python."""
    k, T = 4000.0, HIT + 0.1
    there = touched_pairs.Wall(M, 0.0, k, b, 0.03)
    x, v = there.step(np.array([0.02, V0]), 0.0, T)
    errors = []
    for dt in (1e-3, 5e-4, 2.5e-4):
        s = slider(wall(hc.Spring(k=k, unilateral=True), b), dt, T)
        r = hc.simulate(s)
        errors.append(abs(r.v[-1, 0] - v))
        assert r.fe[:, 0].min() == 0.0 and abs(r.energy["residual"]) < 1e-14
        # (w h)^2/12 in each of touch, spring and letting go
        assert errors[-1] < 0.25 * abs(v) * k * r.scenario.mobility * dt**2
    python = hc.simulate(s, engine="python")
    np.testing.assert_array_equal(r.fe, python.fe)
    np.testing.assert_array_equal(r.p, python.p)
    if b == 3.0:
        assert x < 0.03 and v < 0.0  # it has left


def test_a_dent_stays():
    # the spring takes Fp^2/(2 k), what is left of the energy makes the dent
    k, Fp = 2000.0, 3.0
    dent = (0.5 * M * V0**2 - Fp**2 / (2.0 * k)) / Fp
    s = slider(wall(hc.Spring(k=k, limit=Fp, unilateral=True)), 1e-4, 0.4)
    r = hc.simulate(s)
    assert r.p[:, 0].max() == pytest.approx(0.03 + dent + Fp / k, abs=1e-7)
    assert r.v[-1, 0] == pytest.approx(-Fp / math.sqrt(k * M), rel=1e-5)
    assert r.energy["springs_dissipated"] == pytest.approx(Fp * dent, rel=1e-4)
    # the handle leaves the ground of the dent, not the border, and touches nothing on its way
    out = (r.v[:, 0] < 0.0) & (r.p[:, 0] > 0.03) & (r.p[:, 0] < 0.03 + 0.9 * dent)
    assert out.any() and not r.fe[out].any()


def test_a_second_push_meets_the_wall_in_its_dent():
    # a hand that pushes twice as hard as the wall bears, lets go, and comes back with less
    k, Fp = 5000.0, 4.0
    t = (0.0, 0.05, 0.06, 0.35, 0.36, 0.7, 0.71, 2.5)
    push = hc.Samples(t, tuple((f, 0.0) for f in (0.0, 0.0, 6.0, 6.0, -3.0, -3.0, 1.0, 1.0)))
    s = dataclasses.replace(
        hc.free(), clay=wall(hc.Spring(k=k, limit=Fp, unilateral=True), edges=(0.01,)),
        force=(0.0, 0.0), muscle=push, t_max=2.5, length=None, stop_when_unstable=False, dt=1e-3,
    )  # fmt: skip
    r = hc.simulate(s)
    deepest = r.p[r.t < 1.0, 0].max()
    rests = deepest - Fp / k
    assert deepest > 0.02
    touching = np.flatnonzero(r.fe[:, 0] > 0.0)
    again = touching[r.t[touching] > 0.8]
    assert again.size and r.p[again, 0].min() == pytest.approx(rests, abs=2e-4)


def test_a_spring_that_sticks_to_the_tool_loses_a_loop_each_cycle():
    # steady cycles of an embedded elastic-plastic spring under a slow, large displacement
    k, Fp = 3000.0, 2.0
    law = hc.Profile((), (0.0,), springs=(hc.Spring(k=k, limit=Fp),))
    push = hc.Multisine((10.0, 0.0), 0.9, 1.1, 1.0, lines=1)
    s = dataclasses.replace(
        hc.free(), clay=hc.Clay(law, hc.Profile((), (0.0,))), force=(0.0, 0.0), gain=(0.3, 0.1),
        muscle=push, t_max=4.0, length=None, stop_when_unstable=False, start=(0.1, 0.0), dt=1e-3,
    )  # fmt: skip
    r = hc.simulate(s)
    last = r.t > 3.0
    area = np.trapezoid(r.fe[last, 0], r.p[last, 0])
    swing = 0.5 * np.ptp(r.p[last, 0])
    assert area == pytest.approx(4.0 * Fp * (swing - Fp / k), rel=4e-3)  # corners between samples
    assert r.energy["clay"] == pytest.approx(
        r.energy["springs_dissipated"] + r.energy["springs_stored"], rel=1e-4
    )


def test_a_zener_wall_relaxes_to_its_lasting_spring():
    # held against the wall by a steady push, the depth goes to F/k; at once it is F/(k + k1)
    k, k1, tau, F = 1000.0, 4000.0, 0.2, 2.0
    s = dataclasses.replace(
        hc.free(), clay=wall(hc.Spring(k=k, k1=k1, tau=tau), b=200.0, edges=(0.005,)),
        force=(F, 0.0), t_max=10.0, length=None, gain=(0.2, 0.2), stop_when_unstable=False, dt=2e-3,
    )  # fmt: skip
    r = hc.simulate(s)
    # delta comes to rest where the clay bears all of the push
    assert r.p[-1, 0] - 0.005 == pytest.approx(F / k, rel=1e-3)
    assert r.fe[-1, 0] == pytest.approx(F, rel=1e-3)
    assert r.energy["springs_dissipated"] > 0.0


def test_steps_and_files_agree_with_the_run(tmp_path):
    spring = hc.Spring(k=2e4, limit=3.0, k1=1e3, tau=0.05, unilateral=True)
    s = dataclasses.replace(
        hc.free(), clay=wall(spring, b=20.0, edges=(0.01, 0.012), Fy=(0.0, 0.5, 0.2)),
        force=(4.0, 1.0), t_max=0.25, length=None, stop_when_unstable=False, operator=hc.Operator(),
    )  # fmt: skip
    a = hc.simulate(s, engine="python")
    with hc.Simulation(s) as sim:
        while sim.outcome is None:
            sim.step()
    for r in (sim.record(), hc.Record.load(a.save(tmp_path))):
        for name in ("t", "p", "v", "fh", "fe", "q", "qd", "tau", "delta"):
            assert np.array_equal(getattr(a, name), getattr(r, name)), name
        assert r.energy == a.energy
    assert hc.Scenario.load(tmp_path / "scenario.toml") == s


@functools.cache
def without_samples():
    """A push into springs under continuous control."""
    clay = wall(
        hc.Spring(k=2e3, limit=3.0, k1=500.0, tau=0.1), b=20.0, edges=(0.01,), Fy=(0.0, 0.3)
    )
    s = dataclasses.replace(
        hc.free(), clay=clay, force=(2.0, 0.0), t_max=0.2, length=None, stop_when_unstable=False,
        dt=1e-4, start=(0.008, 0.0),
    )  # fmt: skip
    return hc.simulate(s)


@pytest.mark.parametrize("render", ["physical", "held"])
def test_sampled_control_meets_the_same_springs(render):
    exact = without_samples()
    s, gaps = exact.scenario, []
    for Ts in (4e-4, 2e-4):
        late = dataclasses.replace(s, control="sampled", render=render, Ts=Ts)
        r = hc.simulate(late)
        gaps.append(np.abs(r.p[-1] - exact.p[-1]).max())
        assert r.energy["springs_dissipated"] == pytest.approx(
            exact.energy["springs_dissipated"], rel=0.02
        )
    # what a hold of half a sample does falls with the sample
    assert gaps[1] < 0.7 * gaps[0] < 1e-4


def test_springs_are_refused_where_no_law_of_them_is_known():
    s = dataclasses.replace(hc.free(), clay=wall(hc.Spring(k=10.0)))
    with pytest.raises(hc.ParameterError, match="integrator"):
        dataclasses.replace(s, integrator="accurate")
    with pytest.raises(hc.ParameterError, match="angle"):
        dataclasses.replace(s, clay=dataclasses.replace(s.clay, angle=0.1))


def test_a_held_spring_pulls_at_the_place_that_the_encoder_reads():
    # soft and lasting: nothing yields or relaxes, so the force tells the place
    k, counts = 800.0, 4096
    clay = wall(hc.Spring(k=k), edges=(0.0,))
    s = dataclasses.replace(
        hc.free(), clay=clay, force=(2.0, 0.0), t_max=0.06, length=None,
        stop_when_unstable=False, dt=1e-4,
        Ts=5e-4, control="sampled", render="held", hardware=hc.Hardware(encoder=counts),
    )  # fmt: skip
    a = hc.simulate(s, engine="python")
    step = 2.0 * math.pi / counts
    q = step * np.round(a.q[:-1:5] / step)
    l1, l2 = s.arm.l1, s.arm.l2
    read = l1 * np.cos(q[:, 0]) + l2 * np.cos(q.sum(axis=1)) - s.origin[0]
    beyond = a.p[:-1:5, 0] > 1e-6  # behind the border, where the spring begins
    assert beyond.sum() > 100 and np.abs(read - a.p[:-1:5, 0]).max() > 0.2 * step * l1
    assert a.fe[:-1:5, 0][beyond] == pytest.approx(k * read[beyond], abs=1e-9)


def test_an_encoder_changes_yielding_and_relaxing_springs_by_its_rounding():
    # far finer than the motion: the same run as without one, to what a count does to the force
    spring = hc.Spring(k=2e3, limit=3.0, k1=500.0, tau=0.1, unilateral=True)
    s = dataclasses.replace(
        hc.free(), clay=wall(spring, b=20.0, edges=(0.01,)), force=(4.0, 0.0), t_max=0.2,
        length=None, stop_when_unstable=False, dt=1e-4, Ts=5e-4, control="sampled", render="held",
    )  # fmt: skip
    exact = hc.simulate(s)
    fine = hc.simulate(dataclasses.replace(s, hardware=hc.Hardware(encoder=2**36)))
    assert exact.energy["springs_dissipated"] > 0.0
    # 2 pi/2^36 of 0.25 m is 2e-11 m, times 2.5 kN/m 6e-8 N
    assert np.abs(fine.fe - exact.fe).max() < 1e-5
    assert np.abs(fine.p - exact.p).max() < 1e-8


def bonded(k, b, **changes):
    """Clay of one region that springs back along x from the start, under a push that sets in."""
    law = hc.Profile((), (b,), springs=(hc.Spring(k=k),))
    own = dict(clay=hc.Clay(law, hc.Profile((), (0.0,))), inertia_shaping=True, force=(2.0, 0.0))
    own |= dict(length=None, stop_when_unstable=False, torque_limit=(1e5, 1e5), t_max=0.05)
    return dataclasses.replace(hc.free(), **(own | changes))


FEEDTHROUGH = hc.Compensator((1.0, 20.0), (1.0, 40.0))
X, Y = hc.free().servo
LIGHT = (hc.Servo(X.G, dataclasses.replace(X.S, gain=100.0)), Y)


@pytest.mark.parametrize(
    ("k", "b", "changes"),
    [
        (1e6, 0.0, dict(servo=LIGHT, gain=(0.0, 0.0), dt=1e-4, t_max=0.02)),
        (1e6, 30.0, dict(servo=LIGHT, gain=(2.0, 0.0), dt=1e-3)),
        (2e4, 300.0, dict(compensator=FEEDTHROUGH, gain=(1.0, 0.0), dt=1e-3, t_max=0.12)),
        (3e5, 20.0, dict(compensator=FEEDTHROUGH, gain=(4.0, 0.0), dt=2e-3, t_max=0.02)),
        (5e4, 5.0, dict(gain=(1.0, 0.0), dt=1e-3, operator=hc.Operator(0.4, 3.0, 0.0))),
    ],
)
def test_a_step_resolves_a_spring_in_the_loop_that_it_closes(k, b, changes):
    """Mobility of a light handle, and of a force that the compensator passes on at once."""
    s = bonded(k, b, **changes)
    loop = dataclasses.replace(hc.theory.Loop.of(s, "x", b), k=k)
    A, B = linear_loop.state_space(loop)
    r = hc.simulate(s)
    assert r.outcome.code in ("time limit", "stalled")
    whole = np.zeros((len(A) + 1,) * 2)
    whole[:-1, :-1], whole[:-1, -1] = A, B[:, 0] * s.force[0]
    exact = expm(whole * r.t[:, None, None])[:, 0, -1]
    # a step of 0.2 rad of the fastest motion: its phase lags by 0.2^2/24 of itself while it lasts
    poles = np.linalg.eigvals(A)
    fastest = poles[np.abs(poles).argmax()]
    phase = abs(fastest) * min(s.t_max, 4.0 / -fastest.real) * 0.2**2 / 24.0
    assert np.abs(exact - r.p[:, 0]).max() < (phase + 2e-3) * np.abs(exact).max()


def test_a_spring_too_fast_for_any_step_is_refused():
    with pytest.raises(hc.ParameterError, match="dt .*must be at most .* 1e\\+09 N/m"):
        hc.simulate(bonded(1e9, 0.0, compensator=FEEDTHROUGH, gain=(1e3, 0.0), dt=0.005))


@pytest.mark.parametrize("k1", [0.0, 500.0])
def test_a_start_inside_a_wall_has_no_energy(k1):
    spring = hc.Spring(k=1e4, k1=k1, unilateral=True)
    s = dataclasses.replace(
        hc.free(), clay=wall(spring, edges=(0.0,)), start=(0.03, 0.0), length=None,
        force=(0.0, 0.0), t_max=0.05, stop_when_unstable=False,
    )  # fmt: skip
    r = hc.simulate(s)
    assert not r.fe.any() and np.abs(r.p[:, 0] - 0.03).max() < 1e-12
    assert r.energy["springs_stored"] == 0.0 and abs(r.energy["clay"]) < 1e-20
    if k1:  # the second spring has no dent: it is new with each contact
        return
    # pushed out, it leaves a dent of that depth
    push = hc.Samples((0.0, 0.1, 0.11, 0.5), ((-4.0, 0.0), (-4.0, 0.0), (6.0, 0.0), (6.0, 0.0)))
    r = hc.simulate(dataclasses.replace(s, muscle=push, t_max=0.5, gain=(2.0, 0.0)))
    touching = r.fe[:, 0] > 0.0
    assert r.p[:, 0].min() < 0.0 and touching.any()
    assert r.p[touching, 0].min() >= 0.03 - 1e-12
    # a spring gives back what it took but for (omega h)^2/24, with omega h = 89 rad/s dt
    assert abs(r.energy["clay"] - r.energy["springs_stored"]) < 1e-4 * abs(r.energy["muscle"])


def test_a_wall_reached_from_its_side_has_no_energy():
    # a slider comes into a block that is a wall along x from below, 2 cm behind its front
    springs = hc.Spring(), hc.Spring(k=1e4, unilateral=True)
    law = hc.Profile((0.01,), (0.0, 0.0), "y", springs=springs)
    s = slider(hc.Clay(law, hc.Profile((), (0.0,))), 1e-3, 0.2, v=(0.0, 0.2))
    r = hc.simulate(s)
    assert len(r.crossings) == 1 and np.abs(r.fe).max() < 1e-6


def test_cells_on_one_axis_may_lie_beside_springs_on_the_other():
    cells = hc.Grid((0.02,), (0.0,), ((1.0, 2.0), (3.0, 20.0)))
    spring = hc.Profile((0.005,), (0.0, 5.0), "y", springs=(hc.Spring(), hc.Spring(k=200.0)))
    s = hc.Scenario(clay=hc.Clay(cells, spring), force=(0.5, 4.0), t_max=0.5, length=None)
    r = hc.simulate(s)
    assert r.outcome.code == "time limit" and r.p[-1, 1] > 0.005
    assert r.energy["springs_stored"] > 0.0 and abs(r.energy["residual"]) < 1e-6
