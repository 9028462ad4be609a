"""Damaged files of logs: refused in a line, never a crash of the process, and never a hang."""

import io
import json
import random
import struct
import subprocess
import sys

import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.sparse import csc_matrix

import hapticclay as hc
from hapticclay.columns.matlab_elements import check_elements
from tests.hunt import MORE

N = 200
T = 1e-3 * np.arange(N)
LOG = {
    "t": T,
    "force": np.sin(T),
    "pos": 1e-3 * np.cos(T),
    "scope": {"time": T, "signals": [{"label": "F [N]", "values": T}, {"label": "", "values": T}]},
    "cells": np.array([np.arange(3.0), "text", np.eye(2)], dtype=object),
    "complex": np.array([[1j, 2.0]]),
    "sparse": csc_matrix(np.eye(4)),
    "empty": np.zeros((0, 0)),
}
READ = """
import sys, warnings
warnings.simplefilter("ignore")
import hapticclay as hc
for path in sys.argv[1:]:
    try:
        hc.studies.log_report(hc.Log.read(path))
        print("read")
    except hc.ParameterError as error:
        print("refused", str(error).count(chr(10)))
"""


def saved(log=LOG, **kw):
    file = io.BytesIO()
    savemat(file, log, oned_as="column", **kw)
    return file.getvalue()


@pytest.mark.parametrize("compressed", [False, True])
def test_whole_files_pass(compressed):
    check_elements(saved(do_compression=compressed))


