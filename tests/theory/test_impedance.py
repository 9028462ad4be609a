"""Impedance over frequency against python-control, a march in time, and the limits of a hold."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.controller import SERVO
from hapticclay.theory import impedance, stability_margins
from hapticclay.theory.impedance import Impedance, loop_impedance, loop_response, wall_response
from tests.hunt import HUNTS, examples
from tests.oracles.multirate import fundamental

TH = hc.Operator()
OMEGA = 2.0 * np.pi * np.geomspace(0.5, 30.0, 13)


@pytest.mark.parametrize("axis", ["x", "y"])
@given(K=st.floats(0.05, 20.0), b=st.floats(0.0, 1e3), k=st.floats(0.0, 1e4), held=st.booleans())
@examples(20)
def test_continuous_impedance_is_that_of_python_control(axis, K, b, k, held):
    s = control.tf("s")
    G = {"x": 910.19 / (s**2 + 41.8 * s + 910.19), "y": 765.5 / (s**2 + 30.3 * s + 765.5)}[axis]
    S = {"x": 0.7919 / (s**2 + 41.1 * s + 432), "y": 0.131 / (s**2 + 32.4 * s + 492.46)}[axis]
    device = G * K / (s**2 + 10 * s) + S
    s = 1j * OMEGA
    Z = 1.0 / (s * device(s)) + b + k / s
    loop = hc.theory.Loop(axis, b, TH, K=K, k=k, render="held" if held else "physical")
    found = loop_response(loop, OMEGA)
    np.testing.assert_allclose(found.Z, Z, rtol=1e-10)  # a ratio of polynomials of degree 6
    np.testing.assert_allclose(
        found.transparency, stability_margins.transparency(loop, OMEGA), rtol=1e-10
    )
    np.testing.assert_allclose(found.transparency, (b + k / s) / Z, rtol=1e-10, atol=1e-300)


@pytest.mark.parametrize("render", ["held", "physical"])
def test_late_impedance_is_that_of_the_signals_around_the_loop(render):
    """The servo's law written out with every motor force late (docs/equations.md, section 3)."""
    loop = hc.theory.Loop("x", 90.0, None, K=2.0, delay=4e-3, k=300.0, render=render, mobility=1.3)
    s = 1j * OMEGA
    G, S = loop.servo.G, loop.servo.S
    late, e = np.exp(-s * loop.delay), loop.b * s + loop.k
    net_to_y = G.gain / (s**2 + G.damping * s + G.stiffness) * loop.gain / (s**2 + 10.0 * s)
    # p = X fh solves s^2 p = W (fh - now) + late (asked + (Wn/W - 1) W f - held), f = fh - e p
    W, now, held = 1.3, (e if render == "physical" else 0.0), (e if render == "held" else 0.0)
    servo = s**2 + S.damping * s + S.stiffness
    pull = S.damping * s + S.stiffness
    right = W + late * (S.gain - W + servo * net_to_y)
    left = s**2 + W * now + late * (pull + W * held + (S.gain - W + servo * net_to_y) * e)
    np.testing.assert_allclose(loop_impedance(loop, OMEGA), left / (s * right), rtol=1e-11)


MARCHES = [  # each two of hand, delay and rendering, in a hunt each three
    (operator, delay, render)
    for i, operator in enumerate((None, TH, hc.Operator(2.0, 1.0, 0.0)))
    for j, delay in enumerate((0.0, 1.7e-3, 5e-3))
    for k, render in enumerate(("held", "physical"))
    if HUNTS or (i + j + k) % 2 == 0
]


