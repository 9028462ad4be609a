"""Commands of a client to a device, independent of the protocol."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

Vector = tuple[float, float, float]
Pair = tuple[float, float]
Numbers = tuple[float, ...]  # along the axes of a handle, or by joint

NOTHING: Vector = (0.0, 0.0, 0.0)
AXES = ("x", "y", "z")
LONGEST_TEXT = 256  # characters of a name or id from a message


class Quantity(NamedTuple):
    """A quantity in messages, and the bound of its numbers."""

    name: str  # name in notices
    most: float  # largest magnitude that counts as a number of this quantity
    unit: str


# far beyond any device, so that what lies outside is rubbish, and far below overflow
POSITION = Quantity("position", 1e3, "m")
VELOCITY = Quantity("velocity", 1e3, "m/s")
FORCE = Quantity("force", 1e6, "N")
TORQUE = Quantity("torque", 1e6, "N.m")
ANGLE = Quantity("angle", 1e6, "deg")
RATE = Quantity("rate", 1e9, "deg/s")


@dataclass(frozen=True)
class Command:
    """The command in a message; None for what the message does not contain."""

    force: Vector | None = None  # [N] on the cursor, along x, y, z of the device
    target: Vector | None = None  # [m] at which to hold the cursor
    torques: Numbers | None = None  # [N.m] on the joints, [N] on those that slide

    @property
    def mode(self) -> str:
        """Which quantity is driven: "force", "position", "torque" or "idle"."""
        if self.target is not None:
            return "position"
        if self.torques is not None:
            return "torque"
        return "idle" if self.force is None else "force"


IDLE = Command()


class Joints(NamedTuple):
    """The joints of a device."""

    names: tuple[str, ...]
    positions: Numbers  # [rad], [m] of those that slide
    rates: Numbers  # [rad/s], [m/s]
    torques: Numbers  # [N.m], [N] that clients apply to them


def finite(value: Any) -> float | None:
    """A number as a float; None for anything else, including bool."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        found = float(value)
    except OverflowError:
        return None
    return found if math.isfinite(found) else None


def read_numbers(
    given: Mapping[str, Any], names: Sequence[str], quantity: Quantity
) -> tuple[tuple[float, ...] | None, str]:
    """Reads the numbers of a quantity from a message; a missing one is 0."""
    values = [finite(given.get(name, 0.0)) for name in names]
    found = tuple(x for x in values if x is not None)
    if len(found) < len(values):
        return None, f"{quantity.name} is not finite"
    if not is_bounded(found, quantity):
        return None, f"{quantity.name} is beyond {quantity.most:g} {quantity.unit}"
    return found, ""


def is_bounded(values: Iterable[float], quantity: Quantity) -> bool:
    """Whether numbers are finite and within the bound of a quantity."""
    return all(abs(x) <= quantity.most for x in values)


def short_text(value: Any) -> str | None:
    """A text of at most LONGEST_TEXT characters; None for anything else."""
    return value if isinstance(value, str) and len(value) <= LONGEST_TEXT else None


def shortening(v: Sequence[float], most: float) -> float:
    """The factor, 0 to 1, that shortens a vector to a length; 0 if the vector is not finite."""
    top = max(map(abs, v), default=0.0)
    if not top or not all(map(math.isfinite, v)):
        return 0.0
    size = math.hypot(*v)
    if math.isfinite(size):
        return min(1.0, most / size)
    return most / top / math.hypot(*(x / top for x in v))  # the length overflows


def by_axis(v: Vector) -> dict[str, float]:
    """A vector in the form used in messages."""
    return dict(zip(AXES, v, strict=True))
