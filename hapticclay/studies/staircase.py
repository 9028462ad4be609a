"""Just-noticeable differences by a staircase, on an observer whose threshold is known.

Transformed up-down: Levitt, J. Acoustical Society of America 49, 1971. Weighted steps: Kaernbach,
Perception & Psychophysics 49, 1991.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named, part
from ..errors import Bound, ParameterError, integer, number
from ..fields import Seed
from ..results import Result

NORMAL = NormalDist()
MOST_TRIALS = 100_000  # of a staircase
MOST_LEVEL = 1e6

Stimulus = Callable[[float], float]


@part("observer.")
class Observer:
    """A simulated observer that answers at random with a known psychometric function.

    A difference x is noticed with probability lapse/2 + (1 - lapse) Phi((x - threshold)/spread).

    Attributes:
        threshold: difference noticed in half of the trials, > 0, in the unit of the stimulus.
        spread: standard deviation of the noise within the observer, > 0, in the same unit.
        lapse: share of guessed answers, 0 to 0.5.
    """

    threshold: Annotated[float, Bound(0.0, MOST_LEVEL, above=True)] = 0.08
    spread: Annotated[float, Bound(0.0, MOST_LEVEL, above=True)] = 0.03
    lapse: Annotated[float, Bound(0.0, 0.5)] = 0.0

    def notices(self, x: float) -> float:
        """Probability that a difference is noticed.

        Args:
            x: the difference.
        """
        seen = NORMAL.cdf((x - self.threshold) / self.spread)
        return 0.5 * self.lapse + (1.0 - self.lapse) * seen

    def difference(self, share: float) -> float:
        """The difference noticed in a share of the trials.

        Args:
            share: lapse/2 to 1 - lapse/2, both excluded.

        Raises:
            ParameterError: no difference is noticed so often.
        """
        half = 0.5 * self.lapse
        if not half < share < 1.0 - half:
            raise ParameterError("share", share, f"must lie between {half:g} and {1.0 - half:g}")
        return self.threshold + self.spread * NORMAL.inv_cdf((share - half) / (1.0 - self.lapse))


@part("staircase.")
class Staircase:
    """A staircase: the difference falls after several hits in a row, and rises after a miss.

    Attributes:
        down: noticed trials in a row before the difference falls, 1 to 10.
        fall: step down, > 0, in the unit of the stimulus.
        rise: step up, > 0; equal steps are Levitt's, others Kaernbach's.
        start: difference of the first trial, >= 0.
        reversals: number of turns at which it ends, 2 to 10000.
        skipped: turns at the start that do not count, less than reversals.
    """

    down: Annotated[int, Bound(1, 10)] = 2
    fall: Annotated[float, Bound(0.0, MOST_LEVEL, above=True)] = 0.01
    rise: Annotated[float, Bound(0.0, MOST_LEVEL, above=True)] = 0.01
    start: Annotated[float, Bound(0.0, MOST_LEVEL)] = 0.2
    reversals: Annotated[int, Bound(2, 10_000)] = 12
    skipped: Annotated[int, Bound(0, 9_999)] = 4

    def __post_init__(self):
        integer("staircase.skipped", self.skipped, 0, self.reversals - 1)

    @property
    def share(self) -> float:
        """Share of noticed trials at which the mean step is zero.

        There p^down fall = (1 - p^down) rise: 70.7 % for two in a row and equal steps, 79.4 % for
        three.
        """
        return (self.rise / (self.rise + self.fall)) ** (1.0 / self.down)

    @property
    def words(self) -> str:
        """The rule in a few words."""
        steps = "" if self.rise == self.fall else f", steps {self.rise:g} up, {self.fall:g} down"
        return f"1 up, {self.down} down{steps}"


@named
@dataclass(frozen=True, eq=False, repr=False)
class StaircaseRun(Result):
    """The trials of a staircase, and what it converged to.

    Attributes:
        staircase: the rule.
        levels: difference of each trial, shape (n,).
        noticed: whether each was noticed, shape (n,).
        turns: index of each trial at which the direction changed, shape (m,).
    """

    drawn_by = "hapticclay.views.chart_plots:staircase_plot"

    staircase: Staircase
    levels: np.ndarray
    noticed: np.ndarray
    turns: np.ndarray

    @property
    def estimate(self) -> float:
        """Mean of the levels at the turns that count."""
        return float(np.mean(self.levels[self.turns[self.staircase.skipped :]]))

    def headline(self) -> str:
        """Rule, estimate and number of trials, in one line."""
        share = 100.0 * self.staircase.share
        return (
            f"{self.staircase.words}: {self.estimate:.4g}, noticed in {share:.1f} % of trials, "
            f"after {len(self.levels)} trials"
        )

    def tables(self) -> dict[str, dict[str, Any]]:
        """The trials and the turns."""
        return {
            "trials": {"level": self.levels, "noticed": self.noticed},
            "turns": {"trial": self.turns, "level": self.levels[self.turns]},
        }


@checked
def run_staircase(
    staircase: Staircase, observer: Observer, seed: Seed = 0, stimulus: Stimulus | None = None
) -> StaircaseRun:
    """Run a staircase on a simulated observer.

    Args:
        staircase: the rule.
        observer: the simulated observer.
        seed: seed of the answers, 0 to 2^32 - 1.
        stimulus: difference at the observer as a function of the difference set; None for the same.

    Raises:
        ParameterError: it does not turn often enough within 100000 trials, or stimulus returns no
            difference.
    """
    rng = np.random.default_rng(seed)
    s, level, row, direction = staircase, staircase.start, 0, 0
    levels: list[float] = []
    noticed: list[bool] = []
    turns: list[int] = []
    while len(turns) < s.reversals:
        if len(levels) == MOST_TRIALS:
            bound = f"must turn {s.reversals} times within {MOST_TRIALS} trials"
            raise ParameterError("staircase.reversals", len(turns), bound)
        given = level if stimulus is None else number("stimulus", stimulus(level), 0.0, MOST_LEVEL)
        seen = bool(rng.random() < observer.notices(given))
        levels.append(level)
        noticed.append(seen)
        row = row + 1 if seen else 0
        way = -1 if row == s.down else 0 if seen else 1
        if not way:
            continue
        if direction and way != direction:
            turns.append(len(levels) - 1)
        direction, row = way, 0
        level = max(0.0, level + (s.rise if way > 0 else -s.fall))
    return StaircaseRun(s, np.array(levels), np.array(noticed), np.array(turns))


@checked
def staircase_mean(
    staircase: Staircase,
    observer: Observer,
    runs: Annotated[int, Bound(2, 100_000)] = 100,
    seed: Annotated[int, Bound(0, 2**31)] = 0,
) -> tuple[float, float]:
    """Mean estimate of many staircases, and its standard error.

    Args:
        staircase: the rule.
        observer: the simulated observer.
        runs: number of staircases, 2 to 100000.
        seed: seed of the first, 0 to 2^31.
    """
    found = [run_staircase(staircase, observer, seed + i).estimate for i in range(runs)]
    return float(np.mean(found)), float(np.std(found, ddof=1) / math.sqrt(runs))
