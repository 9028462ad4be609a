"""Describing functions against integrals, limit cycles against exact ones and against motions."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

import hapticclay as hc
from hapticclay.theory import describing, linear_loop
from hapticclay.theory.describing import amplitudes, damping_crossings
from tests.oracles import sticking

Y = hc.theory.Loop("y", K=1.0)
FLOWS = st.builds(
    hc.Flow,
    Fy=st.sampled_from((0.0, 0.1, 5.0, 100.0)),
    K=st.sampled_from((0.0, 0.5, 20.0)),
    n=st.floats(0.1, 3.0),
    b=st.sampled_from((0.0, 30.0)),
)
HANDS = st.sampled_from((None, hc.Operator(), hc.Operator(2.0, 5.0, 0.0)))


@given(FLOWS, st.floats(-4.0, 1.0))
@settings(max_examples=40, deadline=None)
def test_it_is_the_fundamental_of_the_force(flow, exponent):
    V = 10.0**exponent

    def share(angle):
        return float(flow.force(V * math.sin(angle))) * math.sin(angle)

    # over half a period, by symmetry; quad's own error at the edges, where |v|^n has no slope
    integral = 2.0 / math.pi * quad(share, 0.0, math.pi, epsrel=1e-10, limit=200)[0]
    assert hc.theory.describing_function(flow, V) * V == pytest.approx(integral, rel=1e-7)


def test_named_laws():
    V = np.array([0.01, 0.1])
    bingham = hc.theory.describing_function(hc.Flow(Fy=5.0, b=30.0), V)
    assert bingham == pytest.approx(30.0 + 4.0 * 5.0 / (math.pi * V), rel=1e-15)
    # c(1) = 1, a damper; c(2) = 8/(3 pi), quadratic damping
    assert hc.theory.describing_function(hc.Flow(K=7.0), 0.3) == pytest.approx(7.0, rel=1e-15)
    quadratic = hc.theory.describing_function(hc.Flow(K=7.0, n=2.0), 0.3)
    assert quadratic == pytest.approx(7.0 * 8.0 / (3.0 * math.pi) * 0.3, rel=1e-15)


@pytest.mark.parametrize("V", [0.0, -1.0, math.nan, [0.1, 0.0]])
def test_no_amplitude_is_refused(V):
    with pytest.raises(hc.ParameterError, match="V"):
        hc.theory.describing_function(hc.Flow(Fy=1.0), V)


@given(FLOWS, st.floats(-1.0, 4.0))
@settings(max_examples=200, deadline=None)
def test_amplitudes_are_all_solutions(flow, exponent):
    N = 10.0**exponent
    found = amplitudes(flow, N)
    assert list(found) == sorted(found)
    for V in found:
        # conditioning: V is a double, and N turns by at most |n - 1| <= 2 of its error
        assert hc.theory.describing_function(flow, V) == pytest.approx(N, rel=1e-11)
    V = np.geomspace(1e-9, 1e9, 4001)
    N_of_V = np.broadcast_to(hc.theory.describing_function(flow, V), V.shape)
    changes = np.count_nonzero(np.diff(np.sign(N_of_V - N)))
    if changes:  # a pair closer than this grid, or a root beyond it, shows in `found` alone
        assert len([x for x in found if V[0] <= x <= V[-1]]) >= changes


def test_amplitudes_of_laws_with_two():
    flow = hc.Flow(Fy=4.0, K=50.0, n=2.0)
    low, high = amplitudes(flow, 100.0)
    assert low < math.sqrt(4.0 * 4.0 / math.pi / (50.0 * 8.0 / (3.0 * math.pi))) < high
    assert amplitudes(flow, 1.0) == ()
    assert amplitudes(hc.Flow(b=30.0), 30.0) == ()


@given(st.floats(0.2, 10.0), HANDS, st.sampled_from("xy"))
@settings(max_examples=40, deadline=None)
def test_unstable_dampings_against_eigenvalues(K, hand, axis):
    loop = hc.theory.Loop(axis, K=K, operator=hand)
    bands = hc.theory.unstable_dampings(loop)
    edges = [x for band in bands for x in band]
    for b in np.geomspace(0.5, 1e5, 23):
        if any(abs(b / x - 1.0) < 1e-3 for x in edges if x):
            continue
        z = np.linalg.eigvals(linear_loop.state_space(replace(loop, b=b))[0])
        growing = bool(np.any(z.real > 1e-6))  # the handle's place is a mode at 0, to rounding
        assert growing == any(low < b < high for low, high in bands)


def test_crossings_have_poles_on_the_axis():
    low, high = damping_crossings(Y)
    assert (low.below, low.above, high.below, high.above) == (0, 2, 2, 0)
    for x in (low, high):
        z = hc.theory.closed_loop_poles("y", 1.0, x.b, None)
        assert np.min(np.abs(z - 1j * x.omega)) < 1e-9 * x.omega


def test_bands_with_open_ends():
    unstable = hc.Compensator((1.0, 0.0), (1.0, -5.0, 0.0))  # C itself is, so no clay saves it
    assert hc.theory.unstable_dampings("x", 0.1, compensator=unstable)[-1][1] == math.inf
    assert hc.theory.unstable_dampings("x", 1.0) == ()


# ---- the claims ----------------------------------------------------------------------------------


@pytest.mark.parametrize("b", [0.0, 30.0, 60.0])
@pytest.mark.parametrize("Fy", [0.1, 5.0, 100.0])
def test_a_small_push_sticks_and_a_large_one_buzzes(b, Fy):
    flow = hc.Flow(Fy=Fy, b=b)
    (low, high) = hc.theory.unstable_dampings(Y)[0]
    assert (low, high) == pytest.approx((62.06, 3903.0), rel=5e-4)
    assert hc.theory.push_outcomes(Y, flow) == ("sticks", "limit cycle")
    threshold, cycle = hc.theory.limit_cycles(Y, flow)
    assert (threshold.kind, cycle.kind) == ("threshold", "limit cycle")
    assert threshold.speed == pytest.approx(4.0 * Fy / (math.pi * (high - b)), rel=1e-12)
    assert cycle.speed == pytest.approx(4.0 * Fy / (math.pi * (low - b)), rel=1e-12)
    assert cycle.amplitude == cycle.speed / cycle.omega
    assert cycle.trusted and not threshold.trusted


def test_in_clay_within_the_band_a_large_push_grows():
    flow = hc.Flow(Fy=5.0, b=200.0)
    assert hc.theory.push_outcomes(Y, flow) == ("sticks", "grows")
    assert [x.kind for x in hc.theory.limit_cycles(Y, flow)] == ["threshold"]


def test_beyond_the_band_everything_sticks():
    flow = hc.Flow(Fy=5.0, b=5000.0)
    assert hc.theory.push_outcomes(Y, flow) == ("sticks", "sticks")
    assert hc.theory.limit_cycles(Y, flow) == ()


def test_clay_without_a_yield_force():
    assert hc.theory.push_outcomes(Y, hc.Flow(b=30.0)) == ("comes to rest", "comes to rest")
    assert hc.theory.push_outcomes(Y, hc.Flow(b=300.0)) == ("grows", "grows")
    # thickening clay: damping falls to b in a small motion, which grows until N leaves the band
    thick = hc.Flow(K=1e4, n=2.0, b=100.0)
    assert hc.theory.push_outcomes(Y, thick) == ("limit cycle", "limit cycle")
    (cycle,) = hc.theory.limit_cycles(Y, thick)
    assert cycle.kind == "limit cycle" and cycle.damping > 3900.0


def test_cycles_of_a_scenario_are_those_of_its_loop():
    flow, cut = hc.Flow(Fy=5.0), hc.constant_cut(inertia_shaping=True, gain=(1.0, 1.0))
    assert hc.theory.limit_cycles(cut, "y", flow) == hc.theory.limit_cycles(
        hc.theory.Loop.of(cut, "y"), flow
    )
    assert hc.theory.limit_cycles("y", flow, 1.0) == hc.theory.limit_cycles(Y, flow=flow)


@pytest.mark.parametrize(
    "ask", [hc.theory.limit_cycles, hc.theory.push_outcomes, hc.theory.exact_cycles]
)
def test_what_is_no_law_is_refused(ask):
    with pytest.raises(hc.ParameterError, match="must be a Flow"):
        ask(Y, 5.0)
    with pytest.raises(hc.ParameterError, match="continuous time"):
        ask(replace(Y, Ts=1e-3), hc.Flow(Fy=1.0))


# ---- exact cycles --------------------------------------------------------------------------------


def relay(loop, flow):
    """A and B of z' = A z + B u under the friction u."""
    A, B = linear_loop.state_space(replace(loop, b=flow.b))
    return A, B[:, 0]


