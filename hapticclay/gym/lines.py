"""Lines in the plane, made of straight pieces, and positions along them.

Positions are numbers or columns, see `columns`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .columns import Pair, Value, bounded, root, where

PIECES = 24  # pieces of an arc


class Place(NamedTuple):
    """Position of a handle relative to its line; numbers or columns.

    Attributes:
        s: arc length of the nearest point of the line [m].
        across: distance from the line, positive to its left [m].
        distance: distance from the nearest point [m].
        tangent: direction of the line there, (x, y).
        ahead: direction of the line further on, (x, y).
    """

    s: Value
    across: Value
    distance: Value
    tangent: Pair
    ahead: Pair


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


def turned(nodes: list[tuple[float, float]], angle: float) -> np.ndarray:
    """A line rotated about its start, shape (number of nodes, 2) [m]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([(c * x - s * y, s * x + c * y) for x, y in nodes])


def pieces_of(nodes: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """The pieces of a line: x and y of its begin [m], of its direction, length and start [m]."""
    d = np.diff(nodes, axis=0)
    lengths = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])
    starts = np.cumsum(lengths) - lengths
    rows = np.column_stack((nodes[:-1], d / lengths[:, None], lengths, starts))
    return tuple(map(tuple, rows.tolist()))


def length_of(nodes: np.ndarray) -> float:
    """Length of a line [m]."""
    d = np.diff(nodes, axis=0)
    return float(np.cumsum(np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1]))[-1])


def place(pieces: tuple[tuple[Value, ...], ...], p: Pair, ahead: float) -> Place:
    """Position of a handle relative to its line."""
    square, s, across, tx, ty = beside(pieces[0], p)
    for piece in pieces[1:]:
        found = beside(piece, p)
        near = found[0] < square
        square, s, across = (
            where(near, x, y) for x, y in zip(found[:3], (square, s, across), strict=True)
        )
        tx, ty = where(near, found[3], tx), where(near, found[4], ty)
    _, _, ux, uy, _, _ = pieces[0]
    for piece in pieces[1:]:
        on = piece[5] <= s + ahead
        ux, uy = where(on, piece[2], ux), where(on, piece[3], uy)
    return Place(s, across, root(square), (tx, ty), (ux, uy))


def beside(piece: tuple[Value, ...], p: Pair) -> tuple[Value, ...]:
    """Squared distance from a piece, arc length, distance to its left, and its direction."""
    x, y, tx, ty, length, start = piece
    dx, dy = p[0] - x, p[1] - y
    along = bounded(dx * tx + dy * ty, 0.0, length)
    ox, oy = dx - along * tx, dy - along * ty
    return ox * ox + oy * oy, start + along, tx * dy - ty * dx, tx, ty


def along_across(tangent: Pair, x: Pair) -> Pair:
    """Components of a vector along and across a line."""
    (a, b), (u, v) = tangent, x
    return a * u + b * v, a * v - b * u
