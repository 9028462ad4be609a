"""What a newcomer types wrong: one line that says what would be right."""

import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hapticclay as hc
from hapticclay.cli import app
from hapticclay.cli.commands import COMMANDS
from hapticclay.errors import MissingPackage, needing
from hapticclay.views import film

FILES = {
    "empty.toml": "",
    "wall.toml": 'schema = "hapticclay-wall-2"\nK = 800\n[device]\nmass = 0.1\n',
    "cut.toml": 'schema = "hapticclay-scenario-2"\nname = "cut"\n',
    "limits.json": '{"schema": "hapticclay-limits-1"}',
    "push.csv": "time,position,force\n" + "".join(f"{2 * k},{k},1\n" for k in range(200)),
    "turn.csv": "Time (ms);Pos (deg)\n" + "".join(f"{2 * k};{k}\n" for k in range(200)),
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with files of several kinds, and the present one."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "session").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "line, said",
    [
        ("lab", "lab needs source: one of wall, zwidth, delay, jnd, pair"),
        ("lab walls", "did you mean 'wall'?"),
        ("identify push.csv", "; give --columns t=time input=cmd output=pos"),
        (
            "identify turn.csv",
            "'Pos (deg)': is input and output, which are different columns; give",
        ),
        ("replay constant --recording push.csv", "must have a motion or a force: name its columns"),
        ("replay constant", "must be given: --recording FILE"),
        ("fit out/gone --axis x", "source = 'out/gone': must be a readable file"),
        ("stability --clay Fy", "(or numbers with their names, as Fy=5 b=30)"),
        ("info session", "must be a saved record (record.npz is not in this folder)"),
        ("device report session", "a session that a program took part in (no exchanges.csv there)"),
        ("device report gone", "must be the folder of a session"),
        ("run constant --out cut.toml", "must be a writable folder (it is a file)"),
        ("run limits.json", "must be a scenario; its schema is 'hapticclay-limits-1'"),
        ("run wall.toml", "must be a scenario; its schema is 'hapticclay-wall-2'"),
        ("zwidth cut.toml", "must be a wall; its schema is 'hapticclay-scenario-2'"),
        ("pair cut.toml", "must be a pair; its schema is 'hapticclay-scenario-2'"),
    ],
)
def test_a_mistake_is_refused_with_what_would_be_right(folder, capsys, line, said):
    assert app.main(line.split()) == 2
    err = capsys.readouterr().err
    assert said in err and err.count("\n") == 1


@pytest.mark.parametrize("command", ["view", "video"])
def test_help_says_that_the_scene_may_be_left_out(capsys, command):
    assert app.main([command, "--help"]) == 0
    out = capsys.readouterr().out
    assert f"hapticclay {command} [EXPERIMENT|FILE|RECORD]" in out
    assert "[default: constant]" in out.replace("│", "") and "[required]" not in out


def test_an_entry_of_a_field_shows_the_field(capsys):
    """As --set and sweeps name it."""
    assert app.main(["fields", "gain.x", "clay.x.values.1"]) == 0
    out = capsys.readouterr().out
    assert "\nclay.x.values = " in out and out.startswith("gain = 1,0.5")
    assert app.main(["fields", "gain.z"]) == 2


@pytest.mark.parametrize("words", ["", "--help"])
def test_each_command_is_listed_once(words, capsys, monkeypatch):
    """Alone, `hapticclay` says what most people need, and names the rest."""
    monkeypatch.setenv("COLUMNS", "200")  # a line each
    assert app.main(words.split()) == 0
    out, err = capsys.readouterr()
    lines = [line for line in out.splitlines() if ":" not in line[:12]]
    listed = [line.split()[0] for line in lines if line.startswith("  ")]
    named = [x for line in lines for x in line.partition(": ")[2].split(", ") if x in COMMANDS]
    names = listed if words else listed + [x for x in named if x not in listed]
    assert sorted(names) == sorted(COMMANDS) and not err


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_help_page_in_a_closed_pipe_ends_like_other_output(unbuffered):
    """As of `hapticclay run --help | head`; Python writes when it must, or at once."""
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "w") as closed:
        done = subprocess.run(
            [sys.executable, "-m", "hapticclay", "run", "--help"],
            stdout=closed,
            stderr=subprocess.PIPE,
            env=dict(os.environ, PYTHONUNBUFFERED=unbuffered),
        )
    assert (done.returncode, done.stderr) == (141, b"")


