"""`hapticclay identify`: identifies each block, prints a table, writes figures and numbers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound, ParameterError
from ..files import writable
from ..model.constants import AXES
from . import console
from .log_options import NAMES as LOG_NAMES
from .log_options import LogOptions, column_names, found_line, hinted
from .options import Loose
from .unused import Unused

if TYPE_CHECKING:
    from ..studies.identification import Identified
    from ..studies.workspace import Drift

QUICK_SIGNALS: dict[str, dict[str, Any]] = {  # period [s], band [Hz]
    "G": {"periods": 1, "lines": 20, "period": 2.5, "band": (0.3, 20.0)},
    "S": {"periods": 1, "lines": 20, "period": 2.5, "band": (0.3, 20.0)},
    "Th": {"periods": 1, "lines": 20, "period": 5.0, "band": (0.15, 3.0)},
}
OF_SIMULATED = ("noise", "map", "quick", "seed", "control")
SPACING, QUICK_SPACING = 0.08, 0.2  # [m] between the poses of the map


@dataclass(frozen=True)
class IdentifyCommand:
    """Identify G, Sh or Th from a log of your own device: mass, damper, spring, with intervals.

    With --simulated, identify all of them on the simulated arm of the paper (Figs. 4, 5, 6), which
    takes a minute.

    Attributes:
        file: Log of time, input (for G the command, for S and Th the force of the hand on the
            handle) and output (position of the handle): text, Parquet, MATLAB, HDF5 and others.
        simulated: Identify the simulated arm of the paper, in place of a file.
        out: Folder for identify.json and identify.png; of the simulated arm for fig4.png, fig5.png,
            fig6.png and map.png too.
        axis: Axis to identify. With a file, the axis of the printed equation to compare with, by
            default x.
        noise: Add sensor noise: encoders with 65536 counts per turn, a force sensor with 0.02 N
            rms.
        map: Also map G and Sh over the workspace, with and without inertia shaping; takes two
            minutes more.
        quick: Use shorter signals and a coarser map.
        seed: Seed of the signals' phases and of the noise.
        control: Control of the runs; "sampled" takes about ten minutes, two with --quick.
        csv: The file, as in earlier releases.
        what: Block to fit to the file, by default G.
        columns: Names in the file, as in t=time input=cmd output=pos; those that are not given
            are looked for. reference=NAME adds the signal that drives the experiment; use it if a
            position or force is noisy or part of a loop.
        band: Lowest and highest frequency to fit [Hz].
        held: A computer holds the input of the file from sample to sample.
        delay: Delay of the position behind the other columns [s], which is removed.
        paper: Show the paper's equation beside the fit, in the table and the figure.
        log: Units of the columns.
        figures: Formats and style of the figures.
    """

    file: Loose[Path | None] = None
    simulated: bool = False
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
    delay: Annotated[float, Bound(-1.0, 1.0, unit="s")] = 0.0
    paper: bool = False
    log: LogOptions = LogOptions()
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("file",), "is the file: leave --csv out", ("csv",)),
        *(
            Unused(
                ("simulated", *OF_SIMULATED),
                "is for the simulated arm: leave it out with a file",
                (file,),
            )
            for file in ("file", "csv")
        ),
        Unused(
            OF_SIMULATED, "is for the arm of the paper: give --simulated too", (), ("simulated",)
        ),
        Unused(
            (
                "what",
                "columns",
                "band",
                "held",
                "delay",
                "paper",
                *LOG_NAMES,
            ),
            "is for a log: give FILE too",
            (),
            ("file", "csv"),
        ),
    )

    def __call__(self) -> int:
        from ..studies.identified_blocks import IdentifiedBlocks

        if file := self.file or self.csv:
            return self._measured(file)
        if not self.simulated:
            bound = "must be given: the log of a device, or --simulated for the arm of the paper"
            raise ParameterError("file", None, bound)
        writable(self.out)
        with console.fraction_bar("identify") as show:
            results = self._blocks(show)
            drift = self._map(show) if self.map else None
        console.deliver(IdentifiedBlocks(results, drift), self.out, self.figures)
        return 0

    def _measured(self, file: Path) -> int:
        from ..studies.identified_blocks import IdentifiedBlocks
        from ..studies.measurement import COLUMNS, measured, named_columns
        from ..studies.spectral_fit import identify_data

        writable(self.out)
        what, given = self.what or "G", column_names(self.columns, COLUMNS)
        log = self.log.log(file, "csv" if self.csv else "file")
        with hinted(given):
            names = named_columns(log, given, input="command" if what == "G" else "force")
        axis = "x" if self.axis == "both" else self.axis
        data = measured(log, names, "hold" if self.held else "spline")
        timing = {"held": self.held, "delay": self.delay}
        result = identify_data(data, what, axis, band=self.band, **timing)
        if line := found_line(given, names):
            print(line)
        console.deliver(IdentifiedBlocks((result,), paper=self.paper), self.out, self.figures)
        return 0

    def _blocks(self, show: Callable[..., None]) -> tuple[Identified, ...]:
        from ..studies.identification import BLOCK_KINDS, Noise, identify

        axes: Any = AXES if self.axis == "both" else (self.axis,)
        jobs = [(what, axis) for what in BLOCK_KINDS for axis in axes]
        return tuple(
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
        )

    def _map(self, show: Callable[..., None]) -> Drift:
        from ..studies.workspace import drift_map

        return drift_map(
            QUICK_SPACING if self.quick else SPACING,
            seed=self.seed,
            progress=lambda done, total: show(done / total, "map"),
        )
