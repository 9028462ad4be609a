"""Many runs in parallel on all cores, each with the same result as alone."""

from __future__ import annotations

import contextlib
import functools
import itertools
import os
import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, ThreadPoolExecutor, wait
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..arguments import checked
from ..errors import ParameterError, choice, integer
from ..model.constants import AXES
from ..scene.plausible import warn_of
from ..scene.scenario import Scenario
from ..stepping import scene
from ..stepping.engine import warnings_caught
from ..stepping.many import FEWEST, SUMMARY_CROSSINGS, Lane, Patterns, draws_of, kind_key
from ..stepping.monitor import Outcome
from ..stepping.run import PLAIN, Crossing, EngineStore, Kernel, Run, completed
from . import record
from .engines import NUMBA, has_numba, load_compiled, outweighs, pays, saved_in_a_step
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
KNOWN = 100_000  # runs of a sequence counted before the first; more repay any compilation
ALONE = 1e-3  # time that a run takes Python in addition to its steps, alone, measured [s]
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

    Results do not depend on the number of threads or the order. Machine code is compiled for each
    kind of scene whose runs repay it; others run in Python. Without numba, scenes run one after the
    other. A record takes 160 bytes per sample, a summary 500 bytes. Scenarios may come from a
    generator: they are read as they are run, and summaries do not keep them.

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
    if not has_numba():
        if first:
            print(f"hapticclay: the batch runs in Python: native {NUMBA}", file=sys.stderr)
        for i, scenario in enumerate(itertools.chain(first, todo)):
            r = simulate(scenario, every=every, engine="python")
            out.put(i, [summary_entry(*record.brief(r))] if summaries else [r])
        return out.all()
    pool, together = BatchPool(every), summaries and len(first) == MANY
    known = scenarios if isinstance(scenarios, Sequence) and len(scenarios) <= KNOWN else ()
    plan = Plan(pool, known, together)

    def make(jobs: list[Job]) -> Any:
        if summaries:
            return _summaries_of(pool, plan, jobs)
        return [record.Record.of(*pool.run(j.scenario, j.kernel)) for j in jobs]

    parts = map(plan.jobs, _in_parts(itertools.chain(first, todo), together))
    with warnings_caught():
        count = max(min(threads, len(first)), 1)
        on_threads(parts, make, out.put, count, pool.stop)
    return out.all()


Part = TypeVar("Part", bound=Sized)


class Job(NamedTuple):
    """A run of a batch.

    Attributes:
        scenario: what to run.
        key: from many.kind_key for a run made together with others; else None.
        kernel: how the steps of a run made alone are made.
    """

    scenario: Scenario
    key: Any
    kernel: Kernel


class BatchPool:
    """What each thread of a batch owns: engines, and what runs of one kind share.

    Args:
        every: keep each every-th sample, and the last.

    Attributes:
        stop: set when the batch ends early, so that no run begins.
    """

    def __init__(self, every: int):
        self.every, self.stop = every, threading.Event()
        self.own, self.turn = threading.local(), threading.Lock()

    def _go(self, scenario: Scenario, every: int, kernel: Kernel, brief: bool) -> tuple[Run, float]:
        """The run, made by this thread's engines, and the seconds it took."""
        # in CPython one after the other: side by side they would wait for each other at each step
        with self.turn if kernel is PLAIN else contextlib.nullcontext():
            if self.stop.is_set():
                raise CancelledError
            return completed(scenario, every, kernel, self.store(), None, brief)

    def store(self) -> EngineStore:
        """The engines of this thread."""
        if not hasattr(self.own, "store"):
            self.own.store = EngineStore()
        return self.own.store

    def lane(self) -> Lane:
        """The lane of this thread, which makes runs of one kind together."""
        if not hasattr(self.own, "lane"):
            from ..stepping.compiled import CARRY, KERNEL, RESET  # where it pays

            self.own.lane = Lane(KERNEL, self.store(), CARRY, RESET)
        return self.own.lane

    def run(self, scenario: Scenario, kernel: Kernel) -> tuple[Run, float]:
        """Makes a run.

        Args:
            scenario: what to run.
            kernel: how its steps are made.

        Returns:
            The run, and the seconds it took.
        """
        return self._go(scenario, self.every, kernel, False)

    def brief(self, scenario: Scenario, kernel: Kernel) -> tuple[Any, ...]:
        """The end of a run, without its samples.

        Args:
            scenario: what to run.
            kernel: how its steps are made.

        Returns:
            As Run.brief.
        """
        return self._go(scenario, LAST_ONLY, kernel, True)[0].brief()

    def many(
        self, scenarios: Sequence[Scenario], keys: Sequence[Any]
    ) -> tuple[list[tuple[np.ndarray, dict[str, Any]]], list[int]]:
        """Makes short runs of one kind together, without their samples.

        Args:
            scenarios: what to run.
            keys: as Job.key.

        Returns:
            As many.Lane.make.
        """
        if self.stop.is_set():
            raise CancelledError
        return self.lane().make(scenarios, keys)


