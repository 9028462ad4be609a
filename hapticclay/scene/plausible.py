"""Warnings before a run about values that are valid but implausible."""

from __future__ import annotations

import math
import sys
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import Warning
from ..model.clay import Clay
from ..model.constants import AXES
from ..model.operator import Operator
from .scenario import Scenario

# Largest plausible hand and arm at a handle: ten times the largest measured values in a firm grip,
# 3 kg, 50 N.s/m and 1 kN/m.
HAND_MOST = {"mass": (30.0, "kg"), "damper": (500.0, "N.s/m"), "spring": (1e4, "N/m")}


def warn_implausible(scenario: Scenario) -> None:
    """Issues a `Warning` for each implausible value of a scenario, at the user's line."""
    for text in implausible(scenario):
        warnings.warn(text, Warning, stacklevel=_user_stack_level())


def _user_stack_level() -> int:
    """`stacklevel` of the user's line, for a warning that the caller issues."""
    level, frame = 0, sys._getframe()
    while frame and frame.f_globals.get("__name__", "").startswith("hapticclay."):
        level, frame = level + 1, frame.f_back
    return level


def implausible(scenario: Scenario) -> Iterator[str]:
    """Field, value and plausible range of each implausible value."""
    hands, given = scenario.operators, scenario.operator
    for i, axis in enumerate(AXES if isinstance(given, tuple) else AXES[:1]):
        field = f"operator.{axis}" if isinstance(given, tuple) else "operator"
        yield from _implausible_hand(field, hands[i])
    clay = scenario.clay
    if clay is not None and scenario.is_closed_form and not _within_reach(scenario, clay):
        folded, stretched = scenario.arm.reach
        ox, oy = scenario.origin
        yield (
            f"clay: lies where the handle cannot come, which is within {folded:.3g} to "
            f"{stretched:.3g} m of the shoulder at ({-ox:g}, {-oy:g}) m; are its edges in metres?"
        )


def _implausible_hand(field: str, hand: Operator | None) -> Iterator[str]:
    for name, (most, unit) in HAND_MOST.items() if hand else ():
        value = getattr(hand, name)
        if value > most:
            yield f"{field}.{name} = {value:g}: the hand of a person has 0 to {most:g} {unit}"


def _within_reach(scenario: Scenario, clay: Clay) -> bool:
    """Whether the handle can reach any point of the clay."""
    laws = [(*law.lines, law.some) for law in clay.laws if law.some.any()]
    inside = np.zeros((3, 3), dtype=bool)
    inside[1, 1] = True
    laws += [(block.x, block.y, inside) for block in clay.blocks]
    return not laws or any(_meets_reach(scenario, *law) for law in laws)


def _meets_reach(scenario: Scenario, x: Any, y: Any, some: np.ndarray) -> bool:
    """Whether cells between lines [m] meet the ring that the handle can reach."""
    near, far = [], []
    for lines, origin in zip((x, y), scenario.origin, strict=True):
        edges = np.array([-math.inf, *lines, math.inf]) + origin
        low, high = edges[:-1], edges[1:]
        near.append(np.maximum(0.0, np.maximum(low, -high)))
        far.append(np.maximum(abs(low), abs(high)))
    folded, stretched = scenario.arm.reach
    least = np.hypot(near[0][:, None], near[1])
    most = np.hypot(far[0][:, None], far[1])
    return bool((some & (least <= stretched) & (most >= folded)).any())
