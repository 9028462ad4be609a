"""Loops of any parts: servo, compensator of order 0 to 4, hand, sampling, delay, shaping.

Beside python-control, a discretisation of the whole plant by one matrix exponential, and direct
searches over frequency.
"""

import dataclasses
import math

import control
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.signal import tf2ss

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.constants import SecondOrder
from hapticclay.theory import gain_crossings, linear_loop, roots, stability_margins
from tests.hunt import examples
from tests.oracles import parts

SIZE = st.floats(1.0, 80.0)  # of a pole or zero [rad/s]
PAIR = st.tuples(st.floats(0.05, 1.0), SIZE).map(lambda x: [1.0, 2.0 * x[0] * x[1], x[1] ** 2])
REAL = SIZE.map(lambda x: [1.0, x])


def product(factors):
    out = np.ones(1)
    for f in factors:
        out = np.convolve(out, f)
    return out


INTEGRATORS = st.sampled_from([1, 1, 1, 0, 2])


@st.composite
def compensators(draw):
    """Real and complex poles and zeros on the left, 0 to 2 integrators, gain near 1 at 10 rad/s."""
    order = draw(st.integers(0, 4))
    n = min(draw(INTEGRATORS), order)
    den = []
    while (left := order - n - sum(len(f) - 1 for f in den)) > 0:
        den.append(draw(PAIR if left > 1 and draw(st.booleans()) else REAL))
    den = product(den + [[1.0, 0.0]] * n)
    zeros = draw(st.integers(0, order))
    num = []
    while (left := zeros - sum(len(f) - 1 for f in num)) > 0:
        num.append(draw(PAIR if left > 1 and draw(st.booleans()) else REAL))
    num = product(num)
    num = num * abs(np.polyval(den, 10j) / np.polyval(num, 10j)) * 10.0 ** draw(st.floats(-3, -1))
    return hc.Compensator(tuple(num), tuple(den))


def block(gain):
    return st.builds(
        lambda g, z, w: SecondOrder(g, 2.0 * z * w, w * w),
        gain,
        st.floats(0.3, 1.2),
        st.floats(15.0, 60.0),
    )


SERVOS = st.builds(
    lambda G, S, follow: hc.Servo(dataclasses.replace(G, gain=follow * G.stiffness), S),
    block(st.just(1.0)),
    block(st.floats(0.1, 2.0)),
    st.floats(0.5, 2.0),
)
HANDS = st.none() | st.builds(
    hc.Operator,
    st.sampled_from([0.0, 0.25, 2.0]),
    st.floats(0.1, 20.0),
    st.sampled_from([0.0, 6.0, 300.0]),
)
LOOPS = st.builds(
    hc.theory.Loop,
    axis=st.sampled_from("xy"),
    b=st.floats(1.0, 500.0),
    operator=HANDS,
    servo=SERVOS,
    compensator=compensators(),
)


def transfer_functions(loop):
    """C/K, G, Sh and Te + Th."""
    c, g, s, th = loop.compensator, loop.servo.G, loop.servo.S, loop.operator
    C = control.tf(list(c.num), list(c.den))
    G = control.tf([g.gain], [1.0, g.damping, g.stiffness])
    S = control.tf([s.gain], [1.0, s.damping, s.stiffness])
    m, d, k = (th.mass, th.damper, th.spring) if th else (0.0, 0.0, 0.0)
    return C, G, S, control.tf([m, d + loop.b, k], [1.0])


def matrix(loop, K):
    """A of the loop, from SciPy's realisation of C."""
    A = parts.system(loop.servo, loop.compensator, K, loop.operator, loop.b)[0]
    return A[:-1, :-1]


def rightmost(a, loop):
    """Real part of the rightmost eigenvalue but those at 0 that move the handle alone."""
    z = np.linalg.eigvals(a)
    return np.delete(z, np.argsort(np.abs(z))[: unseen(loop)]).real.max()


def unseen(loop):
    """Poles at 0 for every K: integrators of C that no spring feels."""
    n = sum(1 for _ in np.trim_zeros(loop.compensator.den, "f")) - len(
        np.trim_zeros(loop.compensator.den)
    )
    return min(n, 0 if loop.operator and loop.operator.spring else 1)


# ---- continuous ----------------------------------------------------------------------------------


