"""The arrays of a record by name, and the interface for tables and files."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np

from ..model.constants import AXES
from ..model.hardware import JOINTS
from ..scene.scenario import Scenario
from .monitor import Outcome


class Column(NamedTuple):
    """An array over the samples: its unit, what it is, and its parts; none for a single number."""

    unit: str
    words: str
    parts: tuple[str, ...] = AXES


ARRAYS = {
    "t": Column("s", "time", ()),
    "p": Column("m", "position of the handle"),
    "v": Column("m/s", "velocity of the handle"),
    "fh": Column("N", "force of the operator on the handle"),
    "fe": Column("N", "resisting force of the clay"),
    "b": Column("N.s/m", "damping of the clay at the handle"),
    "q": Column("rad", "joint angle", JOINTS),
    "qd": Column("rad/s", "joint rate", JOINTS),
    "tau": Column("N.m", "motor torque", JOINTS),
    "delta": Column("m", "output of the compensator"),
}
EXTRA = {  # arrays that some records have
    "removed": Column("m^3", "volume of clay removed", ()),
    "removal_rate": Column("m^3/s", "rate of removal", ()),
    "target": Column("m", "point that the hand pulls to"),
    "gain": Column("1/kg", "gain K of the compensator"),
}
# the remaining clay is an array over cells instead
COLUMNS = ARRAYS | EXTRA | {"ground": Column("m", "height of the remaining clay")}


def parts_of(name: str, scenario: Scenario) -> tuple[str, ...]:
    """Parts of an array: axes of the handle, or joints of the arm; none for a single number."""
    parts = COLUMNS[name].parts
    if name in EXTRA:
        return parts
    return {AXES: scenario.axes, JOINTS: scenario.joints}.get(parts, parts)


class Recorded(Protocol):
    """A record as tables and files use it: its arrays by name, and these members."""

    @property
    def t(self) -> np.ndarray: ...
    @property
    def scenario(self) -> Scenario: ...
    @property
    def outcome(self) -> Outcome: ...
    @property
    def status(self) -> str: ...
    @property
    def versions(self) -> dict[str, str]: ...
    @property
    def extra(self) -> dict[str, np.ndarray]: ...
    @property
    def ground(self) -> np.ndarray | None: ...
    def summary(self) -> dict[str, Any]: ...
