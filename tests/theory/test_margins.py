"""Verdicts and margins against the poles, python-control, dense frequencies and the theorems they
come from.
"""

import math

import control
import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.polynomial import Polynomial

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.model.operator import Operator
from hapticclay.theory import linear_loop, roots, stability_margins
from hapticclay.theory.stability_margins import BREAKS
from tests.hunt import examples

OMEGA = np.geomspace(1e-2, 1e4, 20_001)
LOOPS = dict(
    axis=st.sampled_from("xy"),
    K=st.floats(0.01, 20.0),
    b=st.floats(1.0, 500.0),
    th=st.none()
    | st.builds(
        Operator,
        st.sampled_from([0.0, 0.25, 2.0]),
        st.floats(0.1, 20.0),
        st.sampled_from([0.0, 6.0, 300.0]),
    ),
    at=st.sampled_from(BREAKS),
)


def roots_right(poly):
    roots = np.roots(np.trim_zeros(poly.coef)[::-1])
    return int(np.sum(roots.real > 0.0)), float(
        np.min(np.abs(roots.real) / np.abs(roots), initial=1.0)
    )


def transfer_function(n, d):
    return control.tf(n.coef[::-1], d.coef[::-1])


def largest(f):
    """Largest value over OMEGA and both ends, and over finer grids around the point it is at."""
    w = np.concatenate(([1e-6], OMEGA, [1e8]))
    for _ in range(6):
        i = int(np.argmax(f(w)))
        w = np.linspace(w[max(i - 1, 0)], w[min(i + 1, len(w) - 1)], 201)
    return np.max(f(w))


@settings(max_examples=300)
@given(**LOOPS)
def test_nyquist_count_of_the_loop_is_that_of_its_poles(axis, K, b, th, at):
    right, nearest = roots_right(linear_loop.characteristic(hc.theory.Loop(axis, b, th, K=K)))
    assume(nearest > 1e-6)  # the curve then passes -1 as near: nothing to count
    found = hc.theory.nyquist(axis, K, b, at=at, operator=th)
    assert found.Z == right and found.P == 0
    assert found.Z == found.N + found.P


def test_nyquist_count_of_500_random_loops():
    """Unstable ones and ones with up to three integrators: Z = N + P, the poles by np.roots."""
    rng = np.random.default_rng(1)

    def poly(n):
        out = np.ones(1)
        while len(out) <= n:
            a, w = rng.uniform(-1.0, 2.0), 10.0 ** rng.uniform(-1.0, 2.0)
            out = np.convolve(
                out,
                [1.0, 2.0 * a * w, w * w]
                if n - len(out) >= 1 and rng.random() < 0.5
                else [1.0, a * w],
            )
        return out

    seen = set()
    for _ in range(500):
        integrators = int(rng.integers(0, 4))
        d = np.concatenate((poly(int(rng.integers(1, 5))), np.zeros(integrators)))
        n = 10.0 ** rng.uniform(-2.0, 2.0) * poly(int(rng.integers(0, len(d))))
        n *= (
            1.0
            if len(n) == len(d)
            else (abs(d[-1] / n[-1]) if d[-1] else 1.0) * 10.0 ** rng.uniform(-1.0, 3.0)
        )
        right, nearest = roots_right(Polynomial(n[::-1]) + Polynomial(d[::-1]))
        if nearest < 1e-4 or (len(n) == len(d) and abs(1.0 + n[0] / d[0]) < 1e-3):
            continue
        N, P = stability_margins.encirclements(Polynomial(n[::-1]), Polynomial(d[::-1]))
        assert N + P == right, (n, d)
        seen.add((P, N))
    assert len(seen) > 10 and any(P for P, _ in seen) and any(N < 0 for _, N in seen)


@settings(max_examples=60)
@given(**LOOPS)
def test_margins_against_python_control(axis, K, b, th, at):
    n, d = stability_margins.open_loop(axis, K, b, at=at, operator=th)
    m = hc.theory.margins(axis, K, b, at=at, operator=th)
    assert m.stable == linear_loop.stable(hc.theory.Loop(axis, b, th, K=K))
    if not m.stable:
        assert m.gain == (1.0, 1.0) and m.phase == m.delay == m.disk == 0.0
        return
    assume(m.phase > 1e-3)
    L = transfer_function(n, d)
    gains, phases, _, _, crossovers, _ = control.stability_margins(L, returnall=True)
    above = [x for x in gains if x > 1.0 and math.isfinite(x)]
    assert m.gain[1] == pytest.approx(
        min(above, default=math.inf), rel=1e-6
    )  # both roots of order 12
    lag = np.deg2rad(np.array(phases)) % (2.0 * np.pi)
    assert m.phase == pytest.approx(
        np.min(np.minimum(lag, 2.0 * np.pi - lag), initial=math.inf), abs=1e-6
    )
    if n.degree() < d.degree() or abs(n.coef[-1]) < abs(d.coef[-1]):
        assert m.delay == pytest.approx(np.min(lag / crossovers, initial=math.inf), rel=1e-6)
    dense = 2.0 / largest(lambda w: np.abs((d(1j * w) - n(1j * w)) / (d(1j * w) + n(1j * w))))
    assert m.disk <= dense * (1.0 + 1e-9)  # exact: no grid finds less
    assert m.disk == pytest.approx(dense, rel=1e-5)  # the last grid is finer than any resonance


