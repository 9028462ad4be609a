"""What the arms of a pair touch, as bodies of a picture: walls, clay and objects."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..model.clay import Clay
from ..scene.contact import Contact
from ..scene.pair import Pair, axes_of
from .sticks import KNOB

AROUND = 0.09  # radius of clay around a handle, as a share of the size
WALL, BLOCK = 0.015, 0.12  # half the thickness of a wall, and of clay behind a border
BROAD = 0.14  # half the breadth of both
OBJECT = 0.055  # half the edge of an object
CLEAR = 0.45  # opacity
NEXT = 1e-9  # [m] behind a border


class Body(NamedTuple):
    """A body of a picture.

    Attributes:
        place: its middle, or where its spring begins [m], shape (3,).
        half: half its edges [m], shape (3,); None for a ball of radius AROUND.
        moves: whether it moves along with the handle.
        spring: whether a spring leads from the place to the handle.
    """

    place: np.ndarray
    half: np.ndarray | None = None
    moves: bool = False
    spring: bool = False


def body_of(
    pair: Pair, i: int, start: np.ndarray, size: float, magnify: float = 1.0
) -> Body | None:
    """What an arm of a pair touches.

    Args:
        pair: the pair.
        i: 0 for the leader, 1 for the follower.
        start: where its handle starts [m].
        size: of the arms [m].
        magnify: times that motion is shown.
    """
    touched: Any = pair.touched[i]
    if touched is None:
        return None
    border = _border(touched)
    if border is not None:
        axis = touched.axis if isinstance(touched, Contact) else None
        along = _along(pair.arms[i], axis, border)
        thick = WALL if isinstance(touched, Contact) else BLOCK
        half = size * np.where(along != 0.0, thick, BROAD)
        away = magnify * abs(border) + (KNOB + thick) * size
        return Body(start + away * along, half)
    if isinstance(touched, Contact) and touched.mass:
        return Body(start, np.full(3, OBJECT * size), moves=True, spring=touched.K > 0.0)
    return Body(start, spring=isinstance(touched, Contact) and touched.K > 0.0)


def _border(touched: Contact | Clay) -> float | None:
    """Where it begins, from the start of the handle [m]; None where the handle is in it."""
    if isinstance(touched, Contact):
        return touched.start if touched.unilateral else None
    law = touched.x
    ahead = [x for x in law.borders[0] if x > 0.0 and law.some[law.index(x + NEXT, 0.0)]]
    return ahead[0] if ahead and not law.some[law.index(0.0, 0.0)] else None


def _along(arm: Any, axis: str | None, border: float) -> np.ndarray:
    """The direction in which it lies."""
    name = axis or axes_of(arm)[0]
    return np.where(np.arange(3) == "xyz".index(name), -1.0 if border < 0.0 else 1.0, 0.0)
