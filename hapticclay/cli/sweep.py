"""`hapticclay sweep`: grids and samples of runs, on these cores or on a cluster."""

from __future__ import annotations

import shutil
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from ..errors import ParameterError, integer
from ..files import atomic
from ..studies import sampling, sweep

LARGE = 1000  # runs from which an estimate, made of 20 at most, pays
LINE = "hapticclay: {n} of {total} runs, {percentage:.0f} %, {elapsed} gone, {remaining} to go"
EVERY = 0.1, 60.0  # of the runs, and [s], from one LINE to the next


@dataclass(frozen=True)
class SweepCommand:
    """Run a whole space of parameters; go on where an earlier call stopped.

    Either a SPEC.toml, or --grid. The results are one Parquet data set, a row a run, and maps of it.
    """

    spec: Annotated[Path | None, tyro.conf.Positional] = None
    """TOML file: experiment, design, runs, seed, chunk; tables [vary] (name = "low:high:n", "low:high:nlog" or [a, b],
    and "low:high" or "low:highlog" where design samples) and [fixed]."""
    grid: str | None = None
    """Parameters to vary, as in "b=1:1000:50log gain=0.2:2:20", or, to sample, "b=1:1000log gain=0.2:2"; gain.x
    is one axis, operator.mass the hand's."""
    fixed: str | None = None
    """Parameters that stay, as in "t_max=2 shaping=true"."""
    experiment: str = "constant"
    """constant, variable, stability or free."""
    design: Literal["grid", "lhs", "sobol"] = "grid"
    """All combinations, a Latin hypercube or a Sobol sequence."""
    runs: int | None = None
    """Number of runs of a Latin hypercube or Sobol sequence."""
    seed: int = 0
    """Of that sample."""
    chunk: int = 64
    """Runs in one file: what a killed process loses at most."""
    out: Path = Path("out/sweep")
    """Folder for sweep.json, data/ and the maps."""
    workers: int | None = None
    """Processes here; one a core if not given."""
    scheduler: str | None = None
    """Address of a dask scheduler to run on instead, as in tcp://10.0.0.1:8786."""
    maps: bool = True
    """Draw maps over the first two parameters."""

    def __call__(self) -> int:
        plan = self._plan()
        if self.workers is not None:
            integer("workers", self.workers, 1, 1024)
        try:
            with sweep.claimed(plan, self.out) as todo:
                left = sum(len(plan.chunk_runs(n)) for n in todo)
                if left >= LARGE:
                    self._foretell(plan, left, todo)
                with (
                    _progress(plan, len(plan) - left) as show,
                    closing(
                        sweep.sweep_worker(plan, self.out, todo, self.workers, self.scheduler)
                    ) as results,
                ):
                    for n in results:
                        show(n)
        except KeyboardInterrupt:
            here = len(plan) - sum(
                len(plan.chunk_runs(n)) for n in sweep.missing_parts(plan, self.out)
            )
            print(
                f"{here} of {len(plan)} runs are in {self.out / 'data'}; the same command goes on from there"
            )
            raise
        table = sweep.read_sweep(self.out)
        for status, n in Counter(table["status"].to_pylist()).most_common():
            print(f"{n:8d}  {status}")
        print(f"{table.num_rows} runs in {self.out / 'data'}")
        if self.maps:
            self._draw(table)
        return 0

    def _foretell(self, plan: sampling.Sweep, left: int, todo: list[int]) -> None:
        """Says what time and room the runs that are left will take."""
        from tqdm import tqdm

        seconds, size = sweep.estimate_time(plan)
        crew = 1 if self.scheduler else sweep.processes(todo, self.workers)
        time_ = f"{tqdm.format_interval(seconds * left / crew)} on {crew} process{'es' if crew > 1 else ''}"
        free, room = shutil.disk_usage(self.out).free, size * left
        print(
            f"hapticclay: {left} runs, {1e3 * seconds:.3g} ms each: about {time_}, {tqdm.format_sizeof(room, 'B')} in "
            f"{self.out / 'data'} ({'only ' if free < room else ''}{tqdm.format_sizeof(free, 'B')} free)",
            file=sys.stderr,
        )

    def _plan(self) -> sampling.Sweep:
        if (self.spec is None) == (self.grid is None):
            raise ParameterError("grid", self.grid, "give either a SPEC.toml or --grid")
        if self.spec is not None:
            return sampling.Sweep(**sampling.load_sweep(self.spec))
        return sampling.Sweep(
            self.experiment, sampling.parse_grid(self.grid or ""), sampling.parse_fixed(self.fixed or ""), self.design,
            self.runs, self.seed, self.chunk,
        )  # fmt: skip

    def _draw(self, table) -> None:
        from ..views import study_plots

        if len(study_plots.swept_parameters(table)) < 2:
            return
        for value in ("status", "fe_over_v_x", "speed_x", "end_time"):
            if all(study_plots.missing_reasons(table, value)):
                continue
            with atomic(self.out / f"{value}.png") as f:
                study_plots.sweep_plot(table, value).savefig(f, format="png")
            print(f"map: {self.out / f'{value}.png'}")


@contextmanager
def _progress(plan: sampling.Sweep, done: int) -> Iterator[Callable[[int], object]]:
    """What to tell of each few runs that are made: a bar shows it at a terminal, elsewhere a line now and then."""
    from tqdm import tqdm

    total, begin = len(plan), time.monotonic()
    now = said = done
    last = begin

    def line(runs: int) -> None:
        nonlocal now, said, last
        now += runs
        at = time.monotonic()
        if now == total or now - said >= EVERY[0] * total or at - last >= EVERY[1]:
            said, last = now, at
            text = tqdm.format_meter(now, total, at - begin, initial=done, bar_format=LINE)
            print(text, file=sys.stderr, flush=True)

    with tqdm(total=total, initial=done, unit="run", desc=plan.experiment, disable=None) as bar:
        yield line if bar.disable else bar.update
