"""Logs in binary formats: the same numbers from each, or a line that says why not."""

import json
import zipfile

import h5py
import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import netcdf_file, savemat

import hapticclay as hc
from hapticclay.columns import parquet_files, workbooks

N = 150
T = 0.25 * np.arange(N)  # exact in any format below
FORCE, PLACE = np.arange(N) % 7 * 0.5, np.arange(N) % 5 * 0.25
NUMBERS = {"t": T, "force": FORCE, "pos": 1e3 * PLACE}  # s, N, mm
UNITS = {"t": "s", "force": "N", "pos": "mm"}


def parquet(path):
    fields = [pa.field(k, pa.float64(), metadata={"unit": u}) for k, u in UNITS.items()]
    pq.write_table(
        pa.table([pa.array(x) for x in NUMBERS.values()], schema=pa.schema(fields)), path
    )


def arrow(path):
    import pyarrow.feather as pf

    pf.write_feather(pa.table({**NUMBERS, "note": ["a"] * N}), path)


def matlab(path):
    savemat(path, {**NUMBERS, "Ts": 0.25, "about": "rig 3"})


def matlab_rows(path):
    savemat(path, {k: x[None, :] for k, x in NUMBERS.items()})


def matlab_structure(path):
    savemat(path, {"log": {"data": NUMBERS, "gain": np.eye(3)}})


def matlab_4(path):
    savemat(path, NUMBERS, format="4")


def simulink(path):
    signals = np.array(
        [(x, k) for k, x in NUMBERS.items() if k != "t"], [("values", object), ("label", object)]
    )
    savemat(path, {"ScopeData": {"time": T, "signals": signals, "blockName": "Scope"}})


