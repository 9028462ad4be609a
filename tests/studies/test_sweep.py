"""Sweeps: the points of the space, and data sets that survive interruption and killed processes."""

import contextlib
import inspect
import json
import math
import os
import re
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.cli import sweep as sweep_command
from hapticclay.errors import ParameterError
from hapticclay.studies import store, store_runs, sweep, sweep_rows
from hapticclay.studies.sampling import Range, parse_fixed, parse_grid
from hapticclay.studies.sweep import Sweep
from hapticclay.views import sweep_plots
from tests.waiting import PATIENCE, alarm, until

GRID = "b=10:1000:3log gain.x=1:2:2"


def small(**kw):
    return Sweep("constant", parse_grid(GRID), {"t_max": 0.02}, chunk=2, **kw)


def columns(table):
    """Everything but the time it took, to the last bit (repr of a float is exact)."""
    return {c: repr(table[c].to_pylist()) for c in table.column_names if c != "wall_time"}


@pytest.mark.parametrize(
    "text,values",
    [
        ("1:1000:4log", [1, 10, 100, 1000]),
        ("0:2:3", [0, 1, 2]),
        ("1,2,5", [1, 2, 5]),
        ("7", [7]),
        ("3:3:1", [3]),
        (4, [4]),
        ([1, 2], [1, 2]),
        ("-1:1:3", [-1, 0, 1]),
    ],
)
def test_ranges(text, values):
    np.testing.assert_allclose(Range.parse("b", text).grid(), values, rtol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a",
        "1:",
        "1:2:0",
        "2:1",
        "2:1:5",
        "0:1log",
        "0:1:5log",
        "-1:1:5log",
        "nan",
        "1:inf:3",
        "1:log",
        None,
        "1:2:3:4",
    ],
)
def test_bad_ranges_are_refused(text):
    with pytest.raises(ParameterError, match="b = "):
        Range.parse("b", text)


@pytest.mark.parametrize("text", ["b", "=3", "b=1 b=2", "b:1:2"])
def test_bad_grids_are_refused(text):
    with pytest.raises(ParameterError):
        parse_grid(text)


@given(st.integers(1, 5), st.integers(1, 5), st.integers(1, 7))
def test_grid_is_every_combination_once_whatever_the_chunks(n, m, chunk):
    s = Sweep("constant", {"b": Range(1.0, 2.0 + n, n), "gain": Range(0.1, 1.0, m)}, chunk=chunk)
    points = np.vstack([s.points(i * chunk, min((i + 1) * chunk, len(s))) for i in range(s.chunks)])
    assert len(points) == n * m == len(set(map(tuple, points)))
    np.testing.assert_array_equal(points, s.points(0, len(s)))
    assert np.all(points[:m, 0] == 1.0)  # the last parameter is the fastest


def test_a_list_made_without_a_count_is_whole():
    s = Sweep("constant", {"b": Range(1.0, 3.0, values=(1.0, 2.0, 3.0)), "gain.x": Range(1, 2, 2)})
    assert s.points(0, len(s)).tolist() == [[b, k] for b in (1.0, 2.0, 3.0) for k in (1.0, 2.0)]


@pytest.mark.parametrize("design", ["lhs", "sobol"])
def test_samples_fill_the_space(design):
    s = Sweep("constant", parse_grid("b=1:1000log gain.x=0:2"), {}, design, 60, seed=3)
    points = s.points(0, 60)
    np.testing.assert_array_equal(
        points, Sweep("constant", s.vary, {}, design, 60, seed=3).points(0, 60)
    )
    u = np.column_stack((np.log10(points[:, 0]) / 3.0, points[:, 1] / 2.0))
    assert u.min() >= 0.0 and u.max() < 1.0
    for i in (0, 1):
        strata = np.unique((u[:, i] * (60 if design == "lhs" else 32)).astype(int))
        assert len(strata) == (
            60 if design == "lhs" else 32
        )  # each stratum of a Latin hypercube once
    other = Sweep("constant", s.vary, {}, design, 60, seed=4)
    assert not np.array_equal(points, other.points(0, 60))


def test_parameters_reach_the_scenario():
    vary = parse_grid("b=50 gain.y=0.3 force=2 operator.mass=1.5")
    s = Sweep(
        "constant",
        vary,
        parse_fixed(
            "inertia_shaping=true operator.damper=3 operator.spring=6 t_max=5 clay=0.01,0.02"
        ),
    )
    scenario = s.run_scenario(s.points(0, 1)[0])
    assert (
        scenario.gain == (1.0, 0.3)
        and scenario.force == (2.0, 2.0)
        and scenario.inertia_shaping
        and scenario.t_max == 5.0
    )
    assert (
        scenario.clay is not None
        and scenario.clay.x.values == (0.0, 50.0, 0.0)
        and scenario.clay.x.edges == (0.01, 0.02)
    )
    assert scenario.operator == hc.Operator(1.5, 3.0, 6.0)
    seeded = Sweep("stability", parse_grid("seed=1,2 gain=2"), {})
    assert seeded.run_scenario(seeded.points(1, 2)[0]).muscle.seed == 2


