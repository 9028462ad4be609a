"""Runs made for a store: in this process, in several, or on a cluster.

Each file is written by the process that made its runs. It holds a chunk of given size; without one,
a process makes runs for a share of the time spent so far and then writes them, so that files stay
few, whatever a run takes.
"""

from __future__ import annotations

import contextlib
import logging
import math
import sys
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

from ..errors import ParameterError
from ..simulation.batch import cores
from ..threads import one_thread
from . import store
from .store import P, Plan
from .workers import ended, started

MOST_IN_CHUNK = 20_000  # runs in a file, where they are short and no chunk was given
CHUNK_TIME = 1.5  # least time of a file in one process [s], if no chunk was given: a kill loses it
CLUSTER_CHUNK_TIME = 10.0  # the same on a cluster: its scheduler serves many workers [s]
CHUNK_SHARE = 0.05  # of the time spent so far, which a file may take instead
AHEAD = 2  # tasks of a cluster per worker, so that none waits for the next
SCHEDULER_PATIENCE = 4.0  # until a scheduler answers [s]; dask tries for up to twice as long
FINISHING = "hapticclay: finishing the chunks in progress"


def run_plan(
    plan: P,
    out: Path,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int], object] | None = None,
    before: Callable[[P, list[range]], object] = lambda plan, todo: None,
) -> int:
    """Makes the missing runs of a plan in its folder; returns their number.

    It calls before(plan, missing runs) once the folder is claimed, and progress(number of runs)
    after each file.
    """
    if not isinstance(scheduler, str | None):
        raise ParameterError("scheduler", scheduler, "must be the address of a dask scheduler")
    done = 0
    with store.claimed(plan, out) as (plan, todo):
        before(plan, todo)
        with contextlib.closing(run_chunks(plan, out, todo, workers, scheduler)) as results:
            for n in results:
                done += n
                if progress:
                    progress(n)
    return done


def run_chunks(
    plan: Plan,
    out: Path,
    todo: list[range],
    workers: int | None = None,
    scheduler: str | None = None,
) -> Generator[int, None, None]:
    """Makes the missing runs of a plan whose folder is claimed; yields the number in each file."""
    work = Work(plan, todo, CLUSTER_CHUNK_TIME if scheduler else CHUNK_TIME)
    if scheduler:
        yield from _run_on_cluster(work, str(out.resolve()), scheduler)
    else:
        yield from _run_here(work, str(out), processes(plan, todo, workers))
    store.check_complete(plan, out)


def processes(plan: Plan, todo: list[range], workers: int | None) -> int:
    """Number of processes that make runs on this machine."""
    tasks = sum(map(len, todo)) if plan.chunk is None else len(todo)
    return max(1, min(workers or cores(), tasks))


@one_thread
def run_part(
    plan: Plan,
    runs: range,
    out: str,
    patience: float = math.inf,
    ended: Callable[[], bool] = lambda: False,
) -> tuple[int, float]:
    """Makes runs and writes their file, in any process; returns their number and the time [s]."""
    begin, number, folder = time.perf_counter(), plan.part_number(runs), Path(out)
    store.check_begun(plan, folder)  # before the work, too: a cluster repeats what has failed
    rows = plan.rows(runs, lambda: time.perf_counter() - begin > patience or ended())
    store.save_part(plan, number, rows, folder)
    return len(rows), time.perf_counter() - begin