def loop_by_its_parts(axis, K, b, th, compensator, at):
    """L(omega) from the factors of Eqs. 8 and 12, without a polynomial of the loop."""
    printed = hc.model.controller.SERVO["xy".index(axis)]

    def L(w):
        s = 1j * w
        T = b * s
        if th:
            T = T + th.mass * s**2 + th.damper * s + th.spring
        G, Sh = (x.gain / (s**2 + x.damping * s + x.stiffness) for x in (printed.G, printed.S))
        C = K * np.polyval(compensator.num, s) / np.polyval(compensator.den, s)
        return (G * C + Sh) * T if at == "force" else G * C * T / (1.0 + Sh * T)

    return L


BIPROPER = dict(
    axis=st.sampled_from("xy"),
    K=st.floats(-3.0, 1.0).map(lambda x: 10.0**x),
    b=st.floats(0.0, 3.5).map(lambda x: 10.0**x),
    th=st.none()
    | st.builds(Operator, st.floats(0.01, 5.0), st.floats(0.1, 100.0), st.floats(0.1, 500.0)),
    num=st.tuples(st.just(1.0), st.floats(0.1, 50.0), st.floats(0.1, 2e3)),
    den=st.tuples(st.just(1.0), st.floats(0.1, 50.0), st.just(0.0) | st.floats(0.1, 2e3)),
    at=st.sampled_from(BREAKS),
)  # both of degree 2: with the hand's mass, L does not roll off


@examples(40)
@given(**BIPROPER)
@example(
    "y",
    0.0385,
    1903.0,
    Operator(0.349, 0.505, 0.496),
    (1.0, 0.1107, 3.5775),
    (1.0, 26.566, 21.31),
    "compensator",
)
@example(
    "x",
    0.0405,
    2058.8,
    Operator(0.032, 31.74, 2.054),
    (1.0, 0.2758, 1809.1),
    (1.0, 10.65, 1.0464),
    "force",
)
def test_no_dense_scan_finds_a_smaller_disk_margin(axis, K, b, th, num, den, at):
    """The slope of |L| ratios loses its highest power; its rounding must not hide the peak."""
    C = hc.Compensator(num, den)
    m = hc.theory.margins(axis, K, b, th, compensator=C, at=at)
    assume(m.stable and m.disk > 1e-3)
    L = loop_by_its_parts(axis, K, b, th, C, at)
    dense = 2.0 / largest(lambda w: np.abs((1.0 - L(w)) / (1.0 + L(w))))
    # The scan ends at 1e-6 and 1e8 rad/s, the margin at 0 and infinity.
    assert m.disk == pytest.approx(dense, rel=1e-5)


@examples(8)
@given(
    axis=st.sampled_from("xy"),
    share=st.floats(-3.0, -0.1).map(lambda x: 1.0 - 10.0**x),
    b=st.floats(1.0, 300.0),
    den=st.tuples(st.just(1.0), st.floats(0.1, 50.0), st.just(0.0) | st.floats(0.1, 2e3)),
    num=st.tuples(st.floats(0.1, 1.0), st.floats(1.0, 100.0))
    | st.tuples(st.just(1.0), st.floats(0.1, 50.0), st.floats(1.0, 2e3)),
    th=st.none()
    | st.builds(Operator, st.floats(0.01, 5.0), st.floats(0.1, 100.0), st.floats(0.1, 500.0)),
    late=st.sampled_from([1e-3, 4e-3]),
)
@example(
    "x",
    0.9998,
    265.7,
    (1.0, 1.2457, 23.379),
    (1.0, 89.456, 4040.35),
    Operator(9.2488, 0.3539, 711.34),
    1e-3,
)
def test_no_dense_scan_finds_a_smaller_disk_margin_of_a_delayed_loop(
    axis, share, b, den, num, th, late
):
    C = hc.Compensator(num, den)
    limit = hc.theory.gain_limit(axis, b, th, compensator=C, delay=late)
    assume(0.0 < limit < 1e6)
    m = hc.theory.margins(axis, share * limit, b, th, compensator=C, delay=late)
    assume(m.stable)
    printed = hc.model.controller.SERVO["xy".index(axis)]
    own = printed.S
    w = np.geomspace(1e-2, 3e4, 200_001)
    s, T = 1j * w, b * 1j * w
    late_by = np.exp(-s * late)
    body, hand = own.gain * b * s * late_by, 0.0
    if th:
        hand = own.gain * (th.mass * s**2 + th.damper * s + th.spring)
        T = T + hand / own.gain
    # every action of the motors is late: the servo's feedback, held clay and the compensator
    arm = s**2 + hand + late_by * (own.damping * s + own.stiffness) + body
    G = printed.G.gain / (s**2 + printed.G.damping * s + printed.G.stiffness)
    drive = late_by * G * (s**2 + own.damping * s + own.stiffness)
    L = share * limit * drive * np.polyval(num, s) / np.polyval(den, s) * T / arm
    assert m.disk <= 2.0 / np.max(np.abs((1.0 - L) / (1.0 + L))) * (1.0 + 1e-6)


