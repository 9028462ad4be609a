"""Each part of the hardware alone against its analytic effect; all off, the run of today."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.formulas import arm
from hapticclay.formulas import hardware as formula
from hapticclay.kernel import scene
from hapticclay.model import constants, hardware
from hapticclay.model.cells import Profile
from hapticclay.model.clay import Clay
from hapticclay.model.constants import TS
from hapticclay.model.operator import Operator
from hapticclay.simulation import run as runs
from hapticclay.simulation.run import Run
from hapticclay.theory import linear_loop
from tests.hunt import examples

EVERYWHERE = Profile((), (90.0,))
EPS = np.finfo(float).eps


def ring(axis, K, b, parts=None, **kw):
    """A push at the nominal pose in clay all around; no compensator on the other axis."""
    i = "xy".index(axis)
    clay = Profile((), (b,))
    unit = lambda x: (x, 0.0) if i == 0 else (0.0, x)  # noqa: E731
    return hc.Scenario(
        clay=Clay(clay, clay),
        gain=unit(K),
        force=(0.0, 0.0),
        velocity=unit(1e-4),
        origin=constants.NOMINAL,
        operator=Operator(),
        length=None,
        control="sampled",
        hardware=parts,
        stop_when_unstable=False,
        **kw,
    )


def cut(parts, **kw):
    return replace(hc.constant_cut(control="sampled", **kw), hardware=parts)


# ---- nothing, and seeds
# ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "kw",
    [dict(), dict(render="physical", operator=hc.Operator(), force=(2.0, 0.3)), dict(Ts=3 * TS)],
)
def test_an_ideal_interface_is_the_sampled_run_bit_for_bit(kw):
    kw = dict(clay=(0.02, 0.15), t_max=0.4) | kw
    a, b = hc.simulate(cut(None, **kw)), hc.simulate(cut(hc.Hardware(), **kw))
    assert a.crossings and a.crossings == b.crossings and a.energy == b.energy
    for name in ("t", "p", "v", "fh", "b", "q", "qd", "tau", "delta"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)
    if kw.get("render") == "physical":
        np.testing.assert_array_equal(a.fe, b.fe)
    elif (
        "Ts" not in kw
    ):  # what the motors hold, a hold later than b v only where the last step was cut short
        np.testing.assert_allclose(a.fe[:-1], b.fe[:-1], atol=8 * EPS)


def test_a_run_in_python_loads_nothing_that_compiles_or_readies_signals():
    code = (
        "import sys, hapticclay as hc; [hc.simulate(hc.constant_cut(t_max=0.01, control=x), "
        "engine='python') for x in ('continuous', 'sampled')]; "
        "print(*sorted(m.rpartition('.')[2] for m in sys.modules "
        "if m.startswith(('hapticclay.kernel.', 'hapticclay.native.', 'hapticclay.simulation.'))))"
    )
    run = [sys.executable, "-c", code]
    out = subprocess.run(run, capture_output=True, text=True, check=True)
    loaded = set(out.stdout.split())
    assert {"path", "run"} < loaded
    assert not loaded & {"machine", "many", "vectored", "signal_ahead"}


def test_random_effects_are_drawn_part_by_part(monkeypatch):
    """No run holds those of all its samples; return to a sample brings them back."""
    s = cut(hc.Hardware(jitter=5e-5, dropout_probability=0.1, force_noise=0.1), t_max=0.1)
    whole = hc.simulate(s)
    for module in (scene, runs):
        monkeypatch.setattr(module, "NOISE_AHEAD", 8)
    run = Run(s, 1)
    run.pause = 100
    run.go(None)
    early = run.snapshot()
    run.pause = 200
    run.go(None)
    assert 0 < run.row.m.chance_first <= 101 and len(run.row.arrays["chances"]) // 4 < 150
    run.return_to(early)
    run.pause = math.inf
    run.go(None)
    np.testing.assert_array_equal(run.arrays()["p"], whole.p)


def test_seeds_repeat_and_differ():
    parts = hc.Hardware(jitter=5e-5, dropout_probability=0.1, force_noise=0.1, seed=3)
    a, b, c = (hc.simulate(cut(x, t_max=0.1)) for x in (parts, parts, replace(parts, seed=4)))
    np.testing.assert_array_equal(a.p, b.p)
    np.testing.assert_array_equal(a.tau, b.tau)
    assert not np.array_equal(a.p, c.p)


def test_scenario_survives_the_record(tmp_path):
    parts = hc.Hardware(
        encoder=4096,
        velocity="difference",
        velocity_window=3,
        delay=1e-4,
        coupling=hc.Coupling(1e3, 10.0),
        friction=(0.01, 0.0),
        dac_bits=12,
        dac_range=(10.0, 5.0),
    )
    r = hc.simulate(cut(parts, t_max=0.01))
    r.save(tmp_path)
    again = hc.Record.load(tmp_path)
    assert again.scenario == r.scenario and again.energy == r.energy


@pytest.mark.parametrize(
    "kw,field",
    [
        (dict(jitter=-1.0), "hardware.jitter"),
        (dict(jitter=0.5 * TS), "hardware.jitter"),
        (dict(dropout_probability=1.0), "hardware.dropout_probability"),
        (dict(encoder=2.5), "hardware.encoder"),
        (dict(velocity="diff"), "hardware.velocity"),
        (dict(velocity_window=2), "hardware.velocity"),
        (dict(adc_bits=1), "hardware.adc_bits"),
        (dict(filter_order=3), "hardware.filter_order"),
        (dict(dac_range=(1.0,)), "hardware.dac_range"),
        (dict(delay=101 * TS), "hardware.delay"),
        (dict(friction=(-0.1, 0.0)), "hardware.friction[shoulder]"),
        (dict(coupling=3.0), "hardware.coupling"),
        (dict(passivity=1), "hardware.passivity"),
        (dict(seed=None), "hardware.seed"),
    ],
)
def test_bad_parts_are_refused(kw, field):
    with pytest.raises(ParameterError) as e:
        cut(hc.Hardware(**kw))
    assert e.value.field == field


def test_an_interface_needs_a_sampled_loop_and_a_controller_held_clay():
    with pytest.raises(ParameterError, match="sampled"):
        replace(hc.constant_cut(), hardware=hc.Hardware())
    with pytest.raises(ParameterError, match="held"):
        cut(hc.Hardware(passivity=True), render="physical")
    with pytest.raises(ParameterError):
        hc.Coupling(0.0, 1.0)


# ---- converters and encoder
# --------------------------------------------------------------------------------------


@given(st.floats(-20.0, 20.0), st.integers(2, 24), st.floats(0.1, 100.0))
def test_a_converter_is_off_by_half_a_level_and_ends_at_its_range(x, bits, span):
    level = 2.0 * span / 2**bits
    y = formula.quantize(x, bits, span)
    assert -span <= y <= span - level * (1.0 - 1e-12)
    if -span <= x <= span - level:
        assert abs(y - x) <= 0.5 * level * (1.0 + 1e-9)
    assert formula.quantize(y, bits, span) == y  # idempotent
    assert abs(y / level - round(y / level)) < 1e-6


@given(st.lists(st.floats(-10.0, 10.0), min_size=2, max_size=20), st.integers(2, 16))
def test_converters_are_monotone(xs, bits):
    ys = [formula.quantize(x, bits, 5.0) for x in sorted(xs)]
    assert ys == sorted(ys)


@pytest.mark.parametrize("bits", [12, 16])
def test_quantisation_error_has_the_variance_of_a_uniform_one(bits):
    rng = np.random.default_rng(0)
    x, level = rng.uniform(-4.0, 4.0, 40_000), 10.0 / 2**bits
    error = np.array([formula.quantize(v, bits, 5.0) for v in x]) - x
    # mean of n uniform errors: level/sqrt(12 n); variance of the squares: level^4/180; five sigma
    assert abs(error.mean()) < 5.0 * level / math.sqrt(12 * len(x))
    assert abs((error**2).mean() - level**2 / 12) < 5.0 * level**2 / math.sqrt(180 * len(x))


@given(st.floats() | st.sampled_from([2.0**52, -(2.0**52), 2.0**63, 1e308]), st.integers(2, 32))
def test_no_number_makes_a_converter_or_an_encoder_raise(x, bits):
    y = formula.quantize(x, bits, 5.0)
    assert -5.0 <= y < 5.0 or (math.isnan(x) and math.isnan(y))
    for step in (1.0, 1e-3, math.tau / 2**40):
        z = formula.round_to_even(x, step)
        if math.isfinite(x / step):  # half a step, and roundings of x
            assert abs(z - x) <= 0.5 * step * (1.0 + 1e-15) + 4e-16 * abs(x)
        else:
            assert math.isnan(z) == math.isnan(x)


SHAKEN = Profile((0.0, 0.05), (0.0, 0.0, 1.0), Fy=(1.0, 0.1, 0.1))


@pytest.mark.parametrize("render", ["held", "physical"])
@given(st.integers(0, 2**32 - 1))
@examples(8)
def test_a_run_that_overflows_has_an_outcome(render, seed):
    """Thrown by 1e4 to 1e6 N against motors of 1e6 N.m, a light hand, read by coarse converters.

    Half of these runs leave the numbers.
    """
    r = np.random.default_rng(seed)
    coarse = hc.Hardware(
        adc_bits=int(r.integers(2, 20)), adc_range=float(10 ** r.uniform(-2, 3)),
        dac_bits=9 if r.random() < 0.5 else None, velocity="difference",
        encoder=int(r.choice([4, 1000])) if r.random() < 0.5 else None,
    )  # fmt: skip
    s = replace(
        hc.free(), clay=Clay(SHAKEN, SHAKEN, isotropic=True), control="sampled", render=render,
        force=tuple(10 ** r.uniform(4, 6, 2) * r.choice([-1.0, 1.0], 2)), hardware=coarse,
        velocity=tuple(r.uniform(-10.0, 10.0, 2)), dt=0.02, t_max=1.5, length=None,
        operator=hc.Operator(float(10 ** r.uniform(-3, 1)), 0.0, 0.0), torque_limit=(1e6, 1e6),
        gain=tuple(10 ** r.uniform(-2, 5, 2)), stop_when_unstable=False,
    )  # fmt: skip
    found = hc.simulate(s, engine="python")
    assert found.outcome.code in {"out of reach", "diverged", "singular", "saturated", "time limit"}
    assert np.isfinite(found.p).all() and np.isfinite(found.tau).all()


def test_halves_go_to_the_even_level():
    assert [formula.round_to_even(x, 1.0) for x in (0.5, 1.5, 2.5, -0.5)] == [0.0, 2.0, 2.0, 0.0]
    assert formula.encode(math.tau * 3 / 1000, math.tau / 1000) == pytest.approx(
        math.tau * 3 / 1000, rel=1e-15
    )
    assert formula.encode(0.123, 0) == 0.123


def test_in_a_run_torques_lie_on_levels_within_the_range():
    r = hc.simulate(cut(hc.Hardware(dac_bits=8, dac_range=(2.0, 1.0)), t_max=0.2))
    levels = r.tau[:-1] / np.array([4.0, 2.0]) * 256
    np.testing.assert_allclose(levels, np.round(levels), atol=1e-9)
    assert len(np.unique(levels[:, 0])) > 3
    few = hc.simulate(cut(hc.Hardware(dac_bits=8, dac_range=(0.1, 1.0)), t_max=0.05))
    assert np.abs(few.tau[:, 0]).max() == 0.1


# ---- velocity ------------------------------------------------------------------------------------
# ----------------


@given(st.integers(1, 30), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(1e-4, 1e-2))
def test_difference_is_exact_for_constant_rates(window, w1, w2, Ts):
    for start, w in ((1.0, w1), (-0.5, w2)):
        found = formula.velocity_difference(-window, start - window * Ts * w, 0, start, Ts)
        assert found == pytest.approx(w, abs=16 * EPS / (window * Ts))


def test_window_divides_the_noise_of_an_encoder():
    """m samples hold n or n + 1 counts, the latter as often as the fraction f says:

    rms sqrt(f (1 - f)) of a count.
    """
    counts, Ts, w = 4096, 1e-3, 0.7391
    for m in (1, 4, 16):
        q = [formula.encode(w * k * Ts, math.tau / counts) for k in range(4000)]
        v = np.array(
            [formula.velocity_difference(k - m, q[k - m], k, q[k], Ts) for k in range(m, 4000)]
        )
        step = math.tau / counts / (m * Ts)
        np.testing.assert_allclose(v / step, np.round(v / step), atol=1e-6)
        assert np.abs(v - w).max() < step  # two roundings of half a count
        f = w / step % 1.0
        # equidistribution of n samples: discrepancy about log(n)/n
        assert np.sqrt(np.mean((v - w) ** 2)) == pytest.approx(
            step * math.sqrt(f * (1.0 - f)), rel=1e-2
        )


def test_velocity_filter_is_an_exact_first_order_lag_of_held_means():
    from scipy.signal import cont2discrete

    cutoff, Ts = 30.0, 1e-3
    w = math.tau * cutoff
    a = cont2discrete((np.array([[-w]]), np.array([[w]]), np.eye(1), np.zeros((1, 1))), Ts)
    rng, y, z = np.random.default_rng(1), 0.0, 0.0
    for u in rng.standard_normal(50):
        y, z = formula.low_pass(y, u, cutoff, Ts), float(a[0][0, 0] * z + a[1][0, 0] * u)
        assert y == pytest.approx(z, abs=1e-12)


def test_difference_lags_half_its_window_in_a_run():
    """Under a steady acceleration the mean over m samples is the rate m Ts/2 ago."""
    s = hc.free(control="sampled", t_max=0.02)
    for m in (1, 4):
        run = Run(replace(s, hardware=hc.Hardware(velocity="difference", velocity_window=m)), 1)
        shown = []
        for _ in range(run.row.m.last):
            run.advance(run.filled + 1)  # one step; the kick to its sample ended with e.w
            s_ = run.row.s
            shown.append((s_.e.w[:2], s_.now.w[:2]))
        true, seen = np.array([x[0] for x in shown]), np.array([x[1] for x in shown])
        late = np.array([np.mean(true[max(k - m, 0) : k + 1], axis=0) for k in range(len(true))])
        # trapezoid against the integral: second differences of the rate
        np.testing.assert_allclose(
            seen[m:], late[m:], atol=0.5 * np.abs(np.diff(true, axis=0)).max()
        )


# ---- force ---------------------------------------------------------------------------------------
# ----------------


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cutoff", [20.0, 500.0])
def test_filter_is_scipys_butterworth_discretised_exactly(order, cutoff):
    from scipy import signal

    f = hardware.butterworth(cutoff, order, TS)
    b, a = signal.butter(order, math.tau * cutoff, analog=True)
    n, d, _ = signal.cont2discrete((b, a), TS, method="zoh")
    u = np.random.default_rng(2).standard_normal(200)
    x, y = (0.0, 0.0), []
    for v in u:
        y.append(x[0])
        x = formula.filter_step(f, *x, v)
    np.testing.assert_allclose(
        y, signal.lfilter(n[0], d, u), atol=1e-9
    )  # polynomials of order 2 near z = 1
    still = (0.0, 0.0)
    for _ in range(20_000):
        still = formula.filter_step(f, *still, 1.0)
    assert still[0] == pytest.approx(1.0, rel=1e-9)


def test_noise_has_its_rms_and_each_part_its_own_stream():
    n = 20_000
    a, b = (
        hardware.SampleNoise(hc.Hardware(force_noise=0.3, dropout_probability=x, seed=5))
        for x in (0.0, 0.5)
    )
    noise = a.table(0, n)[:, 2:]
    assert np.all(np.abs(noise.std(axis=0) - 0.3) < 5 * 0.3 / math.sqrt(2 * n))
    assert np.abs(np.corrcoef(noise.T)[0, 1]) < 5 / math.sqrt(n)
    np.testing.assert_array_equal(b.table(0, 50)[:, 2:], noise[:50])


# ---- time ----------------------------------------------------------------------------------------
# ----------------


def test_jitter_is_uniform_of_its_rms_and_keeps_the_order():
    n, rms = 20_000, 0.28 * TS
    c = hardware.SampleNoise(hc.Hardware(jitter=rms))
    late = c.table(0, n)[:, 0]
    assert late[0] == 0.0 and np.all(np.diff(np.arange(n) * TS + late) > 0.0)
    assert abs(late.std() - rms) < 5 * rms / math.sqrt(
        5 * n
    )  # kurtosis 9/5: variance of the variance 4/5 rms^4/n
    assert abs(late.mean()) < 5 * rms / math.sqrt(n)


def test_lost_samples_hold_the_torque_as_often_as_they_should():
    p = 0.2
    r = hc.simulate(cut(hc.Hardware(dropout_probability=p), t_max=0.9))
    same = np.all(np.diff(r.tau[:-1], axis=0) == 0.0, axis=1)
    n = len(same)
    assert abs(same.mean() - p) < 5.0 * math.sqrt(p * (1.0 - p) / n)
    assert hc.simulate(cut(None, t_max=0.2)).outcome.code == "time limit"


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 2.7])
def test_torques_come_late_by_the_delay_to_the_step(delay):
    n = 5  # physics steps in a sample; 0.4 and 2.7 fall on the grid and off it
    s = cut(hc.Hardware(delay=delay * n * 1e-4), dt=1e-4, Ts=n * 1e-4, t_max=0.02)
    r = hc.simulate(s)
    changes = np.flatnonzero(np.any(np.diff(r.tau[:-1], axis=0) != 0.0, axis=1)) + 1
    first = math.ceil(delay * n - 1e-9)
    assert np.all((changes - first) % n == 0)
    assert changes[0] == (first or n)


@pytest.mark.parametrize(
    "axis,b,Ts,delay", [("x", 90.0, 1e-3, 0.0), ("y", 90.0, 2e-3, 2e-3), ("x", 300.0, 2e-3, 3.4e-3)]
)
def test_delayed_run_follows_the_lifted_map(axis, b, Ts, delay):
    """At the nominal pose the small motion of the arm is x(k+1) = M x(k), exact between samples."""
    K, i = 0.5, "xy".index(axis)
    less, beta, gamma = linear_loop.sampled_differences(
        hc.theory.Loop(axis, b, Operator(), Ts=Ts, delay=delay)
    )
    A = np.eye(len(less)) + less + K * np.outer(beta, gamma)
    r = hc.simulate(ring(axis, K, b, hc.Hardware(delay=delay), dt=Ts / 8, Ts=Ts, t_max=60 * Ts))
    x = np.zeros(len(A))
    lead = {"x": 41.8 / 910.19, "y": 30.3 / 765.5}[axis] * 1e-4
    x[[1, 2, 3, 5]] = 1e-4, lead, 1e-4, 1e-4
    p = []
    for _ in range(60):
        p.append(x[0])
        x = A @ x
    found = r.p[::8, i][:60]
    # second order in dt = Ts/8; the first sample of a run has no acceleration to measure
    np.testing.assert_allclose(found, p, atol=2e-3 * np.abs(p).max())


def growth(record, i, span):
    """Rate at which the swings of a recorded axis grow [1/s]: peaks of |v| of the last part."""
    v, t = record.v[:, i], record.t
    late = t > t[-1] - span
    v, t = v[late], t[late]
    turns = np.flatnonzero((v[1:-1] - v[:-2]) * (v[2:] - v[1:-1]) < 0.0) + 1
    sizes = np.abs(np.diff(v[turns]))
    return np.polyfit(0.5 * (t[turns][1:] + t[turns][:-1]), np.log(sizes), 1)[0]


@pytest.mark.parametrize("axis,b,Ts,delay", [("x", 90.0, 1e-3, 1.5e-3), ("y", 90.0, 1e-3, 1e-3)])
def test_the_run_decays_2_percent_inside_the_limit_and_grows_2_percent_outside(axis, b, Ts, delay):
    limit = hc.theory.gain_limit(axis, b, Operator(), Ts=Ts, delay=delay)
    found = []
    for factor in (0.98, 1.02):
        r = hc.simulate(ring(axis, factor * limit, b, hc.Hardware(delay=delay), dt=Ts, t_max=1.4))
        found.append(growth(r, "xy".index(axis), 0.8))
    assert found[0] < 0.0 < found[1]
    assert 0.0 < np.interp(0.0, found, [0.98, 1.02]) - 0.98 < 0.04


# ---- friction ------------------------------------------------------------------------------------
# ----------------


@given(
    st.tuples(st.floats(-1, 1), st.floats(-1, 1)),
    st.floats(0.1, 10.0),
    st.floats(0.1, 10.0),
    st.floats(-0.95, 0.95),
    st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
)
def test_friction_obeys_coulombs_law(w, a11, a22, share, limit):
    a12 = share * math.sqrt(a11 * a22)
    f = formula.coulomb_friction(w, a11, a12, a22, limit)
    after = (w[0] + a11 * f[0] + a12 * f[1], w[1] + a12 * f[0] + a22 * f[1])
    for j in (0, 1):
        assert abs(f[j]) <= limit[j]
        if abs(f[j]) < limit[j] * (1.0 - 1e-9):
            assert abs(after[j]) < 1e-12  # rests
        else:
            assert f[j] * after[j] <= 1e-12  # against the motion
    energy = sum(0.5 * f[j] * (w[j] + after[j]) for j in (0, 1))
    assert energy <= 1e-12  # a loss


def test_a_push_below_the_friction_does_not_move_the_arm_and_one_above_does():
    """At rest, without compensator, the motors give nothing:

    the hand's torques J'f against the limit.
    """
    s = replace(hc.free(control="sampled", t_max=0.3), gain=(0.0, 0.0), force=(0.1, 0.0))
    q = arm.inverse_kinematics(*s.origin, s.arm.links)
    u = arm.jacobian(*q, s.arm.links)
    tau = arm.joint_torques(0.1, 0.0, u)
    for factor, moves in ((1.01, False), (0.99, True)):
        parts = hc.Hardware(friction=(factor * abs(tau[0]), factor * abs(tau[1])))
        r = hc.simulate(replace(s, hardware=parts))
        assert (np.abs(r.p).max() > 1e-9) == moves


def test_friction_takes_its_torque_times_the_travel():
    limit = (0.02, 0.01)
    e = hc.simulate(cut(hc.Hardware(friction=limit), t_max=0.7))
    travel = np.abs(np.diff(e.q, axis=0)).sum(axis=0)
    assert travel.min() > 0.1
    # exact while a joint slides; half a step of it at the start and at the end
    assert e.energy["friction"] == pytest.approx(np.dot(limit, travel), rel=2e-3)
    assert abs(e.energy["residual"]) < 1e-12 * e.energy["throughput"]


def test_a_joint_that_friction_can_hold_rests_exactly_while_the_other_slides():
    s = replace(
        hc.free(control="sampled", t_max=0.2),
        gain=(0.0, 0.0),
        force=(0.0, 0.0),
        velocity=(0.05, 0.0),
        hardware=hc.Hardware(friction=(2.0, 2.0)),
    )
    r = hc.simulate(s)
    assert abs(r.qd[0, 1]) > 0.1
    assert np.abs(r.qd[50:, 1]).max() < 1e-14 and np.ptp(r.q[50:, 1]) < 1e-14 < 1e-3 < np.ptp(
        r.q[50:, 0]
    )


# ---- passivity observer and controller, coupling
# -----------------------------------------------------------------


@given(
    st.floats(-1e-3, 1.0),
    st.floats(0.0, 1e6),
    st.floats(-2.0, 2.0),
    st.floats(1e-5, 1e-2),
    st.floats(0.05, 5.0),
)
def test_the_controllers_force_is_never_active_in_the_hold(energy, b, v, Ts, W):
    f = formula.passivity_controller(energy, b * v, v, Ts, W)
    gain = Ts * f * (v - 0.5 * Ts * W * f)
    assert f * v >= 0.0
    best = 0.5 * v * v / W
    assert gain >= min(max(-energy, 0.0), best) - 1e-9 * best
    if energy >= 0.0 and b * Ts * W <= 1.999:
        assert f == b * v  # not needed, not there
    if v == 0.0:
        assert f == 0.0


@given(st.floats(-1e-6, -1e-9), st.floats(0.01, 1.0), st.floats(0.0, 0.99))
def test_for_short_samples_it_is_hannaford_and_ryus_damper(energy, v, share):
    Ts, W = 1e-4, 1e-6  # 2 W |energy| is below 1e-3 v^2
    need = -energy / (Ts * v)
    b = share * need / v  # which resists less
    assert formula.passivity_controller(energy, b * v, v, Ts, W) == pytest.approx(need, rel=1e-2)


@pytest.mark.parametrize("b", [8e3, 1e6])
def test_clay_too_stiff_for_its_hold_is_bounded_by_the_controller(b):
    kw = dict(b=b, start=(0.06, 0.0), gain=(1.0, 0.1), t_max=0.5)
    wild, tame = (hc.simulate(cut(hc.Hardware(passivity=x), **kw)) for x in (False, True))
    assert wild.outcome.code == "limit cycle" and wild.energy.keys().isdisjoint(
        ("passivity_controller",)
    )
    taken = np.cumsum(tame.fe[:-1] * np.diff(tame.p, axis=0), axis=0)
    assert tame.outcome.code == "time limit" and np.abs(tame.v).max() < 2e-3
    assert taken.min() >= -1e-12 * taken.max()
    assert tame.energy["passivity_controller"] < 0.0  # it took damping away
    assert abs(tame.energy["residual"]) < 1e-11 * tame.energy["throughput"]


@pytest.mark.parametrize(
    "parts",
    [
        dict(),
        dict(force_noise=0.1, adc_bits=12, dac_bits=12),
        dict(jitter=1e-5, dropout_probability=0.01),
    ],
)
def test_the_controller_leaves_passive_clay_alone(parts):
    kw = dict(t_max=0.5, clay=(0.02, 0.15))
    a, b = (hc.simulate(cut(hc.Hardware(passivity=x, **parts), **kw)) for x in (False, True))
    np.testing.assert_array_equal(a.p, b.p)
    assert b.energy["passivity_controller"] == 0.0


@pytest.mark.parametrize("parts", [dict(encoder=65536), dict(velocity="difference")])
def test_the_controller_acts_in_passive_clay_where_place_or_velocity_is_not_exact(parts):
    """On the idle axis, whose velocity passes zero: some 1e-7 J and 1e-6 m, of 5 N and 20 cm."""
    kw = dict(inertia_shaping=True, force=(5.0, 0.0))
    a, b = (hc.simulate(cut(hc.Hardware(passivity=x, **parts), **kw)) for x in (False, True))
    n = min(len(a.p), len(b.p))
    assert 0.0 < np.abs(a.p[:n] - b.p[:n]).max() < 1e-5
    assert 0.0 < b.energy["passivity_controller"] < 1e-6


@given(
    st.floats(0.0, 1e9),
    st.floats(1.0, 1e5),
    st.floats(0.1, 1e3),
    st.floats(-1.0, 1.0),
    st.floats(1e-5, 1e-2),
)
def test_through_a_coupling_no_clay_resists_more_than_its_spring_and_damper(b, k, d, v, Ts):
    tool, u = formula.virtual_coupling(0.0, 0.0, v, b, (k, d), Ts)
    assert abs(b * u) <= min(b, d + k * Ts) * abs(v) * (1.0 + 1e-12)
    assert b * u == pytest.approx(
        k * (0.0 - tool) + d * (v - u), abs=1e-9 * max(1.0, (d + k * Ts) * abs(v))
    )


def test_in_steady_motion_a_coupling_renders_the_clay_itself():
    tool, b, v, Ts = 0.0, 90.0, 0.1, 1e-3
    for i in range(3000):
        tool, u = formula.virtual_coupling(tool, (i + 1) * Ts * v, v, b, (2e3, 20.0), Ts)
    assert b * u == pytest.approx(b * v, rel=1e-9)


@given(
    st.floats(0.01, 10.0),
    st.floats(0.01, 4.0),
    st.floats(-4.0, 6.0),
    st.floats(0.1, 10.0),
    st.floats(1e-5, 1e-2),
)
def test_a_coupling_is_stable_in_all_clay_if_its_damper_pays_for_the_hold(k, d, decades, m, Ts):
    """k Ts/2 < d < 2 m/Ts, on a bare handle of mass m; in the hardest clay also only if."""
    spring, damper = k * m / Ts**2, d * m / Ts

    def radius(b):
        p, v = np.eye(2)  # place of the handle from the tool, and velocity, exact between samples
        on_tool = np.array(
            [
                formula.virtual_coupling(0.0, *unit, b, (spring, damper), Ts)[1]
                for unit in np.eye(2).tolist()
            ]
        )
        force = b * on_tool
        moved = p + Ts * v - 0.5 * Ts**2 / m * force - Ts * on_tool
        slowed = v - Ts / m * force
        return np.abs(np.linalg.eigvals(np.array([moved, slowed]))).max()

    paid = 0.5 * k < d < 2.0
    if paid:
        assert radius(10.0**decades * m / Ts) < 1.0 + 1e-9  # rounding of eigenvalues near 1
    elif not 0.5 * k < 1.01 * d < 2.05:  # 1 % beyond the border, far above rounding
        assert radius(1e9 * m / Ts) > 1.0


def test_a_coupling_bounds_clay_of_any_stiffness_and_its_energy_is_kept():
    kw = dict(b=1e8, start=(0.06, 0.0), gain=(1.0, 0.1), t_max=0.4)
    r = hc.simulate(cut(hc.Hardware(coupling=hc.Coupling(3000.0, 300.0)), **kw))
    assert r.outcome.code == "time limit" and np.abs(r.v).max() < 5e-3
    assert r.energy["coupling"] > 0.0 and abs(r.energy["residual"]) < 1e-11 * r.energy["throughput"]
    assert hc.simulate(cut(hc.Hardware(), **kw)).outcome.code == "limit cycle"


# ---- all of it -----------------------------------------------------------------------------------
# ----------------


def test_the_constant_cut_runs_through_an_encoder_converters_delay_and_hold():
    parts = hc.Hardware(
        encoder=65536, velocity="difference", velocity_window=16, adc_bits=12, dac_bits=12, delay=TS
    )
    r = hc.simulate(cut(parts, inertia_shaping=True, force=(4.0, 0.0)))
    assert r.outcome.code == "finished"
    inside = (r.p[:, 0] > 0.08) & (r.p[:, 0] < 0.14)
    v, fe = r.v[inside, 0].mean(), r.fe[inside, 0].mean()
    assert fe / v == pytest.approx(90.0, rel=0.02)


def test_published_resolution_page_was_made_from_the_published_data():
    folder = Path(__file__).parents[2]
    from benchmarks import resolution

    rows = json.loads((folder / "docs" / "bench" / "resolution.json").read_text())["rows"]
    page = (folder / "docs" / "bench" / "resolution.md").read_text()
    assert resolution.page(rows).split("## Machine")[0] == page.split("## Machine")[0]
    assert all(r["status"] == "finished" for r in rows)
    fine = [r for r in rows if r["counts"] and r["counts"] >= 65536]
    assert all(
        r["rms"] < 0.5 * r["least"] for r in fine
    )  # n or n + 1 counts in a window: half a count at most
    assert all(abs(r["mean"]) < 1e-3 for r in fine)


def test_resolution_is_measured(monkeypatch):
    from benchmarks import resolution

    monkeypatch.setattr(resolution, "WITHIN", (0.052, 0.058))
    monkeypatch.setattr(resolution, "END", 0.059)
    row = resolution.run(262144, 16)
    assert row["status"] == "finished" and 1e-4 < row["rms"] < 0.5  # still slowing down


@pytest.mark.parametrize("cutoff", [None, 10.0, 30.0, 300.0])
def test_the_lag_of_a_velocity_is_that_of_the_page(cutoff):
    """docs/velocity_filter.md: of p = t^2/2 the estimate is t less the lag, Ts/2 + Ts a/(1 - a)."""
    Ts, y, lag = 1e-3, 0.0, 5e-4
    for k in range(1, 2001):
        p, old = (0.5 * (i * Ts) ** 2 for i in (k, k - 1))
        w = formula.velocity_difference(k - 1, old, k, p, Ts)
        y = w if cutoff is None else formula.low_pass(y, w, cutoff, Ts)
    if cutoff is not None:
        a = math.exp(-math.tau * cutoff * Ts)
        lag += Ts * a / (1.0 - a)
        assert lag == pytest.approx(1.0 / (math.tau * cutoff), rel=(math.tau * cutoff * Ts) ** 2)
    # positions of 2 s^2 divided by Ts: a few hundred eps / Ts
    assert 2000 * Ts - y == pytest.approx(lag, abs=400 * EPS / Ts)
