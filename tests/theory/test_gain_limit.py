"""Gain limits found another way.

Roots, Routh, Pade, a period walked step by step, python-control, the simulator.
"""

import itertools
from decimal import Decimal, localcontext

import control
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.operator import Operator
from hapticclay.theory import gain_crossings, linear_loop
from tests.oracles import G0, G1, S0, S1, SG

HANDS = {"hand": (0.25, 2.0, 6.0), "none": (0.0, 0.0, 0.0), "stiff": (1.0, 5.0, 400.0)}
PRINTED = {
    ("x", True): (4.74, 3.84, 3.79),
    ("y", True): (1.42, 0.86, 0.80),
    ("x", False): (3.47, 3.23, 3.24),
    ("y", False): (1.18, 0.77, 0.73),
}
EXACT = {  # to 4 digits, in the same order: b = 50, 90, 100
    ("x", True): (4.7358, 3.8443, 3.7938),
    ("y", True): (1.4195, 0.8605, 0.7979),
    ("x", False): (3.4731, 3.2312, 3.2424),
    ("y", False): (1.1771, 0.7748, 0.7256),
}


def operator(hand):
    return Operator(*hand) if any(hand) else None


def limit(axis, b, hand=(0.25, 2.0, 6.0), **kw):
    return hc.theory.gain_limit(axis, b, operator(hand), **kw)


def polynomial(axis, K, b, hand, now=1.0, then=1.0):
    """Closed loop spelt out from the differential equations.

    `now` and `then` weigh what acts at once and late.
    """
    i = "xy".index(axis)
    m, d, k = hand
    c, g, s = [1, 10, 0], [1, G1[i], G0[i]], [1, S1[i], S0[i]]
    cg, t = np.convolve(c, g), [m, d + b, k]
    at_once = np.convolve(cg, [1 + SG[i] * m, SG[i] * d, SG[i] * k])
    late = np.polyadd(np.convolve(cg, [S1[i] + SG[i] * b, S0[i]]), K * G0[i] * np.convolve(s, t))
    return np.polyadd(
        np.convolve(at_once, np.atleast_1d(now)), np.convolve(late, np.atleast_1d(then))
    )


def worst(poly):
    while poly[-1] == 0:
        poly = poly[:-1]
    return np.roots(poly).real.max()


@pytest.mark.parametrize("axis,on,j", list(itertools.product("xy", [True, False], [0, 1, 2])))
def test_continuous_limits(axis, on, j):
    b = (50.0, 90.0, 100.0)[j]
    found = hc.theory.gain_limit(axis, b, Operator() if on else None)
    assert found == pytest.approx(
        PRINTED[axis, on][j], abs=0.0051
    )  # half the last digit, and a hair
    assert found == pytest.approx(EXACT[axis, on][j], abs=0.5001e-4)  # half the last digit
    hand = HANDS["hand" if on else "none"]
    root = brentq(
        lambda K: worst(polynomial(axis, K, b, hand)), 0.5 * found, 1.5 * found, xtol=1e-13
    )
    assert found == pytest.approx(root, rel=1e-9)  # eps times the condition of the roots, 1e4
    K, omega = gain_crossings.critical_gain(hc.theory.Loop(axis, b, operator(hand)))
    assert abs(np.polyval(polynomial(axis, K, b, hand), 1j * omega)) < 1e-8 * np.polyval(
        np.abs(polynomial(axis, K, b, hand)), omega
    )


def routh(poly):
    """First column of Routh's array."""
    a, b = list(poly[0::2]), list(poly[1::2])
    column = [a[0]]
    while b:
        column.append(b[0])
        b += [0.0] * (len(a) - len(b))
        c = [b[0] * a[i + 1] - a[0] * b[i + 1] for i in range(len(a) - 1)]
        a, b = b, [x / b[0] for x in c]
        while a and a[-1] == 0.0:
            a.pop()
        while b and b[-1] == 0.0:
            b.pop()
    return np.array(column)


