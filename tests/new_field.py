"""A part and an experiment of a user's own, with one new field each, wherever fields are asked.

Runs in a process of its own (`tests.test_fields`): the classes stay known to the process.
"""

import contextlib
import dataclasses
import inspect
import io
import sys
from pathlib import Path
from typing import Annotated

import pytest

import hapticclay as hc
from hapticclay.arguments import named, part
from hapticclay.cli import app
from hapticclay.fields import dotted_names, field_unit
from hapticclay.scene.changes import named_values
from hapticclay.scene.experiments import EXPERIMENTS, ConstantCut, parameter_names, parameter_unit


@part("knock.")
class Knock(hc.Constant):
    """A force with a field of its own.

    Attributes:
        softness: how far it gives way [m], 0 to 0.1.
    """

    softness: Annotated[float, hc.Bound(0.0, 0.1, "m")] = 0.02


@named
@dataclasses.dataclass(frozen=True)
class Deeper(ConstantCut):
    """The constant cut, with a parameter of its own.

    Attributes:
        depth: by which the clay begins later [m], 0 to 0.04.
    """

    depth: Annotated[float, hc.Bound(0.0, 0.04, "m")] = 0.01

    def scenario(self):
        begin, end = self.clay
        return self.build_scenario("deeper", clay=hc.slab(self.b, begin + self.depth, end))


EXPERIMENTS["deeper"] = Deeper
SCENE = dataclasses.replace(hc.constant_cut(), muscle=Knock((1.0, 0.0), softness="3 cm"))


def said(*words):
    """What a command says, and its exit status."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            status = app.main(list(words))
        except SystemExit as end:
            status = end.code
    return status or 0, " ".join(out.getvalue().split())


def refused(call):
    with pytest.raises(hc.ParameterError) as e:
        call()
    return str(e.value)


def check_a_part():
    assert SCENE.muscle.softness == 0.03
    text = refused(lambda: Knock((1.0, 0.0), softness=0.2))
    assert text == "knock.softness = 0.2: must be a finite number >= 0 and <= 0.1 m"
    assert "not in kg" in refused(lambda: Knock((1.0, 0.0), softness="1 kg"))
    assert "did you mean 'softness'" in refused(lambda: Knock((1.0, 0.0), softnes=0.1))
    assert "softness: float [m] = 0.02" in str(inspect.signature(Knock))


def check_files(folder):
    for file in (SCENE.save(folder / "a.toml"), SCENE.save(folder / "a.json")):
        assert hc.Scenario.load(file) == SCENE
    written = (folder / "a.toml").read_text()
    assert 'kind = "knock"' in written and "softness = 0.03  # m" in written
    (folder / "b.toml").write_text('experiment = "deeper"\ndepth = "2 cm"\n')
    assert hc.Scenario.load(folder / "b.toml").clay.x.edges == (0.07, 0.15)


def check_dotted_names():
    assert "muscle.softness" in dotted_names(hc.Scenario)
    assert field_unit("muscle.softness", hc.Scenario) == "m"
    assert "depth" in parameter_names(Deeper) and parameter_unit("depth") == "m"
    changes = named_values("--set", ["muscle.softness=4cm"])
    assert hc.with_fields(SCENE, changes).muscle.softness == 0.04
    text = refused(lambda: hc.with_fields(SCENE, {"muscle.softnes": 1.0}))
    assert "did you mean 'muscle.softness'" in text
    assert "did you mean 'depth'" in refused(lambda: Deeper.of({}, {"dept": 0.01}))


def check_commands():
    assert said("fields", "deeper")[1].count("depth = 0.01 [m] 0 to 0.04 by which the clay") == 1
    assert "muscle.softness = 0.02 [m] 0 to 0.1" in said("fields", "softness")[1]
    status, text = said("run", "deeper", "--help")
    assert status == 0 and "--depth" in text and "y which the clay begins later [m]" in text
    for words, told in (
        (["--depth", "5cm"], "must be a finite number >= 0 and <= 0.04 m"),
        (["--depth", "5kg"], "must be a number in m, not in kg"),
        (["--dept", "1cm"], "did you mean --depth"),
        (["--set", "muscle.kind=knock", "muscle.value=1,0", "muscle.softness=1m"], "<= 0.1 m"),
    ):
        status, text = said("run", "deeper", *words)
        assert status == 2 and told in text, text


def check_sweeps():
    depths = hc.studies.Range.parse("depth", "1cm:3cm:3", parameter_unit("depth"))
    sweep = hc.studies.Sweep("deeper", {"depth": depths})
    made = sweep.run_scenario(sweep.points(2, 3)[0])
    assert made == Deeper(depth=0.03).scenario()


if __name__ == "__main__":
    check_a_part()
    check_files(Path(sys.argv[1]))
    check_dotted_names()
    check_commands()
    check_sweeps()