@examples(25)
@given(loop=LOOPS)
def test_gain_limit_is_the_gain_margin_of_python_control(loop):
    C, G, S, T = transfer_functions(loop)
    found = hc.theory.gain_limit(loop)
    if found in (0.0, math.inf):
        K = 1e-3 if found == 0.0 else 1e3
        assert (rightmost(matrix(loop, K), loop) > 0.0) == (found == 0.0)
        return
    n, d = stability_margins.open_loop(loop, K=1.0, at="compensator")
    L = control.tf(n.coef[::-1], d.coef[::-1])
    s = 3.7j  # the polynomials are those of the blocks
    assert L(s) == pytest.approx((G * C * T / (1 + S * T))(s), rel=1e-9)
    every = [m for m in control.stability_margins(L, returnall=True)[0] if m > 0.0]
    assert min(abs(m / found - 1.0) for m in every) < 1e-6  # roots of order 16, not balanced
    low, high = (rightmost(matrix(loop, x * found), loop) for x in (1 - 1e-6, 1 + 1e-6))
    assert low < high and low < 1e-7 and high > -1e-7  # eps of the largest pole, 1e2, times 1e4
    # the crossing itself, by another route: eigenvalues of a state space
    try:
        root = brentq(lambda K: rightmost(matrix(loop, K), loop), 0.999 * found, 1.001 * found)
    except ValueError:  # the pole turns back, or another one is right of it
        return
    assert found == pytest.approx(root, rel=1e-8)  # brentq's 2e-12 and the eigenvalues' 1e-13 * 1e4


@examples(25)
@given(loop=LOOPS, K=st.floats(0.01, 20.0))
def test_poles_and_state_space_are_those_of_another_realisation(loop, K):
    loop = dataclasses.replace(loop, K=K)
    A, B = linear_loop.state_space(loop)
    poly = np.poly(np.linalg.eigvals(A))
    size = np.abs(np.linalg.eigvals(A)).max() ** np.arange(len(poly))
    mine, other = matrix(loop, K), np.poly(np.linalg.eigvals(matrix(loop, K)))
    assert mine.shape == A.shape
    assert np.all(np.abs(poly - other) < 1e-9 * size)
    characteristic = linear_loop.characteristic(loop).coef[::-1]
    assert np.all(np.abs(characteristic / characteristic[0] - poly) < 1e-9 * size)
    assert len(hc.theory.closed_loop_poles(loop)) == len(A)
    # a step of the hand's force moves the handle alike
    t = 0.05
    step = np.linalg.solve(A + 1e-3 * np.eye(len(A)), expm(t * A) @ B[:, 0] - B[:, 0])
    a, b = parts.system(loop.servo, loop.compensator, K, loop.operator, loop.b)[:2]
    a, b = a[:-1, :-1], b[:-1]
    same = np.linalg.solve(a + 1e-3 * np.eye(len(a)), expm(t * a) @ b - b)
    assert step[:2] == pytest.approx(same[:2], rel=1e-6, abs=1e-9)


@examples(25)
@given(loop=LOOPS, K=st.floats(0.01, 20.0), at=st.sampled_from(stability_margins.BREAKS))
def test_margins_are_those_of_python_control(loop, K, at):
    n, d = stability_margins.open_loop(loop, K=K, at=at)
    m = hc.theory.margins(loop, K=K, at=at)
    z = roots.nonzero_roots(n + d)
    assume(np.min(np.abs(z.real) / np.abs(z)) > 1e-6)
    assert m.stable == (rightmost(matrix(loop, K), loop) < 0.0)
    if not m.stable:
        return
    assume(m.phase > 1e-3)
    L = control.tf(n.coef[::-1], d.coef[::-1])
    gains, phases, _, _, crossovers, _ = control.stability_margins(L, returnall=True)
    above = [x for x in gains if x > 1.0 + 1e-9 and math.isfinite(x)]
    # polynomials of order 16 on both sides; python-control leaves out what L does at infinity
    if m.gain_omega[1] < math.inf:
        assert m.gain[1] == pytest.approx(min(above, default=math.inf), rel=1e-5)
    lag = np.deg2rad(np.array(phases)) % (2.0 * np.pi)
    turn = np.min(np.minimum(lag, 2.0 * np.pi - lag), initial=math.inf)
    assert m.phase == pytest.approx(turn, abs=1e-5)


@examples(30)
@given(
    loop=LOOPS,
    K=st.floats(0.01, 20.0),
    at=st.sampled_from(stability_margins.BREAKS),
    right=st.sampled_from([(), (3.0,), (2.0, 30.0)]),
)
def test_nyquist_counts_the_poles_of_loops_with_unstable_compensators(loop, K, at, right):
    c = loop.compensator
    for pole in right[: max(0, 4 - c.order)]:
        c = hc.Compensator(tuple(np.array(c.num) * pole), tuple(np.convolve(c.den, [1.0, -pole])))
    loop = dataclasses.replace(loop, compensator=c, K=K)
    z = roots.nonzero_roots(linear_loop.characteristic(loop))
    assume(np.min(np.abs(z.real) / np.abs(z)) > 1e-5)  # the curve then passes -1 as near
    found = hc.theory.nyquist(loop, at=at)
    assert found.Z == found.N + found.P == int(np.sum(z.real > 0.0))
    if at == "force":
        assert found.P == int(np.sum(c.poles.real > 0.0))


