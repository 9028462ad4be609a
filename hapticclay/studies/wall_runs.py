"""Stability of a wall by its steps: growth rate for a linear loop, rest after a push otherwise."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named
from ..errors import Bound
from ..fields import check_fields
from ..model.shapes import Constant
from ..model.spring import STIFFNESS_MAX
from ..scene.virtual_wall import VirtualWall
from ..simulation.batch import simulate_batch
from ..simulation.period_map import PeriodMaps
from ..simulation.record import Record
from . import boundary, growth
from .wall_lines import Wall, is_linear, moving_mass, wall_at

FEWEST_SAMPLES, MOST_SAMPLES = 300, 6000  # samples of a run whose growth is read
READ_SWINGS = 4.0  # periods of device and wall in such a run, at least
READ = 400  # samples of it that are read, about
SLOWEST = 1e-3  # modes slower than this share of sqrt(K/m) do not count as oscillation
GROWTH_STEPS, REST_STEPS = 16, 4  # least number of engine steps per sample
STEP_DECAY = 0.1  # largest share of its speed that the damper takes in a step
DEEPEST = 5e-3  # [m] depth to which the force presses into the wall, so that the arm moves straight
REST_SAMPLES = 1000  # of the first run that is judged by its rest
REST_SWINGS = 10.0  # its periods, at least
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


@named
@dataclass(frozen=True)
class Press:
    """The push that tests a wall with a nonlinear loop, and the criterion of rest.

    Attributes:
        force: force that presses into the wall from the start [N], 0 to 1e3: to at most 5 mm, and
            to the middle between two forces that the encoder can resolve, where rest is least
            likely.
        speed: impact speed of the device [m/s], 0 to 1.
        still: largest peak-to-peak motion that counts as rest [m], 1e-9 to 1e-2. A gripping hand
            feels less than 1 um at 150 to 200 Hz (Brisben, Hsiao, Johnson 1999).
    """

    force: Annotated[float, Bound(0.0, 1e3, "N")] = 1.0
    speed: Annotated[float, Bound(0.0, 1.0, "m/s")] = boundary.LARGE_PUSH
    still: Annotated[float, Bound(1e-9, 1e-2, "m")] = 1e-6

    def __post_init__(self):
        check_fields(self, "press.")


PRESS = Press()


def stiffest(
    walls: Sequence[Wall],
    exact: Sequence[float],
    softest: float,
    press: Press,
    show: Share,
) -> list[float]:
    """Largest stable K of each wall [N/m], by runs."""
    if is_linear(walls[0]):
        searches = [
            boundary.crossing_search(K if 0.0 < K < math.inf else softest, 0.1 * STIFFNESS_MAX)
            for K in exact
        ]
        return _side_by_side(
            searches, lambda i, K: wall_at(walls[i], K, _damping(walls[i])), _growth(), show
        )
    top = 0.3 * STIFFNESS_MAX
    return _side_by_side(
        [_rung_search(softest, top) for _ in walls],
        lambda i, K: wall_at(walls[i], K, _damping(walls[i])),
        lambda tried: come_to_rest(tried, press),
        show,
    )


def _growth() -> Callable[[Sequence[Any]], list[float]]:
    """`growth_rates` in a search."""
    return functools.partial(growth_rates, maps=PeriodMaps())


def _damping(wall: Wall) -> float:
    return wall.B if isinstance(wall, VirtualWall) else wall.b


def most_damping(wall: Wall, top: float, K: float, press: Press) -> float:
    """Largest stable B at a K [N.s/m], by runs."""
    if top == 0.0:
        return 0.0

    def tried(i: int, B: float) -> Wall:
        return wall_at(wall, K, B)

    if K == 0.0:
        search = boundary.crossing_search(top, 100.0 * top)
        return _side_by_side([search], tried, _growth())[0]
    search = _rung_search(1e-3 * top, 10.0 * top)
    return _side_by_side([search], tried, lambda walls: come_to_rest(walls, press))[0]


def _side_by_side(
    searches: Sequence[Search],
    wall: Callable[[int, float], Any],
    judge: Callable[[Sequence[Any]], Sequence[Any]],
    show: Share = unshown,
) -> list[float]:
    """Results of searches that each need one run at a time; a batch has one run of each search."""
    results = [math.nan] * len(searches)
    asked = {i: next(search) for i, search in enumerate(searches)}
    while asked:
        answers = judge([wall(i, x) for i, x in asked.items()])
        going = {}
        for i, answer in zip(asked, answers, strict=True):
            try:
                going[i] = searches[i].send(answer)
            except StopIteration as end:
                results[i] = end.value
        asked = going
        show(1.0 - len(asked) / len(searches))
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


def growth_rates(walls: Sequence[Wall], maps: PeriodMaps | None = None) -> list[float]:
    """Growth rate of the oscillation of each wall's linear loop [1/s].

    It is that of the map of a sample; that of a run where there is none.
    """
    maps = maps or PeriodMaps()
    rates = [_mapped_rate(wall, maps) for wall in walls]
    if left := [i for i, x in enumerate(rates) if math.isnan(x)]:
        for i, x in zip(left, _rates_of_runs([walls[i] for i in left]), strict=True):
            rates[i] = x
    return rates


def _mapped_rate(wall: Wall, maps: PeriodMaps) -> float:
    """The rate of a wall by its map; NaN for none."""
    if not isinstance(wall, VirtualWall):
        return growth.mapped_growth(wall.scenario(), wall.axis, maps)
    s = wall.scenario(wall.Ts, steps=growth_steps(wall))
    return growth.mapped_growth(s, "x", maps, growth_reading(wall)[2])


def _rates_of_runs(walls: Sequence[Wall]) -> list[float]:
    """The rates of walls, from one run each."""
    arms = [w for w in walls if isinstance(w, boundary.PushedLoop)]
    if arms:
        records = simulate_batch(w.scenario() for w in arms)
        how = growth.GROWTH_SAMPLE, growth.SLOWEST_MODE
        return [growth.growth_of_run(r, *how, w.axis) for r, w in zip(records, arms, strict=True)]
    bare = [w for w in walls if isinstance(w, VirtualWall)]
    steps = growth_steps(bare[0]) if bare else 1
    read = [growth_reading(w) for w in bare]
    records = simulate_batch(
        (
            w.scenario(n * w.Ts, push=boundary.SMALL_PUSH, steps=steps)
            for w, (n, *_) in zip(bare, read, strict=True)
        ),
        every=steps,
    )
    return [
        growth.growth_of_run(r, sample, slowest)
        for r, (_, sample, slowest) in zip(records, read, strict=True)
    ]


def growth_steps(wall: VirtualWall) -> int:
    """Engine steps per sample of a run for a growth rate."""
    return _engine_steps([wall], GROWTH_STEPS)


def growth_reading(wall: VirtualWall, span: float = 1.0) -> tuple[int, float, float]:
    """Parameters for the growth rate of a wall's oscillation, on the scale of its samples."""
    omega = math.sqrt((wall.K + wall.hand.spring) / moving_mass(wall))
    order = wall.velocity_window + wall.delay / wall.Ts
    n = max(
        FEWEST_SAMPLES + 12.0 * order,
        READ_SWINGS * math.tau / max(omega * wall.Ts, 1e-9) if omega else 0.0,
    )
    n = math.ceil(span * min(n, MOST_SAMPLES + 12.0 * order))
    kept = max(READ, 6.0 * order)
    return n, wall.Ts * max(1.0, n / kept), SLOWEST * omega


