"""How commands read a log: names, units and counts of its columns."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from ..errors import Bound, ParameterError, choice
from ..fields import value_of_text

if TYPE_CHECKING:
    from ..columns.log import Log


NAMES = ("units", "counts", "table", "where", "rate")  # of the options


@dataclass(frozen=True)
class LogOptions:
    """What the names in a log do not say.

    Attributes:
        units: Units of columns, in place of what the file says, as in pos=mm force=lbf; or scales
            of sensors, as in current_mA=0.05N.m/A.
        counts: Columns of encoders, in counts a turn, or with the size of a count, as in q=4096
            x=0.01mm.
        table: Group, topic or sheet to read, where a file has several.
        where: Rows to read, as in episode_index=3.
        rate: Rows in a second, of a file without a time [Hz].
    """

    units: tuple[str, ...] = ()
    counts: tuple[str, ...] = ()
    table: str = ""
    where: tuple[str, ...] = ()
    rate: Annotated[float | None, Bound(0.0, 1e9, "Hz", above=True)] = None

    def log(self, file: Path, field: str = "file") -> Log:
        """The log in a file."""
        from ..columns.log import Reading, open_log

        where = {name: value_of_text(x) for name, x in self._pairs("where").items()}
        units, counts = self._pairs("units"), self._pairs("counts")
        return open_log(field, file, Reading(units, counts, self.table, where, self.rate))

    def _pairs(self, option: str) -> dict[str, str]:
        """Values by the name of a column, which may hold an equals sign."""
        out = {}
        for word in getattr(self, option):
            name, _, value = word.rpartition("=")
            if not name or not value:
                raise ParameterError(option, word, "must be NAME=VALUE")
            out[name] = value
        return out


EXAMPLE = "t=time input=cmd output=pos"


@contextlib.contextmanager
def hinted(given: Collection[str], example: str = EXAMPLE) -> Iterator[None]:
    """Says how columns are named, in a refusal of one that was looked for and not found."""
    try:
        yield
    except ParameterError as error:
        key = error.field.removeprefix("columns.")
        told = key in given or (key == "columns" and given)
        hint = "" if told else f"; give --columns {example}"
        raise ParameterError(error.field, error.value, error.bound + hint) from None


def column_names(
    words: Sequence[str], columns: Collection[str], example: str = EXAMPLE
) -> dict[str, str]:
    """Names of columns from words such as "input=cmd"."""
    out: dict[str, str] = {}
    for word in words:
        key, _, name = word.partition("=")
        if not name:
            raise ParameterError("columns", word, f"must be words such as {example}")
        if choice("columns", key, tuple(columns)) in out:
            raise ParameterError("columns", word, f"must give {key} once")
        out[key] = name
    return out


def found_line(given: Mapping[str, str], names: Mapping[str, str]) -> str:
    """Which columns were found, in a line; "" where all were given."""
    found = [f"{key} = {name!r}" for key, name in names.items() if key not in given]
    return f"columns found: {', '.join(found)}" if found else ""
