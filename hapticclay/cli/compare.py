"""`hapticclay compare`: controllers or bare devices side by side on one page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..errors import ParameterError
from ..files import writable
from ..model.constants import AXES
from . import console
from .options import Loose


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
        from ..paper.comparison import comparison_page
        from ..studies.comparison import compare_files, is_wall_file

        writable(self.out)
        if self.axis and all(is_wall_file(x) for x in self.source):
            raise ParameterError("axis", self.axis, "is for the arm: leave it out with walls")
        found = compare_files(
            self.source,
            self.axis or AXES[0],
            lambda files: console.progress_bar(files, desc="files"),
        )
        pages = {"compare.html": lambda: comparison_page(found)}
        console.deliver(found, self.out, self.figures, pages=pages)
        print(f"page: {(self.out / 'compare.html').resolve()}")
        return 0
