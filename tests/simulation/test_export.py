"""Records in other programs' formats, read back by each format's own library, value for value."""

import csv
import dataclasses
import errno
import json
import os
import subprocess
import sys

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.errors import ParameterError
from hapticclay.fields import make_part
from hapticclay.scene.scenario import Scenario
from hapticclay.simulation import export, tables
from hapticclay.simulation.columns import COLUMNS

FORMATS = tuple(export.EXPORTS)
EXACT = {"nc", "parquet", "csv", "mat", "mcap"}  # hold t as a double; rrd has whole nanoseconds


def cut(**kw):
    return hc.simulate(hc.constant_cut(t_max=0.8, dt=1e-3), **kw)


def grooved():
    """A record with ground and removed volume."""
    block = hc.Groove((0.01, 0.06), (-0.02, 0.02), 2e4, tool=hc.Tool(0.01, 0.004))
    scenario = dataclasses.replace(
        hc.constant_cut(force=(6.0, 0.0), t_max=0.5, dt=1e-3), clay=hc.Clay.of_groove(block)
    )
    return hc.simulate(scenario)


def stuck():
    """A record with stops: the clay holds the handle at once."""
    clay = hc.slab(hc.Flow(Fy=5.0, b=20.0), 0.0, 0.1)
    return hc.simulate(dataclasses.replace(hc.constant_cut(t_max=0.3, dt=1e-3), clay=clay))


def springy():
    """A record in clay that springs back."""
    law = hc.Profile((0.002,), (0.0, 5.0), springs=(hc.Spring(), hc.Spring(k=1e3)))
    return hc.simulate(
        dataclasses.replace(hc.constant_cut(t_max=0.3, dt=1e-3), clay=hc.Clay(law, law))
    )


def extra():
    """As a session leaves it, with names and notes that need care."""
    r = cut(every=3)
    n = len(r.t)
    more = {
        "removed": np.linspace(0.0, 1e-5, n),
        "removal_rate": np.full(n, 1e-6),
        "target": r.p + 1e-3,
        "gain": np.ones((n, 2)),
    }
    scenario = dataclasses.replace(r.scenario, name='Größe "ü" <b>&\n,;# 漢')
    return dataclasses.replace(r, extra=more, notes={"tool": {"width": 0.02}}, scenario=scenario)


def with_gaps():
    """NaN and infinity, as a record made by hand may hold."""
    r = cut()
    v = r.v.copy()
    v[3, 0], v[4, 1], v[5, 0] = np.nan, np.nan, np.nan
    return dataclasses.replace(r, v=v)


def empty():
    """No samples at all."""
    r = cut()
    none = {name: x[:0] for name, x in tables.recorded_arrays(r).items()}
    return dataclasses.replace(r, **none)


MAKES = {f.__name__: f for f in (cut, grooved, stuck, springy, extra, with_gaps, empty)}


@pytest.fixture(scope="module")
def records():
    return {name: make() for name, make in MAKES.items()}


def columns_of(record):
    return tables.record_columns(record)


def read_nc(file):
    import xarray as xr

    with xr.open_dataset(file, engine="h5netcdf") as ds:
        ds.load()
    out = {"t": ds["time"].values}
    for name in ds.data_vars:
        if name == "ground":
            continue
        x = ds[name]
        last = x.dims[-1]
        if last == "time":
            out[name] = x.values
        else:
            out |= {f"{name}_{p}": x.sel({last: p}).values for p in ds[last].values.tolist()}
    return out, json.loads(ds.attrs["scenario"]), ds.attrs["status"]


def read_parquet(file):
    import pandas as pd

    df = pd.read_parquet(file)
    told = df.attrs
    return {n: df[n].to_numpy() for n in df}, json.loads(told["scenario"]), told["status"]


def read_csv(file):
    text = (x for x in file.read_text().splitlines() if not x.startswith("#"))
    names, *rows = csv.reader(text)
    values = np.array(rows, dtype=float).reshape(-1, len(names))
    return dict(zip(names, values.T, strict=True)), None, None


def read_mcap(file):
    from mcap.reader import make_reader

    out, told = {}, None
    with open(file, "rb") as f:
        reader = make_reader(f)
        for _, channel, message in reader.iter_messages():
            assert (channel.topic, channel.message_encoding) == ("/hapticclay", "json")
            sample = json.loads(message.data)
            assert message.log_time == round(1e9 * sample["t"])
            for name, x in sample.items():
                each = (
                    {f"{name}_{p}": v for p, v in x.items()} if isinstance(x, dict) else {name: x}
                )
                for column, v in each.items():
                    out.setdefault(column, []).append(np.nan if v is None else v)
        (told,) = [m.metadata for m in reader.iter_metadata()]
    values = {n: np.array(x, dtype=float) for n, x in out.items()}
    return values, json.loads(told["scenario"]), told["status"]


