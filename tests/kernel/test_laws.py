"""Laws of the clay in modules of their own, in every method, against independent solutions."""

import dataclasses
import itertools
import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.kernel import user_laws
from hapticclay.simulation import run
from tests.hunt import some
from tests.kernel.test_engines import summary_of
from tests.oracles import Arm, axis_rates, drag_law, hardening_law
from tests.oracles.hardening_law import DAMPING, WAY

CLAY = 5.0  # [N.s/m] of the viscous clay around the law
ARRAYS = ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta")
CONTRACT = "numbers", "refuses", "start", "load", "moved", "force"
METHODS = {
    "continuous": dict(),
    "accurate": dict(integrator="accurate", dt=2e-3),
    "physical": dict(control="sampled", render="physical"),
    "held": dict(control="sampled", render="held"),
    "hardware": dict(
        control="sampled",
        render="held",
        hardware=hc.Hardware(jitter=2e-5, delay=4e-4, passivity=True, friction=(0.01, 0.01)),
    ),
}


@pytest.fixture
def hardening(monkeypatch):
    monkeypatch.setattr(user_laws, "TABLE", [hardening_law])


@pytest.fixture
def both(monkeypatch):
    monkeypatch.setattr(user_laws, "TABLE", [hardening_law, drag_law])


def scene(**kw):
    flat = hc.Profile((), (CLAY,))
    s = hc.free(inertia_shaping=True, force=(1.0, 0.0), t_max=0.6)
    return dataclasses.replace(s, length=None, clay=hc.Clay(flat, flat), **kw)


def axis_solution(times):
    """p and the way gone of x, whose compensator and servo are linear: by DOP853 at 1e-12."""
    rates = axis_rates(0, 1.0)

    def rhs(t, z):
        b = CLAY + DAMPING * (1.0 + z[6] / WAY)
        return np.append(rates(z[:6], b, 1.0), abs(z[1]))

    end = times[-1]
    return solve_ivp(rhs, (0.0, end), np.zeros(7), "DOP853", times, rtol=1e-12, atol=1e-15).y[
        [0, 6]
    ]


def errors_of(integrator, steps):
    out = []
    for dt in steps:
        r = hc.simulate(scene(integrator=integrator, dt=dt))
        p, gone = axis_solution(r.t)
        out.append(np.abs(r.p[:, 0] - p).max())
        b = CLAY + DAMPING * (1.0 + gone / WAY)
        assert np.abs(r.fe[1:-1, 0] - (b * r.v[:, 0])[1:-1]).max() < 1e-3 * np.abs(r.fe).max()
        small = 1e-12 if integrator == "fast" else 5e-9 * (dt / 1e-3) ** 4
        assert abs(r.energy["residual"]) < small * r.energy["throughput"]
    return out


@pytest.mark.parametrize(
    "integrator,steps,order,most",
    [("fast", (2e-3, 1e-3, 5e-4), 2, 1e-7), ("accurate", (8e-3, 4e-3, 2e-3), 4, 1e-9)],
)
def test_the_law_converges_in_continuous_control(hardening, integrator, steps, order, most):
    """The handle goes one way, so that its way is exact from step to step."""
    errors = errors_of(integrator, steps)
    found = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order - 0.4 < found < order + 0.7 and errors[-1] < most, (found, errors)


def moved_by(s, r, f_clay):
    """Joint angles at the samples of a run under the torques that its motors held: by DOP853.

    Args:
        s: the scenario.
        r: its record.
        f_clay: force of the clay on the handle by velocity and way gone, None where there is none.
    """
    inverse, every = np.linalg.inv(Arm.M), round((s.Ts or s.dt) / s.dt)

    def rhs(t, z, tau):
        q, w = z[:2], z[2:4]
        J = Arm.jacobian(q)
        v = J @ w
        b = (CLAY + DAMPING * (1.0 + z[4] / WAY)) if f_clay else 0.0
        return np.concatenate(
            (w, inverse @ (tau + J.T @ (np.array(s.force) - b * v)), [np.hypot(*v)])
        )

    z, out = np.array([*r.q[0], 0.0, 0.0, 0.0]), []
    for i in range(0, len(r.t) - every, every):
        z = solve_ivp(
            rhs, (r.t[i], r.t[i + every]), z, "DOP853", args=(r.tau[i],), rtol=1e-12, atol=1e-14
        ).y[:, -1]
        out.append(z)
    return np.array(out)


@pytest.mark.parametrize("render", ["physical", "held"])
def test_the_law_converges_under_held_torques(hardening, render):
    """The arm between control samples of 2 ms, at ever shorter steps."""
    errors = []
    for n in (1, 2, 4):
        s = scene(control="sampled", render=render, Ts=2e-3, dt=2e-3 / n)
        s = dataclasses.replace(s, t_max=0.2, force=(1.0, 0.4))
        r = hc.simulate(s)
        z = moved_by(s, r, render == "physical")
        errors.append(np.abs(r.q[n::n][: len(z)] - z[:, :2]).max())
        if render == "held":  # what the motors hold is the law at the control samples
            gone = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(r.p, axis=0).T))))
            f = (CLAY + DAMPING * (1.0 + gone / WAY))[:, None] * r.v
            np.testing.assert_allclose(r.fe[:-1:n], f[:-1:n], rtol=1e-9, atol=1e-12)
    found = np.polyfit(np.log([1.0, 0.5, 0.25]), np.log(errors), 1)[0]
    assert 1.6 < found < 2.5 and errors[-1] < 1e-6, (found, errors)


