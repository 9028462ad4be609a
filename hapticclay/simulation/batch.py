"""Many runs in parallel on all cores, each with the same result as alone."""

from __future__ import annotations

import functools
import itertools
import math
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from typing import Annotated, Any, Literal, TypeVar

import numpy as np

from ..arguments import checked
from ..errors import Bound, ParameterError
from ..kernel.engine import warnings_caught
from ..model.sampled_controller import Controller
from ..scene.plausible import warn_implausible
from ..scene.scenario import Scenario
from . import record
from .crew import outlast
from .engines import engine_for
from .many import Lane, kind_key
from .one_run import check_memory
from .run import Run, Workspace, completed
from .summaries import SUMMARY, Summaries, of_run, put_fields

MANY = 32  # batches of so many runs or more make the runs of one kind together
PART_STEPS = 20_000.0  # steps in a part of such a batch: 50 ms, after which Ctrl-C takes effect
LAST_ONLY = 1_000_000_000  # value of `every` that keeps only the first sample and the last
WARNED = 200  # kinds of scene per batch that are checked for implausible values


@checked
def simulate_batch(
    scenarios: Iterable[Scenario],
    *,
    threads: Annotated[int | None, Bound(1, 1024)] = None,
    every: Annotated[int, Bound(1, 1_000_000)] = 1,
    keep: Literal["records", "summaries"] = "records",
) -> Any:
    """Runs scenarios in parallel; each gives the record of `simulate`, bit for bit.

    Results do not depend on the number of threads or the order. Without the compiled kernel, scenes
    run one after the other. A record takes 160 bytes per sample, a summary 500 bytes. Scenarios may
    come from a generator: they are read as they are run, and summaries do not keep them.

    Args:
        scenarios: what to run; they may differ in anything. Short runs, of up to 10 000 steps, that
            differ only in numbers take 0.8 times the time of the bare engine, sampled 0.9 times.
        threads: number of parallel runs; None for one per core.
        every: keep each every-th sample, and the last.
        keep: "records", or "summaries" without samples.

    Returns:
        A list of records in the order of the scenarios; or an array of SUMMARY, shape (n,).

    Raises:
        ParameterError: a scenario, or another argument, is of the wrong kind.
    """
    summaries, seen = keep == "summaries", set[Any]()
    if isinstance(scenarios, Sequence):  # refuse before the first run where possible
        for _ in checked_scenarios(scenarios, seen):
            pass
    todo = checked_scenarios(scenarios, seen)
    first = list(itertools.islice(todo, MANY))
    engine = engine_for("auto", math.inf if first else 0.0)
    pool, together = BatchPool(engine), summaries and len(first) == MANY and engine == "native"
    out, records = Summaries(), dict[int, Any]()

    def make(jobs: list[Scenario]) -> Any:
        if summaries:
            return _summaries_of(pool, jobs, together)
        return [record.Record.of(*pool.run(s, every)) for s in jobs]

    def put(first: int, results: Any) -> None:
        records.update(enumerate(results, first))

    with warnings_caught():
        parts = _in_parts(itertools.chain(first, todo), together)
        # in Python one after the other: side by side they would wait for each other
        count = max(min(threads or cores(), len(first)), 1) if engine == "native" else 0
        on_threads(parts, make, out.put if summaries else put, count, pool.stop)
    return out.all() if summaries else [records[i] for i in range(len(records))]


Part = TypeVar("Part", bound=Sized)


class BatchPool:
    """What each thread of a batch owns: a lane, with the workspace of its runs."""

    def __init__(self, engine: str = "native"):
        self.engine, self.stop = engine, threading.Event()
        self.own = threading.local()

    def lane(self) -> Lane:
        """The lane of this thread, unless the batch has ended."""
        if self.stop.is_set():
            raise CancelledError
        if not hasattr(self.own, "lane"):
            self.own.lane = Lane(Workspace(stop=self.stop))
        return self.own.lane

    def run(self, scenario: Scenario, every: int) -> tuple[Run, float]:
        """Makes a run, and the time that it took [s]."""
        check_memory(scenario, every)
        return completed(scenario, every, self.engine, self.lane().workspace)

    def together(self, jobs: Sequence[Scenario]) -> tuple[list[Any], list[int]]:
        """Makes short runs of one kind together, as `Lane.make`."""
        return self.lane().make(jobs, [kind_key(s) for s in jobs])

    def summary(self, scenario: Scenario) -> tuple[Any, ...]:
        """Summary of a run."""
        return of_run(self.run(scenario, LAST_ONLY)[0])


def checked_scenarios(scenarios: Iterable[Any], seen: set[Any]) -> Iterator[Scenario]:
    """The scenarios; a `Warning` names implausible values in the first WARNED kinds of scene."""
    for i, s in enumerate(scenarios):
        if not isinstance(s, Scenario):
            raise ParameterError(
                f"scenarios[{i}]", s, "must be a Scenario, as constant_cut() returns"
            )
        scene = id(s.clay), s.origin, s.arm, s.operator
        if len(seen) < WARNED and scene not in seen:
            seen.add(scene)
            warn_implausible(s)
        if isinstance(s.controller, Controller):
            s.controller.function()  # imported here, not in a thread
        yield s


def _in_parts(scenarios: Iterable[Scenario], together: bool) -> Iterator[list[Scenario]]:
    """Scenarios for one thread at a time: one, or as many as have about PART_STEPS together."""
    part, steps = [], 0.0
    for s in scenarios:
        part.append(s)
        steps += s.t_max / s.dt
        if not together or steps >= PART_STEPS:
            yield part
            part, steps = [], 0.0
    if part:
        yield part


def _summaries_of(pool: BatchPool, jobs: list[Scenario], together: bool) -> np.ndarray:
    """Summaries of runs."""
    out, left = np.zeros(len(jobs), SUMMARY), list(range(len(jobs)))
    if together:
        done, left = pool.together(jobs)
        for places, fields in done:
            put_fields(out, places, fields)
    for i in left:
        out[i] = pool.summary(jobs[i])
    return out


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def on_threads(
    parts: Iterable[Part],
    make: Callable[[Part], Any],
    put: Callable[[int, Any], None],
    threads: int,
    stop: threading.Event,
) -> None:
    """Makes parts of a batch on threads, 0 for none; the first exception ends all and is raised.

    The calling thread reads the scenarios and stores the results. So a generator runs where it was
    made, Ctrl-C reaches it, and at most two parts per thread are held. Once `stop` is set, runs end
    at their next look.
    """
    at = 0
    if not threads:
        for part in parts:
            put(at, make(part))
            at += len(part)
        return
    working: dict[Future[Any], int] = {}

    def collect(most: int) -> None:
        while len(working) > most:
            for future in wait(working, return_when=FIRST_COMPLETED).done:
                put(working.pop(future), future.result())

    pool = ThreadPoolExecutor(threads)
    try:
        for part in parts:
            working[pool.submit(make, part)] = at
            at += len(part)
            collect(2 * threads - 1)
        collect(0)
    except BaseException:  # Ctrl-C too
        stop.set()
        raise
    finally:
        outlast(functools.partial(pool.shutdown, wait=True, cancel_futures=True))
