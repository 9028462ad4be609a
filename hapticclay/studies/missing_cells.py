"""Rows that lack cells: left out as rows that are missing; or topics side by side, joined in time.

Where few rows lack a cell, those rows were lost. Where columns hardly share rows, each has stamps
of its own, as topics that were saved side by side: the others are interpolated onto the rows of the
column that has most.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..columns.log import Log
from ..columns.stamps import Stamps
from .even_columns import Between, Columns, Even, Restarted, even_columns
from .restarts import episodes

SHARED = 0.5  # of a column's rows: those of topics side by side share fewer with the others


def even_rows(log: Log, cells: Columns, names: Mapping[str, str], between: Between) -> Even:
    """Columns of a log at even times, without missing cells, and what was done.

    `names`: of the columns in the file; `between`: how the input is between the rows.
    """
    for key, x in cells.items():
        if len(x) and not np.isfinite(x).any():
            raise log.table.bad_cell(0, log.place(names[key]))
    first = [name for name in names.values() if f"{name}#2" in log.names]
    notes = [f"{name} is the first of the columns of this name" for name in first]
    cells, more = whole_rows(cells, names, {"input": between})
    try:
        made = even_columns(cells, between)
    except Restarted as error:
        runs = episodes(log, names["t"])
        raise error.told_apart_by(runs.where() if runs else "") from None
    return Even(made.columns, (*notes, *more, *made.notes))


def whole_rows(
    cells: Columns, names: Mapping[str, str], between: Mapping[str, Between]
) -> tuple[Columns, list[str]]:
    """Columns without missing cells, t among them, and what was done, one sentence each.

    `names`: of the columns in the file; `between`: how a column is between its rows, by default a
    spline.
    """
    cells = {key: x[np.isfinite(cells["t"])] for key, x in cells.items()}
    there = {key: np.isfinite(x) for key, x in cells.items() if key != "t"}
    counts = {key: int(np.count_nonzero(x)) for key, x in there.items()}
    total, shared = len(cells["t"]), np.logical_and.reduce([*there.values()])
    if shared.all() or not all(counts.values()):
        return cells, []
    if np.count_nonzero(shared) >= SHARED * min(counts.values()):
        lacking = ", ".join(names[key] for key, n in counts.items() if n < total)
        rows = total - int(np.count_nonzero(shared))
        note = f"{rows} of {total} rows lack a value of {lacking}: taken as rows that are missing"
        return {key: x[shared] for key, x in cells.items()}, [note]
    base = max(counts, key=lambda key: (counts[key], key == "output"))
    return _on_rows_of(base, cells, names, between)


def _on_rows_of(
    base: str, cells: Columns, names: Mapping[str, str], between: Mapping[str, Between]
) -> tuple[Columns, list[str]]:
    """The other columns at the times of one."""
    mine = np.isfinite(cells[base])
    t, out, notes = cells["t"][mine], {base: cells[base][mine]}, []
    covered = np.ones(len(t), dtype=bool)
    for key, x in cells.items():
        if key in ("t", base):
            continue
        good = np.isfinite(x)
        own, first = np.unique(cells["t"][good], return_index=True)
        out[key] = _between(own, x[good][first], t, between.get(key, "spline"))
        covered &= _is_covered(t, Stamps(own))
        notes.append(
            f"{names[key]} has stamps of its own, at {Stamps(own).rate:.4g} Hz: it is interpolated "
            f"onto those of {names[base]}"
        )
    out["t"] = t
    return {key: x[covered] for key, x in out.items()}, notes


def _between(own: np.ndarray, x: np.ndarray, t: np.ndarray, way: Between) -> np.ndarray:
    """A column at other times: by a cubic spline, by lines, or held from stamp to stamp."""
    from scipy.interpolate import CubicSpline

    if way == "hold":
        return x[np.clip(np.searchsorted(own, t, "right") - 1, 0, len(x) - 1)]
    if way == "linear" or len(own) < 4:
        return np.interp(t, own, x)
    return CubicSpline(own, x)(np.clip(t, own[0], own[-1]))


def _is_covered(t: np.ndarray, own: Stamps) -> np.ndarray:
    """Whether times are between stamps that are no gap."""
    inside = (t >= own.t[0]) & (t <= own.t[-1])
    for i in own.gaps.tolist():
        inside &= (t <= own.t[i]) | (t >= own.t[i + 1])
    return inside
