"""The linear loop against python-control and the paper's own limits."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model import controller
from hapticclay.model.controller import SERVO
from hapticclay.model.operator import Operator
from hapticclay.theory import linear_loop, loops
from tests.oracles import Linear, laws, piecewise_linear

TH = Operator()


def blocks(axis, K, b, operator):
    s = control.tf("s")
    G = {"x": 910.19 / (s**2 + 41.8 * s + 910.19), "y": 765.5 / (s**2 + 30.3 * s + 765.5)}[axis]
    S = {"x": 0.7919 / (s**2 + 41.1 * s + 432), "y": 0.131 / (s**2 + 32.4 * s + 492.46)}[axis]
    C = K / (s**2 + 10 * s)
    T = b * s + (0.25 * s**2 + 2 * s + 6 if operator else 0)
    return G, S, C, T


@pytest.mark.parametrize("axis", ["x", "y"])
@pytest.mark.parametrize("operator", [None, TH], ids=["hand off", "hand on"])
@given(K=st.floats(0.1, 30), b=st.floats(1, 1000), omega=st.floats(0.1, 300))
def test_characteristic_polynomial_is_one_plus_the_loop(axis, operator, K, b, omega):
    G, S, C, T = blocks(axis, K, b, operator)
    s = 1j * omega
    den = np.prod([np.polyval(np.atleast_1d(x.den[0][0]), s) for x in (C, G, S)])
    expected = (1 + (G(s) * C(s) + S(s)) * T(s)) * den
    found = linear_loop.characteristic(hc.theory.Loop(axis, b, operator, K=K))(s)
    assert found == pytest.approx(
        expected, rel=1e-11
    )  # cancellation between the terms costs up to 4 digits


@pytest.mark.parametrize("axis", ["x", "y"])
def test_poles_are_those_of_the_state_space_model(axis):
    for K, b, th in [(1, 90, None), (0.5, 300, TH), (3, 20, TH)]:
        m = Linear("xy".index(axis), b, K, 1.0, (0.25, 2, 6) if th else (0, 0, 0))
        # the state space has p, v beside the servo's states: same loop, order 6 in both
        np.testing.assert_allclose(
            np.sort_complex(loops.closed_loop_poles(axis, K, b, th)),
            np.sort_complex(m.poles()),
            atol=1e-6,
        )


@pytest.mark.parametrize(
    "axis,b,on,printed",
    [
        ("x", 50, True, 4.74),
        ("x", 90, True, 3.84),
        ("x", 100, True, 3.79),
        ("y", 50, True, 1.42),
        ("y", 90, True, 0.86),
        ("y", 100, True, 0.80),
        ("x", 50, False, 3.47),
        ("x", 90, False, 3.23),
        ("x", 100, False, 3.24),
        ("y", 50, False, 1.18),
        ("y", 90, False, 0.77),
        ("y", 100, False, 0.73),
    ],
)
def test_gain_limit_against_the_gain_margin_of_python_control(axis, b, on, printed):
    limit = hc.theory.gain_limit(axis, b, TH if on else None)
    G, S, C, T = blocks(axis, 1.0, b, on)
    loop = control.minreal(G * C * T / (1 + S * T), tol=1e-8, verbose=False)
    margins = control.stability_margins(loop, returnall=True)[0]
    assert limit == pytest.approx(min(m for m in margins if m > 0), rel=1e-6)
    assert limit == pytest.approx(printed, abs=0.0055)  # half the last digit, and a hair


def test_y_axis_is_unstable_at_unit_gain():
    assert loops.closed_loop_poles("y", 1.0, 100.0).real.max() == pytest.approx(2.36, abs=0.005)
    assert loops.closed_loop_poles("y", 1.0, 100.0, TH).real.max() == pytest.approx(1.56, abs=0.005)

    def stable(b):
        return linear_loop.stable(hc.theory.Loop("y", b, K=1.0))

    assert stable(61.0) and not stable(63.0)
    assert not stable(3800.0) and stable(4000.0)


def test_gain_limit_without_clay_and_hand_is_infinite():
    assert hc.theory.gain_limit("x", 0.0) == float("inf")


def test_gain_limit_where_a_resonance_of_the_hand_sits_on_the_axis():
    """An undamped hand makes the driven polynomial vanish at its resonance.

    No K puts a pole there.
    """
    for th in (Operator(1.0, 0.0, 6.0), Operator(0.25, 0.0, 100.0)):
        limit = hc.theory.gain_limit("y", 0.0, th)
        assert limit > 0.0
        assert limit == float("inf") or not linear_loop.stable(
            hc.theory.Loop("y", 0.0, th, K=1.001 * limit)
        )


@given(K=st.floats(0.01, 100), f=st.floats(-10, 10), b=st.floats(0, 1e6))
def test_steady_speed_is_the_static_gain_of_the_loop(K, f, b):
    # p/uh = (GC + S)/(1 + (GC + S) b s) times s, at s = 0
    G, S, C, _ = blocks("x", K, b, None)
    s = 1e-7
    H = G(s).real * C(s).real + S(s).real
    assert linear_loop.steady_speed(K, f, b) == pytest.approx(s * H / (1 + H * b * s) * f, rel=1e-6)


@pytest.mark.parametrize(
    "call,field",
    [
        (lambda: hc.theory.closed_loop_poles("z", 1, 1), "axis"),
        (lambda: hc.theory.closed_loop_poles("x", -1, 1), "K"),
        (lambda: hc.theory.closed_loop_poles("x", 1, float("nan")), "b"),
    ],
)
def test_bad_input_is_refused(call, field):
    with pytest.raises(ParameterError) as e:
        call()
    assert e.value.field == field


@pytest.mark.parametrize("axis", "xy")
@pytest.mark.parametrize("th", [None, Operator(), Operator(5.0, 0.0, 100.0)])
def test_state_space_has_the_poles_and_the_oracles_matrix(axis, th):
    A, B = linear_loop.state_space(hc.theory.Loop(axis, 90.0, th, K=0.7))
    poles = np.sort_complex(loops.closed_loop_poles(axis, 0.7, 90.0, th))
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(A)), poles, atol=1e-5
    )  # a double pole near 0
    numbers = (th.mass, th.damper, th.spring) if th else (0.0, 0.0, 0.0)
    other = Linear("xy".index(axis), 90.0, 0.7, 1.3, numbers).A
    np.testing.assert_allclose(np.column_stack((A, 1.3 * B)), other[:6], rtol=1e-13, atol=1e-12)


def test_crossing_times_beside_the_oracle():
    exact, _ = piecewise_linear((0.05, 0.15, 0.2), (0.0, 90.0, 0.0), 1.0, 1.0)
    assert linear_loop.crossing_times(
        hc.theory.Loop(K=1.0), 1.0, (0.05, 0.15, 0.2), (0.0, 90.0, 0.0)
    ) == pytest.approx(exact, abs=1e-10)  # eleven thousand products
    assert linear_loop.crossing_times(hc.theory.Loop(K=1.0), -1.0, (0.05,), (0.0,), t_max=0.5) == []


@pytest.mark.parametrize("axis", "xy")
@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6), st.floats(1e-5, 1e-2))
def test_law_of_the_loop_and_feedback_vector_agree(axis, state, H):
    """A kick whose sample lies at its end sees the state before it.

    The explicit form of the law.
    """
    i = "xy".index(axis)
    servo = SERVO[i]
    p, v, delta, _, y, yd = state
    keep, take, *weights = laws.servo_weights(servo, H, 1.0, 0.0)
    ahead = keep * yd + take * (delta - y)
    law = laws.servo_acceleration(*weights, (yd, ahead), v, y, p, 0.0) - v / H
    size = np.abs(state) @ np.abs(controller.feedback_vector(servo))
    assert law == pytest.approx(
        controller.feedback_vector(servo) @ state, abs=1e-14 * (size + 4.0 / H)
    )
    A = linear_loop.state_space(hc.theory.Loop(axis, K=1.0))[
        0
    ]  # without clay and hand the law is all there is
    assert np.array_equal(A[1], controller.feedback_vector(servo))


@pytest.mark.parametrize("delay", [0.0, 4e-4, 1e-3, 2.3e-3])
@pytest.mark.parametrize("render", ["held", "physical"])
def test_sampled_loop_of_both_axes_is_that_of_each_where_nothing_couples_them(delay, render):
    loops = [hc.theory.Loop(axis, 90.0, TH, Ts=1e-3, delay=delay, render=render) for axis in "xy"]
    less, beta, gamma = linear_loop.sampled_differences(*loops)
    n = len(less) // 2
    for j in range(2):
        mine = [*range(6 * j, 6 * j + 6), *range(12 + j, 2 * n, 2)]
        one = linear_loop.sampled_differences(loops[j])
        both = less[np.ix_(mine, mine)], beta[mine, j : j + 1], gamma[j : j + 1, mine]
        for a, b in zip(both, one, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14 * np.abs(b).max())
        others = [k for k in range(2 * n) if k not in mine]
        assert np.abs(less[np.ix_(mine, others)]).max() <= 1e-14 * np.abs(less).max()


def test_sampled_loop_tends_to_the_continuous_one_at_any_mobility():
    """Both axes coupled: (M - 1)/Ts of slow states is A, to first order in Ts."""
    W = np.array([[0.6, 0.2], [0.2, 0.3]])
    loops = [hc.theory.Loop(axis, 20.0, TH, K=K) for axis, K in (("x", 0.7), ("y", 0.3))]
    A = linear_loop.state_space(*loops, mobility=W)[0]
    poles = np.linalg.eigvals(A)
    gaps = []
    for Ts in (4e-5, 2e-5):
        less, beta, gamma = linear_loop.sampled_differences(
            *(replace(x, Ts=Ts) for x in loops), pose=(W, False)
        )
        z = np.linalg.eigvals(less + beta @ np.diag([0.7, 0.3]) @ gamma)
        found = np.log1p(z[np.abs(1.0 + z) > 0.5]) / Ts
        gaps.append(max(np.min(np.abs(found - x)) / abs(x) for x in poles if abs(x) > 1e-3))
    assert gaps[1] < 5e-3 and gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.1)