def rrd_tables(file):
    """Tables of a Rerun file by its own reader; columns are t and /entity:component."""
    try:
        from rerun.chunk import RrdReader
    except ImportError:  # an older one: what is static, then rows
        from rerun.dataframe import load_recording

        recording = load_recording(file)
        view = recording.view(index="t", contents="/**")
        has_rows = "t" in [x.name for x in recording.schema().index_columns()]
        for read in (view.select_static, view.select)[: 1 + has_rows]:
            table = read().read_all()
            yield dict(zip(table.schema.names, table.columns, strict=True))
        return
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch()
        names = [x if x == "t" else f"{chunk.entity_path}:{x}" for x in batch.schema.names]
        yield dict(zip(names, batch.columns, strict=True))


def read_rrd(file):
    out, names, told = {}, {}, {}
    for table in rrd_tables(file):
        for column, values in table.items():
            where, _, what = column.removeprefix("/").partition(":")
            if what == "SeriesLines:names":
                names[where] = [x.split(" [")[0] for x in values.to_pylist()[0]]
            elif what == "TextDocument:text":
                told[where] = values.to_pylist()[0][0]
            elif what == "Scalars:scalars":
                t = table["t"].cast("int64").to_numpy() * 1e-9
                out.setdefault(where, []).append((t, np.array(values.to_pylist(), dtype=float)))
    values = {}
    for where, parts in out.items():
        parts.sort(key=lambda x: x[0][0])
        values["t"] = np.concatenate([t for t, _ in parts])
        x = np.concatenate([x for _, x in parts])
        values |= dict(zip(names[where], x.T, strict=True))
    return values, json.loads(told["about/scenario"]), told["about/status"]


def read_mat(file):
    from scipy.io import loadmat

    m = loadmat(file)
    out = {}
    for name in m["units"].dtype.names:
        if name == "ground":
            continue
        parts = COLUMNS[name].parts
        out |= (
            {f"{name}_{p}": m[name][:, i] for i, p in enumerate(parts)}
            if parts
            else {name: m[name].ravel()}
        )
        assert m["units"][name][0, 0][0] == COLUMNS[name].unit
    return out, json.loads(str(m["scenario"][0])), str(m["status"][0])


READERS = dict(nc=read_nc, parquet=read_parquet, csv=read_csv, mcap=read_mcap)
READERS |= dict(rrd=read_rrd, mat=read_mat)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("name", MAKES)
def test_each_format_gives_back_every_value(records, kind, name, tmp_path):
    """Bit for bit, zeros with their signs too; t to half a nanosecond where that is all."""
    if kind == "rrd":
        pytest.importorskip("rerun")
    record = records[name]
    file = record.export(tmp_path / "Übung 漢" / f"a b.{kind}")
    values, scenario, status = READERS[kind](file)
    expected = columns_of(record)
    if not len(record.t) and kind in ("mcap", "rrd"):  # no sample, no column
        assert values == {}
    else:
        assert set(values) == set(expected)
    for column, x in values.items():
        if column == "t" and kind not in EXACT:
            np.testing.assert_allclose(x, expected[column], rtol=0.0, atol=0.5e-9)
        else:
            assert x.astype(float).tobytes() == np.ascontiguousarray(
                expected[column]
            ).tobytes() or (
                np.isnan(expected[column]).any()
                and np.array_equal(x, expected[column], equal_nan=True)
            ), column
    if kind == "nc":
        import xarray as xr

        with xr.open_dataset(file, engine="h5netcdf") as ds:
            xr.testing.assert_identical(ds.load(), record.to_xarray())
    if kind != "csv":
        assert make_part(Scenario, scenario) == record.scenario and status == record.status
    assert [p.name for p in file.parent.iterdir()] == [file.name]


