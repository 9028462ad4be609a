"""Faults of sweeps: a full disk, killed processes, damaged files, two sweeps in one folder."""

import contextlib
import os
import resource
import shutil
import signal
import subprocess
import sys

import numpy as np
import psutil
import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.errors import ParameterError
from hapticclay.studies import store, store_runs, sweep
from hapticclay.studies.sampling import parse_grid
from hapticclay.studies.sweep import Sweep
from tests.hunt import HUNTS
from tests.waiting import PATIENCE, until

RUNS = 40
MORE = "10:1000:40log"  # values of b: twice the runs, so that a sweep is caught at work


def command(out, *extra, t_max=0.02, b="10:1000:20log", workers=2, chunk=2):
    return [
        sys.executable,
        "-m",
        "hapticclay",
        "sweep",
        "--grid",
        f"b={b} gain.x=1:2:2",
        "--fixed",
        f"t_max={t_max}",
        "--chunk",
        str(chunk),
        "--workers",
        str(workers),
        "--no-maps",
        "--out",
        str(out),
        *extra,
    ]


def plan(b="10:1000:20log", t_max=0.02, chunk=2):
    return Sweep("constant", parse_grid(f"b={b} gain.x=1:2:2"), {"t_max": t_max}, chunk=chunk)


def columns(table):
    return {c: repr(table[c].to_pylist()) for c in table.column_names if c != "wall_time"}


def temporary(out):
    """Files that are not what a sweep is made of."""
    whole = ("sweep.json", ".lock")
    return [
        f
        for f in out.rglob("*")
        if f.is_file() and f.name not in whole and not f.name.startswith("part-")
    ]


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """The folder of the sweep of `command`."""
    out = tmp_path_factory.mktemp("whole")
    sweep.run_sweep(plan(), out, workers=1)
    return out


@pytest.fixture
def copy(swept, tmp_path):
    """A copy of that folder."""
    return shutil.copytree(swept, tmp_path / "o")


@pytest.fixture(scope="module")
def whole(swept):
    """What every sweep of `command` must come to."""
    return columns(store.read_sweep(swept))


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 64 kB: room for some ten of the twenty parts."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = shutil.which("mount")
    made = mount and subprocess.run(
        [mount, "-t", "tmpfs", "-o", "size=64k", "tmpfs", disk], capture_output=True
    )
    if not made or made.returncode:
        pytest.skip("may not mount a file system here")
    yield disk
    subprocess.run(["umount", "-l", disk], check=True)


def one_line_of_a_full_disk(code, err, word):
    assert code == 2 and "Traceback" not in err
    said = [line for line in err.splitlines() if " to go" not in line]  # but progress
    assert len(said) == 1 and "must be writable" in said[0] and word in said[0]


@pytest.mark.parametrize("workers", [1, 2] if HUNTS else [1])  # a limit for files is met by both
def test_a_full_disk_is_one_line_and_the_sweep_goes_on_with_room(
    small_disk, whole, workers, capsys
):
    out = small_disk / "o"
    code = app.main(command(out, workers=workers)[3:])
    one_line_of_a_full_disk(code, capsys.readouterr().err, "No space left")
    assert not temporary(out)
    there = len(store.read_sweep(out))  # all that is there is valid
    assert 0 < there < RUNS
    with pytest.raises(ParameterError, match="No space left"):
        sweep.run_sweep(plan(), out, workers=1)
    assert len(store.read_sweep(out)) >= there
    subprocess.run(["mount", "-o", "remount,size=4m", small_disk], check=True)
    sweep.run_sweep(plan(), out, workers=1)
    assert columns(store.read_sweep(out)) == whole


def test_a_disk_that_is_full_from_the_start_is_one_line(small_disk, capsys):
    with contextlib.suppress(OSError), open(small_disk / "fill", "wb", buffering=0) as f:
        while True:
            f.write(bytes(4096))
    code = app.main(command(small_disk / "o")[3:])
    one_line_of_a_full_disk(code, capsys.readouterr().err, "No space left")
    assert not temporary(small_disk / "o")


