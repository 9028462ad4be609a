"""A sampled linear control of one end of a pair."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Control(NamedTuple):
    """x+ = A x + B y + C r; torque and message are sums of the same kind.

    y is (q, v, F): positions, measured rates and the torque on what the arm carries, of n joints;
    r is what arrives, m numbers. A joint law pulls to zero besides: it is not part of this.

    Attributes:
        torque: of (y, r, x), shape (n, 3n + m + k).
        message: of (y, r, x), shape (m, 3n + m + k).
        state: of (y, r, x), shape (k, 3n + m + k).
    """

    torque: np.ndarray
    message: np.ndarray
    state: np.ndarray

    @property
    def states(self) -> int:
        """Number of states k."""
        return len(self.state)

    @property
    def feels(self) -> bool:
        """Whether it needs the measured force."""
        n = len(self.torque)
        return any(np.any(x[:, 2 * n : 3 * n]) for x in self)

    @property
    def echoes(self) -> bool:
        """Whether what arrives is in the message of the same sample."""
        n, m = len(self.torque), len(self.message)
        return bool(np.any(self.message[:, 3 * n : 3 * n + m]))


def without_states(torque: np.ndarray, message: np.ndarray, own: np.ndarray | None = None):
    """A control that adds torque r, and sends the message of y.

    Args:
        torque: shape (n, m).
        message: shape (m, 3n).
        own: torque of y, shape (n, 3n); None for none.
    """
    n, m = torque.shape
    own = np.zeros((n, 3 * n)) if own is None else own
    return Control(
        np.hstack([own, torque]),
        np.hstack([message, np.zeros((m, m))]),
        np.zeros((0, 3 * n + m)),
    )
