"""`hapticclay sweep`: grids and samples of runs, on this machine or on a cluster."""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from ..errors import Bound, ParameterError
from . import console
from .options import Loose
from .unused import Unused

if TYPE_CHECKING:
    from ..studies.sweep import Sweep

LARGE_SWEEP = 1000  # runs from which an estimate, made of 20 at most, pays
STATUS_LINE = (
    "hapticclay: {n} of {total} runs, {percentage:.0f} %, {elapsed} gone, {remaining} to go"
)
STATUS_EVERY = 0.1, 60.0  # share of the runs, and time [s], between two of these lines
MAPPED = ("status", "fe_over_v_x", "speed_x", "end_time")  # columns that are drawn
SAMPLED = "design=lhs", "design=sobol"


@dataclass(frozen=True)
class SweepCommand:
    """Run an experiment over a space of parameters; resume an interrupted sweep.

    Give either a SPEC.toml or --grid. The results are one Parquet data set with one row per run,
    and maps.

    Attributes:
        spec: TOML file: experiment (or scenario, a file), design, runs, seed, chunk; tables [vary]
            (name = "low:high:n", "low:high:nlog" or [a, b], and "low:high" or "low:highlog" where
            design samples) and [fixed].
        grid: Parameters to vary, as in "b=1:1000:50log gain=0.2:2:20", or, to sample,
            "b=1:1000log gain=0.2:2"; gain.x is one axis, arm.l1 and servo.x.G.damping numbers of
            parts: hapticclay fields lists them all.
        fixed: Fixed parameters, as in "t_max=2 inertia_shaping=true arm.l2=0.4".
        experiment: Name of an experiment, as in hapticclay run, or a scenario file.
        design: All combinations, a Latin hypercube or a Sobol sequence.
        runs: Number of runs of a Latin hypercube or Sobol sequence.
        seed: Seed of the sample.
        chunk: Runs per file, which is the most that a killed process loses; by default as many as
            take 1.5 s, or 5 % of the time spent so far.
        out: Folder for sweep.json, data/ and the maps.
        workers: Processes on this machine; by default one per core.
        scheduler: Address of a dask scheduler to run on instead, as in tcp://10.0.0.1:8786.
        maps: Draw maps over the first two parameters.
        figures: Formats and style of the maps.
    """

    spec: Loose[Path | None] = None
    grid: str | None = None
    fixed: str | None = None
    experiment: str = "constant"
    design: Literal["grid", "lhs", "sobol"] = "grid"
    runs: int | None = None
    seed: int = 0
    chunk: int | None = None
    out: Path = Path("out/sweep")
    workers: Annotated[int | None, Bound(1, 1024)] = None
    scheduler: str | None = None
    maps: bool = True
    figures: console.FigureOptions = console.FigureOptions()

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(
            ("grid", "fixed", "experiment", "design", "runs", "seed", "chunk"),
            "must stand in the SPEC.toml, where one is given",
            ("spec",),
        ),
        Unused(("seed",), "is of a sample: give --design lhs or sobol", (), ("spec", *SAMPLED)),
        Unused(("workers",), "is for this machine: leave it out with --scheduler", ("scheduler",)),
    )

    def __call__(self) -> int:
        from ..studies import store

        asked = self._plan()
        with store.claimed(asked, self.out) as (plan, todo):
            try:
                self._make(plan, todo)
            except KeyboardInterrupt:
                missing = store.missing_parts(plan, self.out)
                here = len(plan) - sum(map(len, missing))
                print(
                    f"{here} of {len(plan)} runs are in {self.out / 'data'}; "
                    "the same command resumes the sweep"
                )
                raise
        table = store.read_sweep(self.out)
        for status, n in Counter(table["status"].to_pylist()).most_common():
            print(f"{n:8d}  {status}")
        print(f"{table.num_rows} runs in {self.out / 'data'}")
        if self.maps:
            self._draw(table)
        return 0

    def _make(self, plan: Sweep, todo: list[range]) -> None:
        from ..studies import store_runs

        left = sum(map(len, todo))
        if left >= LARGE_SWEEP:
            self._estimate(plan, left, todo)
        chunks = store_runs.run_chunks(plan, self.out, todo, self.workers, self.scheduler)
        with _status(plan, len(plan) - left) as show, closing(chunks) as results:
            for n in results:
                show(n)

    def _plan(self) -> Sweep:
        from ..scene.files import is_scenario_file, read_settings
        from ..studies.sampling import parse_fixed, parse_grid
        from ..studies.sweep import Sweep, load_sweep

        if (self.spec is None) == (self.grid is None):
            raise ParameterError("arguments", "", "give either a SPEC.toml or --grid")
        if self.spec is not None:
            return Sweep(**load_sweep(self.spec))
        file = is_scenario_file(self.experiment)
        return Sweep(
            "constant" if file else self.experiment,
            parse_grid(self.grid or ""),
            parse_fixed(self.fixed or ""),
            self.design,
            self.runs,
            self.seed,
            self.chunk,
            read_settings(self.experiment) if file else {},
        )

    def _estimate(self, plan: Sweep, left: int, todo: list[range]) -> None:
        """Prints the time and room on disk that the runs left will take."""
        from ..studies import store_runs, sweep

        each, size = sweep.estimate_time(plan)
        crew = 1 if self.scheduler else store_runs.processes(plan, todo, self.workers)
        runs, data = f"{left} runs, {1e3 * each:.3g} ms each", self.out / "data"
        console.announce(runs, each * left / crew, crew, size * left, data)

    def _draw(self, table: Any) -> None:
        from ..views import sweep_plots
        from ..views.figure import Figure

        if len(sweep_plots.swept_parameters(table)) < 2:
            return
        for value in MAPPED:
            if not all(sweep_plots.missing_reasons(table, value)):
                figure = Figure(
                    partial(sweep_plots.sweep_plot, table, value),
                    partial(sweep_plots.sweep_tables, table, value),
                )
                for files in console.save_figures({value: figure}, self.out, self.figures).values():
                    print(f"map: {', '.join(map(str, files))}")


@contextmanager
def _status(plan: Sweep, done: int) -> Iterator[Callable[[int], object]]:
    """Yields show(runs), which reports finished runs: a bar on a terminal, elsewhere a line."""
    from tqdm import tqdm

    total, begin = len(plan), time.monotonic()
    now = said = done
    last = begin

    def line(runs: int) -> None:
        nonlocal now, said, last
        now += runs
        at = time.monotonic()
        share, span = STATUS_EVERY
        if now == total or now - said >= share * total or at - last >= span:
            said, last = now, at
            text = tqdm.format_meter(now, total, at - begin, initial=done, bar_format=STATUS_LINE)
            print(text, file=sys.stderr, flush=True)

    look: dict[str, Any] = {"unit": "run", "desc": plan.title, "delay": 0.0, "leave": True}
    with console.progress_bar(total=total, initial=done, **look) as bar:
        yield line if bar.disable else bar.update
