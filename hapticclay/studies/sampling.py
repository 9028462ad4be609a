"""Spaces of parameters: ranges, and grids, Latin hypercubes and Sobol sequences over them."""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..errors import ParameterError, number_in
from ..scene.changes import named_values, split_words
from ..scene.experiments import parameter_unit

RANGE_PATTERN = r"(?P<low>[^:]+):(?P<high>[^:]+?)(:(?P<n>\d+))?\s*(?P<log>log)?"
MOST_RUNS = 10_000_000


@named
@dataclass(frozen=True)
class Range:
    """Values of one parameter: from low to high, evenly spaced or by constant factors; or a list.

    Attributes:
        low: smallest value.
        high: largest value.
        n: number of values on a grid; None for designs that sample between low and high.
        log: whether neighbours differ by a constant factor.
        values: the list; empty for none.
    """

    low: float
    high: float
    n: int | None = None
    log: bool = False
    values: tuple[float, ...] = ()

    @classmethod
    def parse(cls, field: str, text: object, unit: str = "") -> Range:
        """Parses "1:1000:50log", "0.2:2:20", "0.2:2", "1:1000log" or "1,2,5".

        Args:
            field: name for the error.
            text: the range; a number or a list of numbers is accepted too. Each number may have a
                unit, as in "0.1ms:1ms:5".
            unit: unit of the parameter.

        Raises:
            ParameterError: it is none of these.
        """
        bound = 'must be like "1:1000:50log", "0.2:2:20", "0.2:2" or "1,2,5", from low to high'
        try:
            if isinstance(text, str) and (found := re.fullmatch(RANGE_PATTERN, text.strip())):
                low, high = (number_in(field, found[end], unit) for end in ("low", "high"))
                n, log = int(found["n"]) if found["n"] else None, bool(found["log"])
                finite = math.isfinite(low) and math.isfinite(high)
                if not finite or n == 0 or (log and low <= 0.0) or (n != 1 and low >= high):
                    raise ValueError
                return cls(low, high, n, log)
            items = text.split(",") if isinstance(text, str) else text
            items = items if isinstance(items, list | tuple) else [items]
            values = tuple(number_in(field, x, unit) for x in items)
            if not values or not all(map(math.isfinite, values)):
                raise ValueError
        except ParameterError:  # of a unit
            raise
        except (TypeError, ValueError, OverflowError):
            raise ParameterError(field, text, bound) from None
        return cls(min(values), max(values), len(values), False, values)

    @property
    def count(self) -> int:
        """Number of values on a grid."""
        return len(self.values) or self.n or 1

    def grid(self) -> np.ndarray:
        """The values, shape (n,)."""
        if self.values:
            return np.array(self.values)
        assert self.n
        return (np.geomspace if self.log else np.linspace)(self.low, self.high, self.n)

    def spread(self, u: np.ndarray) -> np.ndarray:
        """Samples of the unit interval spread over the range.

        Args:
            u: samples in [0, 1); they select from the list if there is one.
        """
        if self.values:
            return np.array(self.values)[(u * len(self.values)).astype(int)]
        if self.log:
            return self.low * (self.high / self.low) ** u
        return self.low + (self.high - self.low) * u


def grid_columns(ranges: Iterable[Range], cells: np.ndarray) -> list[np.ndarray]:
    """Values in some cells of a grid, by range; the last range is the fastest."""
    axes = [r.grid() for r in ranges]
    index = np.unravel_index(cells, [len(x) for x in axes])
    return [x[i] for x, i in zip(axes, index, strict=True)]


@functools.lru_cache(1)  # a worker needs it for each chunk
def unit_samples(design: str, dimensions: int, runs: int, seed: int) -> np.ndarray:
    """A sample of the unit cube, shape (runs, dimensions)."""
    from scipy.stats import qmc

    kind = qmc.LatinHypercube if design == "lhs" else qmc.Sobol
    with np.errstate(all="ignore"):
        engine = kind(dimensions, rng=np.random.default_rng(seed))
    if design == "sobol":  # balance needs a power of two; the first runs of these are used
        return engine.random_base2(max(0, math.ceil(math.log2(runs))))[:runs]  # type: ignore[attr-defined]
    return engine.random(runs)


@checked
def parse_grid(text: str) -> dict[str, Range]:
    """Reads "b=1:1000:50log gain=0.2:2:20 force=1:2 log"; units as in "dt=0.1ms:1ms:5log".

    Args:
        text: the ranges.

    Raises:
        ParameterError: a word is not name=range, or a name stands twice.
    """
    return grid_in_units(text, parameter_unit)


def grid_in_units(text: str, unit_of: Callable[[str], str]) -> dict[str, Range]:
    """Reads ranges as `parse_grid` does."""
    how = (
        "must be name=low:high:n, name=low:high:nlog, name=low:high (sampled) or name=a,b,c, "
        "each name once"
    )
    if not isinstance(text, str):
        raise ParameterError("grid", text, how)
    words = re.sub(r"\s+log(?!\S)", "log", text).split()
    ranges = split_words("grid", words, how).items()
    return {name: Range.parse(name, values, unit_of(name)) for name, values in ranges}


def parse_fixed(text: str) -> dict[str, Any]:
    """Reads "t_max=2 inertia_shaping=true force=1,0 growth=30/s arm.l1=30cm"."""
    return named_values("fixed", text.split())