@pytest.mark.parametrize("operator, delay, render", MARCHES)
def test_sampled_impedance_is_that_of_a_march_in_time(operator, render, delay):
    """Ts = 5 ms, where the hold costs a third of the damping at 20 Hz."""
    Ts, b, k, K, W = 5e-3, 30.0, 80.0, 0.6, 0.9
    loop = hc.theory.Loop(
        "x", b, operator, K=K, k=k, Ts=Ts, delay=delay, render=render, mobility=W
    )  # fmt: skip
    G, S, hand = SERVO[0].G, SERVO[0].S, loop.hand
    implicit = render == "physical"
    A = np.zeros((5, 5))  # delta, delta', y, y', f
    A[0, 1] = A[2, 3] = 1.0
    A[1] = [0.0, -10.0, 0.0, 0.0, K]
    A[3] = [G.gain, 0.0, -G.stiffness, -G.damping, 0.0]
    E = expm(A * Ts)
    mass = 1.0 / W + hand.mass
    damper = hand.damper + b * implicit
    spring = hand.spring + k * implicit

    def law(p, v, muscle, acted, z):
        z = np.zeros(4) if z is None else z
        a = (muscle + acted - damper * v - spring * p) / mass
        f = muscle - hand.mass * a - (hand.damper + b) * v - (hand.spring + k) * p
        ydd = G.gain * z[0] - G.stiffness * z[2] - G.damping * z[3]
        asked = ydd + S.damping * (z[3] - v) + S.stiffness * (z[2] - p)
        u = asked / W + (S.gain / W - 1.0) * f - (0.0 if implicit else b * v + k * p)
        return u, (E @ np.append(z, f))[:4]

    omega = 2.0 * np.pi * np.array([2.0, 8.0, 20.0])
    found = loop_response(loop, omega)
    for i, w in enumerate(omega.tolist()):
        p, v, u = fundamental(mass, damper, spring, law, Ts, delay, w, 3000, 20)
        s = 1j * w
        fh = 1.0 - (hand.mass * s + hand.damper + hand.spring / s) * v
        # the transient has faded to 1e-9; the march loses a few digits more
        assert found.Z[i] == pytest.approx(fh / v, rel=1e-7)
        motor_free = mass * s + damper + spring / s
        assert 1.0 + u == pytest.approx(motor_free * v, rel=1e-6)  # the oracle on itself


@pytest.mark.parametrize(
    "wall",
    [
        hc.VirtualWall(K=300.0, B=2.0),
        hc.VirtualWall(K=300.0, B=2.0, M=0.03, operator=TH),
        hc.VirtualWall(K=100.0, B=1.0, M=-0.02, delay=3e-3, velocity="exact"),
        hc.VirtualWall(
            K=100.0, B=2.0, M=0.02, delay=3.7e-3, velocity_window=3, velocity_filter=40.0
        ),
    ],
)
def test_wall_impedance_is_that_of_a_march_in_time(wall):
    Ts = 2e-3
    wall = replace(wall, Ts=Ts, device=hc.Device(0.1, 1.0))
    d, hand = wall.device, wall.hand
    cutoff = wall.velocity_filter
    keep = math.exp(-2.0 * math.pi * cutoff * Ts) if cutoff else 0.0

    def law(p, v, muscle, acted, z):
        past, smooth, before = z or ([p] * wall.velocity_window, 0.0, 0.0)
        smooth = keep * smooth + (1.0 - keep) * (p - past[-wall.velocity_window]) / (
            wall.velocity_window * Ts
        )
        rate = v if wall.velocity == "exact" else smooth
        force = -(wall.K * p + wall.B * rate + wall.M * (rate - before) / Ts)
        return force, ([*past, p][-wall.velocity_window :], smooth, rate)

    mass, damper = d.mass + hand.mass, d.damper + hand.damper
    omega = 2.0 * np.pi * np.array([2.0, 10.0, 25.0])
    found = wall_response(wall, omega)
    for i, w in enumerate(omega.tolist()):
        p, v, u = fundamental(mass, damper, hand.spring, law, Ts, wall.delay, w, 4000, 20)
        s = 1j * w
        fh = 1.0 - (hand.mass * s + hand.damper + hand.spring / s) * v
        assert found.Z[i] == pytest.approx(fh / v, rel=1e-7)  # as above
        assert found.transparency[i] == pytest.approx(-u / fh, rel=1e-7)


