"""Laws of the clay of a user: modules in TABLE, each with six functions.

| function | gives |
|---|---|
| `numbers(scenario)` | its parameters, a tuple of floats; None for a scene without it |
| `refuses(scenario)` | why it does not work in a scene; "" where it does |
| `start(numbers, p)` | its state at the start, a tuple of floats; p: place of the handle [m] |
| `load(z, k)` | adds its load f - d u to the Kick k; z: parameters, then state |
| `moved(z, px, py, vx, vy, h)` | changes its state after a step of length h that led there |
| `force(z, px, py, vx, vy, out)` | puts its force at an instant into out, (x, y) [N] |
"""

from __future__ import annotations

from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError
from ..scene.scenario import Scenario
from . import records

TABLE: list[ModuleType] = []


class UserLaw(NamedTuple):
    """A law in a scene: its functions, and its numbers, parameters and then state."""

    module: Any
    z: np.ndarray
    first: int  # index of the state
    start: np.ndarray  # the numbers at the start of a run


def of_scene(scenario: Scenario) -> tuple[UserLaw, ...]:
    """The laws that a scene has."""
    laws = []
    for module in TABLE:
        numbers = module.numbers(scenario)
        if numbers is None:
            continue
        refusal = module.refuses(scenario)
        if scenario.hardware is not None and scenario.hardware.coupling is not None:
            refusal = (
                refusal or "must be without a coupling, which renders viscous clay and its yielding"
            )
        if not refusal and len(laws) == records.LAWS:
            refusal = f"must have at most {records.LAWS} laws of a user"
        if refusal:
            raise ParameterError("clay", scenario.clay, refusal)
        p = tuple(map(float, scenario.start))
        z = np.array([*numbers, *module.start(numbers, p)], float)
        laws.append(UserLaw(module, z, len(numbers), z.copy()))
    return tuple(laws)
