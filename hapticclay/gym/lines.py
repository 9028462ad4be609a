"""Lines in the plane, made of straight pieces, and positions along them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

PIECES = 24  # pieces of an arc


class Place(NamedTuple):
    """Position of a handle relative to its line; arrays over copies.

    Attributes:
        s: arc length of the nearest point of the line [m], shape (n,).
        across: distance from the line, positive to its left [m], shape (n,).
        distance: distance from the nearest point [m], shape (n,).
        tangent: direction of the line there, shape (n, 2).
        ahead: direction of the line further on, shape (n, 2).
    """

    s: np.ndarray
    across: np.ndarray
    distance: np.ndarray
    tangent: np.ndarray
    ahead: np.ndarray


def straight(length: float) -> list[tuple[float, float]]:
    """A straight line along x.

    Args:
        length: [m].
    """
    return [(0.0, 0.0), (length, 0.0)]


def corner(length: float) -> list[tuple[float, float]]:
    """A line along x that turns left by 90 degrees half-way.

    Args:
        length: [m].
    """
    return [(0.0, 0.0), (0.5 * length, 0.0), (0.5 * length, 0.5 * length)]


def arc(length: float) -> list[tuple[float, float]]:
    """A quarter circle that starts along x and turns left, as a polygon of that length.

    Args:
        length: [m].
    """
    part = length / PIECES
    nodes, turn = [(0.0, 0.0)], 0.5 * math.pi / PIECES
    for i in range(PIECES):
        a = (i + 0.5) * turn
        x, y = nodes[-1]
        nodes.append((x + part * math.cos(a), y + part * math.sin(a)))
    return nodes


SHAPES = {"straight": straight, "arc": arc, "corner": corner}


def turned(nodes: list[tuple[float, float]], angle: float) -> np.ndarray:
    """A line rotated about its start, shape (number of nodes, 2) [m].

    Args:
        nodes: nodes of the line [m].
        angle: angle, counterclockwise [rad].
    """
    c, s = math.cos(angle), math.sin(angle)
    return np.array([(c * x - s * y, s * x + c * y) for x, y in nodes])


def empty(n: int, pieces: int) -> dict[str, np.ndarray]:
    """Allocates a line for each copy.

    Args:
        n: number of copies.
        pieces: number of pieces of a line.
    """
    return {
        "nodes": np.zeros((n, pieces + 1, 2)), "tangents": np.zeros((n, pieces, 2)),
        "lengths": np.ones((n, pieces)), "starts": np.zeros((n, pieces)), "length": np.ones(n),
    }  # fmt: skip


def lay(m: dict[str, np.ndarray], i: int, nodes: np.ndarray) -> None:
    """Sets the line of a copy.

    Args:
        m: memory from `empty`.
        i: number of the copy.
        nodes: nodes of the line [m], shape (pieces + 1, 2).
    """
    d = np.diff(nodes, axis=0)
    lengths = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])
    m["nodes"][i], m["tangents"][i], m["lengths"][i] = nodes, d / lengths[:, None], lengths
    ends = np.cumsum(lengths)
    m["starts"][i], m["length"][i] = ends - lengths, ends[-1]


def place(m: dict[str, np.ndarray], p: np.ndarray, ahead: float) -> Place:
    """Positions of handles relative to their lines.

    Args:
        m: memory from `empty`.
        p: positions of the handles [m], shape (n, 2).
        ahead: look-ahead distance along the line [m].
    """
    tx, ty = m["tangents"][:, :, 0], m["tangents"][:, :, 1]
    dx = p[:, None, 0] - m["nodes"][:, :-1, 0]
    dy = p[:, None, 1] - m["nodes"][:, :-1, 1]
    along = np.minimum(np.maximum(dx * tx + dy * ty, 0.0), m["lengths"])
    ox, oy = dx - along * tx, dy - along * ty
    square = ox * ox + oy * oy
    rows = np.arange(len(p))
    k = square.argmin(axis=1)
    s = m["starts"][rows, k] + along[rows, k]
    on = (m["starts"] <= (s + ahead)[:, None]).sum(axis=1) - 1
    across = tx[rows, k] * dy[rows, k] - ty[rows, k] * dx[rows, k]
    distance = np.sqrt(square[rows, k])
    return Place(s, across, distance, m["tangents"][rows, k], m["tangents"][rows, on])


def along_across(tangent: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Components of vectors along and across a line.

    Args:
        tangent: direction of the line, shape (n, 2).
        x: the vectors, shape (n, 2).
    """
    along = tangent[:, 0] * x[:, 0] + tangent[:, 1] * x[:, 1]
    return along, tangent[:, 0] * x[:, 1] - tangent[:, 1] * x[:, 0]
