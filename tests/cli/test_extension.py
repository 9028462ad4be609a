"""The cost of extensions: a class and a line an experiment, a module a command, three a study."""

import dataclasses
import importlib
import os
import re
import subprocess
import sys
from typing import Annotated

import pytest

import hapticclay as hc
from hapticclay.cli import app, commands, parser
from hapticclay.errors import Bound, ParameterError
from hapticclay.scene.experiments import (
    EXPERIMENTS,
    Damping,
    Gains,
    PathExperiment,
    parameter_unit,
)
from hapticclay.studies.sampling import parse_grid
from hapticclay.studies.store import read_sweep
from hapticclay.studies.sweep import Sweep
from hapticclay.views import sweep_plots
from tests.waiting import PATIENCE


@dataclasses.dataclass(frozen=True)
class Staircase(PathExperiment):
    """A cut through clay whose damping rises in steps.

    Attributes:
        b: damping of the first step [N.s/m], 0 to 1e9.
        steps: number of steps, 1 to 20.
        gain: K of the compensator on each axis [1/kg], > 0.
        depth: length of a step along x [m], 1e-3 to 0.1.
    """

    b: Damping = 20.0
    steps: Annotated[int, Bound(1, 20)] = 3
    gain: Gains = (1.0, 0.5)
    depth: Annotated[float, Bound(1e-3, 0.1, "m")] = 0.01

    def scenario(self):
        edges = tuple(self.depth * i for i in range(1, self.steps + 1))
        profile = hc.Profile(edges, (0.0, *(self.b * i for i in range(1, self.steps + 1))))
        return self.build_scenario("staircase", clay=hc.Clay(profile, profile), force=(1.0, 0.0))


COMMAND = '''
"""`hapticclay greet`: says hello."""

from dataclasses import dataclass


@dataclass(frozen=True)
class GreetCommand:
    """Say hello.

    Attributes:
        name: Person to greet.
        times: Number of greetings.
    """

    name: str = "you"
    times: int = 1

    def __call__(self) -> int:
        print("\\n".join([f"hello {self.name}"] * self.times))
        return 0
'''


STUDY = {  # a question, its figure and its command, a module each
    "reach_study": '''
"""How far the handle comes under a push."""

from dataclasses import dataclass

import numpy as np

import hapticclay as hc


@dataclass(frozen=True, eq=False, repr=False)
class Reach(hc.Result):
    """How far the handle came in a time.

    Attributes:
        force: pushes [N].
        reach: places at the end [m].
    """

    drawn_by = "reach_plots:reach_plot"

    force: tuple[float, ...]
    reach: tuple[float, ...]

    def headline(self):
        return f"up to {max(self.reach):.3g} m"

    def tables(self):
        return {"reach": {"force [N]": self.force, "reach [m]": np.array(self.reach)}}


def reach(forces):
    runs = [hc.simulate(hc.constant_cut(force=(f, 0.0), t_max=0.2)) for f in forces]
    return Reach(tuple(forces), tuple(float(r.p[-1, 0]) for r in runs))
''',
    "reach_plots": '''
"""The figure of a reach."""

from matplotlib.figure import Figure


def reach_plot(found):
    figure = Figure()
    ax = figure.subplots()
    ax.plot(found.force, found.reach)
    ax.set(xlabel="force [N]", ylabel="reach [m]")
    return figure
''',
    "reach_command": '''
"""`hapticclay reach`: how far the handle comes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from hapticclay.cli import console
from hapticclay.errors import Bound


@dataclass(frozen=True)
class ReachCommand:
    """Find how far the handle comes under some pushes.

    Attributes:
        force: Pushes along x [N].
        out: Folder for reach.json and the figure.
        figures: Format and style of the figure.
    """

    force: Annotated[tuple[float, ...], Bound(unit="N")] = (1.0, 2.0)
    out: Path = Path("out/reach")
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from reach_study import reach

        console.deliver(reach(self.force), self.out, self.figures)
        return 0
''',
}


@pytest.fixture
def reach(monkeypatch, tmp_path):
    for name, text in STUDY.items():
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(commands.COMMANDS, "reach", "reach_command")


@pytest.fixture
def staircase(monkeypatch):
    monkeypatch.setitem(EXPERIMENTS, "staircase", Staircase)


@pytest.fixture
def greet(monkeypatch, tmp_path):
    (tmp_path / "greet_command.py").write_text(COMMAND)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(commands.COMMANDS, "greet", "greet_command")


def said(capsys, *args):
    code = app.main(args)
    out = capsys.readouterr()
    return code, out.out, out.err


def test_a_new_experiment_runs_and_is_drawn(capsys, tmp_path, staircase):
    words = ["--steps", "4", "--b", "30", "--operator", "--t-max", "3", "--out", str(tmp_path)]
    code, out, err = said(capsys, "run", "staircase", *words)
    assert (code, err) == (0, "") and "border x = 1 cm crossed" in out
    assert sorted(os.listdir(tmp_path)) == [
        "force.png",
        "record.npz",
        "scenario.toml",
        "summary.json",
        "velocity.png",
    ]
    s = hc.Record.load(tmp_path).scenario
    assert s.clay.x.values == (0.0, 30.0, 60.0, 90.0, 120.0) and s.operator == hc.Operator()
    assert s == Staircase(30.0, 4, operator=hc.Operator(), t_max=3.0).scenario()


