"""Exchanges of a client and the device, one row per message."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..arguments import checked, named
from ..columns.log import open_log
from .commands import AXES, Numbers
from .rows import MOST_ROWS, Rows, write_table

FILE = "exchanges.csv"  # stored with the record of a session
TIMES = ("received_s", "began_s", "sampled_s")
VECTORS = ("{}_m", "v{}_m_per_s", "asked_{}_N", "applied_{}_N")
ACROSS = "asked_across_N"  # where the handle moves along two axes


def columns_of_axes(axes: int) -> tuple[str, ...]:
    """Names of the columns for a handle of two or three axes."""
    groups = [[form.format(axis) for axis in AXES[:axes]] for form in VECTORS]
    if axes < len(AXES):
        groups[2].append(ACROSS)
    return TIMES + tuple(name for group in groups for name in group)


COLUMNS = {axes: columns_of_axes(axes) for axes in (2, 3)}


class Exchange(NamedTuple):
    """A message and its answer."""

    received: float  # [s] when the message came, on the computer's clock
    began: float  # [s] simulated time from which its force acted
    sampled: float  # [s] simulated time at which the answered state was measured
    position: Numbers  # [m] of the handle along its axes, as answered
    velocity: Numbers  # [m/s] of the handle, as answered
    asked: Numbers  # [N] by this client: along its axes, and along the third if there are two
    applied: Numbers  # [N] of all clients on the handle, after the limit


@named
@dataclass(frozen=True, eq=False)
class Exchanges:
    """Exchanges of one client and the device, one row per message.

    Attributes:
        received: when each message came, on the computer's clock [s], shape (n,).
        began: simulated time from which its force acted [s], shape (n,).
        sampled: simulated time at which the answered state was measured [s], shape (n,).
        position: position of the handle along its axes, in the plane of a planar arm [m], shape
            (n, 2) or (n, 3).
        velocity: velocity of the handle [m/s], likewise.
        asked: force that the client requested [N], shape (n, 3): along these axes; if there are
            two, then across them, where the arm cannot act.
        applied: force on the handle along these axes [N], likewise.
    """

    received: np.ndarray
    began: np.ndarray
    sampled: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    asked: np.ndarray
    applied: np.ndarray

    def __len__(self) -> int:
        return len(self.received)

    def __repr__(self) -> str:
        return f"<Exchanges: {len(self)} messages>"

    @classmethod
    def of_table(cls, table: np.ndarray) -> Exchanges:
        """Makes exchanges from a table.

        Args:
            table: columns as in the file, shape (n, 12), or (n, 15) for a handle of three axes.
        """
        t = np.asarray(table, float)
        axes = next((n for n, names in COLUMNS.items() if t.shape[-1] == len(names)), 2)
        t = t.reshape(-1, len(COLUMNS[axes]))
        vectors = np.split(t[:, 3:], [axes, 2 * axes, 2 * axes + 3], axis=1)
        return cls(t[:, 0], t[:, 1], t[:, 2], *vectors)

    @property
    def axes(self) -> int:
        """Number of axes along which the handle moves."""
        return self.position.shape[1]

    def table(self) -> np.ndarray:
        """All exchanges, columns as in the file, shape (n, 12) or (n, 15)."""
        times = self.received, self.began, self.sampled
        return np.column_stack([*times, self.position, self.velocity, self.asked, self.applied])

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes a CSV file with exact values, whole or not at all.

        Args:
            path: the file.

        Returns:
            The file.

        Raises:
            OSError: the file cannot be written.
        """
        return write_table(path, COLUMNS[self.axes], self.table())

    @classmethod
    @checked
    def load(cls, path: str | os.PathLike[str]) -> Exchanges:
        """Reads what `save` wrote.

        Args:
            path: the file, or the folder of a record with an exchanges.csv.

        Raises:
            ParameterError: the file cannot be read, or holds something else.
        """
        file = Path(path) / FILE if os.path.isdir(path) else Path(path)
        log = open_log("record", file)
        if log.names not in COLUMNS.values():
            raise log.table.refusal("must be a file of exchanges (other columns)")
        return cls.of_table(np.column_stack([log.raw(name) for name in log.names]))


class ExchangeLog:
    """Keeps the newest exchanges."""

    def __init__(self, most: int = MOST_ROWS, axes: int = 2):
        self._rows = Rows(len(COLUMNS[axes]), most)

    @property
    def count(self) -> int:
        """Number of exchanges so far, kept or not."""
        return self._rows.count

    def add(self, row: Exchange) -> None:
        times, (position, velocity, asked, applied) = row[:3], row[3:]
        self._rows.add((*times, *position, *velocity, *asked, *applied))

    def exchanges(self) -> Exchanges:
        return Exchanges.of_table(self._rows.table())
