import dataclasses
import errno
import json
import os
import zipfile

import numpy as np
import pytest

import hapticclay as hc
from hapticclay import files
from hapticclay.errors import ParameterError
from hapticclay.simulation import record


@pytest.fixture(scope="module")
def run():
    return hc.simulate(hc.constant_cut(operator=hc.Operator(), force=(2.0, 0.0), t_max=2.0))


def test_save_and_load_give_back_the_same_record(run, tmp_path):
    folder = run.save(tmp_path / "a" / "b")
    assert sorted(p.name for p in folder.iterdir()) == [
        "record.npz",
        "scenario.toml",
        "summary.json",
    ]
    for path in (folder, folder / "record.npz"):
        again = hc.Record.load(path)
        for f in dataclasses.fields(run):
            a, b = getattr(run, f.name), getattr(again, f.name)
            if isinstance(a, np.ndarray):
                np.testing.assert_array_equal(a, b)
            else:
                assert a == b, f.name


def test_every_array_is_named_shaped_and_has_a_unit(run):
    n = len(run.t)
    for name in record.ARRAYS:
        assert getattr(run, name).shape == ((n,) if name == "t" else (n, 2))
        assert getattr(run, name).dtype == np.float64


def test_summary_holds_what_a_reader_needs(run, tmp_path):
    s = json.loads(
        (run.save(tmp_path) / "summary.json").read_text(), parse_constant=lambda x: pytest.fail(x)
    )
    assert s["schema"] == record.RECORD_SCHEMA and s["status"].startswith("time limit")
    assert s["crossings"][0]["border"] == 0.05 and s["crossings"][0]["speed"] > 0.1
    assert s["steps"] == run.steps and s["real_time_factor"] > 0
    assert set(s["versions"]) >= {"python", "hapticclay", "mujoco", "numpy"}
    assert s["units"]["fe"] == "N"
    clay = s["regions"][-1]["x"]
    assert clay["b"] == 90.0 and clay["fe_over_v"]["mean"] == pytest.approx(90.0)
    assert clay["fe_over_v"]["std"] < 1e-9


def test_regions_report_the_steady_cut():
    r = hc.simulate(hc.constant_cut())
    x = [e["x"] for e in r.summary()["regions"]]
    assert [e["b"] for e in x] == [0.0, 90.0, 0.0]
    assert x[1]["steady_speed"] == pytest.approx(0.01, rel=1e-3)
    assert x[1]["expected_speed"] == 0.01
    assert x[1]["steady_fh_over_v"]["mean"] == pytest.approx(100.0, rel=1e-3)
    assert x[0]["fe_over_v"]["mean"] == 0.0


def test_record_can_be_read_without_pickle(run, tmp_path):
    with zipfile.ZipFile(run.save(tmp_path) / "record.npz") as z:
        for name in z.namelist():
            assert b"|O" not in z.read(name)[:128]


@pytest.mark.parametrize("force", ["much", [[1.0, 2.0]] * 3])
def test_a_ratio_of_what_is_no_force_of_the_run_is_refused(force, run):
    with pytest.raises(ParameterError, match="force = .*must be numbers of shape"):
        run.ratio(force)


@pytest.mark.parametrize("content", [b"", b"not a record", None])
def test_load_refuses_what_is_no_record(content, tmp_path):
    file = tmp_path / "record.npz"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(ParameterError, match="record"):
        hc.Record.load(file)


def test_load_refuses_a_damaged_record(run, tmp_path):
    file = run.save(tmp_path) / "record.npz"
    whole = file.read_bytes()
    rng = np.random.default_rng(0)
    for at in rng.integers(0, len(whole), 30):
        file.write_bytes(whole[:at])
        with pytest.raises(ParameterError, match="record"):
            hc.Record.load(file)
    for change in ({"steps": None}, {"scenario": {"nonsense": 1}}, {"outcome": []}):
        arrays = {name: getattr(run, name) for name in record.ARRAYS}
        np.savez(
            file, summary=np.array(json.dumps({"schema": record.RECORD_SCHEMA, **change})), **arrays
        )
        with pytest.raises(ParameterError, match="record"):
            hc.Record.load(file)
    np.save(tmp_path / "a.npy", np.zeros(3))
    with pytest.raises(ParameterError, match="record"):
        hc.Record.load(tmp_path / "a.npy")


@pytest.mark.parametrize(
    "name,change",
    [
        ("fe", lambda x: x[:-1]),
        ("p", lambda x: x[:, 0]),
        ("b", lambda x: x[:, :1]),
        ("t", lambda x: x[:, None]),
        ("t", lambda x: x[0]),
        ("tau", lambda x: np.stack((x, x))),
        ("t", lambda x: x[::-1]),
        ("v", lambda x: x.astype(np.float32)),
        ("q", lambda x: x.astype(int)),
        ("qd", lambda x: x.astype(complex)),
        ("delta", lambda x: x.astype("U8")),
        ("fh", lambda x: np.where(x == x[7], np.nan, x)),
        ("v", lambda x: x + np.inf),
        ("removed", lambda x: x[:, None]),
        ("removal_rate", lambda x: x[1:]),
        ("target", lambda x: x[:, 0]),
        ("gain", lambda x: x.astype(int)),
        ("target", lambda x: np.nan * x),
    ],
)
def test_load_refuses_an_array_that_is_not_what_it_must_be_and_names_it(
    run, tmp_path, name, change
):
    n = len(run.t)
    extra = {
        "removed": np.zeros(n),
        "removal_rate": np.zeros(n),
        "target": np.zeros((n, 2)),
        "gain": np.ones((n, 2)),
    }
    file = dataclasses.replace(run, extra=extra).save(tmp_path) / "record.npz"
    hc.Record.load(file)
    with np.load(file) as z:
        arrays = dict(z)
    np.savez(file, **{**arrays, name: change(arrays[name])})
    with pytest.raises(ParameterError, match=f"record = .*array {name} must"):
        hc.Record.load(file)