@pytest.mark.parametrize("axis,b", list(itertools.product("xy", [50.0, 90.0, 100.0])))
def test_continuous_limits_by_routh_hurwitz(axis, b):
    found = limit(axis, b)
    assert np.all(routh(polynomial(axis, found * (1 - 1e-9), b, HANDS["hand"])) > 0)
    assert np.any(routh(polynomial(axis, found * (1 + 1e-9), b, HANDS["hand"])) < 0)


def period(  # noqa: PLR0913  # one loop, in floats or in Decimals
    axis, K, b, hand, Ts, delay, render, number=float, exponential=expm
):
    """One period of the sampled loop as a matrix.

    Every unit state is walked through the events, one after another.
    """
    n = int(delay / Ts + 1e-9) + 1
    g0, g1, s0, s1, sg = (number(float(x["xy".index(axis)])) for x in (G0, G1, S0, S1, SG))
    K, b, Ts, delay, m, d, k = (number(x) for x in (K, b, Ts, delay, *hand))
    mass = 1 / sg + m
    physical = b if render == "physical" else 0
    blocks = exponential(
        Ts
        * np.array(
            [
                [0, 1, 0, 0, 0],
                [0, -10, 0, 0, K],
                [0, 0, 0, 1, 0],
                [g0, 0, -g0, -g1, 0],
                [0, 0, 0, 0, 0],
            ]
        )
    )
    changes = delay - (n - 1) * Ts  # in a period the oldest gives way to the next then
    plant = np.array([[0, 1, 0], [-k / mass, -(d + physical) / mass, 1 / mass], [0, 0, 0]])
    before, after = exponential(changes * plant), exponential((Ts - changes) * plant)

    def walk(x):
        p, v, *z = x[:6]
        queue = list(x[6:])  # oldest last
        acting = queue[-1]
        a = (acting - k * p - (d + physical) * v) / mass
        f = -k * p - d * v - m * a - b * v
        y2 = g0 * (z[0] - z[2]) - g1 * z[3]
        u = (y2 + s1 * (z[3] - v) + s0 * (z[2] - p)) / sg - (b * v if render == "held" else 0)
        state = before @ [p, v, acting]
        queue = [u, *queue]
        state = after @ [state[0], state[1], queue[-2]]
        return [*state[:2], *(blocks @ [*z, f])[:4], *queue[:-1]]

    return np.array([walk([number(x) for x in e]) for e in np.eye(6 + n).tolist()]).T


def radius(matrix, spring):
    z = np.linalg.eigvals(matrix)
    if not spring:  # the handle's place
        z = np.delete(z, np.argmin(np.abs(z - 1)))
    return np.abs(z).max()


CASES = list(
    itertools.product(
        "xy", HANDS, [(3.6e-4, 0.0), (1e-3, 0.0), (1e-3, 4e-4), (1e-3, 2e-3), (5e-3, 7.5e-3)]
    )
)


@pytest.mark.parametrize("axis,hand,timing", CASES)
@pytest.mark.parametrize("render", ["held", "physical"])
def test_sampled_limits_against_the_period_map(axis, hand, timing, render):
    Ts, delay = timing
    hand = HANDS[hand]
    found = limit(axis, 90.0, hand, Ts=Ts, delay=delay, render=render)

    def beyond(K):
        return radius(period(axis, K, 90.0, hand, Ts, delay, render), hand[2]) - 1

    root = brentq(beyond, 0.7 * found, 1.3 * found, xtol=1e-12)
    assert found == pytest.approx(
        root, rel=1e-9
    )  # rounding of eigenvalues near z = 1; found: 1e-12
    assert all(beyond(K) < 0 for K in np.geomspace(0.01, 0.999, 25) * found)  # no window below it


