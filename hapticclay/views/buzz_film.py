"""The film of a buzz: the last swings of a run, slowed and magnified."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..simulation.record import Record
from .film import FilmOptions

SWINGS = 8  # that are shown
SHOWN = 1.0  # [s] of the film that a swing takes
SWUNG = 0.25  # [rad] to which the largest motion of a joint is magnified
WHOLE = 8.0  # [s] that the film of a motion without swings takes


def buzz_of(record: Record, frequency: float) -> tuple[Record, FilmOptions]:
    """The last swings of a run, and the options of their film.

    Args:
        record: the run.
        frequency: of the swings [Hz]; 0 for none.
    """
    end = float(record.t[-1])
    begin = max(0.0, end - SWINGS / frequency) if frequency > 0.0 else 0.0
    kept = slice(int(np.searchsorted(record.t, begin)), None)
    names = ("p", "v", "fh", "fe", "b", "q", "qd", "tau", "delta")
    arrays: dict[str, Any] = {name: getattr(record, name)[kept] for name in names}
    shown = replace(record, t=record.t[kept] - record.t[kept][0], **arrays)
    moved = float(np.abs(shown.q - np.median(shown.q, axis=0)).max())
    speed = 1.0 / (SHOWN * frequency) if frequency > 0.0 else end / WHOLE
    magnify = min(max(SWUNG / max(moved, 1e-12), 1.0), 1e9)
    return shown, FilmOptions(speed=min(max(speed, 2e-3), 1e3), magnify=magnify)