@pytest.mark.untraced
@pytest.mark.parametrize("workers", [1, 2])
def test_a_file_beyond_the_limit_of_the_process_is_one_line(tmp_path, whole, workers):
    """The full disk without a mount: sweep.json fits into 2 kB, a part does not."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))

    done = subprocess.run(
        command(tmp_path, workers=workers), capture_output=True, text=True, preexec_fn=limit
    )
    one_line_of_a_full_disk(done.returncode, done.stderr, "File too large")
    assert not temporary(tmp_path) and not list((tmp_path / "data").iterdir())
    sweep.run_sweep(plan(), tmp_path, workers=1)
    assert columns(store.read_sweep(tmp_path)) == whole


def alive(process):
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


@contextlib.contextmanager
def at_work(out, t_max=0.3, chunk=4, workers=2):
    """A sweep that has written two parts, and its worker processes."""
    with subprocess.Popen(
        command(out, t_max=t_max, b=MORE, workers=workers, chunk=chunk),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as p:
        try:
            until(
                lambda: len(list((out / "data").glob("part-*"))) >= 2,
                alive=lambda: p.poll() is None,
            )
            yield p, psutil.Process(p.pid).children(recursive=True)
        finally:
            p.kill()


@pytest.mark.untraced
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_killed_parent_is_outlived_by_no_worker_and_no_lock(tmp_path, how):
    ours = plan(MORE, t_max=2.0, chunk=1)
    with at_work(tmp_path, 2.0, 1) as (p, children):
        assert len(children) >= 2
        with pytest.raises(ParameterError, match=f"process {p.pid} on "):
            sweep.run_sweep(ours, tmp_path)
        p.send_signal(how)
        p.wait()
        assert p.returncode == (-how if how == signal.SIGKILL else 128 + how)
        with store.claimed(ours, tmp_path) as (_, todo):
            assert 0 < len(todo) < 2 * RUNS
        until(lambda: not any(map(alive, children)))
    assert store.missing_parts(ours, tmp_path)  # none had gone on


def test_a_killed_worker_is_one_line_and_the_sweep_goes_on(tmp_path):
    with at_work(tmp_path) as (p, children):
        next(c for c in children if "spawn_main" in " ".join(c.cmdline())).kill()
        _, err = p.communicate(timeout=PATIENCE)
        said = [line for line in err.splitlines() if " to go" not in line]
        assert p.returncode == 1 and len(said) == 1 and "worker was killed" in said[0]
    assert sweep.run_sweep(plan(MORE, t_max=0.3, chunk=4), tmp_path, workers=1) > 0
    assert len(store.read_sweep(tmp_path)) == 2 * RUNS


def truncated(file, out):
    file.write_bytes(file.read_bytes()[:-7])


def empty(file, out):
    file.write_bytes(b"")


def garbage(file, out):
    file.write_bytes(os.urandom(5000))


def flipped(file, out):
    """One bit of a figure: without checksums the file reads well, and says something else."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    def unchecked(content):
        return pq.ParquetFile(pa.BufferReader(bytes(content))).read(use_threads=False).to_pylist()

    content = bytearray(file.read_bytes())
    whole = repr(unchecked(content))
    for at in range(4, len(content)):
        content[at] ^= 1
        with contextlib.suppress(pa.ArrowException, OSError, ValueError):
            if repr(unchecked(content)) != whole:
                file.write_bytes(content)
                return
        content[at] ^= 1
    raise AssertionError("no bit that only a checksum guards")


def copied(file, out):
    shutil.copy(store.part_file(out, 2), file)


def foreign(file, out):
    other = out.parent / "other"
    sweep.run_sweep(plan("10:1000:4log"), other, workers=1)
    shutil.copy(store.part_file(other, 1), file)


def short(file, out):
    import pyarrow.parquet as pq

    pq.write_table(store.read_part(file).slice(0, 1), file)


def columnless(file, out):
    import pyarrow.parquet as pq

    pq.write_table(store.read_part(file).drop_columns(["cause"]), file)


@pytest.mark.parametrize(
    "harm,fault",
    [
        (truncated, "damaged"),
        (empty, "damaged"),
        (garbage, "damaged"),
        (flipped, "damaged"),
        (copied, "a copy of part 2"),
        (foreign, "of another sweep"),
        (short, "incomplete"),
        (columnless, "incomplete"),
    ],
)
def test_bad_parts_are_named_and_made_again(copy, capsys, whole, harm, fault):
    out = copy
    for n in (1, 7):
        harm(store.part_file(out, n), out)
    if harm is not short:
        with pytest.raises(ParameterError, match="part-00000[17].parquet"):
            store.read_sweep(out)
    capsys.readouterr()
    assert sweep.run_sweep(plan(), out, workers=1) == 4
    said = capsys.readouterr().err
    assert (
        said
        == f"hapticclay: made again: part-000001.parquet ({fault}), part-000007.parquet ({fault})\n"
    )
    assert columns(store.read_sweep(out)) == whole
    assert sweep.run_sweep(plan(), out, workers=1) == 0 and not capsys.readouterr().err


