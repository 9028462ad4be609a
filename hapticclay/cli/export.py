"""`hapticclay export`: a record as a file that other programs open."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ..errors import ParameterError
from .options import Loose


@dataclass(frozen=True)
class ExportCommand:
    """Write a saved record for other programs: netCDF, Parquet, CSV, MCAP, Rerun or MATLAB.

    Attributes:
        record: The record: its folder, or its record.npz.
        format: nc for xarray and MATLAB, parquet for data frames, csv for spreadsheets, mcap for
            Foxglove, rrd for Rerun, mat for MATLAB and Octave. By default the ending of --out
            decides.
        out: The file, by default record.FORMAT beside the record; an older one is replaced.
    """

    record: Loose[Path]
    format: Literal["nc", "parquet", "csv", "mcap", "rrd", "mat"] | None = None
    out: Path | None = None

    def __call__(self) -> int:
        from ..simulation.record import Record

        if self.format is None and (self.out is None or not self.out.suffix):
            bound = "must be given, as in --format csv or --out cut.csv"
            raise ParameterError("format", "", bound)
        record = Record.load(self.record)
        folder = self.record if os.path.isdir(self.record) else self.record.parent
        out = self.out or folder / f"record.{self.format}"
        print(f"written to {record.export(out, self.format)}")
        return 0
