"""Random quantities of episodes: ranges, draws from them, and given values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError, choice, number, numbers_of

Truth = dict[str, float]


class Range(NamedTuple):
    """Range of a number drawn for each episode."""

    low: float  # smallest value drawn
    high: float  # largest value drawn
    unit: str  # "" for none
    least: float  # smallest value allowed
    most: float  # largest value allowed
    log: bool  # whether its logarithm is uniformly distributed; else the number itself is
    what: str


# Published hands: the ends are those of `POPULATIONS["published range"]`.
HAND = {
    "mass": Range(0.25, 0.554, "kg", 0.0, 100.0, True, "mass of the hand"),
    "damper": Range(2.0, 6.45, "N.s/m", 0.0, 1e4, True, "damper of the hand"),
    "spring": Range(6.0, 135.0, "N/m", 0.0, 1e5, True, "spring of the hand"),
}


def with_ranges(ranges: Mapping[str, Range], given: Mapping[str, Any] | None) -> dict[str, Range]:
    """Copies ranges with other ends."""
    if given is not None and not isinstance(given, Mapping):
        bound = (
            "must be a dictionary of pairs [low, high] by name, as {'mass': [0.3, 0.4]}, or None"
        )
        raise ParameterError("ranges", given, bound)
    found = dict(ranges)
    for name, ends in (given or {}).items():
        r = found[choice("ranges", name, tuple(found))]
        names = ("low", "high")
        low, high = numbers_of(f"ranges.{name}", ends, names, r.least, r.most, unit=r.unit)
        if high < low:
            raise ParameterError(f"ranges.{name}", ends, "must not end below where it begins")
        found[name] = r._replace(low=low, high=high)
    return found


def fixed_by(ranges: Mapping[str, Range], given: Mapping[str, Any]) -> Truth:
    """Checks numbers that replace drawn ones."""
    found = {}
    for name, value in given.items():
        r = ranges[choice("options", name, tuple(ranges))]
        found[name] = number(f"options.{name}", value, r.least, r.most, unit=r.unit)
    return found


def draw(ranges: Mapping[str, Range], rng: np.random.Generator, fixed: Truth) -> Truth:
    """Draws the numbers of an episode.

    All numbers are drawn, so that a fixed value does not change the others.
    """
    return {name: _sample(r, float(rng.random())) for name, r in ranges.items()} | fixed


def _sample(r: Range, u: float) -> float:
    """The number of a range at u, 0 to 1, of its distribution."""
    if r.log and r.low > 0.0:
        return min(max(r.low * math.exp(u * math.log(r.high / r.low)), r.low), r.high)
    return r.low + u * (r.high - r.low)
