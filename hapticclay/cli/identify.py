"""`hapticclay identify`: identifies each block, prints a table, writes figures and numbers."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from ..errors import Bound, ParameterError, choice
from ..files import writable
from ..model.constants import AXES
from . import console

if TYPE_CHECKING:
    from ..studies.identification import Identified
    from ..studies.workspace import Drift

QUICK_SIGNALS: dict[str, dict[str, Any]] = {  # period [s], band [Hz]
    "G": {"periods": 1, "lines": 20, "period": 2.5, "band": (0.3, 20.0)},
    "S": {"periods": 1, "lines": 20, "period": 2.5, "band": (0.3, 20.0)},
    "Th": {"periods": 1, "lines": 20, "period": 5.0, "band": (0.15, 3.0)},
}
NUMBERS = ("printed", "fitted", "95 % interval", "error")  # columns of the table
SPACING, QUICK_SPACING = 0.08, 0.2  # of the map's poses [m]
SIMULATED_ONLY = ("noise", "map", "quick", "seed", "control")
MEASURED_ONLY = ("what", "columns", "band", "held", "paper")


@dataclass(frozen=True)
class IdentifyCommand:
    """Identify G, Sh and Th on the simulated arm (Figs. 4, 5, 6); takes a minute.

    With --csv, identify one of them from measured columns in SI units.

    Attributes:
        out: Folder for identify.json, fig4.png, fig5.png, fig6.png and map.png; with --csv for
            identify.json and identify.png.
        axis: Axis to identify. With --csv, the axis of the printed equation to compare with, by
            default x.
        noise: Add sensor noise: encoders with 65536 counts per turn, a force sensor with 0.02 N
            rms.
        map: Also map G and Sh over the workspace, with and without inertia shaping; takes two
            minutes more.
        quick: Use shorter signals and a coarser map.
        seed: Seed of the signals' phases and of the noise.
        control: Control of the runs; "sampled" takes about ten minutes, two with --quick.
        csv: File of measured columns. Its first line names them: time [s], input (for G the command
            [m], for S and Th the force of the hand on the handle [N]) and output (position of the
            handle [m]).
        what: Block to fit to the file, by default G.
        columns: Names in the file, as in t=time input=cmd output=pos. reference=NAME adds the
            signal that drives the experiment; use it if a position or force is noisy or part of a
            loop.
        band: Lowest and highest frequency to fit [Hz].
        held: A computer holds the input of the file from sample to sample.
        paper: Show the paper's equation beside the fit, in the table and the figure.
        figures: Formats and style of the figures.
    """

    out: Path = Path("out/identify")
    axis: Literal["x", "y", "both"] = "both"
    noise: bool = False
    map: bool = False
    quick: bool = False
    seed: int = 0
    control: Literal["continuous", "sampled"] = "continuous"
    csv: Path | None = None
    what: Literal["G", "S", "Th"] | None = None
    columns: tuple[str, ...] = ()
    band: Annotated[tuple[float, float] | None, Bound(unit="Hz", names=("low", "high"))] = None
    held: bool = False
    paper: bool = False
    figures: console.FigureOptions = console.FigureOptions()

    def __call__(self) -> int:
        self._check_words()
        if self.csv:
            return self._measured(self.csv)
        writable(self.out)
        with console.fraction_bar("identify") as show:
            results = self._blocks(show)
            found = self._map(show) if self.map else None
        try:
            self._save(results, found)
        finally:  # a full disk must not hide the results
            print(coefficient_table(results))
            if found:
                print("\n" + drift_table(found))
        print(f"written to {self.out}")
        return 0

    def _check_words(self) -> None:
        """Refuse options of the simulated arm with a file, and of a file without one."""
        names, bound = SIMULATED_ONLY, "is for the simulated arm: leave it out with --csv"
        if not self.csv:
            names, bound = MEASURED_ONLY, "is for measured columns: give --csv FILE too"
        for name in names:
            if (value := getattr(self, name)) != getattr(type(self), name):
                raise ParameterError(name, value, bound)

    def _measured(self, file: Path) -> int:
        from ..studies.measurement import COLUMNS, Measurement
        from ..studies.spectral_fit import identify_data

        writable(self.out)
        data = Measurement.load(file, column_names(self.columns, COLUMNS))
        axis = "x" if self.axis == "both" else self.axis
        result = identify_data(data, self.what or "G", axis, band=self.band, held=self.held)
        try:
            self._save([result], None)
        finally:  # a full disk must not hide the result
            print(coefficient_table([result], self.paper))
        print(f"written to {self.out}")
        return 0

    def _blocks(self, show: Callable[..., None]) -> list[Identified]:
        from ..studies.identification import BLOCK_KINDS, Noise, identify

        axes = AXES if self.axis == "both" else (self.axis,)
        jobs = [(what, axis) for what in BLOCK_KINDS for axis in axes]
        return [
            identify(
                axis,
                what,
                noise=Noise() if self.noise else None,
                seed=self.seed,
                control=self.control,
                progress=lambda done, total, i=i: show((i + done / total) / len(jobs)),
                **(QUICK_SIGNALS[what] if self.quick else {}),
            )
            for i, (what, axis) in enumerate(jobs)
        ]

    def _map(self, show: Callable[..., None]) -> Drift:
        from ..studies.workspace import drift_map

        return drift_map(
            QUICK_SPACING if self.quick else SPACING,
            seed=self.seed,
            progress=lambda done, total: show(done / total, "map"),
        )

    def _save(self, results: Sequence[Identified], found: Drift | None) -> None:
        from ..studies.identification import IDENTIFICATION_SCHEMA, response_tables
        from ..views import identification_plots, workspace_plots
        from ..views.figure import Figure

        data = {
            "schema": IDENTIFICATION_SCHEMA,
            "results": [r.summary() for r in results],
            "map": found and found.summary(),
        }
        console.save_json(data, self.out / "identify.json")
        beside = self.paper or not self.csv
        figures = {
            "identify" if self.csv else block.figure: Figure(
                partial(identification_plots.identification_plot, same, beside),
                partial(response_tables, same, beside),
            )
            for what, block in identification_plots.BLOCKS.items()
            if (same := [r for r in results if r.what == what])
        }
        if found:
            figures["map"] = Figure(partial(workspace_plots.workspace_plot, found), found.tables)
        console.save_figures(figures, self.out, self.figures)


def column_names(
    words: Sequence[str],
    columns: Collection[str],
    example: str = "t=time input=cmd output=pos",
) -> dict[str, str]:
    """Names of columns from words such as "input=cmd"."""
    out: dict[str, str] = {}
    for word in words:
        key, _, name = word.partition("=")
        if not name:
            raise ParameterError("columns", word, f"must be words such as {example}")
        if choice("columns", key, tuple(columns)) in out:
            raise ParameterError("columns", word, f"must give {key} once")
        out[key] = name
    return out


def coefficient_table(results: Sequence[Identified], paper: bool = True) -> str:
    """Fitted coefficients, and the printed ones beside them, for a terminal."""
    rows = [
        [
            r.what,
            r.axis,
            f"{c.name} [{c.unit}]",
            f"{c.printed:g}",
            f"{c.value:.6g}",
            f"{c.low:.6g} to {c.high:.6g}",
            f"{100.0 * c.error:+.4f} %",
        ]
        for r in results
        for c in r.coefficients
    ]
    head = ["", "axis", "coefficient", "printed", "fitted", "95 % interval", "error"]
    if not paper:
        kept = [i for i, name in enumerate(head) if name not in ("axis", "printed", "error")]
        rows, head = [[row[i] for i in kept] for row in rows], [head[i] for i in kept]
    low = min(float(r.coherence.min()) for r in results)
    counts = ", ".join(f"{r.what}{r.axis if paper else ''} {len(r.frequency)}" for r in results)
    table = console.text_table(rows, head, "".join("r" if x in NUMBERS else "l" for x in head))
    way = "".join(f"; {r.source}: {r.estimate}" for r in results if r.scenario is None)
    lines = [table, f"lines: {counts}; lowest coherence {low:.6f}{way}"]
    for r in results:
        if r.scenario is None and r.what == "S":
            mass, damper, spring = r.device
            lines.append(
                f"as a device: mass {mass:.5g} kg, damper {damper:.5g} N.s/m, "
                f"spring {spring:.5g} N/m"
            )
        lines += [f"warning: {x}" for x in r.warnings]
    return "\n".join(lines)


def drift_table(found: Drift) -> str:
    """Range of each coefficient over the workspace, with and without shaping, for a terminal."""
    ranges = found.ranges()
    rows = [
        [
            a["what"],
            a["axis"],
            a["name"],
            f"{a['printed']:g}",
            *(f"{r['lowest']:.5g} to {r['highest']:.5g}" for r in (a, b)),
        ]
        for a, b in zip(ranges[::2], ranges[1::2], strict=True)
    ]
    head = ["", "axis", "coefficient", "printed", "without shaping", "with shaping"]
    text = console.text_table(rows, head, "lllrrr")
    return f"over {len(found.x)} poses of the workspace:\n{text}"