class Plan:
    """Chooses how each run of a batch is made: compiled where the runs of its kind repay it.

    All runs of the batch count where they are known beforehand, else those taken so far.

    Args:
        pool: makes the runs.
        known: all scenarios of the batch; empty where they are not known beforehand.
        together: whether runs of one kind may be made together.
    """

    def __init__(self, pool: BatchPool, known: Sequence[Scenario], together: bool):
        self.pool, self.together, self.known = pool, together, bool(known)
        self.lock = threading.Lock()
        self.kernels: dict[Any, Kernel] = {}  # by traits of a scene
        # steps of runs made alone, by traits of their scene
        self.expected: defaultdict[Any, float] = defaultdict(float)
        self.patterns = Patterns()
        self.carried: dict[Any, bool] = {}  # kinds of run made together: whether compiled yet
        kinds: dict[Any, list[Scenario]] = {}
        for s in known:
            key = kind_key(s) if together else None
            if key is None:
                self.expected[scene.traits(s)] += s.t_max / s.dt
            else:
                kinds.setdefault(key, []).append(s)
        for key, jobs in kinds.items():
            self._count(key, jobs)
        for key, jobs in kinds.items():
            if self._repay(key, jobs):
                self.carried[key] = False
            else:
                self.expected[scene.traits(jobs[0])] += sum(s.t_max / s.dt for s in jobs)

    def jobs(self, scenarios: list[Scenario]) -> list[Job]:
        """Jobs of the batch for one thread; compiles what they need.

        Args:
            scenarios: of the runs.
        """
        if not self.together:
            return [Job(s, None, self.kernel(s)) for s in scenarios]
        keys, kinds = [kind_key(s) for s in scenarios], dict[Any, list[Scenario]]()
        for key, s in zip(keys, scenarios, strict=True):
            kinds.setdefault(key, []).append(s)
        kinds.pop(None, None)
        made = {key for key, jobs in kinds.items() if self._carries(key, jobs)}
        return [
            Job(s, key, PLAIN) if key in made else Job(s, None, self.kernel(s))
            for s, key in zip(scenarios, keys, strict=True)
        ]

    @functools.cached_property
    def compiled(self) -> Any:
        """The module stepping.compiled; None where it cannot be loaded."""
        return load_compiled()

    def takes(self, key: Any, like: Scenario, n: int) -> bool:
        """Whether n runs, all of their kind, are made together; if so, compiles what they need.

        Args:
            key: of the kind.
            like: one of the runs.
            n: how many there are.
        """
        return self._carries(key, [like] * min(n, KNOWN))

    def _carries(self, key: Any, jobs: list[Scenario]) -> bool:
        """Whether runs of a kind are made together; if so, compiles what they need."""
        if key not in self.carried:
            if self.known:
                return False
            self._count(key, jobs)
            if not self._repay(key, jobs):
                return False
            self.carried[key] = False
        if self.compiled is None:
            return False
        if not self.carried[key]:
            pattern = self.patterns.of(key, jobs[0])
            try:
                with self.compiled.first_call(carried, pattern.kind, "many runs of this kind"):
                    self.pool.lane().group(pattern, draws_of(jobs[:1]))
            except self.compiled.Unavailable:
                return False
            self.carried[key] = True
        return True

    def _count(self, key: Any, jobs: list[Scenario]) -> None:
        """Adds the time that making runs of a kind together would save."""
        if len(jobs) < FEWEST:
            return
        pattern = self.patterns.of(key, jobs[0])
        steps = 0.0 if is_ready(pattern.scene) else sum(s.t_max / s.dt for s in jobs)
        # half: runs tend to end before t_max
        time = ALONE * len(jobs) + 0.5 * saved_in_a_step(jobs[0]) * steps
        saved[pattern.kind] = saved.get(pattern.kind, 0.0) + time

    def _repay(self, key: Any, jobs: list[Scenario]) -> bool:
        """Whether runs of a kind, with those counted so far, repay code to make them together."""
        if len(jobs) < FEWEST:
            return False
        pattern = self.patterns.of(key, jobs[0])
        if not pattern.is_made or pattern.kind in carried:
            return pattern.is_made
        return outweighs(saved[pattern.kind], pattern.kind)

    def kernel(self, s: Scenario) -> Kernel:
        """How the steps of a run made alone are made; compiles them if needed.

        Args:
            s: what to run.
        """
        traits = scene.traits(s)
        with self.lock:
            if traits in self.kernels:
                return self.kernels[traits]
            known = traits in self.expected
            if not pays(s, self.expected.pop(traits, s.t_max / s.dt)):
                if known:
                    self.kernels[traits] = PLAIN
                return PLAIN
            self.kernels[traits] = self.compiled.KERNEL if self.compiled else PLAIN
            if self.compiled:
                self.compiled.warm(s)
            return self.kernels[traits]