def last_period(t, z):
    """Period, velocity at even times over it, and half of the way, of the last full period."""
    v = z[:, 1]
    up = np.flatnonzero((v[:-1] < 0.0) & (v[1:] >= 0.0))
    start, end = t[up[-2]], t[up[-1]]
    even = np.linspace(start, end, 512, endpoint=False)
    inside = (t >= start) & (t <= end)
    return end - start, np.interp(even, t, v), 0.5 * np.ptp(z[inside, 0])


@pytest.mark.parametrize("hand", [None, hc.Operator(2.0, 5.0, 0.0)])
def test_a_push_ends_in_the_exact_limit_cycle(hand):
    loop, flow = replace(Y, operator=hand), hc.Flow(Fy=5.0, b=10.0)
    cycle = [x for x in hc.theory.exact_cycles(loop, flow) if x.stable][0]
    A, B = relay(loop, flow)
    start = np.zeros(len(A))
    start[1] = cycle.speed
    t, z, stuck = sticking.motion(A, B, flow.Fy, start, 2.5)
    period, v, amplitude = last_period(t, z)
    assert stuck == math.inf
    # interpolation between steps of the oracle, of some 1/20 of a period
    assert 2.0 * math.pi / period == pytest.approx(cycle.omega, rel=1e-3)
    assert np.max(np.abs(v)) == pytest.approx(cycle.speed, rel=1e-2)
    assert amplitude == pytest.approx(cycle.amplitude, rel=1e-3)
    spectrum = np.abs(np.fft.rfft(v))
    predicted = next(x for x in hc.theory.limit_cycles(loop, flow) if x.kind == "limit cycle")
    # to first order; and interpolation
    assert spectrum[3] / spectrum[1] == pytest.approx(predicted.third, rel=0.25)


