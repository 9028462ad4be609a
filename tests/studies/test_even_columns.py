"""Rows at uneven times: what is done to them, and that the columns are those of an even clock."""

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.studies.even_columns import even_columns, unwrapped

N, STEP = 2000, 0.002
T = STEP * np.arange(N)


def motion(t):
    """A smooth motion and force, to 15 Hz."""
    x = sum(np.sin(2.0 * np.pi * f * t + f * f) / f for f in (0.7, 2.3, 5.1, 9.7, 15.0))
    y = sum(np.cos(2.0 * np.pi * f * t + 3.0 * f) / f**2 for f in (0.7, 2.3, 5.1, 9.7, 15.0))
    return np.asarray(x), np.asarray(y)


def made(t, true=None, keep=None, **more):
    """Columns even again, of a motion seen at `true` times and stamped at t."""
    x, y = motion(t if true is None else true)
    rows = {"t": t, "input": x, "output": y}
    if keep is not None:
        rows = {k: v[keep] for k, v in rows.items()}
    return even_columns(rows, **more)


def check(found, tolerance, shift=0.0):
    c = found.columns
    hc.studies.Measurement(**c)  # which refuses uneven steps
    x, y = motion(c["t"] + shift)
    assert np.max(np.abs(c["input"] - x)) < tolerance
    assert np.max(np.abs(c["output"] - y)) < tolerance


def test_even_rows_are_as_they_were():
    found = made(T)
    assert found.notes == ()
    np.testing.assert_array_equal(found.columns["t"], T)
    x, y = motion(T)
    np.testing.assert_array_equal(found.columns["input"], x)
    np.testing.assert_array_equal(found.columns["output"], y)


@pytest.mark.parametrize("jitter", [0.1, 0.3, 0.45])
def test_rows_sampled_at_uneven_times_are_resampled(jitter):
    """Cubic splines: an error of some (omega h)^4/384, here 0.19^4/384 = 3e-6 at 15 Hz, and with
    steps of up to twice the usual one 16 times this, of sines of size 1 to 1/15. Rows less than a
    quarter of a step apart are averaged: (0.19/4)^2/8 of the sine of size 1/15 that moves fastest.
    """
    t = T + STEP * np.random.default_rng(1).uniform(-jitter, jitter, N)
    found = made(t)
    assert "resampled by cubic splines onto " in found.notes[-1]
    check(found, 2e-5 if jitter < 0.4 else 5e-5)


def test_even_rows_that_were_stamped_on_arrival_keep_their_rows():
    late = STEP * np.random.default_rng(2).exponential(0.4, N)
    found = made(np.maximum.accumulate(T + late) + 1e-9 * np.arange(N), true=T)
    assert "were sampled evenly and stamped later" in found.notes[-1]
    c = found.columns
    np.testing.assert_array_equal(c["output"], motion(T)[1])
    # the mean step: 2000 stamps with a deviation of 0.4 steps
    assert np.ptp(c["t"]) == pytest.approx(np.ptp(T), rel=1e-4)


@pytest.mark.parametrize("place", [5e-3, 4e-3, 0.015625])
def test_stamps_that_are_rounded_to_a_step_or_two_are_even(place):
    found = made(np.floor(T / place + 1e-9) * place, true=T)
    assert "stamps are rounded" in found.notes[0]
    # a line through rounded stamps, which are early by half a tick: 0.1 of a tick off by the ends
    check(found, 94.0 * 0.1 * place, shift=0.5 * place)


def test_few_missing_rows_are_bridged():
    keep = np.ones(N, dtype=bool)
    keep[[100, 101, 102, 700, 1300, 1301]] = False
    found = made(T, keep=keep)
    assert "6 rows are missing in 3 gaps" in found.notes[0] and "bridged" in found.notes[0]
    assert len(found.columns["t"]) == N
    check(found, 1e-3)  # three rows, 4 steps: (4 * 0.19)^4/384 of the fastest sine


def test_the_longest_part_without_a_long_gap_is_used():
    keep = np.ones(N, dtype=bool)
    keep[600:700] = False
    found = made(T, keep=keep)
    assert "the longest part without is used, 1300 of 1900 rows" in found.notes[0]
    np.testing.assert_array_equal(found.columns["output"], motion(T)[1][700:])


def test_rows_that_repeat_or_came_out_of_order():
    rng = np.random.default_rng(3)
    order = np.sort(np.concatenate((np.arange(N), rng.integers(0, N, 12))))
    x, y = motion(T)
    rows = {"t": T[order], "input": x[order], "output": y[order]}
    found = even_columns(rows)
    assert "are left out: 12" in found.notes[0] and len(found.columns["t"]) == N
    order = np.arange(N)
    order[[400, 401, 900, 901]] = [401, 400, 901, 900]
    found = even_columns({"t": T[order], "input": x[order], "output": y[order]})
    assert "sorted by their stamps: 2" in found.notes[0]
    np.testing.assert_array_equal(found.columns["output"], y)
    with pytest.raises(hc.ParameterError, match="two logs in one file"):
        even_columns({"t": np.concatenate((T[:1000], T[:1000])), "input": x, "output": y})


