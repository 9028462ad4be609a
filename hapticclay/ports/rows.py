"""A growing table of numbers that keeps its newest rows in little memory."""

from __future__ import annotations

import collections
import csv
import io
import os
import threading
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from ..files import atomic

CHUNK = 4096  # rows per allocation
MOST_ROWS = 1_000_000  # 17 minutes at 1 kHz


class Rows:
    """The newest rows of a table, which one thread adds and others may read meanwhile."""

    def __init__(self, width: int, most: int = MOST_ROWS):
        self.count, self._width, self._most = 0, width, most  # rows so far, kept or not
        chunks = -(-most // CHUNK) + 1
        self._chunks: collections.deque[np.ndarray] = collections.deque(maxlen=chunks)
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return min(self.count, self._most)

    def add(self, row: Sequence[float]) -> None:
        with self._lock:
            at = self.count % CHUNK
            if not at:
                self._chunks.append(np.empty((CHUNK, self._width)))
            self._chunks[-1][at] = row
            self.count += 1

    def table(self) -> np.ndarray:
        """The rows that are kept, in order, shape (n, width)."""
        with self._lock:
            chunks, count = list(self._chunks), self.count
        if not count:
            return np.empty((0, self._width))
        last = (count - 1) % CHUNK + 1
        return np.concatenate([*chunks[:-1], chunks[-1][:last]])[-self._most :]


def write_table(path: str | os.PathLike[str], names: Iterable[str], table: np.ndarray) -> Path:
    """Writes a table with exact values as a CSV file, whole or not at all."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(names)
    rows.writerows([[repr(x) for x in row] for row in table.tolist()])
    with atomic(Path(path)) as f:
        f.write(text.getvalue().encode())
    return Path(path)