def test_nyquist_passes_a_resonance_of_the_compensator_on_its_right():
    """Poles of C on the axis: (s^2 + 400) undamped."""
    for K in (0.1, 1.0, 5.0):
        for zero in (5.0, -5.0):
            c = hc.Compensator((1.0, zero), (1.0, 0.0, 400.0))
            loop = hc.theory.Loop("x", 90.0, hc.Operator(), compensator=c, K=K)
            z = roots.nonzero_roots(linear_loop.characteristic(loop))
            assert hc.theory.nyquist(loop).Z == int(np.sum(z.real > 0.0))


def test_a_compensator_that_is_unstable_alone_has_no_limit_from_zero():
    c = hc.Compensator((1.0, 2.0), (1.0, -1.0, 0.0))
    loop = hc.theory.Loop("x", 90.0, hc.Operator(), compensator=c)
    # above a gain that moves the pole to the left there is a window of stable ones
    K = np.geomspace(1e-4, 1.0, 401)
    window = [rightmost(matrix(loop, x), loop) < 0.0 for x in K]
    assert not window[0] and any(window)
    first = int(np.argmax(window))
    tried = [*range(0, first - 1, 20), first - 2, *range(first - 1, first + 2)]
    for kw in (dict(), dict(Ts=1e-3), dict(delay=1e-3), dict(Ts=1e-3, delay=2e-3)):
        timed = dataclasses.replace(loop, **kw)
        assert hc.theory.gain_limit(timed) == 0.0
        stable = [gain_crossings.is_stable(dataclasses.replace(timed, K=K[i])) for i in tried]
        assert not any(stable[:-3]) and any(stable[-3:])  # a slow pole: sampling is far


def test_a_pole_that_leaves_along_the_real_axis_is_seen():
    """A compensator that pulls the handle on: the pole passes s = 0, z = 1, at no frequency."""
    c = hc.Compensator((-1.0,), (1.0, 5.0))
    th = hc.Operator(0.25, 2.0, 300.0)
    # 1 + (Sh + K C(0)) k = 0 at s = 0
    K = (1.0 / 300.0 + 0.7919 / 432.0) * 5.0
    for kw in (dict(), dict(Ts=1e-3), dict(delay=1e-3), dict(Ts=1e-3, delay=2.5e-3)):
        loop = hc.theory.Loop("x", 20.0, th, compensator=c, **kw)
        assert hc.theory.gain_limit(loop) == pytest.approx(K, rel=1e-9)
        assert gain_crossings.critical_gain(loop)[1] == 0.0


def test_integrating_the_wrong_way_is_unstable_at_any_gain():
    c = hc.Compensator((-1.0,), (1.0, 10.0, 0.0))
    for kw in (dict(), dict(Ts=1e-3), dict(delay=1e-3)):
        assert hc.theory.gain_limit("x", 90.0, hc.Operator(), compensator=c, **kw) == 0.0


# ---- late ----------------------------------------------------------------------------------------


def late_crossing(loop):
    """Gains at which a pole is on the axis, from a dense direct search over frequency."""
    C, G, S, _ = transfer_functions(loop)
    s_, th = loop.servo.S, loop.operator
    m, d, k = (th.mass, th.damper, th.spring) if th else (0.0, 0.0, 0.0)
    W = s_.gain if loop.mobility is None else loop.mobility

    def gain(w):
        """Complex K that puts a pole at j w: from the handle's equation of motion, in place p."""
        s, late = 1j * w, np.exp(-1j * w * loop.delay)
        Th, be = m * s * s + d * s + k, loop.b * s
        f = -(Th + be)  # net force over place
        free = s * s + W * Th + (W * be if loop.render == "physical" else 0.0)
        held = s_.damping * s + s_.stiffness - (s_.gain - W) * f
        held = held + (W * be if loop.render == "held" else 0.0)
        lead = (s * s + s_.damping * s + s_.stiffness) * G(s) * C(s) * f
        return (free + late * held) / (late * lead)

    w = np.geomspace(0.05, 4000.0, 400_000)
    K = gain(w)
    out = []
    for i in np.flatnonzero((K.imag[:-1] * K.imag[1:] < 0.0) & (K.real[:-1] > 0.0)):
        at = brentq(lambda x: gain(x).imag, w[i], w[i + 1], xtol=1e-14)
        out.append(float(gain(at).real))
    return sorted(out)


@examples(12)
@given(
    loop=LOOPS,
    delay=st.floats(2e-4, 8e-3),
    render=st.sampled_from(["held", "physical"]),
    bare=st.none() | st.floats(0.3, 3.0),
)
def test_late_limits_are_those_of_a_direct_search(loop, delay, render, bare):
    mobility = bare and bare * loop.servo.S.gain
    loop = dataclasses.replace(loop, delay=delay, render=render, mobility=mobility)
    found, omega = gain_crossings.critical_gain(loop)
    if found == 0.0:  # servo and clay alone do not bear the delay, or two integrators
        assert not gain_crossings.is_stable(dataclasses.replace(loop, K=1e-6))
    elif found < math.inf and 0.05 < omega < 4000.0:
        assert min(abs(K / found - 1.0) for K in late_crossing(loop)) < 1e-8


