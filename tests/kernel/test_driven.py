"""Driven runs, growing clay, a start at speed, against independent solutions.

With shaping each axis is linear: p, compensator and reference model under SciPy's DOP853 at 1e-11,
the muscle force and the clay spelt out as functions of time.
"""

import dataclasses
import functools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hapticclay as hc
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.model.operator import Operator
from hapticclay.model.signals import Multisine
from tests.oracles import G0, G1, axis_rates, piecewise_linear

TH = (0.25, 2.0, 6.0)


def muscle_of(m, t, i):
    s = m
    return np.sum(s.amplitude[i] * np.cos(s.omega * t + s.phase[:, i]))


def axis_solution(  # noqa: PLR0913  # a case, spelt out
    i, b, K, uh, th, t_end, command=lambda t: 0.0, z0=None, edge=None
):
    """One axis under b(t), uh(t), command(t); z = (p, v, delta, delta', y, y')."""
    rates = axis_rates(i, K, th)
    events = None
    if edge is not None:

        def events(t, z):
            return z[0] - edge

        events.terminal = True
    return solve_ivp(
        lambda t, z: rates(z, b(t), uh(t), command(t)),
        (0.0, t_end),
        np.zeros(6) if z0 is None else z0,
        "DOP853",
        rtol=1e-11,
        atol=1e-13,
        dense_output=True,
        events=events,
    )


MUSCLE = Multisine(rms=(1.0, 0.5), low=0.2, high=3.0, period=5.0, seed=5)
COMMAND = Multisine(rms=(1e-3, 2e-3), low=0.5, high=3.0, period=5.0, seed=6)
DRIVEN = dataclasses.replace(
    hc.free(inertia_shaping=True, operator=hc.Operator(), force=(0.5, 0.0), t_max=2.0),
    length=None,
    muscle=MUSCLE,
    command=COMMAND,
)


@functools.cache
def driven(i):
    """The solution of an axis of that scene."""
    return axis_solution(
        i,
        lambda t: 0.0,
        DRIVEN.gain[i],
        lambda t: DRIVEN.force[i] + muscle_of(MUSCLE, t, i),
        TH,
        DRIVEN.t_max,
        lambda t: muscle_of(COMMAND, t, i) - muscle_of(COMMAND, 0.0, i),
    ).sol


@pytest.mark.parametrize(
    "kw,tolerance",
    [
        (dict(), 1e-7),
        (dict(integrator="accurate", dt=2e-3), 1e-9),
        (dict(dt=2e-3), 4e-6),
    ],
)
def test_varying_muscle_force_and_command(kw, tolerance):
    """Errors of second order in dt:

    (omega dt)^2/12 of some cm at 3 Hz is 2e-7 m at 0.36 ms; of fourth, far less.
    """
    s = dataclasses.replace(DRIVEN, **kw)
    r = hc.simulate(s)
    assert r.outcome.code == "time limit"
    for i in (0, 1):
        assert np.max(np.abs(r.p[:, i] - driven(i)(r.t)[0])) < tolerance
    residual = abs(r.energy["residual"]) / r.energy["throughput"]
    assert residual < (1e-6 if s.integrator == "fast" else 1e-9) * max(1.0, (s.dt / 3.6e-4) ** 2)


def test_varying_scenes_converge_at_second_order():
    clay = Clay(
        Profile((0.01,), (50.0, 100.0), growth=(0.0, 300.0)), Profile((0.01,), (50.0, 100.0))
    )
    s = dataclasses.replace(
        hc.free(operator=hc.Operator(), t_max=1.5), clay=clay, length=None, muscle=MUSCLE
    )
    exact = hc.simulate(dataclasses.replace(s, integrator="accurate", dt=5e-4))
    errors = []
    for n in (1, 2, 4):
        r = hc.simulate(dataclasses.replace(s, dt=1e-3 * n))
        errors.append(np.max(np.abs(r.p - exact.p[:: 2 * n][: len(r.p)])))
    order = np.polyfit(np.log([1, 2, 4]), np.log(errors), 1)[0]
    assert order > 1.8, errors


@pytest.mark.parametrize(
    "kw,tolerance", [(dict(), 1e-6), (dict(integrator="accurate", dt=2e-3), 1e-8)]
)
def test_growing_clay_counts_from_entry(kw, tolerance):
    clay = Clay(Profile((0.02,), (50.0, 100.0), growth=(0.0, 30.0)), Profile((), (50.0,)))
    s = dataclasses.replace(hc.free(inertia_shaping=True, t_max=3.0), clay=clay, **kw)
    r = hc.simulate(s)
    first = axis_solution(0, lambda t: 50.0, 1.0, lambda t: 1.0, (0, 0, 0), 3.0, edge=0.02)
    entry = first.t[-1]
    assert r.crossings[0].time == pytest.approx(entry, abs=tolerance)
    z = first.y[:, -1]
    later = axis_solution(
        0, lambda t: 100.0 + 30.0 * t, 1.0, lambda t: 1.0, (0, 0, 0), 3.0 - entry, z0=z
    )
    after = r.t > entry
    assert np.max(np.abs(r.p[after, 0] - later.sol(r.t[after] - entry)[0])) < tolerance
    np.testing.assert_allclose(
        r.b[after, 0], 100.0 + 30.0 * (r.t[after] - r.crossings[0].time), rtol=1e-12
    )
    assert np.all(r.b[:, 1] == 50.0)
    assert len(r.regions()) == 2


