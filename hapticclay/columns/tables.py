"""A table in a file, whatever its format: what readers of formats make, and which reads what."""

from __future__ import annotations

import importlib
import os
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from ..display import one_line
from ..errors import ParameterError
from ..files import MOST_READ, Unfit, check_regular
from .cells import BadCell, Cells
from .heads import Head
from .text_tables import TextTable

if TYPE_CHECKING:
    import numpy as np


class Table(Cells, Protocol):
    """Columns under their heads."""

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def heads(self) -> Sequence[Head]:
        """Names and units of the columns."""
        ...

    @property
    def rows(self) -> int:
        """Number of rows."""
        ...

    @property
    def form(self) -> str:
        """The format, in words."""
        ...

    @property
    def notes(self) -> Sequence[str]:
        """What was passed over, in words."""
        ...

    def refusal(self, bound: str) -> ParameterError:
        """An error that names the file."""
        ...


@dataclass(frozen=True)
class Over(Cells):
    """A view of another table, of the same file."""

    table: Table

    @property
    def path(self) -> Path:
        """The file."""
        return self.table.path

    @property
    def form(self) -> str:
        """The format, in words."""
        return self.table.form

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.table.rows

    def refusal(self, bound: str) -> ParameterError:
        """An error that names the file."""
        return self.table.refusal(bound)


@dataclass(frozen=True)
class Chosen(Over):
    """Some rows of another table: those in which columns have given values."""

    rows_kept: np.ndarray
    notes: tuple[str, ...]

    @property
    def heads(self) -> Sequence[Head]:
        """Names and units of the columns."""
        return self.table.heads

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.rows_kept)

    def is_missing(self, row: int, place: int) -> bool:
        """Whether a cell stands for a number that is not there."""
        return self.table.is_missing(int(self.rows_kept[row]), place)

    def bad_cell(self, row: int, place: int) -> BadCell:
        """An error that names a cell which is no finite number."""
        return self.table.bad_cell(int(self.rows_kept[row]), place)

    def loose_numbers(self, place: int) -> np.ndarray:
        """A column, (n,), with NaN for what is no number."""
        return self.table.loose_numbers(place)[self.rows_kept]


@dataclass(frozen=True)
class Picked(Over):
    """Some columns of another table, with heads of their own."""

    kept: tuple[int, ...]
    heads: tuple[Head, ...]
    notes: tuple[str, ...]

    def is_missing(self, row: int, place: int) -> bool:
        """Whether a cell stands for a number that is not there."""
        return self.table.is_missing(row, self.kept[place])

    def bad_cell(self, row: int, place: int) -> BadCell:
        """An error that names a cell which is no finite number."""
        return self.table.bad_cell(row, self.kept[place])

    def loose_numbers(self, place: int) -> np.ndarray:
        """A column, (n,), with NaN for what is no number."""
        return self.table.loose_numbers(self.kept[place])


@dataclass(frozen=True)
class Clocked(Over):
    """Another table with a time of its rows, behind its own columns, by a rate that is stated."""

    rate: float  # [Hz]

    @property
    def clock(self) -> str:
        """Name of the time."""
        return f"rows at {self.rate:.6g} Hz"

    @property
    def heads(self) -> Sequence[Head]:
        """Names and units of the columns."""
        return (*self.table.heads, Head(self.clock, "s"))

    @property
    def notes(self) -> Sequence[str]:
        """What was passed over, in words."""
        return self.table.notes

    def is_missing(self, row: int, place: int) -> bool:
        """Whether a cell stands for a number that is not there."""
        return self.table.is_missing(row, place)

    def bad_cell(self, row: int, place: int) -> BadCell:
        """An error that names a cell which is no finite number."""
        return self.table.bad_cell(row, place)

    def loose_numbers(self, place: int) -> np.ndarray:
        """A column, (n,), with NaN for what is no number."""
        import numpy as np

        if place == len(self.table.heads):
            return np.arange(self.rows) / self.rate
        return self.table.loose_numbers(place)


# first bytes of a file, and its reader, "module:function"
MAGIC = (
    (b"PAR1", "parquet_files:parquet"),
    (b"ARROW1", "parquet_files:feather"),
    (b"\x89HDF\r\n\x1a\n", "scientific:hdf5"),
    (b"MATLAB 7.3", "scientific:hdf5"),
    (b"MATLAB 5.0", "scientific:matlab"),
    (b"CDF", "scientific:netcdf3"),
    (b"\x93NUMPY", "scientific:numpy_array"),
    (b"\x89MCAP0\r\n", "bags:mcap"),
    (b"#ROSBAG", "bags:bag"),
    (b"SQLite format 3\0", "bags:bag"),
    (b"\xd0\xcf\x11\xe0", "no:xls"),
    (b"\x1f\x8b", "no:gzip"),
)
ZIPPED = {"xl/": "workbooks:excel", ".npy": "scientific:numpy_arrays"}  # by the names in a ZIP file
REFUSED = {
    "no:xls": "an .xlsx file: save it as one",
    "no:gzip": "unpacked: gunzip it",
    "no:zip": "a log: unpack it",
}


def open_table(field: str, path: Path, table: str = "") -> Table:
    """The table in a file; of several, that of a name."""
    try:
        reader = _reader_of(path)
        if reader is None:
            if table:
                raise ParameterError(
                    "table", table, "is for files with several tables: leave it out"
                )
            return TextTable.read(field, path)
        module, _, function = reader.partition(":")
        if reader in REFUSED:
            raise ParameterError(field, str(path), f"must be {REFUSED[reader]}")
        made = importlib.import_module(f".{module}", __package__)
        return getattr(made, function)(field, path, table)
    except ParameterError:
        raise
    except OSError as error:
        bound = f"must be a readable file ({error.strerror or one_line(error, 120)})"
        raise ParameterError(field, str(path), bound) from None
    except Exception as error:  # whatever a library raises of a damaged file
        bound = (
            f"must be a log that is not damaged ({one_line(error, 120) or type(error).__name__})"
        )
        raise ParameterError(field, str(path), bound) from None


def _reader_of(path: Path) -> str | None:
    """The reader of a binary format; None for text."""
    if os.path.isdir(path):
        if os.path.isfile(path / "metadata.yaml"):
            return "bags:bag"
        raise Unfit("it is a folder, not a log")
    check_regular(path)
    if os.path.getsize(path) > MOST_READ:
        raise Unfit(f"it is larger than {MOST_READ / 2**20:.3g} MiB")
    with open(path, "rb") as file:
        start = file.read(16)
    if start.startswith(b"PK\x03\x04"):
        with zipfile.ZipFile(path) as file:
            names = file.namelist()
        return next((x for mark, x in ZIPPED.items() if any(mark in n for n in names)), "no:zip")
    for mark, reader in MAGIC:
        if start.startswith(mark):
            return reader
    return "scientific:matlab" if path.suffix.lower() == ".mat" else None
