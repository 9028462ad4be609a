"""The command line as a newcomer would use it."""

import contextlib
import json
import os
import pty
import re
import signal
import subprocess
import sys
import termios

import pytest

import hapticclay as hc
from hapticclay.cli import app, parser
from hapticclay.display import cell_text
from hapticclay.simulation import record, simulate
from hapticclay.views import run_figures
from tests.waiting import PATIENCE


def run(capsys, *args):
    code = app.main(args)
    out = capsys.readouterr()
    return code, out.out, out.err


def test_run_constant_writes_record_summary_and_plots(capsys, tmp_path):
    code, out, err = run(
        capsys, "run", "constant", "--b", "50", "--gain", "1", "0.4", "--out", str(tmp_path / "o")
    )
    assert (code, err) == (0, "")
    assert sorted(os.listdir(tmp_path / "o")) == [
        "force.png",
        "record.npz",
        "scenario.toml",
        "summary.json",
        "velocity.png",
    ]
    assert "fe/v" in out and "status: finished at" in out
    summary = json.loads((tmp_path / "o" / "summary.json").read_text())
    assert summary["scenario"]["gain"] == [1.0, 0.4]
    assert summary["regions"][1]["x"]["b"] == 50.0


def test_run_free_and_no_plots(capsys, tmp_path):
    code, out, _ = run(
        capsys,
        "run",
        "free",
        "--inertia-shaping",
        "--no-plots",
        "--every",
        "10",
        "--out",
        str(tmp_path),
    )
    assert code == 0 and "border x = 20 cm" in out
    assert sorted(os.listdir(tmp_path)) == ["record.npz", "scenario.toml", "summary.json"]


def test_a_run_to_an_asked_error_says_what_was_reached(capsys, tmp_path):
    code, out, err = run(
        capsys, "run", "constant", "--error", "1e-5m", "--no-plots", "--out", str(tmp_path)
    )
    assert (code, err) == (0, "") and "error: " in out
    assert "1e-05 m requested: reached (fast, dt = " in out and "why:" not in out
    assert hc.Record.load(tmp_path).error.reached
    args = ("--gain", "1", "1", "--error", "1e-5", "--no-plots", "--out", str(tmp_path))
    code, out, _ = run(capsys, "run", "constant", *args)
    assert code == 0 and "requested: not reached" in out and "why: the loop is unstable" in out


def test_accuracy_writes_figure_page_and_numbers(capsys, tmp_path):
    args = ("--length", "0.06", "--quick", "--out", str(tmp_path))
    code, out, err = run(capsys, "accuracy", "constant", *args)
    assert (code, err) == (0, "")
    assert sorted(os.listdir(tmp_path)) == ["accuracy.json", "accuracy.md", "accuracy.png"]
    assert "Cheapest setting by error in the times of the border crossings" in out
    data = json.loads((tmp_path / "accuracy.json").read_text())
    assert data["schema"] == "hapticclay-accuracy-1"
    series = {x["series"] for x in data["settings"]}
    assert series == {"fast", "accurate", "sampled, Ts = dt"}
    page = (tmp_path / "accuracy.md").read_text()
    assert "](accuracy.png)" in page and page.count("\n| fast ") >= 6
    tables, _, told = out.partition("Errors are against the ")
    assert told and max(widths(tables)) <= 80


def test_instability_is_a_result_with_advice(capsys, tmp_path):
    code, out, _ = run(capsys, "run", "constant", "--gain", "1", "1", "--out", str(tmp_path))
    assert code == 0
    assert "status: diverged: y axis at" in out and "advice: lower gain[y]" in out


