"""The command line as a newcomer would use it."""

import contextlib
import json
import os
import pty
import signal
import subprocess
import sys
import termios

import pytest

from hapticclay import cli


def run(capsys, *args):
    code = cli.main(args)
    out = capsys.readouterr()
    return code, out.out, out.err


def test_run_constant_writes_record_summary_and_plots(capsys, tmp_path):
    code, out, err = run(capsys, "run", "constant", "--b", "50", "--gain", "1", "0.4", "--out", str(tmp_path / "o"))
    assert (code, err) == (0, "")
    assert sorted(os.listdir(tmp_path / "o")) == ["force.png", "record.npz", "summary.json", "velocity.png"]
    assert "fe/v" in out and "status: finished at" in out
    summary = json.loads((tmp_path / "o" / "summary.json").read_text())
    assert summary["scenario"]["gain"] == [1.0, 0.4]
    assert summary["regions"][1]["x"]["b"] == 50.0


def test_run_free_and_no_plots(capsys, tmp_path):
    code, out, _ = run(capsys, "run", "free", "--shaping", "--no-plots", "--every", "10", "--out", str(tmp_path))
    assert code == 0 and "border x = 20 cm" in out
    assert sorted(os.listdir(tmp_path)) == ["record.npz", "summary.json"]


def test_instability_is_a_result_with_advice(capsys, tmp_path):
    code, out, _ = run(capsys, "run", "constant", "--gain", "1", "1", "--out", str(tmp_path))
    assert code == 0
    assert "status: diverged: y axis at" in out and "advice: lower gain[y]" in out


@pytest.mark.parametrize("args,words", [
    (["run", "constant", "--b", "-1"], ["b = -1.0", ">= 0"]),
    (["run", "constant", "--b", "nan"], ["b = nan", "finite"]),
    (["run", "constant", "--b", "x"], ["--b", "'x'"]),
    (["run", "constant", "--force", "inf", "0"], ["force[x] = inf"]),
    (["run", "constant", "--gain", "1"], ["--gain"]),
    (["run", "constant", "--gain", "0", "1"], ["gain[x] = 0.0"]),
    (["run", "constant", "--dt", "0"], ["dt = 0.0"]),
    (["run", "constant", "--dt", "-1e-3"], ["dt = -0.001"]),
    (["run", "constant", "--length", "0.5"], ["length = 0.5", "unreachable"]),
    (["run", "constant", "--origin", "2", "2"], ["unreachable"]),
    (["run", "constant", "--clay", "0.15", "0.05"], ["clay"]),
    (["run", "constant", "--nonsense", "1"], ["--nonsense"]),
    (["run", "constnat"], ["constnat", "did you mean 'constant'"]),
    (["rnu", "constant"], ["rnu", "did you mean 'run'"]),
    (["stabilty"], ["stabilty", "did you mean 'stability'"]),
    (["run"], ["constant"]),
    ([], ["run"]),
    (["run", "constant", "--every", "0"], ["every = 0"]),
])  # fmt: skip
def test_bad_input_is_one_line_and_exit_2(capsys, tmp_path, monkeypatch, args, words):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *args)
    assert code == 2 and out == ""
    assert err.count("\n") == 1 and err.startswith("hapticclay: ")
    for word in words:
        assert word in err
    assert os.listdir(tmp_path) == []


def test_unwritable_out_is_refused_before_the_run(capsys, monkeypatch):
    monkeypatch.setattr(cli, "simulate", lambda *a, **k: pytest.fail("ran"))
    code, _, err = run(capsys, "run", "constant", "--out", "/proc/nowhere")
    assert code == 2 and "out = '/proc/nowhere'" in err and err.count("\n") == 1


def test_out_that_is_a_file_is_refused(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = run(capsys, "run", "constant", "--out", str(tmp_path / "file"))
    assert code == 2 and err.count("\n") == 1


@pytest.mark.parametrize("args", [["--help"], ["run", "--help"], ["run", "constant", "--help"], ["version"]])
def test_help_and_version(capsys, args):
    code, out, err = run(capsys, *args)
    assert (code, err) == (0, "") and len(out) > 30


def test_module_entry_point_runs_without_a_display(tmp_path):
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "MPLBACKEND", "MUJOCO_GL")}
    out = subprocess.run(
        [sys.executable, "-W", "error", "-m", "hapticclay", "run", "constant", "--t-max", "0.5", "--out", "o"],
        cwd=tmp_path, env=env, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (out.returncode, out.stderr) == (0, "")
    assert sorted(os.listdir(tmp_path)) == ["o"]  # no MUJOCO_LOG.TXT


def test_ctrl_c_leaves_nothing_behind(tmp_path):
    terminal, end = pty.openpty()
    termios.tcsetwinsize(end, (24, 80))
    with open(terminal, "rb", buffering=0) as screen, subprocess.Popen(
        [sys.executable, "-m", "hapticclay", "run", "constant", "--dt", "1e-6", "--out", "o"],
        cwd=tmp_path, stderr=end, stdout=subprocess.DEVNULL,
    ) as p:  # fmt: skip
        os.close(end)
        assert b"constant" in screen.read(1000)  # the bar is there, so it runs
        p.send_signal(signal.SIGINT)
        said = b""
        with contextlib.suppress(OSError):  # the end of a terminal
            while True:
                said += screen.read(1000)
    assert p.returncode == 130
    assert said.decode().split("\r")[-2:] == ["hapticclay: interrupted", "\n"]
    assert os.listdir(tmp_path) == []


def test_output_cut_short_is_no_traceback_and_loses_nothing(tmp_path):
    out = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {sys.executable} -m hapticclay run constant --t-max 0.5 --out o | head -0"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert "Traceback" not in out.stderr
    assert sorted(os.listdir(tmp_path / "o")) == ["force.png", "record.npz", "summary.json", "velocity.png"]


def test_a_full_device_for_output_is_one_line(tmp_path):
    with open("/dev/full", "w") as full:
        out = subprocess.run(
            [sys.executable, "-m", "hapticclay", "run", "constant", "--t-max", "0.5", "--no-plots", "--out", "o"],
            cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, timeout=120,
        )  # fmt: skip
    assert out.returncode == 1 and out.stderr.count("\n") == 1 and "No space left" in out.stderr


def test_results_are_shown_even_if_they_cannot_be_kept(capsys, tmp_path, monkeypatch):
    def full(self, path):
        raise cli.ParameterError("out", str(path), "must be writable (No space left on device)")

    monkeypatch.setattr(cli.Record, "save", full)
    code, out, err = run(capsys, "run", "constant", "--t-max", "0.5", "--out", str(tmp_path))
    assert code == 2 and "status: time limit" in out and err.count("\n") == 1


def test_help_on_a_terminal_without_unicode(tmp_path):
    env = {**os.environ, "LC_ALL": "C", "PYTHONIOENCODING": "ascii"}
    out = subprocess.run([sys.executable, "-m", "hapticclay", "--help"], env=env, capture_output=True, timeout=60)
    assert out.returncode == 0 and b"run" in out.stdout and out.stderr == b""


def test_a_run_that_ends_at_once_is_still_drawn(capsys, tmp_path):
    args = ("--b", "1e4", "--start", "0.06", "0", "--force", "1e6", "0", "--dt", "0.02")
    code, out, _ = run(capsys, "run", "constant", *args, "--out", str(tmp_path))
    assert code == 0 and "diverged" in out and (tmp_path / "force.png").is_file()
