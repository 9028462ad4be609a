"""`hapticclay fit`: fits the law of clay to measured columns or a record."""

from __future__ import annotations

import math
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
    from ..studies.fitting import Fitted
    from ..studies.measurement import Measurement

COLUMNS_EXAMPLE = "t=time p=pos f=force"
FIT_COLUMNS = {"t": "t", "p": "output", "f": "input"}  # of a file; their names in a Measurement


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
        from ..views.figure import Figure
        from ..views.fit_plots import fit_plot

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
        try:
            console.save_json(fitted.summary(), self.out / "fit.json")
            tables = fitted.tables()
            shown = {name: tables[name] for name in ("samples", "parameters")}  # fit.csv: samples
            figure = Figure(lambda: fit_plot(fitted), shown)
            console.save_figures({"fit": figure}, self.out, self.figures)
        finally:  # a full disk must not hide the result
            print(law_table(fitted))
        print(f"written to {self.out}")
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


def law_table(fitted: Fitted) -> str:
    """The candidates, the chosen one's parameters with intervals, and warnings, for a terminal."""
    rows = []
    for c in sorted(fitted.candidates, key=lambda c: (c.law != fitted.law, c.aicc)):
        of = fitted.parameters if c.law == fitted.law else c.parameters
        for i, p in enumerate(of):
            name = f"{p.name} [{p.unit}]" if p.unit else p.name
            span = "" if math.isnan(p.low) else f"{p.low:.6g} to {p.high:.6g}"
            first = [c.law, f"{c.aicc:.1f}", f"{c.weight:.3f}", f"{c.deviation:.3g}"]
            rows.append([*(first if not i else [""] * 4), name, f"{p.value:.6g}", span])
    interval = f"{100.0 * fitted.level:g} % interval"
    head = ["law", "AICc", "weight", "left [N]", "parameter", "fitted", interval]
    table = console.text_table(rows, head, "lrrrlrr")
    low, high = (1e3 * x for x in fitted.summary()["speed"])
    lines = [
        table,
        f"{fitted.law}: {len(fitted.v)} of {fitted.samples} samples slide, "
        f"at {low:.3g} to {high:.3g} mm/s; noise {fitted.force_noise:.3g} N"
        + (f", {1e6 * fitted.position_noise:.3g} um" if fitted.position_noise else ""),
    ]
    return "\n".join(lines + [f"warning: {x}" for x in fitted.warnings])
