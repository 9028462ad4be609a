"""`hapticclay accuracy`: error against run time of one scenario, and the cheapest settings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..files import atomic, writable
from . import console
from .options import ScenarioWord
from .unused import Unused

if TYPE_CHECKING:
    from ..studies.accuracy_ladder import Ladder

ERROR_NAMES = {"s": "times of the border crossings", "m": "position"}
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
        try:
            self._save(found, out)
        finally:  # a full disk must not hide the results
            print(cheapest_tables(found))
        print(f"written to {out}")
        return 0

    def _save(self, found: Ladder, out: Path) -> None:
        from ..views import accuracy_plots
        from ..views.figure import Figure

        console.save_json(found.summary(), out / "accuracy.json")
        with atomic(out / "accuracy.md") as f:
            f.write((accuracy_page(found) + "\n").encode())
        figure = Figure(lambda: accuracy_plots.accuracy_plot(found), found.tables)
        console.save_figures({"accuracy": figure}, out, self.figures)


def cheapest_tables(found: Ladder, markdown: bool = False) -> str:
    """The fastest setting for each requested error, one table per unit."""
    parts = []
    for unit in found.units():
        rows = [
            [f"{asked:.0e}", x.series, f"{x.dt:.3g}", _error(found, x, unit), f"{x.wall:.2g}"]
            for asked, x in found.cheapest(unit).items()
        ]
        head = [
            f"requested error [{unit}]",
            "integrator",
            "dt [s]",
            f"error [{unit}]",
            "run time [s]",
        ]
        parts += [f"Cheapest setting by error in the {ERROR_NAMES[unit]}:"]
        parts += [console.text_table(rows, head, "rlrrr", "pipe" if markdown else "simple")]
    left = [f"{e:.1e} {unit}" for unit, e in found.left.items() if e and unit in found.units()]
    within = f", good to {' and '.join(left)}" if left else ""
    parts += [f"Errors are against the {found.reference}{within}.", *found.notes]
    return "\n\n".join(parts)


def accuracy_page(found: Ladder) -> str:
    """The ladder as a page in Markdown: the figure, the cheapest settings, all settings."""
    rows = [
        [
            x.series,
            f"{x.dt:.3g}",
            _error(found, x, "s"),
            _error(found, x, "m"),
            "-" if x.wall is None else f"{x.wall:.2g}",
            x.status,
        ]
        for x in found.settings
    ]
    head = ["method", "dt [s]", "border times [s]", "position [m]", "run time [s]", "status"]
    return "\n\n".join(
        [
            f"# Error against run time: {found.scenario.name}",
            "![error against run time](accuracy.png)",
            f"{found.simulated:.4g} s simulated, engine {found.engine}.",
            cheapest_tables(found, markdown=True),
            "All settings:",
            console.text_table(rows, head, "lrrrrl", "pipe"),
        ]
    )


def _error(found: Ladder, x: Any, unit: str) -> str:
    """An error as text; "<" where it is not clear of that of the reference."""
    from ..studies.accuracy_ladder import CLEAR

    error, left = x.error(unit), found.left[unit]
    if error is None:
        return "-"
    return f"{error:.1e}" if found.shown(x, unit) else f"< {CLEAR * (left or 0.0):.1e}"
