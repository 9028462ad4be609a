"""`cells` for clay that arrays and splines describe, as `store` keeps it."""

from tests.oracles.cells import Solved, cells
from tests.oracles.spline import even_spline


def of_grid(edges, values, loop, times, th=(0.0,) * 3, shaping=False, angle=0.0, rates=None):
    """Cells of the dampings values[0][i, j] and values[1][i, j]; loop: gains and forces.

    rates: at which the first grow from their first entry.
    """
    return cells(
        edges, lambda i, j: (values[0][i, j], values[1][i, j]), *loop, times, th, shaping, angle,
        grows=None if rates is None else lambda i, j: (rates[i, j], 0.0),
    )  # fmt: skip


def of_splines(spans, values, loop, times, th=(0.0,) * 3, shaping=False, angle=0.0) -> Solved:
    """Smooth clay: of each axis, the splines of values over spans."""
    splines = [even_spline(*span, x) for span, x in zip(spans, values, strict=True)]
    return cells(
        ((), ()), None, *loop, times, th, shaping, angle, place=lambda p: [b(p) for b in splines]
    )
