"""Logs as others write them: the law behind the rows is found, or the cause is told in a line.

The motion of gain/(s^2 + damping s + stiffness) under sines is exact at any time, so that each log
is written from the times at which it is sampled.
"""

import re
import shlex

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.cli import app
from tests.hunt import examples

LAW = (2.0, 6.0, 40.0)  # 1/kg, 1/s, 1/s^2
BAND = (0.5, 9.0)  # [Hz]


class Motion:
    """Force and position of a law under sines of random phase, one in each 1/duration."""

    def __init__(self, duration, law=LAW, seed=0, band=BAND):
        rng = np.random.default_rng(seed)
        f = np.arange(np.ceil(band[0] * duration), band[1] * duration) / duration
        s = 2j * np.pi * f
        self.s, self.wave = s, np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, len(f)))
        self.response = law[0] / (s * s + law[1] * s + law[2])

    def force(self, t):
        return (np.exp(np.outer(t, self.s)) @ self.wave).real

    def place(self, t):
        return (np.exp(np.outer(t, self.s)) @ (self.wave * self.response)).real


def write(path, head, *columns, form="%.9g"):
    np.savetxt(path, np.column_stack(columns), form, ",", header=head, comments="")
    return path


def identified(log, band=BAND, **how):
    data = hc.studies.Measurement.load(log, **how)
    return hc.studies.identify_data(data, "S", band=band)


def check(found, law=LAW, near=5e-3):
    """Within an interval of each coefficient, or near it: a cubic in place of a lost row."""
    for c, true in zip(found.coefficients, law, strict=True):
        assert abs(c.value - true) < max(near * true, 1.5 * (c.high - c.low)), (c, true)


T = 0.01 * np.arange(1200)
MOTION = Motion(12.0)
FORCE, PLACE = MOTION.force(T), MOTION.place(T)


# ---- rows that are missing, and stamps that are rounded