def test_sampled_limits_of_random_loops():
    """Clay to 3e4 N.s/m, hands to 30 kg and 1e5 N/m, samples of 10 us to 10 ms, delays to four of
    them.
    """
    rng = np.random.default_rng(7)
    zero = 0
    for _ in range(40):
        b, Ts = 10 ** rng.uniform(0.0, 4.5), 10 ** rng.uniform(-5.0, -2.0)
        hand = [
            float(rng.choice([0.0, 10 ** rng.uniform(*x)]))
            for x in ((-2.0, 1.5), (-1.0, 2.5), (-1.0, 5.0))
        ]
        delay = float(rng.choice([0.0, Ts * rng.uniform(0.0, 4.0), Ts * rng.integers(0, 4)]))
        axis, render = "xy"[rng.integers(2)], ("held", "physical")[rng.integers(2)]
        found = limit(axis, b, hand, Ts=Ts, delay=delay, render=render)

        def beyond(K):
            return radius(period(axis, K, b, hand, Ts, delay, render), hand[2]) - 1  # noqa: B023

        if found == 0.0:
            zero += 1
            assert beyond(1e-4) > -1e-10
        else:  # all eigenvalues of a long run of slow samples lie within 1e-10 of the circle
            assert all(
                beyond(K) < 1e-10
                for K in found * np.array([1e-3, 0.01, 0.1, 0.3, 0.6, 0.9, 0.99, 1 - 1e-5])
            )
            assert beyond(found * (1 + 1e-5)) > -1e-11
    assert 0 < zero < 20


def exponential(a):
    """Of a matrix of Decimals: Taylor's series of a/2^n, squared n times."""
    n = max(0, int(max(abs(x) for x in a.ravel()) * len(a)).bit_length() + 8)
    a, out = a / Decimal(2) ** n, np.eye(len(a), dtype=int) * Decimal(1)
    term = out
    for i in range(1, 60):  # 2^-8 each: beyond 120 digits
        term = term @ a / i
        out = out + term
    for _ in range(n):
        out = out @ out
    return out


def inside(matrix, spring):
    """Whether all eigenvalues but the handle's place lie within the unit circle (Schur, Cohn).

    The characteristic polynomial is Faddeev's and LeVerrier's.
    """
    n, p, M = len(matrix), [Decimal(1)], matrix * Decimal(0)
    for i in range(1, n + 1):
        M = matrix @ (M + p[-1] * np.eye(n, dtype=int))
        p.append(-np.trace(M) / i)
    if not spring:
        assert abs(sum(p)) < Decimal(10) ** -80  # z = 1 is a root
        p = list(itertools.accumulate(p))[:-1]
    while len(p) > 1:
        if abs(p[-1]) >= abs(p[0]):
            return False
        p = [p[0] * x - p[-1] * y for x, y in zip(p[:-1], p[:0:-1], strict=True)]
        p = [x / p[0] for x in p]
    return True


@pytest.fixture
def digits():
    with localcontext() as context:
        context.prec = 150
        yield


def is_inside(axis, K, b, hand, Ts, delay, render):
    return inside(period(axis, K, b, hand, Ts, delay, render, Decimal, exponential), hand[2])


@pytest.mark.parametrize("axis,hand", list(itertools.product("xy", HANDS)))
@pytest.mark.parametrize(
    "b,Ts,delay", [(1e9, 3.6e-4, 0.0), (1e9, 1e-6, 0.0), (1e8, 1e-3, 1.4e-3), (90.0, 3.6e-4, 0.0)]
)
def test_sampled_limits_where_poles_crowd_at_one(digits, axis, hand, b, Ts, delay):
    """Implicit clay to 1e9 N.s/m moves poles to within 1e-15 of z = 1.

    Judged with 150 digits, by another criterion.
    """
    found = limit(axis, b, HANDS[hand], Ts=Ts, delay=delay, render="physical")
    assert 0.0 < found < np.inf
    for share in (1e-12, 1e-3, 0.5, 1 - 1e-7, 1 + 1e-7):
        stable = is_inside(axis, share * found, b, HANDS[hand], Ts, delay, "physical")
        assert stable == (share < 1.0)
        assert (
            gain_crossings.is_stable(
                hc.theory.Loop(
                    axis,
                    b,
                    operator(HANDS[hand]),
                    K=share * found,
                    Ts=Ts,
                    delay=delay,
                    render="physical",
                )
            )
            == stable
        )


