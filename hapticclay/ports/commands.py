"""Commands of a client to a device, independent of the protocol."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

Vector = tuple[float, float, float]
Pair = tuple[float, float]

NOTHING: Vector = (0.0, 0.0, 0.0)
AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Command:
    """The command in a message; None for what the message does not contain.

    Attributes:
        force: force on the cursor, along x, y, z of the device [N].
        target: position at which to hold the cursor, x, y, z [m].
        torques: torques on the shoulder and elbow joints [N.m].
    """

    force: Vector | None = None
    target: Vector | None = None
    torques: Pair | None = None

    @property
    def mode(self) -> str:
        """Which quantity is driven: "force", "position", "torque" or "idle"."""
        if self.target is not None:
            return "position"
        if self.torques is not None:
            return "torque"
        return "idle" if self.force is None else "force"


IDLE = Command()


def finite(value: Any) -> float | None:
    """A number as a float; None for anything else, including bool.

    Args:
        value: value from a message.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        found = float(value)
    except OverflowError:
        return None
    return found if math.isfinite(found) else None


def by_axis(v: Vector) -> dict[str, float]:
    """A vector in the form used in messages.

    Args:
        v: components along x, y, z.
    """
    return dict(zip(AXES, v, strict=True))
