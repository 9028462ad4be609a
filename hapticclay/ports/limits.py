"""Limits that protect the hand at a device: length, ramp, rate of change, frozen positions."""

from __future__ import annotations

from typing import Annotated

from ..arguments import part
from ..errors import Bound, Real
from .commands import NOTHING, Vector, shortening

PATIENCE = 0.05  # [s] after which a sample counts as lost


@part()
class Limits:
    """Limits that protect the hand that holds the device.

    Attributes:
        largest_force: longer forces are shortened to this length [N], > 0, at most 100.
        ramp: time over which forces rise from zero, at the start, after a lost sample and after a
            pause longer than `patience` beyond an exchange [s], 0 to 60.
        rate: exchanges per second [Hz], 1 to 1e4; a faster device waits.
        patience: time after which a sample counts as lost [s], 1e-3 to 1.
        period: time per exchange, for a device whose clock advances with its messages [s],
            1e-5 to 1; None to use the computer's clock.
        slew_rate: largest change of the force per time [N/s], > 0, at most 1e6. Between two
            messages the force changes by `largest_force` at most. A zero force is sent at once,
            whatever was sent before.
        frozen: time for which forces may act while the position does not change at all [s], 1e-2 to
            60. After it zero force is sent, until the position changes or zero is requested, and
            the ramp restarts. None for no limit.
    """

    largest_force: Annotated[Real, Bound(0.0, 100.0, "N", above=True)] = 3.0
    ramp: Annotated[Real, Bound(0.0, 60.0, "s")] = 1.0
    rate: Annotated[Real, Bound(1.0, 1e4, "Hz")] = 1000.0
    patience: Annotated[Real, Bound(1e-3, 1.0, "s")] = PATIENCE
    period: Annotated[Real | None, Bound(1e-5, 1.0, "s")] = None
    slew_rate: Annotated[Real, Bound(0.0, 1e6, "N/s", above=True)] = 500.0
    frozen: Annotated[Real | None, Bound(1e-2, 60.0, "s")] = 0.5

    @property
    def Ts(self) -> float:
        """Time between two exchanges [s]."""
        return 1.0 / self.rate if self.period is None else self.period


PLAIN = Limits()


def allowed(force: Vector, largest: float, share: float) -> Vector:
    """A force within its largest length, times the share of the ramp."""
    scale = share * shortening(force, largest)
    if not scale:
        return NOTHING
    return force[0] * scale, force[1] * scale, force[2] * scale


class ForceLimiter:
    """Applies the limits to the forces for a device, one after the other."""

    def __init__(self, limits: Limits):
        """Starts with the ramp, before any force."""
        self._limits, self.withheld = limits, 0  # forces not sent: the position was frozen
        self._ramp_start = 0.0  # [s]
        self._sent, self._sent_at = NOTHING, -limits.Ts  # the newest force, and when [s]
        self._position: Vector | None = None  # the newest
        self._pushed_at: float | None = None  # [s] when a force first acted at this position
        self._is_frozen = False

    def restart(self, t: float) -> None:
        self._ramp_start, self._pushed_at = t, None

    def see(self, position: Vector, t: float) -> None:
        """Compares a position with the one before."""
        if position != self._position:
            self._position, self._pushed_at = position, None
            self._thaw(t)

    def apply(self, force: Vector, t: float, lost: bool = False) -> Vector:
        """The force to send; it counts as sent."""
        limits, passed = self._limits, max(0.0, t - self._sent_at)
        self._sent_at = t
        if passed > limits.Ts + limits.patience:  # the device may have let go meanwhile
            self.restart(t)
        asked = NOTHING if lost else allowed(force, limits.largest_force, self._ramp_share(t))
        if not shortening(force, limits.largest_force):
            self._pushed_at = None
            self._thaw(t)
        self._sent = self._slewed(self._unless_frozen(asked, t), passed)
        return self._sent

    def _ramp_share(self, t: float) -> float:
        """Share of the ramp that has passed, 0 to 1."""
        ramp, passed = self._limits.ramp, t - self._ramp_start
        return 1.0 if passed >= ramp else max(0.0, passed / ramp)

    def _unless_frozen(self, asked: Vector, t: float) -> Vector:
        """The force; zero if forces have acted for too long at a position that does not change."""
        if asked == NOTHING or self._limits.frozen is None:
            return asked
        if self._pushed_at is None:
            self._pushed_at = t
        if t - self._pushed_at >= self._limits.frozen * (1.0 - 1e-9):
            self._is_frozen = True
        self.withheld += self._is_frozen
        return NOTHING if self._is_frozen else asked

    def _thaw(self, t: float) -> None:
        if self._is_frozen:
            self._is_frozen = False
            self.restart(t)

    def _slewed(self, asked: Vector, passed: float) -> Vector:
        """The force, as far from the one before as the rate of change allows."""
        if asked == NOTHING:
            return NOTHING
        limits, before = self._limits, self._sent
        change = tuple(a - b for a, b in zip(asked, before, strict=True))
        share = shortening(change, min(limits.slew_rate * passed, limits.largest_force))
        if share == 1.0:
            return asked
        x, y, z = (b + share * c for b, c in zip(before, change, strict=True))
        return x, y, z
