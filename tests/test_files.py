"""What is written replaces regular files alone, and none that the command reads from."""

import os
import socket
import stat

import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.files import atomic


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return hc.simulate(hc.constant_cut(t_max=0.01)).save(tmp_path_factory.mktemp("saved") / "rec")


def make_pipe(path):
    os.mkfifo(path)


def make_socket(path):
    with socket.socket(socket.AF_UNIX) as s:
        s.bind(str(path))


def make_device(path):
    try:
        os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(1, 3))
    except PermissionError:
        pytest.skip("device nodes need privileges")


@pytest.mark.parametrize("linked", [False, True])
@pytest.mark.parametrize(
    "make, said",
    [
        (make_pipe, "is a pipe"),
        (make_socket, "is a device or socket"),
        (make_device, "is a device or socket"),
        (os.mkdir, "is a folder"),
    ],
)
def test_only_regular_files_are_replaced(tmp_path, make, said, linked):
    path = tmp_path / "special"
    make(path)
    kind = stat.S_IFMT(os.stat(path).st_mode)
    out = path
    if linked:
        out = tmp_path / "link"
        out.symlink_to(path)
    with pytest.raises(hc.ParameterError, match=f"must be a regular file, {said}"):
        with atomic(out) as f:
            f.write(b"x")
    assert stat.S_IFMT(os.stat(path).st_mode) == kind
    assert len(os.listdir(tmp_path)) == 1 + linked


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "link.toml").symlink_to(tmp_path / "file.toml")
    for text in (b"new", b"newer"):  # a file that is not there yet, and one that is
        with atomic(tmp_path / "link.toml") as f:
            f.write(text)
        assert (tmp_path / "link.toml").is_symlink()
        assert (tmp_path / "file.toml").read_bytes() == text
    assert sorted(os.listdir(tmp_path)) == ["file.toml", "link.toml"]


@pytest.mark.parametrize("name", ["record.npz", "summary.json", "scenario.toml"])
@pytest.mark.parametrize("how", ["folder", "file", "link"])
def test_an_export_keeps_the_record_it_reads(saved, tmp_path, capsys, name, how):
    before = {f.name: f.read_bytes() for f in saved.iterdir()}
    out = saved / name
    if how == "link":
        out = tmp_path / "out"
        out.symlink_to(saved / name)
    source = saved / "record.npz" if how == "file" and name == "record.npz" else saved
    code = app.main(["export", str(source), "--format", "csv", "--out", str(out)])
    said = capsys.readouterr().err
    assert code == 2 and said.count("\n") == 1
    assert "must not be a file that the command reads from" in said
    assert {f.name: f.read_bytes() for f in saved.iterdir()} == before


def test_a_run_keeps_the_scenario_file_it_reads(tmp_path, capsys):
    file = tmp_path / "scenario.toml"
    file.write_text('# mine\nexperiment = "constant"\nt_max = 0.01\n')
    code = app.main(["run", str(file), "--no-plots", "--out", str(tmp_path)])
    assert code == 2 and "reads from" in capsys.readouterr().err
    assert file.read_text().startswith("# mine")


def test_a_scenario_is_saved_over_the_file_it_came_from(tmp_path):
    hc.constant_cut().save(tmp_path / "a.toml")
    hc.Scenario.load(tmp_path / "a.toml").save(tmp_path / "a.toml")
    assert hc.Scenario.load(tmp_path / "a.toml") == hc.constant_cut()


def test_files_have_the_rights_of_new_files_and_the_process_keeps_its_mask(tmp_path, monkeypatch):
    """The mask is the whole process's: set for an instant, it is every thread's."""
    set_mask, asked = os.umask, []
    monkeypatch.setattr(os, "umask", lambda mask: asked.append(mask) or set_mask(mask))
    before = set_mask(0o027)
    try:
        with atomic(tmp_path / "a") as file:
            file.write(b"whole")
    finally:
        assert set_mask(before) == 0o027
    assert asked == []
    assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640
    assert [x.name for x in tmp_path.iterdir()] == ["a"]
