"""Lost packets, spikes, repeated values and wrong signs: left out, counted, named.

Motions and forces are closed forms; what is put in is known, sample by sample.
"""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.studies.outliers import cleaned
from hapticclay.studies.sliding import quantum
from tests.hunt import examples, some

N, DT = 3000, 2e-3
T = DT * np.arange(N)
V = 0.066 * np.cos(2.2 * T) + 0.0828 * np.cos(6.9 * T + 0.4)
P = 0.35 + 0.03 * np.sin(2.2 * T) + 0.012 * np.sin(6.9 * T + 0.4)
LAWS = {
    "Bingham": hc.Flow(Fy=2.0, b=30.0),
    "viscous": hc.Flow(b=60.0),
    "Coulomb": hc.Flow(Fy=5.0),
    "Herschel-Bulkley": hc.Flow(Fy=3.0, K=15.0, n=0.5),
}
REVERSALS = np.flatnonzero(np.diff(np.sign(V))) + 1  # first sample of each new direction


def log(law="Bingham", seed=1):
    """Positions with 2 um and forces with 0.05 N of noise."""
    rng = np.random.default_rng(seed)
    f = LAWS[law].force(V) + 0.05 * rng.standard_normal(N)
    return rng, P + 2e-6 * rng.standard_normal(N), f


def anywhere(rng, count, length=1):
    """Starts of runs of samples, none beside another, away from the ends."""
    starts = rng.permutation(np.arange(30, N - 60, 60))[:count]
    return np.sort(starts + rng.integers(0, 20, len(starts))), length


def spikes(size, count):
    def spoil(rng, p, f):
        at, _ = anywhere(rng, count)
        p[at] = 0.0 if size == 0.0 else p[at] + size
        return count, 0

    return spoil


def force_spikes(size, count):
    def spoil(rng, p, f):
        at, _ = anywhere(rng, count)
        f[at] += size
        return 0, count

    return spoil


def lost(length, held):
    """Packets that are lost: both columns read 0, or repeat their last values."""

    def spoil(rng, p, f):
        at, _ = anywhere(rng, 10)
        for i in at.tolist():
            p[i : i + length] = p[i - 1] if held else 0.0
            f[i : i + length] = f[i - 1] if held else 0.0
        return None

    return spoil


def wrong_signs(after):
    """The force keeps its old sign for some samples after each reversal."""

    def spoil(rng, p, f):
        for i in REVERSALS.tolist():
            f[i : i + after] *= -1.0
        return None

    return spoil


SPOILT = {
    "one position read as 0": spikes(0.0, 1),
    "two positions read as 0": spikes(0.0, 2),
    "30 read as 0": spikes(0.0, 30),
    "10 off by 0.2 mm": spikes(2e-4, 10),
    "30 off by 5 mm": spikes(5e-3, 30),
    "one off by 10 m": spikes(10.0, 1),
    "one force of 1e4 N": force_spikes(-1e4, 1),
    "30 forces off by 3 N": force_spikes(3.0, 30),
    "packets of 5 lost": lost(5, False),
    "packets of 12 lost": lost(12, False),
    "packets of 40 lost": lost(40, False),
    "packets of 5 repeated": lost(5, True),
    "packets of 20 repeated": lost(20, True),
    "3 wrong signs at reversals": wrong_signs(3),
    "12 wrong signs at reversals": wrong_signs(12),
}


CASES = [("Bingham", spoilt) for spoilt in SPOILT] + [
    (law, spoilt)
    for law in ("viscous", "Coulomb", "Herschel-Bulkley")
    for spoilt in ("one position read as 0", "3 wrong signs at reversals")
]


