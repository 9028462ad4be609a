"""Identification of G, Sh and Th from measured columns: time, command or force, position.

The form of the block and the terms of start and end are fitted to the discrete Fourier transform
of the whole record (R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach,
2nd ed., Wiley 2012, ch. 6 and 9). Method and limits: docs/identify.md.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..columns.finding import find
from ..columns.log import Log, Reading, open_log
from ..columns.stamps import times_of
from ..display import brief
from ..errors import ParameterError, array_of, choice
from ..units import parse_unit
from .even_columns import Between, even_columns, unwrapped_where, wrap_note
from .missing_cells import even_rows

COLUMNS = {  # columns of a file and their contents
    "t": "time [s]",
    "input": "command [m] for G, force of the hand on the handle [N] for S and Th",
    "output": "position of the handle [m]",
    "reference": "what drives the experiment, free of noise, in any unit",
}
MEANINGS = {"t": "time", "input": "force or command", "output": "position"}
UNITS = {"t": ("s",), "input": ("N", "m", "N.m", "rad"), "output": ("m", "rad")}
ROTARY = tuple(parse_unit(x)[1] for x in ("N.m", "rad"))  # type: ignore[index]
LEAST_ROWS = 100
LARGEST_VALUE = 1e50  # value in a column; squares and sums of it do not overflow
JITTER = 0.05  # largest deviation of a step from the mean step


@named
@dataclass(frozen=True, eq=False)
class Measurement:
    """Columns measured on an arm, evenly sampled; SI units.

    Each column may have an unknown offset: the zero of a sensor is irrelevant.

    Attributes:
        t: time [s], (n,), n >= 100; no step differs from the mean one by more than 5 %.
        input: for G the command delta [m], for S and Th the force of the hand on the handle, fh
            [N], (n,).
        output: position of the handle [m], (n,).
        reference: excitation of the experiment, independent of all noise, in any unit, (n,); None
            uses the input, for Th the position.
        name: name in titles and files.
        notes: what was done to the rows of a log, one sentence each.
        rotary: whether the output is an angle [rad] and a force a torque [N.m].

    Raises:
        ParameterError: a column is not such an array, is constant or too short; a value is not
            finite; the sampling is uneven.
    """

    def __repr__(self) -> str:
        return brief(self)

    t: np.ndarray
    input: np.ndarray
    output: np.ndarray
    reference: np.ndarray | None = None
    name: str = "data"
    notes: tuple[str, ...] = ()
    rotary: bool = False

    def __post_init__(self):
        for column in COLUMNS:
            value = getattr(self, column)
            if value is not None or column != "reference":
                object.__setattr__(self, column, column_of(column, value, self.t))
        check_sampling(self.t)
        for column in ("input", "output", "reference"):
            value = getattr(self, column)
            if value is not None and np.ptp(value) == 0.0:
                raise ParameterError(column, float(value[0]), "must change; it is constant")

    @property
    def dt(self) -> float:
        """Mean step [s]."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @classmethod
    @checked
    def load(
        cls,
        path: str | os.PathLike[str] | Log,
        columns: Mapping[str, str] | None = None,
        units: Mapping[str, str] | None = None,
        counts: Mapping[str, Any] | None = None,
        held: bool = False,
        rate: float | None = None,
    ) -> Measurement:
        """Reads a log: text, or a binary format of docs/logs.md.

        Values are SI, unless the name of a column holds another unit, as in "time [ms]" or "t_ms",
        a row of units stands below the names, or `units` states one: they are then converted. Rows
        at uneven times are resampled, with a note (docs/logs.md); a last row after a shorter step
        is skipped, because a run ends between two samples.

        Args:
            path: the file, or a log that was read.
            columns: names in the file of t, input, output and reference. One that is not given is
                found if a single column can be meant; a reference is read only if it is given.
            units: unit of a column by name, in place of what the file says, as {"x": "mm"}.
            counts: of an encoder's column by name: counts a turn, or the size of a count, as
                "0.01 mm".
            held: whether a computer holds the input from row to row; it matters where the rows are
                not even.
            rate: rows in a second [Hz], of a file without a time or in place of its own.

        Raises:
            ParameterError: the file cannot be read or holds no table; a column is missing, or
                several can be meant; one is named twice, holds a value that is not a finite number,
                or is in a unit that is unknown or of another quantity; or as `Measurement`.
        """
        for key in columns or {}:
            choice("columns", key, tuple(COLUMNS))
        log = open_log("path", path, Reading(units or {}, counts or {}, rate=rate))
        return measured(log, named_columns(log, columns or {}), "hold" if held else "spline")

    @classmethod
    @checked
    def resampled(
        cls,
        t: Any,
        input: Any,
        output: Any,
        reference: Any = None,
        name: str = "data",
        held: bool = False,
    ) -> Measurement:
        """Makes a measurement from columns whose steps are not even, as `load` does.

        Args:
            t: time [s], (n,).
            input: as the attribute, at these times.
            output: as the attribute, at these times.
            reference: as the attribute, at these times.
            name: as the attribute.
            held: whether a computer holds the input from row to row.

        Raises:
            ParameterError: time goes back, or as `Measurement`.
        """
        given: dict[str, Any] = {"t": t, "input": input, "output": output}
        given |= {} if reference is None else {"reference": reference}
        columns = {key: column_of(key, x, t) for key, x in given.items()}
        made = even_columns(columns, "hold" if held else "spline")
        even: Any = made.columns
        return cls(**even, name=name, notes=made.notes)


