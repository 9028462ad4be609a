"""Lines in the plane, made of straight pieces, and positions along them.

Positions are numbers or columns, see `columns`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .columns import Pair, Value, clipped, root, where

PIECES = 24  # pieces of an arc


class Place(NamedTuple):
    """Position of a handle relative to its line; numbers or columns."""

    s: Value  # [m] arc length of the nearest point of the line
    across: Value  # [m] distance from the line, positive to its left
    distance: Value  # [m] from the nearest point
    tangent: Pair  # unit vector along the line there
    ahead: Pair  # unit vector along the line further on


def straight(length: float) -> list[tuple[float, float]]:
    """A straight line along x."""
    return [(0.0, 0.0), (length, 0.0)]


def corner(length: float) -> list[tuple[float, float]]:
    """A line along x that turns left by 90 degrees half-way."""
    return [(0.0, 0.0), (0.5 * length, 0.0), (0.5 * length, 0.5 * length)]


def arc(length: float) -> list[tuple[float, float]]:
    """A quarter circle that starts along x and turns left, as a polygon of that length."""
    part = length / PIECES
    nodes, turn = [(0.0, 0.0)], 0.5 * math.pi / PIECES
    for i in range(PIECES):
        a = (i + 0.5) * turn
        x, y = nodes[-1]
        nodes.append((x + part * math.cos(a), y + part * math.sin(a)))
    return nodes


SHAPES = {"straight": straight, "arc": arc, "corner": corner}


def rotated(nodes: list[tuple[float, float]], angle: float) -> np.ndarray:
    """A line rotated about its start, shape (number of nodes, 2) [m]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([(c * x - s * y, s * x + c * y) for x, y in nodes])


def pieces_of(nodes: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """The pieces of a line: x and y of the begin, unit vector, length and arc length there [m]."""
    d, lengths = _steps(nodes)
    starts = np.cumsum(lengths) - lengths
    rows = np.column_stack((nodes[:-1], d / lengths[:, None], lengths, starts))
    return tuple(map(tuple, rows.tolist()))


def length_of(nodes: np.ndarray) -> float:
    """Length of a line [m]."""
    return float(np.cumsum(_steps(nodes)[1])[-1])


def _steps(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """From each node to the next: differences, shape (n, 2), and distances, shape (n,) [m]."""
    d = np.diff(nodes, axis=0)
    return d, np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])


def place(pieces: tuple[tuple[Value, ...], ...], p: Pair, ahead: float) -> Place:
    """Position of a handle relative to its line."""
    nearest = _from_piece(pieces[0], p)
    for piece in pieces[1:]:
        found = _from_piece(piece, p)
        nearer = found[0] < nearest[0]
        nearest = [where(nearer, x, y) for x, y in zip(found, nearest, strict=True)]
    square, s, across, tx, ty = nearest
    ux, uy = pieces[0][2:4]
    for piece in pieces[1:]:
        begun = piece[5] <= s + ahead
        ux, uy = where(begun, piece[2], ux), where(begun, piece[3], uy)
    return Place(s, across, root(square), (tx, ty), (ux, uy))


def _from_piece(piece: tuple[Value, ...], p: Pair) -> Sequence[Value]:
    """Squared distance from a piece, arc length, distance to its left, and its unit vector."""
    x, y, tx, ty, length, start = piece
    dx, dy = p[0] - x, p[1] - y
    along = clipped(dx * tx + dy * ty, 0.0, length)
    ox, oy = dx - along * tx, dy - along * ty
    return ox * ox + oy * oy, start + along, tx * dy - ty * dx, tx, ty


def along_across(tangent: Pair, vector: Pair) -> Pair:
    """Components of a vector along a line and to its left."""
    (a, b), (u, v) = tangent, vector
    return a * u + b * v, a * v - b * u
