"""Many runs over a space of parameters, as a data set that survives anything.

A sweep is cut into chunks; each chunk is one Parquet file, written whole or not at all by whoever ran it. What
is missing is what is left to do, so a sweep that was interrupted, even killed, goes on where it stopped.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import numpy as np

from . import limits
from .errors import ParameterError
from .params import AXES
from .record import Record, atomic
from .sim import fits, has_numba, simulate
from .space import Sweep

BORDERS = 3  # crossings that have columns of their own
NATIVE_FROM = 2_000_000  # steps in the whole sweep from which the compiled loop pays in every process
STALE = 3600.0  # [s] after which an unfinished file is taken for a killed writer's


def row(index: int, names: list[str], point: np.ndarray, r: Record | None, refused: str = "") -> dict[str, Any]:
    """One row of the data set: parameters, how the run ended, what was measured. NaN where there is nothing.

    Args:
        index: of the run. names, point: its parameters. r: its record; None if it was refused, and why.
    """
    nan = math.nan
    out: dict[str, Any] = {"run": index, **dict(zip(names, point.tolist(), strict=True))}
    out |= {"status": r.outcome.code if r else "refused", "axis": r.outcome.axis if r else "",
            "cause": r.outcome.cause if r else refused, "end_time": r.outcome.time if r else nan}  # fmt: skip
    times = [c.time for c in r.crossings] if r else []
    out |= {f"crossing{k + 1}": times[k] if k < len(times) else nan for k in range(BORDERS)}
    for i, axis in enumerate(AXES):
        deepest = max(r.regions(axis), key=lambda x: x[axis]["b"], default=None) if r else None
        entry = deepest[axis] if deepest else {}
        fe = entry.get("steady_fe_over_v") or {}
        out |= {f"b_{axis}": entry.get("b", nan), f"fe_over_v_{axis}": fe.get("mean", nan),
                f"speed_{axis}": nan if entry.get("steady_speed") is None else entry["steady_speed"]}  # fmt: skip
        margin = nan
        if r and r.scenario.gain[i] > 0.0:
            b = entry.get("b", 0.0)
            th = r.scenario.operator
            margin = limits.gain_limit(axis, b, impedance=th is not None, operator=th) / r.scenario.gain[i]
        out[f"gain_margin_{axis}"] = margin
    through = r.energy.get("throughput", 0.0) if r else 0.0
    out["energy_residual"] = abs(r.energy["residual"]) / through if r and through else nan
    out["wall_time"] = r.wall_time if r else nan
    return out


def run_chunk(sweep: Sweep, number: int, out: str) -> int:
    """Runs one chunk and writes its file; returns the number of its runs. What a worker does, here or far away."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    first, last = number * sweep.chunk, min((number + 1) * sweep.chunk, len(sweep))
    names, rows = list(sweep.vary), []
    for index, point in zip(itertools.count(first), sweep.points(first, last)):
        try:
            scenario = sweep.scenario(point)
            compiled = len(sweep) * scenario.t_max / scenario.dt >= NATIVE_FROM and fits(scenario) and has_numba()
            rows.append(row(index, names, point, simulate(scenario, engine="native" if compiled else "python")))
        except ParameterError as error:
            rows.append(row(index, names, point, None, str(error)))
    table = pa.Table.from_pylist(rows)
    with atomic(part(Path(out), number)) as f:
        pq.write_table(table, f)
    return last - first


def part(out: Path, number: int) -> Path:
    """The file of one chunk."""
    return out / "data" / f"part-{number:06d}.parquet"


def missing(sweep: Sweep, out: Path) -> list[int]:
    """Chunks that have no file yet."""
    return [n for n in range(sweep.chunks) if not part(out, n).is_file()]


def begin(sweep: Sweep, out: Path) -> None:
    """Makes the folder, or checks that what lies there is this same sweep; clears away what a killed writer left.

    Raises:
        ParameterError: another sweep lies there.
    """
    file = out / "sweep.json"
    if file.is_file():
        try:
            digest = json.loads(file.read_text())["digest"]
        except (OSError, ValueError, KeyError):
            digest = "unreadable"
        if digest != sweep.digest():
            raise ParameterError("out", str(out), "holds another sweep, or another release's: choose another folder")
    else:
        with atomic(file) as f:
            f.write((json.dumps({"digest": sweep.digest(), **sweep.described()}, indent=1) + "\n").encode())
    for left in (out / "data").glob(".part-*"):
        with contextlib.suppress(FileNotFoundError):
            if time.time() - left.stat().st_mtime > STALE:
                left.unlink()


def run(
    sweep: Sweep, out: Path, *, workers: int | None = None, scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> int:  # fmt: skip
    """Does what is missing of a sweep; returns the number of runs made.

    Args:
        sweep: what to run. out: folder of sweep.json and data/.
        workers: processes here; None for one a core. scheduler: address of a dask scheduler to use instead.
        progress: called with the number of runs of each chunk that is done.

    Raises:
        ParameterError: another sweep lies in out, or a package is missing.
    """
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        raise ParameterError("sweep", "pyarrow", "is not installed: pip install 'hapticclay[sweep]'") from None
    begin(sweep, out)
    todo, done = missing(sweep, out), 0
    map_chunks = _far(sweep, out, scheduler) if scheduler else _here(sweep, out, workers or os.cpu_count() or 1)
    with contextlib.closing(map_chunks(todo)) as results:
        for n in results:
            done += n
            if progress:
                progress(n)
    return done


def _here(sweep: Sweep, out: Path, workers: int):
    def chunks(todo: list[int]) -> Generator[int, None, None]:
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor, as_completed

        if workers == 1 or len(todo) < 2:
            for number in todo:
                yield run_chunk(sweep, number, str(out))
            return
        context = multiprocessing.get_context("spawn")  # the engine's threads and locks do not survive a fork
        with ProcessPoolExecutor(min(workers, len(todo)), mp_context=context, initializer=_quiet) as pool:
            jobs = [pool.submit(run_chunk, sweep, number, str(out)) for number in todo]
            try:
                for job in as_completed(jobs):
                    yield job.result()
            finally:
                pool.shutdown(wait=True, cancel_futures=True)

    return chunks


def _quiet() -> None:
    """Leaves Ctrl-C to the process that waits: a worker finishes its chunk."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _far(sweep: Sweep, out: Path, address: str):
    def chunks(todo: list[int]) -> Generator[int, None, None]:
        try:
            from distributed import Client, as_completed
        except ImportError:
            raise ParameterError("scheduler", address, "needs dask: pip install 'hapticclay[cluster]'") from None
        try:
            client = Client(address, timeout="20s", set_as_default=False)
        except OSError as error:
            raise ParameterError("scheduler", address, f"must be the address of a dask scheduler ({error})") from None
        with client:
            jobs = client.map(lambda n: run_chunk(sweep, n, str(out.resolve())), todo, pure=False, retries=10)
            for job in as_completed(jobs, loop=client.loop):
                yield job.result()

    return chunks


def read(out: str | os.PathLike[str]):
    """The data set in the folder out, all its chunks, as a pyarrow Table in the order of the runs.

    Raises:
        ParameterError: there is none.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    files = sorted((Path(out) / "data").glob("part-*.parquet"))
    if not files:
        raise ParameterError("sweep", str(out), "must be a folder that hapticclay sweep has written")
    return pa.concat_tables([pq.read_table(f) for f in files])