def damaged(seed, whole):
    """Some bytes, most of them of tags, replaced; or the end cut off."""
    rng = random.Random(seed)
    data = bytearray(rng.choice(whole))
    if seed % 7 == 0:
        return bytes(data[: rng.randrange(1, len(data))])
    for _ in range(rng.randrange(1, 5)):
        at = 128 + 8 * rng.randrange(len(data) // 8 - 17) + rng.randrange(8)
        data[at] = rng.choice((0, 1, 5, 14, 15, 19, 32, 127, 128, 255))
    return bytes(data)


def test_damaged_files_of_matlab_are_read_or_refused_in_a_line(tmp_path):
    """In a process of their own, which SciPy's reader alone ends at some of them."""
    flat = {k: LOG[k] for k in ("t", "force", "pos", "cells", "sparse", "complex")}
    whole = [saved(log, do_compression=x) for log in (LOG, flat) for x in (False, True)]
    paths = [tmp_path / f"{i}.mat" for i in range(300)]
    for i, path in enumerate(paths):
        path.write_bytes(damaged(i, whole))
    assert read_in_a_process(paths) == {"read", "refused 0"}


def read_in_a_process(paths):
    """What became of files, in a process that none of them may end or hold up for minutes."""
    words = [sys.executable, "-c", READ, *map(str, paths)]
    ran = subprocess.run(words, capture_output=True, text=True, check=False, timeout=600)
    lines = ran.stdout.splitlines()
    assert ran.returncode == 0, (paths[min(len(lines), len(paths) - 1)], ran.stderr[-2000:])
    assert len(lines) == len(paths)
    return set(lines)


def arrow_files(folder):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    from pyarrow import feather

    lists = pa.array([[float(i), 1.0, 2.0] for i in range(N)])
    words = pa.array([f"a{i}" for i in range(N)])
    holes = pa.array([None if i == 5 else i for i in range(N)])
    log = pa.table({"t": T, "x": T, "l": lists, "w": words, "n": holes})
    for way in ("uncompressed", "lz4", "zstd"):
        feather.write_feather(log, folder / f"{way}.feather", compression=way)
    for way in ("none", "snappy", "gzip", "zstd"):
        pq.write_table(log, folder / f"{way}.parquet", compression=way)
    pq.write_table(log, folder / "plain.parquet", use_dictionary=False, data_page_version="2.0")


def hdf5_files(folder):
    h5py = pytest.importorskip("h5py")
    for version in ("earliest", "latest"):
        with h5py.File(folder / f"{version}.h5", "w", libver=version) as f:
            f["rig/arm/t"], f["rig/arm/x"], f["rig/v"] = T, T, np.zeros((N, 3))
            f["rig/arm/x"].attrs["units"] = "mm"
            f.create_dataset("c", data=T, chunks=(64,), compression="gzip", fletcher32=True)
            f["rec"] = np.zeros(N, dtype=[("a", "f8"), ("b", "i4")])
            f["link"] = h5py.SoftLink("/rig/arm")


def netcdf_files(folder):
    from scipy.io import netcdf_file

    for name, length in (("fixed", N), ("record", None)):
        with netcdf_file(folder / f"{name}.nc", "w") as f:
            f.createDimension("n", length)
            for key in ("t", "x"):
                f.createVariable(key, "d", ("n",))[:] = T


def numpy_files(folder):
    np.save(folder / "plain.npy", np.column_stack((T, T)))
    np.save(folder / "named.npy", np.rec.fromarrays([T, T], names="t,x"))
    np.savez(folder / "plain.npz", t=T, x=T)
    np.savez_compressed(folder / "packed.npz", t=T, x=T)


def excel_files(folder):
    book = pytest.importorskip("openpyxl").Workbook()
    for row in [("t", "x"), *np.column_stack((T, T)).tolist()]:
        book.active.append(row)
    book.save(folder / "book.xlsx")


def mcap_files(folder):
    writing = pytest.importorskip("mcap.writer")
    schema = json.dumps({"properties": {"x": {"description": "force [N]"}}}).encode()
    for way in writing.CompressionType:
        with open(folder / f"{way.name}.mcap", "wb") as f:
            writer = writing.Writer(f, compression=way, chunk_size=4000)
            writer.start()
            kind = writer.register_schema("W", "jsonschema", schema)
            ways = [writer.register_channel(x, "json", kind) for x in ("/a", "/b")]
            for i in range(N):
                for channel in ways:
                    writer.add_message(channel, i * 10**6, b'{"x": {"y": 1.5}}', i * 10**6)
            writer.finish()


def ros_files(folder):
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    kind = "geometry_msgs/msg/Vector3"
    for way in (None, *Writer1.CompressionFormat, *StoragePlugin):
        is_1 = way is None or isinstance(way, Writer1.CompressionFormat)
        store = get_typestore(Stores.ROS1_NOETIC if is_1 else Stores.ROS2_HUMBLE)
        path = folder / f"{way.name if way else 'plain'}{'.bag' if is_1 else ''}"
        bag = Writer1(path) if is_1 else Writer2(path, version=9, storage_plugin=way)
        if is_1 and way:
            bag.set_compression(way)
        with bag:
            channel = bag.add_connection("/tip", kind, typestore=store)
            pack = store.serialize_ros1 if is_1 else store.serialize_cdr
            for i in range(N):
                message = store.types[kind](0.1 * i, 0.0, 0.0)
                bag.write(channel, 10**18 + 10**6 * i, pack(message, kind))
        if not is_1:
            file = next(x for x in path.iterdir() if x.suffix != ".yaml")
            file.rename(folder / file.name)


BINARY = (
    arrow_files, hdf5_files, netcdf_files, numpy_files, excel_files, mcap_files, ros_files,
)  # fmt: skip
EDGES = (0, 0xFF, 0x7FFFFF00, 0x80000000, 0xFFFFFFFF)


def with_wrong_bytes(data, rng):
    """A file with a few bits, bytes or numbers replaced, half of them at its ends; or cut off."""
    if rng.random() < 0.1:
        return data[: rng.randrange(1, len(data))]
    out = bytearray(data)
    at_ends = rng.random() < 0.5
    for _ in range(rng.choice((1, 1, 2, 4, 16))):
        at = rng.randrange(len(data))
        if at_ends:
            at = rng.choice((at % 1500, len(data) - 1 - at % 3000)) % len(data)
        kind = rng.random()
        if kind < 0.4:
            out[at] ^= 1 << rng.randrange(8)
        elif kind < 0.7:
            out[at] = rng.randrange(256)
        else:
            out[at : at + 4] = struct.pack("<I", rng.choice(EDGES))
    return bytes(out[: len(data)])


@pytest.mark.parametrize("write", BINARY)
def test_damaged_binary_files_are_read_or_refused_in_a_line(write, tmp_path):
    write(tmp_path)
    whole = sorted(x for x in tmp_path.iterdir() if x.is_file())
    assert read_in_a_process(whole) == {"read"}
    paths = []
    for path in whole:
        data = path.read_bytes()
        for i in range(8 * MORE):
            paths.append(tmp_path / f"{path.stem} {i}{path.suffix}")
            paths[-1].write_bytes(with_wrong_bytes(data, random.Random(f"{path.name} {i}")))
    assert read_in_a_process(paths) <= {"read", "refused 0"}


@pytest.mark.parametrize("offset", [0x7FFFFF00, -0x7FFFFF00, 601, 0])
@pytest.mark.parametrize("form", ["feather", "arrow"])
def test_a_wrong_offset_of_a_list_is_refused(offset, form, tmp_path):
    """Which pyarrow follows out of its memory, or without an end, unless it is asked to check."""
    pa = pytest.importorskip("pyarrow")
    lists = pa.array([[float(i), 1.0, 2.0] for i in range(N)])
    path = tmp_path / f"log.{form}"
    with pa.OSFile(str(path), "wb") as file:
        log = pa.table({"t": T, "x": T, "l": lists})
        with pa.ipc.new_file(file, log.schema) as writer:
            writer.write_table(log)
    data = bytearray(path.read_bytes())
    at = data.find(struct.pack("<4i", 0, 3, 6, 9)) + 4 * 100
    data[at : at + 4] = struct.pack("<i", offset)
    path.write_bytes(data)
    assert read_in_a_process([path]) == {"refused 0"}


def at_first(data, old, new):
    return data.replace(old, new, 1)


@pytest.mark.parametrize(
    "old, new, told",
    [
        (b"\x09\x00\x00\x00\x40\x06\x00\x00", b"\x13\x00\x00\x00\x40\x06\x00\x00", "unknown type"),
        (b"\x09\x00\x00\x00\x40\x06\x00\x00", b"\x0e\x00\x00\x00\x40\x06\x00\x00", "other parts"),
        (b"\x09\x00\x00\x00\x40\x06\x00\x00", b"\x09\x00\x00\x00\x41\xff\x00\x00", "longer"),
        (b"\x05\x00\x00\x00\x08\x00\x00\x00\xc8", b"\x05\x00\x00\x00\x08\x00\x00\x00\xc9", "parts"),
    ],
)
def test_what_is_wrong_is_told(old, new, told, tmp_path):
    data = saved()
    assert old in data and "t" in loadmat(io.BytesIO(data))
    (tmp_path / "log.mat").write_bytes(at_first(data, old, new))
    with pytest.raises(hc.ParameterError, match=told):
        hc.Log.read(tmp_path / "log.mat")


def test_numbers_beyond_all_measure_are_told(tmp_path):
    """Their squares, and counters as wide, overflow."""
    x = np.cumsum(np.ones(300))
    x[100], x[200] = 1.7e308, -1.7e308
    rows = [f"{1e-3 * i},{v!r}" for i, v in enumerate(x.tolist())]
    (tmp_path / "log.csv").write_text("\n".join(["t [s],pos [m]", *rows]))
    report = hc.studies.log_report(hc.Log.read(tmp_path / "log.csv"))
    assert "2 beyond 1e+50" in report.table["remarks"][1]
