"""`hapticclay fit`: fits the law of clay to measured columns or a record."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from ..errors import Bound, ParameterError
from ..files import writable
from . import console
from .log_options import NAMES as LOG_NAMES
from .log_options import LogOptions, column_names, found_line
from .options import Loose

if TYPE_CHECKING:
    from ..studies.measurement import Measurement

COLUMNS_EXAMPLE = "t=time p=pos f=force"
FIT_COLUMNS = {
    "t": "t",
    "p": "output",
    "f": "input",
}  # columns of a file, as a Measurement names them


@dataclass(frozen=True)
class FitCommand:
    """Fit the law by which clay resists, f = (Fy + K |v|^n) v/|v| + b v, and choose its terms.

    Attributes:
        source: Log of time, position and force of the clay on the tool, counted as resistance:
            text, Parquet, MATLAB, HDF5 and others; or the folder of a record, or its record.npz.
        out: Folder for fit.json and fit.png.
        axis: Axis of a record; "path" is along the motion, whatever its direction.
        columns: Names in the file, as in t=time p=pos f=force; those that are not given are looked
            for.
        laws: Candidate laws: viscous, Coulomb, Bingham, power-law, Herschel-Bulkley; by default
            all.
        level: Confidence level of the intervals.
        time: First and last time to use [s].
        place: Lowest and highest position to use [m].
        log: Units of the columns.
        figures: Format and style of the figure.
    """

    source: Loose[Path]
    out: Path = Path("out/fit")
    axis: Literal["x", "y", "path"] | None = None
    columns: tuple[str, ...] = ()
    laws: tuple[str, ...] = ()
    level: float = 0.95
    time: Annotated[tuple[float, float] | None, Bound(unit="s", names=("first", "last"))] = None
    place: Annotated[tuple[float, float] | None, Bound(unit="m", names=("low", "high"))] = None
    log: LogOptions = LogOptions()
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..studies.fitting import fit_flow
        from ..studies.flow_models import FLOW_LAWS

        writable(self.out)
        recorded = self._recorded
        if self.source.suffix == ".toml":
            bound = "must be a log or a record, not a scenario: run it first"
            raise ParameterError("source", str(self.source), bound)
        for name in ("columns", *LOG_NAMES):
            words = self.columns if name == "columns" else getattr(self.log, name)
            if recorded and words:
                raise ParameterError(name, words, "is for a log: leave it out")
        if self.axis and not recorded and os.path.exists(self.source):
            raise ParameterError("axis", self.axis, "is for a record: leave it out")
        fitted = fit_flow(
            self.source if recorded else self._measured(),
            self.axis,
            self.laws or tuple(FLOW_LAWS),
            self.level,
            time=self.time,
            place=self.place,
        )
        console.deliver(fitted, self.out, self.figures)
        return 0

    @property
    def _recorded(self) -> bool:
        """Whether the source is a record of this package."""
        return os.path.isdir(self.source) or self.source.suffix == ".npz"

    def _measured(self) -> Measurement:
        from ..studies.measurement import measured, named_columns

        given = column_names(self.columns, FIT_COLUMNS, COLUMNS_EXAMPLE)
        log, names = (
            self.log.log(self.source, "source"),
            {FIT_COLUMNS[k]: x for k, x in given.items()},
        )
        own = {theirs: name for name, theirs in FIT_COLUMNS.items()}
        try:
            names = named_columns(log, names, input="force")
        except ParameterError as error:  # in the words of this command
            key = error.field.removeprefix("columns.")
            if key not in own:
                raise
            hint = "" if own[key] in given else f"; give --columns {COLUMNS_EXAMPLE}"
            value = own[key] if error.value == key else error.value
            raise ParameterError(f"columns.{own[key]}", value, error.bound + hint) from None
        if line := found_line(given, {own[key]: name for key, name in names.items()}):
            print(line)
        return measured(log, names, "linear")