@pytest.mark.parametrize(
    "axis,K,at", [("x", 1.0, "compensator"), ("x", 2.0, "force"), ("y", 0.5, "force")]
)
def test_disk_margin_against_python_control(axis, K, at):
    n, d = stability_margins.open_loop(axis, K, 90.0, at=at)
    alpha, down, turn = control.disk_margins(transfer_function(n, d), OMEGA[OMEGA < 1e3])
    m = hc.theory.margins(axis, K, 90.0, at=at)
    assert m.disk == pytest.approx(
        float(alpha), rel=1e-5
    )  # its grid: 2e-4 in omega, squared, times the curvature
    assert 20.0 * math.log10((1 + m.disk / 2) / (1 - m.disk / 2)) == pytest.approx(
        float(down), rel=1e-4
    )
    assert 2.0 * math.atan(m.disk / 2) == pytest.approx(math.radians(float(turn)), rel=1e-4)


@settings(max_examples=40)
@given(**LOOPS, turn=st.floats(-1, 1), size=st.floats(0.0, 0.999))
def test_what_the_margins_allow_is_stable(axis, K, b, th, at, turn, size):
    m = hc.theory.margins(axis, K, b, at=at, operator=th)
    assume(m.stable and 0.01 < m.disk < 1.99)
    n, d = stability_margins.open_loop(axis, K, b, at=at, operator=th)
    z = size * m.disk / 2 * np.exp(1j * np.pi * turn)
    factor = (1 + z) / (1 - z)
    L = factor * n(1j * OMEGA) / d(1j * OMEGA)
    assert np.min(np.abs(1 + L)) > 0.0
    both = [
        (n * abs(factor) + d).roots().real.max()
    ]  # a real factor of that size lies in the disk as well
    assert 1 / m.gain[1] < 1 < m.gain[1]
    low, high = (1 - m.disk / 2) / (1 + m.disk / 2), (1 + m.disk / 2) / (1 - m.disk / 2)
    if low * 1.001 < abs(factor) < high * 0.999:
        assert max(both) < 1e-9


@given(**{k: v for k, v in LOOPS.items() if k != "at"})
@settings(max_examples=60)
def test_gain_margin_at_the_compensator_is_the_gain_limit(axis, K, b, th):
    limit = hc.theory.gain_limit(axis, b, operator=th)
    assume(K < 0.99 * limit)
    assert hc.theory.margins(axis, K, b, operator=th).gain[1] * K == pytest.approx(limit, rel=1e-9)


@pytest.mark.parametrize(
    "kw",
    [dict(), dict(operator=Operator()), dict(Ts=1e-3), dict(Ts=1e-3, delay=5e-4), dict(delay=2e-3)],
)
@pytest.mark.parametrize("axis", ["x", "y"])
def test_coupled_stability(axis, kw):
    limit = hc.theory.gain_limit(axis, 90.0, **kw)
    for factor in (0.999, 1.001):
        v = hc.theory.coupled_stability(axis, factor * limit, 90.0, **kw)
        assert bool(v) == v.verdict == (factor < 1.0)
        assert v.margin == pytest.approx(1.0 / factor, rel=1e-12)
        assert 30.0 < v.omega < 80.0 and v.method.endswith("exact") and v.assumptions


