"""Tables of arrays, and how nested containers of arrays become one."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..display import one_line
from ..errors import ParameterError
from .cells import BadCell, Cells, short
from .heads import Head

MOST_PARTS = 256  # columns of an array with a column for each part
LEAST_ROWS = 2
Arrays = Mapping[str, np.ndarray]
TIMES = frozenset(("t", "time", "timestamp", "stamp"))


@dataclass(frozen=True)
class ArrayTable(Cells):
    """Columns of numbers under their heads.

    Attributes:
        field: name for errors.
        path: the file.
        heads: names and units of the columns.
        arrays: the columns, (n,) each.
        form: the format, in words.
        notes: what was passed over, in words.
    """

    field: str
    path: Path
    heads: tuple[Head, ...]
    arrays: tuple[np.ndarray, ...]
    form: str
    notes: tuple[str, ...] = ()

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.arrays[0]) if self.arrays else 0

    def refusal(self, bound: str) -> ParameterError:
        """An error that names the file."""
        return ParameterError(self.field, str(self.path), bound)

    def loose_numbers(self, place: int) -> np.ndarray:
        """A column, (n,), with NaN for what is no number."""
        return self.arrays[place]

    def is_missing(self, row: int, place: int) -> bool:
        """Whether a cell is no finite number."""
        return True

    def bad_cell(self, row: int, place: int) -> BadCell:
        """An error that names the row of a cell which is no finite number."""
        name, value = short(self.heads[place].text), self.arrays[place][row]
        bound = f"row {row}, column {name}: must be a finite number, is {value:g}"
        return BadCell(self.field, str(self.path), bound)


def flat(data: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Arrays of numbers and texts in nested containers, by a name with points."""
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from flat(value, f"{name}.{key}" if name else str(key))
    elif isinstance(data, list | tuple) and data and not _are_numbers(data):
        for i, value in enumerate(data):
            yield from flat(value, f"{name}[{i}]")
    elif isinstance(data, np.ndarray) and data.dtype == object:
        yield from flat(data.ravel().tolist(), name)
    elif isinstance(data, np.ndarray) and data.dtype.names:
        yield from flat({key: data[key] for key in data.dtype.names}, name)
    else:
        yield name, data


def _are_numbers(data: Sequence[Any]) -> bool:
    return all(isinstance(x, int | float) and not isinstance(x, bool) for x in data)


def as_numbers(value: Any) -> np.ndarray | None:
    """An array of doubles; None for what holds no real numbers."""
    x = np.asarray(value)
    if x.dtype.kind == "m":
        return x.astype("timedelta64[ns]").astype(np.int64) * 1e-9
    if x.dtype.kind == "M":
        whole = x.astype("datetime64[ns]").astype(np.int64)
        return (whole - whole.ravel()[0]) * 1e-9 if x.size else None
    return x.astype(float) if x.dtype.kind in "biuf" else None


def columns_of_array(name: str, x: np.ndarray, n: int, parts: Sequence[str] = ()) -> dict[str, Any]:
    """Columns of n rows in an array, with a column for each of the parts of a row."""
    x = x.squeeze()
    if x.ndim == 2 and x.shape[0] != n and x.shape[1] == n:
        x = x.T
    if x.ndim == 0 or x.shape[0] != n or x[:1].size > MOST_PARTS:
        return {}
    if x.ndim == 1:
        return {name: x}
    x = x.reshape(n, -1)
    if len(parts) == x.shape[1]:
        return {f"{name}_{part}": x[:, i] for i, part in enumerate(parts)}
    return {f"{name}[{i}]": x[:, i] for i in range(x.shape[1])}


def lengths(x: np.ndarray) -> list[int]:
    """Numbers of rows that an array can have."""
    shape = list(x.squeeze().shape)
    if len(shape) == 2 and min(shape) <= MOST_PARTS:
        return [max(shape)]
    return [shape[0]] if shape and len(shape) < 3 else []


@dataclass(frozen=True)
class Container:
    """Arrays in a file, before it is known which of them are the columns.

    Attributes:
        field: name for errors.
        path: the file.
        form: the format, in words.
        arrays: by name.
        units: units by name.
        parts: names of the columns of an array, by its name.
        notes: for the table.
    """

    field: str
    path: Path
    form: str
    arrays: Arrays
    units: Mapping[str, str]
    parts: Mapping[str, Sequence[str]]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls,
        field: str,
        path: Path,
        form: str,
        data: Any,
        units: Mapping[str, str] | None = None,
        parts: Mapping[str, Sequence[str]] | None = None,
    ) -> Container:
        """The arrays of nested containers."""
        found = {name: as_numbers(x) for name, x in flat(data)}
        return cls(
            field, path, form, {k: x for k, x in found.items() if x is not None},
            units or {}, parts or {},
        )  # fmt: skip

    def table(self, name: str = "") -> ArrayTable:
        """The columns of equal length below a name: those with a time, or the most."""
        kept = self._below(name)
        counts = Counter(n for x in kept.values() for n in lengths(x) if n >= LEAST_ROWS)
        if not counts:
            what = one_line(", ".join(self.arrays), 80) or "no numbers"
            raise ParameterError(
                self.field, str(self.path), f"must hold columns of numbers; it has {what}"
            )
        timed = {n for key, x in kept.items() if _last(key) in TIMES for n in lengths(x)}
        n = max(counts, key=lambda n: (n in timed, counts[n], n))
        columns: dict[str, np.ndarray] = {}
        heads = []
        group = _group([key for key, x in kept.items() if n in lengths(x)])
        for key, x in kept.items():
            made = columns_of_array(key.removeprefix(group), x, n, self.parts.get(key, ()))
            columns |= made
            heads += [Head(x, self.units.get(key, "")) for x in made]
        left = [f"{x.size if x.ndim < 2 else 'x'.join(map(str, x.shape))} of {key}"
                for key, x in kept.items() if n not in lengths(x) and x.size > 1]  # fmt: skip
        notes = [f"other lengths: {one_line(', '.join(left), 120)}"] if left else []
        return ArrayTable(
            self.field, self.path, tuple(heads), tuple(columns.values()), self.form,
            (*self.notes, *notes),
        )  # fmt: skip

    def _below(self, name: str) -> dict[str, np.ndarray]:
        """The arrays of a group."""
        if not name:
            return dict(self.arrays)
        kept = {k: x for k, x in self.arrays.items() if k == name or k.startswith(f"{name}.")}
        if not kept:
            groups = dict.fromkeys(k.rpartition(".")[0] or k for k in self.arrays)
            bound = f"must be one of {one_line(', '.join(groups), 200)}"
            raise ParameterError("table", name, bound)
        return kept


def _group(names: list[str]) -> str:
    """The group in which all of some names are, with its point; "" for none."""
    groups = [x.split(".")[:-1] for x in names]
    levels = itertools.takewhile(lambda x: len(set(x)) == 1, zip(*groups, strict=False))
    return "".join(f"{x[0]}." for x in levels)


def _last(name: str) -> str:
    return name.rpartition(".")[2].lower()
