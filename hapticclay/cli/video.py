"""`hapticclay video`: films of scenarios and records."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..files import writable
from ..simulation.record import Record
from ..studies.removal import TOOL, Tool
from .run import Experiment, simulate_with_progress
from .view import Recorded

if TYPE_CHECKING:
    from ..views.film import FilmOptions


@dataclass(frozen=True)
class Video:
    """Film a record (its folder) or an experiment: arm, clay and running plots side by side."""

    scenario: Experiment | Recorded
    out: Path = Path("out/film.mp4")
    """The file: .mp4, .webp or .gif."""
    camera: Literal["room", "top", "close"] = "room"
    """Where to look from."""
    speed: float = 1.0
    """1 is real time, 2 twice as fast."""
    size: tuple[int, int] = (960, 480)
    """Width and height [pixels]."""
    plots: bool = True
    """Run the plots on the right, if there is room: from 320 x 100."""
    smooth: bool = False
    """Soften edges and shadows; takes twice as long without a graphics card."""
    tool_width: float = TOOL.width
    """Width of the tool [m]."""
    tool_depth: float = TOOL.depth
    """Depth of the cut [m]."""

    def __call__(self) -> int:
        tool = Tool(self.tool_width, self.tool_depth)
        writable(self.out.parent)
        s = self.scenario
        from ..views.film import FilmOptions

        options = FilmOptions(self.camera, self.speed, self.size, self.plots, self.smooth, tool)
        made = film_with_progress(
            lambda: s if isinstance(s, Record) else simulate_with_progress(s, 1), self.out, options
        )
        print(f"written to {made}")
        return 0


def film_with_progress(record: Callable[[], Record], out: Path, options: FilmOptions) -> Path:
    """Writes a film under a progress bar; the record is made once a film is known to be possible.

    Args:
        record: makes or returns the run.
        out: the file.
        options: of the film.

    Raises:
        ParameterError: as film.film.
    """
    from tqdm import tqdm

    from ..views import film

    def progress(images: Iterator[np.ndarray], count: int) -> Iterator[np.ndarray]:
        return iter(
            tqdm(images, total=count, desc=out.name, unit="frame", disable=None, leave=False)
        )

    film.ready(out, options)
    return film.film(record(), out, options, progress)
