"""Stability of a wall by its steps: growth rate for a linear loop, rest after a push otherwise."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Generator, Sequence
from typing import Any

import numpy as np

from ..arguments import checked
from ..model.spring import STIFFNESS_MAX
from ..scene.virtual_wall import VirtualWall
from ..simulation.batch import simulate_batch
from ..simulation.period_map import PeriodMaps
from ..simulation.record import Record
from . import boundary, growth
from .wall import REST_STEPS, Press, Subject, Wall, as_wall

REST_SPANS = (1.0, 4.0, 16.0, 64.0)  # longer while a swing decays, or the device creeps
REST_MOST = 20_000  # samples of that first run, at most
WINDOWS = ((0.4, 0.6), (0.8, 1.0))  # parts of a run whose swings are compared
KEPT = 0.97  # an oscillation that keeps this share from one part to the next is sustained
ROUGH_KEPT = 0.8  # the same for one within ROUGH quanta, whose amplitude is irregular
ROUGH = 10.0
RUNG = 3.0  # ratio of successive K of the search
EDGE_CLOSE = 5e-3  # relative accuracy of the boundary between rest and oscillation
Search = Generator[float, Any, float]
Share = Callable[[float], None]


def unshown(share: float) -> None:
    """Ignores the progress."""


BY_DEFAULT = Press()
PRESS = Press(still=1e-6)  # what a hand feels, whatever the encoder sees: of labs and classics


def stiffest(
    walls: Sequence[Wall | Subject],
    exact: Sequence[float],
    softest: float,
    press: Press,
    show: Share,
) -> list[float]:
    """Largest stable K of each wall [N/m], by runs."""
    walls = [as_wall(wall) for wall in walls]
    if walls[0].linear:
        judge = growth_judge()
        searches = [
            boundary.crossing_search(K if 0.0 < K < math.inf else softest, 0.1 * STIFFNESS_MAX)
            for K in exact
        ]
    else:
        judge = functools.partial(come_to_rest, press=press)
        searches = [_rung_search(softest, 0.3 * STIFFNESS_MAX) for _ in walls]
    return _side_by_side(searches, lambda i, K: walls[i].at(K, walls[i].damping), judge, show)


def growth_judge() -> Callable[[Sequence[Wall]], list[float]]:
    """`growth_rates` in a search, whose maps share engines."""
    return functools.partial(growth_rates, maps=PeriodMaps())


def most_damping(wall: Wall, top: float, K: float, press: Press) -> float:
    """Largest stable B at a K [N.s/m], by runs."""
    if top == 0.0:
        return 0.0

    if K == 0.0:
        search, judge = boundary.crossing_search(top, 100.0 * top), growth_judge()
    else:
        search = _rung_search(1e-3 * top, 10.0 * top)
        judge = functools.partial(come_to_rest, press=press)
    return _side_by_side([search], lambda _, B: wall.at(K, B), judge)[0]


def _side_by_side(
    searches: Sequence[Search],
    wall: Callable[[int, float], Any],
    judge: Callable[[Sequence[Any]], Sequence[Any]],
    show: Share = unshown,
) -> list[float]:
    """Results of searches that each need one run at a time; a batch has one run of each search."""
    results = [math.nan] * len(searches)
    pending = {i: next(search) for i, search in enumerate(searches)}
    while pending:
        answers = judge([wall(i, x) for i, x in pending.items()])
        remaining = {}
        for i, answer in zip(pending, answers, strict=True):
            try:
                remaining[i] = searches[i].send(answer)
            except StopIteration as end:
                results[i] = end.value
        pending = remaining
        show(1.0 - len(pending) / len(searches))
    return results


def _rung_search(start: float, most: float) -> Search:
    """Yields x from start upwards, receives whether it rests, and returns the largest x at rest.

    The first x that does not rest ends the ascent; a bisection follows.
    """
    low, high = 0.0, start
    while (yield high):
        low, high = high, RUNG * high
        if low > most:
            return math.inf
    while low and high / low > 1.0 + EDGE_CLOSE:
        middle = math.sqrt(low * high)
        if (yield middle):
            low = middle
        else:
            high = middle
    return low


def growth_rates(walls: Sequence[Wall | Subject], maps: PeriodMaps | None = None) -> list[float]:
    """Growth rate of the oscillation of each wall's linear loop [1/s].

    It is that of the map of a sample; that of a run where there is none.
    """
    maps = maps or PeriodMaps()
    found = [(wall.axis, wall.growth_run()) for wall in map(as_wall, walls)]
    rates = [growth.mapped_growth(x.scenario, axis, maps, x.slowest) for axis, x in found]
    left = [i for i, x in enumerate(rates) if math.isnan(x)]
    for every in sorted({found[i][1].every for i in left}):
        some = [i for i in left if found[i][1].every == every]
        records = simulate_batch((found[i][1].scenario for i in some), every=every)
        for i, record in zip(some, records, strict=True):
            axis, x = found[i]
            rates[i] = growth.growth_of_run(record, x.sample, x.slowest, axis)
    return rates


@checked
def settles(wall: VirtualWall, press: Press = BY_DEFAULT) -> bool:
    """Whether a wall is stable in a run, with the friction, encoder and surface of its device.

    This is the verdict of `zwidth` on one wall. A linear loop settles if its oscillation decays.
    Any other wall must come to rest after a push: see `Press`. `stable_wall` judges the linear loop
    alone, which may be stable where an encoder keeps the wall from rest.

    Args:
        wall: the wall with its K.
        press: push and criterion of rest for a loop that is not linear.

    Raises:
        ParameterError: wall is not a wall, or a value is out of its bounds.
    """
    if as_wall(wall).linear:
        return growth_rates([wall])[0] <= 0.0
    return come_to_rest([wall], press)[0]


def come_to_rest(subjects: Sequence[Wall | Subject], press: Press = BY_DEFAULT) -> list[bool]:
    """Whether each wall comes to rest after a push, by one run each.

    A wall is at rest if its peak-to-peak motion in the last fifth of the run is at most
    `press.rest`. While a larger oscillation decays, the run is extended, up to 64 times. Without
    an encoder, an oscillation that still decays at the end is stable, too. With an encoder it may
    end in a limit cycle of about a quantum, so the wall must come to rest.
    """
    rests: dict[int, bool] = {}
    walls = [as_wall(wall) for wall in subjects]
    steps = walls[0].engine_steps(REST_STEPS)
    for span in REST_SPANS:
        left = [i for i in range(len(walls)) if i not in rests]
        jobs = [walls[i].rest_run(press, span, steps) for i in left]
        for i, record in zip(left, simulate_batch(jobs, every=steps), strict=True):
            (early, _), (late, creep) = (_swing(record, *window) for window in WINDOWS)
            quantum, last = walls[i].quantum, span == REST_SPANS[-1]
            chatters = late < ROUGH * quantum and span > 1.0
            keeps = late >= (ROUGH_KEPT if chatters else KEPT) * early
            if record.outcome.code in ("diverged", "out of reach", "singular"):
                rests[i] = False
            elif late <= press.rest(quantum):
                rests[i] = True
            elif quantum and (last or (keeps and creep < late)):
                rests[i] = False
            elif not quantum and (last or late >= early):
                rests[i] = not keeps
    return [rests[i] for i in range(len(walls))]


def _swing(record: Record, begin: float, end: float) -> tuple[float, float]:
    """Largest peak-to-peak motion in a part of a run, and the creep in one direction [m]."""
    n = len(record.p)
    x = record.p[int(begin * n) : max(int(end * n), int(begin * n) + 1), 0]
    back = np.max(np.maximum.accumulate(x) - x)
    forth = np.max(x - np.minimum.accumulate(x))
    return float(min(back, forth)), float(abs(x[-1] - x[0]))