def matlab_73(path):
    """As MATLAB writes it: a block of text before HDF5, arrays with rows and columns exchanged."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, x in NUMBERS.items():
            file[f"log/{name}"] = x[None, :]
            file[f"log/{name}"].attrs["MATLAB_class"] = np.bytes_("double")
        file["name"] = np.frombuffer(b"r\0i\0g\0", np.uint16)
        file["name"].attrs["MATLAB_class"] = np.bytes_("char")
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(128))


def hdf5(path):
    with h5py.File(path, "w") as file:
        for name, x in NUMBERS.items():
            file[f"rig/{name}"] = x
            file[f"rig/{name}"].attrs["units"] = UNITS[name]
        file["note"] = "rig 3"


def hdf5_records(path):
    with h5py.File(path, "w") as file:
        file["log"] = np.rec.fromarrays(list(NUMBERS.values()), names=list(NUMBERS))


def netcdf3(path):
    with netcdf_file(path, "w") as file:
        file.createDimension("time", N)
        for name, x in NUMBERS.items():
            column = file.createVariable(name, "d", ("time",))
            column[:] = x
            column.units = UNITS[name]


def netcdf4(path):
    import xarray as xr

    made = {k: ("time", x, {"units": UNITS[k]}) for k, x in NUMBERS.items()}
    xr.Dataset(made).to_netcdf(path, engine="h5netcdf")


def numpy_records(path):
    np.save(path, np.rec.fromarrays(list(NUMBERS.values()), names=list(NUMBERS)))


def numpy_arrays(path):
    np.savez_compressed(path, **NUMBERS, note="rig 3")


def excel(path):
    book = openpyxl.Workbook()
    book.active.title = "about"
    book.active.append(["rig 3"])
    sheet = book.create_sheet("data")
    sheet.append(["Rig 3, test 5"])
    sheet.append(list(NUMBERS))
    sheet.append(list(UNITS.values()))
    for row in np.column_stack(list(NUMBERS.values())).tolist():
        sheet.append(row)
    book.save(path)


def mcap_json(path):
    from mcap.writer import Writer

    with open(path, "wb") as file:
        writer = Writer(file)
        writer.start()
        words = {k: {"description": f"it [{u}]"} for k, u in UNITS.items()}
        schema = writer.register_schema(
            "Row", "jsonschema", json.dumps({"properties": words}).encode()
        )
        channel = writer.register_channel("/rig", "json", schema)
        for i, row in enumerate(np.column_stack(list(NUMBERS.values())).tolist()):
            data = json.dumps(dict(zip(NUMBERS, row, strict=True))).encode()
            writer.add_message(channel, int(1e9 * row[0]), data, int(1e9 * row[0]), i)
        writer.finish()


WITH_UNITS = {
    "a.parquet": parquet, "a.h5": hdf5, "a.nc": netcdf3, "b.nc": netcdf4, "a.xlsx": excel,
    "a.mcap": mcap_json,
}  # fmt: skip
WITHOUT = {
    "a.arrow": arrow, "a.mat": matlab, "rows.mat": matlab_rows, "structure.mat": matlab_structure,
    "four.mat": matlab_4, "scope.mat": simulink, "new.mat": matlab_73, "records.h5": hdf5_records,
    "a.npy": numpy_records, "a.npz": numpy_arrays,
}  # fmt: skip


@pytest.mark.parametrize("name", [*WITH_UNITS, *WITHOUT])
def test_a_format_gives_the_numbers_that_were_written(name, tmp_path):
    (WITH_UNITS | WITHOUT)[name](tmp_path / name)
    units = {"units": {"pos": "mm"}} if name in WITHOUT else {}
    log = hc.Log.read(tmp_path / name)
    names = {k: next(x for x in log.names if x.split(".")[-1] == k) for k in ("force", "pos")}
    if name in WITHOUT:
        units = {"units": {names["pos"]: "mm"}}
    columns = {"input": names["force"], "output": names["pos"]}
    data = hc.studies.Measurement.load(tmp_path / name, columns, **units)
    np.testing.assert_array_equal(data.t, T)
    np.testing.assert_array_equal(data.input, FORCE)
    np.testing.assert_allclose(data.output, PLACE, rtol=4e-16)  # one product
    assert hc.studies.log_report(log).text()


@pytest.mark.parametrize("name", [*WITH_UNITS, *WITHOUT])
def test_a_damaged_file_is_refused_in_a_line(name, tmp_path):
    path = tmp_path / name
    (WITH_UNITS | WITHOUT)[name](path)
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    for kept in (20, len(whole) // 3, len(whole) - 9):
        path.write_bytes(whole[:kept])
        try:
            hc.Log.read(path)
        except hc.ParameterError as error:
            assert "\n" not in str(error) and len(str(error)) < 400
    if name.endswith((".mat", ".arrow")):  # their libraries trust the lengths within a file
        return
    for _ in range(8):
        data = np.frombuffer(whole, np.uint8).copy()
        data[rng.integers(12, len(data), 12)] ^= rng.integers(1, 255, 12).astype(np.uint8)
        path.write_bytes(data.tobytes())
        try:
            hc.Log.read(path)
        except hc.ParameterError as error:
            assert "\n" not in str(error) and len(str(error)) < 400


def test_lerobots_layout(tmp_path):
    """Lists for each row, names of their parts beside the data, episodes one after another."""
    file = tmp_path / "data" / "chunk-000" / "file-000.parquet"
    file.parent.mkdir(parents=True)
    state = np.column_stack((FORCE, PLACE)).astype(np.float32)
    columns = {
        "observation.state": pa.FixedSizeListArray.from_arrays(pa.array(state.ravel()), 2),
        "action": pa.array(state[:, ::-1].tolist()),
        "timestamp": np.tile(T[:75], 2),
        "episode_index": np.repeat([4, 7], 75),
    }
    pq.write_table(pa.table(columns), file)
    features = {
        "observation.state": {"names": {"motors": ["pan", "lift"]}},
        "action": {"names": None},
    }
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"features": features}))
    log = hc.Log.read(file, where={"episode_index": 7})
    assert log.rows == 75
    assert {"observation.state_pan", "observation.state_lift", "action[0]", "action[1]"} < {
        *log.names
    }
    np.testing.assert_array_equal(log.values("observation.state_lift"), PLACE[75:])
    np.testing.assert_array_equal(log.values("action[0]"), PLACE[75:])
    columns = ("timestamp", "action[0]", "action[1]")
    samples = hc.Samples.of(log, columns)
    np.testing.assert_array_equal(np.array(samples.values), state[75:, ::-1])
    assert samples.t == tuple(T[:75])
    with pytest.raises(hc.ParameterError, match="4, 7"):
        hc.Log.read(file, where={"episode_index": 1})
    assert hc.studies.log_report(hc.Log.read(file)).stamps.backward.tolist() == [75]


@pytest.mark.parametrize(
    "size",
    [
        pytest.param(
            4,
            marks=pytest.mark.skipif(
                int(pa.__version__.split(".")[0]) < 26,
                reason="pyarrow before 26 reads no absent lists of a fixed length",
            ),
        ),
        -1,  # of any length
    ],
)
def test_rows_without_a_list_are_empty_and_the_others_stay_whole(size, tmp_path):
    """Two lists of four in four rows are not four lists of two."""
    lists = [[1.0, 2.0, 3.0, 4.0], None, [5.0, 6.0, 7.0, 8.0], None]
    q = pa.array(lists, pa.list_(pa.float64(), size))
    pq.write_table(pa.table({"t": [0.0, 0.1, 0.2, 0.3], "q": q}), tmp_path / "log.parquet")
    table = parquet_files.parquet("log", tmp_path / "log.parquet")
    assert [x.text for x in table.heads] == ["t", *(f"q[{i}]" for i in range(4))]
    nan = np.nan
    for i in range(4):
        np.testing.assert_array_equal(table.loose_numbers(1 + i), [1.0 + i, nan, 5.0 + i, nan])
    with pytest.raises(hc.ParameterError, match=r"row 1, column 'q\[0\]'"):
        table.numbers(1)


def test_a_workbook_is_closed_when_it_is_read(tmp_path, monkeypatch):
    book = openpyxl.Workbook()
    for row in (["t", "x"], [0.0, 1.0], [0.1, 2.0]):
        book.active.append(row)
    book.save(tmp_path / "log.xlsx")
    load, opened = openpyxl.load_workbook, []

    def keeping(*args, **how):
        opened.append(load(*args, **how))
        return opened[-1]

    monkeypatch.setattr(openpyxl, "load_workbook", keeping)
    workbooks.excel("log", tmp_path / "log.xlsx")
    assert opened[0]._archive.fp is None


@pytest.mark.parametrize("ros1", [True, False])
def test_bags_of_ros(ros1, tmp_path):
    """Two topics with clocks of their own, and names of joints."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    types = store.types
    start = 1_700_000_000_000_000_000
    path = tmp_path / ("a.bag" if ros1 else "a")
    writer = Writer1(path) if ros1 else Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)

    def header(stamp):
        time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
        kind = types["std_msgs/msg/Header"]
        return kind(seq=0, stamp=time, frame_id="") if ros1 else kind(stamp=time, frame_id="")

    with writer as bag:
        kinds = {
            "/joints": "sensor_msgs/msg/JointState",
            "/wrench": "geometry_msgs/msg/WrenchStamped",
        }
        ways = {k: bag.add_connection(k, x, typestore=store) for k, x in kinds.items()}
        for i in range(N):
            stamp = start + 250_000_000 * i
            joints = types[kinds["/joints"]](
                header(stamp), ["a", "b"], np.array([PLACE[i], 1.0]), np.zeros(2), np.zeros(0)
            )
            force = types["geometry_msgs/msg/Vector3"](0.5 * i, 0.0, 0.0)
            zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
            wrench = types[kinds["/wrench"]](
                header(stamp), types["geometry_msgs/msg/Wrench"](force, zero)
            )
            pack = store.serialize_ros1 if ros1 else store.serialize_cdr
            bag.write(ways["/joints"], stamp + 1000, pack(joints, kinds["/joints"]))
            if i % 2 == 0:
                bag.write(ways["/wrench"], stamp + 2000, pack(wrench, kinds["/wrench"]))
    file = path if ros1 else next(path.glob("*.mcap"))
    for place in {path, file}:
        log = hc.Log.read(place)
        np.testing.assert_allclose(log.values("stamp"), 0.25 * np.arange(N) - 1e-6, atol=2e-9)
        np.testing.assert_array_equal(log.values("/joints.position.a"), PLACE[:N])
        # of every second row, interpolated between: the same line, after nine digits of a stamp;
        # the last row is behind the last force
        wrench = log.values("/wrench.wrench.force.x", holes=True)
        np.testing.assert_allclose(wrench[:-1], 0.5 * np.arange(N - 1), atol=1e-6)
        assert np.isnan(wrench[-1])
    log = hc.Log.read(file, table="/wrench")
    assert log.rows == N // 2
    with pytest.raises(hc.ParameterError, match="one of /joints, /wrench"):
        hc.Log.read(file, table="/pose")


