"""G, Sh and Th come back from measured columns, whatever drives them; bad columns are named.

The data are made by SciPy alone: exact samples of the printed forms under a drive that is held or
goes in straight lines between samples, plus noise.
"""

import csv
import json

import numpy as np
import pytest
from scipy import signal

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.studies import identification
from tests.hunt import HUNTS

DT = 1e-3
PRINTED = {"G": (910.19, 41.8, 910.19), "S": (0.131, 32.4, 492.46), "Th": (0.25, 2.0, 6.0)}
AXIS = {"G": "x", "S": "y", "Th": "y"}
TOP = {"G": 10.0, "S": 10.0, "Th": 2.0}  # highest frequency of the drive [Hz]
SIZE = {"G": 2e-3, "S": 2.0, "Th": 0.01}  # rms of the drive: [m], [N], [m]
KINDS = ("multisine", "noise", "chirp", "steps")


def drive(kind, seconds, top, rng, dt):
    """Time and a signal of rms 1."""
    n = round(seconds / dt)
    t = np.arange(n) * dt
    if kind == "multisine":  # four periods
        period = n // 4
        k = np.unique(np.round(np.geomspace(1, top * period * dt, 40)).astype(int))
        phase = rng.uniform(0, 2 * np.pi, len(k))
        x = np.cos(2 * np.pi * np.outer(np.arange(n), k) / period + phase).sum(axis=1)
    elif kind == "noise":
        x = signal.lfilter(*signal.butter(2, 2 * top * dt), rng.normal(size=n))
    elif kind == "chirp":
        x = signal.chirp(t, 0.2, seconds, top, "logarithmic", rng.uniform(0, 360))
    else:  # both signs in turn or not, for half a second each
        each = round(5.0 / top / dt)
        x = np.repeat(rng.choice([-1.0, 1.0], n // each + 1), each)[:n]
    return t, x / np.std(x)


def second_order(c, u, t, held, also=((1.0, 0.0, 0.0),)):
    """Output of c[0]/(s^2 + c[1] s + c[2]) for u; rows of `also` mix p, v and the acceleration."""
    A, B = np.array([[0.0, 1.0], [-c[2], -c[1]]]), np.array([[0.0], [c[0]]])
    out = np.array(also) @ np.array([[1.0, 0.0], [0.0, 1.0], [-c[2], -c[1]]])
    through = np.array(also) @ np.array([[0.0], [0.0], [c[0]]])
    *discrete, _ = signal.cont2discrete((A, B, out, through), t[1] - t[0], "zoh" if held else "foh")
    above, below = signal.ss2tf(*discrete)
    return [signal.lfilter(row, below, u) for row in above]


def columns(what, kind, rng, seconds=None, noise=0.1, colour=0.0):
    """A measurement of the printed form, its noise a share of the output's rms; and `held`.

    The zeros of both sensors are off.
    """
    seconds = seconds or (40.0 if what == "Th" else 10.0)
    held = kind == "steps" and what != "Th"
    dt = 4e-3 if what == "Th" else DT
    t, x = drive(kind, seconds, TOP[what], rng, dt)
    if kind == "steps" and what == "Th":  # a hand does not jump
        x = signal.lfilter(*signal.bessel(3, 2 * 3.0 * dt), x)
    u = SIZE[what] * x
    v = signal.lfilter([1.0], [1.0, -colour], rng.normal(size=len(t)))
    v *= noise / np.std(v)
    if what == "Th":
        m, d, k = PRINTED["Th"]
        p, minus = second_order(PRINTED["G"], u, t, False, [(1.0, 0.0, 0.0), (k, d, m)])
        return hc.studies.Measurement(t, -minus + np.std(minus) * v + 0.3, p + 0.1), held
    (p,) = second_order(PRINTED[what], u, t, held)
    return hc.studies.Measurement(t + 7.0, u, p + np.std(p) * v - 0.05), held


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("what", PRINTED)
def test_printed_coefficients_without_noise(what, kind):
    """Tolerance: what straight lines leave between samples, (omega dt)^2/12.

    At 10 Hz and 1 ms it is 3e-4; for Th at the corner of G, which moves the hand, and 4 ms 1.2e-3.
    """
    data, held = columns(what, kind, np.random.default_rng(1), noise=0.0)
    r = hc.studies.identify_data(data, what, AXIS[what], held=held)
    left = 1.3e-3 if what == "Th" else 3.3e-4
    np.testing.assert_allclose(r.values, PRINTED[what], rtol=left)
    assert r.periods == (3 if kind == "multisine" else 0)
    assert [c.unit for c in r.coefficients] == list(identification.COEFFICIENT_UNITS[what])
    exact = identification.response(what, PRINTED[what], r.frequency)
    np.testing.assert_allclose(r.response, exact, rtol=1e-2)
    assert r.coherence.min() > 0.99 and len(r.frequency) >= 8


@pytest.mark.parametrize(
    "what, kind, colour",
    [
        ("G", "noise", 0.99),
        ("G", "chirp", 0.0),
        ("S", "steps", 0.0),
        ("Th", "noise", 0.9),
        ("Th", "multisine", 0.0),
        *[("G", "multisine", 0.0), ("S", "noise", 0.0), ("Th", "steps", 0.0)][: 3 * HUNTS],
    ],
)
def test_intervals_hold_the_truth_at_the_stated_rate(what, kind, colour):
    """60 draws of drive and noise; noise is a tenth of the output, white or coloured.

    Of 60, 95 % are 57: fewer than 51 have a chance of 7e-4. Nor are intervals wide without need:
    half of one is 1.96 times the rms error at best; a third more allows for the scatter of both.
    """
    hits, error, half = [], [], []
    for seed in range(60):
        data, held = columns(what, kind, np.random.default_rng(seed), colour=colour)
        found = hc.studies.identify_data(data, what, AXIS[what], held=held).coefficients
        hits.append([c.low <= c.printed <= c.high for c in found])
        error.append([c.error for c in found])
        half.append([0.5 * (c.high - c.low) / c.printed for c in found])
    held_of = np.sum(hits, axis=0)
    assert held_of.min() >= 51, held_of
    assert held_of.sum() >= 162, held_of  # of 180, 171 expected
    ratio = np.median(half, axis=0) / np.sqrt(np.mean(np.square(error), axis=0))
    assert np.all(ratio < 1.96 * 4 / 3), ratio


def test_a_step_decides_with_few_lines_and_says_so():
    """One step of the command, 60 draws: few lines hold what is known, so the intervals are wide.

    Of 60, 95 % are 57; fewer than 51 have a chance of 7e-4.
    """
    hits = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        t = np.arange(8000) * DT
        u = 2e-3 * (t >= 2.0)
        (p,) = second_order(PRINTED["G"], u, t, True)
        data = hc.studies.Measurement(t, u, p + rng.normal(0.0, 1e-4, len(t)))
        found = hc.studies.identify_data(data, held=True).coefficients
        hits.append([c.low <= c.printed <= c.high for c in found])
    assert np.sum(hits, axis=0).min() >= 51, np.sum(hits, axis=0)


def test_a_held_input_comes_half_a_step_late():
    """What is taken for a signal between its samples delays the block by dt/2.

    1/((s^2 + d s + k)(1 + s dt/2)) has, to first order, d + k dt/2 beside 1 + d dt/2 of s^2: d is
    off by (k/d - d) dt/2 of itself. Tolerance: the next order, (omega dt) of it at 10 Hz, 6 %.
    """
    rng = np.random.default_rng(4)
    data, _ = columns("G", "steps", rng, seconds=20.0, noise=0.0)
    right, late = (
        hc.studies.identify_data(data, band=(0.2, 2.0), held=held).coefficients[1]
        for held in (True, False)
    )
    k, d = PRINTED["G"][2], PRINTED["G"][1]
    assert abs(right.error) < 1e-4
    assert late.error == pytest.approx(0.5 * DT * (k / d - d), rel=0.06)


def loop(delta, uh, dt):
    """Position and hand force of the printed loop in x, K = 0, the hand holding the handle.

    p = G delta + Sh fh and fh = uh - Th p, with the states p and v of G and of Sh.
    """
    (g, d, k), (gs, ds, ks), (m, b, kh) = PRINTED["G"], (0.7919, 41.1, 432.0), PRINTED["Th"]
    free = 1.0 + m * gs  # fh (1 + m gs) = uh - m (accelerations without fh) - b v - kh p
    row = np.array([m * k - kh, m * d - b, m * ks - kh, m * ds - b]) / free
    A = np.array([[0, 1, 0, 0], [-k, -d, 0, 0], [0, 0, 0, 1], [0, 0, -ks, -ds]], dtype=float)
    A[3] += gs * row
    B = np.array([[0, 0], [g, 0], [0, 0], [-gs * m * g / free, gs / free]])
    C, D = np.array([[1, 0, 1, 0], row]), np.array([[0, 0], [-m * g / free, 1 / free]])
    t = np.arange(len(delta)) * dt
    *discrete, _ = signal.cont2discrete((A, B, C, D), dt, "foh")
    out = np.zeros((2, len(t)))
    for i, u in enumerate((delta, uh)):
        above, below = signal.ss2tf(*discrete, input=i)
        out += [signal.lfilter(row, below, u) for row in above]
    return t, *out


def test_a_virtual_spring_takes_damping_from_the_fit():
    """docs/identify_device.md: the fitted b is that of the device less K Ts/2, by the hold."""
    K, Ts, b = 20.0, 0.01, 0.5
    push = hc.Multisine((0.05, 0.0), low=0.5, high=20.0, period=4.0, seed=1)
    rig = hc.VirtualWall(K=K, device=hc.Device(0.1, b), Ts=Ts)
    r = hc.simulate(rig.scenario(12.0, muscle=push, steps=5), engine="python")
    data = hc.studies.Measurement(r.t, input=push(r.t)[:, 0], output=r.p[:, 0])
    gain, damping, _ = hc.studies.identify_data(data, "S", band=(0.5, 8.0)).coefficients
    # the hold is a damper to first order: (omega Ts)^2/12 of K Ts/2 at 8 Hz are 2 %
    assert damping.value / gain.value == pytest.approx(b - 0.5 * K * Ts, abs=0.02 * 0.5 * K * Ts)


def test_a_reference_takes_the_bias_from_a_closed_loop():
    """A muscle force of 0.7 N rms moves the handle too: without a reference it biases Th.

    20 draws; the mean of each coefficient has a deviation of a half interval/(1.96 sqrt(20)).
    """
    found, half, dt = {True: [], False: []}, [], 4e-3
    for seed in range(20):
        rng = np.random.default_rng(seed)
        _, x = drive("noise", 80.0, 2.0, rng, dt)
        tremor = signal.lfilter(
            *signal.butter(2, [2 * dt, 12 * dt], "band"), rng.normal(size=len(x))
        )
        t, p, fh = loop(0.01 * x, 0.7 * tremor / np.std(tremor), dt)
        fh = fh + rng.normal(0.0, 0.02, len(t))
        for given in (True, False):
            r = hc.studies.identify_data(
                hc.studies.Measurement(t, fh, p, x if given else None), "Th"
            )
            found[given].append(r.values)
            half += [[0.5 * (c.high - c.low) for c in r.coefficients]] if given else []
    deviation = np.median(half, axis=0) / 1.96 / np.sqrt(20)
    away = {k: np.abs(np.mean(v, axis=0) - PRINTED["Th"]) / deviation for k, v in found.items()}
    assert np.all(away[True] < 3.5), away
    assert away[False].max() > 5.0, away


def test_zeros_of_sensors_and_clock_do_not_matter():
    """An offset moves the line at 0 alone. Tolerance: rounding of 1e3 + 1e-3, 1e-10."""
    data, _ = columns("S", "noise", np.random.default_rng(3))
    moved = hc.studies.Measurement(data.t - 3.0, data.input + 10.0, data.output + 1.0)
    a, b = (hc.studies.identify_data(x, "S", "y") for x in (data, moved))
    np.testing.assert_allclose(a.values, b.values, rtol=1e-7)
    assert a.coefficients[0].high == pytest.approx(b.coefficients[0].high, rel=1e-7)


def save(path, head, *arrays, mark=","):
    with open(path, "w", newline="") as f:
        rows = csv.writer(f, delimiter=mark)
        rows.writerow(head)
        rows.writerows(np.column_stack(arrays).tolist())


@pytest.mark.parametrize("what", PRINTED)
def test_columns_of_our_own_record_agree_with_the_built_in_route(what, tmp_path):
    """The first run of an identification with noisy sensors, written as CSV and read.

    Both intervals hold the difference of the values, each a half in quadrature, and half of it
    again for the seed.
    """
    short = dict(period=5.0, band=(0.15, 3.0), dt=1e-3) if what == "Th" else dict(period=1.5)
    own = hc.studies.identify("x", what, noise=hc.studies.Noise(), seed=3, lines=20, **short)
    record = hc.simulate(own.scenario)
    p, fh = identification.measured(record, hc.studies.Noise(), np.random.default_rng(1))
    given = record.delta[:, 0] if what == "G" else fh[:, 0]
    file = tmp_path / "data.csv"
    wave = record.scenario.muscle or record.scenario.command
    save(
        file,
        ("t", "input", "output", "ref"),
        record.t,
        given,
        p[:, 0],
        wave(record.t)[:, 0],
    )
    for names in ({}, {"reference": "ref"}):
        data = hc.studies.Measurement.load(file, names)
        np.testing.assert_array_equal(data.output, p[:, 0])
        r = hc.studies.identify_data(data, what, "x", band=short.get("band"))
        assert r.periods == 2 and r.scenario is None and r.source == "data.csv"
        for a, b in zip(r.coefficients, own.coefficients, strict=True):
            half = 0.5 * np.hypot(a.high - a.low, b.high - b.low)
            assert abs(a.value - b.value) < 1.5 * half, (a, b)


def test_files_as_others_write_them(tmp_path):
    """A byte-order mark, comments, empty lines, quotes, semicolons, and columns of words."""
    t = np.arange(100) * DT
    text = '\ufeff# rig 2\n"time";"cmd, m";note;pos\n\n'
    text += "".join(f'{x:.4f};{i % 7};"a ""b""; c";{i}\n' for i, x in enumerate(t))
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    names = {"t": "time", "input": "cmd, m", "output": "pos"}
    data = hc.studies.Measurement.load(tmp_path / "a.csv", names)
    np.testing.assert_array_equal(data.input, np.arange(100) % 7)
    np.testing.assert_array_equal(data.output, np.arange(100))
    assert data.name == "a.csv" and data.reference is None and data.dt == pytest.approx(DT)


@pytest.mark.parametrize(
    "head, size",
    [
        ("time [ms],force (kN),pos [um]", (1e-3, 1e3, 1e-6)),
        ("t,command (mm),pos [cm]", (1.0, 1e-3, 1e-2)),
        ("t [s],input (2),output [1]", (1.0, 1.0, 1.0)),  # no units: as they are
        ("t_ms,force / mN,x_mm", (1e-3, 1e-3, 1e-3)),
        ("time (seconds),input [mN] raw,pos", (1.0, 1e-3, 1.0)),
    ],
)
def test_a_unit_in_the_name_of_a_column_is_converted(head, size, tmp_path):
    t = np.arange(120.0)
    text = "".join(f"{x:g},{x % 7:g},{x % 5:g}\n" for x in t)
    (tmp_path / "a.csv").write_text(f"{head}\n{text}")
    names = dict(zip(("t", "input", "output"), head.split(","), strict=True))
    data = hc.studies.Measurement.load(tmp_path / "a.csv", names)
    for got, factor, want in zip(
        (data.t, data.input, data.output), size, (t, t % 7, t % 5), strict=True
    ):
        # one product of two rounded numbers
        np.testing.assert_allclose(got, factor * want, rtol=4e-16)


def test_command_line(tmp_path, capsys):
    data, _ = columns("S", "noise", np.random.default_rng(2))
    save(tmp_path / "rig.csv", ("time", "fh", "pos"), data.t, data.input, data.output, mark="\t")
    out = tmp_path / "out"
    words = ["identify", "--csv", str(tmp_path / "rig.csv"), "--what", "S", "--axis", "y"]
    words += ["--columns", "t=time", "input=fh", "output=pos", "--out", str(out)]
    assert app.main([*words, "--band", "0.2", "12"]) == 0
    text, err = capsys.readouterr()
    assert err == "" and "rig.csv: whole record" in text and "stiffness [1/s^2]" in text
    assert sorted(p.name for p in out.iterdir()) == ["identify.json", "identify.png"]
    assert "axis" not in text and "Sy" not in text  # one's own device has no axis of the arm
    saved = json.loads((out / "identify.json").read_text())
    (r,) = saved["results"]
    own = hc.studies.identify_data(data, "S", "y", band=(0.2, 12.0)).summary()
    assert r["source"] == "rig.csv" and r["coefficients"] == own["coefficients"]
    assert "scenario" not in r and r["units"]["response"] == "m/N" and r["periods"] == 0


def test_plot_of_measured_columns():
    from hapticclay.views import identification_plots

    low, high = (
        hc.studies.identify_data(columns("G", "noise", np.random.default_rng(2), noise=x)[0])
        for x in (3.0, 0.01)
    )
    figure = identification_plots.identification_plot([low, high])
    coherence = figure.axes[-1]
    assert coherence.get_ylim()[0] < low.coherence.min() < 0.5  # nothing is cut off
    told = [x.get_text() for x in figure.legends[0].get_texts()]
    assert "measured, with 95 % bars" in told
    titles = [ax.get_title(loc="left") for ax in figure.axes]
    assert not any("axis" in x for x in titles) and "axis" not in low.headline()
    beside = identification_plots.identification_plot([low], paper=True)
    assert "G, x axis (Eq. 15)" in beside.axes[0].get_title(loc="left")  # of the equation
    figure.savefig("/dev/null", format="png")


T = np.arange(4000) * DT
X = np.random.default_rng(0).normal(size=(2, 4000))


def replaced(x, row, value):
    x = x.copy()
    x[row] = value
    return x


@pytest.mark.parametrize(
    "t, u, y, field, words",
    [
        (T[:50], X[0, :50], X[1, :50], "t", "100 rows"),
        (T, X[0, :-1], X[1], "input", "as long as t"),
        (T, X, X[1], "input", "one column"),
        (T, X[0], ["a"] * 4000, "output", "array of numbers"),
        (T, X[0], replaced(X[1], 17, np.nan), "output[17]", "finite"),
        (replaced(T, 5, np.inf), X[0], X[1], "t[5]", "finite"),
        (T, replaced(X[0], 3, -1e60), X[1], "input[3]", "1e.50"),
        (T[::-1], X[0], X[1], "t", "increase"),
        (replaced(T, 700, T[700] + 2e-4), X[0], X[1], "t[700]", "row 699 to 700"),
        (np.delete(T, 900), X[0, 1:], X[1, 1:], "t[900]", "5 %"),
        (T, np.ones(4000), X[1], "input", "constant"),
        (T, X[0], np.ones(4000), "output", "constant"),
    ],
)
def test_bad_columns_are_refused(t, u, y, field, words):
    with pytest.raises(hc.ParameterError, match=words) as e:
        hc.studies.Measurement(t, u, y)
    assert e.value.field == field


def good(rng=0, **kw):
    return columns("G", "noise", np.random.default_rng(rng), **kw)[0]


@pytest.mark.parametrize(
    "data, kw, field, words",
    [
        (X, {}, "data", "Measurement"),
        (good(), dict(what="C"), "what", "G, S, Th"),
        (good(), dict(axis="z"), "axis", "x, y"),
        (good(), dict(held=1), "held", "True or False"),
        (good(), dict(what="Th", held=True), "held", "position"),
        (good(), dict(band=(1.0, 200.0)), "band[high]", "100"),
        (good(), dict(band=(1.0, 1.1)), "band", "too short"),
        (good(seconds=0.5), {}, "band", "too short"),
        (
            hc.studies.Measurement(T, np.sin(2 * np.pi * 60 * T), X[1]),
            {},
            "input",
            "12 lines or more",
        ),
        (
            hc.studies.Measurement(T, np.sin(2 * np.pi * 2 * T), X[1]),
            {},
            "input",
            "5 lines or more",
        ),
        (hc.studies.Measurement(T, X[0], X[1]), {}, "output", r"coherence must be 0.5 .* at .* Hz"),
        (hc.studies.Measurement(T, T, X[1]), {}, "output", "coherence"),
    ],
)
def test_bad_data_is_refused(data, kw, field, words):
    with pytest.raises(hc.ParameterError, match=words) as e:
        hc.studies.identify_data(data, **kw)
    assert e.value.field == field


ODD = {
    "itself": lambda x: x,
    "its integral": lambda x: np.cumsum(x) * DT,
    "its derivative": lambda x: np.gradient(x, DT),
    "late by a fifth of a second": lambda x: np.roll(x, 200),
    "squared": lambda x: x * x,
    "rounded to a count": lambda x: np.round(x / 3.0),
    "tiny": lambda x: 1e-200 * x,
    "huge": lambda x: 1e48 * x,
}


@pytest.mark.parametrize("what", PRINTED)
@pytest.mark.parametrize("odd", ODD)
def test_what_is_no_such_block_gives_finite_numbers_or_a_refusal(what, odd):
    x = drive("noise", 10.0, 5.0, np.random.default_rng(9), DT)[1]
    data = hc.studies.Measurement(np.arange(len(x)) * DT, x, ODD[odd](x))
    try:
        r = hc.studies.identify_data(data, what)
    except hc.ParameterError:
        return
    assert np.all(np.isfinite([(c.low, c.value, c.high) for c in r.coefficients]))
    assert np.all(np.isfinite(r.response)) and np.all(np.isfinite(r.deviation))
    json.dumps(r.summary(), allow_nan=False)


@pytest.mark.parametrize("what", PRINTED)
def test_a_wrong_sign_is_named(what):
    data, held = columns(what, "noise", np.random.default_rng(0))
    with pytest.raises(hc.ParameterError, match="wrong sign"):
        hc.studies.identify_data(
            hc.studies.Measurement(data.t, -data.input, data.output), what, held=held
        )


ROWS = "".join(f"{i * DT:.4f},{i % 7},{i % 5}\n" for i in range(200))
EMPTY = "".join(f"{i * DT:.4f},nan,{i % 5}\n" for i in range(200))
FILE = ["identify", "--csv", "a.csv"]


@pytest.mark.parametrize(
    "text, words, said",
    [
        (None, FILE, ["csv = 'a.csv'", "No such file"]),
        ("", FILE, ["csv", "empty"]),
        ("# only\n\n", FILE, ["csv", "empty"]),
        ("t,input,output\n", FILE, ["0 rows", "100 rows"]),
        (b"\xff\xfe\x00", FILE, ["UTF-16", "damaged"]),
        (ROWS, FILE, ["columns.t", "one of 1, 2, 3"]),
        ("t,inputs,output\n" + ROWS, FILE, ["columns.input", "did you mean 'inputs'"]),
        (
            "t,fx,fy,output\n" + ROWS.replace("\n", ",0\n"),
            [*FILE, "--what", "S"],
            ["columns.input", "fx, fy"],
        ),
        ("t,input,input\n" + ROWS, [*FILE, "--columns", "output=input"], ["input and output"]),
        ("t,a,b\n" + ROWS, [*FILE, "--columns", "input=a", "output=a"], ["different columns"]),
        ("t,input,output\n" + ROWS + "x,1,2\n", FILE, ["line 202", "'t'", "'x'"]),
        ("t,input,output\n" + ROWS + "0.2,1,none yet\n", FILE, ["line 202", "'output'", "yet"]),
        ("t,input,output\n" + EMPTY, FILE, ["line 2", "'input'", "'nan'"]),
        ("t,input,output\n" + ROWS + "0.2,1\n", FILE, ["line 202", "3 cells, has 2"]),
        ('t,input,output\n0,1,"2\n' + ROWS, FILE, ["line 2", "'output'"]),
        ("t,input,output\n" + ROWS + "0.1,1,2\n", FILE, ["t[200]", "goes back by 0.099 s"]),
        ("t,input,output\n" + ROWS, FILE, ["band", "too short"]),
        (
            "t,input,out [V]\n" + ROWS,
            [*FILE, "--columns", "output=out [V]"],
            ["'out [V]'", "must be in m or rad, not in V"],
        ),
        ("", [*FILE, "--columns", "inptu=a"], ["columns", "did you mean 'input'"]),
        ("", [*FILE, "--columns", "a"], ["columns", "t=time"]),
        ("", [*FILE, "--columns", "t=a", "t=b"], ["columns", "once"]),
        ("", [*FILE, "--map"], ["map", "leave it out"]),
        ("", [*FILE, "--what", "C"], ["--what"]),
        ("", [*FILE, "--band", "1"], ["--band"]),
        ("", ["identify", "--held"], ["held", "FILE"]),
        ("", ["identify", "--what", "G"], ["what", "FILE"]),
    ],
)
def test_command_line_refuses(text, words, said, tmp_path, monkeypatch, capsys):
    """One line that names the fault, exit status 2, and no file."""
    monkeypatch.chdir(tmp_path)
    if text is not None:
        (tmp_path / "a.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    before = list(tmp_path.iterdir())
    assert app.main(words) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.count("\n") == 1 and all(w in err for w in said), err
    assert list(tmp_path.iterdir()) == before


def test_the_simulated_route_says_nothing_of_files():
    r = hc.studies.identify(
        "x", "G", period=1.0, band=(1.0, 10.0), lines=5, realisations=2, periods=1
    )
    assert r.source == "" and not {"source", "estimate"} & set(r.summary())
    assert r.estimate == "lines of 1 whole periods"