def test_a_force_that_goes_straight_round_has_a_limit_at_infinite_frequency():
    """C of order (1, 1) and a mass in the hand: late by any time at all, K m g d/(1 + W m) < 1."""
    c, th = hc.Compensator((1.0, 3.0), (1.0, 30.0)), hc.Operator(2.0, 20.0, 6.0)
    for delay in (1e-5, 1e-3):
        loop = hc.theory.Loop("x", 20.0, th, compensator=c, delay=delay)
        bound = (1.0 + 0.7919 * 2.0) / (910.19 * 2.0)
        found, omega = gain_crossings.critical_gain(loop)
        assert found <= bound * (1.0 + 1e-12)
        assert not gain_crossings.is_stable(dataclasses.replace(loop, K=1.001 * bound))
        assert gain_crossings.is_stable(dataclasses.replace(loop, K=0.9 * found))


# ---- sampled -------------------------------------------------------------------------------------


def period(loop, K):
    """One period of the sampled loop: events walked through, everything by one exponential each.

    The states: place, rate, C and reference model, torques that wait (the oldest last).
    """
    c, g, s, th, Ts = loop.compensator, loop.servo.G, loop.servo.S, loop.operator, loop.Ts
    m, d, k = (th.mass, th.damper, th.spring) if th else (0.0, 0.0, 0.0)
    if c.order:
        a, b, o, D = tf2ss(np.atleast_1d(c.num), np.atleast_1d(c.den))
        b, o, D = K * b[:, 0], o[0], K * float(D[0, 0])
    else:
        a, b, o, D = np.zeros((0, 0)), np.zeros(0), np.zeros(0), K * c.num[0] / c.den[0]
    n = len(b)
    W = s.gain if loop.mobility is None else loop.mobility
    mass, physical = 1.0 / W + m, loop.b if loop.render == "physical" else 0.0
    waits = int(loop.delay / Ts + 1e-9) + 1
    changes = loop.delay - (waits - 1) * Ts
    plant = np.array([[0, 1, 0], [-k / mass, -(d + physical) / mass, 1 / mass], [0, 0, 0]])
    before, after = expm(changes * plant), expm((Ts - changes) * plant)
    M = np.zeros((n + 3, n + 3))  # C, y, y' and the held force
    M[:n, :n], M[:n, -1], M[n, n + 1] = a, b, 1.0
    M[n + 1, :n], M[n + 1, n : n + 2], M[n + 1, -1] = (
        g.gain * o,
        (-g.stiffness, -g.damping),
        g.gain * D,
    )
    held = expm(Ts * M)

    def walk(x):
        p, v, z, y, yd, queue = x[0], x[1], x[2 : 2 + n], x[2 + n], x[3 + n], list(x[4 + n :])
        acceleration = (queue[-1] - k * p - (d + physical) * v) / mass
        f = -k * p - d * v - m * acceleration - loop.b * v
        y2 = g.gain * (o @ z + D * f) - g.stiffness * y - g.damping * yd
        wanted = y2 + s.damping * (yd - v) + s.stiffness * (y - p) + s.gain * f
        # the motors' force for that acceleration of the bare handle, under the force measured
        u = wanted / W - f - (loop.b * v if loop.render == "held" else 0.0)
        state = before @ [p, v, queue[-1]]
        queue = [u, *queue]
        state = after @ [state[0], state[1], queue[-2]]
        return [*state[:2], *(held @ [*z, y, yd, f])[:-1], *queue[:-1]]

    size = n + 4 + waits
    return np.array([walk(e) for e in np.eye(size)]).T


def radius(loop, K):
    z = np.linalg.eigvals(period(loop, K))
    return np.abs(np.delete(z, np.argsort(np.abs(z - 1.0))[: unseen(loop)])).max()


@examples(15)
@given(
    loop=LOOPS,
    Ts=st.floats(5e-4, 5e-3),
    share=st.sampled_from([0.0, 0.0, 0.4, 1.0, 2.3]),
    render=st.sampled_from(["held", "physical"]),
    bare=st.none() | st.floats(0.3, 3.0),
)
def test_sampled_limits_are_those_of_the_period_map(loop, Ts, share, render, bare):
    mobility = bare and bare * loop.servo.S.gain
    loop = dataclasses.replace(loop, Ts=Ts, delay=share * Ts, render=render, mobility=mobility)
    found = hc.theory.gain_limit(loop)
    if found == 0.0:  # two eigenvalues that leave z = 1 together are known to the root of eps
        assert radius(loop, 1e-4) > 1.0 - 1e-7
        return
    assume(found < math.inf)
    assert all(radius(loop, K) < 1.0 + 1e-7 for K in found * np.array([0.01, 0.3, 0.9, 0.999]))
    assert radius(loop, 1.001 * found) > 1.0
    root = brentq(lambda K: radius(loop, K) - 1.0, 0.999 * found, 1.001 * found, xtol=1e-14)
    # the eigenvalues' 1e-13 over the rate of the radius with K, at least 1e-5 here
    assert found == pytest.approx(root, rel=1e-8)


