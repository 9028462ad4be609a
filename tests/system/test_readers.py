"""Files that are opened: damaged, endless, deep or huge, they are refused in one line, in time."""

import contextlib
import gc
import json
import os
import random
import socket
import struct
import tracemalloc
import zipfile
import zlib
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from scipy.io import savemat

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.ports.buttons import ButtonScript
from hapticclay.ports.device import Trajectory
from hapticclay.ports.exchanges import Exchanges
from hapticclay.results import Result
from hapticclay.studies.measurement import Measurement
from hapticclay.studies.pair_log import PairLog
from hapticclay.studies.replay import Recording
from hapticclay.studies.store import read_sweep
from hapticclay.studies.sweep import load_sweep
from hapticclay.views.images import gray_image
from tests.waiting import alarm


def samples(path):
    return hc.Samples.csv(path, ("t", "x", "y"))


def settings_of_sweep(path):
    return load_sweep(Path(path))


READERS = {  # by the name of the file
    "scene.toml": hc.Scenario.load,
    "scene.json": hc.Scenario.load,
    "wall.toml": hc.VirtualWall.load,
    "spec.toml": settings_of_sweep,
    "record.npz": hc.Record.load,
    "result.json": Result.load,
    "log.csv": Measurement.load,
    "samples.csv": samples,
    "hand.csv": Trajectory.of_file,
    "buttons.csv": ButtonScript.of_file,
    "exchanges.csv": Exchanges.load,
    "clay.png": gray_image,
    "pair.csv": PairLog.load,
    "scope.mat": PairLog.load,
    "recording.csv": Recording.load,
}


@pytest.fixture(autouse=True)
def in_time():
    """What waits for ever fails rather than hangs."""
    with alarm():
        yield


def refused(read, path):
    """The message of a reader that refuses a file; Samples passes on errors of the system."""
    with pytest.raises((hc.ParameterError, OSError)) as error:
        read(path)
    assert not isinstance(error.value, TimeoutError)
    said = str(error.value)
    assert "\n" not in said and len(said) < 1000
    return said


def pipe(path):
    os.mkfifo(path)


def zeros(path):
    path.symlink_to("/dev/zero")


def unix_socket(path):
    with socket.socket(socket.AF_UNIX) as s:
        s.bind(str(path))


def folder(path):
    path.mkdir()


def loop(path):
    path.symlink_to(path)


def nothing(path):
    """No file at all."""


def sparse(path):
    """A terabyte that takes no room on the disk."""
    with open(path, "wb") as f:
        f.truncate(2**40)