class Work:
    """Runs still to be made, and how many of them go to one process at a time.

    Args:
        plan: the plan.
        todo: the runs, in ranges as by `missing_parts`.
        least: time of a file, if chunks have no size [s]; later CHUNK_SHARE of the time spent.
    """

    def __init__(self, plan: Plan, todo: list[range], least: float):
        self.plan, self.free, self.least = plan, plan.chunk is None, least
        self.left, self.count = todo[::-1], sum(map(len, todo))
        self.begin, self.each = time.perf_counter(), 0.0  # each: time of a run, latest known [s]

    @property
    def patience(self) -> float:
        """Time after which a process writes a file [s]."""
        if not self.free:
            return math.inf
        return max(self.least, CHUNK_SHARE * (time.perf_counter() - self.begin))

    def take(self, workers: int) -> range | None:
        """The next runs for one process; None if none are left."""
        if not self.left:
            return None
        runs = self.left.pop()
        if self.free:
            # a share of the rest, so that all end together, but no small files towards the end
            fair = -(-self.count // (AHEAD * workers)) if workers > 1 else self.count
            least = self.patience / (4.0 * self.each) if self.each else 0.0
            n = min(MOST_IN_CHUNK, max(fair, int(min(least, MOST_IN_CHUNK))))
            self._put_back(runs[n:])
            runs = runs[:n]
        self.count -= len(runs)
        return runs

    def give_back(self, runs: range, made: int, seconds: float) -> None:
        """Notes what a process has made; the rest of its runs is to be made."""
        self.each = seconds / made
        self.count += len(runs) - made
        self._put_back(runs[made:])

    def _put_back(self, runs: range) -> None:
        if runs:
            self.left.append(runs)

    def spread(
        self,
        crew: Callable[[], int],
        ahead: int,
        submit: Callable[[range], Any],
        finished: Callable[[dict[Any, range]], Any],
    ) -> Generator[int, None, None]:
        """Keeps `ahead` tasks with each process; yields the number of runs of each one done."""
        jobs: dict[Any, range] = {}
        while True:
            workers = crew()
            while len(jobs) < ahead * workers and (runs := self.take(workers)) is not None:
                jobs[submit(runs)] = runs
            if not jobs:
                return
            job = finished(jobs)
            made, seconds = job.result()
            self.give_back(jobs.pop(job), made, seconds)
            yield made


def _run_here(work: Work, out: str, crew: int) -> Generator[int, None, None]:
    """As `run_chunks`, on this machine."""
    # the first file of short runs may be all
    while work.left and (crew == 1 or (work.free and not work.each)):
        yield _made_in_turn(work, out)
    if work.left:
        yield from _run_in_processes(work, out, crew)


def _made_in_turn(work: Work, out: str) -> int:
    """Makes the next file in this process."""
    runs = work.take(1)
    assert runs
    with _finishing() as ended:
        made, seconds = run_part(work.plan, runs, out, work.patience, ended)
    work.give_back(runs, made, seconds)
    return made


def _run_in_processes(work: Work, out: str, crew: int) -> Generator[int, None, None]:
    from concurrent.futures import FIRST_COMPLETED, wait

    with started(crew) as submit:
        try:
            yield from work.spread(
                lambda: crew,
                1,  # Ctrl-C would wait for queued tasks
                lambda runs: submit(run_part, work.plan, runs, out, work.patience, ended),
                lambda jobs: wait(jobs, return_when=FIRST_COMPLETED).done.pop(),
            )
        except (KeyboardInterrupt, GeneratorExit):  # Ctrl-C here or in the consumer of the results
            print(FINISHING, file=sys.stderr, flush=True)
            raise


@contextlib.contextmanager
def _finishing() -> Iterator[Callable[[], bool]]:
    """Makes Ctrl-C wait for the runs in progress, with a message; a second one does not wait.

    Yields a function that returns whether there was one.
    """
    import signal
    import threading

    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield lambda: False
        return
    caught: list[int] = []

    def note(number: int, frame: Any) -> None:
        caught.append(number)
        signal.signal(signal.SIGINT, before)
        print(FINISHING, file=sys.stderr, flush=True)

    signal.signal(signal.SIGINT, note)
    try:
        yield lambda: bool(caught)
    finally:
        signal.signal(signal.SIGINT, before)
    if caught:
        raise KeyboardInterrupt


def _run_on_cluster(work: Work, out: str, address: str) -> Generator[int, None, None]:
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
        results = as_completed(loop=client.loop)

        def submit(runs: range) -> Any:
            given = (work.plan, runs, out, work.patience)
            job = client.submit(run_part, *given, pure=False, retries=10)
            results.add(job)
            return job

        def crew() -> int:  # workers come and go
            return max(1, sum(client.nthreads().values()))

        try:
            yield from work.spread(crew, AHEAD, submit, lambda jobs: next(results))
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