def test_growth_counts_from_the_first_entry():
    """In, out and in again: the clock of the region does not start anew."""
    clay = Clay(Profile((0.0,), (50.0, 100.0), growth=(0.0, 30.0)), Profile((), (50.0,)))
    muscle = Multisine(rms=(3.0, 0.0), low=0.5, high=0.5, period=2.0, seed=1)
    s = dataclasses.replace(
        hc.free(inertia_shaping=True, t_max=4.0, force=(0.0, 0.0), dt=1e-3),
        clay=clay,
        length=None,
        muscle=muscle,
        start=(-1e-3, 0.0),
    )
    r = hc.simulate(s)
    ups = [c.time for c in r.crossings if c.speed > 0.0]
    assert len(ups) >= 2
    inside = r.p[:, 0] > 1e-6
    np.testing.assert_allclose(r.b[inside, 0], 100.0 + 30.0 * (r.t[inside] - ups[0]), rtol=1e-12)


@pytest.mark.parametrize("control", ["continuous", "sampled"])
@pytest.mark.parametrize("b,speed", [(90.0, 0.5), (1e4, 2.0), (1e9, 2.0), (90.0, 0.0)])
def test_clay_hit_at_speed(b, speed, control):
    """The loop as if it had moved so for long, delta ahead by G's lag:

    exact solution by matrix exponential.
    """
    s = dataclasses.replace(
        hc.constant_cut(
            b=b,
            inertia_shaping=True,
            t_max=0.7,
            control=control,
            render="physical",
            torque_limit=(1e5, 1e5),
        ),
        velocity=(speed, 0.0),
    )
    r = hc.simulate(s)
    z0 = (0.0, speed, 41.8 / 910.19 * speed, speed, 0.0, speed, 1.0)
    crossings, position = piecewise_linear(
        (0.05, 0.15, 0.2), (0.0, b, 0.0), 1.0, 1.0, t_max=0.7, z0=z0
    )
    # sampled: held for one sample, as a delay of half of it, 0.18 ms
    tolerance = 1e-6 if control == "continuous" else 4e-4
    mine = [c.time for c in r.crossings]
    assert len(mine) == len(crossings) and mine == pytest.approx(crossings, abs=tolerance)
    t = r.t[r.t < (crossings[-1] if len(crossings) == 3 else 0.7)]
    assert np.max(np.abs(r.p[: len(t), 0] - position(t))) < (
        2e-5 if control == "continuous" else 2e-3
    )
    kinetic = 0.5 / 0.7919 * r.v[:, 0] ** 2
    assert np.max(kinetic) <= 1.1 * np.max(0.5 / 0.7919 * np.gradient(position(t), t) ** 2)


@pytest.mark.parametrize(
    "engine,kw",
    [
        ("python", dict()),
        ("native", dict()),
        ("python", dict(integrator="accurate", dt=1.8e-3)),
        ("python", dict(control="sampled")),
        ("python", dict(control="sampled", dt=1.8e-4, Ts=3.6e-4, hardware=hc.Hardware())),
    ],
)
def test_command_is_counted_from_the_start(engine, kw):
    """K = 0 opens the loop:

    delta is the command less its value at t = 0, however the run is stepped; p = G delta.
    """
    command = Multisine(rms=(1e-3, 0.0), low=1.0, high=2.0, period=1.0, seed=2)
    s = hc.free(force=(0.0, 0.0), inertia_shaping=True, t_max=3000 * 3.6e-4)
    s = dataclasses.replace(s, gain=(0.0, 0.0), length=None, command=command, **kw)
    r, sig = hc.simulate(s, engine=engine), command
    assert abs(sig(0.0)[0]) > 1e-4  # a jump, if it were not counted from there
    every = round((s.Ts or s.dt) / s.dt)
    np.testing.assert_allclose(r.delta[::every], (sig(r.t) - sig(0.0))[::every], atol=1e-12)
    G = G0[0] / (G0[0] - sig.omega**2 + 1j * G1[0] * sig.omega)
    moved = (
        np.real(np.exp(1j * (np.outer(r.t, sig.omega) + sig.phase[:, 0])) @ G) * sig.amplitude[0]
        - sig(0.0)[0]
    )
    later = r.t > 0.7  # what the start has left decays at 21/s
    # (omega dt)^2/6 of 1.4 mm is 5e-9 m; held torques come half a sample late, which the servo's
    # poles double
    tolerance = np.abs(r.v).max() * 3.6e-4 if s.control == "sampled" else 1e-7
    assert np.max(np.abs(r.p[:, 0] - moved)[later]) < tolerance


def test_driven_records_survive_the_disk(tmp_path):
    clay = Clay(Profile((0.01,), (50.0, 100.0), growth=(0.0, 30.0)), Profile((), (50.0,)))
    s = dataclasses.replace(
        hc.free(t_max=0.1),
        clay=clay,
        muscle=Multisine(seed=3),
        command=Multisine(rms=(1e-3, 0.0)),
        operator=Operator(),
        velocity=(0.1, 0.0),
        stop_when_unstable=False,
    )
    assert hc.Record.load(hc.simulate(s).save(tmp_path)).scenario == s
