"""Tables of text: encoding, separator, decimal commas, the lines above the numbers, and the cells.

What a file is, is found from its rows of numbers: the separator by which most of its cells become
numbers, and above the first such row its names, its units, or neither.
"""

from __future__ import annotations

import csv
import dataclasses
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import ParameterError
from ..files import MOST_TABLE, read_bytes
from . import cells
from .cells import BadCell, Cells, short
from .heads import Head, bracketed, is_unit

if TYPE_CHECKING:
    import numpy as np

SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "strokes", ",": "commas", " ": "spaces"}
COMMENTS = ("#", "%", "//", "!")
EMPTY = ' \t,;|\f\x1a"'  # what a line without cells consists of
SAMPLE = 200  # lines by which the separator is found
WIDE = {b"\xff\xfe\x00\x00": "utf-32", b"\x00\x00\xfe\xff": "utf-32", b"\xff\xfe": "utf-16"}
WIDE |= {b"\xfe\xff": "utf-16"}
CONTROL = re.compile(rb"[\x00-\x08\x0e-\x19\x1b-\x1f]")
JSON = re.compile(r"\s*(\{|\[\s*[\[{])")  # how an object, or a list of them or of rows, begins
CELL = re.compile(r'"((?:[^"]|"")*)"|(\S+)')  # where spaces separate
Line = tuple[int, str]


