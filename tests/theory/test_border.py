"""Poles and zeros on the border of stability and close beside it, late and slow loops.

Beside roots with 60 digits, and beside the phase along a dense axis.
"""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

import hapticclay as hc
from hapticclay.theory import exact_roots, gain_crossings, late_roots, linear_loop
from tests.hunt import examples
from tests.oracles import digits

HAND = hc.Operator()
BESIDE = [0.0, 0.0, 1e-13, -1e-13, 1e-10, -1e-10, 1e-7, -1e-7, 1e-3]  # damping ratios
SIZE = st.integers(1, 3000).map(lambda n: n / 10.0)  # [rad/s]
PAIR = st.tuples(st.sampled_from(BESIDE), SIZE).map(lambda x: [1.0, 2.0 * x[0] * x[1], x[1] ** 2])
REAL = st.tuples(st.sampled_from([1.0, 1.0, -1.0, 0.0]), SIZE).map(lambda x: [1.0, x[0] * x[1]])
UNDAMPED = hc.Compensator((1.0,), (1.0, 30.0, 122500.0, 3675000.0))


def coefficients(factors) -> np.ndarray:
    out = np.ones(1)
    for f in factors:
        out = np.convolve(out, f)
    return out


@st.composite
def loops(draw):
    """C of order 1 to 4 with pairs on and near the axis, hands with and without a damper."""
    den = coefficients(draw(st.lists(PAIR | REAL, min_size=1, max_size=2)))
    num = coefficients(draw(st.lists(PAIR | REAL, max_size=2)))
    num = num if len(num) <= len(den) else np.ones(1)
    hands = [HAND, hc.Operator(0.25, 0.0, 6.0), hc.Operator(2.0, 0.0, 0.0)]
    num = num * abs(np.polyval(den, 10j) / np.polyval(num, 10j)) * 0.01
    return hc.theory.Loop(
        axis=draw(st.sampled_from("xy")),
        b=draw(st.sampled_from([0.0, 1e-12, 1.0, 90.0, 1e4])),
        operator=draw(st.sampled_from(hands)),
        compensator=hc.Compensator(tuple(num.tolist()), tuple(den.tolist())),
    )


# ---- continuous ----------------------------------------------------------------------------------


@examples(6)
@given(loop=loops(), K=st.floats(-3.0, 3.0).map(lambda x: 10.0**x))
def test_encirclements_and_verdicts_are_those_of_60_digits(loop, K):
    right, on = digits.closed(loop, K)
    verdict = hc.theory.coupled_stability(loop, K=K)
    assert bool(verdict) == (right + on == 0)
    margins = hc.theory.margins(loop, K=K)
    assert margins.stable == bool(verdict)
    if on:  # the curve passes through -1
        return
    for at in ("force", "compensator"):
        found = hc.theory.nyquist(loop, K=K, at=at)
        assert found.Z == right
    # the poles of the loop opened at the compensator; a parity that no conjugate pair changes
    A, B = digits.polynomials(loop)
    assert (found.P - digits.sides(A)[0]) % 2 == 0 and found.P <= digits.sides(A)[0]


@examples(6)
@given(loop=loops())
def test_limits_are_those_of_60_digits(loop):
    limit = hc.theory.gain_limit(loop)
    if 0.0 < limit < math.inf:
        for share in (1e-3, 0.5, 1.0 - 1e-9):  # rounding of K alone
            assert digits.closed(loop, share * limit) == (0, 0)
        right, on = digits.closed(loop, limit * (1.0 + 1e-9))
        assert right > 0
    elif limit == math.inf:
        assert all(digits.closed(loop, K) == (0, 0) for K in (1e-4, 1.0, 1e4))
    else:  # right of the axis at K = 0, or as soon as K leaves it
        A, _ = digits.polynomials(loop)
        right, on = digits.sides(A)
        assert right or sum(digits.closed(loop, 1e-12)) or sum(digits.closed(loop, 1e-20))


def test_a_pair_on_the_axis_that_every_gain_moves_right_has_the_limit_0():
    loop = hc.theory.Loop("x", 1.0, HAND, compensator=UNDAMPED)
    for kw in (dict(), dict(delay=1e-9), dict(delay=1e-3), dict(Ts=1e-3)):
        timed = dataclasses.replace(loop, **kw)
        assert hc.theory.gain_limit(timed) == 0.0
        verdict = hc.theory.coupled_stability(timed, K=0.5)
        assert not verdict and verdict.margin == 0.0
        found = hc.theory.nyquist(timed, K=0.5, at="compensator")
        assert found.Z == 2 and found.P == 0
    assert hc.theory.nyquist(loop, K=0.5).Z == 2 == digits.closed(loop, 0.5)[0]