def test_any_field_of_any_part_is_varied_by_name(tmp_path):
    names = {
        "arm.l1": lambda s: s.arm.l1,
        "servo.x.G.damping": lambda s: s.servo[0].G.damping,
        "compensator.den.1": lambda s: s.compensator.den[1],
        "clay.x.values.1": lambda s: s.clay.x.values[1],
        "torque_limit.elbow": lambda s: s.torque_limit[1],
        "hardware.friction.x": lambda s: s.hardware.friction[0],
        "muscle.rms.x": lambda s: s.muscle.rms[0],
        "operator.y.mass": lambda s: s.operator[1].mass,
    }
    grid = " ".join(f"{name}=0.3:0.4:2" for name in names)
    sampled = {
        "control": "sampled", "hardware.friction": 0.1, "compensator.den": [1.0, 40.0, 0.0],
        "operator": True,
    }  # fmt: skip
    s = Sweep("constant", parse_grid(grid), sampled)
    assert len(s) == 2 ** len(names)
    for point in s.points(100, 104):
        scenario = s.run_scenario(point)
        assert [get(scenario) for get in names.values()] == list(point)
        assert scenario.clay.y.values == (0.0, 90.0, 0.0)


def test_a_sweep_starts_from_a_scenario_file(tmp_path):
    (tmp_path / "mine.toml").write_text('experiment = "free"\ngain = [1, 0.4]\n[arm]\nl1 = 0.3\n')
    spec = tmp_path / "spec.toml"
    spec.write_text('scenario = "mine.toml"\n[vary]\narm.l2 = "0.3:0.4:2"\n"gain.x" = [1, 2]\n'
                    '[fixed]\nt_max = 0.01\noperator = true\n"operator.mass" = 0.5\n')  # fmt: skip
    s = Sweep(**sweep.load_sweep(spec))
    assert s.title == "mine" and list(s.vary) == ["arm.l2", "gain.x"]
    got = s.run_scenario(s.points(1, 2)[0])
    assert (got.arm, got.gain, got.operator) == (hc.Arm(0.3, 0.3), (2.0, 0.4), hc.Operator(0.5))
    assert json.loads(json.dumps(s.described()))["scenario"]["arm"] == {"l1": 0.3}
    other = dict(s.scenario, gain=[1, 0.3])
    assert Sweep(**{**vars(s), "scenario": other}).digest() != s.digest()
    for text, said in (
        ('scenario = "none.toml"', "No such file"),
        ("scenario = 3", "path of a scenario file"),
        ('scenario = "mine.toml"\nexperiment = "free"', "remove the experiment"),
    ):
        spec.write_text(f"{text}\n[vary]\narm.l2 = [1, 2]\n")
        with pytest.raises(ParameterError, match=said):
            sweep.load_sweep(spec)


@pytest.mark.parametrize(
    "kw,word",
    [
        (dict(experiment="cut"), "experiment"),
        (dict(vary={}), "grid"),
        (dict(design="random"), "design"),
        (dict(runs=5), "runs"),
        (dict(design="lhs"), "runs"),
        (dict(vary={"bb": Range(1, 2, 2)}), "did you mean 'b'"),
        (dict(vary={"gain.z": Range(1, 2, 2)}), "did you mean 'gain.y'"),
        (dict(vary={"operator.weight": Range(1, 2, 2)}), "there are mass, damper, spring"),
        (dict(vary={"b": Range(-5, 2, 2)}), "b = -5"),
        (dict(chunk=0), "chunk"),
        (dict(fixed={"tmax": 3.0}), "t_max"),
        (dict(vary={"b": Range(1, 2, 10**8)}), "runs"),
    ],
)
def test_bad_sweeps_are_refused(kw, word):
    with pytest.raises(ParameterError) as e:
        Sweep(**{"experiment": "constant", "vary": parse_grid("b=1:2:2"), **kw})
    assert word in str(e.value)


def test_rows_say_what_the_runs_said(tmp_path):
    s = Sweep("constant", parse_grid("b=90 gain.y=0.5,1"), {}, chunk=2)
    assert sweep.run_sweep(s, tmp_path, workers=1) == 2
    rows = store.read_sweep(tmp_path).to_pylist()
    assert [r["status"] for r in rows] == ["finished", "diverged"]
    r = hc.simulate(hc.constant_cut())
    assert [rows[0][f"crossing{k}"] for k in (1, 2, 3)] == [c.time for c in r.crossings]
    assert rows[0]["fe_over_v_x"] == pytest.approx(90.0, rel=1e-6) and rows[0][
        "speed_x"
    ] == pytest.approx(0.01, rel=1e-3)
    assert (
        # of the worst pose in the clay, its far end: somewhat below the nominal 0.7748 / 0.5
        0.99 * 0.7748 / 0.5 < rows[0]["gain_margin_y"] < 0.7748 / 0.5
        and rows[1]["gain_margin_y"] < 1.0
    )
    assert rows[1]["axis"] == "y" and rows[0]["energy_residual"] < 1e-12