@given(
    K=st.floats(0.0, 1e4),
    B=st.floats(-1.0, 20.0),
    M=st.floats(-0.05, 0.1),
    delay=st.floats(0.0, 4e-3),
    velocity_window=st.integers(1, 5),
)
@examples(12)
def test_wall_impedance_agrees_with_wall_limits_without_a_hand(K, B, M, delay, velocity_window):
    """Two derivations of one number; the hand's sidebands are none without its arm."""
    wall = hc.VirtualWall(
        K, B, M, hc.Device(0.2, 0.7), delay=delay, velocity_window=velocity_window
    )
    found = wall_response(wall, OMEGA)
    np.testing.assert_allclose(found.Z, hc.walls.wall_impedance(wall, OMEGA), rtol=1e-8)
    # the device itself is left: fh = (m s + b) v + fe
    s = 1j * OMEGA
    own = (0.2 * s + 0.7) / found.Z
    np.testing.assert_allclose(found.transparency + own, 1.0, atol=1e-9 * np.abs(own).max())


def test_a_fast_sampled_loop_is_the_continuous_one():
    exact = loop_impedance(hc.theory.Loop("x", 90.0, TH, K=1.0), OMEGA)
    gaps = [
        np.abs(
            loop_impedance(hc.theory.Loop("x", 90.0, TH, K=1.0, Ts=Ts), OMEGA) / exact - 1.0
        ).max()
        for Ts in (1e-5, 1e-6)
    ]
    assert gaps[0] == pytest.approx(10.0 * gaps[1], rel=0.02)  # first order in Ts
    assert gaps[1] < 1e-4


def test_low_frequencies_feel_the_steady_values():
    """The stiffness of a wall, less nothing; its damping less K Ts/2, the cost of the hold."""
    wall = hc.VirtualWall(500.0, 3.0, device=hc.Device(0.1, 0.5))
    found = wall_response(wall, np.array([1e-2]))
    assert found.stiffness[0] == pytest.approx(500.0, rel=1e-6)
    # the difference is late by Ts/2, which at rest costs nothing more
    assert found.damping[0] == pytest.approx(0.5 + 3.0 - 500.0 * 0.5e-3, rel=1e-6)
    loop = hc.theory.Loop("x", 90.0, None, K=1.0)
    slow = loop_response(loop, np.array([1e-4]))
    assert slow.damping[0] == pytest.approx(90.0 + 10.0, rel=1e-6)  # K f = (10 + K b) v


def test_effective_values_are_those_of_a_spring_a_damper_and_a_mass():
    s = 1j * OMEGA
    none = np.zeros_like(s)
    spring = Impedance(OMEGA, 4.0 + 30.0 / s, none, 3.0 + 30.0 / s)
    np.testing.assert_allclose(spring.stiffness, 30.0)
    np.testing.assert_allclose(spring.damping, 4.0)
    assert np.all(np.isnan(spring.mass))
    mass = Impedance(OMEGA, 4.0 + 0.7 * s, none, none)
    np.testing.assert_allclose(mass.mass, 0.7)
    assert np.all(np.isnan(mass.stiffness)) and np.all(np.isnan(mass.ratio))
    np.testing.assert_allclose(spring.ratio, (4.0 + 30.0 / s) / (3.0 + 30.0 / s))
    np.testing.assert_allclose(mass.frequency, OMEGA / (2.0 * math.pi))


@pytest.mark.parametrize("omega", [[0.0], [-1.0], [math.nan], [[1.0]], [math.inf]])
def test_frequencies_are_above_zero(omega):
    with pytest.raises(ParameterError, match="omega"):
        impedance.loop_response(hc.theory.Loop("x", 90.0, K=1.0), np.array(omega))
