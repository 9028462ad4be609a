"""Simulated time paced by real time."""

from __future__ import annotations

from collections import deque

import numpy as np

FRAME_TIME = 1.0 / 60.0  # [s] between two slices
LONGEST_SLICE = 0.05  # [s]; the clock slows down if the machine needs longer
LATE_EDGES = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0)  # of a histogram [ms]
RECENT = 1.0  # [s] over which the real-time factor is averaged


class Clock:
    """Schedules simulated time in real time, and slows down on a machine that is too slow.

    `late` is a histogram of the lateness of the `frames` slices, with edges LATE_EDGES; `slow` says
    whether the machine is too slow now.
    """

    def __init__(self, span: float = FRAME_TIME):
        self._span = span
        self.frames, self.late, self.slow = 0, np.zeros(len(LATE_EDGES) - 1, dtype=int), False
        self.real = self.simulated = 0.0  # elapsed and scheduled [s]
        self._recent: deque[tuple[float, float]] = deque(maxlen=round(RECENT / span))
        self._then: float | None = None
        self._owed = 0.0

    def due(self, now: float) -> float:
        """Returns the simulated time to advance now [s], at most LONGEST_SLICE."""
        passed = self._span if self._then is None else now - self._then
        self._then = now
        self._owed += passed
        due = min(self._owed, LONGEST_SLICE)
        self._owed -= due
        self.slow = self._owed > 0.5 * LONGEST_SLICE
        if self._owed > LONGEST_SLICE:  # the rest is lost
            self._owed = LONGEST_SLICE
        self.frames += 1
        self.real += passed
        self.simulated += due
        late = min(max(1e3 * (passed - self._span), 0.0), LATE_EDGES[-1] - 1e-9)
        self.late[np.searchsorted(LATE_EDGES, late, "right") - 1] += 1
        self._recent.append((passed, due))
        return due

    def rest(self) -> None:
        """Skips real time without catching up: a pause."""
        self._then, self._owed = None, 0.0

    @property
    def factor(self) -> float:
        """Real-time factor: simulated over real time, averaged over the last frames."""
        real, simulated = (
            (sum(x) for x in zip(*self._recent, strict=True)) if self._recent else (1.0, 1.0)
        )
        return simulated / real