@pytest.mark.parametrize("margin", [True, False])
def test_clay_that_yields_has_no_linear_gain_margin(margin):
    clay = hc.slab(90.0 if margin else hc.Flow(Fy=0.1, b=90.0))
    r = hc.simulate(replace(hc.constant_cut(), clay=clay, t_max=0.05))
    row = sweep_rows.result_row(0, [], np.empty(0), r)
    assert [math.isfinite(row[f"gain_margin_{axis}"]) for axis in "xy"] == [margin, margin]


def test_a_refused_run_is_a_row(tmp_path):
    s = Sweep("constant", parse_grid("b=90 dt=0.001,0.5"), {"t_max": 0.01})
    sweep.run_sweep(s, tmp_path, workers=1)
    rows = store.read_sweep(tmp_path).to_pylist()
    assert [r["status"] for r in rows] == ["time limit", "refused"] and "dt = 0.5" in rows[1][
        "cause"
    ]


def test_only_what_is_missing_is_done_and_the_result_is_the_same(tmp_path):
    whole, torn = tmp_path / "whole", tmp_path / "torn"
    assert sweep.run_sweep(small(), whole, workers=1) == 6
    assert sweep.run_sweep(small(), whole, workers=1) == 0
    sweep.run_sweep(small(), torn, workers=1)
    store.part_file(torn, 1).unlink()
    (torn / "data" / ".part-000001.parquet.abc").write_bytes(b"half a file")
    assert store.missing_parts(small(), torn) == [range(2, 4)]
    assert sweep.run_sweep(small(), torn, workers=1) == 2
    assert columns(store.read_sweep(torn)) == columns(store.read_sweep(whole))


def test_two_processes_give_the_same(tmp_path):
    one, two = tmp_path / "1", tmp_path / "2"
    sweep.run_sweep(small(), one, workers=1)
    sweep.run_sweep(small(), two, workers=2)
    assert columns(store.read_sweep(one)) == columns(store.read_sweep(two))


def test_a_changed_sweep_is_refused_not_mixed(tmp_path):
    sweep.run_sweep(small(), tmp_path, workers=1)
    with pytest.raises(ParameterError, match="another sweep"):
        sweep.run_sweep(small(seed=1), tmp_path, workers=1)
    (tmp_path / "sweep.json").write_text("{")
    with pytest.raises(ParameterError, match="another sweep"):
        store.begin(small(), tmp_path)


def test_spec_file(tmp_path):
    spec = tmp_path / "s.toml"
    spec.write_text(
        'experiment = "free"\nchunk = 3\n'
        '[vary]\n"gain.x" = "1:2:2"\nforce = [1, 2]\n[fixed]\nt_max = 0.01\n'
    )
    s = Sweep(**sweep.load_sweep(spec))
    assert (s.experiment, len(s), s.chunk) == ("free", 4, 3)
    for text, word in (
        ("experiment = ", "TOML"),
        ("expermient = 'free'", "did you mean 'experiment'"),
        ("vary = 3", "table"),
    ):
        spec.write_text(text)
        with pytest.raises(ParameterError, match=word):
            sweep.load_sweep(spec)
    with pytest.raises(ParameterError, match="spec"):
        sweep.load_sweep(tmp_path / "none.toml")


COMMAND = [
    sys.executable,
    "-m",
    "hapticclay",
    "sweep",
    "--grid",
    "b=10:1000:40log gain.x=1:2:2",
    "--fixed",
    "t_max=0.3",
    "--chunk",
    "4",
    "--workers",
    "2",
    "--no-maps",
]


