"""`hapticclay lab`: the runs of a lab of a course, its table, figures and questions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from ..files import versions, writable
from . import console
from .options import Loose

if TYPE_CHECKING:
    from ..studies.labs import Lab

LAB_SCHEMA = "hapticclay-lab-1"


@dataclass(frozen=True)
class LabCommand:
    """Do a lab of a course: wall, zwidth, delay or jnd.

    Attributes:
        source: The lab: a wall and its rate, Z-width, delay and passivity, or a just-noticeable
            difference.
        out: Folder for lab.json and the figures; by default out/lab/NAME.
        quick: Make fewer runs.
        view: At the end, show a run of the lab in a window.
        figures: Formats and style of the figures.
    """

    source: Loose[str]
    out: Path | None = None
    quick: bool = False
    view: bool = False
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..errors import choice
        from ..studies.labs import LABS, lab

        name = choice("lab", self.source, tuple(LABS))
        out = self.out or Path("out/lab") / name
        writable(out)
        with console.progress_bar(total=0, bar_format="{elapsed} {desc}") as bar:
            found = lab(name, self.quick, bar.set_description_str)
        try:
            self._save(found, out)
        finally:  # a full disk must not hide the results
            print(lab_text(found))
        print(f"written to {out}")
        if self.view:
            from ..simulation.simulate import simulate
            from ..studies.removal import TOOL
            from .view import replay

            replay(simulate(found.scene), TOOL)
        return 0

    def _save(self, found: Lab, out: Path) -> None:
        from ..views.chart_plots import chart_plot
        from ..views.figure import Figure

        tables = {
            name: {column: list(values) for column, values in table.items()}
            for name, table in found.tables().items()
        }
        data = {"schema": LAB_SCHEMA, "lab": found.name, "questions": found.questions}
        data |= {"tables": tables, "versions": versions()}
        console.save_json(data, out / "lab.json")
        figures = {c.name: Figure(partial(chart_plot, c), c.tables) for c in found.charts}
        console.save_figures(figures, out, self.figures)


def lab_text(found: Lab) -> str:
    """Task, table and questions of a lab, for a terminal."""
    columns = list(found.columns.values())
    cells = [[x if isinstance(x, str) else f"{x:.5g}" for x in column] for column in columns]
    align = "".join("l" if isinstance(column[0], str) else "r" for column in columns)
    table = console.text_table(list(zip(*cells, strict=True)), list(found.columns), align)
    asked = "\n".join(f"{i}. {q}" for i, q in enumerate(found.questions, 1))
    return f"{found.title}. {found.task}\n\n{table}\n\n{found.found}\n\n{asked}"