def test_a_new_experiment_has_help_and_messages(capsys, staircase):
    code, out, _ = said(capsys, "run", "staircase", "--help")
    flat = " ".join(out.replace("│", " ").split())
    assert code == 0 and "Length of a step along x [m], 1e-3 to 0.1. [default: 0.01]" in flat
    assert "staircase" in said(capsys, "run", "--help")[1]
    for words, told in (
        (["run", "stairs"], "did you mean 'staircase'?"),
        (["run", "staircase", "--stps", "2"], "did you mean --steps?"),
        (["run", "staircase", "--steps", "x"], "--steps = 'x': must be a whole number"),
        (["run", "staircase", "--steps", "21"], "steps = 21: must be a whole number from 1 to 20"),
        (["run", "staircase", "--depth", "1"], "must be a finite number >= 0.001 and <= 0.1 m"),
    ):
        code, out, err = said(capsys, *words)
        assert (code, out, err.count("\n")) == (2, "", 1) and told in err
    assert parser.read(["video", "--steps", "2", "staircase"]).source == "staircase"


def test_a_new_experiment_is_swept_and_mapped(capsys, tmp_path, staircase):
    words = [
        "sweep",
        "--experiment",
        "staircase",
        "--grid",
        "depth=0.01,0.02 steps=1,2 gain.x=1,2",
        "--fixed",
        "t_max=0.5 operator=true",
        "--workers",
        "1",
        "--out",
    ]
    code, out, _ = said(capsys, *words, str(tmp_path))
    assert code == 0 and "8 runs in" in out and (tmp_path / "status.png").is_file()
    assert read_sweep(tmp_path)["steps"].to_pylist() == [1, 1, 2, 2] * 2
    assert parameter_unit("depth") == "m" and sweep_plots._column_label("depth") == "depth [m]"
    with pytest.raises(ParameterError, match="did you mean 'depth'"):
        Sweep("staircase", parse_grid("deph=0.01:0.02:2"))


def test_a_new_command_runs_and_has_help_and_messages(capsys, greet):
    assert said(capsys, "greet", "--name", "Ada", "--times", "2") == (0, "hello Ada\n" * 2, "")
    assert re.search(r"greet +Say hello\.", said(capsys, "--help")[1])
    assert "Number of greetings. [default: 1]" in said(capsys, "greet", "--help")[1]
    for words, told in (
        (["gret"], "did you mean 'greet'?"),
        (["greet", "--nme", "x"], "--nme: no option of greet; did you mean --name?"),
        (["greet", "--times", "x"], "--times = 'x': must be a whole number"),
    ):
        code, out, err = said(capsys, *words)
        assert (code, out, err.count("\n")) == (2, "", 1) and told in err


def test_a_new_study_has_a_command_a_figure_its_numbers_and_a_result(capsys, tmp_path, reach):
    out = tmp_path / "o"
    words = ["reach", "--force", "1N", "0.002kN", "--data", "--format", "svg", "--out", str(out)]
    code, told, err = said(capsys, *words)
    assert (code, err) == (0, "") and "\nup to " in told
    assert {p.name for p in out.iterdir()} == {"reach.json", "reach.svg", "reach.csv"}
    head, first, *_ = (out / "reach.csv").read_text().splitlines()
    assert head == "force [N],reach [m]" and first.startswith("1.0,")
    found = importlib.import_module("reach_study").reach([2.0])
    assert repr(found) == "<Reach: up to 0.0178 m>" and "reach [m]" in found._repr_html_()
    assert list(found.to_frame().columns) == ["force [N]", "reach [m]"]
    assert found.plot().axes[0].get_xlabel() == "force [N]"
    assert "reach" in said(capsys, "--help")[1]
    assert "Pushes along x [N]. [default: 1.0 2.0]" in said(capsys, "reach", "--help")[1]
    code, told, err = said(capsys, "reach", "--forse", "1")
    assert (code, told) == (2, "") and "did you mean --force?" in err


def test_every_module_of_the_command_line_is_a_command_or_of_the_parser():
    for name in commands.COMMANDS:
        kind = commands.load_command(name)
        assert dataclasses.is_dataclass(kind) and callable(kind) and kind.__doc__


@pytest.mark.parametrize(
    "words,heavy",
    [
        (["version"], ("numpy", "scipy", "mujoco", "matplotlib", "tqdm", "tabulate")),
        (["--help"], ("numpy", "scipy", "mujoco", "matplotlib", "tqdm", "tabulate")),
        (["run", "constant", "--help"], ("mujoco", "scipy", "matplotlib", "tqdm", "tabulate")),
        (["sweep", "--help"], ("numpy", "mujoco", "scipy", "matplotlib", "pyarrow")),
    ],
)
def test_a_command_imports_what_it_needs(words, heavy):
    code = (
        "import sys; from hapticclay.cli import app; code = app.main(sys.argv[1:]);"
        f"print([m for m in {heavy!r} if m in sys.modules], file=sys.stderr)"
    )
    out = subprocess.run(
        [sys.executable, "-c", code, *words], capture_output=True, text=True, timeout=PATIENCE
    )
    assert out.stderr == "[]\n"
