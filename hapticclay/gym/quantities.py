"""Quantities of actions and observations: names, bounds and units, and their spaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from gymnasium.spaces import Box


class Quantity(NamedTuple):
    """One number of an action or an observation, and its bounds."""

    name: str
    low: float
    high: float
    unit: str = ""  # "" for none


def symmetric(name: str, most: float, unit: str = "") -> Quantity:
    """A quantity with symmetric bounds."""
    return Quantity(name, -most, most, unit)


def box_of(quantities: Sequence[Quantity]) -> Box:
    """The space of quantities, float32."""
    low = np.array([q.low for q in quantities], np.float32)
    high = np.array([q.high for q in quantities], np.float32)
    return Box(low, high, dtype=np.float32)