@pytest.mark.parametrize("modulus", [65.536, 4294.967296, 4294967.296])
def test_clocks_that_begin_again(modulus):
    """Counters of 16 and 32 bits, in milliseconds and microseconds."""
    start = modulus - 1.5
    found = made((start + T) % modulus, true=T)
    assert "the clock begins again" in found.notes[0]
    c = found.columns
    # differences of numbers of the size of the modulus
    np.testing.assert_allclose(c["t"] - c["t"][0], T, atol=1e-9)


@pytest.mark.parametrize("turn", [2.0 * np.pi, 360.0, 256.0, 4096.0, 65536.0])
def test_encoders_that_begin_again(turn):
    x = turn * (0.9 + 1.7 * np.sin(2.0 * T))
    x = np.round(x) if turn >= 256.0 else x
    found, size, at = unwrapped(x % turn)
    assert size == turn and len(at) == np.count_nonzero(np.diff(np.floor(x / turn)))
    # differences of numbers of the size of a turn
    np.testing.assert_allclose(found - found[0], x - x[0], atol=1e-12 * turn)


@pytest.mark.parametrize(
    "x",
    [
        np.sin(3.0 * T),
        0.0 * T,
        0.25 * (np.arange(N) % 28),  # 0 to 6.75, a saw
        250.0 * (np.arange(N) % 5),
        np.where(np.arange(N) % 400 < 200, 0.0, 6.2832),  # a switch
        np.where(np.arange(N) == 700, 0.0, 5.0 + 0.01 * np.sin(T)),  # a lost packet
        180.0 * np.sin(T),
    ],
)
def test_positions_that_do_not_begin_again_are_left(x):
    found, _, at = unwrapped(x)
    assert not len(at)
    np.testing.assert_array_equal(found, x)


def test_an_input_that_is_held_from_stamp_to_stamp():
    """Its means, held again, are its action: the integral is kept, against finer steps."""
    rng = np.random.default_rng(4)
    t = T + STEP * rng.uniform(-0.4, 0.4, N)
    u = np.convolve(rng.standard_normal(N + 30), np.ones(31) / 31.0, "valid")
    found = even_columns({"t": t, "input": u, "output": motion(t)[1]}, "hold").columns
    own = np.concatenate(([0.0], np.cumsum(u[:-1] * np.diff(t))))
    step = found["t"][1] - found["t"][0]
    other = np.concatenate(([0.0], np.cumsum(found["input"] * step)))
    at = found["t"][0] + step * np.arange(len(other))
    # the sharpening moves the integral by the change of a first difference, a twelfth of it
    off = np.interp(at, t, own)[:-1] - other[:-1]
    assert np.max(np.abs(off)) < 0.1 * step * np.max(np.abs(np.diff(u)))


def test_a_log_with_jitter_gives_the_device(tmp_path):
    """0.5 kg, 4 N.s/m, 100 N/m by the exact response at uneven times; sampled and stamped so."""
    rng = np.random.default_rng(5)
    t = 0.002 * (np.arange(6000) + rng.uniform(-0.3, 0.3, 6000))
    lines = np.arange(3, 180) / 11.0  # [Hz]
    phase = rng.uniform(0.0, 2.0 * np.pi, len(lines))
    s = 2j * np.pi * lines
    H = 1.0 / (0.5 * s**2 + 4.0 * s + 100.0)
    wave = np.exp(1j * (2.0 * np.pi * np.outer(t, lines) + phase))
    force, place = (wave.sum(axis=1)).real, (wave @ H).real
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack((t, force, place)), "%.9g", ",", header="t,f,x", comments="")
    with pytest.raises(hc.ParameterError, match="steps must be within"):
        hc.studies.Measurement(t, force, place)
    found = hc.studies.identify_data(hc.studies.Measurement.load(path), "S", band=(0.3, 12.0))
    assert any("resampled" in x for x in found.warnings)
    for value, true in zip(found.device, (0.5, 4.0, 100.0), strict=True):
        assert value == pytest.approx(true, rel=2e-3)
    again = hc.studies.Measurement.resampled(t, force, place)
    own = hc.studies.identify_data(again, "S", band=(0.3, 12.0))
    assert own.values == pytest.approx(found.values, rel=1e-5)  # nine digits in the file