carried: set[Any] = set()  # kinds whose code for many runs is compiled or loaded in this process
saved: dict[Any, float] = {}  # time that this would have saved so far, by kind [s]


def is_ready(kind: Any) -> bool:
    """Whether machine code for steps of a kind of scene is loaded.

    Args:
        kind: from machine_code.kind_of.
    """
    compiled = sys.modules.get("hapticclay.stepping.compiled")
    return compiled is not None and kind in compiled.ready


class _Records:
    """The results of a batch, in the order of its scenarios."""

    def __init__(self):
        self.found: list[Any] = []

    def put(self, first: int, results: Sequence[Any]) -> None:
        """Stores the results of consecutive runs.

        Args:
            first: index of the first run.
            results: of these runs.
        """
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
        """Stores the results of consecutive runs.

        Args:
            first: index of the first run.
            results: of these runs.
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


def checked_scenarios(scenarios: Iterable[Any], seen: set[Any]) -> Iterator[Scenario]:
    """The scenarios; a `Warning` names implausible values in the first WARNED kinds of scene.

    Args:
        scenarios: to check.
        seen: kinds of scene checked so far.

    Raises:
        ParameterError: one is not a Scenario.
    """
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


def _summaries_of(pool: BatchPool, plan: Plan, jobs: list[Job]) -> np.ndarray:
    """Summaries of runs.

    Args:
        pool: makes them.
        plan: how.
        jobs: what to run.
    """
    out, keys = np.zeros(len(jobs), SUMMARY), [j.key for j in jobs]
    together = any(key is not None for key in keys)
    done, left = pool.many([j.scenario for j in jobs], keys) if together else ([], range(len(jobs)))
    for places, fields in done:
        for name, values in fields.items():
            out[name][places] = values
    for i in left:
        s, key, kernel = jobs[i]
        out[i] = summary_entry(*pool.brief(s, kernel if key is None else plan.kernel(s)))
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

    Args:
        parts: of the batch.
        make: results of a part.
        put: receives the index of the first run of a part, and the results.
        threads: their number.
        stop: set when the batch ends early.
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
    """Entry of a run among summaries.

    Args:
        o: the outcome.
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