@pytest.mark.parametrize("how,code", [(signal.SIGKILL, -9), (signal.SIGINT, 130)])
def test_interrupted_and_killed_sweeps_go_on(tmp_path, capsys, monkeypatch, how, code):
    out = tmp_path / "o"
    with subprocess.Popen(
        [*COMMAND, "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as p:
        until(lambda: len(list((out / "data").glob("part-*"))) >= 2 or p.poll() is not None)
        if how == signal.SIGKILL:
            os.killpg(p.pid, how)
        else:
            p.send_signal(how)
        said, told = p.communicate(timeout=PATIENCE)
        assert p.returncode == code
    if how == signal.SIGINT:
        assert "resumes the sweep" in said and told.count(store_runs.FINISHING) == 1
        assert "Traceback" not in told
    done = len(list((out / "data").glob("part-*")))
    assert 2 <= done < 20
    store.read_sweep(out)  # whatever is there is valid
    monkeypatch.setattr(sweep_rows, "_least_limit", lambda *given: math.nan)  # most of a run's time
    words = [*COMMAND[COMMAND.index("sweep") :], "--workers", "1", "--out", str(out)]
    assert app.main(words) == 0 and "80 runs" in capsys.readouterr().out
    assert store.read_sweep(out)["run"].to_pylist() == list(range(80))


def test_command_draws_maps_and_complains_in_one_line(tmp_path, capsys, monkeypatch):
    args = ["sweep", "--grid", GRID, "--fixed", "t_max=0.02", "--out", str(tmp_path)]
    assert app.main([*args, "--workers", "1"]) == 0
    assert "6 runs" in capsys.readouterr().out and (tmp_path / "status.png").stat().st_size > 5000
    monkeypatch.setattr(store_runs, "run_part", None)  # nothing is left to make
    assert app.main([*args, "--no-maps"]) == 0 and "6 runs" in capsys.readouterr().out
    for extra, word in (
        (["--grid", "b=1:2"], "b = "),
        (["--grid", "b=1", "--runs", "3"], "runs"),
        ([], "either"),
        (["--grid", "b=1", "--design", "lhs"], "runs"),
        (["--grid", "b=1:2:2", "--workers", "0"], "workers"),
        (["--grid", "b=1:2:2", "--experiment", "fre"], "did you mean"),
        (["nothing.toml"], "spec"),
        (["--grid", GRID, "--fixed", "t_max"], "fixed"),
    ):
        assert app.main(["sweep", *extra, "--out", str(tmp_path / "x")]) == 2
        err = capsys.readouterr().err
        assert word in err and err.count("\n") == 1 and not (tmp_path / "x").exists()


def test_maps(tmp_path):
    sweep.run_sweep(
        Sweep("constant", parse_grid("b=10:1000:5log gain.y=0.3:1:3"), {"t_max": 2.0, "dt": 2e-3}),
        tmp_path,
        workers=1,
    )
    table = store.read_sweep(tmp_path)
    figure = sweep_plots.sweep_plot(table)
    ax = figure.axes[0]
    assert (
        ax.get_xlabel() == "b [N·s/m]" and ax.get_xscale() == "log" and ax.get_yscale() == "linear"
    )
    shown = {t.get_text() for t in figure.legends[0].get_texts()}
    assert shown == {
        *table["status"].to_pylist(),
        "gain margin of y < 1",
    }  # gain 1 on y, at b = 100
    sweep_plots.sweep_plot(table, "speed_x").savefig(tmp_path / "a.png")
    with pytest.raises(ParameterError, match="column"):
        sweep_plots.sweep_plot(table, "speedx")


@pytest.mark.parametrize("package,extra", [("pyarrow", "sweep"), ("distributed", "cluster")])
def test_missing_packages_are_named(package, extra, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ParameterError, match=rf"hapticclay\[{extra}\]"):
        sweep.run_sweep(
            small(), tmp_path, scheduler="tcp://127.0.0.1:1" if extra == "cluster" else None
        )


def spawn(*args, **kw):
    return subprocess.Popen(
        [sys.executable, "-m", *args], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, **kw
    )


@pytest.fixture
def scheduler(tmp_path):
    """The process of a scheduler, and its address: one for each test, since tests end it."""
    file = tmp_path / "scheduler.json"
    words = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    process = spawn("distributed.cli.dask_scheduler", *words)
    try:
        until(lambda: file.is_file() and file.stat().st_size, alive=lambda: process.poll() is None)
        yield process, json.loads(file.read_text())["address"]
    finally:
        process.kill()
        process.wait()


def test_cluster_with_a_worker_killed_gives_the_local_result(tmp_path, scheduler):
    """A real scheduler, two worker processes without a nanny, one killed with work in hand."""
    from distributed import Client

    s = Sweep("constant", parse_grid("b=10:1000:12log gain.x=1:2:2"), {"t_max": 0.5}, chunk=1)
    _, address = scheduler
    workers = []
    try:
        workers = [
            spawn(
                "distributed.cli.dask_worker",
                address,
                "--no-nanny",
                "--nthreads",
                "1",
                "--no-dashboard",
                cwd=tmp_path,
            )
            for _ in range(2)
        ]
        with Client(address, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
        killed = []

        def kill(n):
            if not killed:
                killed.append(workers[0].pid)
                workers[0].kill()

        far, here = tmp_path / "far", tmp_path / "here"
        assert sweep.run_sweep(s, far, scheduler=address, progress=kill) >= 24
        assert killed and workers[0].wait(PATIENCE) == -9
        sweep.run_sweep(s, here, workers=1)
        assert columns(store.read_sweep(far)) == columns(store.read_sweep(here))
    finally:
        for p in workers:
            p.kill()
            p.wait()


def test_unreachable_scheduler_is_one_line(tmp_path):
    with alarm(), pytest.raises(ParameterError, match="scheduler"):  # dask alone tries for ever
        sweep.run_sweep(small(), tmp_path, scheduler="tcp://127.0.0.1:9")
    assert 2.0 * store_runs.SCHEDULER_PATIENCE < 10.0  # dask tries for twice as long


KILL_WHEN_ASKED = """
import os, sys, time
from distributed import Client
client = Client(sys.argv[1])
while not client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.tasks)):
    time.sleep(0.05)
os.kill(int(sys.argv[2]), 9)
os._exit(0)  # without a word about the scheduler
"""


def test_a_scheduler_that_dies_is_one_line(tmp_path, capfd, scheduler):
    """It dies once it has tasks; no worker is there, so the sweep waits for results."""
    process, address = scheduler
    killer = subprocess.Popen([sys.executable, "-c", KILL_WHEN_ASKED, address, str(process.pid)])
    try:
        with pytest.raises(ConnectionError, match="has gone; the same command resumes"):
            sweep.run_sweep(small(), tmp_path / "sweep", scheduler=address)
        assert killer.wait(PATIENCE) == 0
    finally:
        killer.kill()
        killer.wait()
    assert capfd.readouterr().err == ""


def test_a_damaged_folder_is_refused(tmp_path):
    with pytest.raises(ParameterError, match="hapticclay sweep has written"):
        store.read_sweep(tmp_path)
    Path(tmp_path / "data").mkdir()
    with pytest.raises(ParameterError):
        store.read_sweep(tmp_path)


def test_parts_without_marks_as_0_1_0_wrote_them_are_read(tmp_path):
    import pyarrow.parquet as pq

    sweep.run_sweep(small(), tmp_path, workers=1)
    marked = columns(store.read_sweep(tmp_path))
    for n in range(3):
        file = store.part_file(tmp_path, n)
        pq.write_table(store.read_part(file).replace_schema_metadata(None), file)
    assert columns(store.read_sweep(tmp_path)) == marked


def test_an_estimate_leaves_out_the_first_run_and_patience_is_limited(monkeypatch):
    """On a made-up clock: the first run compiles for a minute, each further one takes `each`."""
    s = Sweep("constant", parse_grid("b=10:1000:40log gain.x=1:2:25"), {"t_max": 0.01})
    real = sweep.run_point
    for each, runs in (
        (0.25, sweep.PROBES + 1),
        (0.5, 12),
        (30.0, 2),
    ):  # 11 of 0.5 s are more than 5 s, and one of 30
        clock, made = [0.0], []

        def timed(*args, each=each, clock=clock, made=made):
            clock[0] += each if made else 60.0
            made.append(args[1])
            return real(*args)

        monkeypatch.setattr(sweep, "run_point", timed)
        monkeypatch.setattr(sweep_command.time, "perf_counter", lambda clock=clock: clock[0])
        assert sweep.estimate_time(s)[0] == pytest.approx(each, rel=1e-12)
        assert len(made) == runs and made[0] == made[1]


def test_an_estimated_size_is_that_of_the_files(tmp_path, monkeypatch):
    monkeypatch.setattr(sweep_rows, "_least_limit", lambda *given: 1.0 / 3.0)  # most of their time
    fixed = {"t_max": 0.4, "dt": 2e-3}
    s = Sweep("constant", parse_grid("b=10:1000:16log gain.x=0.5:2:16"), fixed, chunk=64)
    guess = sweep.estimate_time(s)[1] * len(s)
    sweep.run_sweep(s, tmp_path, workers=1)
    size = sum(f.stat().st_size for f in (tmp_path / "data").iterdir())
    assert guess == pytest.approx(
        size, rel=0.3
    )  # 20 of 256 runs, some with a longer cause than others


def test_without_a_terminal_a_line_tells_every_tenth(tmp_path, capsys, monkeypatch):
    args = [
        "sweep",
        "--grid",
        "b=10:1000:30log gain.x=1:2:2",
        "--fixed",
        "t_max=0.01",
        "--chunk",
        "1",
        "--workers",
        "1",
        "--no-maps",
        "--out",
        str(tmp_path),
    ]
    monkeypatch.setattr(sweep_command, "LARGE_SWEEP", 60)
    monkeypatch.setattr(sweep_rows, "_least_limit", lambda *given: math.nan)  # most of their time
    assert app.main(args) == 0
    first, *lines = capsys.readouterr().err.splitlines()
    assert re.fullmatch(
        r"hapticclay: 60 runs, [\d.]+ ms each: about \d\d:\d\d on 1 process, \d+kB in .*data "
        r".* free.",
        first,
    )
    told = [
        re.match(r"hapticclay: (\d+) of 60 runs, (\d+) %, \d\d:\d\d gone, \d\d:\d\d to go", x)
        for x in lines
    ]
    assert [(int(m[1]), int(m[2])) for m in told if m] == [(6 * k, 10 * k) for k in range(1, 11)]
    for n in range(30):
        store.part_file(tmp_path, n).unlink()
    ticks = iter(range(0, 10**6, 100))  # seconds, 100 from one look at the clock to the next
    monkeypatch.setattr(sweep_command.time, "monotonic", lambda: next(ticks))
    assert app.main(args) == 0
    lines = (
        capsys.readouterr().err.splitlines()
    )  # half of them is there: no estimate, and a line after each
    assert [int(x.split()[1]) for x in lines] == list(range(31, 61))
    assert lines[0].endswith("31 of 60 runs, 52 %, 01:40 gone, 48:20 to go")


@pytest.mark.parametrize(
    "design,text,word",
    [
        ("lhs", "b=1:1000:50log", "must have no count"),
        ("sobol", "b=1:2:2", "must have no count"),
        ("grid", "b=1:2", "have a count"),
        ("grid", "b=1:10log", "have a count"),
    ],
)
def test_only_a_grid_counts(design, text, word):
    with pytest.raises(ParameterError, match=f"b = .*{word}.*{design}"):
        Sweep("constant", parse_grid(text), {}, design, None if design == "grid" else 8)


@pytest.mark.parametrize(
    "text", ["b=1:1000log gain.x=0:2", "b=1:1000 log  gain.x=0:2", "gain.x=0:2 b=1:1000 log"]
)
def test_samples_need_no_count(text):
    vary = parse_grid(text)
    assert vary == {"b": Range(1.0, 1000.0, log=True), "gain.x": Range(0.0, 2.0)}
    listed = Sweep("constant", {**vary, "gain.y": Range.parse("gain.y", "0.3,0.5")}, {}, "sobol", 8)
    assert set(listed.points(0, 8)[:, 2]) == {0.3, 0.5}
    assert Range.parse("b", "1:1000:50 log") == Range(1.0, 1000.0, 50, True)


def hatched(figure):
    """Number of cells and label of each kind without figure."""
    shown = [p for p in figure.axes[0].patches if p.get_hatch()]
    names = [t.get_text() for t in figure.legends[0].get_texts()]
    return {n: len(p.get_path().to_polygons()) for n, p in zip(names, shown, strict=True)}


def test_a_map_shows_what_was_never_reached_as_such(tmp_path):
    """The slab begins at 5 cm: runs of 3 s reach it with 1 N on the handle, not with 0.01 N."""
    sweep.run_sweep(
        Sweep("constant", parse_grid("b=20:50:3 force=0,0.01,1"), {"t_max": 3.0, "dt": 2e-3}),
        tmp_path,
        workers=1,
    )
    table = store.read_sweep(tmp_path)
    for value in ("fe_over_v_x", "speed_x"):
        assert (
            sweep_plots.missing_reasons(table, value)
            == ["no clay reached", "no clay reached", ""] * 3
        )
        figure = sweep_plots.sweep_plot(table, value)
        shown = figure.axes[0].collections[0].get_array()
        np.testing.assert_array_equal(
            np.ma.getmaskarray(shown), [[True] * 3, [True] * 3, [False] * 3]
        )
        np.testing.assert_allclose(
            shown[2], [r[value] for r in table.to_pylist() if r["force"] == 1.0]
        )
        assert hatched(figure) == {"no clay reached": 6}
    assert hatched(sweep_plots.sweep_plot(table, "crossing1")) == {"border not reached": 6}
    assert figure.axes[1].get_ylabel() == "speed x [m/s]"
    free = table.set_column(
        table.column_names.index("b_x"), "b_x", [[0.0] * 9]
    )  # an experiment without clay
    assert "no clay reached" not in sweep_plots.missing_reasons(free, "speed_x")
    assert set(sweep_plots.missing_reasons(free, "fe_over_v_x")) == {"no clay reached"}


@pytest.mark.parametrize(
    "value,ringed",
    [
        ("status", {"x": [10.0, 31.0], "y": [57.0, 88.0]}),
        ("speed_x", {"x": [10.0, 31.0]}),  # a column of one axis, by its own verdict
        ("speed_y", {"y": [57.0, 88.0]}),
    ],
)
def test_a_sampled_map_rings_the_runs_whose_gain_margin_is_below_one(value, ringed):
    pa = pytest.importorskip("pyarrow")
    margins = np.array([0.5, 1.0, 0.999, 3.0, math.nan, math.nan])  # of x; of y below
    runs = {
        "run": np.arange(6),
        "b": np.array([10.0, 25.0, 31.0, 57.0, 64.0, 88.0]),
        "gain.x": np.array([0.3, 1.7, 2.2, 0.9, 5.1, 4.4]),
        "status": ["diverged", *["time limit"] * 4, "refused"],
        "gain_margin_x": margins,
        "gain_margin_y": np.array([2.0, 2.0, 2.0, 0.1, 7.0, 0.9]),
        "speed_x": np.array([math.nan, 0.1, 0.2, 0.3, 0.4, math.nan]),
        "b_x": np.full(6, 90.0),
    }
    runs |= {"speed_y": runs["speed_x"], "b_y": runs["b_x"]}
    figure = sweep_plots.sweep_plot(pa.table(runs), value)
    labels = [t.get_text() for t in figure.legends[0].get_texts()]
    for axis in "xy":
        label = f"gain margin of {axis} < 1"
        found = [c for c in figure.axes[0].collections if c.get_label() == label]
        assert labels.count(label) == len(found) == (axis in ringed)
        for rings in found:
            np.testing.assert_array_equal(rings.get_offsets()[:, 0], ringed[axis])
    runs |= {"gain_margin_x": np.full(6, 1.0), "gain_margin_y": np.full(6, math.nan)}
    legend = sweep_plots.sweep_plot(pa.table(runs), value).legends[0]
    assert not any("gain margin" in t.get_text() for t in legend.get_texts())


def test_a_sampled_map_marks_what_has_no_figure(tmp_path):
    s = Sweep(
        "constant",
        parse_grid("b=20:60 force=0.01:1 dt=0.5,0.002"),
        {"t_max": 0.5},
        "lhs",
        40,
        seed=4,
    )
    sweep.run_sweep(s, tmp_path, workers=1)
    table = store.read_sweep(tmp_path)
    why = sweep_plots.missing_reasons(table, "fe_over_v_x")
    marks = {
        c.get_label(): len(c.get_offsets())
        for c in sweep_plots.sweep_plot(table, "fe_over_v_x").axes[0].collections
    }
    for name in ("refused", "no clay reached"):
        assert marks[name] == why.count(name) > 0
    assert sum(marks.values()) == 40 and why.count("refused") == table["status"].to_pylist().count(
        "refused"
    )


def test_every_column_and_parameter_has_its_unit(tmp_path):
    """Units of the docstrings; a ratio names what it is relative to."""
    sweep.run_sweep(small(), tmp_path, workers=1)
    table = store.read_sweep(tmp_path)
    units = {
        "end_time": "s",
        "crossing2": "s",
        "b_y": "N.s/m",
        "fe_over_v_y": "N.s/m",
        "speed_x": "m/s",
        "wall_time": "s",
        "gain_margin_x": "factor on K",
        "energy_residual": "share of the energy put through",
    }
    for name, unit in units.items():
        assert name in table.column_names and sweep_plots._column_label(name).endswith(f" [{unit}]")
    for name, unit in {
        "operator.damper": "N.s/m",
        "operator.mass": "kg",
        "gain.x": "1/kg",
        "force.y": "N",
    }.items():
        assert sweep_plots._column_label(name).endswith(f" [{unit}]")
    for make in hc.SCENARIOS.values():
        for name, parameter in inspect.signature(make).parameters.items():
            if isinstance(parameter.default, float) or (
                isinstance(parameter.default, tuple) and isinstance(parameter.default[0], float)
            ):
                assert "[" in sweep_plots._column_label(name), name
    for text in ("axis", "cause"):
        with pytest.raises(ParameterError, match="column"):
            sweep_plots.sweep_plot(table, text)


def files_of(out):
    return sorted((out / "data").glob("part-*"))


def whole(plan, out):
    """Whether the folder has each run once, in order."""
    return store.read_sweep(out)["run"].to_pylist() == list(range(len(plan)))


@pytest.mark.parametrize("workers", [1, 2])
def test_files_are_few_however_long_a_run_takes(tmp_path, monkeypatch, workers):
    """On a made-up clock, in one process: the first run seems to take minutes, as on a busy machine
    or where it compiles; each other one 0.05 s or 5 s.

    A file takes 1.5 s or 5 % of the time T spent so far, whichever is longer. So there are 20 files
    in the first 30 s, and then ln(T/30 s)/ln(1.05).
    """
    free = Sweep("constant", parse_grid("b=5:1000:40log gain.x=0.2:8:40"), {"t_max": 0.003})
    for each, most in ((0.05, 20 + 21 + 2), (5.0, 1 + math.log(1600 * 5.0 / 100.0, 1.05))):
        clock, made = [0.0], []

        def timed(plan, index, point, each=each, clock=clock, made=made):
            clock[0] += each if made else 300.0
            made.append(index)
            return sweep_rows.result_row(index, list(plan.vary), point, None)

        monkeypatch.setattr(sweep, "run_point", timed)
        monkeypatch.setattr(sweep.time, "perf_counter", lambda clock=clock: clock[0])
        out = tmp_path / f"{each}-{workers}"
        assert sweep.run_sweep(free, out, workers=1) == 1600 == len(set(made))
        assert whole(free, out) and len(files_of(out)) <= most


def test_short_runs_are_few_files_of_two_processes(tmp_path, monkeypatch):
    """A file takes 0.2 s: far fewer files than runs, and none of them lost."""
    monkeypatch.setattr(store_runs, "CHUNK_TIME", 0.2)
    free = Sweep("constant", parse_grid("b=5:1000:12log gain.x=0.2:8:12"), {"t_max": 0.02})
    assert sweep.run_sweep(free, tmp_path, workers=2) == 144
    assert whole(free, tmp_path) and 2 < len(files_of(tmp_path)) <= 40
    assert sweep.run_sweep(free, tmp_path, workers=2) == 0


@given(st.data())
def test_runs_handed_out_in_any_order_are_made_once(data):
    """Tasks end in any order, after any share of their runs: each run is made, and made once."""
    n, crew = data.draw(st.integers(1, 300)), data.draw(st.integers(1, 5))
    plan = Sweep("constant", {"b": Range(1.0, 2.0 + n, n)})
    cuts = sorted(data.draw(st.sets(st.integers(0, n), max_size=6)) | {0, n})
    gaps = [range(a, b) for a, b in zip(cuts, cuts[1:], strict=False)][::2]
    work, jobs, made = store_runs.Work(plan, gaps, 1.0), [], []
    while True:
        while len(jobs) < crew and (runs := work.take(crew)):
            jobs.append(runs)
        if not jobs:
            break
        runs = jobs.pop(data.draw(st.integers(0, len(jobs) - 1)))
        k = data.draw(st.integers(1, len(runs)))
        made += runs[:k]
        work.give_back(runs, k, data.draw(st.floats(1e-4, 1e3)))
    assert sorted(made) == [i for gap in gaps for i in gap] and work.count == 0


def test_ctrl_c_waits_for_one_run_and_loses_none(tmp_path, monkeypatch):
    free, real, made = replace(small(), chunk=None), sweep.run_point, []

    def struck(plan, index, point):
        if index == 3:
            signal.raise_signal(signal.SIGINT)
        made.append(index)
        return real(plan, index, point)

    monkeypatch.setattr(sweep, "run_point", struck)
    with pytest.raises(KeyboardInterrupt):
        sweep.run_sweep(free, tmp_path, workers=1)
    assert made == [0, 1, 2, 3] and store.missing_parts(free, tmp_path) == [range(4, 6)]
    with pytest.warns(hc.Warning, match="4 of 6 runs are in"):
        store.read_sweep(tmp_path)
    monkeypatch.undo()
    assert sweep.run_sweep(free, tmp_path, workers=1) == 2 and whole(free, tmp_path)


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_lost_file_is_made_again_between_the_others(tmp_path, lost):
    """Files of any size, as they remain after interruptions."""
    free = replace(small(), chunk=None)
    with store.claimed(free, tmp_path) as (plan, _):
        for a, b in ((0, 1), (1, 4), (4, 6)):
            store_runs.run_part(plan, range(a, b), str(tmp_path))
    same = columns(store.read_sweep(tmp_path))
    gone = [(0, 1), (1, 4), (4, 6)][lost]
    store.part_file(tmp_path, gone[0]).unlink()
    assert store.missing_parts(free, tmp_path) == [range(*gone)]
    assert sweep.run_sweep(free, tmp_path, workers=1) == gone[1] - gone[0]
    assert columns(store.read_sweep(tmp_path)) == same


def test_files_that_share_runs_are_refused_and_made_again(tmp_path, capsys):
    """As a worker of a cluster would leave them that was thought dead."""
    free = replace(small(), chunk=None)
    with store.claimed(free, tmp_path) as (plan, _):
        for a, b in ((0, 4), (2, 5), (5, 6)):
            store_runs.run_part(plan, range(a, b), str(tmp_path))
    with pytest.raises(ParameterError, match="must have each run once"):
        store.read_sweep(tmp_path)
    assert sweep.run_sweep(free, tmp_path, workers=1) == 1 and whole(free, tmp_path)
    assert "part-000002.parquet (has runs of another)" in capsys.readouterr().err


def test_a_resumed_sweep_keeps_its_chunks(tmp_path):
    free, given_ = replace(small(), chunk=None), replace(small(), chunk=4)
    sweep.run_sweep(given_, tmp_path, workers=1)
    store.part_file(tmp_path, 1).unlink()
    assert sweep.run_sweep(free, tmp_path, workers=1) == 2  # the chunk of the folder
    assert sweep.run_sweep(given_, tmp_path, workers=1) == 0
    with pytest.raises(ParameterError, match="another sweep"):
        sweep.run_sweep(small(), tmp_path, workers=1)
    for text in ("[1]", '{"chunk": true}', '{"chunk": "many"}', '{"chunk": -1}', "[" * 10**5):
        (tmp_path / "sweep.json").write_text(text)
        with pytest.raises(ParameterError, match="another sweep"):
            sweep.run_sweep(free, tmp_path, workers=1)


def test_results_are_the_same_bits_whatever_the_chunk(tmp_path, monkeypatch):
    found = []
    for size in (1, 4, 100, None):
        plan, out = replace(small(), chunk=size), tmp_path / str(size)
        sweep.run_sweep(plan, out, workers=1)
        found.append(columns(store.read_sweep(out)))
    assert found[1:] == found[:1] * 3


def test_of_two_workers_only_the_chunks_in_progress_are_finished(tmp_path):
    """An interruption waits for one chunk a worker, none that stands ready behind them."""
    plan = Sweep("constant", parse_grid("b=10:1000:20log gain.x=1:2:2"), {"t_max": 0.2}, chunk=2)
    with store.claimed(plan, tmp_path) as (_, todo):
        results = store_runs.run_chunks(plan, tmp_path, todo, 2)
        assert next(results) == 2
        with contextlib.suppress(KeyboardInterrupt):
            results.throw(KeyboardInterrupt)
    assert len(list((tmp_path / "data").glob("part-*"))) <= 3


def test_ctrl_c_with_one_worker_finishes_the_chunk(tmp_path, monkeypatch, capsys):
    real = sweep.run_point

    def struck(plan, index, point):
        if index == 2:  # the first of the second chunk
            signal.raise_signal(signal.SIGINT)
            assert "finishing the chunks in progress" in capsys.readouterr().err
        return real(plan, index, point)

    monkeypatch.setattr(sweep, "run_point", struck)
    with pytest.raises(KeyboardInterrupt):
        sweep.run_sweep(small(), tmp_path, workers=1)
    assert store.missing_parts(small(), tmp_path) == [range(4, 6)]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    monkeypatch.undo()
    sweep.run_sweep(small(), tmp_path, workers=1)
    assert len(store.read_sweep(tmp_path)) == len(small())