def test_a_pair_on_the_axis_that_gains_damp_has_the_limit_of_the_next_crossing():
    """A notch beside each pole: the locus leaves to the left. The pair is left to rounding, too."""
    for w in (3.3, 35.0):
        den = np.convolve([1.0, 30.0], [1.0, 0.0, w * w])
        found = []
        for num in ([-1.0], [1.0]):
            loop = hc.theory.Loop(
                "x",
                20.0,
                HAND,
                compensator=hc.Compensator(tuple(np.multiply(num, 1e3)), tuple(den)),
            )
            limit = hc.theory.gain_limit(loop)
            found.append(limit)
            K = 0.5 * limit if limit else 1e-6
            assert (digits.closed(loop, K)[0] == 0) == (limit > 0.0)
            for kw in (dict(delay=1e-7), dict(Ts=1e-6)):
                near = hc.theory.gain_limit(dataclasses.replace(loop, **kw))
                # first order in the delay, at 1e-7 s times the fastest pole
                assert near == pytest.approx(limit, rel=1e-3)
        assert sorted(x > 0.0 for x in found) == [False, True]


@pytest.mark.parametrize("kw", [dict(), dict(delay=1e-3), dict(Ts=1e-3)])
def test_a_zero_on_the_axis_is_no_limit(kw):
    """A hand of mass and spring without damper in clay of b = 0."""
    for mass, spring in ((0.25, 6.0), (0.25, 100.0), (1.0, 6.0)):
        loop = hc.theory.Loop("y", 0.0, hc.Operator(mass, 0.0, spring), **kw)
        limit = hc.theory.gain_limit(loop)
        K = 1.0 if limit == math.inf else 0.5 * limit
        if not limit:
            continue
        gain = hc.theory.margins(loop, K=K).gain
        assert gain[0] == 0.0 and gain[1] == pytest.approx(limit / K, rel=1e-9)
        assert gain[1] == math.inf or gain[1] < 1e9
        if not kw:
            assert digits.closed(loop, K)[0] == 0
            for more in (1e2, 1e4):
                assert limit < math.inf or digits.closed(loop, more)[0] == 0


def test_slow_poles_are_counted():
    c = hc.Compensator.zpk([0.0], [-1e-6, -1e-6, -1e-6, -1e-12])
    loop = hc.theory.Loop("x", 1.0, HAND, compensator=c, K=1.0)
    assert digits.closed(loop, 1.0)[0] == 2
    for at in ("force", "compensator"):
        found = hc.theory.nyquist(loop, at=at)
        assert found.Z == 2 and np.all(np.isfinite(found.L))


@examples(12)
@given(factors=st.lists(PAIR | REAL, min_size=1, max_size=4))
def test_roots_on_each_side_are_counted_exactly(factors):
    c = coefficients(factors)
    assert exact_roots.roots_right(Polynomial(c[::-1])) == digits.sides(digits.numbers(*c))


@examples(10)
@given(x=st.lists(st.integers(1, 10**6), min_size=1, max_size=6, unique=True), gap=SIZE)
def test_real_roots_are_those_of_the_factors(x, gap):
    """Integers, and one 1e-12 beside the first: exact to the last digit of a float."""
    close = x[0] * (1.0 + 1e-12 * gap)
    p = exact_roots.rational([1])
    for root in (*x, close):
        p = p * exact_roots.rational([-root, 1])
    found = [float(r) for r in exact_roots.positive_roots(p * exact_roots.rational([gap, 1]))]
    assert found == sorted([*map(float, x), close])


# ---- sampled -------------------------------------------------------------------------------------


@examples(3)
@given(
    loop=loops(),
    Ts=st.sampled_from([1e-3, 4e-3]),
    share=st.sampled_from([0.0, 0.5, 1.0]),
    K=st.floats(-2.0, 2.0).map(lambda x: 10.0**x),
)
def test_sampled_encirclements_are_those_of_60_digits(loop, Ts, share, K):
    loop = dataclasses.replace(loop, Ts=Ts, delay=share * Ts, b=min(loop.b, 90.0))
    right, gap = digits.outside(loop, K)
    if (
        gap < 1e-11
    ):  # the map itself is rounded: 1e-16 of its norm, times the condition of its roots
        return
    assert hc.theory.nyquist(loop, K=K, at="compensator").Z == right
    assert bool(hc.theory.coupled_stability(loop, K=K)) == (right == 0)


