"""`hapticclay fit`: fits the law of clay to measured columns or a record."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from ..errors import Bound, ParameterError
from ..files import writable
from . import console
from .identify import column_names
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
        source: CSV file of time [s], position [m] and force of the clay on the tool, counted as
            resistance [N]; or the folder of a record, or its record.npz.
        out: Folder for fit.json and fit.png.
        axis: Axis of a record; "path" is along the motion, whatever its direction.
        columns: Names in the file, as in t=time p=pos f=force.
        laws: Candidate laws: viscous, Coulomb, Bingham, power-law, Herschel-Bulkley; by default
            all.
        level: Confidence level of the intervals.
        time: First and last time to use [s].
        place: Lowest and highest position to use [m].
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
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        from ..studies.fitting import fit_flow
        from ..studies.flow_models import FLOW_LAWS

        writable(self.out)
        recorded = os.path.isdir(self.source) or self.source.suffix == ".npz"
        if self.source.suffix == ".toml":
            bound = "must be a CSV file or a record, not a scenario: run it first"
            raise ParameterError("source", str(self.source), bound)
        if recorded and self.columns:
            raise ParameterError("columns", self.columns, "is for a CSV file: leave it out")
        if self.axis and not recorded:
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

    def _measured(self) -> Measurement:
        from ..studies.measurement import Measurement

        given = column_names(self.columns, FIT_COLUMNS, COLUMNS_EXAMPLE)
        names = {x: x for x in FIT_COLUMNS} | given
        try:
            return Measurement.load(self.source, {FIT_COLUMNS[k]: x for k, x in names.items()})
        except ParameterError as error:  # in the words of this command
            field, bound = error.field, error.bound
            for name, theirs in FIT_COLUMNS.items():
                if field == f"columns.{theirs}":
                    field = f"columns.{name}"
                    if name not in given:
                        bound += f"; give --columns {COLUMNS_EXAMPLE}"
            raise ParameterError(field, error.value, bound) from None