@dataclass(frozen=True)
class TextTable(Cells):
    """A table in a file of text.

    Attributes:
        field: name for errors.
        path: the file.
        heads: names and units of the columns.
        lines: number of the line, and its text, of each row of numbers.
        separator: between cells.
        form: encoding and separator, in words.
        notes: what was passed over, in words.
    """

    field: str
    path: Path
    heads: tuple[Head, ...]
    lines: list[Line]
    separator: str
    form: str
    notes: tuple[str, ...] = ()
    last_is_cut: bool = False
    _kept: dict[int, np.ndarray] = dataclasses.field(default_factory=dict, repr=False)

    @classmethod
    def read(cls, field: str, path: Path) -> TextTable:
        """Reads a file; its cells are read when a column is asked for."""
        text, encoding = decoded(field, path)
        return cls.of_text(field, path, text, encoding)

    @classmethod
    def of_text(cls, field: str, path: Path, text: str, encoding: str) -> TextTable:
        """Reads a text; its form begins with the encoding."""
        if JSON.match(text):
            bound = "must be a table: JSON is not read; write a line of names and rows of numbers"
            raise ParameterError(field, str(path), bound)
        whole = [(i, x) for i, x in enumerate(text.splitlines(), 1) if x.strip(EMPTY)]
        rows, comments = _without_comments(whole)
        if not rows:
            bound = "must hold a table; it is empty"
            raise ParameterError(field, str(path), bound)
        separator = _separator(rows)
        above, below = _parted(rows, separator)
        notes: list[str] = []
        try:
            heads = _heads(above, comments, below, separator, notes)
        except ValueError as error:
            raise ParameterError(field, str(path), str(error)) from None
        form = f"{encoding}, {SEPARATORS.get(separator, 'one column')}"
        cut = bool(below) and whole[-1][0] == below[-1][0] and not text.endswith(("\n", "\r"))
        return cls(field, path, heads, below, separator, form, tuple(notes), cut)._checked()

    def _checked(self) -> TextTable:
        """The table without a last row that was cut off; refused if no row has the right width."""
        if self.last_is_cut and len(self.lines) > 1:
            line, text = self.lines[-1]
            if len(split(text, self.separator)) < len(self.heads):
                note = f"line {line}, the last, was cut off: it is left out"
                return replace(self.with_note(note), lines=self.lines[:-1], _kept={})
        return self

    def with_note(self, note: str) -> TextTable:
        """The table with another note."""
        return replace(self, notes=(*self.notes, note))

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.lines)

    def refusal(self, bound: str) -> ParameterError:
        """An error that names the file."""
        return ParameterError(self.field, str(self.path), bound)

    def is_missing(self, row: int, place: int) -> bool:
        """Whether a cell is empty, or says that nothing is there."""
        return cells.is_missing(self.cell(row, place))

    def bad_cell(self, row: int, place: int) -> BadCell:
        """An error that names the line of a cell which is no finite number."""
        bound = f"line {self.lines[row][0]}, column {short(self.heads[place].text)}"
        bound += f": must be a finite number, is {short(self.cell(row, place))}"
        return BadCell(self.field, str(self.path), bound)

    def loose_numbers(self, place: int) -> np.ndarray:
        """A column, (n,), with NaN where a cell is no number; of clock times in seconds."""
        if place not in self._kept:
            if self.separator != "," and self._commas_and_points:
                raise self.refusal("must have decimal points or decimal commas, not both")
            fast = self._fast(place)
            self._kept[place] = self._by_cell(place) if fast is None else fast
        return self._kept[place]

    def cell(self, row: int, place: int) -> str:
        """The text of a cell."""
        return split(self.lines[row][1], self.separator)[place]

    # ---- cells

    @cached_property
    def _even(self) -> bool:
        """Whether each line has as many separators as the first, and no quotes."""
        if self.separator == " ":
            counts = {len(x.split()) for _, x in self.lines}
        else:
            counts = {x.count(self.separator) for _, x in self.lines}
        return len(counts) == 1 and not any('"' in x for _, x in self.lines)

    def _fast(self, place: int) -> np.ndarray | None:
        """A column of plain numbers in one go; None if some cell needs a closer look."""
        import numpy as np

        if not self._even or not self.lines:
            self._check_widths()
            return None
        self._check_widths(self.lines[:1])
        texts: Iterable[str] = (x for _, x in self.lines)
        if self._comma:
            texts = (x.replace(",", ".") for x in texts)
        try:
            found = np.loadtxt(
                texts,
                delimiter=self.separator.strip(" ") or None,
                usecols=place,
                comments=None,
                ndmin=1,
            )
        except ValueError:
            return None
        return found if np.isfinite(found).all() else None

    def _by_cell(self, place: int) -> np.ndarray:
        import numpy as np

        texts = [row[place] if place < len(row) else "" for row in self._split_lines]
        comma = self._comma or self._quoted_commas
        found = np.array([cells.number(x, comma) for x in texts])
        first = next((x for x in texts if not cells.is_missing(x)), "")
        if not np.isfinite(found).any() and cells.is_clock(first):
            return _clock_times(texts)
        return found

    @cached_property
    def _split_lines(self) -> list[list[str]]:
        return [split(text, self.separator) for _, text in self.lines]

    def _check_widths(self, lines: Sequence[Line] | None = None) -> None:
        n = len(self.heads)
        some = self._split_lines if lines is None else [split(x, self.separator) for _, x in lines]
        for (line, _), row in zip(self.lines, some, strict=False):
            if len(row) < n or any(row[n:]):
                bound = f"line {line}: must have {n} cells, has {len(row)}"
                if row[:n] == [head.text for head in self.heads[: len(row)]]:
                    bound = f"line {line} repeats the names: two logs in one file"
                raise self.refusal(bound)

    @cached_property
    def _comma(self) -> bool:
        """Whether numbers have decimal commas, as they may where no comma separates cells."""
        return self.separator != "," and any("," in x for _, x in self.lines)

    @cached_property
    def _quoted_commas(self) -> bool:
        """Whether commas separate cells, and stand in quoted numbers too."""
        some = self._split_lines[:SAMPLE] if self.separator == "," else []
        commas = [cells.COMMA_NUMBER.fullmatch(x) for row in some for x in row]
        return any(commas) and not any("." in x for row in some for x in row)

    @cached_property
    def _commas_and_points(self) -> bool:
        """Whether some cells have a decimal comma and others a decimal point."""
        if not self._comma or not any("." in text for _, text in self.lines):
            return False
        found = [x for row in self._split_lines for x in row if cells.is_number(x)]
        return any("," in x for x in found) and any("." in x for x in found)


def split(text: str, separator: str) -> list[str]:
    """The cells of a line."""
    if separator == " ":
        return [(a.replace('""', '"') if b is None else b) for a, b in _spaced(text)]
    if '"' in text and text.count('"') % 2 == 0:  # one that is not closed stays in its cell
        row = next(csv.reader([text], delimiter=separator or "\n", skipinitialspace=True))
        return [x.strip() for x in row]
    return [x.strip() for x in (text.split(separator) if separator else [text])]


def _spaced(text: str) -> list[tuple[str, str | None]]:
    return [(x[1], x[2]) for x in CELL.finditer(text)]