@pytest.mark.parametrize(
    "args,words",
    [
        (["run", "constant", "--b", "-1"], ["b = -1.0", ">= 0"]),
        (["run", "constant", "--b", "nan"], ["b = nan", "finite"]),
        (["run", "constant", "--b", "x"], ["--b = 'x': must be a finite number >= 0"]),
        (["run", "constant", "--b"], ["--b = '': must be a finite number >= 0"]),
        (["run", "constant", "--every", "1.5"], ["--every = 1.5: must be a whole number"]),
        (
            ["run", "constant", "--control", "smapled"],
            ["--control = 'smapled'", "did you mean 'sampled'"],
        ),
        (["run", "constant", "--Ts", "foo"], ["--Ts = 'foo': must be a finite number"]),
        (
            ["run", "constant", "--Ts", "0.00072"],
            ["Ts = 0.00072: must be None unless control is 'sampled'\n"],
        ),
        (
            ["run", "constant", "--control", "sampled", "--Ts", "1e-3", "--dt", "3.6e-4"],
            ["must be a whole multiple of dt = 0.00036 s", "nearest is 0.00108 s"],
        ),
        (
            ["run", "variable", "--growth", "foo"],
            [
                "--growth = 'foo': must be a finite number",
                "N.s/m per s or one of 30/s, 0.15/s, 0.15/sample, none\n",
            ],
        ),
        (["run", "constant", "--force", "inf", "0"], ["force[x] = inf"]),
        (["run", "constant", "--gain"], ["--gain = '': must be 2 numbers"]),
        (["run", "constant", "--gain", "a"], ["--gain = 'a': must be 2 numbers"]),
        (["run", "constant", "--gain", "1", "a"], ["--gain[y] = 'a': must be a finite number"]),
        (["run", "constant", "--gain", "1", "1", "7"], ["--gain = '1 1 7': must be 2 numbers"]),
        (["run", "constant", "--b", "1", "7"], ["unexpected argument '7' of run constant"]),
        (["run", "constant", "--gain", "0", "1"], ["gain[x] = 0.0"]),
        (["run", "constant", "--dt", "0"], ["dt = 0.0"]),
        (["run", "constant", "--dt", "-1e-3"], ["dt = -0.001"]),
        (["run", "constant", "--length", "0.5"], ["length = 0.5", "unreachable"]),
        (["run", "constant", "--origin", "2", "2"], ["unreachable"]),
        (["run", "constant", "--clay", "0.15", "0.05"], ["clay"]),
        (
            ["run", "constant", "--nonsense", "1"],
            ["--nonsense: no option of run constant; see hapticclay run constant"],
        ),
        (
            ["run", "constant", "--gan", "1", "1"],
            ["--gan: no option of run constant; did you mean --gain?"],
        ),
        (["run", "constant", "--no-plot"], ["did you mean --no-plots?"]),
        (
            ["run", "constant", "--torque_limits=1", "1"],
            ["--torque_limits: no", "did you mean --torque-limit?"],
        ),
        (["stability", "--axs", "y"], ["--axs: no option of stability; did you mean --axis?"]),
        (["sweep", "--grd", "b=1:2:3"], ["did you mean --grid?"]),
        (["identify", "nowhere.csv", "extra"], ["unexpected argument 'extra' of identify"]),
        (["version", "--b"], ["--b: no option of version; see hapticclay version --help"]),
        (
            ["video", "--speed", "2", "constnat"],
            ["did you mean 'constant'? (or give a scenario file, .toml or .json, or the folder"],
        ),
        (["run", "constnat"], ["constnat", "did you mean 'constant'"]),
        (["rnu", "constant"], ["rnu", "did you mean 'run'"]),
        (["stabilty"], ["stabilty", "did you mean 'stability'"]),
        (["run"], ["give an experiment or a scenario file: constant, variable, stability, free\n"]),
        (["help", "nope"], ["command = 'nope'"]),
        (["--nonsense"], ["--nonsense: no option of hapticclay; see hapticclay --help"]),
        (["info"], ["info needs record: a path"]),
        (["compare"], ["2 to 5 files"]),
        (["device", "srve"], ["action = 'srve'", "did you mean 'serve'?"]),
        (["export", "o", "--format", "cvs"], ["--format = 'cvs'", "did you mean 'csv'?"]),
        (["run", "variable", "--growth", "nne"], ["--growth = 'nne'", "did you mean 'none'?"]),
        (["run", "constant", "--format"], ["--format = '': must be one or more, each one of png"]),
        (["run", "constant", "--"], ["--: no option of run constant"]),
        (["stability", "--num"], ["--num = '': must be one or more, each a finite number"]),
        (["stability", "--G", "1", "2"], ["--G = '1 2': must be 3 numbers"]),
        (["zwidth", "--hand", "1", "2s", "0"], ["--hand = '2s': must be a number in N.s/m, not"]),
        (["run", "constant", "--operator=maybe"], ["--operator = 'maybe': must be True or False"]),
        (["run", "constant", "--every", "0"], ["every = 0"]),
        (["run", "constant", "--error", "1e-6 kg"], ["error = '1e-6 kg'", "such as '1e-7 m'"]),
        (["run", "constant", "--error", "0"], ["error = 0.0", ">= 1e-11"]),
        (["run", "constant", "--error", "-1e-6"], ["error = -1e-06", ">= 1e-11"]),
        (["run", "constant", "--error", "nan"], ["error = nan", "finite"]),
        (["run", "constant", "--error"], ["--error = '': must be a word"]),
        (["run", "stability", "--error", "1e-6"], ["error = '1e-6': must be in m"]),
        (["run", "constant", "--eror", "1"], ["--eror: no", "did you mean --error?"]),
        (
            ["accuracy"],
            ["give an experiment or a scenario file: constant, variable, stability, free\n"],
        ),
        (["accuracy", "constnat"], ["constnat", "did you mean 'constant'"]),
        (["accuracy", "free", "--qiuck"], ["did you mean --quick?"]),
        (["accuracy", "constant", "--b", "nan"], ["b = nan", "finite"]),
        (["accuracy", "constant", "--out", "/proc/no"], ["out = '/proc/no'", "writable folder"]),
        (
            ["accuracy", "free", "--control", "sampled", "--dt", "1e-5"],
            ["Ts = 1e-05: must be at least 1.6e-05 s"],
        ),
    ],
)
def test_bad_input_is_one_line_and_exit_2(capsys, tmp_path, monkeypatch, args, words):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *args)
    assert code == 2 and out == ""
    assert err.count("\n") == 1 and err.startswith("hapticclay: ")
    for word in words:
        assert word in err
    assert os.listdir(tmp_path) == []


