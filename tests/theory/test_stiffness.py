"""Loops in clay with a stiffness k: where it is physical, one with the hand's spring; by runs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.simulation.simulate import simulate
from hapticclay.studies.boundary import PushedLoop, pose_matrix
from hapticclay.studies.growth import growth_rate
from hapticclay.theory import gain_limits, linear_loop
from hapticclay.theory.loops import Loop

TIMINGS = [
    dict(),
    dict(delay=3e-3, render="physical"),
    dict(Ts=1e-3, render="physical"),
    dict(Ts=1e-3, delay=1.3e-3, render="physical"),
]


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 500.0), st.floats(0.0, 500.0), st.sampled_from(TIMINGS))
def test_a_physical_stiffness_is_one_with_the_hands_spring(k, spring, timing):
    one = Loop(b=30.0, K=1.0, k=k, operator=hc.Operator(0.2, 2.0, spring), **timing)
    other = replace(one, k=0.0, operator=hc.Operator(0.2, 2.0, spring + k))
    assert one.environment.coef == pytest.approx(other.environment.coef, rel=1e-15)
    if one.Ts:
        for a, b in zip(
            linear_loop.sampled_differences(one),
            linear_loop.sampled_differences(other),
            strict=True,
        ):
            assert a == pytest.approx(b, rel=1e-12, abs=1e-300)
    elif one.delay:
        pairs = linear_loop.delayed_polynomials(one), linear_loop.delayed_polynomials(other)
        for a, b in zip(*pairs, strict=True):
            assert a.coef == pytest.approx(b.coef, rel=1e-12)
    else:
        a, b = linear_loop.characteristic(one), linear_loop.characteristic(other)
        assert a.coef == pytest.approx(b.coef, rel=1e-12)
    if k + spring:
        assert gain_limits.gain_limit(one) == pytest.approx(gain_limits.gain_limit(other), rel=1e-7)


def test_a_late_stiffness_is_the_loop_of_the_definition():
    # s = j omega at the limit solves 1 + (G C + Sh)(Te + Th) with all that the motors do late
    loop = Loop(b=20.0, K=1.0, delay=4e-3, operator=hc.Operator())
    k = hc.theory.stiffness_limit(loop)
    at = replace(loop, k=k)
    physical, motors, driven = linear_loop.delayed_polynomials(at)
    omega = np.linspace(1.0, 300.0, 300_001)
    s = 1j * omega
    left = np.abs(physical(s) + np.exp(-s * loop.delay) * (motors(s) + driven(s)))
    size = np.abs(physical(s)) + np.abs(motors(s)) + np.abs(driven(s))
    assert (left / size).min() < 1e-5


@pytest.mark.parametrize(
    "timing",
    [
        dict(),
        dict(Ts=1e-3),
        dict(Ts=1e-3, delay=1.5e-3),
        dict(Ts=1e-3, delay=1.5e-3, render="physical"),
    ],
)
def test_runs_grow_beyond_the_limit_of_k_and_decay_below(timing):
    loop = PushedLoop(K=1.0, b=20.0, operator=hc.Operator(), **timing)
    limit = hc.theory.stiffness_limit(loop.linear)
    rates = [
        growth_rate(simulate(replace(loop, k=x * limit).scenario()), "x") for x in (0.995, 1.005)
    ]
    assert rates[0] < 0.0 < rates[1]
    # the matrix of both axes has the poles of this one
    z = np.linalg.eigvals(pose_matrix(replace(loop, k=limit)))
    border = np.abs(z) if loop.Ts else np.exp(z.real)
    assert border[np.abs(z - (1.0 if loop.Ts else 0.0)) > 1e-3].max() == pytest.approx(
        1.0, abs=1e-6
    )


def test_the_clay_of_a_spring_shows_in_transparency():
    loop = Loop(b=30.0, K=1.0, k=200.0)
    z, e = linear_loop.device_impedance(loop)
    s = 1j * np.array([0.5, 5.0, 50.0])
    te = 30.0 + 200.0 / s  # force over velocity
    assert hc.theory.transparency(loop, s.imag) == pytest.approx(te / (te + z(s) / e(s)), rel=1e-12)


def test_yielding_clay_is_refused_beside_a_stiffness():
    loop = Loop(K=1.0, k=10.0)
    for ask in (hc.theory.limit_cycles, hc.theory.push_outcomes, hc.theory.exact_cycles):
        with pytest.raises(ParameterError, match="k = 10"):
            ask(loop, flow=hc.Flow(Fy=1.0, b=10.0))
    with pytest.raises(ParameterError, match="^k"):
        Loop(k=-1.0)
