"""Movers that successive runs share."""

from __future__ import annotations

from typing import Any

from ..scene.scenario import Scenario
from . import mover

STORED = 8  # movers per store


class Movers:
    """Movers that successive runs share: one for each arm, with clay and without."""

    def __init__(self):
        self.known: dict[Any, mover.Mover] = {}

    def of(self, scenario: Scenario) -> mover.Mover:
        """The mover of a scenario, at rest."""
        clay = scenario.clay
        key = None if clay is None else clay.angle, scenario.arm
        if key not in self.known:
            if len(self.known) >= STORED:
                del self.known[next(iter(self.known))]  # the oldest one
            self.known[key] = _new(scenario)
        self.known[key].rest(scenario)
        return self.known[key]


def _new(scenario: Scenario) -> mover.Mover:
    if scenario.is_closed_form:
        return mover.Mover(scenario)
    from .joint_mover import JointMover  # imported only for an arm from a file

    return JointMover(scenario)