def test_load_refuses_another_schema(run, tmp_path, monkeypatch):
    monkeypatch.setattr(record, "RECORD_SCHEMA", "hapticclay-record-0")
    run.save(tmp_path)
    monkeypatch.undo()
    with pytest.raises(ParameterError, match="schema"):
        hc.Record.load(tmp_path)


@pytest.mark.parametrize("moment", ["fsync", "replace"])
def test_a_full_disk_leaves_nothing_half_written(run, tmp_path, monkeypatch, moment):
    def full(*args, **kw):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, moment, full)
    with pytest.raises(ParameterError, match="No space left"):
        run.save(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_write_keeps_the_old_file(tmp_path):
    file = tmp_path / "x"
    file.write_text("old")
    with pytest.raises(KeyboardInterrupt), files.atomic(file) as f:
        f.write(b"new")
        raise KeyboardInterrupt
    assert file.read_text() == "old" and len(list(tmp_path.iterdir())) == 1


def test_save_refuses_an_unwritable_place(run):
    with pytest.raises(ParameterError, match="writable"):
        run.save("/proc/nowhere")


def test_ratio_is_nan_only_where_nothing_moves(run):
    assert np.isnan(run.ratio(run.fe)[0, 0])
    assert np.all(np.isfinite(run.ratio(run.fe)[1:, 0]))


BEFORE_PARTS = {  # a scenario as release 0.1 wrote it in its records
    "name": "stability",
    "clay": {
        axis: {"edges": [0.01], "values": [0.0, 100.0], "along": "x", "growth": [0.0, 3.0]}
        for axis in ("x", "y")
    },
    "gain": [2.0, 0.5],
    "force": [0.0, 0.0],
    "operator": {"mass": 0.25, "damper": 2.0, "spring": 6.0},
    "inertia_shaping": False,
    "dt": 0.00036,
    "t_max": 0.1,
    "length": None,
    "start": [0.0, 0.0],
    "velocity": [0.0, 0.0],
    "origin": [0.35, 0.24],
    "torque_limit": [40.0, 40.0],
    "integrator": "fast",
    "control": "sampled",
    "Ts": None,
    "render": "held",
    "muscle": {
        "rms": [1.0, 0.0],
        "low": 0.1,
        "high": 2.0,
        "period": 20.0,
        "lines": None,
        "seed": 7,
    },
    "command": None,
    "stop": False,
    "hardware": {"delay": 0.0001, "coupling": {"spring": 1e4, "damper": 10.0}, "seed": 3},
}


def test_a_record_of_the_release_before_is_read(run, tmp_path):
    file = run.save(tmp_path) / "record.npz"
    with np.load(file) as z:
        arrays = dict(z)
    head = json.loads(str(arrays.pop("summary")))
    head["scenario"] = BEFORE_PARTS
    np.savez(file, summary=np.array(json.dumps(head)), **arrays)
    profile = hc.Profile((0.01,), (0.0, 100.0), growth=(0.0, 3.0))
    assert hc.Record.load(tmp_path).scenario == hc.Scenario(
        "stability",
        hc.Clay(profile, profile),
        (2.0, 0.5),
        (0.0, 0.0),
        hc.Operator(),
        t_max=0.1,
        length=None,
        origin=(0.35, 0.24),
        control="sampled",
        muscle=hc.Multisine(seed=7),
        stop_when_unstable=False,
        hardware=hc.Hardware(delay=1e-4, coupling=hc.Coupling(1e4, 10.0), seed=3),
    )


def test_the_scenario_lies_beside_the_record(run, tmp_path):
    folder = run.save(tmp_path)
    assert hc.Scenario.load(folder / "scenario.toml") == run.scenario
    assert "[operator]" in (folder / "scenario.toml").read_text()


def law(t, q, qd, fh, state, params):
    return (0.0, 0.0), state


def test_a_function_that_others_cannot_find_is_left_out(run, tmp_path):
    sampled = dataclasses.replace(run.scenario, control="sampled")
    for function, kept in ((lambda *a: law(*a), False), (json.dumps, True)):
        (tmp_path / "scenario.toml").write_text("of an earlier run")
        scenario = dataclasses.replace(sampled, controller=hc.Controller(function, (1.0,)))
        dataclasses.replace(run, scenario=scenario).save(tmp_path)
        again = hc.Record.load(tmp_path)
        assert again.scenario == (scenario if kept else sampled)
        assert again.notes == ({} if kept else {"left_out": ["controller"]})
        assert (tmp_path / "scenario.toml").exists() == kept
    assert hc.Scenario.load(tmp_path / "scenario.toml") == scenario
    with np.load(tmp_path / "record.npz") as z:
        arrays = dict(z)
    text = str(arrays.pop("summary")).replace("json:dumps", "nowhere:law")
    np.savez(tmp_path / "record.npz", summary=np.array(text), **arrays)
    again = hc.Record.load(tmp_path)  # a name is text until a run starts
    assert again.scenario.controller.law == "nowhere:law" and not again.notes
