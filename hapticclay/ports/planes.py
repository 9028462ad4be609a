"""Between the cursor of a device, x, y, z, and the plane in which the arm moves."""

from __future__ import annotations

from .commands import NOTHING, Pair, Vector

PLANES = {"xy": (0, 1), "xz": (0, 2)}  # axes of the cursor that are x and y of the arm


def to_plane(v: Vector, plane: str) -> Pair:
    """What a vector of the cursor has in the plane of the arm.

    Args:
        v: the vector.
        plane: of PLANES.
    """
    i, j = PLANES[plane]
    return v[i], v[j]


def normal_component(v: Vector, plane: str) -> float:
    """What a vector of the cursor has across the plane of the arm.

    Args:
        v: the vector.
        plane: of PLANES.
    """
    return v[3 - sum(PLANES[plane])]


def to_space(v: Pair, plane: str, rest: Vector = NOTHING) -> Vector:
    """A vector of the arm's plane as one of the cursor.

    Args:
        v: the vector.
        plane: of PLANES.
        rest: what is added to it.
    """
    out = list(rest)
    for axis, value in zip(PLANES[plane], v, strict=True):
        out[axis] += value
    return out[0], out[1], out[2]