@pytest.mark.parametrize("pole", [0.5, 3.0, 20.0])
@pytest.mark.parametrize("hand", [None, hc.Operator(0.25, 2.0, 0.0)])
@pytest.mark.parametrize("zeros,more", [((5.0,), (40.0,)), ((2.0, 9.0), (40.0, 70.0))])
def test_an_unstable_compensator_that_integrates_has_a_crossing_at_z_1(pole, hand, zeros, more):
    """Without spring: small K leave the unstable pole where it is, so the limit is 0."""
    c = hc.Compensator.zpk([-x for x in zeros], [pole, 0.0, *(-x for x in more)])
    loop = hc.theory.Loop("x", 50.0, hand, compensator=c)
    for kw in (dict(), dict(Ts=1e-3), dict(Ts=1e-3, delay=4e-4), dict(delay=1e-3)):
        timed = dataclasses.replace(loop, **kw)
        assert hc.theory.gain_limit(timed) == 0.0
    found = gain_crossings.gain_crossings(
        gain_crossings.loop_family(dataclasses.replace(loop, Ts=1e-3))
    )
    at_rest = [K for K, omega in found if omega == 0.0]
    exact = [x[0] for x in _crossings_at_rest(loop)]
    assert at_rest == pytest.approx(exact, rel=1e-9)  # a pole at z = 1 knows no sampling


def _crossings_at_rest(loop):
    """-A0/B0 with the common factor s removed."""
    A, B = digits.polynomials(loop)
    K = -A[-2] / B[-2]
    return [(float(K), 0.0)] if K > 0 else []


@pytest.mark.parametrize("kw", [dict(Ts=1e-3), dict(Ts=1e-3, delay=2.5e-3), dict(delay=1e-3)])
@pytest.mark.parametrize("K", [1e-2, 1e-3, 1e-6, 1e-12])
def test_margins_at_small_gains_are_those_of_continuous_time(kw, K):
    """|L| = 1 at K k/10, where neither a sample nor a delay is felt, far below the other poles."""
    loop = hc.theory.Loop("x", 50.0, HAND, K=K)
    exact, found = (hc.theory.margins(dataclasses.replace(loop, **x)) for x in (dict(), kw))
    w = exact.phase_omega
    assert w == pytest.approx(K * HAND.spring / 10.0, rel=0.02)
    assert found.phase == pytest.approx(exact.phase, abs=3.0 * 5e-3 * w + 1e-7)  # late by 3 ms
    assert found.delay == pytest.approx(exact.delay, rel=1e-4)


@pytest.mark.parametrize("delay", [0.0, 1e-3, 2.4e-3, 40e-3])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_forces_that_wait_are_eliminated_exactly(delay, order):
    c = [hc.Compensator((1e-3,), (1.0,)), hc.Compensator(), hc.Compensator((1, 5), (1, 40, 0, 0))]
    loop = hc.theory.Loop("x", 20.0, None, compensator=c[order], Ts=1e-3, delay=delay)
    family = gain_crossings.loop_family(loop)
    less, beta, gamma = linear_loop.sampled_differences(loop)
    omega = np.array([3.0, 70.0, 1500.0])
    z1 = np.expm1(1j * omega * 1e-3)
    whole = np.linalg.solve(z1[:, None, None] * np.eye(len(less)) - less, beta)[:, :, 0]
    # the condition of z = 1, which the whole map has and the family has not
    np.testing.assert_allclose(family.h(omega), whole @ gamma[0], rtol=1e-8)


# ---- late ----------------------------------------------------------------------------------------


def turned(p, q, delay):
    """Roots right of the axis of p + q exp(-s delay), deg p > deg q: the phase on a dense axis."""
    high = 1.0
    while Polynomial(np.abs(q.coef))(high) > 1e-3 * abs(p(1j * high)):
        high *= 1.3
    n = int(40.0 * delay * high) + 20_000
    w = np.unique(
        np.concatenate(([0.0], np.geomspace(1e-6, high, 20_000), np.linspace(0, high, n)))
    )
    F = p(1j * w) + q(1j * w) * np.exp(-1j * w * delay)
    steps = np.angle(F[1:] / F[:-1])
    assert np.abs(steps).max() < 2.5
    left = np.angle(F[-1] / (p.coef[-1] * 1j ** p.degree()))
    return round(p.degree() / 2 - (steps.sum() - left) / np.pi)


