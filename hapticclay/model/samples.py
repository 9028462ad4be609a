"""Signals from measurements, or from a user's function."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from ..arguments import checked, named
from ..columns.log import Log, Reading, open_log
from ..columns.stamps import times_of
from ..errors import ParameterError, array_of, choice
from . import pieces
from .signals import Signal

Between = Literal["linear", "hold"]
Outside = Literal["hold", "zero"]
COLUMNS = ("t", "fx", "fy")
UNITS = ("N", "m")


@named
@dataclass(frozen=True)
class Samples(Signal):
    """Samples (t, values), interpolated linearly or held.

    Attributes:
        t: times [s], ascending, at least one.
        values: (x, y) at each of them, -1e6 to 1e6, shape (n, 2).
        between: "linear" from sample to sample, or "hold" each sample up to the next.
        outside: before the first and from the last sample on, "hold" that sample, or "zero".
    """

    t: tuple[float, ...]
    values: tuple[tuple[float, float], ...]
    between: Between = "linear"
    outside: Outside = "hold"

    def __post_init__(self):
        t, values = (array_of(f"samples.{x}", getattr(self, x)) for x in ("t", "values"))
        if t.ndim != 1 or not len(t):
            raise ParameterError("samples.t", self.t, "must be a sequence of times")
        if values.shape != (len(t), 2):
            bound = f"must be a pair (x, y) for each of the {len(t)} times"
            raise ParameterError("samples.values", self.values, f"{bound}, has {values.shape}")
        for name, x, most in (("t", t, 1e9), ("values", values, 1e6)):
            good = (np.abs(x) <= most).reshape(len(t), -1).all(axis=1)
            if not good.all():
                i = int(np.argmin(good))
                bound = f"must be finite and {most:g} at most"
                raise ParameterError(f"samples.{name}[{i}]", x[i].tolist(), bound)
        if (np.diff(t) <= 0.0).any():
            i = int(np.argmax(np.diff(t) <= 0.0)) + 1
            bound = f"times must ascend; the time before is {t[i - 1]:.12g} s"
            raise ParameterError(f"samples.t[{i}]", float(t[i]), bound)
        choice("samples.between", self.between, get_args(Between))
        choice("samples.outside", self.outside, get_args(Outside))
        object.__setattr__(self, "t", tuple(t.tolist()))
        object.__setattr__(self, "values", tuple(map(tuple, values.tolist())))

    @classmethod
    @checked
    def of(
        cls,
        path: str | os.PathLike[str] | Log,
        columns: Sequence[str] = COLUMNS,
        between: Between = "linear",
        outside: Outside = "hold",
        *,
        units: Mapping[str, str] | None = None,
    ) -> Samples:
        """Reads samples from a log: text, or a binary format of docs/logs.md.

        A unit in the name of a column, as in "fx [mN]" or "t_ms", or in a row below the names is
        converted to SI.

        Args:
            path: the file, or a log that was read.
            columns: names of the columns with time [s], x and y [N, or m for a position].
            between: as the attribute.
            outside: as the attribute.
            units: unit of a column by name, in place of what the file says.

        Raises:
            ParameterError: the file cannot be read, a column is missing, a cell is not a number, a
                unit is unknown or of another quantity, or the samples are refused.
        """
        if isinstance(columns, str) or len(columns) != 3:
            raise ParameterError("columns", columns, "must name three columns: time, x, y")
        log = open_log("path", path, Reading(units or {}))
        log.check_once(columns)
        t, _ = times_of(log, columns[0])
        x, y = (log.values(name, UNITS) for name in columns[1:])
        if not len(t):
            raise log.table.refusal("must have a line of numbers")
        return cls(t, np.column_stack((x, y)), between, outside)  # type: ignore[arg-type]

    @classmethod
    @checked
    def csv(
        cls,
        path: str | os.PathLike[str],
        columns: Sequence[str] = COLUMNS,
        between: Between = "linear",
        outside: Outside = "hold",
    ) -> Samples:
        """As `of`, by its name in earlier releases.

        Args:
            path: the file.
            columns: as those of `of`.
            between: as the attribute.
            outside: as the attribute.

        Raises:
            ParameterError: as by `of`.
        """
        return cls.of(path, columns, between, outside)

    @cached_property
    def _rows(self) -> np.ndarray:
        """All pieces; the first one precedes the first sample."""
        t, values = np.array(self.t), np.array(self.values)
        slopes = np.zeros_like(values)
        if self.between == "linear" and len(t) > 1:
            slopes[:-1] = np.diff(values, axis=0) / np.diff(t)[:, None]
        before = values[:1]
        if self.outside == "zero":
            before = np.zeros((1, 2))
            values[-1] = 0.0
        t = np.append(t[0] - 1.0, t)
        slopes = np.concatenate((np.zeros((1, 2)), slopes))
        return pieces.straight_pieces(t, np.concatenate((before, values)), slopes)

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        first, last = np.searchsorted(self._rows[:, 0], (begin, end), "right")
        return self._rows[max(first - 1, 0) : max(last, 1)]


@named
@dataclass(frozen=True)
class Function(Signal):
    """Any smooth function of time; where it is not smooth, the order of accuracy drops.

    A run evaluates the function at the ends of each half step and twice in between, and uses the
    cubic through these four values. `mean` uses ten values of the function itself.

    Attributes:
        f: returns (x, y) at a time [s]. It may accept an array of times and return arrays; else it
            is called with one time after another. It is not called for times before 0 or after
            t_max. A signal with a function cannot be written to a file.
    """

    f: Callable[[Any], Any]

    def __post_init__(self):
        if not callable(self.f):
            raise ParameterError("function.f", self.f, "must be a function of time: f(t) = (x, y)")

    def _at(self, t: float) -> tuple[float, float]:
        """Value at one time."""
        bound = f"f({t:.12g}) must be a pair (x, y) of finite numbers"
        try:
            given = self.f(t)
        except Exception as error:  # noqa: BLE001  # whatever a user's function may raise
            why = " ".join(f"{type(error).__name__}: {error}".split())
            raise ParameterError("function.f", self.f, f"{bound}, but raised {why}") from error
        try:
            x, y = (float(v) for v in given)
        except (TypeError, ValueError):
            raise ParameterError("function.f", self.f, f"{bound}, not {given!r:.60}") from None
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ParameterError("function.f", self.f, f"{bound}, not ({x}, {y})")
        return x, y

    def _together(self, t: np.ndarray) -> np.ndarray | None:
        """Values at many times by one call; None if the function does not support arrays."""
        try:
            x, y = self.f(t)
            out = np.column_stack([np.broadcast_to(np.asarray(v, float), t.shape) for v in (x, y)])
        except Exception:  # noqa: BLE001  # whatever a user's function may raise
            return None
        return out if np.isfinite(out).all() else None

    @cached_property
    def _takes_arrays(self) -> list[bool]:
        """Whether one call may pass many times; empty until known."""
        return []

    def _agrees(self, t: np.ndarray, values: np.ndarray) -> bool:
        """Whether three of the values agree with single calls of the function."""
        ask, size = (0, len(t) // 2, len(t) - 1), np.abs(values).max()
        return all(np.allclose(values[i], self._at(float(t[i])), 1e-6, 1e-6 * size) for i in ask)

    def _values(self, t: np.ndarray) -> np.ndarray:
        known = self._takes_arrays
        if known != [False] and len(t) > 2:
            out = self._together(t)
            if not known:
                known.append(out is not None and self._agrees(t, out))
            if out is not None and known == [True]:
                return out
        return np.array([self._at(x) for x in t.tolist()]).reshape(-1, 2)

    def pieces(self, begin: float, end: float, step: float) -> np.ndarray:
        return pieces.interpolate(self._values, pieces.cell_edges(begin, end, 0.5 * step))

    def breaks(self, begin: float, end: float) -> np.ndarray:
        return np.zeros(0)

    def _means(self, t: np.ndarray, h: np.ndarray) -> np.ndarray:
        if not h.any():
            return self._values(t)
        one = np.ones(len(t), dtype=int)
        wide = pieces.integrals(self._values, t - h, t + h, one)
        return np.where(h[:, None] > 0.0, wide / np.where(h > 0.0, 2.0 * h, 1.0)[:, None], self(t))
