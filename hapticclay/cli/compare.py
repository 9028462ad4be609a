"""`hapticclay compare`: controllers or bare devices side by side on one page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..errors import ParameterError
from ..files import atomic, versions, writable
from ..model.constants import AXES
from . import console
from .options import Loose

COMPARE_SCHEMA = "hapticclay-compare-1"


@dataclass(frozen=True)
class CompareCommand:
    """Compare controllers, or bare devices, on one page: key numbers, figures and fields.

    Attributes:
        source: Two to five scenario files, or files of walls.
        axis: Axis of the arm, by default x.
        out: Folder for compare.html (self-contained), compare.json and the figures.
        figures: Formats and style of the figure files; those on the page are for a screen.
    """

    source: Loose[tuple[Path, ...]] = ()
    axis: Literal["x", "y"] | None = None
    out: Path = Path("out/compare")
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..paper.comparison import comparison_page, number_rows
        from ..studies.comparison import compare_files, differing_fields, is_wall_file
        from ..views.compare_plots import compare_figures

        writable(self.out)
        if self.axis and all(is_wall_file(x) for x in self.source):
            raise ParameterError("axis", self.axis, "is for the arm: leave it out with walls")
        found = compare_files(
            self.source,
            self.axis or AXES[0],
            lambda files: console.progress_bar(files, desc="files"),
        )
        rows = [[name, *cells] for name, cells in number_rows(found).items()]
        try:
            with atomic(self.out / "compare.html") as f:
                f.write(comparison_page(found).encode())
            data = {
                "schema": COMPARE_SCHEMA,
                "files": {x.name: x.numbers for x in found},
                "fields": differing_fields(found),
                "versions": versions(),
            }
            console.save_json(data, self.out / "compare.json")
            figures = {name: figure for name, (_, figure) in compare_figures(found).items()}
            console.save_figures(figures, self.out, self.figures)
        finally:  # a full disk must not hide the results
            names = [x.name for x in found]
            print(console.text_table(rows, ["", *names], "l" + "r" * len(names)))
        print(f"page: {(self.out / 'compare.html').resolve()}")
        return 0
