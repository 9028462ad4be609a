"""Where a property of one parameter ceases to hold.

Roots of continuous functions are SciPy's (`brentq`); a yes or no needs bisection.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable


def bisect(
    holds: Callable[[float], bool], low: float, high: float, rtol: float = 1e-12
) -> tuple[float, float]:
    """Narrow the bracket of a change.

    Args:
        holds: the property; true at low, false at high.
        low: lower end of the bracket.
        high: upper end of the bracket.
        rtol: width of the result, relative to its upper end.

    Returns:
        (low, high), the property true at low and false at high.
    """
    while high - low > rtol * high:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def first_failure(
    holds: Callable[[float], bool], grid: Iterable[float], below: float | None = None
) -> tuple[float, float]:
    """Bracket the first change from true to false along a grid, to 1e-12 of its place.

    Args:
        holds: the property. A failure narrower than the grid may be missed.
        grid: ascending positive values at which to look.
        below: value below the grid at which the property is known to hold; None if there is none.

    Returns:
        (low, high), the property true at low and false at high: (0, first of grid) if it fails
        there and below is None, (last of grid, inf) if it never fails.
    """
    low = below
    for x in grid:
        if not holds(x):
            return (0.0, x) if low is None else bisect(holds, low, x)
        low = x
    assert low is not None
    return low, math.inf
