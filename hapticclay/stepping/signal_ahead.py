"""What drives a run, the muscle force and the command, made ready for the loops part by part."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model import pieces
from ..model.signals import Signal

NEAR = 1e-6  # of dt: a jump of a signal so close to the end of a step is at its end


class Drive:
    """A signal, and its pieces over the part of a run that comes next.

    Args:
        signal: the signal.
        dt: step of the run [s].
        from_start: count the pieces from their value at t = 0.

    Attributes:
        signal: the signal.
        cosines: number of its multisines' lines.
        table: for the loops, see model.pieces.
    """

    def __init__(self, signal: Signal, dt: float, from_start: bool):
        self.signal, self.dt = signal, dt
        lines = signal.cosines
        self.cosines, self._lines = len(lines), lines
        self._slack, self._first = NEAR * dt, np.zeros(2)
        self._pieces = pieces.NO_PIECES
        self.table = pieces.loop_table(lines, self._pieces, self._slack)
        if from_start:
            self.prepare(0.0, dt)
            if len(self._pieces):
                now = np.zeros(1)
                self._first = pieces.pieces_value(self._pieces, now, now + self._slack)[0]

    def prepare(self, begin: float, end: float) -> None:
        """Makes the pieces of the part of a run that comes next, and with them the table.

        Args:
            begin: of the part, a whole multiple of dt [s].
            end: of the part, a whole multiple of dt or the end of the run [s].
        """
        made = self.signal.pieces(begin, end, self.dt)
        if len(made):
            made = made.copy()
            made[:, [1, 5]] -= self._first
            self.table = pieces.loop_table(self._lines, made, self._slack)
        self._pieces = made

    def breaks(self, begin: float, end: float) -> np.ndarray:
        """Times in the part made ready at which a step must end: jumps, and kinks off the samples.

        Args:
            begin: of the part [s].
            end: of the part [s].

        Returns:
            Ascending [s], shape (n,).
        """
        t = self.signal.breaks(begin, end)
        t = t[(t > begin) & (t < end)]
        if not len(t):
            return t
        before, after = (
            pieces.pieces_value(self._pieces, t, t + s * self._slack) for s in (-1.0, 1.0)
        )
        jumps = np.abs(after - before).max(axis=1) > 1e-12 * np.abs(after + before).max(axis=1)
        off = np.abs(t / self.dt - np.rint(t / self.dt)) > NEAR
        return t[jumps | off]

    def mean(self, t: np.ndarray, h: float) -> np.ndarray:
        """Mean over [t - h, t + h]; for h = 0 the value from t on.

        Args:
            t: centres of the intervals [s], shape (n,), in the part made ready.
            h: half their length [s].

        Returns:
            Shape (n, 2).
        """
        out = self.signal.mean_of_multisines(t, h)
        if len(self._pieces):
            if h == 0.0:
                return out + pieces.pieces_value(self._pieces, t, t + self._slack)
            return out + pieces.pieces_mean(self._pieces, t, np.full(len(t), h))
        return out

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Value from each time on.

        Args:
            t: times [s], shape (n,), in the part made ready.

        Returns:
            Shape (n, 2).
        """
        return self.mean(t, 0.0)

    def around(self, t: np.ndarray, h: float) -> np.ndarray:
        """Value at times, of pieces the mean over h before and after, or over less next to t = 0.

        Args:
            t: times [s], shape (n,), in the part made ready.
            h: half the length of that interval [s].

        Returns:
            Shape (n, 2).
        """
        out = self.signal.mean_of_multisines(t, 0.0)
        if len(self._pieces):
            out = out + pieces.pieces_mean(self._pieces, t, np.minimum(h, t))
        return out

    def since_start(self, t: np.ndarray) -> Any:
        """Change since t = 0, of a drive that counts its pieces from there.

        Args:
            t: times [s], shape (n,), in the part made ready.

        Returns:
            Shape (n, 2).
        """
        out = self.signal.mean_of_multisines(t, 0.0)
        out = out - self.signal.mean_of_multisines(np.zeros(1), 0.0)
        if len(self._pieces):
            out = out + pieces.pieces_value(self._pieces, t, t + self._slack)
        return out