def decoded(field: str, path: Path) -> tuple[str, str]:
    """The text of a file, and its encoding."""
    data = read_bytes(path, MOST_TABLE)
    for mark, name in WIDE.items():
        if data.startswith(mark):
            return _wide(field, path, data, name)
    if len(data) > 3 and data[:400:2].count(0) + data[1:400:2].count(0) > 0.4 * len(data[:400]):
        return _wide(field, path, data, "utf-16-be" if data[0] == 0 else "utf-16-le")
    if bad := CONTROL.search(data):
        line = data.count(b"\n", 0, bad.start()) + 1
        bound = f"must be a table of text; line {line} holds the byte 0x{bad[0][0]:02x}"
        raise ParameterError(field, str(path), bound)
    try:
        return data.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        return data.decode("latin-1"), "Latin-1"


def _wide(field: str, path: Path, data: bytes, name: str) -> tuple[str, str]:
    try:
        return data.decode(name).removeprefix("\ufeff"), name[:6].upper()
    except UnicodeDecodeError:
        bound = f"must be text; it seems to be {name[:6].upper()} and is damaged"
        raise ParameterError(field, str(path), bound) from None


# ---- lines


def _without_comments(lines: list[Line]) -> tuple[list[Line], list[str]]:
    """Lines of cells, and what stands behind the marks of the others."""
    rows, comments = [], []
    for i, text in lines:
        start = text.lstrip()
        mark = next((x for x in COMMENTS if start.startswith(x)), None)
        if mark:
            comments.append(start[len(mark) :].strip())
        elif not (i == 1 and start[:4].lower() == "sep="):  # which a spreadsheet reads
            rows.append((i, text))
    return rows, comments


