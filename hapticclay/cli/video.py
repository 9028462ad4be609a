"""`hapticclay video`: films of experiments and records."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from ..errors import Bound
from ..files import writable
from ..model.tool import Tool
from . import console
from .options import Prefixed, RecordWord
from .run import simulate_with_progress

Pixels = Annotated[int, Bound(1, 100_000)]


@dataclass(frozen=True)
class VideoCommand:
    """Film an experiment or a saved record: arm, clay and running plots side by side.

    Attributes:
        scenario: The experiment, a scenario file, or the folder of a record.
        out: The file: .mp4, .webp or .gif; by default out/film.mp4, or .webp where no codec for
            .mp4 is installed.
        camera: Point of view.
        speed: Playback speed: 1 is real time, 2 twice as fast.
        size: Width and height [pixels].
        plots: Show the running plots on the right, if there is room: from 320 x 100.
        smooth: Soften edges and shadows; takes twice as long without a graphics card.
        tool: The tool.
        magnify: Show the motion of an arm from a file about its median pose so many times larger.
    """

    scenario: RecordWord = "constant"
    out: Path | None = None
    camera: Literal["room", "top", "close"] = "room"
    speed: float = 1.0
    size: tuple[Pixels, Pixels] = (960, 480)
    plots: bool = True
    smooth: bool = False
    tool: Prefixed[Tool] = Tool()
    magnify: Annotated[float, Bound(1e-3, 1e9)] = 1.0

    def __call__(self) -> int:
        from ..simulation.record import Record
        from ..views import film

        record = self.scenario
        options = film.FilmOptions(
            self.camera, self.speed, self.size, self.plots, self.smooth, self.tool, self.magnify
        )
        out = self.out or film.usual_file(Path("out"))
        writable(out.parent)
        film.ready(out, options)
        if not isinstance(record, Record):
            record = simulate_with_progress(record, 1)

        def progress(images: Iterator[Any], count: int) -> Iterator[Any]:
            return iter(
                console.progress_bar(images, total=count, desc=out.name, unit="frame", delay=0.0)
            )

        made = film.film(record, out, options, progress)
        print(f"written to {made}")
        return 0