@examples(12)
@given(
    loop=LOOPS,
    Ts=st.floats(5e-4, 5e-3),
    share=st.sampled_from([0.0, 0.4, 2.3]),
    part=st.floats(0.1, 0.8),
)
def test_sampled_margins_put_a_pole_on_the_circle(loop, Ts, share, part):
    """A factor on the gain, a turn of the phase, a disk: each put into the period map."""
    loop = dataclasses.replace(loop, Ts=Ts, delay=share * Ts)
    limit = hc.theory.gain_limit(loop)
    assume(0.0 < limit < math.inf)
    K = part * limit
    m = hc.theory.margins(loop, K=K)
    assert m.stable and m.gain[1] == pytest.approx(1.0 / part, rel=1e-9)
    first, second = period(loop, 1.0), period(loop, 2.0)
    family = gain_crossings.loop_family(loop)

    def nearest(factor, omega):
        """Distance of the pole nearest to exp(j omega Ts) from there."""
        z = np.linalg.eigvals(first + (factor * K - 1.0) * (second - first))
        return np.abs(z - np.exp(1j * omega * Ts)).min()

    if m.phase < math.inf:
        L = -K * family.h(np.array([m.phase_omega]))[0]
        assert abs(L) == pytest.approx(1.0, rel=1e-9)
        assert nearest(-1.0 / L, m.phase_omega) < 1e-6
        assert m.phase == pytest.approx(abs(np.angle(-L)), abs=1e-9)
    L = -K * family.h(np.array([m.disk_omega]))[0]
    d = 2.0 * (-1.0 / L - 1.0) / (-1.0 / L + 1.0)  # the factor of the disk that reaches -1
    assert abs(d) == pytest.approx(m.disk, rel=1e-9)
    dense = np.geomspace(family.grid[0], math.pi / Ts, 20_001)
    L = -K * family.h(dense)
    assert m.disk <= 2.0 / np.abs((1.0 - L) / (1.0 + L)).max() * (1.0 + 1e-9)


@examples(12)
@given(
    loop=LOOPS,
    K=st.floats(0.01, 20.0),
    Ts=st.floats(5e-4, 5e-3),
    share=st.sampled_from([0.0, 0.4, 2.3]),
    pole=st.sampled_from([0.0, 3.0]),
)
def test_nyquist_of_sampled_loops_counts_the_poles_outside_the_circle(loop, K, Ts, share, pole):
    c = loop.compensator
    if pole and c.order < 4:
        c = hc.Compensator(tuple(np.array(c.num) * pole), tuple(np.convolve(c.den, [1.0, -pole])))
    loop = dataclasses.replace(loop, compensator=c, K=K, Ts=Ts, delay=share * Ts)
    z = np.linalg.eigvals(period(loop, K))
    z = np.delete(z, np.argsort(np.abs(z - 1.0))[: unseen(loop)])
    assume(np.min(np.abs(np.abs(z) - 1.0)) > 1e-6)
    found = hc.theory.nyquist(loop, at="compensator")
    assert found.Z == found.N + found.P == int(np.sum(np.abs(z) > 1.0))


@pytest.mark.parametrize("th", [None, hc.Operator(), hc.Operator(2.0, 20.0, 6.0)])
@pytest.mark.parametrize(
    "c",
    [
        hc.Compensator(),
        hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0)),
        hc.Compensator((3.0, 2.0), (1.0, -2.0, 0.0)),
        hc.Compensator((1.0, 5.0), (1.0, 40.0, 0.0, 0.0)),
        hc.Compensator((1e-4, 1.0), (1.0, 30.0)),
    ],
)
def test_nyquist_of_late_loops_counts_as_fast_sampling_does(c, th):
    """Samples of 20 us stand for none, unless an acceleration goes straight round."""
    T = 2e-3
    loop = hc.theory.Loop("x", 60.0, th, compensator=c, delay=T)
    most = gain_crossings.loop_family(loop).most
    if most < math.inf:
        assert hc.theory.nyquist(loop, K=0.5 * most, at="compensator").P == 0
        with pytest.raises(ParameterError):
            hc.theory.nyquist(loop, K=most, at="compensator")
        return
    for K in (0.3, 3.0, 10.0):
        found = hc.theory.nyquist(loop, K=K, at="compensator")
        fine = dataclasses.replace(loop, delay=0.0, Ts=2e-5)
        fine = dataclasses.replace(fine, delay=T - 1e-5)  # a hold is half a sample late
        z = np.linalg.eigvals(period(fine, K))
        z = np.delete(z, np.argsort(np.abs(z - 1.0))[: unseen(loop)])
        assert found.Z == int(np.sum(np.abs(z) > 1.0 + 1e-9))


