"""Cubic B-splines over an even grid of control points, by scipy.interpolate.BSpline."""

import numpy as np
from scipy.interpolate import BSpline

BEYOND = 40  # lines of control points like those of the outline, on each side


def even_spline(x, y, values):
    """b(p) from the first and last node of each way and the control points, shape (n, m)."""
    values = np.atleast_2d(np.array(values, float))
    padded = np.pad(values, BEYOND, mode="edge")
    knots = []
    for (low, high), n in zip((x, y), values.shape, strict=True):
        step = (high - low) / (n - 1) if n > 1 else 1.0
        knots.append(low + step * (np.arange(n + 2 * BEYOND + 4) - BEYOND - 2.0))
    across = BSpline(knots[0], padded, 3)

    def b(p):
        return float(BSpline(knots[1], across(p[0]), 3)(p[1]))

    return b