@checked
def settles(wall: VirtualWall, press: Press = PRESS) -> bool:
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
    if is_linear(wall):
        return growth_rates([wall])[0] <= 0.0
    return come_to_rest([wall], press)[0]


def come_to_rest(walls: Sequence[VirtualWall], press: Press = Press()) -> list[bool]:
    """Whether each wall comes to rest after a push, by one run each.

    A wall is at rest if its peak-to-peak motion in the last fifth of the run is at most
    `press.still`. While a larger oscillation decays, the run is extended, up to 64 times. Without
    an encoder, an oscillation that still decays at the end is stable, too. With an encoder it may
    end in a limit cycle of about a quantum, so the wall must come to rest.
    """
    rests: dict[int, bool] = {}
    steps = _engine_steps(walls, REST_STEPS)
    for span in REST_SPANS:
        left = [i for i in range(len(walls)) if i not in rests]
        jobs = [_pressed(walls[i], press, span, steps) for i in left]
        for i, record in zip(left, simulate_batch(jobs, every=steps), strict=True):
            (early, _), (late, creep) = (_swing(record, *window) for window in WINDOWS)
            quantum, last = walls[i].device.quantum, span == REST_SPANS[-1]
            chatters = late < ROUGH * quantum and span > 1.0
            keeps = late >= (ROUGH_KEPT if chatters else KEPT) * early
            if record.outcome.code in ("diverged", "out of reach", "singular"):
                rests[i] = False
            elif late <= press.still:
                rests[i] = True
            elif quantum and (last or (keeps and creep < late)):
                rests[i] = False
            elif not quantum and (last or late >= early):
                rests[i] = not keeps
    return [rests[i] for i in range(len(walls))]


def _pressed(wall: VirtualWall, press: Press, span: float, steps: int) -> Any:
    """The scenario of a wall pushed by a hand."""
    stiffness, quantum = wall.K + wall.hand.spring, wall.device.quantum
    force = min(press.force, DEEPEST * stiffness)
    if quantum and wall.K:
        force = (max(0, round(force / (wall.K * quantum) - 0.5)) + 0.5) * wall.K * quantum
    omega = math.sqrt(stiffness / moving_mass(wall))
    n = max(REST_SAMPLES, REST_SWINGS * math.tau / (omega * wall.Ts)) if omega else REST_SAMPLES
    n = math.ceil(span * min(n + wall.delay / wall.Ts, REST_MOST))
    muscle = Constant((force, 0.0)) if force else None
    return wall.scenario(n * wall.Ts, push=press.speed, muscle=muscle, steps=steps)


def _swing(record: Record, begin: float, end: float) -> tuple[float, float]:
    """Largest peak-to-peak motion in a part of a run, and the creep in one direction [m]."""
    n = len(record.p)
    x = record.p[int(begin * n) : max(int(end * n), int(begin * n) + 1), 0]
    back = np.max(np.maximum.accumulate(x) - x)
    forth = np.max(x - np.minimum.accumulate(x))
    return float(min(back, forth)), float(abs(x[-1] - x[0]))


def _engine_steps(walls: Sequence[VirtualWall], least: int) -> int:
    """Engine steps per sample: at least a given number, more where dampers are strong."""
    w = walls[0]
    decay = (w.device.damper + w.hand.damper) / moving_mass(w) * w.Ts
    most = max(1, math.floor(w.Ts / 1e-6))  # dt is 1 us at least
    return min(max(least, math.ceil(decay / STEP_DECAY), math.ceil(w.Ts / 0.02)), most)
