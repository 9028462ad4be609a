"""Exchanges of a client with a device: rate, latency, and columns for identification."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..arguments import named
from ..errors import ParameterError, integer
from .commands import AXES, Vector
from .rows import MOST_ROWS, Rows, write_table

FILE = "device.csv"  # stored with the record of a session
FEWEST = 2


class Exchanged(NamedTuple):
    """A force that was sent to the cursor, and the answer."""

    sent: float  # [s] on the computer's clock
    received: float  # [s] on the same clock
    t: float  # [s] assigned to the answer
    position: Vector  # [m]
    velocity: Vector  # [m/s]
    force: Vector  # [N] that was sent


class Timing(NamedTuple):
    """How regular the exchanges were.

    Attributes:
        exchanges: number of exchanges answered in time.
        missed: number of exchanges not answered in time.
        rate: mean rate [Hz].
        interval: median and 99th percentile of the time between two answers [s].
        latency: median and 99th percentile of the time from a force to the answer [s].
        jitter: standard deviation of the interval [s].
        skipped: number of frames of the device that were not used: a newer one came, they came too
            late, or they did not hold the device.
        withheld: number of forces that were not sent because the position was frozen.
    """

    exchanges: int
    missed: int
    rate: float
    interval: tuple[float, float]
    latency: tuple[float, float]
    jitter: float
    skipped: int = 0
    withheld: int = 0

    def summary(self) -> dict[str, Any]:
        """The values with their units, for the notes of a record."""
        return {
            "exchanges": self.exchanges,
            "missed": self.missed,
            "rate_hz": self.rate,
            "interval_p50_p99_s": list(self.interval),
            "latency_p50_p99_s": list(self.latency),
            "jitter_s": self.jitter,
            "skipped": self.skipped,
            "withheld": self.withheld,
        }


@named
class ClientLog:
    """Keeps the newest exchanges.

    Attributes:
        missed: exchanges without an answer in time.
        skipped: frames of the device that were not used.
        withheld: forces that were not sent because the position was frozen.
    """

    def __init__(self, most: int = MOST_ROWS):
        """Makes an empty log.

        Args:
            most: number of newest rows to keep, 1 to 10^9.

        Raises:
            ParameterError: most is out of its bounds.
        """
        self.missed = self.skipped = self.withheld = 0
        self._rows = Rows(12, integer("most", most, 1, 10**9))  # numbers of an Exchanged

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def rows(self) -> list[Exchanged]:
        """The rows that are kept, in order."""
        out = []
        for x in self._rows.table().tolist():
            place, rate, force = ((a, b, c) for a, b, c in (x[3:6], x[6:9], x[9:12]))
            out.append(Exchanged(x[0], x[1], x[2], place, rate, force))
        return out

    def add(self, row: Exchanged) -> None:
        """Adds an exchange.

        Args:
            row: the exchange.
        """
        self._rows.add((*row[:3], *row.position, *row.velocity, *row.force))

    def timing(self) -> Timing:
        """Timing of the exchanges; NaN if there are fewer than two."""
        rows = self.rows
        if len(rows) < FEWEST:
            none = math.nan, math.nan
            counts = self.skipped, self.withheld
            return Timing(len(rows), self.missed, math.nan, none, none, math.nan, *counts)
        sent, received = np.array([r[:2] for r in rows]).T
        gaps, late = np.diff(received), received - sent
        return Timing(
            len(rows),
            self.missed,
            float(1.0 / gaps.mean()),
            (float(np.median(gaps)), float(np.quantile(gaps, 0.99))),
            (float(np.median(late)), float(np.quantile(late, 0.99))),
            float(gaps.std()),
            self.skipped,
            self.withheld,
        )

    def columns(self) -> dict[str, np.ndarray]:
        """Evenly sampled columns: t_s, x_m, y_m, z_m and the force on the handle fx_N, fy_N, fz_N.

        The step is the median time between two answers. Positions are interpolated linearly between
        answers. Each force is the one that the device held from that time on.

        Raises:
            ParameterError: there are fewer than two exchanges.
        """
        rows = self.rows
        if len(rows) < FEWEST:
            raise ParameterError("log", len(rows), "must hold two exchanges or more")
        t = np.array([r.t for r in rows])
        step = float(np.median(np.diff(t)))
        even = t[0] + step * np.arange(int((t[-1] - t[0]) / step + 1e-6) + 1)
        place = np.array([r.position for r in rows])
        force = np.array([r.force for r in rows])
        # the force sent after an answer acts until the next answer
        held = np.minimum(np.searchsorted(t, even + 1e-9 * step, side="right"), len(rows) - 1)
        out = {"t_s": even}
        out |= {f"{a}_m": np.interp(even, t, place[:, i]) for i, a in enumerate(AXES)}
        return out | {f"f{a}_N": force[held, i] for i, a in enumerate(AXES)}

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the columns as a CSV file, whole or not at all.

        `hapticclay identify --csv` and `hapticclay fit` read it.

        Args:
            path: the file.

        Returns:
            The file.

        Raises:
            ParameterError: there are fewer than two exchanges, or the file cannot be written.
        """
        columns = self.columns()
        return write_table(path, columns, np.column_stack(list(columns.values())))
