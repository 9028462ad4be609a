"""Signals as tables of numbers for a loop: rows of cosines, and rows of cubics in time.

A piece is a row of PIECE numbers: its start [s], and for x, then y, the coefficients of 1, u, u^2
and u^3, with u the time since that start [s]. A piece is valid up to the start of the next one; the
first is also valid before its start, the last has no end. Loops read a table: a row (number of
lines, slack [s]), the lines of multisines (omega [rad/s], phases x, y [rad], amplitudes x, y), and
the pieces.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..formulas.pieces import PIECE

NO_PIECES = np.zeros((0, PIECE))
NO_LINES = np.zeros((0, 5))
# nodes of a cell for `interpolate`, those of Lobatto: the mean of the cubic over a cell is exact to
# sixth order in its length; and the coefficients of the cubic for values of 1 at one node each
NODES = np.array([0.0, 0.5 - 0.5 / math.sqrt(5.0), 0.5 + 0.5 / math.sqrt(5.0), 1.0])
TO_CUBIC = np.linalg.inv(np.vander(NODES, increasing=True))
TO_CUBIC[0] = 1.0, 0.0, 0.0, 0.0  # to the last bit
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(10)  # nodes and weights on [-1, 1]
PANELS = 2**17  # panels of a quadrature evaluated at once


def loop_table(lines: np.ndarray, pieces: np.ndarray, slack: float) -> np.ndarray:
    """The table of a signal; a jump within `slack` [s] after an instant counts as being at it."""
    table = np.zeros((1 + len(lines) + len(pieces), PIECE))
    table[0, :3] = len(lines), slack, len(table)
    table[1 : 1 + len(lines), :5] = lines
    table[1 + len(lines) :] = pieces
    return table


def value_rows(rows: np.ndarray, t: np.ndarray, h: Any = 0.0) -> np.ndarray:
    """Mean of each row's piece over [t - h, t + h] [s], shape (n, 2)."""
    u, k = t - rows[:, 0], np.square(h)
    c = rows[:, 1:].reshape(-1, 2, 4).T
    mean = c[0] + u * (c[1] + u * (c[2] + u * c[3])) + k * (c[2] / 3.0 + c[3] * u)
    return mean.T


def pieces_value(pieces: np.ndarray, t: np.ndarray, near: np.ndarray) -> np.ndarray:
    """As `value_of_pieces`, at many times; `near` lies on the wanted side of each."""
    at = np.searchsorted(pieces[:, 0], near, "right") - 1
    return value_rows(pieces[np.maximum(at, 0)], t)


def pieces_mean(pieces: np.ndarray, t: np.ndarray, h: np.ndarray) -> np.ndarray:
    """As `mean_of_pieces`, over many intervals; for h = 0 the value from t on, without slack."""
    start, begin, end = pieces[:, 0], t - h, t + h
    first = np.maximum(np.searchsorted(start, begin, "right") - 1, 0)
    last = np.maximum(np.searchsorted(start, end, "left") - 1, first)
    out = value_rows(pieces[first], t, h)
    (across,) = np.nonzero(last > first)
    if len(across):
        count = last[across] - first[across] + 1
        which = np.repeat(np.arange(len(across)), count)
        j = np.arange(count.sum()) + np.repeat(first[across] - np.cumsum(count) + count, count)
        low = np.where(j == first[across][which], begin[across][which], start[j])
        high = np.append(start[1:], math.inf)[j]
        high = np.minimum(high, end[across][which])
        mean = value_rows(pieces[j], 0.5 * (low + high), 0.5 * (high - low))
        share = 0.5 * (high - low) / h[across][which]
        for i in (0, 1):
            out[across, i] = np.bincount(which, share * mean[:, i], len(across))
    return out


def added_pieces(parts: Sequence[np.ndarray], factors: Sequence[float]) -> np.ndarray:
    """Pieces of the sum of signals, each with its factor."""
    terms = [(x, k) for x, k in zip(parts, factors, strict=True) if len(x)]
    if not terms:
        return NO_PIECES
    start = np.unique(np.concatenate([x[:, 0] for x, _ in terms]))
    out = np.zeros((len(start), PIECE))
    out[:, 0] = start
    for x, factor in terms:
        rows = x[np.maximum(np.searchsorted(x[:, 0], start, "right") - 1, 0)]
        u = start - rows[:, 0]
        for i in (1, 5):  # the cubic, counted from the new start
            a, b, c, d = factor * rows[:, i : i + 4].T
            out[:, i] += a + u * (b + u * (c + u * d))
            out[:, i + 1] += b + u * (2.0 * c + u * (3.0 * d))
            out[:, i + 2] += c + u * (3.0 * d)
            out[:, i + 3] += d
    return out


def straight_pieces(start: Any, values: Any, slopes: Any = None) -> np.ndarray:
    """Straight pieces from values (x, y) at their starts [s]; constant ones without slopes."""
    out = np.zeros((len(start), PIECE))
    out[:, 0] = start
    out[:, [1, 5]] = values
    if slopes is not None:
        out[:, [2, 6]] = slopes
    return out


def cell_edges(begin: float, end: float, cell: float) -> np.ndarray:
    """Edges of cells that cover an interval: multiples of their length, cut at the end."""
    first = math.floor(begin / cell + 1e-6)
    last = max(math.ceil(end / cell - 1e-6), first + 1)
    edges = np.arange(first, last + 1) * cell
    if end < edges[-1] - 1e-6 * cell and end > edges[-2]:
        edges[-1] = end
    return edges


def interpolate(f: Callable[[np.ndarray], np.ndarray], edges: np.ndarray) -> np.ndarray:
    """Cubic pieces through values at the Lobatto nodes of each cell."""
    m, span = len(edges) - 1, np.diff(edges)
    inner = edges[:-1, None] + span[:, None] * NODES[:3]
    values = f(np.append(inner.ravel(), edges[-1]))
    nodes = np.empty((m, 4, 2))
    nodes[:, :3], nodes[:, 3] = values[:-1].reshape(m, 3, 2), values[3::3]
    cubic = np.einsum("kj,mji->mik", TO_CUBIC, nodes) / span[:, None, None] ** np.arange(4)
    return np.column_stack((edges[:-1], cubic.reshape(m, 8)))


def integrals(
    f: Callable[[np.ndarray], np.ndarray], begin: np.ndarray, end: np.ndarray, panels: np.ndarray
) -> np.ndarray:
    """Integrals of f, (m,) to (m, 2), by Gauss quadrature with ten nodes per panel."""
    out = np.zeros((len(begin), 2))
    for which in np.array_split(np.arange(len(begin)), panels.sum() // PANELS + 1):
        of = np.repeat(which, panels[which])
        if not len(of):
            continue
        part = np.arange(len(of)) - np.repeat(np.cumsum(panels[which]), panels[which])
        half = 0.5 * ((end - begin) / panels)[of]
        middle = end[of] + (2.0 * part + 1.0) * half
        values = f((middle[:, None] + half[:, None] * GAUSS).ravel()).reshape(len(of), -1, 2)
        each = half[:, None] * np.einsum("j,mji->mi", WEIGHTS, values)
        for i in (0, 1):
            out[:, i] += np.bincount(of, each[:, i], len(begin))
    return out