def _separator(rows: list[Line]) -> str:
    """The separator by which most cells of the last rows are numbers; "" for none."""
    some = [x for _, x in rows[len(rows) // 2 :]]
    some = some[:: max(len(some) // SAMPLE, 1)]
    scores = {x: _score(some, x) for x in SEPARATORS}
    best = max(scores, key=lambda x: scores[x])  # the first of equals
    if scores[best][0] > 0.0:
        return best
    head = rows[0][1]
    return max(SEPARATORS, key=head.count) if any(x in head.strip() for x in SEPARATORS) else ""


def _score(lines: list[str], separator: str) -> tuple[float, float]:
    """Share of lines with the usual number of cells, times that of numbers; and that number."""
    made = [split(x, separator) for x in lines if separator in x.strip()]
    widths = [len(x) for x in made]
    if not made or (usual := max(set(widths), key=widths.count)) < 2:
        return 0.0, 0.0
    same = [x for x in made if len(x) == usual]
    good = [_is_value(x) for row in same for x in row]
    empty = sum(cells.is_missing(x) for row in same for x in row)
    share = sum(good) / max(len(good) - empty, 1)
    return round(share * len(same) / len(lines), 3), usual


def _parted(rows: list[Line], separator: str) -> tuple[list[Line], list[Line]]:
    """Lines above the numbers, and rows of numbers."""
    made = [split(x, separator) for _, x in rows[-SAMPLE:]]
    width = max(map(len, made))
    numeric = [
        sum(map(_is_value, column)) >= 0.5 * sum(not cells.is_missing(x) for x in column)
        and any(not cells.is_missing(x) for x in column)
        for column in ([row[i] if i < len(row) else "" for row in made] for i in range(width))
    ]
    named = False
    for k, (_, text) in enumerate(rows):
        row = split(text, separator)
        kind = _kind_of_row(row, numeric)
        if kind == "numbers" or (kind == "both" and named and len(row) == width):
            return rows[:k], rows[k:]
        named |= kind == "words" and len(row) == width
    return rows, []


def _kind_of_row(row: list[str], numeric: list[bool]) -> str:
    """What stands where the columns of numbers are: "numbers", "words", "both" or "" for neither"""
    some = [x for x, is_one in zip(row, numeric, strict=False) if is_one and x]
    words = [x for x in some if not (cells.is_missing(x) or _is_value(x))]
    if words:
        return "both" if len(words) < len(some) else "words"
    return "numbers" if some and len(row) >= 0.5 * len(numeric) else ""


def _is_value(cell: str) -> bool:
    return cells.is_number(cell) or cells.is_clock(cell)


def _heads(
    above: list[Line], comments: list[str], below: list[Line], separator: str, notes: list[str]
) -> tuple[Head, ...]:
    """Names and units of the columns, from the lines above the numbers or a comment."""
    directly = above[-1][1] if above and below and above[-1][0] == below[0][0] - 1 else ""
    width = _width(below, separator, directly)
    if directly:
        _check_names(_words(directly, separator, width), width, below[0][0])
    rows = [(i, _words(x, separator, width)) for i, x in above]
    full = [(i, x) for i, x in rows if len(x) == width or (not width and len(x) > 0)]
    near = []
    for i, x in reversed(full):  # those that stand directly above the numbers
        if near and near[0][0] - i > 2:
            break
        near.insert(0, (i, x))
    names, units = _names_and_units([x for _, x in near[-3:]])
    of_comments = [x for x in (_words(c, separator, width) for c in comments) if len(x) == width]
    of_comments = [x for x in of_comments if not all(cells.is_number(y) for y in x)]
    if names is None:
        names = of_comments[-1] if of_comments and width else None
    elif not units:
        units = _units_of_comment(names, of_comments)
    skipped = len(rows) - len([x for x in (names, units) if x is not None])
    if skipped > 0:
        notes.append(f"{skipped} line{'s' * (skipped > 1)} above the names passed over")
    if names is None:
        notes.append("no line of names: columns are named by their number")
        return tuple(Head(str(i + 1)) for i in range(width))
    return tuple(
        Head(" ".join(x.split()) or f"column {i + 1}", unit)
        for i, (x, unit) in enumerate(zip(names, units or [""] * len(names), strict=True))
    )


def _check_names(row: list[str], width: int, line: int) -> None:
    """Refuses rows with more or fewer cells than the line of names directly above them."""
    if len(row) == width or len(row) < 2:
        return
    bound = f"line {line}: must have {len(row)} cells, has {width}"
    if width == 2 * len(row):
        bound += "; decimal commas need semicolons between cells"
    raise ValueError(bound)


def _width(below: list[Line], separator: str, names: str) -> int:
    """Number of cells in most rows, without empty ones at their ends that no name stands above."""
    if not below:
        return 0
    made = [split(x, separator) for _, x in below[:: max(len(below) // SAMPLE, 1)]]
    whole, filled = (
        max(set(widths), key=widths.count)
        for widths in ([len(x) for x in made], [len(_trimmed(x)) for x in made])
    )
    named = len(_trimmed(split(names, separator)))
    wider = named == whole if named else any(len(_trimmed(x)) == whole for x in made)
    return whole if wider else filled


def _trimmed(row: list[str]) -> list[str]:
    while row and not row[-1]:
        row = row[:-1]
    return row


def _words(text: str, separator: str, width: int) -> list[str]:
    """The names of a line; a unit behind a space belongs to the name before it."""
    row = split(text, separator)
    row = row if len(row) == width else _trimmed(row)
    if separator != " " or len(row) == width:
        return [x.rstrip(",;") for x in row]
    for way in (r"\s{2,}", r"\s*,\s*", r"\s*;\s*", r"\t"):
        if len(found := [x.strip('"') for x in re.split(way, text.strip())]) == width:
            return found
    return (
        re.sub(r"\s+(?=[\[(])", "\0", " ".join(row))
        .replace(" ", "\n")
        .replace("\0", " ")
        .split("\n")
    )


def _names_and_units(rows: list[list[str]]) -> tuple[list[str] | None, list[str] | None]:
    """Names, and units in the row below them if there is one."""
    if not rows:
        return None, None
    last = rows[-1]
    if len(rows) > 1 and _are_units(last):
        return rows[-2], [x.strip("[]() ") for x in last]
    return last, None


def _are_units(row: list[str]) -> bool:
    """Whether the cells of a row are units, or empty."""
    filled = [x for x in row if x and x not in ("-", "1")]
    good = [is_unit(x.strip("[]() ")) or bracketed(x) for x in filled]
    return bool(filled) and any(good) and 2 * sum(good) >= len(filled)


def _units_of_comment(names: list[str], comments: list[list[str]]) -> list[str] | None:
    """Units of a comment that repeats the names with units in brackets."""
    for row in comments:
        heads = [Head(x) for x in row]
        if [x.name for x in heads] == names and any(x.unit for x in heads):
            return [x.unit for x in heads]
    return None


def _clock_times(texts: list[str]) -> np.ndarray:
    """Seconds since the first day or, of dates, since the first time; NaN for another cell."""
    import numpy as np

    whole = [cells.nanoseconds(x) for x in texts]
    first = next((x for x in whole if x is not None), 0)
    start = first if first > cells.DAY else 0
    out, days, before = [], 0, None
    for x in whole:
        if x is not None and before is not None and not start and x < before - cells.DAY // 2:
            days += 1
        before = before if x is None else x
        out.append(np.nan if x is None else 1e-9 * (x - start + days * cells.DAY))
    return np.array(out)