@pytest.mark.parametrize("factor", [0.5, 3.0, 100.0, 2e3])
@pytest.mark.parametrize("delay", [1e-3, 0.02, 0.2])
@pytest.mark.parametrize(
    "c",
    [hc.Compensator(), hc.Compensator((1, 3), (1, 20, 5, 0)), hc.Compensator((1,), (1, 0, 900, 0))],
)
def test_late_loops_far_above_the_limit_are_counted(factor, delay, c):
    loop = hc.theory.Loop("y", 30.0, HAND, compensator=c, delay=delay)
    limit = hc.theory.gain_limit(loop)
    K = factor * (limit if 0.0 < limit < math.inf else 10.0)
    physical, motors, driven = linear_loop.delayed_polynomials(loop)
    late = motors + K * driven
    found = hc.theory.nyquist(loop, K=K, at="compensator")
    assert found.Z == found.N + found.P == turned(physical, late, delay)


@pytest.mark.parametrize("K,delay", [(0.5, 1.0), (2.0, 0.1), (7.0, 3.0), (1.2, 10.0), (1e5, 1e-3)])
def test_roots_of_a_late_integrator_in_closed_form(K, delay):
    """s + K exp(-s T): a pair for each w = pi/2 + 2 pi n below K T."""
    n = late_roots.roots_right(Polynomial([0.0, 1.0]), Polynomial([K]), delay)
    assert n == 2 * (1 + math.floor((K * delay - math.pi / 2) / (2 * math.pi)))


# ---- servos of any size --------------------------------------------------------------------------


@pytest.mark.parametrize("damping", [0.008, 1e-6])
@pytest.mark.parametrize("stiffness", [1e-10, 1e-3, 900.0])
@pytest.mark.parametrize("Ts", [1e-6, 1e-3])
def test_slow_servos_have_a_limit(damping, stiffness, Ts):
    """Where the map is 1 but for 1e-20, sampling is not felt: the limit of continuous time."""
    printed = hc.theory.Loop("x").servo
    slow = dict(damping=damping, stiffness=stiffness)
    servo = hc.Servo(
        dataclasses.replace(printed.G, **slow), dataclasses.replace(printed.S, damping=41.1)
    )
    loop = hc.theory.Loop("x", 90.0, HAND, servo=servo)
    exact = hc.theory.gain_limit(loop)
    found = hc.theory.gain_limit(dataclasses.replace(loop, Ts=Ts, render="physical"))
    assert found == pytest.approx(exact, rel=40.0 * Ts + 1e-7)  # first order in the sample


def test_a_singular_map_has_eigenvalues():
    a = np.diag([1.0, 0.5, 0.0, 0.0])
    a[2, 3] = 1e-9
    np.testing.assert_allclose(np.sort(np.abs(gain_crossings.eigenvalues(a))), [0, 0, 0.5, 1])


def test_long_delays_are_searched_in_bounded_work():
    """A delay of 100 samples, and one of 1e6 turns of the fastest pole."""
    sampled = hc.theory.Loop("x", 0.5, HAND, Ts=1e-3, delay=0.1)
    assert hc.theory.gain_limit(sampled) == pytest.approx(
        hc.theory.gain_limit(dataclasses.replace(sampled, Ts=None, delay=0.1005)), rel=1e-3
    )  # a hold is half a sample late
    c = hc.Compensator((1.0,), (1.0, 30.0))
    late = hc.theory.Loop("x", 3e4, HAND, compensator=c, delay=1.0)
    assert hc.theory.gain_limit(late) == 0.0 and hc.theory.nyquist(late, K=1.0, at="compensator").Z


# ---- boxes of hands ------------------------------------------------------------------------------


@pytest.mark.parametrize("b,wide", [(90.0, 0.0), (8e4, 0.0), (1e6, 0.0), (1e8, 0.0), (1e6, 1e-6)])
def test_a_box_of_one_hand_has_its_limit_in_stiff_clay(b, wide):
    """And a box as small as a millionth has it to a millionth."""
    box = hc.theory.Box((0.25, 0.25), (2.0, 2.0 * (1.0 + wide)), (6.0, 6.0 * (1.0 + wide)))
    found = hc.theory.worst_case("x", 1.0, b, box).limit
    assert found == pytest.approx(hc.theory.gain_limit("x", b, HAND), rel=1e-12 + 2.0 * wide)