def measured(log: Log, names: Mapping[str, str], between: Between = "spline") -> Measurement:
    """The measurement in some columns of a log, `between` whose rows the input is as said."""
    cells, notes = {}, []
    cells["t"], more = times_of(log, names["t"], holes=True)
    notes += more
    for key, name in names.items():
        if key == "t":
            continue
        units = UNITS.get(key)
        cells[key] = log.values(name, units, holes=True) if units else log.raw(name, holes=True)
    raw, turn, at = unwrapped_where(log.raw(names["output"], holes=True))
    if len(at):
        cells["output"] = raw * log.size(log.place(names["output"]), UNITS["output"])[0]
        notes.append(wrap_note(turn, at, cells["t"]))
    made = even_rows(log, cells, names, between)
    given: dict[str, Any] = {**made.columns, "notes": (*notes, *made.notes)}
    return Measurement(**given, name=log.path.name, rotary=_is_rotary(log, names))


def _is_rotary(log: Log, names: Mapping[str, str]) -> bool:
    """Whether input and output are of a motion about an axis, by the units that they state."""
    keys = [key for key in ("input", "output") if key in names]
    powers = {key: log.size(log.place(names[key]), UNITS[key])[1] for key in keys}
    rotary = {key: x in ROTARY for key, x in powers.items() if x is not None}
    if len(set(rotary.values())) > 1:
        (about,) = [names[key] for key, x in rotary.items() if x]
        bound = "must both be along a line, in N and m, or about an axis, in N.m and rad"
        raise log.table.refusal(f"input and output {bound}; only {about!r} is about an axis")
    return any(rotary.values())


def named_columns(log: Log, given: Mapping[str, str], **meanings: str) -> dict[str, str]:
    """Names in the file by key: those that are given, and those that are found."""
    names = {
        key: find(log, f"columns.{key}", key, meaning)
        for key, meaning in {**MEANINGS, **meanings}.items()
        if key not in given
    }
    for key, name in given.items():
        names[key] = log.names[log.place(name, f"columns.{key}")]
    for name in names.values():
        keys = [key for key in COLUMNS if names.get(key) == name]
        if len(keys) > 1:
            raise ParameterError(
                "columns", name, f"is {' and '.join(keys)}, which are different columns"
            )
    return {key: names[key] for key in COLUMNS if key in names}


def column_of(name: str, value: Any, t: Any) -> np.ndarray:
    """A column as an array of floats, as long as t."""
    x = array_of(name, value, "must be an array of numbers")
    if x.ndim != 1 or len(x) < LEAST_ROWS:
        bound = f"must be one column of {LEAST_ROWS} rows or more"
        given = f"{len(x)} rows" if x.ndim == 1 else f"array of shape {x.shape}"
        raise ParameterError(name, given, bound)
    if len(x) != len(t):
        raise ParameterError(name, f"{len(x)} samples", f"must be as long as t, {len(t)} samples")
    within = np.abs(x) <= LARGEST_VALUE
    if not np.all(within):
        row = int(np.argmin(within))
        bound = f"must be a finite number within +- {LARGEST_VALUE:g}"
        raise ParameterError(f"{name}[{row}]", float(x[row]), bound)
    return x


def check_sampling(t: np.ndarray) -> None:
    """Refuse steps that differ from the mean step."""
    mean = (t[-1] - t[0]) / (len(t) - 1)
    if not mean > 0.0:
        raise ParameterError("t", float(t[-1] - t[0]), "must increase")
    off = np.abs(np.diff(t) / mean - 1.0)
    row = int(np.argmax(off))
    if off[row] > JITTER:
        bound = (
            f"steps must be within {100 * JITTER:g} % of their mean, {mean:.6g} s; "
            f"that from row {row} to {row + 1} is {t[row + 1] - t[row]:.6g} s"
        )
        raise ParameterError(f"t[{row + 1}]", float(t[row + 1]), bound)
