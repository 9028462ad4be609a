"""Conversion between the cursor of a device, x, y, z, and the plane of the arm."""

from __future__ import annotations

from typing import Literal

from .commands import NOTHING, Pair, Vector

Plane = Literal["xy", "xz"]
PLANES = {"xy": (0, 1), "xz": (0, 2)}  # axes of the cursor that become x and y of the arm


def to_plane(v: Vector, plane: str) -> Pair:
    """Components of a cursor vector in the plane of the arm."""
    i, j = PLANES[plane]
    return v[i], v[j]


def normal_component(v: Vector, plane: str) -> float:
    """Component of a cursor vector normal to the plane of the arm."""
    return v[3 - sum(PLANES[plane])]


def to_space(v: Pair, plane: str, rest: Vector = NOTHING) -> Vector:
    """Converts a vector in the plane of the arm to a cursor vector."""
    out = list(rest)
    for axis, value in zip(PLANES[plane], v, strict=True):
        out[axis] += value
    return out[0], out[1], out[2]
