"""Columns of CSV files: encoding, separators, decimal commas and units, one way for all readers."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .display import one_line
from .errors import ParameterError
from .files import MOST_TABLE, read_bytes
from .units import parse_unit

if TYPE_CHECKING:
    import numpy as np

BRACKETED = re.compile(r"[\[(]\s*([^\[\]()]*?)\s*[\])]")  # "time [ms]", "force (N)"
LAST_WORD = re.compile(r".*\S[\s_/,]\s*([^\s_/,\[\]()]+)")  # "t_ms", "force / mN", "time, s"
NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
WORDS = {  # units in words
    **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("msec", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("newton", "newtons"), "N"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
}
WIDE = (b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff")  # marks of UTF-16 and UTF-32


class BadCell(ParameterError):
    """A cell that is no number.

    Args:
        field: name for the error.
        value: the file.
        bound: what is accepted, in words.
        column: name of the column.
        line: number of the line.
        cell: text of the cell.
    """

    def __init__(
        self, field: str, value: object, bound: str, column: str = "", line: int = 0, cell: str = ""
    ):
        self.column, self.line, self.cell = column, line, cell
        super().__init__(field, value, bound)


@dataclass(frozen=True)
class Sheet:
    """The lines of a CSV file.

    Attributes:
        field: name for errors.
        path: the file.
        head: names of the columns.
        rows: number of the line, and its cells, of each row below.
        separator: between cells.
    """

    field: str
    path: Path
    head: list[str]
    rows: list[tuple[int, list[str]]]
    separator: str

    @classmethod
    def read(cls, field: str, path: Path) -> Sheet:
        """Reads a file whose first line names its columns.

        Comma, semicolon or tab separate cells; a byte-order mark, empty lines and lines that begin
        with # are skipped.
        """
        lines = [
            (i, x)
            for i, x in enumerate(_text(field, path).splitlines(), 1)
            if x.strip() and not x.startswith("#")
        ]
        if not lines:
            bound = "must name its columns in the first line; it is empty"
            raise ParameterError(field, str(path), bound)
        separator = max(",;\t", key=lines[0][1].count)
        reader = csv.reader((x for _, x in lines), delimiter=separator, skipinitialspace=True)
        try:
            cells = [(lines[reader.line_num - 1][0], [x.strip() for x in row]) for row in reader]
        except csv.Error as error:
            bound = f"must be a table of cells ({error})"
            raise ParameterError(field, str(path), bound) from None
        (_, head), *rows = cells
        sheet = cls(field, path, head, [x for x in rows if any(x[1])], separator)
        if all(NUMBER.fullmatch(x) for x in head):
            raise sheet.refusal(f"must name its columns in the first line; that holds {head[0]}")
        return sheet

    def refusal(self, bound: str) -> ParameterError:
        """An error that names the file."""
        return ParameterError(self.field, str(self.path), bound)

    def place(self, name: str) -> int:
        """Index of a column."""
        if self.head.count(name) > 1:
            raise self.refusal(f"column {_short(name)} must stand once in the first line")
        return self.head.index(name)

    def named(self, names: Sequence[str]) -> dict[str, int]:
        """Indices of columns by name; a unit in brackets behind it is no part of a name."""
        plain = [x if x in names else BRACKETED.sub("", x).strip() for x in self.head]
        if missing := [x for x in names if x not in plain]:
            given = one_line(", ".join(self.head), 60)
            lacks = f"it lacks {', '.join(missing)} and has {given}"
            raise self.refusal(f"must have the columns {', '.join(names)}; {lacks}")
        for name in names:
            if plain.count(name) > 1:
                raise self.refusal(f"column {_short(name)} must stand once in the first line")
        return {name: plain.index(name) for name in names}

    def numbers(
        self, places: Mapping[str, int], units: Mapping[str, Sequence[str]]
    ) -> dict[str, np.ndarray]:
        """Columns as numbers in SI units, each of shape (n,).

        A unit stands in brackets in the name of a column, as its last word (t_ms), or in a row of
        units below the names.
        """
        import numpy as np

        rows, row_units = self._without_units(places)
        sizes = {
            key: self._size(self.head[i], row_units.get(i, ""), units.get(key, ()))
            for key, i in places.items()
        }
        comma = self._decimal_comma(rows, list(places.values()))
        out: dict[str, list[float]] = {key: [] for key in places}
        for line, row in rows:
            self._check_width(line, row)
            for key, i in places.items():
                out[key].append(self._number(row[i], self.head[i], line, comma))
        return {key: sizes[key] * np.array(x) for key, x in out.items()}

    # ---- cells

    def _check_width(self, line: int, row: list[str]) -> None:
        n = len(self.head)
        if len(row) < n or any(row[n:]):
            bound = f"line {line}: must have {n} cells, has {len(row)}"
            if len(row) == 2 * n and self.separator == ",":
                bound += "; decimal commas need semicolons between cells"
            raise self.refusal(bound)

    def _decimal_comma(self, rows: list[tuple[int, list[str]]], places: list[int]) -> bool:
        """Whether numbers have decimal commas, as they may where no comma separates cells."""
        if self.separator == ",":
            return False
        cells = [row[i] for _, row in rows for i in places if i < len(row)]
        commas = any(NUMBER.fullmatch(x.replace(",", ".")) for x in cells if "," in x)
        if commas and any(NUMBER.fullmatch(x) for x in cells if "." in x):
            raise self.refusal("must have decimal points or decimal commas, not both")
        return commas

    def _number(self, cell: str, column: str, line: int, comma: bool) -> float:
        plain = cell.replace(",", ".") if comma and "." not in cell else cell
        if not NUMBER.fullmatch(plain) or not math.isfinite(x := float(plain)):
            bound = f"line {line}, column {_short(column)}: must be a finite number"
            bound += f", is {_short(cell)}"
            raise BadCell(self.field, str(self.path), bound, column, line, cell)
        return x

    # ---- units

    def _without_units(
        self, places: Mapping[str, int]
    ) -> tuple[list[tuple[int, list[str]]], dict[int, str]]:
        """The rows of numbers; and the units of columns, if the first row holds them."""
        if not self.rows or len(self.rows) < 2:
            return self.rows, {}
        line, first = self.rows[0]
        cells = {i: first[i].strip("[]() ") for i in places.values() if i < len(first)}
        if not all(_may_be_unit(x) for x in cells.values()) or not any(cells.values()):
            return self.rows, {}
        self._check_width(line, first)
        return self.rows[1:], cells

    def _size(self, name: str, row_unit: str, accepted: Sequence[str]) -> float:
        """SI size of the unit of a column; 1 without a unit."""
        if not accepted:
            return 1.0
        found = [self._known(name, x, accepted) for x in BRACKETED.findall(name)]
        if row_unit:
            found.append(self._known(name, row_unit, accepted))
        found = [x for x in found if x is not None]
        if len(set(found)) > 1:
            raise self.refusal(f"column {_short(name)}: must have one unit")
        if not found and (last := LAST_WORD.fullmatch(name)):
            unit = parse_unit(last[1])
            if unit is not None and unit[1] in _powers(accepted):
                return float(unit[0])
        return found[0] if found else 1.0

    def _known(self, name: str, text: str, accepted: Sequence[str]) -> float | None:
        """SI size of a unit; None for a text without letters, such as a number."""
        if not any(x.isalpha() or x in "%°\"'" for x in text):
            return None
        unit = parse_unit(WORDS.get(text.lower(), text))
        told = f"column {_short(name)}: must be in {' or '.join(accepted)}"
        if unit is None:
            raise self.refusal(f"{told}; unknown unit {_short(text)}")
        if unit[1] not in _powers(accepted):
            raise self.refusal(f"{told}, not in {one_line(text, 20)}")
        return float(unit[0])


def unreadable(field: str, path: Path, error: OSError) -> ParameterError:
    """The error for a file that cannot be read."""
    return ParameterError(field, str(path), f"must be a readable file ({error.strerror})")


def _text(field: str, path: Path) -> str:
    data = read_bytes(path, MOST_TABLE)
    bound = "must be text in UTF-8"
    if data.startswith(WIDE) or b"\0" in data:
        raise ParameterError(field, str(path), f"{bound}, seems to be UTF-16 or no text at all")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        what = f"line {line} holds the byte 0x{data[error.start]:02x}, as in Latin-1"
        raise ParameterError(field, str(path), f"{bound} ({what})") from None


def _powers(accepted: Sequence[str]) -> list[tuple[int, ...]]:
    known = [parse_unit(x) for x in accepted]
    return [x[1] for x in known if x is not None]


def _may_be_unit(cell: str) -> bool:
    """Whether a cell below the names can be a unit: no number, and not one that is missing."""
    return not NUMBER.match(cell.replace(",", ".")) and cell.lower().strip("+-") not in (
        "nan",
        "na",
        "n/a",
        "inf",
        "infinity",
        "null",
        "none",
    )


def _short(text: str) -> str:
    return repr(one_line(text, 40))
