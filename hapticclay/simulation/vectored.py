"""Runs that are advanced side by side: compiled by kind where that pays, else one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any

import numpy as np

from ..scene.scenario import Scenario
from ..stepping import scene
from ..stepping.monitor import Outcome
from ..stepping.rows import ROW
from ..stepping.run import CHUNK, PLAIN, EngineStore, Run, torque_reached
from ..stepping.state import OPEN
from ..stepping.vector import (
    BOTH,
    STEPS,
    TRY,
    Common,
    RunVector,
    is_vectored,
    kind_key,
    kind_of_steps,
)
from . import engines
from .engines import has_numba, load_compiled

PART = 200_000  # steps of a thread between two checks of the runs, and for Ctrl-C: half a second
VECTORS = 16  # kinds above which those without a run are dropped
LOOK = 0.02  # [s] of simulated time between two checks for divergence


class VectoredRuns:
    """Runs, and how each is advanced.

    Args:
        scenarios: of the runs.
        engine: as in `simulate`.
        workers: threads of compiled steps.
        monitored: whether their stability is judged.

    Attributes:
        runs: the runs.
        given: the scenario that each began with.
        force: constant muscle force of each that is in effect [N], shape (n, 2).
        gain: K of x and y of each that is in effect [1/kg], shape (n, 2).
        over: which have ended.
        common: what is known of each, see vector.Vector.
    """

    def __init__(self, scenarios: Sequence[Scenario], engine: str, workers: int, monitored: bool):
        n, self.monitored = len(scenarios), monitored
        self.engine, self.workers, self.engines = engine, workers, dict[Any, Any]()
        self.compiled: Any = load_compiled() if engine == "native" else None
        self.common, self.over = Common(n), np.zeros(n, bool)
        self.given, self.changed = list(scenarios), np.zeros(n, bool)
        self.force, self.steady, self.gain = np.zeros((3, n, 2))
        self.looked_at, self.diverging = np.full(n, -np.inf), np.zeros(n, bool)
        self.vectors: dict[Any, RunVector] = {}
        self.of: list[RunVector | None] = [None] * n
        self.asked = 0  # steps since the last check whether machine code pays
        self.pool: ThreadPoolExecutor | None = None
        self.is_shown = self.is_tried = self.is_asked = False
        stores = [EngineStore(self.engines) for _ in scenarios]
        self.runs = [self._new(s, x) for s, x in zip(scenarios, stores, strict=True)]
        for k in range(n):
            self._begin(k)

    def close(self) -> None:
        """Ends its threads."""
        if self.pool is not None:
            self.pool.shutdown()

    # ---- one run

    def _new(self, s: Scenario, store: EngineStore) -> Run:
        kernel = self.compiled.KERNEL if self.compiled else PLAIN
        kept = dict(watched=True, recorded=False, monitored=self.monitored)
        return Run(s, 1, kernel, store, **kept)

    def _begin(self, k: int) -> None:
        """Notes that a run is at its start."""
        c, s = self.common, self.given[k]
        self.over[k], self.changed[k] = False, False
        self.force[k], self.steady[k], self.gain[k] = s.force, scene.steady_force(s), s.gain
        self.looked_at[k], self.diverging[k] = -np.inf, False
        c.quiet[k], c.swings[k], c.seen[k] = 1, 0.0, (0, -1, -1, 0)
        c.times[k], c.marks[k], c.looked[k] = 0.0, (0, 0, OPEN, 0, 0, 0), 0
        if self.compiled or self.of[k]:
            self._place(k)
        self._unshow()

    def _place(self, k: int) -> None:
        """Puts a run among those of its kind, where they are compiled."""
        run = self.runs[k]
        self.of[k] = None
        if is_vectored(run):
            key = kind_key(run)
            if key not in self.vectors:
                if len(self.vectors) >= VECTORS:  # drop kinds without a run
                    kept = [(x, v) for x, v in self.vectors.items() if any(v is y for y in self.of)]
                    self.vectors = dict(kept)
                if (made := self._prepared(run)) is None:
                    return
                self.vectors[key] = made
            self.of[k] = self.vectors[key]
            self._take(k)

    def _take(self, k: int) -> None:
        v: Any = self.of[k]
        v.take(k, self.runs[k])
        v.push(np.array([k]), self.steady[[k]])

    def _prepared(self, run: Run) -> RunVector | None:
        """Compiles what the kind of a run needs, or loads it from disk; None if that fails."""
        compiled, none = load_compiled(), np.empty(0, np.int64)
        if compiled is None:
            return None
        v = RunVector(run, self.common, compiled.KERNEL)
        try:
            v.advance = compiled.advancing(v.kind, v.parts, v.state, v.place(0), v.x, none, STEPS)
        except compiled.Unavailable:
            return None
        return v

    def _sync(self, k: int) -> Run:
        """The run, with its present state, force and gain."""
        run, v = self.runs[k], self.of[k]
        if v is not None:
            v.give(k, run)
            gain = float(self.gain[k, 0]), float(self.gain[k, 1])
            if gain != run.scenario.gain:
                run.change_gain(gain)
            force = float(self.force[k, 0]), float(self.force[k, 1])
            if force != run.scenario.force:
                run.change_force(force)
        return run

    def scenario(self, k: int) -> Scenario:
        """The scenario of a run, with all that is now in effect.

        Args:
            k: its index.
        """
        return self._sync(k).scenario

    def restart(self, k: int, scenario: Scenario | None) -> None:
        """Restarts a run.

        Args:
            k: its index.
            scenario: what to run; None for the same.
        """
        run = self.runs[k]
        if scenario is None and not self.changed[k] and is_vectored(run):
            run.restart()
            if run.scenario is not self.given[k]:
                run.scenario = self.given[k]
                run.push_evenly((0.0, *scene.steady_force(run.scenario), 0.0, 0.0))
        else:
            self.given[k] = scenario or self.given[k]
            self.runs[k] = self._new(self.given[k], run.store)
            self.runs[k].kernel = run.kernel
        self._begin(k)

    def change(self, k: int, change: Callable[[Scenario], Scenario]) -> None:
        """Continues with other numbers, unless the run has ended.

        Args:
            k: index of the run.
            change: makes its scenario another one.
        """
        if self.over[k]:
            return
        run = self._sync(k)
        run.change(change(run.scenario))
        self.changed[k] = True
        self._unshow()
        if self.of[k]:
            self._place(k)

    def set_gain(self, which: np.ndarray, gain: np.ndarray) -> None:
        """Continues with other gains, in runs that have not ended.

        Args:
            which: indices of runs.
            gain: K of x and y of each [1/kg], shape (len(which), 2).
        """
        other = (gain != self.gain[which]).any(axis=1) & ~self.over[which]
        which, gain = which[other], gain[other]
        if not len(which):
            return
        self.gain[which], self.changed[which] = gain, True
        self._unshow()
        for v, ks in self._groups(which):
            if v is not None and scene.takes_gain(v.parts):
                v.set_gain(ks, self.gain[ks])
                continue
            for k in ks.tolist():
                self._sync(k).change_gain((float(self.gain[k, 0]), float(self.gain[k, 1])))
                if v is not None:
                    self._place(k)

    # ---- steps

    def push(self, which: np.ndarray, force: np.ndarray) -> None:
        """Sets constant muscle forces.

        Args:
            which: indices of runs.
            force: of each [N], shape (len(which), 2).
        """
        other = (force != self.force[which]).any(axis=1)
        which, force = which[other], force[other]
        if not len(which):
            return
        self.force[which] = force
        self._unshow()
        for k in which.tolist():
            muscle = self.given[k].muscle
            self.steady[k] = self.force[k]
            if muscle is not None and not muscle.varies:
                self.steady[k] += muscle(0.0)
            if self.of[k] is None:
                self.runs[k].change_force((float(self.force[k, 0]), float(self.force[k, 1])))
        for v, ks in self._groups(which):
            if v is not None:
                v.push(ks, self.steady[ks])

    def _groups(self, which: np.ndarray) -> list[tuple[RunVector | None, np.ndarray]]:
        """Runs by their vector; None for those that are advanced one by one."""
        found: dict[int, tuple[RunVector | None, list[int]]] = {}
        for k in which.tolist():
            v = self.of[k]
            found.setdefault(id(v), (v, []))[1].append(k)
        return [(v, np.array(ks)) for v, ks in found.values()]

    def advance(self, which: np.ndarray, n: int) -> None:
        """Makes steps of runs that have not ended.

        Args:
            which: their indices.
            n: number of steps.
        """
        if not len(which):
            return
        self._choose(which, n)
        self._unshow()
        for v, ks in self._groups(which):
            if v is not None:
                self._draw(v, ks, n)
        # a caller that reads samples will read the next
        both = self.is_asked and len(which) == len(self.over) - self.over.sum()
        goal, left = self.common.marks[:, 0] + n, which
        while len(left):
            part = max(1, self.workers * PART // len(left))
            self.common.until[left] = np.minimum(goal[left], self.common.marks[left, 0] + part)
            last = both and (self.common.until[left] == goal[left]).all()
            self._move(left, BOTH if last else STEPS)
            marks = self.common.marks[left]
            for k in left[(marks[:, 2] != OPEN) | (marks[:, 1] >= CHUNK - 1)].tolist():
                self._settle(k)
            left = left[~self.over[left] & (self.common.marks[left, 0] < goal[left])]
        self.is_tried, self.is_asked = both, False

    def _unshow(self) -> None:
        """Discards the sample of a run that has changed."""
        self.is_shown = self.is_tried = False

    def _draw(self, v: RunVector, which: np.ndarray, n: int) -> None:
        """Draws the random effects of the next n steps, and of the one that is then tried."""
        sampler = v.parts.sampler
        if sampler is None or sampler.chance is None:
            return
        for k in which.tolist():
            run = self.runs[k]
            before = run.parts
            v.give(k, run)
            run.draw(n + 2 * sampler.ratio)
            if run.parts is not before:
                self._take(k)

    def _move(self, which: np.ndarray, ahead: int) -> None:
        """Makes steps up to `until`, tries the next one, or both."""
        jobs = []
        for v, ks in self._groups(which):
            if v is None:
                for k in ks.tolist():
                    self._one(k, ahead)
            else:
                count = min(self.workers, len(ks))
                jobs += [
                    (i, v, v.place(i), part) for i, part in enumerate(np.array_split(ks, count))
                ]
        if len(jobs) == 1:
            self._work(jobs, ahead)
        elif jobs:
            self._on_threads(jobs, ahead)

    def _work(self, jobs: list[Any], ahead: int) -> None:
        for _, v, place, part in jobs:
            v.advance(v.parts, v.state, place, v.x, part, ahead)

    def _on_threads(self, jobs: list[Any], ahead: int) -> None:
        """Makes the jobs of each thread; an exception is raised once all are done."""
        if self.pool is None:
            self.pool = ThreadPoolExecutor(self.workers)
        work = [[j for j in jobs if j[0] == i] for i in range(self.workers)]
        futures = [self.pool.submit(self._work, x, ahead) for x in work if x]
        try:
            wait(futures)
        finally:
            for x in futures:
                x.result()

    def _one(self, k: int, ahead: int) -> None:
        """Advances a run that is advanced alone."""
        run, c = self.runs[k], self.common
        run.resume()
        if ahead != TRY:
            run.pause = c.until[k]
            run.go(None)
            c.quiet[k], c.times[k], c.marks[k, :3] = 0, run.t, (run.i, run.filled, run.code)
        if run.outcome is not None:
            self._end(k, run)
        elif ahead != STEPS:
            c.shown[k] = run.ahead()

    def _settle(self, k: int) -> None:
        """Judges the rows of a compiled run: they are full, or it is over."""
        run, v = self.runs[k], self.of[k]
        if v is None or self.over[k]:
            return
        self._sync(k)
        run.note_end()
        run.flush()
        v.take_state(k, run)
        if run.outcome is not None:
            self._end(k, run)

    def _end(self, k: int, run: Run) -> None:
        """Stores the last sample of a run that has ended."""
        c = self.common
        self.over[k] = True
        if run.last_row is None:
            c.times[k], c.shown[k] = np.nan, np.nan
            return
        c.times[k], c.shown[k, :ROW] = run.sample_time(), run.last_row
        c.shown[k, ROW:] = run.last_force()

    # ---- results

    def show(self) -> np.ndarray:
        """The present samples, shape (n, SHOWN)."""
        if not self.is_shown:
            live = self._groups(np.flatnonzero(~self.over))
            vectors = [(v, ks) for v, ks in live if v is not None]
            if not self.is_tried:
                for v, ks in vectors:
                    self._draw(v, ks, 1)
                self._move(np.flatnonzero(~self.over), TRY)
            for v, ks in vectors:
                self.common.shown[ks, ROW:] = v.force(ks)
            self.is_shown = self.is_asked = True
        return self.common.shown

    def torque_reached(self, n: int, k: int) -> np.ndarray:
        """As `run.torque_reached`, in the last rows of each run, shape (runs, 2).

        Args:
            n: number of rows, of those not judged yet.
            k: how many reach it.
        """
        filled = self.common.marks[:, 1].tolist()
        pairs = zip(self.runs, filled, strict=True)
        return np.array([torque_reached(x.store.rows[max(i - n, 0) : i], k) for x, i in pairs])

    def look(self) -> np.ndarray:
        """Whether the motion of each run is unstable by now, evaluated again after LOOK."""
        due = ~self.over & (self.common.times >= self.looked_at + LOOK)
        self.looked_at[due] = self.common.times[due]
        self.diverging[due] = False
        for k in np.flatnonzero(due & (self.common.quiet == 0)).tolist():
            self.diverging[k] = self._sync(k).is_diverging()
        onset = [run.watch.onset is not None for run in self.runs]
        return self.diverging | np.array(onset, bool)

    @property
    def outcomes(self) -> list[Outcome | None]:
        """How each run ended."""
        return [run.outcome for run in self.runs]

    # ---- machine code

    def _choose(self, which: np.ndarray, n: int) -> None:
        """Switches to machine code for the runs whose steps repay it."""
        if self.engine != "auto" or not has_numba():
            return
        self.asked += n * len(which)
        if self.asked < CHUNK:
            return
        self.asked = 0
        kinds: dict[Any, list[int]] = {}
        for k in which.tolist():
            if self.of[k] is None and self.runs[k].kernel is PLAIN:
                kinds.setdefault(kind_key(self.runs[k]), []).append(k)
        for ks in kinds.values():
            self._choose_kind(ks, n)

    def _choose_kind(self, ks: list[int], n: int) -> None:
        if not repay(self.runs[ks[0]], float(n * len(ks))):
            return
        self.compiled = self.compiled or load_compiled()
        if self.compiled is None:
            self.engine = "python"
            return
        for k in ks:
            self.runs[k].kernel = self.compiled.KERNEL
            self._place(k)


def repay(run: Run, steps: float) -> bool:
    """Whether machine code repays loading or compiling it, for runs that are advanced in loops.

    Args:
        run: one of them.
        steps: number of steps of its kind that are about to be made.
    """
    if not is_vectored(run):
        return engines.pays(run.scenario, steps)
    more = 0.5 * engines.saved_in_a_step(run.scenario) * steps
    return engines.repays_with(kind_of_steps(run.kind, run.state), more)
