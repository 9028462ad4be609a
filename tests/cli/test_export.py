"""hapticclay export and hapticclay info."""

import os

import numpy as np
import pytest

import hapticclay as hc
from hapticclay.cli import app


def run(capsys, *args):
    code = app.main([str(a) for a in args])
    out = capsys.readouterr()
    return code, out.out, out.err


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("Übung 漢") / "a b"
    return hc.simulate(hc.constant_cut(t_max=0.8, dt=1e-3)).save(where)


def test_export_writes_beside_the_record_or_where_it_is_told(capsys, folder, tmp_path):
    for given in (folder, folder / "record.npz"):
        code, out, err = run(capsys, "export", given, "--format", "csv")
        assert (code, err) == (0, "") and out == f"written to {folder / 'record.csv'}\n"
        (folder / "record.csv").unlink()
    for words, name in ((["--out", tmp_path / "x.CSV"], "x.CSV"),):
        assert run(capsys, "export", folder, *words)[0] == 0
        with open(tmp_path / name, encoding="utf-8") as f:
            table = np.genfromtxt(f, delimiter=",", names=True, skip_header=2)
        np.testing.assert_array_equal(table["p_x"], hc.Record.load(folder).p[:, 0])
    assert run(capsys, "export", folder, "--format", "mat", "--out", tmp_path / "y.dat")[0] == 0
    assert (tmp_path / "y.dat").read_bytes().startswith(b"MATLAB 5.0")


@pytest.mark.parametrize(
    "words,told",
    [
        ([], ["format", "must be given, as in --format csv or --out cut.csv"]),
        (["--out", "x"], ["format", "must be given"]),
        (["--out", "x.foo"], ["format = 'foo': must be one of nc, parquet, csv, mcap, rrd, mat"]),
        (["--format", "cvs"], ["--format = 'cvs': must be one of nc, parquet, csv"]),
        (["--frmat", "csv"], ["--frmat: no option of export; did you mean --format?"]),
        (["--format", "csv", "--out", "/proc/no/x"], ["out = '/proc/no/x'", "writable"]),
        (["more"], ["unexpected argument 'more' of export"]),
    ],
)
def test_bad_words_are_one_line(capsys, folder, tmp_path, monkeypatch, words, told):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, "export", folder, *words)
    assert code == 2 and out == "" and err.count("\n") == 1
    for text in told:
        assert text in err
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("command", [["export", "--format", "csv"], ["info"]])
def test_what_is_no_record_is_refused(capsys, tmp_path, command):
    (tmp_path / "my.toml").write_text('name = "a"\n')
    np.save(tmp_path / "a.npy", np.zeros(3))
    for file in ("my.toml", "a.npy", "nothing", "."):
        code, out, err = run(capsys, command[0], tmp_path / file, *command[1:])
        assert code == 2 and out == "" and err.count("\n") == 1
        assert "must be a saved record" in err and "Errno" not in err
    assert sorted(os.listdir(tmp_path)) == ["a.npy", "my.toml"]


def test_info_tells_what_a_record_holds(capsys, folder):
    record = hc.Record.load(folder)
    for given in (folder, folder / "record.npz"):
        code, out, err = run(capsys, "info", given)
        assert (code, err) == (0, "")
        size = (folder / "record.npz").stat().st_size
        assert out.startswith(f"record of constant, hapticclay-record-2, {1e-3 * size:.3g} kB\n")
    rows = dict(x.split("  ", 1) for x in out.splitlines() if "  " in x)
    assert rows["status"].strip() == record.status
    assert rows["samples"].strip() == "801, from 0 to 0.8 s, every 0.001 s"
    assert rows["clay"].strip() == "b = 90 N.s/m" and "numpy" in rows["written by"]
    for name, unit in (("fe", "N"), ("tau", "N.m"), ("b", "N.s/m")):
        x = getattr(record, name)
        assert rows[name].split()[:6] == [
            *("801", "x", "2", unit, f"{x.min():.6g}", f"{x.max():.6g}"),
        ]


def test_info_of_other_records(capsys, tmp_path):
    import dataclasses

    r = hc.simulate(hc.constant_cut(t_max=0.05))
    none = {f: getattr(r, f)[:0] for f in ("t", "p", "v", "fh", "fe", "b", "q", "qd", "tau")}
    empty = dataclasses.replace(r, **none, delta=r.delta[:0], crossings=())
    old = dataclasses.replace(r, versions={"hapticclay": "0.0.1"}, notes={"frames": 3})
    block = hc.Groove((0.001, 0.06), (-0.02, 0.02), 2e4, tool=hc.Tool(0.01, 0.004))
    grooved = hc.simulate(dataclasses.replace(r.scenario, clay=hc.Clay.of_groove(block)))
    for record, words in (
        (empty, ["samples     0\n", "0 x 2"]),
        (old, ["read by     hapticclay", "written by  hapticclay 0.0.1", "notes       frames"]),
        (grooved, ["ground", "m^3", "permanent cut"]),
    ):
        code, out, _ = run(capsys, "info", record.save(tmp_path))
        assert code == 0
        for word in words:
            assert word in out