@pytest.mark.parametrize("rate, digits", [(100.0, 2), (1000.0, 3), (50.0, 2), (125.0, 3)])
@pytest.mark.parametrize("lost", [(600,), (4, 1100), (300, 301), (100, 400, 700, 1000)])
def test_lost_rows_of_a_clock_without_jitter_are_lost(tmp_path, rate, digits, lost):
    """Not rows of a slower clock whose stamps are rounded: the position jumps with the stamps."""
    n = int(12.0 * rate)
    rows = [lost[0] * n // 1200 + x - lost[0] if x - lost[0] < 2 else x * n // 1200 for x in lost]
    t = np.delete(np.arange(n) / rate, rows)
    path = write(tmp_path / "a.csv", "t,force,pos", t, MOTION.force(t), MOTION.place(t))
    found = identified(path, band=(0.5, min(9.0, 0.09 * rate)))
    assert re.match(rf"{len(lost)} rows? (is|are) missing in \d gap", found.warnings[0])
    assert found.coherence.min() > 0.99
    check(found, near=2e-3)


@pytest.mark.parametrize("rate", [99.875, 99.6, 98.7, 96.0])
def test_rows_of_a_slower_clock_whose_stamps_are_rounded_are_even(tmp_path, rate):
    """Their stamps are those of a clock of 100 Hz that lost rows, but the position is even."""
    t = np.arange(1200) / rate
    stamps = np.floor(100.0 * t + 1e-9) / 100.0
    path = write(tmp_path / "a.csv", "t,force,pos", stamps, MOTION.force(t), MOTION.place(t))
    found = identified(path)
    assert "rows are even" in found.warnings[0]
    check(found, near=2e-3)


@pytest.mark.parametrize("noise", [0.0, 1e-3, 1e-2])
def test_noise_does_not_hide_a_lost_row(tmp_path, noise):
    """Where it does, a single long step is taken as a lost row."""
    rng = np.random.default_rng(1)
    keep = np.delete(np.arange(1200), 600)
    x = PLACE + noise * np.std(PLACE) * rng.standard_normal(1200)
    path = write(tmp_path / "a.csv", "t,force,pos", T[keep], FORCE[keep], x[keep])
    assert "1 row is missing in 1 gap, at t = 5.99 s" in identified(path).warnings[0]


# ---- cells that are missing


@pytest.mark.parametrize("empty", ["", "nan", "NaN", "NA", "null"])
@pytest.mark.parametrize("column", ["t", "force", "pos"])
def test_missing_cells_are_missing_rows(tmp_path, empty, column):
    lines = [f"{t:.2f},{f:.9g},{x:.9g}" for t, f, x in zip(T, FORCE, PLACE, strict=True)]
    place = ["t", "force", "pos"].index(column)
    without = list(lines)
    for i in (100, 333, 334, 700, 1100):
        cells = lines[i].split(",")
        cells[place] = empty
        lines[i], without[i] = ",".join(cells), ""
    (tmp_path / "a.csv").write_text("\n".join(["t,force,pos", *lines]))
    (tmp_path / "b.csv").write_text("\n".join(["t,force,pos", *filter(None, without)]))
    found, other = (identified(tmp_path / name) for name in ("a.csv", "b.csv"))
    assert found.values == other.values
    check(found)
    if column != "t":
        assert f"5 of 1200 rows lack a value of {column}" in found.warnings[0]


def test_a_last_column_that_is_empty_is_a_column(tmp_path):
    lines = [f"{t:.2f},{f:.9g},{x:.9g}," for t, f, x in zip(T, FORCE, PLACE, strict=True)]
    lines[900] += "1"
    (tmp_path / "a.csv").write_text("\n".join(["t,force,pos,marker", *lines]))
    log = hc.Log.read(tmp_path / "a.csv")
    assert (log.rows, log.names) == (1200, ("t", "force", "pos", "marker"))
    assert hc.studies.log_report(log).table["remarks"][3].startswith("1199 missing")
    check(identified(log))


@pytest.mark.parametrize("rates", [(100.0, 100.0), (200.0, 100.0), (100.0, 250.0)])
def test_topics_side_by_side_have_stamps_of_their_own(tmp_path, rates):
    """Cubic splines: at 9 Hz and 100 Hz, (0.57)^4/384 = 3e-4 of a sine."""
    rows = []
    for rate, late, kind in zip(rates, (0.0, 0.0031), "fx", strict=True):
        for t in (late + np.arange(int(12.0 * rate)) / rate).tolist():
            value = MOTION.force([t])[0] if kind == "f" else MOTION.place([t])[0]
            rows.append((t, f"{value:.9g}," if kind == "f" else f",{value:.9g}"))
    text = "\n".join(["__time,/arm/force,/arm/pos", *(f"{t:.6f},{x}" for t, x in sorted(rows))])
    (tmp_path / "a.csv").write_text(text)
    log = hc.Log.read(tmp_path / "a.csv")
    assert log.rows == len(rows)
    found = identified(log, columns={"input": "/arm/force", "output": "/arm/pos"})
    assert "stamps of its own" in found.warnings[0]
    check(found, near=3e-3)


# ---- rows in bursts, runs one after the other, files without a time


@pytest.mark.parametrize("size", [2, 3, 8])
@pytest.mark.parametrize("are_late", [True, False])
def test_rows_in_bursts_have_one_rate(tmp_path, size, are_late):
    """Rows that were sampled evenly keep their places; those read at once are one reading."""
    last = np.minimum((np.arange(1200) // size + 1) * size - 1, 1199)
    stamps = T[last] + 1e-4 * (np.arange(1200) % size)
    sampled = T if are_late else stamps
    columns = stamps, MOTION.force(sampled), MOTION.place(sampled)
    log = hc.Log.read(write(tmp_path / "a.csv", "t,force,pos", *columns))
    assert f"at 100 Hz, in bursts of {size}" in hc.studies.log_report(log).headline()
    if are_late:
        check(identified(log))
    elif size == 2:  # 50 Hz, of which a tenth is the highest line
        check(identified(log, band=(0.5, 5.0)), near=1e-2)


@pytest.mark.parametrize("seconds", [2.0, 4.25, 4.28, 4.29, 4.3, 65.53])
@pytest.mark.parametrize("start", [0.0, 0.5])
def test_a_second_run_is_no_counter_that_begins_again(tmp_path, seconds, start):
    """Near 2^32 ns and 2^16 ms, at which counters begin again."""
    n = round(100.0 * seconds)
    t = start + np.concatenate((0.01 * np.arange(n), T[: max(n, 900)]))
    run = np.arange(len(t)) >= n
    columns = (t, MOTION.force(t), MOTION.place(t), 7 + run)
    log = hc.Log.read(write(tmp_path / "a.csv", "timestamp,force,pos,episode_index", *columns))
    with pytest.raises(hc.ParameterError, match="two logs in one file.*--where episode_index=7"):
        identified(log)
    check(identified(hc.Log.read(tmp_path / "a.csv", where={"episode_index": 8})))
    assert all("--where episode_index=7" in x for x in hc.studies.log_report(log).commands)


@pytest.mark.parametrize("modulus", [2.0**32 * 1e-9, 65.536, 2.0**32 * 1e-6])
@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_counters_that_begin_again_are_unwrapped(tmp_path, modulus, jitter):
    t = T + 0.01 * jitter * np.random.default_rng(2).uniform(-1.0, 1.0, 1200)
    stamps = (t + modulus - 2.3) % modulus
    columns = (stamps, MOTION.force(t), MOTION.place(t))
    found = identified(write(tmp_path / "a.csv", "t,force,pos", *columns, form="%.12g"))
    assert "the clock begins again" in found.warnings[0]
    check(found)


def test_the_rate_of_rows_can_be_stated(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = write(tmp_path / "a.csv", "effort,qpos", FORCE, PLACE)
    with pytest.raises(hc.ParameterError, match="the file has no time.*--rate 50"):
        identified(path)
    check(identified(path, rate=100.0))
    t = hc.studies.Measurement.load(path, rate="0.1 kHz").t
    np.testing.assert_allclose(t, T, rtol=3e-16)  # a product and a quotient
    assert app.main(["columns", "a.csv", "--rate", "100"]) == 0
    command = capsys.readouterr().out.split("go on with: hapticclay ")[1].splitlines()[0]
    assert "--rate 100" in command and app.main(shlex.split(command)) == 0
    # a file's own time is put aside
    path = write(tmp_path / "b.csv", "time,force,pos", np.floor(T), FORCE, PLACE)
    check(identified(path, rate=100.0))
    with pytest.raises(hc.ParameterError, match="rate = 0: must be a finite number > 0"):
        hc.Log.read(path, rate=0)


# ---- names, units, commands


def test_columns_of_one_name(tmp_path):
    same = write(tmp_path / "a.csv", "Time,Position,Time,Force", T, PLACE, T, FORCE)
    log = hc.Log.read(same)
    assert log.names == ("Time", "Position", "Force")
    assert log.table.notes == ("2 columns are named Time: they are the same, read as one",)
    check(identified(log))
    path = tmp_path / "b.csv"
    log = hc.Log.read(write(path, "Time,x_mm,F [mN],F [mN],x_mm", T, PLACE, FORCE, 0 * T, FORCE))
    assert log.names == ("Time", "x_mm", "F [mN]", "F [mN]#2", "x_mm#2")
    np.testing.assert_allclose(log.values("x_mm#2", ("m",)), 1e-3 * FORCE, rtol=1e-8)
    np.testing.assert_allclose(log.values("F#2", ("N",)), 0.0 * T)
    with pytest.raises(hc.ParameterError, match=r"one of F \[mN\], F \[mN\]#2"):
        identified(log, columns={"output": "x_mm"})
    found = identified(log, columns={"input": "F [mN]", "output": "x_mm"})
    assert "F [mN] is the first of the columns of this name" in found.warnings
    check(found)


@pytest.mark.parametrize("name", ["action[1]", "joint_1", "x.effort1", "arm.m2", "q.1", "p_s1"])
def test_the_place_of_a_part_is_no_unit(tmp_path, name):
    log = hc.Log.read(write(tmp_path / "a.csv", f"t,{name}", T, PLACE))
    assert hc.studies.log_report(log).table["unit"][1] == "none: SI"


@pytest.mark.parametrize(
    "unit, size, si",
    [
        ("mm", 1e-3, "m"),
        ("N", 1.0, "N"),
        ("0.05 N.m/A", 0.05, "N.m"),
        ("20N/V", 20.0, "N"),
        ("0.5 mm", 5e-4, "m"),
        ("2 m/s", 2.0, "m/s"),
    ],
)
def test_stated_units_are_shown(tmp_path, unit, size, si):
    log = hc.Log.read(write(tmp_path / "a.csv", "t,signal", T, PLACE), units={"signal": unit})
    report = hc.studies.log_report(log)
    assert report.table["unit"][1].endswith(si)
    assert report.table["highest"][1] == pytest.approx(size * PLACE.max(), rel=1e-8)
    np.testing.assert_allclose(log.values("signal", (si,)), size * PLACE, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("name", ["current_mA", "current [mA]", "i / mA"])
def test_a_scale_is_per_unit_of_its_column(tmp_path, name):
    log = hc.Log.read(write(tmp_path / "a.csv", f"t,{name}", T, FORCE), units={name: "0.05 N.m/A"})
    np.testing.assert_allclose(log.values(name, ("N.m",)), 5e-5 * FORCE, rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize("counts", ["4096", 4096, 4096.0])
def test_counts_a_turn_as_text(tmp_path, counts):
    log = hc.Log.read(write(tmp_path / "a.csv", "t,q", T, 500.0 * PLACE), counts={"q": counts})
    expected = 2.0 * np.pi / 4096.0 * 500.0 * PLACE
    np.testing.assert_allclose(log.values("q", ("rad",)), expected, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("options", [[], ["--units", "pos=mm"], ["--counts", "pos=0.01mm"]])
def test_the_command_that_is_printed_has_all_options(tmp_path, capsys, monkeypatch, options):
    """A table, rows of a run, units: pasted as it is, it runs."""
    from scipy.io import savemat

    monkeypatch.chdir(tmp_path)
    run = np.repeat((3.0, 4.0), 1200)
    both = {"t": np.tile(T, 2), "pos": np.tile(PLACE, 2), "force": np.tile(FORCE, 2), "trial": run}
    savemat("my trials.mat", {"a": {"t": T, "pos": T, "force": T}, "b c": both})
    assert app.main(["columns", "my trials.mat", "--table", "b c", *options]) == 0
    lines = capsys.readouterr().out.splitlines()
    commands = [x.partition(": hapticclay ")[2] for x in lines if x.startswith("go on")]
    assert len(commands) == 2
    for command in commands:
        assert all(word in command for word in ("--table", "--where", "trial=3", *options))
        assert app.main(shlex.split(command)) == 0
    capsys.readouterr()
    units = dict([options[1].split("=")]) if options else {}
    how = {options[0][2:]: units} if options else {}
    log = hc.Log.read("my trials.mat", table="b c", where={"trial": 4}, **how)
    assert len(hc.studies.log_report(log).commands) == 2


def test_a_command_that_would_be_refused_is_not_printed(tmp_path):
    words = [f"{x:.3f}" for x in T]
    words[7] = "soon"
    lines = [f"{t},{f},{x}" for t, f, x in zip(words, FORCE, PLACE, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["t,force,pos", *lines]))
    report = hc.studies.log_report(hc.Log.read(tmp_path / "a.csv"))
    assert report.commands == () and "t is no time: line 9" in report.warnings[0]
    columns = np.concatenate((T, T)), np.tile(FORCE, 2), np.tile(PLACE, 2)
    log = hc.Log.read(write(tmp_path / "b.csv", "t,force,pos", *columns))
    report = hc.studies.log_report(log)
    assert report.commands == () and "two logs in one file" in report.warnings[-1]


def test_a_reference_is_offered_where_a_command_stands_beside_the_force(tmp_path):
    path = write(tmp_path / "a.csv", "t,ref,force,pos", T, FORCE, FORCE, PLACE)
    commands = hc.studies.log_report(hc.Log.read(path)).commands
    assert any(x.endswith("input=force output=pos reference=ref") for x in commands)


def test_files_that_are_replaced_are_said_to_be(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "a.csv", "t,force,pos", T, FORCE, PLACE)
    for said in ("", ", in place of the files that were there"):
        assert app.main(["columns", "a.csv"]) == 0
        assert capsys.readouterr().out.endswith(f"written to out/columns/a{said}\n")


# ---- all of these at random


@st.composite
def laws(draw):
    if draw(st.booleans()):
        return LAW
    omega = 2.0 * np.pi * draw(st.floats(0.8, 3.0))
    return (draw(st.floats(0.3, 20.0)), 2.0 * draw(st.floats(0.1, 0.8)) * omega, omega**2)


@examples(20)
@given(
    law=laws(),
    rate=st.sampled_from((50.0, 100.0, 200.0, 500.0)),
    lost=st.lists(st.integers(3, 995), max_size=6, unique=True),
    holes=st.lists(st.integers(3, 995), max_size=6, unique=True),
    digits=st.sampled_from((3, 4, 6)),
    wrapped=st.booleans(),
    seed=st.integers(0, 2**20),
)
def test_the_law_is_found(tmp_path_factory, law, rate, lost, holes, digits, wrapped, seed):
    """Lost rows, missing cells, rounded stamps, a counter that begins again: all at once."""
    n = int(16.0 * rate)
    motion = Motion(16.0, law, seed, (0.5, min(9.0, 0.09 * rate)))
    t = np.arange(n) / rate
    keep = np.delete(np.arange(n), [x * n // 1000 for x in lost])
    stamps = np.round(t + (2.0**32 * 1e-9 - 1.0 if wrapped else 0.0), 9)
    stamps = stamps % (2.0**32 * 1e-9) if wrapped else stamps
    assume(not wrapped or 16.0 / (2.0**32 * 1e-9) < 4)
    rows = [
        [f"{a:.{digits}f}" if not wrapped else f"{a:.9f}", f"{f:.9g}", f"{x:.9g}"]
        for a, f, x in zip(stamps[keep], motion.force(t[keep]), motion.place(t[keep]), strict=True)
    ]
    for k, i in enumerate(holes):
        rows[i * len(rows) // 1000][1 + k % 2] = ""
    path = tmp_path_factory.mktemp("log") / "a.csv"
    path.write_text("\n".join(["t,force,pos", *(",".join(x) for x in rows)]))
    # a cubic over a hole at the highest line, a tenth of the rate: (2 pi/10 2)^4/384 = 6e-3
    check(identified(path, band=(0.5, min(9.0, 0.09 * rate))), law, near=2e-2)
