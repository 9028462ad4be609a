"""What a client asks of a device, whatever protocol it speaks."""

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
    """What a message asks of a device; None for what it does not mention.

    Attributes:
        force: on the cursor, along x, y, z of the device [N].
        target: where the cursor is to be held, x, y, z [m].
        torques: of the joints of the arm, shoulder and elbow [N.m].
    """

    force: Vector | None = None
    target: Vector | None = None
    torques: Pair | None = None

    @property
    def mode(self) -> str:
        """What is driven: "force", "position", "torque" or "idle"."""
        if self.target is not None:
            return "position"
        if self.torques is not None:
            return "torque"
        return "idle" if self.force is None else "force"


IDLE = Command()


def finite(value: Any) -> float | None:
    """A number as a float; None for anything else, truth values included.

    Args:
        value: of a message.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        found = float(value)
    except OverflowError:
        return None
    return found if math.isfinite(found) else None


def by_axis(v: Vector) -> dict[str, float]:
    """A vector as messages hold it.

    Args:
        v: along x, y, z.
    """
    return dict(zip(AXES, v, strict=True))
