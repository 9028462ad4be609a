"""The arrays of a record by name, and the interface for tables and files."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ..scene.scenario import Scenario
from .monitor import Outcome

ARRAYS = {
    "t": "s",
    "p": "m",
    "v": "m/s",
    "fh": "N",
    "fe": "N",
    "b": "N.s/m",
    "q": "rad",
    "qd": "rad/s",
    "tau": "N.m",
    "delta": "m",
}
EXTRA = {  # arrays that some records have
    "removed": "m^3",
    "removal_rate": "m^3/s",
    "target": "m",
    "gain": "1/kg",
}
SCALAR = (
    "t",
    "removed",
    "removal_rate",
)  # arrays of one number per sample; the others have one per axis


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