@pytest.mark.parametrize("what", ["S", "Th"])
@pytest.mark.parametrize("delay", [3e-3, -2e-3, 0.0])
def test_a_delay_between_the_columns_is_named_and_removed(what, delay):
    """0.5 kg, 4 N.s/m, 100 N/m, by the exact response to many lines, and noise of 1 %."""
    rng = np.random.default_rng(6)
    t = 0.002 * np.arange(6000)
    f = np.arange(4, 170) / 13.0
    s = 2j * np.pi * f
    Z = 0.5 * s**2 + 4.0 * s + 100.0
    waves = np.exp(np.outer(t, s)) * np.exp(1j * rng.uniform(0.0, 6.28, len(f)))
    force = (waves @ Z if what == "Th" else waves.sum(axis=1)).real
    place = (waves @ ((1.0 if what == "Th" else 1.0 / Z) * np.exp(-s * delay))).real
    force = -force if what == "Th" else force
    noisy = force if what == "Th" else place
    noisy += 0.01 * np.std(noisy) * rng.standard_normal(len(t))
    data = hc.studies.Measurement(t, force, place)
    found = hc.studies.identify_data(data, what, band=(0.4, 12.0))
    said = [x for x in found.warnings if x.startswith("the force acts")]
    assert bool(said) == bool(delay), found.warnings
    if delay:
        assert ("later" if delay > 0.0 else "earlier") in said[0]
        rows, ms, half = (float(x.strip("(),")) for x in np.array(said[0].split())[[3, 5, 8]])
        assert rows == pytest.approx(ms / 2.0, rel=0.01)  # three digits
        # of a normal estimate, 3.5 deviations; the digits that are printed
        assert abs(ms - 1e3 * abs(delay)) < 1.8 * half + 0.005 * ms
    r = hc.studies.identify_data(data, what, band=(0.4, 12.0), delay=delay)
    for value, true in zip(r.device, (0.5, 4.0, 100.0), strict=True):
        assert value == pytest.approx(true, rel=0.01)  # noise of 1 %
    assert not any(x.startswith("the force acts") for x in r.warnings)


def test_a_motion_about_an_axis(tmp_path):
    """Counts of an encoder and torques in mN.m: 2e-3 kg.m^2, 0.02 N.m.s/rad, 0.8 N.m/rad."""
    rng = np.random.default_rng(7)
    t = 0.002 * np.arange(6000)
    f = np.arange(4, 170) / 13.0
    s = 2j * np.pi * f
    Z = 2e-3 * s**2 + 0.02 * s + 0.8
    waves = np.exp(np.outer(t, s)) * np.exp(1j * rng.uniform(0.0, 6.28, len(f)))
    torque, angle = 0.05 * waves.sum(axis=1).real, 0.05 * (waves @ (1.0 / Z)).real
    turns = np.round(2.0 + angle * 65536 / (2.0 * np.pi))
    path = tmp_path / "knob.csv"
    head = "t,torque [mNm],q [counts]"
    np.savetxt(
        path, np.column_stack((t, 1e3 * torque, turns)), "%.9g", ",", header=head, comments=""
    )
    data = hc.studies.Measurement.load(path, counts={"q": 65536})
    r = hc.studies.identify_data(data, "S", band=(0.4, 12.0))
    assert r.rotary and r.response_unit == "rad/(N.m)" and r.warnings == ()
    assert [c.unit for c in r.coefficients] == ["1/(kg.m^2)", "1/s", "1/s^2"]
    # a count is 1e-4 rad of some 0.3
    for value, true in zip(r.device, (2e-3, 0.02, 0.8), strict=True):
        assert value == pytest.approx(true, rel=5e-3)
    assert "rad/(N" in r.plot().axes[0].get_ylabel()
    with pytest.raises(hc.ParameterError, match="along a line"):
        hc.studies.fit_flow(data)
    with pytest.raises(hc.ParameterError, match="only 'torque"):
        hc.studies.Measurement.load(path, units={"q": "mm"})


@pytest.mark.parametrize(
    "head, size", [("t", 1.0), ("t", 1e3), ("t", 1e6), ("stamp", 1e9), ("t [ms]", 1e3)]
)
def test_dates_since_1970_are_taken_from_their_start(head, size, tmp_path):
    x, y = motion(T)
    whole = [f"{round(size * 1.7e9) + size * t:.6f}" for t in T]
    rows = [f"{t},{a!r},{b!r}" for t, a, b in zip(whole, x.tolist(), y.tolist(), strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([f"{head},f,p", *rows]))
    data = hc.studies.Measurement.load(tmp_path / "a.csv")
    # doubles near 1.7e9 s have steps of 2.4e-7 s
    np.testing.assert_allclose(data.t, T, atol=3e-7)
    assert "since 1970" in data.notes[0]
    samples = hc.Samples.of(tmp_path / "a.csv", (head, "f", "p"))
    np.testing.assert_allclose(samples.t, T, atol=3e-7)