def test_an_angle_has_a_sign_of_degrees():
    arm = hc.MjcfArm("planar_2r", pose=("30°", "-40 °"))
    assert list(arm.pose.values()) == pytest.approx([0.5235987756, -0.6981317008])


def test_a_missing_package_is_named_with_what_installs_it():
    with pytest.raises(hc.ParameterError) as error, needing("a page", "no_such_package", "web"):
        import no_such_package  # noqa: F401
    said = "a page needs no_such_package, which must be installed: pip install 'hapticclay[web]'"
    assert str(error.value) == said and isinstance(error.value, MissingPackage)
    assert str(pickle.loads(pickle.dumps(error.value))) == said


def test_a_film_without_a_name_is_of_a_kind_that_can_be_written(monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(film.importlib.util, "find_spec", lambda name: None)
    assert film.usual_file(Path("out")) == Path("out/film.webp")
    film.ready(film.usual_file(Path("out")))


def test_a_scenario_of_an_arm_runs_from_any_folder(tmp_path, monkeypatch):
    """The path of the arm, relative to the present folder, is written relative to the file."""
    arms = Path(hc.__file__).parents[1] / "mjcf" / "arms"
    (tmp_path / "arms").mkdir()
    (tmp_path / "arms" / "mine.xml").write_text((arms / "planar_2r.xml").read_text())
    monkeypatch.chdir(tmp_path)
    law = hc.JointPD((1.0, 1.0), (0.1, 0.1))
    scenario = hc.Scenario(arm=hc.MjcfArm("arms/mine.xml"), controller=law, Ts=1e-3)
    file = scenario.save("out/run/mine.toml")
    assert hc.Scenario.load(file).arm.file == "arms/mine.xml"
    monkeypatch.chdir("out")
    assert hc.Scenario.load("run/mine.toml").arm.names == ("shoulder", "elbow")
    monkeypatch.chdir("/")
    assert hc.Scenario.load(tmp_path / file).arm.names == ("shoulder", "elbow")


def test_a_session_without_a_program_says_that_there_is_no_report(tmp_path):
    words = ["device", "serve", "--port", "0", "--duration", "0.3", "--no-plots"]
    done = subprocess.run(
        [sys.executable, "-m", "hapticclay", *words, "--out", str(tmp_path / "o")],
        capture_output=True,
        text=True,
        env=dict(os.environ, OPENBLAS_NUM_THREADS="1"),
    )
    assert done.returncode == 0 and "no program connected" in done.stdout
    assert "energy" not in done.stdout  # of an arm at rest


@pytest.fixture
def clone(tmp_path):
    """The folder of a clone after `pip install .` elsewhere; runs code there: lines of stderr."""
    root = Path(hc.__file__).parents[1]
    for place in ("clone", "site"):
        (tmp_path / place).mkdir()
        shutil.copytree(
            root / "hapticclay",
            tmp_path / place / "hapticclay",
            ignore=shutil.ignore_patterns("native", "__pycache__"),
        )
        (tmp_path / place / "mjcf").symlink_to(root / "mjcf")
    (tmp_path / "clone" / "setup.py").touch()
    info = tmp_path / "site" / "hapticclay-9.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hapticclay\nVersion: 9\n")

    def said(code):
        done = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            cwd=tmp_path / "clone",
            env=dict(os.environ, PYTHONPATH=str(tmp_path / "site")),
        )
        assert done.returncode == 0, done
        return done.stderr.splitlines()

    return said


RUN = "import hapticclay as hc; hc.simulate(hc.free(t_max=0.01)); hc.simulate(hc.free(t_max=0.01))"


@pytest.mark.parametrize("code", ["import hapticclay", RUN])
def test_a_program_in_a_clone_that_was_not_built_is_told_so_once(clone, code):
    """It takes the sources there, and not what is installed."""
    (line,) = clone(code)
    assert "no compiled kernel (not built); these are the sources: run outside" in line
    assert "pip install -e" in line


def test_a_program_in_a_clone_whose_sources_have_changed_is_told_so_once(clone, tmp_path):
    native = tmp_path / "clone/hapticclay/native"
    native.mkdir()
    (native / "__init__.py").touch()
    (native / "built.py").write_text("LACKED = ''\nSOURCES = {'kernel/path.py': 1}\nMODULES = {}\n")
    (line,) = clone(RUN)
    assert "built from other sources" in line and "pip install -e" in line
    (native / "built.py").write_text("LACKED = 'HAPTICCLAY_NATIVE=no'\n")
    assert clone(RUN) == []  # as asked for, and the run is short
