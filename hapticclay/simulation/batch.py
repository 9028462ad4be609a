"""Many runs at once, on all cores, each with the result it has alone."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any

import numpy as np

from ..errors import ParameterError, choice, integer
from ..model.constants import AXES
from ..model.scenario import Scenario
from ..stepping.engine import warnings_caught
from ..stepping.monitor import Outcome
from ..stepping.run import Crossing, kind_of
from . import record
from .simulate import NUMBA, has_numba, load_compiled, simulate

KEEP = ("records", "summaries")
SUMMARY_CROSSINGS = 8  # crossings that a summary has room for
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


def simulate_batch(
    scenarios: Iterable[Scenario],
    *,
    threads: int | None = None,
    every: int = 1,
    keep: str = "records",
) -> Any:
    """Runs scenarios in parallel; each gives the record of `simulate`, bit for bit.

    The number of threads and the order do not matter. Without numba, scenes run one after the
    other. A record takes 160 bytes a sample, a summary 500 bytes.

    Args:
        scenarios: what to run; they may differ in anything.
        threads: number of parallel runs; None for one a core.
        every: keep each every-th sample, and the last.
        keep: "records", or "summaries" without samples.

    Returns:
        A list of records in the order of the scenarios; or an array of SUMMARY, shape (n,).

    Raises:
        ParameterError: a scenario, or another argument, is of the wrong kind.
    """
    jobs = list(scenarios)
    for i, s in enumerate(jobs):
        if not isinstance(s, Scenario):
            raise ParameterError(
                f"scenarios[{i}]", s, "must be a Scenario, as constant_cut() returns"
            )
    threads = integer("threads", cores() if threads is None else threads, 1, 1024)
    every = integer("every", every, 1, 1_000_000)
    summaries = choice("keep", keep, KEEP) == "summaries"
    out: Any = np.zeros(len(jobs), SUMMARY) if summaries else [None] * len(jobs)
    module = load_compiled() if jobs and has_numba() else None
    if module:
        for kind in {kind_of(s) for s in jobs}:
            module.warm(kind)
        pool = module.BatchPool(every)

        def run(i: int) -> None:
            out[i] = (
                summary_entry(*pool.brief(jobs[i]))
                if summaries
                else record.Record.of(*pool.run(jobs[i]))
            )

        with warnings_caught():
            _on_threads(range(len(jobs)), run, min(threads, len(jobs)))
        return out
    if jobs and not has_numba():
        print(f"hapticclay: the batch runs in Python: native {NUMBA}", file=sys.stderr)
    for i, scenario in enumerate(jobs):
        r = simulate(scenario, every=every, engine="python")
        out[i] = summary_entry(*record.brief(r)) if summaries else r
    return out


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _on_threads(jobs: Iterable[int], run: Callable[[int], None], threads: int) -> None:
    """run(job) for each job, on several threads; the first exception ends all and is raised."""
    todo, stop = iter(jobs), threading.Event()

    def work() -> None:
        for job in todo:
            if stop.is_set():
                return
            run(job)

    with ThreadPoolExecutor(threads) as pool:
        try:
            for worker in as_completed([pool.submit(work) for _ in range(threads)]):
                worker.result()
        except BaseException:  # Ctrl-C too
            stop.set()
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
