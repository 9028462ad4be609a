"""A growing table of numbers that keeps its newest rows in little memory."""

from __future__ import annotations

import collections
from collections.abc import Sequence

import numpy as np

CHUNK = 4096  # rows per allocation
MOST_ROWS = 1_000_000  # 17 minutes at 1 kHz


class Rows:
    """The newest rows of a table.

    Attributes:
        count: number of rows so far, kept or not.
    """

    def __init__(self, width: int, most: int = MOST_ROWS):
        """Makes an empty table."""
        self.count, self._width, self._most = 0, width, most
        chunks = -(-most // CHUNK) + 1
        self._chunks: collections.deque[np.ndarray] = collections.deque(maxlen=chunks)

    def __len__(self) -> int:
        return min(self.count, self._most)

    def add(self, row: Sequence[float]) -> None:
        """Adds a row."""
        at = self.count % CHUNK
        if not at:
            self._chunks.append(np.empty((CHUNK, self._width)))
        self._chunks[-1][at] = row
        self.count += 1

    def table(self) -> np.ndarray:
        """The rows that are kept, in order, shape (n, width)."""
        if not self.count:
            return np.empty((0, self._width))
        last = (self.count - 1) % CHUNK + 1
        parts = [*list(self._chunks)[:-1], self._chunks[-1][:last]]
        return np.concatenate(parts)[-self._most :]