@pytest.mark.parametrize("make", [pipe, zeros, unix_socket, folder, loop, nothing, sparse])
@pytest.mark.parametrize("name", READERS)
def test_what_is_no_file_or_has_no_end_is_refused(tmp_path, monkeypatch, name, make):
    monkeypatch.chdir(tmp_path)  # the name of a socket is short
    make(Path(name))
    tracemalloc.start()
    refused(READERS[name], Path(name))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2**25


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A good file for each reader."""
    here = tmp_path_factory.mktemp("good")
    scene = hc.constant_cut(t_max=0.01)
    record = hc.simulate(scene)
    (record.save(here / "rec") / "record.npz").rename(here / "record.npz")
    scene.save(here / "scene.toml")
    scene.save(here / "scene.json")
    hc.VirtualWall(100.0, 1.0).save(here / "wall.toml")
    (here / "spec.toml").write_text('experiment = "free"\n[vary]\n"gain.x" = [1, 2]\n')
    loop = hc.theory.Loop("x", 90.0, hc.Operator(), K=1.0)
    hc.theory.loop_response(loop, [1.0, 9.0, 80.0]).save(here / "result.json")
    t = np.arange(120) / 100.0
    rows = [f"{x},{np.sin(x)},{np.cos(x)}\n" for x in t]
    (here / "log.csv").write_text("t,input,output\n" + "".join(rows))
    (here / "samples.csv").write_text("t,x,y\n" + "".join(rows))
    (here / "hand.csv").write_text("t,x,y\n" + "".join(rows))
    (here / "recording.csv").write_text("t,x,y\n" + "".join(rows))
    (here / "pair.csv").write_text(
        "t,leader,follower,tau_s\n" + "".join(f"{x},{np.sin(x)},{np.cos(x)},{x}\n" for x in t)
    )
    signals = [
        {"label": "p (rad) leader, follower", "values": np.outer(t, [1.0, 2.0])},
        {"label": "torque (Nm) tau_s", "values": 3.0 * t},
    ]
    savemat(here / "scope.mat", {"s": {"time": t, "signals": signals}})
    (here / "buttons.csv").write_text("t,a,b,c,home\n0,0,0,0,0\n1,1,0,0,0\n")
    Exchanges.of_table(np.arange(24.0).reshape(2, 12)).save(here / "exchanges.csv")
    iio.imwrite(here / "clay.png", np.arange(64, dtype=np.uint8).reshape(8, 8))
    return here


def test_the_good_files_are_read(good):
    for name, read in READERS.items():
        read(good / name)


@pytest.mark.parametrize("name", READERS)
def test_damaged_files_are_refused_in_one_line_or_read(good, tmp_path, name):
    """Bytes that flip, vanish or come twice: no error but a refusal, and no long message."""
    content, draw, file = (good / name).read_bytes(), random.Random(name), tmp_path / name
    refusals = 0
    for k in range(60):
        bad = bytearray(content)
        for _ in range(draw.choice((1, 1, 4, 40))):
            at = draw.randrange(len(bad))
            bad[at] = draw.choice((bad[at] ^ 1 << draw.randrange(8), 0, 255, ord("9"), ord("[")))
        if k % 4 == 1:
            del bad[draw.randrange(len(bad)) :]
        elif k % 4 == 2:
            at, end = sorted(draw.sample(range(len(bad)), 2))
            bad[at:at] = bad[at : min(end, at + 50)]
        file.write_bytes(bad)
        try:
            READERS[name](file)
        except (hc.ParameterError, OSError) as error:
            assert not isinstance(error, TimeoutError)
            said, refusals = str(error), refusals + 1
            assert "\n" not in said and len(said) < 1000
    assert refusals


def deep_tables(kind, depth):
    if kind == "toml":
        return ".".join(["a"] * depth) + " = 1\n"
    return '{"a":' * depth + "1" + "}" * depth


def deep_lists(kind, depth):
    lists = "[" * depth + "]" * depth
    return f"a = {lists}\n" if kind == "toml" else f'{{"a": {lists}}}'


def deep_inline(kind, depth):
    tables = "{a=" * depth + "1" + "}" * depth
    return f"a = {tables}\n" if kind == "toml" else '{"a":[' * depth + "1" + "]}" * depth


@pytest.fixture(scope="module")
def collected():
    """Takes away what other tests left: once, since a collection takes longer than a reader."""
    gc.collect()


@pytest.fixture
def no_collection(collected):
    """What other tests leave is not finalized at the bottom of a recursion, where that fails."""
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("no_collection")
@pytest.mark.parametrize("depth", [101, 5000, 200_000])
@pytest.mark.parametrize("text", [deep_tables, deep_lists, deep_inline])
@pytest.mark.parametrize(
    "name", ["scene.toml", "scene.json", "wall.toml", "spec.toml", "result.json"]
)
def test_what_is_nested_deep_is_refused(tmp_path, name, text, depth):
    file = tmp_path / name
    file.write_text(text(name.rpartition(".")[2], depth))
    assert "nested more than 100 deep" in refused(READERS[name], file)


@pytest.mark.parametrize("digits", ["1" + "0" * n for n in (20, 400, 4000, 6000)], ids=len)
@pytest.mark.parametrize("sign", ["", "-"])
@pytest.mark.parametrize("where", ["dt", "gain", "mesh"])
@pytest.mark.parametrize("name", ["scene.toml", "scene.json", "spec.toml"])
def test_whole_numbers_that_no_float_holds_are_refused(tmp_path, name, where, sign, digits):
    file, toml = tmp_path / name, name.endswith("toml")
    text = f"[{sign}{digits}]"
    file.write_text(f"{where} = {text}\n" if toml else f'{{"{where}": {text}}}')
    said = refused(READERS[name], file)
    assert "whole number" in said or "4300" in said


def changed(good, folder, change, **arrays):
    """A copy of the record with another summary."""
    with np.load(good / "record.npz") as z:
        old = dict(z)
    head = json.loads(str(old["summary"]))
    change(head)
    np.savez(folder / "record.npz", **(old | {"summary": np.array(json.dumps(head))} | arrays))
    return folder / "record.npz"


@pytest.mark.parametrize("entry", ["steps", "wall_time_s", "schema", "samples"])
def test_a_number_of_400_digits_in_a_record_is_refused(good, tmp_path, entry):
    file = changed(good, tmp_path, lambda head: head.update({entry: 10**400}))
    assert "whole number" in refused(hc.Record.load, file)


@pytest.mark.parametrize("part", ["scenario", "outcome", "notes", "energy", "crossings"])
def test_a_record_with_a_deep_part_is_refused(good, tmp_path, part):
    deep = 1.0
    for _ in range(150):
        deep = {"x": [deep]}
    file = changed(good, tmp_path, lambda head: head.update({part: deep}))
    assert "nested" in refused(hc.Record.load, file)


def test_a_record_holds_its_arrays_and_no_other(good):
    """NumPy 2.0 stores every keyword that it does not know as an array."""
    with zipfile.ZipFile(good / "record.npz") as z:
        names = {x.removesuffix(".npy") for x in z.namelist()}
    fields = {"t", "p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta", "summary"}
    assert names == fields


@pytest.mark.parametrize("method", [zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_damaged_members_of_a_record_are_refused(good, tmp_path, method):
    """Each decompressor has errors of its own; so have a password and a method of the future."""
    file = tmp_path / "record.npz"
    with zipfile.ZipFile(good / "record.npz") as old:
        with zipfile.ZipFile(file, "w", method) as new:
            for x in old.namelist():
                new.writestr(x, old.read(x))
    hc.Record.load(file)
    content, draw, refusals = file.read_bytes(), random.Random(3), 0
    for _ in range(40):
        bad = bytearray(content)
        bad[draw.randrange(30, len(bad) // 2)] ^= 255
        file.write_bytes(bad)
        with contextlib.suppress(hc.ParameterError):
            hc.Record.load(file)
            refusals -= 1
        refusals += 1
    assert refusals > 20
    for at, value in ((6, 1), (8, 99)):  # flags and method of the first member, in both heads
        bad = bytearray(content)
        bad[at] = value
        directory = content.index(b"PK\x01\x02")
        bad[directory + at + 2] = value
        file.write_bytes(bad)
        assert "must be a saved record" in refused(hc.Record.load, file)


@pytest.mark.parametrize(
    "array, said",
    [
        ({"array": "|O", "shape": [1], "values": [1]}, "not read"),
        ({"array": "<U99999999", "shape": [1], "values": ["a"]}, "not read"),
        ({"array": "<f8", "shape": [10**9], "values": [1.0]}, "reshape"),
        ({"array": "<i4", "shape": [1], "values": [2**40]}, "int"),
        ({"part": "hapticclay.model.nothing:Arm", "fields": {}}, "not a part"),
        ({"part": "hapticclay.cli.app:main", "fields": {}}, "not a part"),
        ({"part": 3, "fields": {}}, "must be"),
        ({"pairs": [[[1], 2]]}, "must be"),
    ],
)
def test_parts_of_a_result_that_none_has_are_refused(good, tmp_path, array, said):
    data = json.loads((good / "result.json").read_text())
    data["result"]["fields"]["omega"] = array
    file = tmp_path / "result.json"
    file.write_text(json.dumps(data))
    assert said in refused(Result.load, file)


@pytest.mark.parametrize("side", [7_100, 12_000, 30_000])
def test_an_image_of_too_many_pixels_is_not_decoded(tmp_path, side):
    """A head says how many pixels follow; Pillow alone warns of some, and refuses others."""

    def chunk(name, data):
        return (
            struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        )

    head = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    parts = chunk(b"IHDR", head), chunk(b"IDAT", zlib.compress(bytes(100))), chunk(b"IEND", b"")
    (tmp_path / "clay.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(parts))
    tracemalloc.start()
    refused(gray_image, tmp_path / "clay.png")
    assert tracemalloc.get_traced_memory()[1] < 2**25
    tracemalloc.stop()


@pytest.mark.parametrize("make", [pipe, zeros])
def test_a_sweep_whose_plan_is_no_file_is_refused(tmp_path, make):
    make(tmp_path / "sweep.json")
    (tmp_path / "data").mkdir()
    make(tmp_path / "data" / "part-000000.parquet")
    assert "part-000000" in refused(read_sweep, tmp_path)
    grid = ["--grid", "b=1:2:2", "--fixed", "t_max=0.01", "--workers", "1"]
    assert app.main(["sweep", *grid, "--out", str(tmp_path), "--no-maps"]) == 2


@pytest.mark.parametrize(
    "words",
    [
        ["run", "FILE.toml"],
        ["info", "FILE.npz"],
        ["identify", "--csv", "FILE.csv"],
        ["sweep", "FILE.toml"],
        ["device", "serve", "--port", "0", "--hand", "FILE.csv"],
        ["compare", "FILE.toml", "FILE.toml"],
    ],
)
def test_commands_refuse_an_endless_file_in_one_line(tmp_path, capsys, words):
    for end in ("toml", "npz", "csv"):
        zeros(tmp_path / f"FILE.{end}")
    given = [x.replace("FILE", str(tmp_path / "FILE")) for x in words]
    assert app.main([*given, "--out", str(tmp_path / "o")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