@pytest.mark.parametrize(("law", "spoilt"), some(CASES, 14))
def test_the_true_law_is_chosen_from_a_spoilt_log(law, spoilt):
    """Those that are left out are those that were spoilt, and a sentence counts them.

    Each parameter within five half intervals of 0.95: never by chance.
    """
    rng, p, f = log(law)
    counts = SPOILT[spoilt](rng, p, f)
    fitted = hc.studies.fit_flow(hc.studies.Measurement(T, f, p))
    assert fitted.law == law, fitted.warnings
    for x in fitted.parameters:
        assert abs(x.value - getattr(LAWS[law], x.name)) < 2.5 * (x.high - x.low), x
    assert fitted.force_noise == pytest.approx(0.05, rel=0.1)  # 4 deviations of 3000: 5 %
    assert fitted.position_noise == pytest.approx(2e-6, rel=0.5)
    assert fitted.warnings
    if counts is not None:
        assert (len(fitted.position_outliers), len(fitted.force_outliers)) == counts
        for column, count in zip(("position", "force"), counts, strict=True):
            assert (f"{count} of {N} {column}" in " ".join(fitted.warnings)) == (count > 0)


def test_wrong_signs_are_called_so():
    rng, p, f = log()
    wrong_signs(3)(rng, p, f)
    told = " ".join(hc.studies.fit_flow(hc.studies.Measurement(T, f, p)).warnings)
    assert "of them drive the motion: wrong signs" in told


def test_a_clean_log_loses_no_sample_and_gets_no_warning():
    for law in LAWS:
        _, p, f = log(law)
        fitted = hc.studies.fit_flow(hc.studies.Measurement(T, f, p))
        assert fitted.law == law and fitted.warnings == ()
        assert fitted.position_outliers == fitted.force_outliers == ()


def test_a_position_that_jumps_for_good_parts_the_motion():
    """As by a lost count: the same law before and after, and a sentence."""
    _, p, f = log()
    p[1500:] += 0.02
    fitted = hc.studies.fit_flow(hc.studies.Measurement(T, f, p))
    assert fitted.law == "Bingham" and fitted.position_noise == pytest.approx(2e-6, rel=0.5)
    assert any("does not return at t = 3 s" in x for x in fitted.warnings)


@examples(20)
@given(
    st.integers(0, 10**6),
    st.sampled_from([0.0, 1e-6, 3e-5]),
    st.sampled_from([0.0, 2e-5]),
    st.sampled_from([(1.0, 12.0), (0.4, 3.0)]),
)
def test_a_smooth_column_stays_as_it_is(seed, noise, count, band):
    """Of sines up to a twentieth of the sampling rate, noisy or rounded: no outlier, same bits."""
    rng = np.random.default_rng(seed)
    omega = 2.0 * np.pi * rng.uniform(band[0], band[1], 4)
    x = 0.01 * np.sin(omega * T[:, None] + rng.uniform(0.0, 6.3, 4)) @ rng.uniform(0.3, 1.0, 4)
    x = x + noise * rng.standard_normal(N)
    x = count * np.round(x / count) if count else x
    found = cleaned(x, quantum(x))
    assert not found.bad.any() and not len(found.steps)
    np.testing.assert_array_equal(found.x, x)


@examples(20)
@given(st.integers(0, 10**6), st.integers(1, 20), st.floats(0.1, 1e3), st.booleans())
def test_what_was_put_in_is_found(seed, length, size, away):
    """Departures from 100 times the noise on; what replaces them lies within 30 of it."""
    rng = np.random.default_rng(seed)
    noise = 1e-5
    x = P + noise * rng.standard_normal(N)
    at, bad = anywhere(rng, 8)[0], np.zeros(N, dtype=bool)
    for i in at.tolist():
        bad[i : i + length] = True
    spoilt = np.where(bad, size if away else x + 0.01 * size, x)
    found = cleaned(spoilt)
    np.testing.assert_array_equal(found.bad, bad)
    assert np.max(np.abs(found.x - P)) < 30.0 * noise and not len(found.steps)


def test_a_hit_is_no_jump():
    """The velocity turns at once, 0.1 m/s to -0.05 m/s, and the position has a corner."""
    rng = np.random.default_rng(3)
    x = np.where(T < 3.0, 0.1 * (T - 3.0), -0.05 * (T - 3.0)) + 1e-7 * rng.standard_normal(N)
    found = cleaned(x)
    assert not found.bad.any() and not len(found.steps)