@pytest.mark.parametrize("at", ["x", "y"])
def test_margins_tend_to_those_of_continuous_time(at):
    """At first order in the sample, or the delay."""
    loop = hc.theory.Loop(at, 90.0, hc.Operator(), K=0.4)
    exact = hc.theory.margins(loop)
    for kw in (dict(Ts=1e-4), dict(delay=1e-4), dict(Ts=1e-4, delay=1.5e-4)):
        late = hc.theory.margins(dataclasses.replace(loop, **kw))
        for field in ("phase", "delay", "disk", "phase_omega"):
            assert getattr(late, field) == pytest.approx(getattr(exact, field), rel=0.02)
        assert late.gain[1] == pytest.approx(exact.gain[1], rel=0.02)
    assert not hc.theory.margins(dataclasses.replace(loop, K=40.0, Ts=1e-3)).stable


@pytest.mark.parametrize("order", range(5))
@pytest.mark.parametrize("delay", [0.0, 7e-4, 2e-3])
def test_sampled_limits_of_each_order_tend_to_the_continuous_ones(order, delay):
    """At first order in the sample, the delay kept."""
    num = (1.0, 30.0) if order else (1.0,)
    den = tuple(np.poly([0.0, -40.0, -60.0, -90.0][:order])) if order else (1.0,)
    c = hc.Compensator(tuple(x * 1e2 ** max(order - 2, 0) for x in num), den)
    loop = hc.theory.Loop("x", 20.0, hc.Operator(0.0, 2.0, 6.0), compensator=c)
    exact = (
        hc.theory.gain_limit(dataclasses.replace(loop, delay=delay))
        if delay
        else hc.theory.gain_limit(loop)
    )
    if exact == math.inf:
        pytest.skip("no limit in continuous time")
    gaps = [
        abs(hc.theory.gain_limit(dataclasses.replace(loop, Ts=Ts, delay=delay)) / exact - 1.0)
        for Ts in (1e-4, 5e-5)
    ]
    assert gaps[1] < 0.1 and gaps[0] / gaps[1] == pytest.approx(2.0, rel=0.15)


# ---- the loop of a scenario ----------------------------------------------------------------------


def test_the_loop_of_a_scenario_is_the_one_spelled_out():
    lead = hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))
    servo = hc.Servo(SecondOrder(800.0, 40.0, 900.0), SecondOrder(0.5, 40.0, 400.0))
    th = hc.Operator()
    cut = dataclasses.replace(
        hc.constant_cut(control="sampled"),
        arm=hc.Arm(0.3, 0.4, 0.2, 0.5),
        servo=(servo, hc.theory.Loop("y").servo),
        compensator=(lead, hc.Compensator()),
        operator=(None, th),
        gain=(0.7, 0.3),
        hardware=hc.Hardware(delay=5e-4),
        render="held",
        origin=(0.3, 0.3),
        length=None,
    )
    wx, wy = cut.arm.nominal_mobility
    timing = dict(Ts=cut.dt, delay=5e-4)
    bare = dataclasses.replace(servo, S=dataclasses.replace(servo.S, gain=wx))
    spelled = hc.theory.Loop("x", 50.0, None, bare, lead, 0.7, **timing)
    assert hc.theory.Loop.of(cut, "x", 50.0) == spelled
    shaped = hc.theory.Loop.of(dataclasses.replace(cut, inertia_shaping=True), "x", 50.0)
    assert shaped == dataclasses.replace(spelled, servo=servo, mobility=wx)
    y = hc.theory.Loop.of(cut, "y", 50.0)
    assert (y.operator, y.compensator, y.K, y.servo.S.gain) == (th, hc.Compensator(), 0.3, wy)
    printed = hc.theory.Loop.of(hc.constant_cut(), "x")
    assert printed == hc.theory.Loop("x", 90.0, K=1.0)
    assert hc.theory.gain_limit(printed) == hc.theory.gain_limit("x", 90.0)


def test_the_clay_of_a_scenario_is_the_one_with_the_least_limit():
    for axis in "xy":
        scenario = hc.variable_cut()
        values = getattr(scenario.clay, axis).values
        least = min(values, key=lambda b: hc.theory.gain_limit(axis, b))
        assert hc.theory.Loop.of(scenario, axis).b == least
    assert hc.theory.Loop.of(hc.free(), "x").b == 0.0
    grid = hc.Grid((0.0,), (0.0, 0.1), ((5.0, 70.0, 20.0), (0.0, 5.0, 400.0)))
    fine = hc.Grid(tuple(np.arange(99) * 1e-3), (), tuple((x,) for x in np.linspace(0, 990, 100)))
    for clay in (hc.Clay(grid, fine), hc.Clay(grid, fine, 0.3)):
        cut = dataclasses.replace(hc.constant_cut(), clay=clay)
        values = np.append(grid.damping, fine.damping if clay.angle else []).ravel()
        found = hc.theory.gain_limit(hc.theory.Loop.of(cut, "y" if clay.angle else "x"))
        limits = [hc.theory.gain_limit("y" if clay.angle else "x", b) for b in values]
        assert found == pytest.approx(min(limits), rel=5e-3 if clay.angle else 1e-12)