@settings(max_examples=60)
@given(**{k: v for k, v in LOOPS.items() if k != "at"}, equation=st.sampled_from([11, 13]))
def test_small_gain_against_dense_frequencies_and_what_it_promises(axis, K, b, th, equation):
    v = hc.theory.small_gain(axis, K, b, equation=equation, operator=th)
    s = 1j * OMEGA
    T = hc.theory.Loop(axis, b, th).environment(s)
    i = "xy".index(axis)
    g, g1, w, kd, kp = ((910.19, 41.8, 0.7919, 41.1, 432.0), (765.5, 30.3, 0.131, 32.4, 492.46))[i]
    GC, Sh = g / (s**2 + g1 * s + g) * K / (s**2 + 10 * s), w / (s**2 + kd * s + kp)
    left, right = (
        (np.abs(GC), np.abs((1 + Sh * T) / T)) if equation == 13 else (np.abs(GC * T + Sh * T), 1.0)
    )
    bad = left >= right
    assert v.margin <= np.min(right / left) * (1 + 1e-9)
    inside = np.zeros(len(OMEGA), dtype=bool)
    for low, high in v.fails:
        inside |= (OMEGA > low) & (OMEGA < high)
    edge = np.abs(np.log(left / right)) < 1e-9
    assert np.all((bad == inside) | edge)
    assert v.verdict == (not v.fails)
    if v.verdict:
        assert linear_loop.stable(hc.theory.Loop(axis, b, th, K=K))  # sufficient


def test_the_papers_condition_fails_near_zero_for_every_gain():
    """C integrates and Th has a spring, so |GC| outgrows the right side (PAPER.

    Not 5C, not any).
    """
    for K in (1e-3, 1.0):
        v = hc.theory.small_gain("x", K, 50.0, Operator())
        assert not v and v.margin == 0.0 and v.omega == 0.0 and v.fails[0][0] == 0.0
        assert hc.theory.coupled_stability("x", K, 50.0, Operator())
    assert hc.theory.small_gain("y", 5.0, 90.0, Operator(), equation=9)
    assert not hc.theory.coupled_stability("y", 5.0, 90.0, Operator())


def test_equation_9_is_the_distance_from_minus_one():
    n, d = stability_margins.open_loop("x", 2.0, 90.0)
    z = n(1j * OMEGA) / d(1j * OMEGA)
    assert hc.theory.small_gain("x", 2.0, 90.0, equation=9).margin == pytest.approx(
        np.min(np.abs(1 + z)), rel=1e-5
    )  # grid


@given(K=st.floats(0.1, 10.0), b=st.floats(1.0, 500.0), axis=st.sampled_from("xy"))
def test_transparency_is_equation_7(K, b, axis):
    found = hc.theory.transparency(axis, K, b, np.array([0.0, 3.0, 40.0]))
    assert found[0] == pytest.approx(
        K * b / (10.0 + K * b), rel=1e-12
    )  # the clay's share of 10/K + b
    s = 1j * np.array([3.0, 40.0])
    i = "xy".index(axis)
    g, g1, w, kd, kp = ((910.19, 41.8, 0.7919, 41.1, 432.0), (765.5, 30.3, 0.131, 32.4, 492.46))[i]
    H = b * s * (w / (s**2 + kd * s + kp) + g / (s**2 + g1 * s + g) * K / (s**2 + 10 * s))
    np.testing.assert_allclose(found[1:], H / (1 + H), rtol=1e-10)


def test_least_finds_the_ends_and_the_middle():
    # (x^2 - 2x + 3)/1 at x = omega^2 = 1; 1/(x + 1) at infinity; (x + 1)/(x + 2) at 0
    assert roots.least_ratio(Polynomial([3.0, -2.0, 1.0]), Polynomial([1.0])) == pytest.approx(
        (2.0, 1.0)
    )
    assert roots.least_ratio(Polynomial([1.0]), Polynomial([1.0, 1.0])) == (0.0, math.inf)
    assert roots.least_ratio(Polynomial([1.0, 1.0]), Polynomial([2.0, 1.0])) == (0.5, 0.0)


@pytest.mark.parametrize(
    "call,field",
    [
        (lambda: hc.theory.margins("z", 1.0, 90.0), "axis"),
        (lambda: hc.theory.margins("x", -1.0, 90.0), "K"),
        (lambda: hc.theory.nyquist("x", 1.0, 90.0, at="motor"), "at"),
        (lambda: hc.theory.small_gain("x", 1.0, 90.0, equation=8), "equation"),
        (lambda: hc.theory.coupled_stability("x", 0.0, 90.0), "K"),
        (lambda: hc.Compensator((1.0,), (0.0,)), "compensator.den"),
    ],
)
def test_bad_input_is_refused(call, field):
    with pytest.raises(ParameterError) as e:
        call()
    assert e.value.field == field