def test_the_exact_threshold_parts_sticking_from_buzzing():
    flow = hc.Flow(Fy=1.0)
    threshold, cycle = hc.theory.exact_cycles(Y, flow)
    assert not threshold.stable and threshold.stuck > 0.0 and cycle.stable and cycle.stuck == 0.0
    A, B = relay(Y, flow)

    def pushed(v, step=3e-3):
        start = np.zeros(len(A))
        start[1] = v
        return sticking.motion(A, B, flow.Fy, start, 1.2, step)

    low, high = 3.9e-3, 4.0e-3
    assert math.isfinite(pushed(low)[2]) and pushed(high)[2] == math.inf
    for _ in range(11):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if math.isfinite(pushed(middle)[2]) else (low, middle)
    t, z, stuck = pushed(high, 1e-3)
    assert stuck == math.inf
    # The motion on the edge is drawn to the threshold before it leaves: there it is read, from
    # one passage of half the speed to the next.
    v, level = z[:, 1], 0.5 * threshold.speed
    ups = t[1:][(v[:-1] < level) & (v[1:] >= level)]
    periods = [
        (v[(t >= a) & (t < c)].max() / threshold.speed, 2.0 * math.pi / (c - a) / threshold.omega)
        for a, c in zip(ups[:-1], ups[1:], strict=True)
    ]
    # 11 bisections leave 1e-5 of the push, of which a growth of 2.8 a period makes 1e-3
    assert min(abs(x - 1.0) + abs(y - 1.0) for x, y in periods) < 5e-3


