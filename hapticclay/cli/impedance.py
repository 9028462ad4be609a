"""`hapticclay impedance`: the impedance a hand feels, measured by a run beside the computed one."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from ..errors import Bound, ParameterError, choice
from ..files import writable
from ..model.constants import AXES
from . import console, walls
from .options import Loose

if TYPE_CHECKING:
    from ..studies.impedance import Subject


@dataclass(frozen=True)
class ImpedanceCommand:
    """Measure impedance and transparency at the hand, and compare them with the computed ones.

    A multisine muscle force excites the arm of an experiment, or a virtual wall on a bare device,
    with an amplitude so small that it stays linear. The command is drawn as a thin line. An option
    of a wall, such as --K 300 or --mass 0.2, selects a wall.

    Attributes:
        source: File of a wall; or experiment, as in hapticclay run, or a scenario file. The clay of
            a scenario is then everywhere around the handle, which is at the nominal pose. By
            default the constant cut.
        axis: Axis of the arm, by default x.
        b: Damping of the clay [N.s/m]; by default the clay of the experiment with the smallest gain
            limit.
        k: Stiffness of the clay [N/m].
        band: Lowest and highest frequency [Hz].
        lines: Number of frequencies.
        amplitude: Amplitude of the motion, rms [m].
        seed: Seed of the multisine's phases.
        out: Folder for impedance.json, impedance.png and transparency.png.
        wall: The wall, its device, sampling and hand; --hand also applies to the arm.
        figures: Format and style of the figures.
    """

    source: Loose[str | None] = None
    axis: Literal["x", "y"] | None = None
    b: Annotated[float | None, Bound(unit="N.s/m")] = None
    k: Annotated[float | None, Bound(unit="N/m")] = None
    band: Annotated[tuple[float, float], Bound(unit="Hz", names=("low", "high"))] = (0.5, 30.0)
    lines: int = 24
    amplitude: Annotated[float, Bound(unit="m")] = 1e-5
    seed: int = 0
    out: Path = Path("out/impedance")
    wall: walls.WallOptions = walls.WallOptions()
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..studies.impedance import measure_impedance

        writable(self.out)
        subject = self._subject()
        found = measure_impedance(
            subject, band=self.band, lines=self.lines, amplitude=self.amplitude, seed=self.seed
        )
        console.deliver(found, self.out, self.figures)
        return 0

    def _subject(self) -> Subject:
        from ..scene.files import is_scenario_file
        from ..studies.comparison import is_wall_file

        file = self.source if self.source and is_scenario_file(self.source) else None
        if file and is_wall_file(file):
            return self._wall(file)
        of_wall = {name: x for name, x in self.wall.given.items() if name != "hand"}
        if self.source is None and of_wall:
            return self._wall(None)
        for name, value in of_wall.items():
            bound = "is for a wall: leave it out beside an experiment or scenario"
            raise ParameterError(name, value, bound)
        return self._loop(file)

    def _wall(self, file: str | None) -> Subject:
        for name in ("axis", "b", "k"):
            if (value := getattr(self, name)) is not None:
                raise ParameterError(name, value, "is for the arm: leave it out with a wall")
        return self.wall.wall(file)

    def _loop(self, file: str | None) -> Subject:
        from ..scene.experiments import EXPERIMENTS, SCENARIOS
        from ..scene.scenario import Scenario
        from ..studies.boundary import PushedLoop

        name = self.source or "constant"
        if file:
            scenario = Scenario.load(file)
        elif os.path.exists(name) or os.sep in name:
            bound = "must be a file of a wall or a scenario, .toml or .json, or an experiment"
            raise ParameterError("file", name, bound)
        else:
            scenario = SCENARIOS[choice("experiment", name, tuple(EXPERIMENTS))]()
        loop = PushedLoop.of(scenario, self.axis or AXES[0], self.b)
        if self.k is not None:
            loop = replace(loop, k=self.k)
        hand = walls.operator_of(self.wall.hand)
        return replace(loop, operator=hand) if hand else loop
