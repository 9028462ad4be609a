"""`hapticclay accuracy`: error against run time of one scenario, and the cheapest settings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

from ..display import text_table
from ..files import writable
from . import console
from .options import ScenarioWord
from .unused import Unused

if TYPE_CHECKING:
    from ..studies.accuracy_ladder import Ladder

VARIED = "is varied by this command: leave it out"


@dataclass(frozen=True)
class AccuracyCommand:
    """Draw error over run time of an experiment, and list the fastest setting for each error.

    The experiment runs at a ladder of steps, with both integrators, and under sampled control.

    Attributes:
        scenario: The experiment, or a scenario file. Its dt and integrator are ignored.
        out: Folder for accuracy.png, accuracy.md and accuracy.json; by default
            out/accuracy/EXPERIMENT.
        quick: Run fewer steps, once each.
        figures: Format and style of the figure.
    """

    scenario: ScenarioWord
    out: Path | None = None
    quick: bool = False
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("integrator",), VARIED),
        Unused(("dt",), VARIED, (), ("control=sampled",)),
        Unused(("dt",), VARIED, ("Ts",)),
    )

    def __call__(self) -> int:
        from ..studies.accuracy_ladder import accuracy_ladder

        out = self.out or console.default_folder("accuracy", self.scenario)
        writable(out)

        def bar(runs: Iterable) -> Iterable:
            return console.progress_bar(runs, desc="accuracy")

        found = accuracy_ladder(self.scenario, self.quick, bar)
        pages = {"accuracy.md": lambda: accuracy_page(found)}
        console.deliver(found, out, self.figures, pages=pages)
        return 0


def accuracy_page(found: Ladder) -> str:
    """The ladder as a page in Markdown: the figure, the cheapest settings, all settings."""
    parts = [
        f"# Error against run time: {found.scenario.name}",
        "![error against run time](accuracy.png)",
        f"{found.simulated:.4g} s simulated, engine {found.engine}.",
        found.text("pipe"),
        "All settings:",
        text_table(found.tables()["settings"], found.formats, "pipe"),
    ]
    return "\n\n".join(parts) + "\n"