@given(st.floats(0.7, 8.0), st.floats(0.0, 0.95), HANDS)
@settings(max_examples=15, deadline=None)
def test_a_trusted_prediction_keeps_its_word(K, share, hand):
    loop = hc.theory.Loop("y", K=K, operator=hand)
    flow = hc.Flow(Fy=1.0, b=share * hc.theory.unstable_dampings(loop)[0][0])
    exact = [x for x in hc.theory.exact_cycles(loop, flow) if x.stable]
    for cycle in hc.theory.limit_cycles(loop, flow):
        if cycle.kind != "limit cycle" or not cycle.trusted:
            continue
        speed, omega = exact[0].speed / cycle.speed - 1.0, exact[0].omega / cycle.omega - 1.0
        assert abs(speed) < 0.10 and abs(omega) < 0.05
        # what the harmonics do is known to first order; largest speed against fundamental
        assert speed == pytest.approx(cycle.speed_shift, abs=2.0 * cycle.speed_shift**2 + 0.006)
        assert omega == pytest.approx(cycle.omega_shift, abs=2.0 * cycle.speed_shift**2 + 1e-3)


def test_exact_cycles_scale_with_the_yield_force():
    one, ten = (hc.theory.exact_cycles(Y, hc.Flow(Fy=x, b=20.0)) for x in (1.0, 10.0))
    for a, b in zip(one, ten, strict=True):
        assert (10.0 * a.speed, 10.0 * a.amplitude) == pytest.approx((b.speed, b.amplitude))
        assert (a.omega, a.multiplier) == pytest.approx((b.omega, b.multiplier))
    same = hc.theory.exact_cycles(Y, hc.Flow(Fy=1.0, K=20.0))
    assert [x.speed for x in same] == pytest.approx([x.speed for x in one], rel=1e-12)


def test_exact_cycles_are_of_coulomb_and_bingham_clay():
    for flow in (hc.Flow(b=10.0), hc.Flow(Fy=1.0, K=2.0, n=0.5)):
        with pytest.raises(hc.ParameterError, match="Coulomb or Bingham"):
            hc.theory.exact_cycles(Y, flow)


@pytest.mark.parametrize("flow", [hc.Flow(K=5.0, n=0.5, b=10.0), hc.Flow(K=9.0, n=0.2)])
def test_a_push_in_a_power_law_ends_in_the_predicted_cycle(flow):
    cycle = next(x for x in hc.theory.limit_cycles(Y, flow) if x.kind == "limit cycle")
    A, B = linear_loop.state_space(replace(Y, b=0.0))

    def rate(_, z):
        return A @ z - B[:, 0] * float(flow.force(z[1]))

    start = np.zeros(len(A))
    start[1] = cycle.speed
    run = solve_ivp(rate, (0.0, 5.0), start, method="LSODA", rtol=1e-8, atol=1e-11, max_step=2e-3)
    period, v, _ = last_period(run.t, run.y.T)
    fundamental = 2.0 * np.abs(np.fft.rfft(v))[1] / len(v)
    assert cycle.trusted
    speed, omega = fundamental / cycle.speed - 1.0, 2.0 * math.pi / period / cycle.omega - 1.0
    assert abs(speed) < 0.10 and abs(omega) < 0.05
    assert speed == pytest.approx(cycle.speed_shift, abs=3e-3)
    assert omega == pytest.approx(cycle.omega_shift, abs=2e-3)


def test_the_words_are_those_that_are_promised():
    assert describing.AMPLITUDE_TRUST < 0.10 and describing.FREQUENCY_TRUST < 0.05