def test_csv_says_units_and_stays_a_table(records, tmp_path):
    lines = records["extra"].export(tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith('# Größe "ü" <b>& ,;# 漢: ') and lines[1].startswith(
        "# t [s], p_x [m]"
    )
    head = lines[2].split(",")
    assert head[:3] == ["t", "p_x", "p_y"] and "removal_rate" in head and "gain_y" in head
    assert {len(x.split(",")) for x in lines[2:]} == {len(head)}


def test_dataset_has_dims_units_and_outcome(records):
    ds = records["grooved"].to_xarray()
    r = records["grooved"]
    assert ds["p"].dims == ("time", "axis") and ds["tau"].dims == ("time", "joint")
    assert ds["time"].attrs == {"units": "s", "long_name": "time"}
    assert ds["fe"].attrs["units"] == "N" and ds["ground"].attrs["units"] == "m"
    assert ds["joint"].values.tolist() == ["shoulder", "elbow"]
    np.testing.assert_array_equal(ds["ground"].values, r.ground)
    edges = r.scenario.clay.groove.edges
    np.testing.assert_allclose(ds["cell_y"], 0.5 * (edges[1][1:] + edges[1][:-1]))
    assert ds.attrs["outcome"] == r.outcome.code and ds.attrs["status"] == r.status
    assert ds.attrs["end_time"] == r.outcome.time
    np.testing.assert_array_equal(ds["v"].sel(axis="y"), r.v[:, 1])


def test_summary_tells_the_events(records):
    ds = records["stuck"].to_xarray()
    summary = json.loads(ds.attrs["summary"])
    assert summary["stops"] == [dataclasses.asdict(x) for x in records["stuck"].stops] != []
    crossings = [dataclasses.asdict(c) for c in records["cut"].crossings]
    assert json.loads(records["cut"].to_frame().attrs["summary"])["crossings"] == crossings != []


def test_frame_has_an_index_of_time_and_units_by_column(records):
    r = records["extra"]
    df = r.to_frame()
    assert df.index.name == "t" and np.array_equal(df.index, r.t)
    assert df.attrs["units"]["fe_x"] == "N" and df.attrs["units"]["t"] == "s"
    assert set(df.attrs["units"]) == {"t", *df.columns}
    np.testing.assert_array_equal(df[["q_shoulder", "q_elbow"]], r.q)
    # a mean over the clay, as a newcomer would ask for it
    inside = df[df.b_x > 0.0]
    assert (inside.fe_x / inside.v_x).mean() == pytest.approx(90.0, rel=1e-9)


def test_parquet_names_units_for_other_readers(records, tmp_path):
    import pyarrow.parquet as pq

    schema = pq.read_schema(records["cut"].export(tmp_path / "a.parquet"))
    assert {n: schema.field(n).metadata[b"unit"].decode() for n in schema.names} == (
        tables.column_units(records["cut"])
    )


def test_mcap_describes_its_samples(records, tmp_path):
    from mcap.reader import make_reader

    with open(records["cut"].export(tmp_path / "a.mcap"), "rb") as f:
        (schema,) = make_reader(f).get_summary().schemas.values()
    assert schema.encoding == "jsonschema"
    told = json.loads(schema.data)["properties"]
    assert told["p"]["description"] == "position of the handle [m]"
    assert set(told["q"]["properties"]) == {"shoulder", "elbow"} and told["t"]["type"] == "number"


def test_scenarios_beyond_64_kB_fit_into_netcdf(records, tmp_path):
    """HDF5 keeps small attributes in 64 kB."""
    edges = tuple(np.linspace(0.0, 0.2, 101).tolist())
    grid = hc.Grid(edges, edges, np.arange(102.0 * 102.0).reshape(102, 102) / 7.0)
    scenario = dataclasses.replace(records["cut"].scenario, clay=hc.Clay(grid, grid))
    record = dataclasses.replace(records["cut"], scenario=scenario)
    for kind in ("nc", "mat", "parquet"):
        _, data, _ = READERS[kind](record.export(tmp_path / f"a.{kind}"))
        assert len(json.dumps(data)) > 65536 and make_part(Scenario, data) == scenario


@pytest.mark.parametrize("kind", FORMATS)
def test_export_replaces_a_file_or_leaves_it(records, kind, tmp_path, monkeypatch):
    """Written whole, or not at all where the disk is full."""
    if kind == "rrd":
        pytest.importorskip("rerun")
    file = tmp_path / f"a.{kind}"
    file.write_text("old")

    def full(*args):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as m:
        m.setattr(os, "fsync", full)
        with pytest.raises(ParameterError, match="out = .*No space left"):
            records["cut"].export(file)
    assert file.read_text() == "old" and list(tmp_path.iterdir()) == [file]
    records["cut"].export(file)
    assert file.read_bytes() != b"old" and list(tmp_path.iterdir()) == [file]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
@pytest.mark.parametrize("kind", FORMATS)
def test_a_writer_whose_file_is_full_raises(records, kind):
    """None of the libraries swallows it."""
    if kind == "rrd":
        pytest.importorskip("rerun")
    with pytest.raises(OSError, match="No space left"):
        with open("/dev/full", "wb", buffering=0) as f:
            export.EXPORTS[kind](records["cut"], f)


def test_what_cannot_be_written_is_refused(records, tmp_path):
    (tmp_path / "file").write_text("")
    for path in ("/proc/nowhere/a.csv", tmp_path / "file" / "a.csv"):
        with pytest.raises(ParameterError, match="writable"):
            records["cut"].export(path)
    for path, kind in (("a.cvs", None), ("a", None), ("a.csv", "cvs")):
        with pytest.raises(ParameterError, match="format = .*must be one of nc, parquet, csv"):
            records["cut"].export(tmp_path / path, kind)
    with pytest.raises(ParameterError, match="did you mean 'csv'"):
        records["cut"].export(tmp_path / "a.cvs")
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    "kind,package,told",
    [
        ("nc", "xarray", "xarray, which must be installed: pip install 'hapticclay[data]'"),
        ("nc", "h5netcdf", "h5netcdf, which must be installed: pip install 'hapticclay[data]'"),
        ("nc", "h5py", "hapticclay[data]"),
        ("parquet", "pandas", "pandas, which must be installed: pip install 'hapticclay[data]'"),
        ("parquet", "pyarrow", "hapticclay[data]"),
        ("mcap", "mcap", "hapticclay[data]"),
        ("rrd", "rerun", "hapticclay[rerun]"),
    ],
)
def test_a_missing_package_is_named_with_its_extra(
    records, kind, package, told, tmp_path, monkeypatch
):
    for name in [m for m in sys.modules if m.partition(".")[0] == package]:
        monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ParameterError) as error:
        records["cut"].export(tmp_path / f"a.{kind}")
    assert told in str(error.value) and list(tmp_path.iterdir()) == []


