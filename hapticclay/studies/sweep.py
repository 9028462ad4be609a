"""Many runs over a space of parameters, as a data set that survives interruptions.

A sweep is cut into chunks; each chunk is one Parquet file, written whole or not at all by the
process that ran it. Missing and damaged files define the remaining work, so an interrupted or
killed sweep resumes where it stopped.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import logging
import os
import sys
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

from ..arguments import checked
from ..errors import ParameterError
from ..files import atomic
from ..simulation.batch import cores
from .sampling import Sweep
from .sweep_rows import PROBE_TIME, probed, run_point
from .sweep_store import (
    Plan,
    chunk_size,
    claimed,
    parquet_schema,
    row_size,
    sweep_part,
    write_part,
)

SCHEDULER_PATIENCE = 4.0  # until a scheduler answers [s]; dask tries for up to twice as long
FINISHING = "hapticclay: finishing the chunks in progress"


def run_chunk(sweep: Plan, number: int, out: str) -> int:
    """Runs one chunk and writes its file, in any process; returns the number of its runs.

    Args:
        sweep: the sweep.
        number: the chunk.
        out: folder of the sweep.
    """
    runs = sweep.chunk_runs(number)
    if isinstance(sweep, Sweep):
        points = sweep.points(runs.start, runs.stop)
        rows = [run_point(sweep, index, point) for index, point in zip(runs, points, strict=True)]
    else:
        rows = sweep.chunk_rows(number)
    with atomic(sweep_part(Path(out), number)) as f:
        write_part(rows, parquet_schema(sweep, number), f)
    return len(runs)


@checked
def run_sweep(
    sweep: Sweep,
    out: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Runs the missing chunks of a sweep; returns the number of runs made.

    Args:
        sweep: the sweep.
        out: folder of sweep.json and data/.
        workers: as in `run_chunks`.
        scheduler: as in `run_chunks`.
        progress: called with the number of runs of each finished chunk.

    Raises:
        ParameterError: as `claimed` and `run_chunks`.
    """
    done, out = 0, Path(out)
    with (
        claimed(sweep, out) as (plan, todo),
        contextlib.closing(run_chunks(plan, out, todo, workers, scheduler)) as results,
    ):
        for n in results:
            done += n
            if progress:
                progress(n)
    return done


def run_chunks(
    sweep: Plan,
    out: Path,
    todo: list[int],
    workers: int | None = None,
    scheduler: str | None = None,
) -> Generator[int, None, None]:
    """Runs chunks of a sweep whose folder is locked; yields the number of runs of each.

    Args:
        sweep: the sweep.
        out: its folder.
        todo: the chunks.
        workers: processes on this machine; None for one per core.
        scheduler: address of a dask scheduler to use instead.

    Raises:
        ParameterError: a file cannot be written, or a package is missing.
        ChildProcessError: a worker here was killed.
        ConnectionError: the connection to the scheduler is lost.
    """
    return (
        _run_on_cluster(sweep, out, todo, scheduler)
        if scheduler
        else _run_here(sweep, out, todo, processes(todo, workers))
    )


def processes(todo: list[int], workers: int | None) -> int:
    """Number of processes that run chunks on this machine.

    Args:
        todo: the chunks.
        workers: largest number to use; None for one per core.
    """
    return max(1, min(workers or cores(), len(todo)))


def _run_here(sweep: Plan, out: Path, todo: list[int], workers: int) -> Generator[int, None, None]:
    import multiprocessing
    from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool

    if workers == 1:
        for number in todo:
            with _finishing():
                made = run_chunk(sweep, number, str(out))
            yield made
        return
    context = multiprocessing.get_context("spawn")  # the engine's threads do not survive a fork
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker) as pool:
        try:
            jobs: set[Future[int]] = set()
            left = iter(todo)
            while True:  # one chunk per worker: Ctrl-C would wait for queued ones
                jobs |= {
                    pool.submit(run_chunk, sweep, number, str(out))
                    for number in itertools.islice(left, workers - len(jobs))
                }
                if not jobs:
                    return
                done, jobs = wait(jobs, return_when=FIRST_COMPLETED)
                yield from (job.result() for job in done)
        except (KeyboardInterrupt, GeneratorExit):  # Ctrl-C here or in the consumer of the results
            print(FINISHING, file=sys.stderr, flush=True)
            raise
        except BrokenProcessPool:
            raise ChildProcessError(
                "a worker was killed (memory?); the same command resumes the sweep"
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def _finishing() -> Iterator[None]:
    """Makes Ctrl-C wait for the running chunks, with a message; a second Ctrl-C does not wait."""
    import signal
    import threading

    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    caught: list[int] = []

    def note(number: int, frame: Any) -> None:
        caught.append(number)
        signal.signal(signal.SIGINT, before)
        print(FINISHING, file=sys.stderr, flush=True)

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if caught:
        raise KeyboardInterrupt


def _start_worker() -> None:
    """Ignores signals of the terminal, so a worker finishes; the worker ends with its parent."""
    import signal
    import threading

    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    assert parent
    parent.join()
    os._exit(1)  # a killed parent receives no report


def _run_on_cluster(
    sweep: Plan, out: Path, todo: list[int], address: str
) -> Generator[int, None, None]:
    from concurrent.futures import CancelledError

    try:
        from distributed import Client, as_completed
    except ImportError:
        raise ParameterError(
            "scheduler", address, "needs dask: pip install 'hapticclay[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=SCHEDULER_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ParameterError(
            "scheduler", address, f"must be the address of a dask scheduler ({error})"
        ) from None
    with _quiet("distributed"), client:
        jobs = client.map(
            lambda n: run_chunk(sweep, n, str(out.resolve())), todo, pure=False, retries=10
        )
        try:
            for job in as_completed(jobs, loop=client.loop):
                yield job.result()
        except CancelledError:
            raise ConnectionError(
                f"the dask scheduler {address} has gone; the same command resumes the sweep"
            ) from None


@contextlib.contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Silences the log of a package: the errors it logs are raised too and shown once."""
    logger = logging.getLogger(name)
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


def estimate_time(sweep: Sweep) -> tuple[float, float]:
    """Process time [s] and disk space [bytes] of a run, estimated from a random sample.

    Args:
        sweep: the sweep.
    """
    probed(sweep, 0.0)  # the first run loads and compiles
    rows, spent = probed(sweep, PROBE_TIME)
    each = spent / len(rows)
    if sweep.chunk is None:
        sweep = dataclasses.replace(sweep, chunk=chunk_size(each))
    return each, row_size(sweep, rows)