@pytest.mark.parametrize("without", [(), (0,), (3,)])
def test_a_topic_with_a_message_without_stamp_is_on_the_times_of_its_receipt(without, tmp_path):
    """A node that starts sends a header of zeros; no column of data may be taken for the clock."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store, kind = get_typestore(Stores.ROS1_NOETIC), "geometry_msgs/msg/PointStamped"
    time, header, point = (
        store.types[x]
        for x in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", "geometry_msgs/msg/Point")
    )
    start, at = 1_700_000_000, 0.25 * np.arange(8)
    with Writer(tmp_path / "a.bag") as bag:
        way = bag.add_connection("/tip", kind, typestore=store)
        for i, x in enumerate(at**2):
            nanos = int(1e9 * at[i])
            stamp = (0, 0) if i in without else (start + nanos // 10**9, nanos % 10**9)
            message = store.types[kind](header(0, time(*stamp), ""), point(x, 0.0, 0.0))
            bag.write(way, start * 10**9 + nanos, store.serialize_ros1(message, kind))
    log = hc.Log.read(tmp_path / "a.bag")
    np.testing.assert_allclose(log.values("t" if without else "stamp"), at, atol=1e-9)
    np.testing.assert_array_equal(log.values("point.x"), at**2)


def test_json_messages_of_which_some_have_a_clock_are_on_the_times_of_the_log(tmp_path):
    from mcap.writer import Writer

    with open(tmp_path / "a.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("Row", "jsonschema", b"{}")
        way = writer.register_channel("/tip", "json", schema)
        for i in range(8):
            row = {"x": 2.0 * i} | ({"t": 100.0 + i} if i > 2 else {})
            writer.add_message(way, 250_000_000 * i, json.dumps(row).encode(), 250_000_000 * i)
        writer.finish()
    log = hc.Log.read(tmp_path / "a.mcap")
    np.testing.assert_allclose(log.values("t"), 0.25 * np.arange(8), rtol=1e-15)
    np.testing.assert_array_equal(log.values("x"), 2.0 * np.arange(8))


def test_our_own_exports_are_read_with_their_units(tmp_path):
    record = hc.simulate(hc.constant_cut(t_max=0.05))
    for kind in ("nc", "parquet", "csv", "mcap", "mat"):
        log = hc.Log.read(record.export(tmp_path / f"cut.{kind}"))
        name = next(x for x in ("fh_x", "fh.x") if x in log.names)
        np.testing.assert_array_equal(log.values(name, ("N",)), record.fh[:, 0])
        place = log.place(name)
        assert log.table.heads[place].unit == "N", kind
        (time,) = {"t", "time"} & {*log.names}
        np.testing.assert_array_equal(log.values(time, ("s",)), record.t)


def test_what_is_no_log_is_refused_in_a_line(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as file:
        file.writestr("a.txt", "t,x\n0,1\n")
    (tmp_path / "a.csv.gz").write_bytes(b"\x1f\x8b\x08\0\0\0\0\0")
    (tmp_path / "a.xls").write_bytes(b"\xd0\xcf\x11\xe0" + bytes(100))
    np.save(tmp_path / "words.npy", np.array(["a", "b"]))
    np.save(tmp_path / "objects.npy", np.array([{}, []], dtype=object), allow_pickle=True)
    savemat(tmp_path / "scalars.mat", {"a": 1.0, "b": "text"})
    (tmp_path / "text.mat").write_text("t,x\n0,1\n")
    for name, said in (
        ("a.zip", "unpack"), ("a.csv.gz", "gunzip"), ("a.xls", ".xlsx"), ("words.npy", "columns"),
        ("objects.npy", "damaged"), ("scalars.mat", "columns of numbers"), ("text.mat", "damaged"),
        (".", "folder"),
    ):  # fmt: skip
        with pytest.raises(hc.ParameterError, match=said) as error:
            hc.Log.read(tmp_path / name)
        assert len(str(error.value)) < 400
    matlab(tmp_path / "a.mat")
    with pytest.raises(hc.ParameterError, match="table = 'rig': must be one of t, force, pos"):
        hc.Log.read(tmp_path / "a.mat", table="rig")


def test_gaps_of_a_topic_are_left_out_and_told(tmp_path):
    """0.3 s without forces: no straight line through it."""
    pytest.importorskip("mcap")
    from mcap.writer import Writer

    with open(tmp_path / "a.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("Row", "jsonschema", b"{}")
        ways = [writer.register_channel(x, "json", schema) for x in ("/place", "/force", "/slow")]
        for i in range(2000):
            rows = [(ways[0], {"t": 1e-3 * i, "x": 2.0 * i})]
            rows += [(ways[1], {"t": 1e-3 * i + 2e-4, "f": 3.0 * i})] * (not 700 <= i < 1000)
            rows += [(ways[2], {"t": 1e-3 * i, "T": 20.0})] * (i < 50 or i == 1999)
            for channel, row in rows:
                writer.add_message(channel, 10**6 * i, json.dumps(row).encode(), 10**6 * i)
        writer.finish()
    log = hc.Log.read(tmp_path / "a.mcap", units={"/place.x": "mm", "/force.f": "N"})
    t, force = log.values("t"), log.values("/force.f", holes=True)
    there = np.isfinite(force)  # but the first row, which comes before the first force
    assert log.rows == 2000 and np.count_nonzero(~there) == 301 + 1
    assert not np.any(there & (t > 0.6992) & (t < 1.0002))
    np.testing.assert_allclose(force[there], 3e3 * (t - 2e-4)[there], atol=1e-6)
    told = " ".join(log.table.notes)
    assert "301 rows in its 1 gap, the longest 0.301 s have no value" in told
    assert "topic /slow has 1 gap, the longest 1.95 s: read it as --table /slow" in told
