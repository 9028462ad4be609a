"""Many runs in parallel on all cores, each with the same result as alone."""

from __future__ import annotations

import itertools
import math
import os
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from typing import Any, TypeVar

import numpy as np

from ..arguments import checked
from ..errors import ParameterError, choice, integer
from ..kernel.engine import warnings_caught
from ..model.constants import AXES
from ..scene.plausible import warn_of
from ..scene.scenario import Scenario
from . import record
from .engines import engine_for
from .many import SUMMARY_CROSSINGS, Lane, kind_key
from .monitor import Outcome
from .run import Crossing, Place, Run, completed
from .simulate import simulate

KEEP = ("records", "summaries")
MANY = 32  # batches of so many runs or more make the runs of one kind together
PART_STEPS = 20_000.0  # steps in a part of such a batch: 50 ms, after which Ctrl-C takes effect
WORKS = (
    "muscle",
    "motors",
    "clay",
    "hand_damper",
    "kinetic",
    "hand_stored",
    "residual",
    "throughput",
)
SUMMARY = np.dtype(
    [
        ("code", "U12"),  # record.Outcome.code; the rest of it: record.status of a run made again
        ("axis", "U1"),  # that is to blame, "" if none
        ("time", "f8"),  # of the end, or of the verdict [s]
        ("step", "i8"),  # last good sample
        ("steps", "i8"),  # engine steps made
        ("crossings", "i8"),  # number of borders crossed; of the first of them:
        ("crossing_axis", "i8", SUMMARY_CROSSINGS),  # 0 for x, 1 for y, -1 for none
        ("crossing_time", "f8", SUMMARY_CROSSINGS),  # [s], NaN for none
        (
            "crossing_speed",
            "f8",
            SUMMARY_CROSSINGS,
        ),  # along the axis [m/s]: the steady one, if the region was long enough
        ("p", "f8", 2),  # at the last good sample: position [m]
        ("v", "f8", 2),  # velocity [m/s]
        ("fh", "f8", 2),  # force of the operator [N]
        ("fe", "f8", 2),  # of the clay [N]
        ("b", "f8", 2),  # damping [N.s/m]
        *((name, "f8") for name in WORKS),  # record.Record.energy [J]
    ]
)
LAST_ONLY = 1_000_000_000  # value of `every` that keeps only the last sample
WARNED = 200  # kinds of scene per batch that are checked for implausible values


@checked
def simulate_batch(
    scenarios: Iterable[Scenario],
    *,
    threads: int | None = None,
    every: int = 1,
    keep: str = "records",
) -> Any:
    """Runs scenarios in parallel; each gives the record of `simulate`, bit for bit.

    Results do not depend on the number of threads or the order. Without the compiled kernel, scenes
    run one after the other. A record takes 160 bytes per sample, a summary 500 bytes. Scenarios may
    come from a generator: they are read as they are run, and summaries do not keep them.

    Args:
        scenarios: what to run; they may differ in anything. Short runs, of up to 10 000 steps, that
            differ only in numbers take 1.2 times the time of the bare engine, sampled 1.9 times.
        threads: number of parallel runs; None for one per core.
        every: keep each every-th sample, and the last.
        keep: "records", or "summaries" without samples.

    Returns:
        A list of records in the order of the scenarios; or an array of SUMMARY, shape (n,).

    Raises:
        ParameterError: a scenario, or another argument, is of the wrong kind.
    """
    threads = integer("threads", cores() if threads is None else threads, 1, 1024)
    every = integer("every", every, 1, 1_000_000)
    summaries = choice("keep", keep, KEEP) == "summaries"
    seen: set[Any] = set()
    if isinstance(scenarios, Sequence):  # refuse before the first run where possible
        for _ in checked_scenarios(scenarios, seen):
            pass
    todo = checked_scenarios(scenarios, seen)
    first = list(itertools.islice(todo, MANY))
    out = Summaries() if summaries else _Records()
    engine = engine_for("auto", math.inf if first else 0.0)
    if engine == "python":  # one after the other: side by side they would wait for each other
        for i, scenario in enumerate(itertools.chain(first, todo)):
            r = simulate(scenario, every=every, engine=engine)
            out.put(i, [summary_entry(*record.brief(r))] if summaries else [r])
        return out.all()
    pool, together = BatchPool(every), summaries and len(first) == MANY

    def make(jobs: list[Scenario]) -> Any:
        if summaries:
            return _summaries_of(pool, jobs, together)
        return [record.Record.of(*pool.run(s)) for s in jobs]

    with warnings_caught():
        count = max(min(threads, len(first)), 1)
        parts = _in_parts(itertools.chain(first, todo), together)
        on_threads(parts, make, out.put, count, pool.stop)
    return out.all()


