"""Cells of text tables: numbers with points or commas, what is missing, clock times."""

from __future__ import annotations

import math
import re
from datetime import UTC, datetime, time
from typing import TYPE_CHECKING, Protocol

from ..display import one_line
from ..errors import ParameterError

if TYPE_CHECKING:
    import numpy as np

NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eEdD][-+]?\d+)?")
COMMA_NUMBER = re.compile(r"[-+]?(\d+,\d+|,\d+|\d+,)([eE][-+]?\d+)?")
MISSING = frozenset(("", "nan", "na", "n/a", "inf", "infinity", "null", "none", "#n/a"))
CLOCK = re.compile(r"(\d{4}-\d\d?-\d\d?[T ])?\d\d?:\d\d(:\d\d([.,]\d+)?)?(Z|[+-]\d\d:?\d\d)?")
SIGNS = str.maketrans({"\u2212": "-", "\u00a0": None, "\u202f": None, "\u2009": None})
DAY = 86_400_000_000_000  # [ns]


class Cells(Protocol):
    """What a table knows of its cells, and the numbers in its columns."""

    def loose_numbers(self, place: int) -> np.ndarray:
        """A column, (n,), with NaN for what is no number."""
        ...

    def is_missing(self, row: int, place: int) -> bool:
        """Whether a cell stands for a number that is not there, and not for another text."""
        ...

    def bad_cell(self, row: int, place: int) -> BadCell:
        """An error that names a cell which is no finite number."""
        ...

    def numbers(self, place: int, holes: bool = False) -> np.ndarray:
        """A column of finite numbers in the unit of the file, (n,).

        With `holes`, missing cells are NaN; else they are refused, as other texts are.
        """
        import numpy as np

        x = self.loose_numbers(place)
        good = np.isfinite(x)
        for row in np.flatnonzero(~good).tolist():
            if not (holes and self.is_missing(row, place)):
                raise self.bad_cell(row, place)
        return x if good.all() else np.where(good, x, np.nan)


class BadCell(ParameterError):
    """A cell that is no number.

    Args:
        field: name for the error.
        value: the file.
        bound: what is accepted, in words.
    """


def plain(cell: str) -> str:
    """A cell without spaces between digits, with the sign of a keyboard."""
    return cell if cell.isascii() else cell.translate(SIGNS)


def is_missing(cell: str) -> bool:
    """Whether a cell stands for a number that is not there."""
    return cell.strip().lower().strip("+-") in MISSING


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with a decimal point or comma."""
    cell = plain(cell)
    return bool(NUMBER.fullmatch(cell) or COMMA_NUMBER.fullmatch(cell))


def is_clock(cell: str) -> bool:
    """Whether a cell is a date with a time, or a time of day."""
    return CLOCK.fullmatch(cell.strip()) is not None


def number(cell: str, comma: bool) -> float:
    """The finite number of a cell; NaN for any other."""
    text = plain(cell)
    if comma and "." not in text:
        text = text.replace(",", ".")
    if not NUMBER.fullmatch(text):
        return math.nan
    x = float(text.replace("D", "e").replace("d", "e"))
    return x if math.isfinite(x) else math.nan


def nanoseconds(cell: str) -> int | None:
    """Whole nanoseconds of a clock time: since midnight, or of a date since 1970; else None."""
    text = cell.strip().replace(",", ".")
    found = FRACTION.search(text)
    rest = int(f"{found[1][:9]:0<9}") if found else 0
    whole = FRACTION.sub("", text)
    try:
        if "-" in whole[:5]:
            moment = datetime.fromisoformat(whole)
            moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
            return 1_000_000_000 * round(moment.timestamp()) + rest
        x = time.fromisoformat(whole.rjust(8, "0") if whole.count(":") > 1 else whole)
        return 1_000_000_000 * (3600 * x.hour + 60 * x.minute + x.second) + rest
    except ValueError:
        return None


FRACTION = re.compile(r"\.(\d+)")


def short(text: str) -> str:
    """A name or a cell in an error."""
    return repr(one_line(text, 40))
