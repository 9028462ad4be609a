"""Runs that are advanced side by side, each as a row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from ..kernel import layout, mover, movers, path, records, scene
from ..kernel.native import machine
from ..kernel.row import CHUNK, SHOWN, one
from ..scene.scenario import Scenario
from .crew import Crew, outlast
from .monitor import Outcome
from .run import Run, Workspace

PART = 200_000  # steps of a thread between two checks of the runs, and for Ctrl-C: half a second
LOOK = 0.02  # [s] of simulated time between two checks for divergence


class VectoredRuns:
    """Runs without a record, and their rows; compiled steps are made by `workers` threads.

    As of a `Run`, what an interrupted call left half done is `pending`, and `mend` completes it.
    Interrupted steps end where they are, each run at a sample of its own.

    Attributes:
        runs: the runs.
        over: which have ended, shape (n,).
        given: the scenario that each began with.
        shown: the present samples, shape (n, SHOWN), of the runs in `is_shown`, shape (n,).
    """

    def __init__(self, scenarios: Sequence[Scenario], engine: str, workers: int, monitored: bool):
        n, self.monitored, self.engine, self.workers = len(scenarios), monitored, engine, workers
        self.over, self.changed = np.zeros(n, bool), np.zeros(n, bool)
        self.given = list(scenarios)
        self.force, self.gain = np.zeros((2, n, 2))
        self.looked_at, self.diverging = np.full(n, -np.inf), np.zeros(n, bool)
        self.shown, self.is_shown = np.zeros((n, SHOWN)), np.zeros(n, bool)
        self.times, self.rooms = np.zeros(n), np.zeros(n, np.int64)
        self.prepares = np.zeros(n, bool)  # which cannot advance together
        self.takes_gain = np.zeros(n, bool)  # whose gains are nothing but two numbers of the model
        self.movers = [movers.Movers() for _ in range(workers)]
        self.crew, self.pending = Crew(workers), ()
        native = engine == "native"
        self.models: Any = np.zeros(n * native, layout.dtype_of(records.Model))
        self.states: Any = np.zeros(n * native, layout.dtype_of(records.State))
        self.spares = [one(records.State) for _ in range(workers * native)]
        self.engines = np.zeros((workers, n), np.int64)  # addresses, by thread and run
        self.kept: list[list[mover.Mover]] = [[] for _ in scenarios]  # what lies there
        self.runs = [self._new(k, s, Workspace(self.movers[0])) for k, s in enumerate(scenarios)]
        for k in range(n):
            self._begin(k)

    def close(self) -> None:
        """Ends its threads."""
        self.crew.end()

    # ---- interruptions

    def mend(self, but: Sequence[int] = ()) -> None:
        """Waits for threads that are still at work, and completes what was left half done.

        but: runs that are about to restart.

        Raises:
            RuntimeError: a step of another run was interrupted within, see `Run.mend`.
        """
        self._end_work()
        if self.pending:
            name, *arguments = self.pending
            getattr(self, name)(*arguments)
        for k, run in enumerate(self.runs):
            if k not in but and not self.over[k]:
                self._mend_run(k, run)
        self.is_shown[:] = self.over
        self.pending = ()

    def _end_work(self) -> None:
        if self.crew.is_at_work:
            self.models["halts"] = 1
            self.crew.end()
        if len(self.models):
            self.models["halts"] = 0

    def _mend_run(self, k: int, run: Run) -> None:
        """Brings a run to a sample, and its entries of this to the run."""
        try:
            run.mend()
        except RuntimeError as error:
            raise RuntimeError(f"run {k}: {error}") from None
        if run.outcome is not None:
            self._end(k, run)
        elif run.row.s.code != path.OPEN or run.filled >= CHUNK - 1:
            self._settle(k)
        if not self.over[k]:
            self.times[k] = run.t

    # ---- one run

    def _new(self, k: int, s: Scenario, workspace: Workspace) -> Run:
        at = (self.models[k : k + 1], self.states[k : k + 1]) if len(self.models) else None
        kept = dict(keep_for_monitor=True, recorded=False, monitored=self.monitored)
        return Run(s, 1, self.engine, workspace, at, **kept)

    def _begin(self, k: int) -> None:
        """Notes that a run is at its start."""
        s, run = self.given[k], self.runs[k]
        self.over[k], self.changed[k], self.times[k] = False, False, 0.0
        self.force[k], self.gain[k] = s.force[:2], s.gain
        self.looked_at[k], self.diverging[k] = -np.inf, False
        if self.engine == "native":
            self.kept[k] = [x.of(s) for x in self.movers]
            self.engines[:, k] = [x.row.ctypes.data for x in self.kept[k]]
        self.prepares[k], self.is_shown[k] = run.prepares, False
        self.takes_gain[k] = scene.takes_gain(run.row.m)

    def _sync(self, k: int) -> Run:
        """The run, whose scenario has the present force and gain."""
        run = self.runs[k]
        force, gain = tuple(self.force[k].tolist()), tuple(self.gain[k].tolist())
        if gain != run.scenario.gain:
            run.change_gain(gain)
        if force != run.scenario.force[:2]:
            run.change_force((*force, *run.scenario.force[2:]))
        return run

    def scenario(self, k: int) -> Scenario:
        """The scenario of a run, with all that is now in effect."""
        return self._sync(k).scenario

    def restart(self, which: Sequence[int], scenarios: Sequence[Scenario | None]) -> None:
        """Restarts runs, in other scenarios where there are any."""
        self.pending = "restart", which, scenarios
        try:
            for k, scenario in zip(which, scenarios, strict=True):
                self._restart(k, scenario)
        except Exception:  # a scenario is refused: the runs before it have restarted
            self.pending = ()
            raise
        self.pending = ()

    def _restart(self, k: int, scenario: Scenario | None) -> None:
        run = self.runs[k]
        if scenario is None and not self.changed[k] and not run.prepares:
            run.restart()
            run.scenario = self.given[k]
            run.push_steadily()
        else:
            scenario = scenario or self.given[k]
            self.runs[k] = self._new(k, scenario, run.workspace)
            self.given[k] = scenario
        self._begin(k)

    def change(self, k: int, change: Callable[[Scenario], Scenario]) -> None:
        """Continues with other numbers, unless the run has ended."""
        if self.over[k]:
            return
        self.changed[k], self.is_shown[k] = True, False
        run = self._sync(k)
        run.change(change(run.scenario))

    def set_gain(self, which: np.ndarray, gain: np.ndarray) -> None:
        """Continues with other gains, in runs that have not ended."""
        other = (gain != self.gain[which]).any(axis=1) & ~self.over[which]
        self._put_gain(which[other], gain[other])

    def _put_gain(self, which: np.ndarray, gain: np.ndarray) -> None:
        self.pending = "_put_gain", which, gain
        self.gain[which], self.changed[which] = gain, True
        self.is_shown[which] = False
        plain = self.takes_gain[which]
        if len(self.models):
            self.models["axis"]["K"][which[plain], :2] = gain[plain]
            which = which[~plain]
        for k in which.tolist():
            self._sync(k)
        self.pending = ()

    # ---- steps

    def push(self, which: np.ndarray, force: np.ndarray) -> None:
        """Sets constant muscle forces."""
        other = (force != self.force[which]).any(axis=1)
        which, force = which[other], force[other]
        if not len(which):
            return
        self._put_force(which, force)

    def _put_force(self, which: np.ndarray, force: np.ndarray) -> None:
        self.pending = "_put_force", which, force
        self.force[which], self.is_shown[which] = force, False
        steady = force.copy()
        for j, k in enumerate(which.tolist()):
            muscle = self.given[k].muscle
            if muscle is not None and not muscle.varies:
                steady[j] += muscle(0.0)
        if len(self.models):
            self.models["axis"]["push"][which, :2] = steady
            self.models["push_since"][which], self.models["axis"]["push_rate"][which] = 0.0, 0.0
        else:
            for k, f in zip(which.tolist(), steady.tolist(), strict=True):
                self.runs[k].push_evenly((0.0, *f, 0.0, 0.0))
        self.pending = ()

    def advance(self, which: np.ndarray, n: int, shows: bool = False) -> None:
        """Makes steps of runs that have not ended; `shows`: their samples will be asked for."""
        if not len(which):
            return
        self.pending = ("stop",)
        self.is_shown[which] = False
        alone, together = self._split(which)
        for k in alone.tolist():
            self._one(k, n)
        self._draw(together, n + shows)
        self._together(together, n, shows)
        self.pending = ()

    def stop(self) -> None:
        """Ends interrupted steps where they are: `mend` brings each run to its sample."""

    def _split(self, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Runs that advance one by one, in Python or with something to prepare, and the others."""
        alone = self.prepares[which] if self.engine == "native" else np.ones(len(which), bool)
        return which[alone], which[~alone]

    def _draw(self, which: np.ndarray, n: int) -> None:
        """Draws what the hardware of runs leaves to chance in the next n steps."""
        for k in which[self.models["chance"][which] != 0].tolist():
            self.runs[k].draw(n)

    def _one(self, k: int, n: int) -> None:
        """Advances a run by itself."""
        run = self.runs[k]
        run.pause = run.i + n
        run.go(None)
        self.times[k] = run.t
        if run.outcome is not None:
            self._end(k, run)

    def _together(self, which: np.ndarray, n: int, shows: bool) -> None:
        """Advances rows in one call of each thread, which may show them in the same turn."""
        if not len(which):
            return
        states, left, work = self.states, which, self._show if shows else self._advance
        goal = states["i"] + n
        while len(left):
            part = max(1, self.workers * PART // len(left))
            more = np.minimum(goal[left] - states["i"][left], part)
            self.rooms[left] = np.minimum(states["row"][left] + more, CHUNK - 1)
            self._call(work, left)
            done = (states["code"][left] != path.OPEN) | (states["row"][left] >= CHUNK - 1)
            for k in left[done].tolist():
                self._settle(k)
            left = left[~self.over[left]]
            left = left[states["i"][left] < goal[left]]
        self.is_shown[which] = shows
        self.times[which] = np.where(self.over[which], self.times[which], states["t"][which])

    def _at(self, which: np.ndarray) -> tuple[int, int, int, int]:
        """Rows as compiled code takes them."""
        return self.models.ctypes.data, self.states.ctypes.data, which.ctypes.data, len(which)

    def _advance(self, thread: int, which: np.ndarray) -> None:
        machine().advance(*self._at(which), self.rooms.ctypes.data, self.monitored)

    def _show(self, thread: int, which: np.ndarray) -> None:
        self._advance(thread, which)
        self._peek(thread, which)

    def _peek(self, thread: int, which: np.ndarray) -> None:
        machine().peek(*self._at(which), self.spares[thread].ctypes.data, self.shown.ctypes.data)

    def _call(self, work: Callable[[int, np.ndarray], None], which: np.ndarray) -> None:
        """Does work for rows, a part of them in each thread; raises once all is done."""
        parts = np.array_split(which, min(self.workers, len(which)))
        for thread, part in enumerate(parts):
            self.models["engine"][part] = self.engines[thread, part]
        try:
            self.crew.do([partial(work, thread, part) for thread, part in enumerate(parts)])
        except BaseException:
            outlast(self._end_work)
            raise

    def _settle(self, k: int) -> None:
        """Judges the rows of a run: they are full, or it is over."""
        run = self._sync(k)
        run.settle()
        if run.outcome is not None:
            self._end(k, run)

    def _end(self, k: int, run: Run) -> None:
        """Stores the last sample of a run that has ended."""
        self.over[k], self.shown[k] = True, run.ending()[:SHOWN]
        self.times[k] = np.nan if run.last is None else run.sample_time()

    # ---- results

    def show(self) -> np.ndarray:
        """The present samples, shape (n, SHOWN)."""
        stale = np.flatnonzero(~(self.over | self.is_shown))
        if len(stale):
            self.pending = ("stop",)
            alone, together = self._split(stale)
            for k in alone.tolist():
                self.shown[k] = self.runs[k].ahead()[:SHOWN]
            if len(together):
                self._draw(together, 1)
                self._call(self._peek, together)
            self.is_shown[stale] = True
            self.pending = ()
        return self.shown

    def torque_reached(self, n: int, k: int) -> np.ndarray:
        """As `Run.torque_reached`, shape (runs, 2)."""
        return np.array([run.torque_reached(n, k) for run in self.runs])

    def strained(self, n: int, limits: Sequence[float]) -> np.ndarray:
        """As `Run.strained`, shape (runs, 2)."""
        if not len(self.models):
            return np.array([run.strained(n, limits) for run in self.runs])
        which, found = np.arange(len(self.runs)), np.zeros((len(self.runs), 2), np.int64)
        machine().strained(*self._at(which), n, *limits, found.ctypes.data)
        return found

    def look(self) -> np.ndarray:
        """Whether the motion of each run is unstable by now, evaluated again after LOOK."""
        due = ~self.over & (self.times >= self.looked_at + LOOK)
        self.looked_at[due] = self.times[due]
        self.diverging[due] = False
        quiet = self.states["watch"]["quiet"] if len(self.states) else np.zeros(len(due))
        for k in np.flatnonzero(due & (quiet == 0)).tolist():
            self.diverging[k] = self._sync(k).is_diverging()
        onset = [run.watch.onset is not None for run in self.runs]
        return self.diverging | np.array(onset, bool)

    @property
    def outcomes(self) -> list[Outcome | None]:
        """How each run ended."""
        return [run.outcome for run in self.runs]
