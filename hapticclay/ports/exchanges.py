"""Exchanges of a client and the device, one row per message."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..arguments import checked, named
from ..columns.log import open_log
from .rows import MOST_ROWS, Rows, write_table

FILE = "exchanges.csv"  # stored with the record of a session
COLUMNS = (
    "received_s",
    "began_s",
    "sampled_s",
    "x_m",
    "y_m",
    "vx_m_per_s",
    "vy_m_per_s",
    "asked_x_N",
    "asked_y_N",
    "asked_across_N",
    "applied_x_N",
    "applied_y_N",
)


class Exchange(NamedTuple):
    """A message and its answer."""

    received: float  # [s] when the message came, on the computer's clock
    began: float  # [s] simulated time from which its force acted
    sampled: float  # [s] simulated time at which the answered state was measured
    position: tuple[float, float]  # [m] of the handle in the plane of the arm, as answered
    velocity: tuple[float, float]  # [m/s] of the handle, as answered
    asked: tuple[float, float, float]  # [N] by this client: in that plane, and normal to it
    applied: tuple[float, float]  # [N] of all clients on the handle, after the limit


@named
@dataclass(frozen=True, eq=False)
class Exchanges:
    """Exchanges of one client and the device, one row per message.

    Attributes:
        received: when each message came, on the computer's clock [s], shape (n,).
        began: simulated time from which its force acted [s], shape (n,).
        sampled: simulated time at which the answered state was measured [s], shape (n,).
        position: position of the handle in the plane of the arm [m], shape (n, 2).
        velocity: velocity of the handle [m/s], shape (n, 2).
        asked: force that the client requested [N], shape (n, 3): in the plane of the arm, and
            normal to it, where the planar arm cannot act.
        applied: force on the handle in the plane of the arm [N], shape (n, 2).
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
            table: columns as in COLUMNS, shape (n, 12).
        """
        t = np.asarray(table, float).reshape(-1, len(COLUMNS))
        return cls(t[:, 0], t[:, 1], t[:, 2], t[:, 3:5], t[:, 5:7], t[:, 7:10], t[:, 10:12])

    def table(self) -> np.ndarray:
        """All exchanges, columns as in COLUMNS, shape (n, 12)."""
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
        return write_table(path, COLUMNS, self.table())

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
        if log.names != COLUMNS:
            raise log.table.refusal("must be a file of exchanges (other columns)")
        return cls.of_table(np.column_stack([log.raw(name) for name in COLUMNS]))


class ExchangeLog:
    """Keeps the newest exchanges."""

    def __init__(self, most: int = MOST_ROWS):
        self._rows = Rows(len(COLUMNS), most)

    @property
    def count(self) -> int:
        """Number of exchanges so far, kept or not."""
        return self._rows.count

    def add(self, row: Exchange) -> None:
        times, (position, velocity, asked, applied) = row[:3], row[3:]
        self._rows.add((*times, *position, *velocity, *asked, *applied))

    def exchanges(self) -> Exchanges:
        return Exchanges.of_table(self._rows.table())