def test_many_bad_parts_are_one_short_line(copy, capsys):
    for n in range(12):
        empty(store.part_file(copy, n), copy)
    assert len(store.begin(plan(), copy)) == 12
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and said.count(".parquet") == 5 and "7 more" in said


def test_a_stray_file_among_the_parts_is_refused_and_kept(copy):
    stray = copy / "data" / "part-000001 (copy).parquet"
    shutil.copy(store.part_file(copy, 1), stray)
    with pytest.raises(ParameterError, match="does not belong to the sweep"):
        sweep.run_sweep(plan(), copy, workers=1)
    with pytest.raises(ParameterError, match="copy"):
        store.read_sweep(copy)
    assert stray.is_file()


def test_a_part_that_cannot_be_read_is_refused_not_removed(copy):
    part = store.part_file(copy, 3)
    part.unlink()
    part.symlink_to(part)  # the system finds no end of it, and no fault of the file
    with pytest.raises(ParameterError, match="part-000003.*[Tt]oo many"):
        sweep.run_sweep(plan(), copy, workers=1)
    assert part.is_symlink()


def to_zeros(part):
    part.symlink_to("/dev/zero")


@pytest.mark.parametrize("make", [to_zeros, os.mkfifo, os.mkdir])
def test_a_part_that_is_no_file_is_refused_at_once(copy, capsys, whole, make):
    """A device that never ends and a pipe without a writer would be read for ever."""
    part = store.part_file(copy, 3)
    part.unlink()
    make(part)
    with pytest.raises(ParameterError, match="part-000003.parquet.*damaged"):
        store.read_sweep(copy)
    if make is os.mkdir:
        with pytest.raises(ParameterError, match="damaged and cannot be removed"):
            sweep.run_sweep(plan(), copy, workers=1)
        part.rmdir()
    sweep.run_sweep(plan(), copy, workers=1)
    assert columns(store.read_sweep(copy)) == whole