@pytest.mark.parametrize(
    "ask",
    [
        lambda *a, **k: hc.theory.margins(*a, **k).phase,
        lambda *a, **k: hc.theory.nyquist(*a, **k).Z,
        lambda *a, **k: hc.theory.passivity(*a, **k).margin,
        lambda *a, **k: hc.theory.coupled_stability(*a, **k).margin,
        lambda *a, **k: hc.theory.small_gain(*a, **k).margin,
        lambda *a, **k: hc.theory.transparency_error(*a, **k),
        lambda *a, **k: hc.theory.closed_loop_poles(*a, **k).tolist(),
    ],
)
def test_a_loop_and_its_parts_are_asked_alike(ask):
    c = hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))
    loop = hc.theory.Loop("y", 90.0, compensator=c, K=0.2)
    parts_ = dict(compensator=c)
    assert ask(loop) == ask("y", 0.2, 90.0, **parts_) == ask(axis="y", K=0.2, b=90.0, **parts_)
    assert ask(dataclasses.replace(loop, K=None), K=0.2) == ask(loop)
    assert ask(loop, K=0.1) == ask("y", 0.1, 90.0, **parts_)


def test_what_follows_a_loop_is_the_analysis_own():
    loop = hc.theory.Loop("x", 90.0, K=1.0)
    omega = np.array([1.0, 10.0])
    assert np.array_equal(
        hc.theory.transparency(loop, omega), hc.theory.transparency("x", 1.0, 90.0, omega)
    )
    box = hc.theory.Box((0.0, 1.0), (1.0, 4.0), (0.0, 50.0))
    assert hc.theory.worst_case(loop, box).limit == hc.theory.worst_case("x", 1.0, 90.0, box).limit
    for wrong in (
        lambda: hc.theory.gain_limit(loop, 90.0),
        lambda: hc.theory.gain_limit(),
        lambda: hc.theory.margins("x", 1.0),
        lambda: hc.theory.margins("x", 1.0, 90.0, K=1.0),
        lambda: hc.theory.margins("x", 1.0, 90.0, gain=2.0),
    ):
        with pytest.raises(TypeError):
            wrong()


def test_systems_of_other_packages_are_compensators():
    s = control.tf("s")
    assert hc.theory.gain_limit("x", 90.0, compensator=1 / (s**2 + 10 * s)) == hc.theory.gain_limit(
        "x", 90.0
    )


@pytest.mark.parametrize("operator", (None, hc.Operator()))
def test_a_gain_without_states_has_the_poles_of_python_control(operator):
    """Poles to 1e-9, what roots of polynomials keep."""
    gain = control.ss([], [], [], [[2e-3]])
    loop = hc.theory.Loop("x", 90.0, operator, compensator=gain, K=1.5)
    C, G, S, T = transfer_functions(loop)
    s = 3.7j
    assert C(s) == pytest.approx(gain(s), rel=1e-15)
    E = 1.5 * C * G + S
    closed = np.polyadd(np.polymul(E.num[0][0], T.num[0][0]), E.den[0][0])
    found = hc.theory.closed_loop_poles(loop)
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(np.roots(closed)), rtol=1e-9)
    assert hc.theory.gain_limit(loop) == math.inf
    assert np.all(np.roots(closed).real < 1e-9)


# ---- steady speed, passivity, transparency -------------------------------------------------------


@pytest.mark.parametrize(
    "num,den,speed",
    [
        ((1.0,), (1.0, 10.0, 0.0), 2.0 * 3.0 / (10.0 + 2.0 * 90.0)),
        ((1.0, 20.0), (1.0, 40.0, 0.0), 2.0 * 20.0 * 3.0 / (40.0 + 2.0 * 20.0 * 90.0)),
        ((1.0, 5.0), (1.0, 7.0), 0.0),
        ((1.0, 0.0), (1.0, 7.0, 0.0), 0.0),
        ((1.0, 5.0), (1.0, 7.0, 0.0, 0.0), 3.0 / 90.0),
    ],
)
def test_steady_speed_is_the_end_of_a_long_run(num, den, speed):
    c = hc.Compensator(num, den)
    assert linear_loop.steady_speed(2.0, 3.0, 90.0, c) == pytest.approx(speed, rel=1e-15)
    loop = hc.theory.Loop("x", 90.0, compensator=c, K=2.0)
    A, B = linear_loop.state_space(loop)
    M = np.zeros((len(A) + 1, len(A) + 1))
    M[:-1, :-1], M[:-1, -1] = A, 3.0 * B[:, 0]
    z = expm(5000.0 * M)[:, -1]  # without an integrator the clay slows the last of the way
    assert z[1] == pytest.approx(speed, rel=1e-6, abs=1e-9)


