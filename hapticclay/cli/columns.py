"""`hapticclay columns`: what a log holds, and the command to go on with."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..files import writable
from . import console
from .log_options import LogOptions
from .options import Loose


@dataclass(frozen=True)
class ColumnsCommand:
    """Show what a log of your own holds: columns, units, ranges, rate, gaps, suspicious values.

    Prints the command to go on with. Text with any separator and encoding, Parquet, MATLAB, HDF5,
    NetCDF, NumPy, Excel, MCAP and ROS bags are read.

    Attributes:
        file: The log.
        out: Folder for columns.json and columns.png; by default out/columns/NAME.
        log: Units of the columns.
        figures: Format and style of the figure.
    """

    file: Loose[Path]
    out: Path | None = None
    log: LogOptions = LogOptions()
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..studies.log_report import log_report

        out = self.out or Path("out", "columns", self.file.stem or "log")
        writable(out)
        console.deliver(log_report(self.log.log(self.file)), out, self.figures)
        return 0
