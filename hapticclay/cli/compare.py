"""`hapticclay compare`: controllers or bare devices side by side on one page."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

from ..errors import ParameterError
from ..files import writable
from ..model.constants import AXES
from . import console
from .log_options import column_names
from .options import Loose
from .replay import EXAMPLE
from .unused import Unused

if TYPE_CHECKING:
    from ..studies.replay import Recording


@dataclass(frozen=True)
class CompareCommand:
    """Compare controllers, or bare devices, on one page: key numbers, figures and fields.

    Attributes:
        source: Two to five scenario files, or files of walls.
        axis: Axis of the arm, by default x.
        recording: Log of a recorded force or motion under which scenarios run, as in
            hapticclay replay; a figure shows them beside it.
        columns: Names in that file, as in t=time x=pos fx=force.
        drive: What of the recording drives the arm.
        out: Folder for compare.html (self-contained), compare.json and the figures.
        figures: Formats and style of the figure files; those on the page are for a screen.
    """

    source: Loose[tuple[Path, ...]] = ()
    axis: Literal["x", "y"] | None = None
    recording: Path | None = None
    columns: tuple[str, ...] = ()
    drive: Literal["force", "motion"] = "force"
    out: Path = Path("out/compare")
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("columns", "drive"), "is for a recording: give --recording", (), ("recording",)),
    )

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
            self._recording(),
            self.drive,
        )
        pages = {"compare.html": lambda: comparison_page(found)}
        console.deliver(found, self.out, self.figures, pages=pages)
        print(f"page: {(self.out / 'compare.html').resolve()}")
        return 0

    def _recording(self) -> Recording | None:
        if self.recording is None:
            return None
        from ..studies.replay import COLUMNS, Recording

        return Recording.load(self.recording, column_names(self.columns, COLUMNS, EXAMPLE))