def test_steady_speed_with_two_integrators_and_no_clay_grows():
    c = hc.Compensator((1.0, 5.0), (1.0, 7.0, 0.0, 0.0))
    assert linear_loop.steady_speed(1.0, -2.0, 0.0, c) == -math.inf
    assert linear_loop.steady_speed(1.0, 0.0, 0.0, c) == 0.0
    speeds = linear_loop.steady_speed(1.0, 2.0, np.array([0.0, 4.0]), c)
    assert speeds.tolist() == [math.inf, 0.5]


@examples(15)
@given(loop=LOOPS, K=st.floats(0.01, 5.0))
def test_passivity_and_transparency_are_those_of_the_blocks(loop, K):
    C, G, S, _ = transfer_functions(loop)
    w = np.geomspace(0.1, 1e3, 4001)
    s = 1j * w
    E = np.polyval(loop.compensator.num, s) / np.polyval(loop.compensator.den, s) * K * G(s) + S(s)
    Z = loop.b + 1.0 / (s * E)
    assert hc.theory.transparency(loop, w, K=K) == pytest.approx(loop.b / Z, rel=1e-8)
    found = hc.theory.passivity(loop, K=K)
    assert found.margin <= Z.real.min() + 1e-8 * np.abs(Z).max()
    if 0.1 < found.omega < 1e3:
        near = np.linspace(0.999, 1.001, 3) * found.omega * 1j
        E = (K * G * C + S)(near)
        assert found.margin == pytest.approx(
            (loop.b + 1.0 / (near * E)).real[1], rel=1e-6, abs=1e-6
        )


# ---- design --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kw", [dict(Ts=1e-3), dict(delay=1e-3), dict(Ts=1e-3, delay=1.5e-3)])
def test_design_takes_any_compensator_sampled_and_late(kw):
    c = hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))
    K = hc.theory.design_gain("x", 90.0, gain_margin=2.0, compensator=c, **kw)
    assert K == pytest.approx(0.5 * hc.theory.gain_limit("x", 90.0, compensator=c, **kw), rel=1e-12)
    with pytest.raises(ParameterError):
        hc.theory.design_gain("x", 90.0, phase_margin=0.5, **kw)
    best = hc.theory.compare("x", 90.0, [c, hc.Compensator()], gain_margin=2.0, **kw)
    assert {d.compensator for d in best} == {c, hc.Compensator()}


def test_a_design_is_a_run():
    shapes = [hc.Compensator(), hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0))]
    th = hc.Operator()
    best = hc.theory.compare("x", 90.0, shapes, th, disk_margin=0.5, delay_margin=0.005)[0]
    cut = dataclasses.replace(
        hc.constant_cut(), compensator=best.compensator, gain=(best.K, 0.0), operator=th
    )
    loop = hc.theory.Loop.of(cut, "x", 90.0)
    assert hc.theory.margins(loop).disk == best.margins.disk and best.K == pytest.approx(
        0.596, abs=5e-4
    )


@examples(8)
@given(loop=LOOPS, seed=st.integers(0, 100))
def test_no_hand_of_a_box_is_worse_than_the_worst(loop, seed):
    box = hc.theory.Box((0.0, 1.0), (0.5, 10.0), (1.0, 200.0))
    found = hc.theory.worst_case(dataclasses.replace(loop, K=1.0), box).limit
    limits = [
        hc.theory.gain_limit(dataclasses.replace(loop, operator=th)) for th in box.sample(12, seed)
    ]
    assert found <= min(limits) * (1.0 + 1e-6)


def test_a_scenario_is_asked_like_its_loop():
    s = hc.constant_cut(operator=hc.Operator(), gain=(0.8, 0.3))
    for axis in "xy":
        loop = hc.theory.Loop.of(s, axis)
        assert (
            hc.theory.gain_limit(s, axis)
            == hc.theory.gain_limit(s, axis=axis)
            == hc.theory.gain_limit(loop)
        )
        assert hc.theory.margins(s, axis, at="force") == hc.theory.margins(loop, at="force")
        other = hc.theory.Loop.of(s, axis, 10.0)
        assert (
            hc.theory.gain_limit(s, axis, b=10.0)
            == hc.theory.gain_limit(other)
            != hc.theory.gain_limit(loop)
        )
    with pytest.raises(TypeError, match="axis"):
        hc.theory.gain_limit(s)


def test_a_run_with_a_controller_of_ones_own_is_refused():
    law = hc.Controller(lambda t, q, qd, fh, state, params: ((0.0, 0.0), state))
    s = hc.constant_cut(control="sampled")
    with pytest.raises(ParameterError, match="controller = .* must be None"):
        hc.theory.gain_limit(dataclasses.replace(s, controller=law), "x")
