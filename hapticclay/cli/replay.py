"""`hapticclay replay`: a recorded force or motion drives the simulated arm."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..errors import ParameterError
from ..files import writable
from . import console
from .log_options import LogOptions, column_names
from .options import ScenarioWord

EXAMPLE = "t=time x=pos fx=force"


@dataclass(frozen=True)
class ReplayCommand:
    """Run a scene under a recorded force or motion of the hand, and lay the recording beside it.

    --recording is needed.

    Attributes:
        scenario: The experiment, or a scenario file; its hand, start and duration are those of the
            recording.
        recording: Log of time [s], positions x and y [m], and force of the hand on the handle,
            fx and fy [N], as far as there are any; units may stand in the heads, as x [mm].
        columns: Names in the file, as in t=time x=pos fx=force.
        drive: What drives the arm.
        out: Folder for replay.json and replay.png; by default out/replay/NAME.
        log: Units of the columns.
        figures: Format and style of the figure.
    """

    scenario: ScenarioWord
    recording: Path | None = None
    columns: tuple[str, ...] = ()
    drive: Literal["force", "motion"] = "force"
    out: Path | None = None
    log: LogOptions = LogOptions()
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..studies.replay import COLUMNS, recorded, replay

        if self.recording is None:
            bound = "must be given: --recording FILE, the log of a force or motion"
            raise ParameterError("recording", None, bound)
        columns = column_names(self.columns, COLUMNS, EXAMPLE)
        recording = recorded(self.log.log(self.recording, "recording"), columns)
        out = self.out or console.default_folder("replay", recording)
        writable(out)
        found = replay(self.scenario, recording, self.drive)
        console.deliver(found, out, self.figures)
        return 0