@pytest.mark.parametrize("axis,hand", list(itertools.product("xy", HANDS)))
@pytest.mark.parametrize("Ts,delay", [(1e-6, 0.0), (3.6e-4, 0.0), (3.6e-4, 6e-4)])
@pytest.mark.parametrize("render", ["held", "physical"])
def test_tiny_gains_are_stable_where_the_limit_says_so(digits, axis, hand, Ts, delay, render):
    """The pole that K moves is at -K k/10.

    Z = 1 - 2e-16 at K = 1e-12, and far below rounding at 1e-30 and 5e-324.
    """
    for K in (1e-6, 1e-12, 1e-30, 5e-324):
        assert K < 1e-30 or is_inside(axis, K, 90.0, HANDS[hand], Ts, delay, render)
        assert gain_crossings.is_stable(
            hc.theory.Loop(
                axis, 90.0, operator(HANDS[hand]), K=K, Ts=Ts, delay=delay, render=render
            )
        )


@pytest.mark.parametrize("axis,n", list(itertools.product("xy", [0, 1, 3])))
def test_sampled_limit_against_the_frequency_response_of_python_control(axis, n):
    """No hand.

    The loop broken at the sampled net force, from python-control's own discretisations.
    """
    Ts, b, i = 1e-3, 90.0, "xy".index(axis)
    K, omega = gain_crossings.critical_gain(hc.theory.Loop(axis, b, Ts=Ts, delay=n * Ts))
    s, z = control.tf("s"), np.exp(1j * omega * Ts)
    G = G0[i] / (s**2 + G1[i] * s + G0[i])
    C = K / (s**2 + 10 * s)
    held = [control.c2d(H, Ts, "zoh")(z) for H in (G * C, G * C * s, C, SG[i] / s**2, SG[i] / s)]
    y, y1, delta, p_u, v_u = held
    y2 = G0[i] * (delta - y) - G1[i] * y1
    late = z**-n / SG[i]
    # u = late (y2 + S1 (y1 - v) + S0 (y - p) - W b v), f = -b v
    back = 1 + late * (S1[i] * v_u + S0[i] * p_u + SG[i] * b * v_u)
    v = v_u * late * (y2 + S1[i] * y1 + S0[i] * y) / back
    assert -b * v == pytest.approx(1.0, abs=1e-6)  # rounding of c2d near z = 1, 1e-16/(omega Ts)^3


@pytest.mark.parametrize("axis,hand", list(itertools.product("xy", HANDS)))
def test_sampled_limit_tends_to_the_continuous_one(axis, hand):
    exact = limit(axis, 90.0, HANDS[hand])
    gap = [exact - limit(axis, 90.0, HANDS[hand], Ts=Ts) for Ts in (8e-5, 4e-5, 2e-5, 1e-5)]
    assert np.all(np.array(gap) > 0) and gap[3] < 1e-2 * exact
    order = np.polyfit(np.log([8, 4, 2, 1]), np.log(gap), 1)[0]
    assert order == pytest.approx(1.0, abs=0.1)  # a hold is half a sample late: first order
    assert 2 * gap[3] - gap[2] == pytest.approx(
        0.0, abs=5e-4 * exact
    )  # extrapolated, second order is left


@pytest.mark.parametrize("axis,hand", list(itertools.product("xy", HANDS)))
@pytest.mark.parametrize("delay", [1e-3, 4e-3])
def test_late_limit_against_pade(axis, hand, delay):
    """Order 8 at omega delay < 0.5 is exact to rounding."""
    hand = HANDS[hand]
    num, den = control.pade(delay, 8)
    found = limit(axis, 90.0, hand, delay=delay)

    def beyond(K):
        return worst(polynomial(axis, K, 90.0, hand, den, num))

    assert found == pytest.approx(
        brentq(beyond, 0.7 * found, 1.3 * found, xtol=1e-12), rel=1e-9
    )  # roots of order 14; found: 1e-13
    assert all(beyond(K) < 0 for K in np.geomspace(0.01, 0.999, 25) * found)


