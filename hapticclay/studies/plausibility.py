"""Numbers that no hand, device or clay has, and the unit that would explain them.

A column that is read in the wrong unit multiplies each number by a known power of the error. Of the
units that logs are in, the first is named with which all numbers, the rate, the motion and the
force are such as rigs have.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .measurement import Measurement

PLACES = {"mm": 1e-3, "cm": 1e-2, "in": 0.0254, "um": 1e-6}
FORCES = {"mN": 1e-3, "gf": 9.80665e-3, "lbf": 4.4482216152605, "kgf": 9.80665}
TIMES = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class Number(NamedTuple):
    """A number with its interval, and what rigs have.

    `powers` are those of the sizes of position, force and time in it.
    """

    name: str
    unit: str
    value: float
    interval: tuple[float, float]
    bounds: tuple[float, float]
    powers: tuple[float, float, float]

    def scaled(self, sizes: Sequence[float]) -> Number:
        """The number, had the columns other sizes."""
        by = math.prod(size**n for size, n in zip(sizes, self.powers, strict=True))
        low, high = self.interval
        return self._replace(value=by * self.value, interval=(by * low, by * high))

    @property
    def plausible(self) -> bool:
        """Whether its interval and the bounds meet."""
        low, high = self.bounds
        return self.interval[1] >= low and self.interval[0] <= high

    def __str__(self) -> str:
        return f"{self.name} {self.value:.3g} {self.unit}"


MASS, DAMPER, SPRING = (5e-3, 100.0), (0.0, 5e3), (-1e6, 1e6)  # [kg], [N.s/m], [N/m]
OF_MASS, OF_DAMPER, OF_SPRING = (-1.0, 1.0, 2.0), (-1.0, 1.0, 1.0), (-1.0, 1.0, 0.0)
YIELD, FLOW = (0.0, 1e3), (0.0, 5e3)  # [N], [N.s/m] of clay


def device_numbers(
    values: Sequence[float], intervals: Sequence[tuple[float, float]]
) -> tuple[Number, ...]:
    """Mass, damper and spring of a device or a hand."""
    rows = (
        ("mass", "kg", MASS, OF_MASS),
        ("damper", "N.s/m", DAMPER, OF_DAMPER),
        ("spring", "N/m", SPRING, OF_SPRING),
    )
    return tuple(
        Number(name, unit, x, span, bounds, powers)
        for (name, unit, bounds, powers), x, span in zip(rows, values, intervals, strict=True)
    )


def doubts(numbers: Sequence[Number], data: Measurement, of: str) -> tuple[str, ...]:
    """A sentence about numbers that nothing of a kind has; `of`: "hand or device", say."""
    every = (*numbers, *_of_log(data))
    bad = [x for x in every if not x.plausible]
    if not bad:
        return ()
    what = f"no {of}, nor a log of one, has {', '.join(map(str, bad))}"
    for names, sizes in _changes():
        made = [x.scaled(sizes) for x in every]
        if all(x.plausible for x in made):
            then = ", ".join(map(str, made[: len(numbers)]))
            return (f"{what}; with {' and '.join(names)} it is {then}: state the units",)
    return (f"{what}: check units and columns",)


def _of_log(data: Measurement) -> tuple[Number, ...]:
    """Rate, motion and force of a log."""
    rate = 1.0 / data.dt
    motion, force = float(np.ptp(data.output)), float(np.ptp(data.input))
    return (
        Number("rate", "Hz", rate, (rate, rate), (8.0, 2e5), (0.0, 0.0, -1.0)),
        Number("motion", "m", motion, (motion, motion), (2e-6, 5.0), (1.0, 0.0, 0.0)),
        Number("force", "N", force, (force, force), (1e-3, 5e3), (0.0, 1.0, 0.0)),
    )


def _changes() -> Iterator[tuple[list[str], tuple[float, float, float]]]:
    """Units in which columns may have been, one column first, and their sizes."""
    kinds = (("position", PLACES), ("force", FORCES), ("time", TIMES))
    some = [[None, *units] for _, units in kinds]
    every = sorted(itertools.product(*some), key=lambda x: 3 - x.count(None))
    for units in every:
        pairs = [(name, u, sizes) for (name, sizes), u in zip(kinds, units, strict=True)]
        names = [f"the {name} in {u}" for name, u, _ in pairs if u]
        if names:
            a, b, c = (sizes[u] if u else 1.0 for _, u, sizes in pairs)
            yield names, (a, b, c)