Part = TypeVar("Part", bound=Sized)


class BatchPool:
    """What each thread of a batch owns: a place for its runs, and what runs of one kind share.

    Args:
        every: keep each every-th sample.
    """

    def __init__(self, every: int):
        self.every, self.stop = every, threading.Event()
        self.own = threading.local()

    def lane(self) -> Lane:
        """The lane of this thread, which makes runs of one kind together."""
        if not hasattr(self.own, "lane"):
            self.own.lane = Lane(Place())
        return self.own.lane

    def _go(self, scenario: Scenario, every: int, brief: bool) -> tuple[Run, float]:
        """The run, made at this thread's place, and the seconds it took."""
        if self.stop.is_set():
            raise CancelledError
        return completed(scenario, every, "native", self.lane().place, None, brief)

    def run(self, scenario: Scenario) -> tuple[Run, float]:
        """Makes a run."""
        return self._go(scenario, self.every, False)

    def brief(self, scenario: Scenario) -> tuple[Any, ...]:
        """The end of a run, without its samples."""
        return self._go(scenario, LAST_ONLY, True)[0].brief()

    def many(
        self, scenarios: Sequence[Scenario], keys: Sequence[Any]
    ) -> tuple[list[tuple[np.ndarray, dict[str, Any]]], list[int]]:
        """Makes short runs of one kind together, without their samples."""
        if self.stop.is_set():
            raise CancelledError
        return self.lane().make(scenarios, keys)


class _Records:
    """The results of a batch, in the order of its scenarios."""

    def __init__(self):
        self.found: list[Any] = []

    def put(self, first: int, results: Sequence[Any]) -> None:
        """Stores the results of consecutive runs."""
        end = first + len(results)
        self.found += [None] * (end - len(self.found))
        self.found[first:end] = results

    def all(self) -> Any:
        """All of them."""
        return self.found


class Summaries:
    """The same as an array of SUMMARY, which grows in place."""

    def __init__(self):
        self.found, self.n = np.zeros(0, SUMMARY), 0

    def put(self, first: int, results: Any) -> None:
        """Stores the results of consecutive runs."""
        end = first + len(results)
        self.n = max(self.n, end)
        if end > len(self.found):
            self.found.resize(max(end, len(self.found) + len(self.found) // 4), refcheck=False)
        self.found[first:end] = results

    def all(self) -> Any:
        """All of them."""
        self.found.resize(self.n, refcheck=False)
        return self.found


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
            warn_of(s)
        if s.controller is not None:
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
        done, left = pool.many(jobs, [kind_key(s) for s in jobs])
        for places, fields in done:
            for name, values in fields.items():
                out[name][places] = values
    for i in left:
        out[i] = summary_entry(*pool.brief(jobs[i]))
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
    """Makes parts of a batch on several threads; the first exception ends all and is raised.

    The calling thread reads the scenarios and stores the results. So a generator runs where it was
    made, Ctrl-C reaches it, and at most two parts per thread are held.
    """
    at = 0
    working: dict[Future[Any], int] = {}

    def collect(most: int) -> None:
        while len(working) > most:
            for future in wait(working, return_when=FIRST_COMPLETED).done:
                put(working.pop(future), future.result())

    with ThreadPoolExecutor(threads) as pool:
        try:
            for part in parts:
                working[pool.submit(make, part)] = at
                at += len(part)
                collect(2 * threads - 1)
            collect(0)
        except BaseException:  # Ctrl-C too
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def summary_entry(
    o: Outcome,
    steps: int,
    crossings: Sequence[Crossing],
    last: Sequence[Any],
    energy: dict[str, float],
) -> tuple[Any, ...]:
    """Entry of a run among summaries."""
    first = crossings[:SUMMARY_CROSSINGS]
    rest = SUMMARY_CROSSINGS - len(first)
    return (
        o.code, o.axis, o.time, o.step, steps, len(crossings),
        [AXES.index(c.axis) for c in first] + [-1] * rest,
        [c.time for c in first] + [np.nan] * rest, [c.speed for c in first] + [np.nan] * rest,
        *last, *(energy[name] for name in WORKS),
    )  # fmt: skip