def test_a_part_that_claims_too_many_rows_is_not_read(copy):
    """A column of one value takes some bytes, however many rows there are."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    part = store.part_file(copy, 3)
    pq.write_table(pa.table({"run": np.zeros(2_000_000, dtype=np.int64)}), part)
    assert part.stat().st_size < 10_000
    with pytest.raises(ParameterError, match="part-000003.parquet.*damaged"):
        store.read_sweep(copy)


def sweep_study(out, progress):
    return sweep.run_sweep(plan(), out, workers=1, progress=progress)


def column_study(out, progress):
    scene = hc.with_fields(hc.constant_cut(operator=hc.Operator()), {"t_max": 0.01})
    masses = {"operator.mass": np.linspace(0.5, 1.0, 8)}
    return hc.studies.run_columns(scene, masses, out, chunk=2, workers=1, progress=progress)


def trial_study(out, progress):
    law = hc.studies.Distribution("uniform", 20.0, 30.0)
    trials = hc.studies.Trials(hc.studies.PushedLoop("x", K=2.0), {"b": law}, runs=8, chunk=2)
    return hc.studies.monte_carlo(trials, out=out, progress=progress)


def episode_study(out, progress):
    pytest.importorskip("gymnasium")
    from hapticclay.gym.dataset import Recording

    recording = Recording("ProbeClay-v0", 0.1, seed=0, episodes=4, engine="auto")
    with contextlib.closing(recording.env):
        return store_runs.run_plan(recording, out, 1, progress=progress)


def remove_all(out):
    shutil.rmtree(out)


def remove_parts(out):
    shutil.rmtree(out / "data")


def replace_sweep(out):
    """The folder is removed, and another sweep begins in its place, which no lock prevents."""
    shutil.rmtree(out)
    sweep.run_sweep(plan("1:2:2"), out, workers=1)


STUDIES = {sweep_study: RUNS, column_study: 8, trial_study: 8, episode_study: 4}


@pytest.mark.parametrize("study", STUDIES)
@pytest.mark.parametrize(
    "harm, said",
    [
        (remove_all, "was removed or replaced while the sweep ran"),
        (replace_sweep, "was removed or replaced while the sweep ran"),
        (remove_parts, r"\d of \d+ runs are in .*: files were removed while the sweep ran"),
    ],
)
def test_a_folder_removed_at_work_is_an_error_and_is_made_again(tmp_path, study, harm, said):
    out, files = tmp_path / "o", []

    def progress(n):
        files.append(n)
        if len(files) == 2:
            harm(out)

    with pytest.raises(FileNotFoundError, match=said):
        study(out, progress)
    others = len(list((out / "data").glob("part-*"))) if out.exists() else 0
    assert others < 20  # what another sweep wrote is left alone, and nothing is added
    if harm is replace_sweep:
        with pytest.raises(ParameterError, match="another"):
            study(out, lambda n: None)
        shutil.rmtree(out)
    study(out, lambda n: None)
    table = store.read_sweep(out)
    assert table["run"].to_pylist() == list(range(table.num_rows))
    assert table.num_rows == STUDIES[study]


def test_a_folder_removed_after_the_last_file_is_an_error(tmp_path):
    """The last chunk is stored, and nothing more is written that would notice."""
    made = []

    def progress(n):
        made.append(n)
        if sum(made) == RUNS:
            store.part_file(tmp_path, 5).unlink()

    with pytest.raises(FileNotFoundError, match=f"{RUNS - 2} of {RUNS} runs are in"):
        sweep_study(tmp_path, progress)


def test_a_folder_removed_while_a_file_is_written_is_an_error(tmp_path, monkeypatch):
    out, write = tmp_path / "o", store.write_part

    def slow(*given):
        write(*given)
        shutil.rmtree(out)

    monkeypatch.setattr(store, "write_part", slow)
    with pytest.raises(FileNotFoundError, match="was removed or replaced"):
        sweep.run_sweep(plan(), out, workers=1)
    assert not out.exists()


@pytest.mark.untraced
def test_the_command_says_in_one_line_that_its_folder_has_gone(tmp_path):
    out = tmp_path / "o"
    with at_work(out, workers=1) as (p, _):
        shutil.rmtree(out)
        said, err = p.communicate(timeout=PATIENCE)
    lines = [line for line in err.splitlines() if " to go" not in line]
    assert p.returncode == 1 and len(lines) == 1 and f"{out} was removed" in lines[0]
    assert "runs in" not in said and not out.exists()


def test_of_sweeps_started_at_once_one_wins_and_the_others_are_refused(tmp_path):
    """The same twice, and one that differs."""
    b = ("10:1000:20log", "10:1000:20log", "20:1000:20log")
    starts = [
        subprocess.Popen(
            command(tmp_path, t_max=0.3, b=x, workers=1),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for x in b
    ]
    ends = [(*p.communicate(timeout=PATIENCE), p.returncode) for p in starts]
    assert sorted(code for _, _, code in ends) == [0, 2, 2], ends
    for said in (err for _, err, code in ends if code):
        assert said.count("\n") == 1
        assert "another sweep is at work" in said or "holds another sweep" in said
    winner = plan(b[[code for _, _, code in ends].index(0)], t_max=0.3)
    table = store.read_sweep(tmp_path)
    assert table["run"].to_pylist() == list(range(RUNS))
    assert table["b"].to_pylist() == winner.points(0, RUNS)[:, 0].tolist()
    assert store.begin(winner, tmp_path) == []


def test_a_folder_is_held_by_one_until_it_ends(tmp_path, capsys):
    with store.claimed(plan(), tmp_path) as (_, todo):
        assert len(todo) == 20
        for again in (plan(), plan("1:2:3")):
            with pytest.raises(
                ParameterError, match=f"another sweep is at work .process {os.getpid()} on "
            ):
                sweep.run_sweep(again, tmp_path)
        assert app.main(command(tmp_path)[3:]) == 2
        assert capsys.readouterr().err.count("\n") == 1
        assert not list(tmp_path.glob("data/*"))
    with pytest.raises(ParameterError, match="holds another sweep"):
        sweep.run_sweep(plan("1:2:3"), tmp_path)
    with store.claimed(plan(), tmp_path) as (_, todo):
        assert len(todo) == 20


def test_a_file_system_without_locks_is_said(tmp_path, capsys, monkeypatch):
    import fcntl

    def nolocks(*args):
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", nolocks)
    assert sweep.run_sweep(plan("1:2:3"), tmp_path, workers=1) == 6
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "no file locks" in said
