"""`hapticclay pair`: what the log of a measured leader and follower says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from ..errors import Bound, ParameterError
from ..files import writable
from . import console
from .identify import column_names


@dataclass(frozen=True)
class PairCommand:
    """Identify a leader and its follower from a log: gains, delays, friction, inertia, stiffness.

    The follower is then simulated behind the measured leader, and its error compared with the
    measured one.

    Attributes:
        data: Log of one axis in any format that is read, or a scope of Simulink, with time [s],
            both positions [rad], torques of both motors and the force on the follower [N.m].
        columns: Names in the file, as in leader=q1 follower=q2 leader_torque=-u1 force=f; a minus
            is for a column that holds the negative.
        band: Highest frequency of the fits of laws [Hz].
        level: Confidence level of the intervals.
        out: Folder for pair_log.json and pair_log.png; by default out/pair/NAME.
        figures: Format and style of the figure.
    """

    data: Path | None = None
    columns: tuple[str, ...] = ()
    band: Annotated[float, Bound(0.1, 1e5, "Hz")] = 80.0
    level: Annotated[float, Bound(0.5, 0.999)] = 0.95
    out: Path | None = None
    figures: console.FigureLook = console.FigureLook()

    def __call__(self) -> int:
        from ..studies.pair_identification import identify_pair
        from ..studies.pair_log import COLUMNS, PairLog

        if self.data is None:
            raise ParameterError("data", None, "must be given: the log of a leader and follower")
        example = "leader=q1 follower=q2 leader_torque=-u1"
        log = PairLog.load(self.data, column_names(self.columns, COLUMNS, example))
        out = self.out or console.default_folder("pair", log)
        writable(out)
        found = identify_pair(log, band=self.band, level=self.level)
        console.deliver(found, out, self.figures)
        return 0
