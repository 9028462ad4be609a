"""Conversion between the cursor of a device, x, y, z, and the axes of an arm's handle."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from ..errors import ParameterError
from ..scene.scenario import Scenario
from .commands import AXES, NOTHING, Numbers, Pair, Vector

Plane = Literal["xy", "xz"]
# axes of the cursor that become x and y of the arm in closed form
PLANES: dict[str, tuple[int, int]] = {"xy": (0, 1), "xz": (0, 2)}


def cursor_axes(scenario: Scenario, plane: str) -> tuple[int, ...]:
    """Axes of the cursor that become those of the handle, which are the world's for an arm's file.

    Raises:
        ParameterError: a plane other than xy is given for an arm from a file.
    """
    if scenario.is_closed_form:
        return PLANES[plane]
    if plane != "xy":
        bound = (
            "must be left out with an arm from a file, which moves along x, y and z of its world"
        )
        raise ParameterError("plane", plane, bound)
    return tuple(AXES.index(axis) for axis in scenario.axes)


def moving_axes(scenario: Scenario, plane: str) -> tuple[int, ...]:
    """Axes of the cursor along which the handle can move."""
    if scenario.is_closed_form:
        return PLANES[plane]
    return tuple(scenario.file_arm.mechanism.axes)


def along(v: Sequence[float], axes: Sequence[int]) -> Numbers:
    """Components of a cursor vector along the axes of the handle."""
    return tuple(v[i] for i in axes)


def to_cursor(v: Sequence[float], axes: Sequence[int], rest: Vector = NOTHING) -> Vector:
    """Converts a vector along the axes of the handle to a cursor vector."""
    out = list(rest)
    for axis, value in zip(axes, v, strict=True):
        out[axis] += value
    return out[0], out[1], out[2]


def to_plane(v: Vector, plane: str) -> Pair:
    """Components of a cursor vector in the plane of the arm in closed form."""
    i, j = PLANES[plane]
    return v[i], v[j]


def to_space(v: Pair, plane: str, rest: Vector = NOTHING) -> Vector:
    """Converts a vector in the plane of that arm to a cursor vector."""
    return to_cursor(v, PLANES[plane], rest)
