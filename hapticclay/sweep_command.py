"""`hapticclay sweep`: grids and samples of runs, on these cores or on a cluster."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from . import space, sweep
from .errors import ParameterError, integer
from .record import atomic


@dataclass(frozen=True)
class SweepCommand:
    """Run a whole space of parameters; go on where an earlier call stopped.

    Either a SPEC.toml, or --grid. The results are one Parquet data set, a row a run, and maps of it.
    """

    spec: Annotated[Path | None, tyro.conf.Positional] = None
    """TOML file: experiment, design, runs, seed, chunk; tables [vary] (name = "low:high:n", "low:high:nlog" or [a, b])
    and [fixed]."""
    grid: str | None = None
    """Parameters to vary, as in "b=1:1000:50log gain=0.2:2:20"; gain.x is one axis, operator.mass the hand's."""
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
        from tqdm import tqdm

        plan = self._plan()
        if self.workers is not None:
            integer("workers", self.workers, 1, 1024)
        sweep.begin(plan, self.out)
        left = sum(min(plan.chunk, len(plan) - n * plan.chunk) for n in sweep.missing(plan, self.out))
        try:
            with tqdm(total=len(plan), initial=len(plan) - left, unit="run", desc=plan.experiment, disable=None) as bar:

                def show(n: int) -> None:
                    bar.update(n)

                sweep.run(
                    plan,
                    self.out,
                    workers=self.workers,
                    scheduler=self.scheduler,
                    progress=show,
                )
        except KeyboardInterrupt:
            here = len(plan) - sum(
                min(plan.chunk, len(plan) - n * plan.chunk) for n in sweep.missing(plan, self.out)
            )  # fmt: skip
            print(f"{here} of {len(plan)} runs are in {self.out / 'data'}; the same command goes on from there")
            raise
        table = sweep.read(self.out)
        for status, n in Counter(table["status"].to_pylist()).most_common():
            print(f"{n:8d}  {status}")
        print(f"{table.num_rows} runs in {self.out / 'data'}")
        if self.maps:
            self._draw(table)
        return 0

    def _plan(self) -> space.Sweep:
        if (self.spec is None) == (self.grid is None):
            raise ParameterError("grid", self.grid, "give either a SPEC.toml or --grid")
        if self.spec is not None:
            return space.Sweep(**space.load(self.spec))
        return space.Sweep(
            self.experiment, space.parse_grid(self.grid or ""), space.parse_fixed(self.fixed or ""), self.design,
            self.runs, self.seed, self.chunk,
        )  # fmt: skip

    def _draw(self, table) -> None:
        from . import plot_sweep

        if len(plot_sweep.columns(table)) < 2:
            return
        for value in ("status", "fe_over_v_x", "speed_x", "end_time"):
            if value != "status" and not any(x == x for x in table[value].to_pylist()):
                continue
            with atomic(self.out / f"{value}.png") as f:
                plot_sweep.heat(table, value).savefig(f, format="png")
            print(f"map: {self.out / f'{value}.png'}")
