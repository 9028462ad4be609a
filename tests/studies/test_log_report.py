"""What `hapticclay columns` says of a log."""

import json
import shlex

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app

T = 0.002 * np.arange(400)


def written(path, head, *columns):
    np.savetxt(path, np.column_stack(columns), "%.17g", ",", header=head, comments="")
    return path


def test_the_commands_that_it_prints_run(tmp_path, capsys, monkeypatch):
    """With names that a shell would part."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    t = 0.01 * np.arange(3000)
    f = np.convolve(rng.standard_normal(len(t)), np.ones(5) / 5.0, "same")
    x = np.zeros(len(t))
    for i in range(2, len(t)):  # 0.5 kg, 4 N.s/m, 100 N/m, by differences
        x[i] = (f[i - 1] + (1e4 * 1.0 - 100.0) * x[i - 1] + (200.0 - 5e3) * x[i - 2]) / 5.2e3
    written(tmp_path / "my rig.csv", "t [s],hand force [N],pos", t, f, x)
    assert app.main(["columns", "my rig.csv"]) == 0
    out = capsys.readouterr().out
    lines = [x.partition(": hapticclay ")[2] for x in out.splitlines() if x.startswith("go on")]
    assert [line.split()[0] for line in lines] == ["identify", "fit"]
    assert app.main([*shlex.split(lines[0]), "--out", "s"]) == 0
    found = json.loads((tmp_path / "out/columns/my rig/columns.json").read_text())
    assert found["schema"] == "hapticclay-columns-1"
    assert (tmp_path / "out/columns/my rig/columns.png").is_file()


@pytest.mark.parametrize(
    "t, x, said",
    [
        (T, T, "gaps 0, repeated 0, backward 0"),
        (np.delete(T, [200, 201]), np.delete(T, [200, 201]), "1 gap, the longest 0.006 s"),
        (np.repeat(T, 2)[:400], T, "as the one before"),
        (np.roll(T, 1), T, "1 stamp before the one before"),
        (1e3 * T, T, "is the time in seconds?"),
        (T, np.where(np.arange(400) == 70, np.nan, T), "1 missing"),
        (T, np.full(400, 3.0), "constant"),
        (T, np.clip(np.sin(9.0 * T), -0.5, 0.5), "limited?"),
        (T, (30.0 * T) % 6.2832, "begins again 3 times: an encoder that wraps"),
        (T, 1.0 * (T > 0.4), "1 jump of more than half the range"),
        (T + 1e-4 * (-1.0) ** np.arange(400), T, "% of the steps are off by more than 5 %"),
    ],
)
def test_what_is_suspicious_is_said(t, x, said, tmp_path):
    log = hc.Log.read(written(tmp_path / "a.csv", "t,x", t, x))
    assert said in hc.studies.log_report(log).text()


def test_a_second_clock_is_compared(tmp_path):
    file = written(tmp_path / "a.csv", "t,timestamp [ms],x", T, 1e3 * 1.0002 * T + 5.0, T)
    text = hc.studies.log_report(hc.Log.read(file)).text()
    assert "a second clock, timestamp [ms]: it runs +200 ppm fast" in text


def test_units_are_shown_as_they_were_read(tmp_path):
    head = "t_ms,x [in],y_mm,z [furlong],w_mm"
    log = hc.Log.read(written(tmp_path / "a.csv", head, 1e3 * T, T, T, T, T))
    table = hc.studies.log_report(log).tables()["columns"]
    shown = ["ms, shown in s", "in, shown in m", "mm, shown in m", "furlong", "mm, by its name?"]
    assert table["unit"] == shown
    assert "unknown unit 'furlong'" in table["remarks"][3]
    report = hc.studies.log_report(log)
    assert [*report.columns] == ["x [m]", "y [m]", "z [furlong]", "w_mm"]
    again = hc.studies.LogReport.load(report.save(tmp_path / "report.json"))
    assert again.text() == report.text() and again.plot().axes
    assert table["highest"][1] == pytest.approx(0.0254 * T[-1], rel=1e-12)  # one product
    assert hc.studies.log_report(log).stamps.step == pytest.approx(0.002, rel=1e-9)  # differences


@pytest.mark.parametrize(
    "name, stem, unit",
    [
        ("v_m_per_s", "v", "m/s"), ("dq_rad_s", "dq", "rad/s"), ("tau_N_m", "tau", "N.m"),
        ("a_m_s2", "a", "m/s2"), ("force / mN", "force", "mN"), ("time, s", "time", "s"),
        ("pos-mm", "pos", "mm"), ("x_mm", "x", "mm"),
    ],
)  # fmt: skip
def test_last_words_of_names_are_units(name, stem, unit):
    from hapticclay.columns.heads import Head

    assert next(iter(Head(name).last_words())) == (stem, unit)


@pytest.mark.parametrize("name", ["force_g", "force_kg", "force_V", "force_lb", "force_counts"])
def test_names_that_end_like_another_quantity_are_asked_about(name, tmp_path):
    log = hc.Log.read(written(tmp_path / "a.csv", f"t,{name}", T, T))
    with pytest.raises(hc.ParameterError, match="state its unit"):
        log.values(name, ("N",))
    assert log.stating({name: "gf"}).values(name, ("N",))[-1] == 9.80665e-3 * T[-1]


def test_counts(tmp_path):
    log = hc.Log.read(written(tmp_path / "a.csv", "t,q [counts],x", T, 500.0 * T, T))
    with pytest.raises(hc.ParameterError, match="counts a turn"):
        log.values("q", ("rad",))
    turn = log.stating(None, {"q": 4096, "x": "0.01 mm"})
    np.testing.assert_allclose(turn.values("q", ("rad",)), 2 * np.pi / 4096 * 500.0 * T, rtol=4e-16)
    np.testing.assert_allclose(turn.values("x", ("m",)), 1e-5 * T, rtol=4e-16)
    with pytest.raises(hc.ParameterError, match="counts.q"):
        log.stating(None, {"q": "fast"})


@pytest.mark.parametrize("times", [range(200, 0, -1), [3] * 200])
def test_time_that_never_goes_ahead_is_drawn(times, tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t,x\n" + "".join(f"{t},{i % 7}\n" for i, t in enumerate(times)))
    assert app.main(["columns", str(file), "--out", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out" / "columns.png").stat().st_size


def test_a_log_without_rows_says_so(tmp_path):
    (tmp_path / "log.csv").write_text("t,force,pos\n")
    report = hc.studies.log_report(hc.Log.read(tmp_path / "log.csv"))
    assert report.warnings == ("there are no rows of numbers",) and not report.commands


def test_columns_of_unknown_units_are_in_no_command(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{0.001 * i},{i},{2 * i}" for i in range(30)]
    path.write_text("\n".join(["t [s],force [blub],pos [mm]", *rows]))
    report = hc.studies.log_report(hc.Log.read(path))
    assert report.commands == ()
    assert any("--units force=UNIT" in x for x in report.warnings)


@pytest.mark.parametrize("hold", [1, 2, 5])
def test_an_input_that_is_held_over_rows_is_told(tmp_path, hold):
    path, rng = tmp_path / "log.csv", np.random.default_rng(0)
    force = np.repeat(rng.normal(size=400 // hold), hold)
    rows = [f"{0.001 * i},{f},{0.01 * f}" for i, f in enumerate(force.tolist())]
    path.write_text("\n".join(["t [s],force [N],pos [m]", *rows]))
    remark = hc.studies.log_report(hc.Log.read(path)).table["remarks"][1]
    assert (f"changes every {hold} rows: held" in remark) is (hold > 1)


def test_a_coarse_sensor_is_not_held(tmp_path):
    """Its column changes at any row."""
    from hapticclay.studies.even_columns import held_rows

    slow = np.round(3.0 * np.sin(0.003 * np.arange(20000)) / 0.5)
    assert held_rows(slow) == 1


def test_a_column_that_does_not_change_is_in_no_command(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(
        "\n".join(["t [s],force [N],pos [m]", *(f"{0.001 * i},1,{i}" for i in range(30))])
    )
    assert hc.studies.log_report(hc.Log.read(path)).commands == ()


def test_a_table_on_its_side_is_refused_in_a_line(tmp_path):
    path = tmp_path / "side.csv"
    path.write_text("\n".join(",".join(f"{i + j}.5" for i in range(1500)) for j in range(3)))
    with pytest.raises(hc.ParameterError, match="are rows and columns exchanged"):
        hc.studies.log_report(hc.Log.read(path))
    path.write_text("\n".join(",".join(f"{i + j}.5" for i in range(300)) for j in range(3)))
    with pytest.raises(hc.ParameterError, match="has 300 columns of 3 rows"):
        hc.studies.log_report(hc.Log.read(path))
