"""`hapticclay lab`: the runs of a lab of a course, its table, figures and questions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..files import writable
from . import console
from .options import Loose

if TYPE_CHECKING:
    from ..scene.pair import Pair
    from ..scene.scenario import Scenario


@dataclass(frozen=True)
class LabCommand:
    """Do a lab of a course: wall, zwidth, delay, jnd or pair.

    Attributes:
        source: The lab: a wall and its rate, Z-width, delay and passivity, a just-noticeable
            difference, or leader and follower.
        out: Folder for lab.json and the figures; by default out/lab/NAME.
        quick: Make fewer runs.
        view: At the end, show a run of the lab in a window, the pair in a browser.
        figures: Formats and style of the figures.
    """

    source: Loose[Literal["wall", "zwidth", "delay", "jnd", "pair"]]
    out: Path | None = None
    quick: bool = False
    view: bool = False
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..studies.labs import lab

        name = self.source
        out = self.out or Path("out/lab") / name
        writable(out)
        with console.progress_bar(total=0, bar_format="{elapsed} {desc}") as bar:
            found = lab(name, self.quick, bar.set_description_str)
        console.deliver(found, out, self.figures)
        if self.view:
            _show(found.scene)
        return 0


def _show(scene: Scenario | Pair) -> None:
    from ..scene.pair import Pair
    from . import view

    if isinstance(scene, Pair):
        view.show_pair(scene)
        return
    from ..simulation.simulate import simulate
    from ..studies.removal import TOOL

    view.replay(simulate(scene), TOOL)