def test_the_command_names_what_it_left_out(tmp_path, capsys):
    rng, p, f = log()
    p[1250] = 0.0
    file = tmp_path / "log.csv"
    np.savetxt(file, np.column_stack((T, f, p)), "%.9g", ",", header="t,f,p", comments="")
    words = ["fit", str(file), "--columns", "t=t", "p=p", "f=f", "--out", str(tmp_path / "out")]
    assert app.main([*words, "--dpi", "40"]) == 0
    out = capsys.readouterr().out
    assert f"warning: 1 of {N} positions is left out, at t = 2.5 s" in out
    assert out.startswith("law") and "\nBingham " in out
    summary = json.loads((tmp_path / "out/fit.json").read_text())
    assert summary["position_outliers"] == [2.5] and summary["force_outliers"] == []


# ---- identification ------------------------------------------------------------------------------

DEVICE = (10.0, 5.0, 200.0)  # gain [1/kg], damping [1/s], stiffness [1/s^2]


def pushed(kind, seed=1):
    """Force and position of a device: exact for held forces, by the matrix exponential."""
    from scipy.linalg import expm

    rng = np.random.default_rng(seed)
    if kind == "multisine":
        f = 0.25 * np.arange(2, 70)
        u = 0.05 * np.cos(2.0 * np.pi * np.outer(T, f) + rng.uniform(0.0, 6.3, len(f))).sum(axis=1)
    else:
        u = np.zeros(N)  # blows
        for i in range(100, N, 500):
            u[i : i + 5] = rng.uniform(5.0, 10.0)
    gain, damping, stiffness = DEVICE
    A = np.array([[0.0, 1.0, 0.0], [-stiffness, -damping, gain], [0.0, 0.0, 0.0]])
    E = expm(A * DT)
    y, state = np.zeros(N), np.zeros(2)
    for i in range(N):
        y[i] = state[0]
        state = E[:2, :2] @ state + E[:2, 2] * u[i]
    return rng, u, y + 1e-5 * rng.standard_normal(N)


def identified(u, y):
    data = hc.studies.Measurement(T, u, y)
    return hc.studies.identify_data(data, "S", band=(0.5, 15.0), held=True)


def close(found):
    """Within five half intervals, and these within a few percent."""
    for c, x in zip(found.coefficients, DEVICE, strict=True):
        assert abs(c.value - x) < 2.5 * (c.high - c.low) and c.high - c.low < 0.05 * x, c


@pytest.mark.parametrize("kind", ["multisine", "blows"])
def test_a_device_is_identified_from_spoilt_positions(kind):
    rng, u, y = pushed(kind)
    clean = identified(u, y)
    close(clean)
    assert clean.warnings == ()  # a blow is no outlier: the position follows it
    y[1250], y[2000:2010] = 0.5, -0.35
    found = identified(u, y)
    close(found)
    assert f"11 of {N} positions are left out" in found.warnings[0]


@pytest.mark.parametrize("kind", ["multisine", "blows"])
def test_a_force_that_the_position_does_not_follow_is_left_out(kind):
    rng, u, y = pushed(kind)
    u[1250] = 50.0
    found = identified(u, y)
    close(found)
    assert f"1 of {N} forces is left out, at t = 2.5 s" in found.warnings[0]


def test_a_device_is_printed_with_units(tmp_path, capsys):
    """1/gain, damping/gain and stiffness/gain, in kg, N.s/m and N/m; and the warning."""
    rng, u, y = pushed("multisine")
    y[1250] = 0.5
    file = tmp_path / "device.csv"
    table = np.column_stack((T, u, y))
    np.savetxt(file, table, "%.12g", ",", header="t,input,output", comments="")
    words = ["identify", "--csv", str(file), "--what", "S", "--held", "--band", "0.5", "15"]
    assert app.main([*words, "--dpi", "40", "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    assert "as a device: mass 0.1" in out or "as a device: mass 0.0999" in out
    assert " kg, damper " in out and " N.s/m, spring " in out and " N/m" in out
    assert f"warning: 1 of {N} positions is left out" in out
    assert json.loads((tmp_path / "out/identify.json").read_text())["results"][0]["warnings"]
    assert identified(u, y).device == pytest.approx((0.1, 0.5, 20.0), rel=0.02)