def test_csv_and_mat_need_no_extra(records, tmp_path, monkeypatch):
    for package in ("pandas", "xarray", "pyarrow", "h5netcdf", "mcap", "rerun"):
        monkeypatch.setitem(sys.modules, package, None)
    for kind in ("csv", "mat"):
        assert records["cut"].export(tmp_path / f"a.{kind}").stat().st_size > 1000


def test_a_record_of_an_earlier_release_is_exported(records, tmp_path):
    """One without versions of what came later, stops and notes."""
    file = records["cut"].save(tmp_path) / "record.npz"
    with np.load(file) as z:
        arrays = dict(z)
    head = json.loads(str(arrays.pop("summary")))
    for name in ("stops", "notes", "error"):
        head.pop(name, None)
    head["versions"] = {"hapticclay": "0.0.1"}
    np.savez(file, summary=np.array(json.dumps(head)), **arrays)
    old = hc.Record.load(tmp_path)
    values, _, _ = read_csv(old.export(tmp_path / "a.csv"))
    np.testing.assert_array_equal(values["p_x"], records["cut"].p[:, 0])
    assert old.to_xarray().attrs["source"] == "hapticclay 0.0.1"


def test_a_function_in_the_scenario_is_left_out(records):
    law = lambda t, q, qd, fh, state: ((0.0, 0.0), state)  # noqa: E731
    scenario = dataclasses.replace(
        records["cut"].scenario, control="sampled", controller=hc.Controller(law)
    )
    record = dataclasses.replace(records["cut"], scenario=scenario)
    data = json.loads(record.to_frame().attrs["scenario"])
    assert data["controller"] is None
    assert json.loads(record.to_xarray().attrs["summary"])["notes"]["left_out"] == ["controller"]


def test_fit_and_identify_read_the_csv(tmp_path):
    """fit gets the clay's b back, identify the printed Sh; a short last step does not matter."""
    cut = hc.simulate(hc.constant_cut(), every=10)
    assert np.diff(cut.t)[-1] < 0.9 * np.diff(cut.t)[0]
    names = {"t": "t", "input": "fe_x", "output": "p_x"}
    data = hc.studies.Measurement.load(cut.export(tmp_path / "cut.csv"), names)
    assert len(data.t) == len(cut.t) - 1
    found = hc.studies.fit_flow(data, place=(0.06, 0.14))
    assert found.law == "viscous"
    # rounding alone
    assert found.parameters[0].value == pytest.approx(90.0, rel=1e-6)
    push = hc.Scenario(
        "push",
        gain=(0.0, 0.0),
        force=(0.0, 0.0),
        muscle=hc.Multisine((0.3, 0.0), low=0.2, high=8.0, period=10.0),
        inertia_shaping=True,
        length=None,
        t_max=20.0,
        dt=1e-3,
    )
    file = hc.simulate(push).export(tmp_path / "push.csv")
    data = hc.studies.Measurement.load(file, {"t": "t", "input": "fh_x", "output": "p_x"})
    block = hc.studies.identify_data(data, "S", "x")
    for c in block.coefficients:
        assert c.value == pytest.approx(c.printed, rel=1e-2), c.name  # steps of 1 ms, 8 Hz


def test_nothing_heavy_is_loaded_until_it_is_asked_for():
    code = (
        "import sys, hapticclay as hc; r = hc.simulate(hc.constant_cut(t_max=0.01)); repr(r);"
        "r._repr_html_(); r.plot; heavy = 'pandas', 'xarray', 'pyarrow', 'h5py', 'mcap', 'rerun';"
        "print(*[m for m in heavy if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.split() == []