@pytest.mark.parametrize("axis,render", list(itertools.product("xy", ["held", "physical"])))
def test_sampled_limit_with_a_delay_tends_to_the_late_one(axis, render):
    exact = limit(axis, 90.0, delay=2e-3, render=render)
    gap = [exact - limit(axis, 90.0, delay=2e-3, Ts=Ts, render=render) for Ts in (4e-4, 2e-4, 1e-4)]
    assert np.polyfit(np.log([4, 2, 1]), np.log(gap), 1)[0] == pytest.approx(1.0, abs=0.1)
    assert 2 * gap[2] - gap[1] == pytest.approx(
        0.0, abs=5e-4 * exact
    )  # extrapolated, second order is left


def test_limits_fall_with_delay_and_sample():
    for axis in "xy":
        assert np.all(
            np.diff([limit(axis, 90.0, delay=d) for d in (0, 1e-6, 1e-4, 1e-3, 3e-3)]) < 0
        )
        assert np.all(np.diff([limit(axis, 90.0, Ts=T) for T in (1e-5, 1e-4, 1e-3, 3e-3)]) < 0)
        assert limit(axis, 90.0, delay=1e-9) == pytest.approx(limit(axis, 90.0), rel=1e-7)


def test_limits_at_the_ends():
    for kw in (dict(), dict(Ts=1e-3), dict(delay=1e-3)):
        assert hc.theory.gain_limit("x", 0.0, **kw) == float("inf")  # nothing to feel
    for kw in (dict(Ts=1e-3), dict(delay=1e-3), dict(Ts=1e-4, delay=2e-3), dict(delay=1.0)):
        assert limit("x", 1e5, **kw) == 0.0  # held clay overshoots by itself
    assert 0.0 < limit("x", 1e5, Ts=1e-4, render="physical") < float("inf")


def test_a_narrow_unstable_window_is_not_missed():
    """Crossings 2e-4 apart between grid points 0.75 apart (in log omega), and a window of 2e-5 in K
    between them.
    """

    def h(w):
        x = np.log(w) - 1.2345
        return (1.0 - 0.1 * x) * (1.0 + 1j * (x**2 - 1e-8))

    edges = 1.0 / (1.0 + 1e-5), 1.0 / (1.0 - 1e-5)
    loop = gain_crossings.LoopFamily(
        h, np.exp(np.linspace(0.0, 3.0, 5)), lambda K: not edges[0] < K < edges[1]
    )
    found = sorted(gain_crossings.gain_crossings(loop))
    np.testing.assert_allclose(
        [K for K, _ in found], edges, rtol=1e-9
    )  # a root beside its extreme: sqrt(eps) of 1e-4
    np.testing.assert_allclose(np.log([w for _, w in found]), [1.2344, 1.2346], atol=1e-9)
    assert gain_crossings.first_instability(loop)[0] == pytest.approx(edges[0], rel=1e-9)


@pytest.mark.parametrize("axis,hand", [("x", "none"), ("y", "hand")])
@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_simulator_decays_and_grows_as_the_sampled_model_says(axis, hand, factor):
    """Small swings about the nominal pose, 2 % inside and outside the limit, at Ts = 2 ms."""
    Ts, b, i = 2e-3, 90.0, "xy".index(axis)
    th = operator(HANDS[hand])
    K = factor * hc.theory.gain_limit(axis, b, th, Ts=Ts)
    gain = [0.1, 0.1]
    gain[i] = K
    force = [0.0, 0.0]
    force[i] = 1e-4
    run = hc.simulate(
        hc.constant_cut(
            b,
            tuple(gain),
            tuple(force),
            operator=th,
            inertia_shaping=True,
            dt=Ts / 8,
            Ts=Ts,
            control="sampled",
            clay=(-0.05, 0.05),
            origin=(0.35, 0.24),
            length=0.04,
            t_max=4.0,
        )
    )
    less, beta, gamma = linear_loop.sampled_differences(hc.theory.Loop(axis, b, th, Ts=Ts))
    z = 1.0 + np.linalg.eigvals(less + K * np.outer(beta, gamma))
    z = z[np.abs(np.angle(z)) > 10.0 * Ts]  # what swings, at 30 rad/s or more
    rate = np.log(np.abs(z).max()) / Ts
    assert (rate < 0) == (factor < 1)
    v, t = np.diff(run.v[::8, i]), run.t[::8][1:]
    peaks = (
        np.flatnonzero((np.abs(v[1:-1]) > np.abs(v[:-2])) & (np.abs(v[1:-1]) >= np.abs(v[2:]))) + 1
    )
    peaks = peaks[t[peaks] > 1.0]  # the other modes have died by then
    found = np.polyfit(t[peaks], np.log(np.abs(v[peaks])), 1)[0]
    assert found == pytest.approx(
        rate, abs=0.02
    )  # steps of 0.25 ms: error of order dt^2 omega^3, and peaks at samples
    assert abs(rate) > 0.1


