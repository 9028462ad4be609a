"""Many runs at once, on all cores, each with the result it has alone."""

from __future__ import annotations

import itertools
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from ..arguments import checked
from ..errors import ParameterError, choice, integer
from ..model.constants import AXES
from ..model.plausible import warn_of
from ..model.scenario import Scenario
from ..stepping.engine import warnings_caught
from ..stepping.many import SUMMARY_CROSSINGS
from ..stepping.monitor import Outcome
from ..stepping.run import Crossing, kind_of
from . import record
from .simulate import NUMBA, has_numba, load_compiled, simulate

KEEP = ("records", "summaries")
MANY = 32  # runs of a batch from which on those of one kind are made together
PART_STEPS = 20_000.0  # of a part of such a batch: 50 ms, after which Ctrl-C is heard
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
WARNED = 1000  # kinds of scene of a batch that are looked at for values that are hardly meant


@checked
def simulate_batch(
    scenarios: Iterable[Scenario],
    *,
    threads: int | None = None,
    every: int = 1,
    keep: str = "records",
) -> Any:
    """Runs scenarios in parallel; each gives the record of `simulate`, bit for bit.

    The number of threads and the order do not matter. Without numba, scenes run one after the
    other. A record takes 160 bytes a sample, a summary 500 bytes. Scenarios may come from a
    generator: they are taken as they are run, and those of summaries are not held.

    Args:
        scenarios: what to run; they may differ in anything. Many short runs, of up to 10 000 steps,
            that differ in numbers alone take 1.2 times the bare engine's time, sampled 1.9 times.
        threads: number of parallel runs; None for one a core.
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
    if isinstance(scenarios, Sequence):  # refused before the first run, if they can be
        for _ in _checked(scenarios, seen):
            pass
    todo = _checked(scenarios, seen)
    first = list(itertools.islice(todo, MANY))
    out = _Summaries() if summaries else _Records()
    module = load_compiled() if first and has_numba() else None
    if module is None:
        if first and not has_numba():
            print(f"hapticclay: the batch runs in Python: native {NUMBA}", file=sys.stderr)
        for i, scenario in enumerate(itertools.chain(first, todo)):
            r = simulate(scenario, every=every, engine="python")
            out.put(i, [summary_entry(*record.brief(r))] if summaries else [r])
        return out.all()
    pool, together = module.BatchPool(every), summaries and len(first) == MANY

    def make(jobs: list[Scenario], stopped: Callable[[], bool]) -> Any:
        if summaries:
            return _summaries_of(pool, jobs, together, stopped)
        return [record.Record.of(*pool.run(s)) for s in jobs if not stopped()]

    warmed: set[Any] = set()

    def parts() -> Iterator[list[Scenario]]:
        for part in _in_parts(itertools.chain(first, todo), together):
            for kind in {kind_of(s) for s in part} - warmed:
                module.warm(kind)
                warmed.add(kind)
            yield part

    with warnings_caught():
        _on_threads(parts(), make, out.put, min(threads, len(first)))
    return out.all()


class _Records:
    """The results of a batch, in the order of its scenarios."""

    def __init__(self):
        self.found: list[Any] = []

    def put(self, first: int, results: Sequence[Any]) -> None:
        """Takes the results of some runs that follow each other.

        Args:
            first: place of the first.
            results: of them.
        """
        end = first + len(results)
        self.found += [None] * (end - len(self.found))
        self.found[first:end] = results

    def all(self) -> Any:
        """All of them."""
        return self.found


class _Summaries:
    """The same, an array of SUMMARY that grows in place."""

    def __init__(self):
        self.found, self.n = np.zeros(0, SUMMARY), 0

    def put(self, first: int, results: Any) -> None:
        """Takes the results of some runs that follow each other.

        Args:
            first: place of the first.
            results: of them.
        """
        end = first + len(results)
        self.n = max(self.n, end)
        if end > len(self.found):
            self.found.resize(max(end, len(self.found) + len(self.found) // 4), refcheck=False)
        self.found[first:end] = results

    def all(self) -> Any:
        """All of them."""
        self.found.resize(self.n, refcheck=False)
        return self.found


def _checked(scenarios: Iterable[Any], seen: set[Any]) -> Iterator[Scenario]:
    """The scenarios; a `Warning` names what is hardly meant in the first WARNED kinds of scene."""
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
    """Scenarios that a thread takes at once: one, or as many as have about PART_STEPS together."""
    part, steps = [], 0.0
    for s in scenarios:
        part.append(s)
        steps += s.t_max / s.dt
        if not together or steps >= PART_STEPS:
            yield part
            part, steps = [], 0.0
    if part:
        yield part


def _summaries_of(
    pool: Any, jobs: list[Scenario], together: bool, stopped: Callable[[], bool]
) -> np.ndarray:
    """Summaries of runs.

    Args:
        pool: a compiled.BatchPool.
        jobs: what to run.
        together: whether to make runs of one kind together.
        stopped: whether the batch is over before its end.
    """
    out = np.zeros(len(jobs), SUMMARY)
    done, left = pool.many(jobs) if together else ([], range(len(jobs)))
    for places, fields in done:
        for name, values in fields.items():
            out[name][places] = values
    for i in left:
        if stopped():
            break
        out[i] = summary_entry(*pool.brief(jobs[i]))
    return out


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _on_threads(
    parts: Iterable[list[Scenario]],
    make: Callable[[list[Scenario], Callable[[], bool]], Any],
    put: Callable[[int, Any], None],
    threads: int,
) -> None:
    """Makes parts of a batch on several threads; the first exception ends all and is raised.

    This thread takes the scenarios and keeps the results, so that a generator runs where it was
    made, Ctrl-C reaches it, and no more than two parts a thread are held.

    Args:
        parts: of the batch.
        make: results of a part, asked for with a function that tells whether the batch is over.
        put: takes the place of the first run of a part, and the results.
        threads: their number.
    """
    stop, at = threading.Event(), 0
    working: dict[Future[Any], int] = {}

    def collect(most: int) -> None:
        while len(working) > most:
            for future in wait(working, return_when=FIRST_COMPLETED).done:
                put(working.pop(future), future.result())

    with ThreadPoolExecutor(threads) as pool:
        try:
            for part in parts:
                working[pool.submit(make, part, stop.is_set)] = at
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
    """Entry of a run among summaries.

    Args:
        o: how it ended.
        steps: of the engine.
        crossings: of borders.
        last: p, v, fh, fe, b at the last good sample, (x, y) each.
        energy: as Record.energy.

    Returns:
        The fields of SUMMARY.
    """
    first = crossings[:SUMMARY_CROSSINGS]
    rest = SUMMARY_CROSSINGS - len(first)
    return (
        o.code, o.axis, o.time, o.step, steps, len(crossings),
        [AXES.index(c.axis) for c in first] + [-1] * rest,
        [c.time for c in first] + [np.nan] * rest, [c.speed for c in first] + [np.nan] * rest,
        *last, *(energy[name] for name in WORKS),
    )  # fmt: skip