def same(a, b):
    return {name for name in ARRAYS if not np.array_equal(getattr(a, name), getattr(b, name))}


@pytest.mark.parametrize("name", [name for name in METHODS if name != "held"])  # as "hardware"
def test_both_engines_and_steps_one_by_one_give_the_same_bits(both, name):
    s = dataclasses.replace(scene(**METHODS[name]), t_max=0.1, force=(1.0, 0.3))
    a, b = hc.simulate(s, engine="python"), hc.simulate(s, engine="native")
    assert not same(a, b) and a.energy == b.energy
    assert np.abs(a.fe[:, 0]).max() > 1.5 * CLAY * np.abs(a.v[:, 0]).max()
    small = 1e-12 if s.integrator == "fast" else 1e-6
    assert abs(a.energy["residual"]) < small * a.energy["throughput"]
    with hc.Simulation(s) as one:
        while one.outcome is None:
            one.step()
        assert not same(a, one.record())
    assert hc.simulate_batch([s], keep="summaries")[0].tobytes() == summary_of(a).tobytes()


@pytest.mark.parametrize("engine", ["python", "native"])
@pytest.mark.parametrize("name", ["continuous", "accurate", "physical"])
def test_a_run_goes_on_from_a_snapshot_with_the_law_as_it_was(both, name, engine):
    s = dataclasses.replace(scene(**METHODS[name]), t_max=0.1)
    whole, parts = run.Run(s, 1, engine), run.Run(s, 1, engine)
    whole.go(None)
    parts.pause = parts.scenario.t_max // s.dt // 2
    parts.go(None)
    saved = parts.snapshot()
    other = run.Run(s, 1, engine)
    other.return_to(pickle.loads(pickle.dumps(saved)))
    other.go(None)
    for name, x in whole.arrays().items():
        assert (x == other.arrays()[name]).all(), name


@pytest.mark.parametrize("name", ["continuous", "accurate", "physical"])
def test_borders_and_clay_that_yields_lie_beside_the_law(both, name):
    """Two regions, of which the second yields and holds the handle once the push ends."""
    layers = hc.Profile((0.005,), (CLAY, 20.0), Fy=(0.0, 0.3))
    s = scene(**METHODS[name], muscle=hc.Step((-0.9, 0.0), 0.4))
    s = dataclasses.replace(s, clay=hc.Clay(layers, hc.Profile((), (CLAY,))), t_max=0.8)
    r = hc.simulate(s)
    assert [c.axis for c in r.crossings] == ["x"]
    assert [x.axis for x in r.stops] == ["x"] and r.stops[0].start > 0.4
    small = 1e-12 if s.integrator == "fast" else 1e-6
    assert abs(r.energy["residual"]) < small * r.energy["throughput"]
    # where the handle rests the clay holds what the hand pushes with, but in the servo's share
    assert not r.v[-10:, 0].any() and np.ptp(r.p[-10:, 0]) < 1e-15


def test_what_a_law_refuses_is_refused_at_the_door(hardening):
    flat = hc.Profile((), (CLAY,))
    turned = dataclasses.replace(scene(), clay=hc.Clay(flat, flat, angle=0.1))
    coupled = scene(control="sampled", hardware=hc.Hardware(coupling=hc.Coupling(3000.0, 300.0)))
    for s, told in ((turned, "must not have rotated axes"), (coupled, "without a coupling")):
        with pytest.raises(ParameterError, match=told) as e:
            hc.simulate(s)
        assert e.value.field == "clay"


def test_batches_carry_the_law(both):
    """Records and summaries of many runs, long enough and short, are those of single runs."""
    few = [dataclasses.replace(scene(**METHODS[name]), t_max=0.1) for name in METHODS]
    for s, r in zip(few, hc.simulate_batch(few), strict=True):
        assert not same(hc.simulate(s, engine="python"), r)
    many = [dataclasses.replace(scene(force=(0.5 + 0.02 * i, 0.0)), t_max=0.05) for i in range(40)]
    ends = hc.simulate_batch(many, keep="summaries")
    at = some(range(40), 10)
    single = np.array([hc.simulate(many[i], engine="python").p[-1] for i in at])
    np.testing.assert_array_equal(ends["p"][at], single)
    assert not np.array_equal(single, single[0])


FAILS = {
    "load": lambda z, k: 1 / 0,
    "moved": lambda z, px, py, vx, vy, h: 1 / 0,
    "force": lambda z, px, py, vx, vy, out: 1 / 0,
}


@pytest.mark.parametrize("engine", ["python", "native"])
@pytest.mark.parametrize("function", FAILS)
def test_what_a_law_raises_ends_the_run_and_is_raised(function, engine, monkeypatch, capfd):
    functions = {name: getattr(drag_law, name) for name in CONTRACT}
    law = SimpleNamespace(**functions | {function: later(functions[function], FAILS[function])})
    monkeypatch.setattr(user_laws, "TABLE", [law])
    for s in (scene(), scene(control="sampled", render="physical")):
        with pytest.raises(ZeroDivisionError):
            hc.simulate(s, engine=engine)
        with pytest.raises(ZeroDivisionError), hc.Simulation(s, engine=engine) as one:
            while one.outcome is None:
                one.step()
    with pytest.raises(ZeroDivisionError):
        hc.simulate_batch([scene(force=(0.1 * i, 0.0)) for i in range(6)], keep="summaries")
    assert not capfd.readouterr().err


def later(plain, fails):
    """A function that fails at each third call and then no more."""
    calls = itertools.count(1)
    return lambda *arguments: (fails if next(calls) % 3 == 0 else plain)(*arguments)