def test_no_operator_is_no_hand():
    for kw in (dict(), dict(Ts=1e-3), dict(delay=1e-3)):
        none = hc.theory.gain_limit("x", 90.0, **kw)
        assert none == hc.theory.gain_limit("x", 90.0, operator=None, **kw)
        assert none == pytest.approx(
            hc.theory.gain_limit("x", 90.0, Operator(0.0, 0.0, 0.0), **kw), rel=1e-12
        )
        assert abs(hc.theory.gain_limit("x", 90.0, Operator(), **kw) / none - 1.0) > 0.1


@pytest.mark.parametrize(
    "call,field",
    [
        (lambda: hc.theory.gain_limit("z", 90.0), "axis"),
        (lambda: hc.theory.gain_limit("x", -1.0), "b"),
        (lambda: hc.theory.gain_limit("x", 90.0, Ts=0.0), "Ts"),
        (lambda: hc.theory.gain_limit("x", 90.0, delay=-1.0), "delay"),
        (lambda: hc.theory.gain_limit("x", 90.0, Ts=1e-4, delay=1.0), "delay"),
        (lambda: hc.theory.gain_limit("x", 90.0, render="hold"), "render"),
        (lambda: hc.theory.gain_limit("x", 90.0, operator=(1, 2, 3)), "operator"),
        (lambda: hc.theory.gain_limit("x", 90.0, operator=True, Ts=1e-3), "operator"),
        (lambda: hc.theory.gain_limit("x", 90.0, operator=True, delay=1e-3), "operator"),
        (lambda: hc.theory.gain_limit("x", 90.0, Ts=1e-3, compensator=5.0), "compensator"),
        (lambda: hc.theory.gain_limit("x", 90.0, servo=(1.0, 2.0)), "servo"),
        (lambda: hc.theory.gain_limit("x", 90.0, mobility=0.0), "mobility"),
        (lambda: hc.theory.gain_limit(hc.theory.Loop(), b=90.0), "b"),
        (lambda: hc.theory.gain_limit(hc.theory.Loop(), servo=hc.theory.Loop().servo), "servo"),
        (lambda: hc.theory.margins(hc.theory.Loop(b=90.0)), "K"),
        (lambda: hc.theory.small_gain(hc.theory.Loop(b=90.0, K=1.0, Ts=1e-3)), "Ts"),
        (lambda: hc.theory.margins("x", 1.0, 90.0, Ts=1e-3, at="force"), "at"),
        (lambda: hc.theory.passivity("x", 1.0, 90.0, delay=1e-3), "delay"),
        (lambda: hc.theory.Loop.of("x", "x"), "scenario"),
    ],
)
def test_bad_input_is_refused(call, field):
    with pytest.raises(ParameterError) as e:
        call()
    assert e.value.field == field


def test_a_loop_of_a_subclass_is_a_loop():
    """A pushed loop of the studies is a loop: it needs no clay beside it."""
    loop = hc.studies.PushedLoop("x", b=90.0)
    plain = hc.theory.Loop(b=90.0)
    assert hc.theory.gain_limit(loop) == hc.theory.gain_limit(plain)
