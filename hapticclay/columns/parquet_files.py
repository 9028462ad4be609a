"""Logs of Parquet and Arrow, with the layout of LeRobot's data sets."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import needing
from ..files import DAMAGED, parse_json, read_text
from .array_tables import ArrayTable, Container
from .heads import Head, numbered

ABOVE = 4  # folders above a file in which LeRobot keeps meta/info.json


def parquet(field: str, path: Path, table: str = "") -> ArrayTable:
    """A Parquet file: columns of numbers, and of lists of equal length."""
    with needing("a Parquet log", "pyarrow", "logs"):
        import pyarrow.parquet as pq

    return _of_arrow(field, path, pq.read_table(path), "Parquet", table)


def feather(field: str, path: Path, table: str = "") -> ArrayTable:
    """An Arrow file."""
    with needing("an Arrow log", "pyarrow", "logs"):
        import pyarrow.feather as pf

    return _of_arrow(field, path, pf.read_table(path), "Arrow", table)


def _of_arrow(field: str, path: Path, found: Any, form: str, table: str) -> ArrayTable:
    found.validate(full=True)  # offsets of a damaged file would end or hang the process
    data: dict[str, Any] = {}
    units: dict[str, str] = {}
    heads = numbered([Head(column.name) for column in found.schema])
    for head, column, cells in zip(heads, found.schema, found.columns, strict=True):
        values = _values(cells)
        if values is not None:
            data[head.text] = values
        for key in (b"unit", b"units"):
            if key in (column.metadata or {}):
                units[head.text] = column.metadata[key].decode("utf-8", "replace")
    return Container.of(field, path, form, data, units, _feature_names(path)).table(table)


def _values(column: Any) -> np.ndarray | None:
    """The numbers of a column, (n,) or (n, k); None for words, or lists of several lengths."""
    import pyarrow as pa

    if (
        pa.types.is_list(column.type)
        or pa.types.is_fixed_size_list(column.type)
        or (pa.types.is_large_list(column.type))
    ):
        return _lists(column)
    values = column.to_numpy()
    return values if values.dtype.kind in "biufmM" else None


def _lists(column: Any) -> np.ndarray | None:
    """A column of lists of one length, (n, k); a row without a list is NaN."""
    lists = column.to_pylist()
    lengths = {len(x) for x in lists if x is not None}
    if len(lengths) != 1:
        return None
    whole = np.concatenate([np.asarray(chunk.flatten()) for chunk in column.chunks])
    if whole.dtype.kind not in "biuf":
        return None
    given = np.array([x is not None for x in lists])
    rows = whole.reshape(-1, lengths.pop()) if len(whole) else np.zeros((given.sum(), 0))
    if given.all():
        return rows
    out = np.full((len(lists), rows.shape[1]), np.nan)
    out[given] = rows
    return out


def _feature_names(path: Path) -> dict[str, Sequence[str]]:
    """Names of the parts of a column, from LeRobot's meta/info.json above the file."""
    for folder in path.resolve().parents[:ABOVE]:
        info = folder / "meta" / "info.json"
        if not info.is_file():
            continue
        with contextlib.suppress(*DAMAGED):
            features = parse_json(read_text(info))["features"]
            names = {k: x.get("names") for k, x in features.items()}
            flat = {
                k: next(iter(x.values())) if isinstance(x, dict) else x for k, x in names.items()
            }
            return {k: [str(y) for y in x] for k, x in flat.items() if isinstance(x, list)}
    return {}