def test_unwritable_out_is_refused_before_the_run(capsys, monkeypatch):
    monkeypatch.setattr(simulate, "simulate", lambda *a, **k: pytest.fail("ran"))
    code, _, err = run(capsys, "run", "constant", "--out", "/proc/nowhere")
    assert code == 2 and "out = '/proc/nowhere'" in err and err.count("\n") == 1


def test_out_that_is_a_file_is_refused(capsys, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, err = run(capsys, "run", "constant", "--out", str(tmp_path / "file"))
    assert code == 2 and err.count("\n") == 1


@pytest.mark.parametrize(
    "args",
    [["--help"], ["run", "--help"], ["run", "constant", "--help"], ["version"], ["--version"]],
)
def test_help_and_version(capsys, args):
    code, out, err = run(capsys, *args)
    assert (code, err) == (0, "") and len(out) > 30


def test_module_entry_point_runs_without_a_display_and_a_home_that_can_be_written(tmp_path):
    lacks = ("DISPLAY", "MPLBACKEND", "MUJOCO_GL", "MPLCONFIG", "XDG_")
    env = {k: v for k, v in os.environ.items() if not k.startswith(lacks)} | {"HOME": "/dev/null"}
    out = subprocess.run(
        [
            sys.executable,
            "-W",
            "error",
            "-m",
            "hapticclay",
            "run",
            "constant",
            "--t-max",
            "0.1",
            "--dpi",
            "40",
            "--out",
            "o",
        ],
        cwd=tmp_path,
        env=env,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (out.returncode, out.stderr) == (0, "")
    assert sorted(os.listdir(tmp_path)) == ["o"]  # no MUJOCO_LOG.TXT
    assert (tmp_path / "o" / "force.png").is_file()


def rest_of(screen):
    """What a terminal says until everybody has left it."""
    said = b""
    with contextlib.suppress(OSError):
        while True:
            said += screen.read(1000)
    return said


SOON = """
import functools, sys
from hapticclay.cli import app, console
from hapticclay.views import film
console.progress_bar = functools.partial(console.progress_bar, delay=0.1)  # not after 2 s
film.ready = lambda *given: None  # without asking for OpenGL
sys.exit(app.main())
"""


def stopped_at_a_terminal(folder, *args):
    """Presses Ctrl-C in a long run when its bar is shown; returns exit status, stdout, screen."""
    terminal, end = pty.openpty()
    termios.tcsetwinsize(end, (24, 80))
    with (
        open(terminal, "rb", buffering=0) as screen,
        open(folder / "said", "w+") as out,
        subprocess.Popen(
            [sys.executable, "-c", SOON, *args],
            cwd=folder,
            stderr=end,
            stdout=out,
        ) as p,
    ):
        os.close(end)
        said = b""
        while (
            said.count(b"constant") < 2
        ):  # after its first showing tqdm has yet to note that it was shown
            said += screen.read(1000)
        p.send_signal(signal.SIGINT)
        said += rest_of(screen)
        p.wait()
        out.seek(0)
        text = out.read()
    (folder / "said").unlink()
    return p.returncode, text, said.decode()


def test_ctrl_c_keeps_what_was_run(tmp_path):
    args = ("run", "constant", "--dt", "1e-6", "--every", "1000", "--dpi", "40", "--out", "o")
    code, out, said = stopped_at_a_terminal(tmp_path, *args)
    assert code == 130 and "Traceback" not in said and "status: interrupted at" in out
    assert sorted(os.listdir(tmp_path / "o")) == [
        "force.png",
        "record.npz",
        "scenario.toml",
        "summary.json",
        "velocity.png",
    ]
    r = hc.Record.load(tmp_path / "o")
    assert r.outcome.code == "interrupted" and 0.0 < r.t[-1] == r.outcome.time < 11.0


def test_ctrl_c_while_a_film_is_simulated_leaves_nothing_behind(tmp_path):
    args = ("video", "constant", "--dt", "2e-6", "--out", "x.webp")
    code, out, said = stopped_at_a_terminal(tmp_path, *args)
    assert (code, out) == (130, "") and said.split("\r")[-2:] == ["hapticclay: interrupted", "\n"]
    assert os.listdir(tmp_path) == []


def test_output_cut_short_is_no_traceback_and_loses_nothing(tmp_path):
    out = subprocess.run(
        [
            "bash",
            "-c",
            f"set -o pipefail; {sys.executable} -m hapticclay run constant --t-max 0.1"
            " --dpi 40 --out o | head -0",
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert "Traceback" not in out.stderr
    assert sorted(os.listdir(tmp_path / "o")) == [
        "force.png",
        "record.npz",
        "scenario.toml",
        "summary.json",
        "velocity.png",
    ]


def test_a_full_device_for_output_is_one_line(tmp_path):
    with open("/dev/full", "w") as full:
        out = subprocess.run(
            [
                sys.executable,
                "-m",
                "hapticclay",
                "run",
                "constant",
                "--t-max",
                "0.5",
                "--no-plots",
                "--out",
                "o",
            ],
            cwd=tmp_path,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=PATIENCE,
        )
    assert out.returncode == 1 and out.stderr.count("\n") == 1 and "No space left" in out.stderr


def test_a_closed_output_is_no_traceback(tmp_path):
    words = f"{sys.executable} -m hapticclay run constant --t-max 0.5 --no-plots --out o >&-"
    out = subprocess.run(
        ["bash", "-c", words], cwd=tmp_path, stderr=subprocess.PIPE, text=True, timeout=PATIENCE
    )
    assert (out.returncode, out.stderr) == (0, "")
    assert sorted(os.listdir(tmp_path / "o")) == ["record.npz", "scenario.toml", "summary.json"]


def test_a_file_that_is_no_record_is_called_so(capsys, tmp_path):
    (tmp_path / "notes.txt").write_text("x")
    code, _, err = run(capsys, "video", str(tmp_path / "notes.txt"))
    assert code == 2 and "must be a scenario file, .toml or .json, or the folder of a record" in err
    code, _, err = run(capsys, "info", str(tmp_path / "notes.txt"))
    assert code == 2 and "must be a saved record (give its folder, or its record.npz" in err


def test_results_are_shown_even_if_they_cannot_be_kept(capsys, tmp_path, monkeypatch):
    def full(self, path):
        raise app.ParameterError("out", str(path), "must be writable (No space left on device)")

    monkeypatch.setattr(record.Record, "save", full)
    code, out, err = run(capsys, "run", "constant", "--t-max", "0.5", "--out", str(tmp_path))
    assert code == 2 and "status: time limit" in out and err.count("\n") == 1


def test_help_on_a_terminal_without_unicode(tmp_path):
    env = {**os.environ, "LC_ALL": "C", "PYTHONIOENCODING": "ascii"}
    out = subprocess.run(
        [sys.executable, "-m", "hapticclay", "--help"],
        env=env,
        capture_output=True,
        timeout=PATIENCE,
    )
    assert out.returncode == 0 and b"run" in out.stdout and out.stderr == b""


def test_a_run_that_ends_at_once_is_still_drawn(capsys, tmp_path):
    args = ("--b", "1e4", "--start", "0.06", "0", "--force", "1e6", "0", "--dt", "0.02")
    code, out, _ = run(capsys, "run", "constant", *args, "--out", str(tmp_path))
    assert code == 0 and "diverged" in out and (tmp_path / "force.png").is_file()


@pytest.mark.parametrize(
    "scenario",
    [
        hc.constant_cut(t_max=0.1),
        hc.variable_cut(t_max=0.1),
        hc.free(t_max=0.1),
        hc.stability_test(t_max=0.1),
    ],
    ids=lambda s: s.name,
)
def test_names_of_figures_are_known(scenario):
    assert set(run_figures.figures(hc.simulate(scenario))) <= set(run_figures.FIGURES)


def test_each_experiment_has_its_own_folder_and_a_folder_holds_one_run(
    capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    for name in ("constant", "variable"):
        code, out, _ = run(capsys, "run", name, "--t-max", "0.1", "--no-plots")
        assert code == 0 and f"written to out/run/{name}\n" in out
    assert sorted(os.listdir("out/run")) == ["constant", "variable"]
    (tmp_path / "o").mkdir()
    (tmp_path / "o" / "path.png").write_text("mine")
    run(capsys, "run", "constant", "--t-max", "0.1", "--out", "o")
    assert (tmp_path / "o" / "path.png").read_text() == "mine"  # no record lay beside it
    (tmp_path / "o" / "notes.png").write_text("mine")
    run(capsys, "run", "variable", "--t-max", "0.1", "--out", "o")
    assert sorted(os.listdir("o")) == [
        "notes.png",
        "path.png",
        "record.npz",
        "scenario.toml",
        "summary.json",
        "velocity.png",
    ]
    run(capsys, "run", "stability", "--t-max", "0.1", "--no-plots", "--out", "o")
    assert sorted(os.listdir("o")) == ["notes.png", "record.npz", "scenario.toml", "summary.json"]


@pytest.mark.parametrize(
    "words,sorted_words",
    [
        ("run --out o constant --b 50", "run constant --out o --b 50"),
        ("run --gain 1 0.5 --operator constant", "run constant --gain 1 0.5 --operator"),
        ("run --force -1 -2e-1 --no-plots free", "run free --force -1 -2e-1 --no-plots"),
        ("run --out constant variable", "run variable --out constant"),
        ("view --tool-width .02 o", "view record o --tool-width 2cm"),
        ("view --web variable --port=1", "view variable --web --port=1"),
        ("view --every 3", "view constant --every 3"),
        ("view", "view constant"),
        ("run --start -5cm -.01 free", "run free --start -5cm -0.01"),
        ("video --speed -1 o", "video record o --speed=-1"),
        ("run free --operator=true --no-plots", "run free --operator --plots=no"),
        ("run free --length 1 --length 2", "run free --length 2"),
        ("video --speed 2 o/record.npz", "video record o/record.npz --speed 2"),
        ("video --out x.gif --size 320 240 o", "video record o --out x.gif --size 320 240"),
        ("video --tool_width 0.01 --smooth record o", "video record o --tool-width 0.01 --smooth"),
        ("video --growth none variable", "video variable --growth none"),
        ("stability --axis y", "stability --axis y"),
    ],
)
def test_options_may_stand_before_what_they_belong_to(words, sorted_words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "o").mkdir()
    a, b = (parser.read(x.split()) for x in (words, sorted_words))
    assert (a.path, a.origin, a.source, a.values) == (b.path, b.origin, b.source, b.values)


@pytest.mark.parametrize(
    "words, same",
    [
        ("help", "--help"),
        ("help run", "run --help"),
        ("-h", "--help"),
        ("run constant -h", "run --help constant"),
        ("--version", "version"),
    ],
)
def test_help_and_version_have_several_names(capsys, words, same):
    assert run(capsys, *words.split()) == run(capsys, *same.split())


def test_a_record_may_come_last(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(capsys, "run", "free", "--t-max", "0.1", "--no-plots", "--out", "o")
    for words in (
        ["view", "--tool-width", "0.01", "o"],
        ["video", "--speed", "2", "--out", "x.gif", "o/record.npz"],
    ):
        command = app.parse_words(words)
        assert isinstance(command.scenario, hc.Record) and command.scenario.scenario.name == "free"


def widths(text):
    return [len(line) for line in text.splitlines()]


@pytest.mark.parametrize(
    "args", [("variable",), ("constant", "--gain", "1", "1"), ("stability", "--t-max", "1")]
)
def test_the_table_fits_a_terminal_and_knows_no_negative_zero(capsys, tmp_path, args):
    out = tmp_path / "x-0"  # names of folders are no numbers, and as long as they are
    code, text, _ = run(capsys, "run", *args, "--no-plots", "--out", str(out))
    table, _, paths = text.partition("written to ")
    assert code == 0 and paths.startswith(str(out))
    assert max(widths(table.split("\n\n")[0])) <= 80
    assert not re.search(r"-0\.?0*(?![\d.])", table)


@pytest.mark.parametrize(
    "x,said", [(-1e-9, "0.00"), (-0.004, "0.00"), (-0.006, "-0.01"), (0.0, "0.00"), (-2.0, "-2.00")]
)
def test_fixed_point_has_no_negative_zero(x, said):
    assert cell_text(x, "z.2f") == said


@pytest.mark.parametrize("args", [("--every", "5000"), ("--t-max", "0.005")])
def test_a_maneuver_with_few_samples_has_a_table(capsys, tmp_path, args):
    code, out, err = run(capsys, "run", "stability", *args, "--no-plots", "--out", str(tmp_path))
    assert (code, err) == (0, "") and "status: time limit" in out


def test_advice_names_what_the_experiment_has(capsys, tmp_path):
    _, out, _ = run(capsys, "run", "stability", "--rms", "0", "--no-plots", "--out", str(tmp_path))
    assert "advice: raise rms\n" in out
    _, out, _ = run(
        capsys, "run", "free", "--force", "0", "0", "--no-plots", "--out", str(tmp_path)
    )
    assert "advice: give a force\n" in out


COLOURS = """
import os
from hapticclay.cli import app

for value in (None, "1", ""):
    os.environ.pop("NO_COLOR", None)
    if value is not None:
        os.environ["NO_COLOR"] = value
    assert app.main(["lab", "--help"]) == 0
    print("====", flush=True)
"""


def test_no_color_is_heeded(tmp_path):
    env = {k: v for k, v in os.environ.items() if k != "FORCE_COLOR"} | {"TERM": "xterm"}
    terminal, end = pty.openpty()
    with (
        open(terminal, "rb", buffering=0) as screen,
        subprocess.Popen(
            [sys.executable, "-c", COLOURS],
            cwd=tmp_path,
            env=env,
            stdout=end,
        ) as p,
    ):
        os.close(end)
        said = rest_of(screen)
    assert p.returncode == 0
    assert [b"\x1b[" in x for x in said.split(b"====")[:3]] == [True, False, True]


def test_memory_that_gives_out_is_one_line(capsys, tmp_path, monkeypatch):
    def full(*args, **kw):
        raise MemoryError("Unable to allocate 8 GiB")

    monkeypatch.setattr(simulate, "simulate", full)
    code, out, err = run(capsys, "run", "constant", "--out", str(tmp_path / "o"))
    assert (code, out, err) == (1, "", "hapticclay: out of memory: Unable to allocate 8 GiB\n")
    assert os.listdir(tmp_path) == []


HAND = ("operator=true", "operator.mass=0.5")
PARTS = ("arm.l1=30cm", "servo.x.G.damping=50", "compensator.den=1,40,0", *HAND)


def test_any_number_of_any_part_is_set_by_name(capsys, tmp_path):
    first, rest = PARTS[:2], PARTS[2:]  # one --set or several
    words = ["--set", *first, "--t-max", "0.1", "--set", *rest, "--no-plots"]
    code, _, err = run(capsys, "run", "constant", *words, "--out", str(tmp_path / "a"))
    assert (code, err) == (0, "")
    s = hc.Record.load(tmp_path / "a").scenario
    assert (s.arm, s.operator) == (hc.Arm(0.3), hc.Operator(0.5))
    assert s.servo[0].G.damping == 50.0 and s.compensator == hc.Compensator(den=(1.0, 40.0, 0.0))
    assert s.t_max == 0.1
    words = ["--set", *PARTS, "t_max=0.1"]  # before the experiment
    code, _, err = run(
        capsys, "run", *words, "constant", "--no-plots", "--out", str(tmp_path / "b")
    )
    assert (code, err) == (0, "") and hc.Record.load(tmp_path / "b").scenario == s


def test_a_small_arm_goes_its_own_way(capsys, tmp_path):
    """No part of the way is within reach of the paper's arm."""
    way = ("--origin", "0.05", "0.03", "--length", "0.02", "--clay", "0.01", "0.015")
    small = ("--set", "arm.l1=0.05", "arm.l2=0.05", "--no-plots", "--out", str(tmp_path))
    code, out, err = run(capsys, "run", "constant", *way, *small)
    assert code == 0 and "status: " in out
    assert err.count("\n") == 1 and err.startswith("hapticclay: the linear loop is unstable")


@pytest.mark.parametrize("name", ["constant", "stability"])
def test_the_scenario_beside_a_record_repeats_the_run(capsys, tmp_path, name):
    words = ["--t-max", "0.3", "--no-plots", "--set", *PARTS, "muscle.rms.x=0.5"]
    assert run(capsys, "run", name, *words, "--out", str(tmp_path / "a"))[0] == 0
    file = str(tmp_path / "a" / "scenario.toml")
    again = ["--no-plots", "--out", str(tmp_path / "b")]
    for words in ((file, *again), ("file", file, *again), (*again, file)):
        code, _, err = run(capsys, "run", *words)
        assert (code, err) == (0, "")
        a, b = (hc.Record.load(tmp_path / x) for x in "ab")
        assert a.scenario == b.scenario
        assert all(getattr(a, x).tobytes() == getattr(b, x).tobytes() for x in record.ARRAYS)


def test_a_file_names_its_folder_and_takes_changes(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.json").write_text('{"experiment": "constant", "b": 70, "t_max": 0.1}')
    code, out, err = run(capsys, "run", "mine.json", "--no-plots", "--set", "gain.x=2", "b=60")
    assert (code, err) == (0, "") and "written to out/run/mine" in out
    s = hc.Record.load("out/run/mine").scenario
    assert s.name == "mine" and s.gain == (2.0, 0.5) and s.clay.x.values == (0.0, 60.0, 0.0)
    (tmp_path / "odd.toml").write_text('name = "../../a b/.."\nt_max = 0.01')
    code, out, _ = run(capsys, "run", "odd.toml", "--no-plots")
    assert code == 0 and "written to out/run/a-b\n" in out


@pytest.mark.parametrize(
    "args,words",
    [
        (["run", "constant", "--set", "arm.l3=1"], ["arm.l3 = 1.0: no such field", "did you mean"]),
        (["run", "constant", "--set", "l1=1"], ["did you mean 'arm.l1'?"]),
        (["run", "constant", "--set", "bb=1"], ["did you mean 'b'?"]),
        (["run", "constant", "--set", "arm.l1"], ["must be name=value"]),
        (["run", "constant", "--set", "arm.l1=1", "--set", "arm.l1=2"], ["each name once"]),
        (["run", "constant", "--set", "arm.l1=3kg"], ["must be a number in m, not in kg"]),
        (["run", "constant", "--set", "arm.l1=-1"], ["arm.l1 = -1.0: must be a finite number"]),
        (["run", "constant", "--set", "arm.l1=five"], ["arm.l1 = 'five': must be a finite"]),
        (["run", "constant", "--st", "arm.l1=1"], ["--st: no option", "did you mean --set?"]),
        (["run", "--set", "arm.l1=1"], ["give an experiment"]),
        (["run", "none.toml"], ["none.toml", "No such file"]),
        (["run", "good.toml", "--b", "3"], ["--b: no option of run"]),
        (["run", "folder.toml"], ["folder.toml", "not a regular file"]),
        (["run", "bad.toml"], ["must be TOML: Invalid value (at line 1, column 5)"]),
        (["run", "typo.toml"], ["arm.l3 = 0.3: no such field", "(in typo.toml)"]),
        (["run", "good.toml", "other.toml"], ["unexpected argument 'other.toml'"]),
        (["run", "file"], ["give the path of a file"]),
        (["accuracy", "none.toml"], ["none.toml", "No such file"]),
        (["video", "none.toml"], ["none.toml", "No such file"]),
        (["view", "typo.toml"], ["arm.l3 = 0.3: no such field"]),
        (["run", "constnat"], ["(or give a scenario file, .toml or .json)"]),
        (["sweep", "--grid", "arm.l4=1:2:3"], ["arm.l4 = 1.0: no such field"]),
        (["sweep", "--grid", "b=1:2:3", "--experiment", "none.toml"], ["No such file"]),
        (["fields", "amr"], ["field = 'amr'", "did you mean 'arm'?"]),
    ],
)
def test_bad_parts_and_files_are_one_line_and_exit_2(capsys, tmp_path, monkeypatch, args, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.toml").mkdir()
    (tmp_path / "bad.toml").write_text("a = = 3")
    (tmp_path / "typo.toml").write_text("[arm]\nl3 = 0.3")
    (tmp_path / "good.toml").write_text("t_max = 0.01")
    here = sorted(os.listdir(tmp_path))
    code, out, err = run(capsys, *args)
    assert code == 2 and out == ""
    assert err.count("\n") == 1 and err.startswith("hapticclay: ")
    for word in words:
        assert word in err
    assert sorted(os.listdir(tmp_path)) == here


def test_the_names_of_all_fields_are_listed(capsys):
    code, out, err = run(capsys, "fields")
    assert (code, err) == (0, "") and max(map(len, out.splitlines())) <= 100
    assert "arm.l1 = 0.24  [m]  0.001 to 100\n    of arm: length of link 1" in out
    assert "servo.y.S.damping = 32.4  [1/s]" in out and "integrator = fast  fast | accurate" in out
    lines = out.splitlines()
    heads = [i for i, line in enumerate(lines) if line[0] != " "]
    told = [(lines[i].partition(" = ")[0], lines[i + 1].partition(":")[0]) for i in heads]
    names = {name for name, _ in told}
    # once, or once for each class that a part may have
    assert len(told) == len(set(told)) and len(names) > 60
    out = run(capsys, "fields", "arm", "constant")[1]
    assert "b = 90  [N.s/m]  0 to 1e+09" in out and "arm.I2" in out
    assert "servo.x" not in out
    for words in (["run", "--help"], ["run", "constant", "--help"]):
        assert "--set" in run(capsys, *words)[1]


NARROW = """
import os
from hapticclay.cli import app

for columns in "15":
    os.environ["COLUMNS"] = columns
    assert app.main(["run", "--help"]) == 0
"""


def test_help_ends_in_the_narrowest_terminal():
    """It was laid out for ever; the bound is many times what it takes."""
    words = [sys.executable, "-c", NARROW]
    out = subprocess.run(words, capture_output=True, text=True, timeout=PATIENCE)
    assert out.returncode == 0 and out.stdout.count("Usage") == 2


def test_a_part_of_a_command_keeps_its_defaults_beside_what_is_given():
    for words, style in (([], "screen"), (["--style", "print"], "print")):
        figures = parser.read(["reproduce", *words]).command().figures
        assert (figures.format, figures.style) == (("svg",), style)
    small = parser.read(["materials", "--tool-width", "2cm"]).command().tool
    assert (small.width, small.depth) == (0.02, 0.005)
    assert parser.read(["view", "--tool-depth", "5mm"]).command().tool == small


@pytest.mark.parametrize(
    "args, held, hand",
    [
        ((), "stable with this hand", "a hand of 0.25 kg, 2 N.s/m, 6 N/m"),
        (("--no-operator",), "stable without a hand", "no hand"),
    ],
)
def test_verdicts_say_which_loop_and_hand_they_are_of(args, held, hand, tmp_path, capsys):
    _, out, _ = run(capsys, "stability", "--axis", "y", *args, "--out", str(tmp_path))
    lines = out.splitlines()
    assert any(line.startswith(held) for line in lines)
    assert any(line.startswith("stable with every passive hand") for line in lines)
    assert f"y axis, K = 0.5 1/kg, clay of 90 N.s/m, {hand}" in lines
    assert json.loads((tmp_path / "stability.json").read_text())["assumed"]
