"""A file that claims to be a record is refused in one line, unread if need be."""

import dataclasses
import io
import json
import zipfile

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.scene.changes import nested
from hapticclay.simulation import stored
from hapticclay.simulation.record import ARRAYS


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return hc.simulate(hc.constant_cut(t_max=0.01)).save(tmp_path_factory.mktemp("saved") / "rec")


def changed(saved, folder, **arrays):
    """A copy of the record with other arrays, compressed."""
    with np.load(saved / "record.npz") as z:
        old = dict(z)
    np.savez_compressed(folder / "record.npz", **(old | arrays))
    return folder


def with_head(saved, folder, change):
    with np.load(saved / "record.npz") as z:
        head = json.loads(str(z["summary"]))
    change(head)
    return changed(saved, folder, summary=np.array(json.dumps(head)))


def member(shape, dtype=float, size=None):
    """An .npy file of zeros whose header says so; of another size where it is given."""
    f = io.BytesIO()
    kind = np.lib.format.dtype_to_descr(np.dtype(dtype))
    header = {"descr": kind, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(f, header)
    return f.getvalue() + bytes(int(np.prod(shape)) * 8 if size is None else size)


def test_arrays_that_inflate_are_refused_by_their_headers(saved, tmp_path, monkeypatch):
    """4.8 MB of zeros in some kilobytes: their size is read, and they are not."""
    n = 300_000
    big = {name: np.zeros((n, 2)) for name in ARRAYS if name != "t"}
    folder = changed(saved, tmp_path, t=np.arange(n) * 1e-9, **big)
    assert (folder / "record.npz").stat().st_size < 9 * n
    monkeypatch.setattr(stored, "memory_left", lambda: 6e7)
    read = []
    monkeypatch.setattr(np.lib.format, "read_array", lambda *a, **k: read.append(a))
    with pytest.raises(ParameterError, match="GB of memory, more than are left"):
        hc.Record.load(folder)
    assert not read


@pytest.mark.parametrize(
    "name, content, said",
    [
        ("p.npy", member((3, 2)), "array p must be"),
        ("p.npy", member((28, 2), size=8), "another size than it says"),
        ("p.npy", b"nonsense", "must be a saved record"),
        ("more.npy", member((10**9,), size=0), "another size than it says"),
        ("p.npy", member((28, 2), object, 448), "another size than it says"),
        ("summary.npy", member((), f"S{2**26 + 1}", 2**26 + 1), "summary is larger"),
    ],
)
def test_headers_that_lie_are_told(saved, tmp_path, name, content, said):
    with zipfile.ZipFile(saved / "record.npz") as old:
        with zipfile.ZipFile(tmp_path / "record.npz", "w", zipfile.ZIP_DEFLATED) as new:
            for x in old.namelist():
                if x != name:
                    new.writestr(x, old.read(x))
            new.writestr(name, content)
    with pytest.raises(ParameterError, match=said):
        hc.Record.load(tmp_path)


@pytest.mark.parametrize(
    "entry, value",
    [
        ("steps", "many"),
        ("steps", -1),
        ("steps", True),
        ("wall_time_s", None),
        ("versions", ["0.2.0"]),
        ("versions", {"python": 3}),
        ("energy", {"clay": "much"}),
        ("outcome", "finished"),
        ("outcome", {"code": 1, "time": 0.0, "step": 1}),
        ("outcome", {"code": "finished", "time": "late", "step": 1}),
        ("crossings", {"axis": "x"}),
        ("crossings", [{"axis": "z", "border": 0.0, "time": 0.0, "speed": 0.0}]),
        ("stops", [{"axis": "x", "start": None}]),
        ("notes", []),
    ],
)
def test_entries_of_another_type_are_told(saved, tmp_path, capsys, entry, value):
    folder = with_head(saved, tmp_path, lambda head: head.update({entry: value}))
    with pytest.raises(ParameterError, match=entry):
        hc.Record.load(folder)
    assert app.main(["info", str(folder)]) == 2
    said = capsys.readouterr()
    assert said.out == "" and said.err.count("\n") == 1


@pytest.mark.parametrize("times", ["equal", "back", "huge", "negative"])
def test_times_that_no_run_has_are_refused_by_files_and_exports(saved, tmp_path, times):
    record = hc.Record.load(saved)
    t = record.t.copy()
    if times == "equal":
        t[3] = t[2]
    elif times == "back":
        t[3] = t[1]
    elif times == "huge":
        t[-1] = 1e300
    else:
        t -= 1.0
    with pytest.raises(ParameterError, match="array t must"):
        hc.Record.load(changed(saved, tmp_path, t=t))
    odd = dataclasses.replace(record, t=t)
    for kind in ("csv", "mcap", "nc"):
        with pytest.raises(ParameterError, match="array t must"):
            odd.export(tmp_path / f"out.{kind}")
    assert [f.name for f in tmp_path.iterdir()] == ["record.npz"]


def test_info_prints_no_commands_of_a_terminal(saved, tmp_path, capsys):
    def change(head):
        evil = "\x1b]0;owned\x07\x1b[2J"
        head["outcome"] |= {"cause": evil, "advice": evil}
        head["versions"][evil] = evil
        head["notes"] = {evil: 1}

    assert app.main(["info", str(with_head(saved, tmp_path, change))]) == 0
    out = capsys.readouterr().out
    assert "owned" in out and all(x.isprintable() or x == "\n" for x in out)


@pytest.mark.parametrize(
    "changes",
    [
        {"gain.x": 1.0, "gain": {"x": 2.0}},
        {"gain": {"x": 2.0}, "gain.x": 1.0},
        {"operator.x.mass": 1.0, "operator": {"x.mass": 1.0}},
    ],
)
def test_a_value_that_is_given_twice_is_refused(changes):
    with pytest.raises(ParameterError, match="given twice"):
        nested(changes)
    with pytest.raises(ParameterError, match="given twice"):
        hc.with_fields(hc.constant_cut(), changes)


def test_what_lies_too_deep_is_refused():
    deep: object = 1.0
    for _ in range(5000):
        deep = {"x": deep}
    with pytest.raises(ParameterError, match="deep"):
        hc.with_fields(hc.constant_cut(), {"gain": deep})
