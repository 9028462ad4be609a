"""Exchanges of a client and the device, one row per message."""

from __future__ import annotations

import csv
import io
import os
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..arguments import checked, named
from ..columns import Sheet, unreadable
from ..files import atomic
from .rows import MOST_ROWS, Rows

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
    """A message and its answer.

    Attributes:
        received: when the message came, on the computer's clock [s].
        began: simulated time from which its force acted [s].
        sampled: simulated time at which the answered state was measured [s].
        position: answered position of the handle in the plane of the arm [m].
        velocity: answered velocity of the handle [m/s].
        asked: force that the client requested [N]: in the plane of the arm, and normal to it.
        applied: force of all clients on the handle, in the plane of the arm, after the limit [N].
    """

    received: float
    began: float
    sampled: float
    position: tuple[float, float]
    velocity: tuple[float, float]
    asked: tuple[float, float, float]
    applied: tuple[float, float]


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
        text = io.StringIO()
        rows = csv.writer(text, lineterminator="\n")
        rows.writerow(COLUMNS)
        rows.writerows([[repr(float(x)) for x in row] for row in self.table()])
        with atomic(Path(path)) as f:
            f.write(text.getvalue().encode())
        return Path(path)

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
        try:
            sheet = Sheet.read("record", file)
        except OSError as error:
            raise unreadable("record", file, error) from None
        if tuple(sheet.head) != COLUMNS:
            raise sheet.refusal("must be a file of exchanges (other columns)")
        columns = sheet.numbers({name: i for i, name in enumerate(COLUMNS)}, {})
        return cls.of_table(np.column_stack([columns[name] for name in COLUMNS]))


FILE = "exchanges.csv"  # stored with the record of a session


class ExchangeLog:
    """Keeps the newest exchanges."""

    def __init__(self, most: int = MOST_ROWS):
        """Makes an empty log."""
        self._rows = Rows(len(COLUMNS), most)

    @property
    def count(self) -> int:
        """Number of exchanges so far, kept or not."""
        return self._rows.count

    def add(self, row: Exchange) -> None:
        """Adds an exchange."""
        times, (position, velocity, asked, applied) = row[:3], row[3:]
        self._rows.add((*times, *position, *velocity, *asked, *applied))

    def exchanges(self) -> Exchanges:
        """The exchanges that are kept."""
        return Exchanges.of_table(self._rows.table())
