"""Runs that differ in columns of numbers, as a data set on disk that survives interruptions."""

from __future__ import annotations

import functools
import hashlib
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ..arguments import checked
from ..errors import Bound
from ..fields import plain_data
from ..model.constants import AXES
from ..scene.scenario import Scenario
from ..simulation.column_batch import Columns, simulate_columns
from ..simulation.summaries import SUMMARY
from .store import Plan
from .store_runs import run_plan
from .sweep_rows import RESULT_COLUMNS
from .workers import batch_threads

SCHEMA = "hapticclay-columns-1"
CHUNK = 10_000  # runs per file: one or two seconds of short runs
ENDS = "p", "v", "fh", "fe", "b"  # columns of a summary, one per axis


@checked
def run_columns(
    base: Scenario,
    columns: Mapping[str, Any],
    out: str | os.PathLike[str],
    *,
    chunk: Annotated[int, Bound(1, 1_000_000)] = CHUNK,
    workers: Annotated[int | None, Bound(1, 1024)] = None,
    scheduler: str | None = None,
    progress: Callable[[int], object] | None = None,
) -> int:
    """Runs a scenario with columns of numbers in place of some fields, and stores the final states.

    As `simulate_columns`, chunk by chunk on processes or on a cluster. Each chunk is a Parquet file
    in the folder, so memory holds one chunk per process. After an interruption the same call makes
    the missing chunks. `read_sweep` reads the folder.

    Args:
        base: what the runs have in common.
        columns: values by dotted name, as for `with_fields`, shape (n,) each.
        out: the folder.
        chunk: runs per file, the most that a killed process loses.
        workers: processes on this machine; None for one per core.
        scheduler: address of a dask scheduler to use instead.
        progress: called with the number of runs of each finished chunk.

    Returns:
        The number of runs made.

    Raises:
        ParameterError: as by `simulate_columns`; or the folder holds other runs, or cannot be
            written, or a package is missing.
        ChildProcessError: workers here cannot be started, or one was killed.
        ConnectionError: the connection to the scheduler is lost.
        FileNotFoundError: the folder, or a file in it, was removed while the runs were made.
    """
    plan = ColumnRuns(base, columns, chunk)
    return run_plan(plan, Path(out), workers, scheduler, progress)


class ColumnRuns(Plan):
    """Runs of a scenario with columns of numbers in place of some fields, see `run_columns`."""

    notes = {
        **{name: RESULT_COLUMNS[name] for name in ("run", "status", "axis", "end_time")},
        "steps": ("", "engine steps made"),
        "p_x": ("m", "position at the end"),
        "v_x": ("m/s", "velocity at the end"),
        "fh_x": ("N", "force of the operator at the end"),
        "fe_x": ("N", "resisting force of the clay at the end"),
        "b_x": ("N.s/m", "damping of the clay at the end"),
        "energy_residual": RESULT_COLUMNS["energy_residual"],
    }

    def __init__(self, base: Scenario, columns: Mapping[str, Any], chunk: int):
        self.chunk, self.base = chunk, base
        self.columns = Columns(base, columns).columns  # refuses bad ones

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def rows(self, runs: range, late: Callable[[], bool]) -> list[dict[str, Any]]:
        """Makes the runs of a file."""
        columns = self._values(runs)
        return _rows(runs, columns, simulate_columns(self.base, columns, threads=batch_threads()))

    def blank_row(self) -> dict[str, Any]:
        """A row, for the types of its columns."""
        return _rows(range(1), self._values(range(1)), np.zeros(1, SUMMARY))[0]

    def _values(self, runs: range) -> dict[str, np.ndarray]:
        return {name: x[runs.start : runs.stop] for name, x in self.columns.items()}

    def described(self) -> dict[str, Any]:
        """The runs as plain data; the columns by their names and a fingerprint."""
        return {
            "schema": SCHEMA, "base": plain_data(self.base), "columns": list(self.columns),
            "runs": len(self), "chunk": self.chunk, "values": self._fingerprint,
        }  # fmt: skip

    @functools.cached_property
    def _fingerprint(self) -> str:
        values = hashlib.sha256()
        for x in self.columns.values():
            values.update(x.tobytes())
        return values.hexdigest()


def _rows(runs: range, columns: Mapping[str, np.ndarray], made: np.ndarray) -> list[dict[str, Any]]:
    """Rows of the data set, of summaries."""
    through = np.where(made["throughput"] > 0.0, made["throughput"], np.nan)
    table = {
        "run": np.array(runs), **columns, "status": made["code"], "axis": made["axis"],
        "end_time": made["time"], "steps": made["steps"],
        **{f"{name}_{axis}": made[name][:, i] for name in ENDS for i, axis in enumerate(AXES)},
        "energy_residual": np.abs(made["residual"]) / through,
    }  # fmt: skip
    values = zip(*(x.tolist() for x in table.values()), strict=True)
    return [dict(zip(table, row, strict=True)) for row in values]
