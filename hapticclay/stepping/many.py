"""Many short runs in one call of compiled code: what runs share is set up once.

A run of a hundred steps takes the engine 0.3 ms, and Python as long to set it up. Runs of one kind
have the same parts and differ in numbers alone. Each is a row of the numbers of its parts; `carry`
fills them in, begins the run, makes its steps and keeps its end. What it cannot judge, as an
unstable run, is made again by `run`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from . import begin, energy, monitor, path, rows
from .engine_step import put
from .state import NOT_FINITE, OPEN, UNRESOLVED, Filled

SUMMARY_CROSSINGS = 8  # crossings that a summary has room for


class Runs(NamedTuple):
    """Runs that `carry` makes, and what it keeps of each.

    Attributes:
        numbers: of their parts, see `numbers_of`, shape (n, m).
        tables: of their clay, shape (n, len(parts.table)).
        starts: position [m] and velocity [m/s] of the handle, (x, y) each, shape (n, 4).
        limits: of the engine's motors, shape (2, 2).
        reset: mj_resetData.
        rows: of the record, shape (m, rows.ROW).
        crossings: noted by steps, shape (m, 4).
        rendered: force of the clay [N] where b v does not tell it, shape (m, 3).
        good: 1 for a run that has nothing for the monitor, else 0, shape (n,).
        last: its last row, shape (n, rows.ROW).
        force: of the clay there [N], shape (n, 2).
        crossed: the first ones: coordinate, time [s], speed [m/s], shape (n, SUMMARY_CROSSINGS, 3).
        counts: number of all crossings, engine steps, last sample, code, shape (n, 4).
        times: end of the run [s], shape (n,).
        seen: counts of the monitor, see monitor.is_quiet, shape (n, 4).
        work: ledger, energies stored at the start and at the end [J], shape (n, 9).
        swings: workspace of monitor.is_quiet.
    """

    numbers: Any
    tables: Any
    starts: Any
    limits: Any
    reset: Any
    rows: Any
    crossings: Any
    rendered: Any
    good: Any
    last: Any
    force: Any
    crossed: Any
    counts: Any
    times: Any
    seen: Any
    work: Any
    swings: Any


def numbers_of(part: Any) -> list[float]:
    """The numbers of parts, in the order in which `filled` takes them.

    Args:
        part: the parts of a scene.
    """
    if isinstance(part, tuple):
        return [x for each in part for x in numbers_of(each)]
    return [float(part)] if isinstance(part, float | int) else []


def filled(like, numbers, k):
    """The parts of run k, which differ from those of `like` in numbers alone; compiled only."""
    raise NotImplementedError


def readied(parts, e, runs, k):
    """Readies the engine, the clay and the workspace for run k."""
    for j in range(len(parts.table)):
        parts.table[j] = runs.tables[k, j]
    for j in range(2):
        runs.limits[j, 0], runs.limits[j, 1] = -parts.limits[j], parts.limits[j]
        for i in range(monitor.QUIET):
            runs.swings[j, i] = 0.0
    runs.reset(e.model, e.data)
    put(e.timestep, 0, (parts.time.dt,))


def noted(runs, k, n):
    """Keeps the crossings of the steps just made."""
    for j in range(n):
        i = runs.counts[k, 0]
        if i < SUMMARY_CROSSINGS:
            found = runs.crossings[j]
            runs.crossed[k, i, 0], runs.crossed[k, i, 1] = found[0], found[2]
            runs.crossed[k, i, 2] = found[3]
        runs.counts[k, 0] = i + 1


def judged(parts, runs, k, s):
    """Judges the rows made; whether the run may go on without the monitor."""
    n, limit = s.filled.rows, parts.limits
    if s.status.code == NOT_FINITE or s.status.code == UNRESOLVED:
        return False
    if n == 0:
        return True
    if not monitor.is_quiet(runs.rows, n, limit[0], limit[1], runs.swings, runs.seen[k]):
        return False
    for j in range(rows.ROW):
        runs.last[k, j] = runs.rows[n - 1, j]
    for j in range(2):
        runs.force[k, j] = runs.rendered[n - 1, j] if len(runs.rendered) else 0.0
    return True


def ended(parts, runs, k, s, first):
    """Keeps the end of a run."""
    last, w = energy.stored(parts, s), s.work
    work = w.muscle, w.motors, w.clay, w.hand, w.through, first[0], first[1], last[0], last[1]
    for j in range(9):
        runs.work[k, j] = work[j]
    runs.counts[k, 2], runs.counts[k, 3] = s.clock.i, s.status.code
    runs.times[k] = s.clock.t


def carry(like, blocks, e, runs):
    """Makes runs one after the other.

    Args:
        like: parts of their kind; the table and whatever else steps write into is used by all.
        blocks: from scene.blocks.
        e: the engine.
        runs: what to run.
    """
    room = len(runs.rows)
    for k in range(len(runs.starts)):
        parts, x = filled(like, runs.numbers, k), runs.starts[k]
        readied(parts, e, runs, k)
        s = begin.begun(parts, blocks, e, (x[0], x[1]), (x[2], x[3]))
        first, good = energy.stored(parts, s), True
        while s.status.code == OPEN and good:
            s = path.advance(parts, s, e, room)
            made = s.filled
            noted(runs, k, made.crossings)
            if made.rows >= room or s.status.code != OPEN:
                good = judged(parts, runs, k, s)
                made = Filled(made.steps, 0, 0, 0)
            s = path.with_filled(s, Filled(0, made.rows, 0, 0))
            runs.counts[k, 1] += made.steps
        runs.good[k] = 1 if good else 0
        ended(parts, runs, k, s, first)
