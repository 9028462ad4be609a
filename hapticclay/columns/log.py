"""A log: the columns of a file, with their names and units, in SI units."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import checked, named
from ..display import one_line
from ..errors import ParameterError, choice, number
from ..units import Powers, from_unit, parse_unit
from .cells import short
from .heads import COUNTS, DOUBTFUL, Head, powers_of
from .tables import Table, open_table

if TYPE_CHECKING:
    import numpy as np

FORCES = {"kg": "kgf", "lb": "lbf", "lbs": "lbf", "oz": "ozf", "g": "gf"}  # by the mass meant
MASS, FORCE = (0, 1, 0, 0, 0), (1, 1, -2, 0, 0)
AS_UNIT = re.compile(r"[,/]\s*\w+$")  # "pos / in", where "pos_in" may be an input
LONGEST_WORD = 3  # of a unit that is an abbreviation


@named
@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """The columns of a file: text, or one of the binary formats of docs/logs.md.

    A column's unit stands in brackets in its name, in a row below the names, in the metadata of the
    file or as the last word of the name, as in "force [lbf]" or "x_mm"; without one it is SI.

    Attributes:
        path: the file.
        table: the table in it.
        sizes: size of a unit, and its powers of m, kg, s, rad and A, that the caller states, by
            the number of the column.
    """

    path: Path
    table: Table
    sizes: Mapping[int, tuple[float, Powers]] = field(default_factory=dict)

    @classmethod
    @checked
    def read(
        cls,
        path: str | os.PathLike[str],
        units: Mapping[str, str] | None = None,
        counts: Mapping[str, Any] | None = None,
        table: str = "",
        where: Mapping[str, float] | None = None,
    ) -> Log:
        """Reads a file.

        Args:
            path: the file.
            units: unit of a column by name, in place of what the file says, as {"x": "mm"}.
            counts: of an encoder's column by name: counts a turn, as 4096, or the size of a count,
                as "0.01 mm" or "0.088 deg".
            table: name of a group, a topic or a sheet, where a file has several.
            where: only the rows in which columns have these values, as {"episode_index": 3}.

        Raises:
            ParameterError: the file cannot be read or holds no table, a name is not one of its
                columns, or a unit is unknown.
        """
        return open_log("path", path, units, counts, table, where)

    def stating(
        self, units: Mapping[str, str] | None, counts: Mapping[str, Any] | None = None
    ) -> Log:
        """The same columns with other units.

        Args:
            units: as those of `read`.
            counts: as those of `read`.
        """
        sizes: dict[int, tuple[float, Powers]] = {}
        for name, unit in (units or {}).items():
            known = parse_unit(unit)
            if known is None:
                raise ParameterError(f"units.{name}", unit, "must be a unit, as mm, N or deg")
            sizes[self.place(name, "units")] = float(known[0]), known[1]
        for name, size in (counts or {}).items():
            sizes[self.place(name, "counts")] = _count(f"counts.{name}", size)
        return Log(self.path, self.table, {**self.sizes, **sizes})

    def __repr__(self) -> str:
        return f"<Log: {self.path.name}, {self.rows} rows, {one_line(', '.join(self.names))}>"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, as they are in the file."""
        return tuple(head.text for head in self.table.heads)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.table.rows

    def place(self, name: str, field: str = "columns") -> int:
        """Number of a column, from 0.

        Args:
            name: as it is in the file, or without its unit.
            field: name for errors.

        Raises:
            ParameterError: there is no such column, or there are several.
        """
        for names in self._names():
            places = [i for i, x in enumerate(names) if name in x]
            if len(places) == 1:
                return places[0]
            if places:
                bound = f"must stand once among the names, stands {len(places)} times"
                raise ParameterError(field, name, bound)
        if all(x.isdigit() for x in self.names):
            bound = f"must be a number, 1 to {len(self.names)}: the file does not name its columns"
            raise ParameterError(field, name, bound)
        choice(field, name, self.names)
        raise AssertionError

    def values(self, name: str, units: Sequence[str] = ()) -> np.ndarray:
        """A column in SI units, shape (n,).

        Args:
            name: as it is in the file, or without its unit.
            units: units of the quantities that are accepted, as ("N", "N.m"); without any, the
                column is converted if its unit is stated.

        Raises:
            ParameterError: there is no such column, a cell is no finite number, or its unit is
                unknown or of another quantity.
        """
        place = self.place(name)
        size = self.size(place, units)[0]
        found = self.table.numbers(place)
        return found if size == 1.0 else size * found

    def raw(self, name: str) -> np.ndarray:
        """A column in the unit of the file, shape (n,).

        Args:
            name: as it is in the file, or without its unit.
        """
        return self.table.numbers(self.place(name))

    def size(self, place: int, units: Sequence[str] = ()) -> tuple[float, Powers | None]:
        """SI size and powers of the unit of a column; powers are None where it states none.

        Args:
            place: number of the column, from 0.
            units: units of the quantities that are accepted; () for any.
        """
        return _Unit(self, place, tuple(units)).size()

    def powers(self, place: int) -> Powers | None:
        """Powers of m, kg, s, rad and A of the unit that a column states; None for an unknown one.

        Args:
            place: number of the column, from 0.
        """
        if place in self.sizes:
            return self.sizes[place][1]
        known = parse_unit(self.table.heads[place].unit)
        return known and known[1]

    def _names(self) -> list[list[set[str]]]:
        """Names of the columns: as in the file, without units, without units as last words."""
        heads = self.table.heads
        whole, bare = [{head.text} for head in heads], [{head.name} for head in heads]
        stems = [{head.name, *head.stems} for head in heads]
        return [whole, bare, stems]


def open_log(
    field: str,
    path: str | os.PathLike[str] | Log,
    units: Mapping[str, str] | None = None,
    counts: Mapping[str, Any] | None = None,
    table: str = "",
    where: Mapping[str, float] | None = None,
) -> Log:
    """As `Log.read`, with the name of the path for errors; a log is taken as it is."""
    if isinstance(path, Log):
        return path.stating(units, counts)
    log = Log(Path(path), open_table(field, Path(path), table)).stating(units, counts)
    return _chosen(log, where) if where else log


def _chosen(log: Log, where: Mapping[str, float]) -> Log:
    """The rows in which columns have some values."""
    import numpy as np

    from .array_tables import Chosen

    kept = np.ones(log.rows, dtype=bool)
    for name, value in where.items():
        found = log.table.loose_numbers(log.place(name, "where"))
        same = found == number(f"where.{name}", value)
        if not (kept & same).any():
            values = np.unique(found[np.isfinite(found)])
            shown = ", ".join(f"{x:g}" for x in values[:8]) + (", ..." if len(values) > 8 else "")
            raise ParameterError(f"where.{name}", value, f"must be a value of the column: {shown}")
        kept &= same
    rows = np.flatnonzero(kept)
    note = (
        f"{len(rows)} of {log.rows} rows, by {', '.join(f'{k} = {x:g}' for k, x in where.items())}"
    )
    return Log(log.path, Chosen(log.table, rows, (*log.table.notes, note)), log.sizes)


def columns_of(
    field: str,
    path: str | os.PathLike[str],
    units: Mapping[str, Sequence[str]],
    optional: Mapping[str, Sequence[str]] | None = None,
) -> dict[str, np.ndarray]:
    """Columns of fixed names in SI units, by name; without units, as they are.

    Those that are optional are left out where the file has none.
    """
    log = open_log(field, path)
    known = {x for names in log._names() for each in names for x in each}
    if all(x.isdigit() for x in log.names):
        raise log.table.refusal(f"must name its columns, {', '.join(units)}, above the numbers")
    if missing := [x for x in units if x not in known]:
        lacks = f"it lacks {', '.join(missing)} and has {one_line(', '.join(log.names), 60)}"
        raise log.table.refusal(f"must have the columns {', '.join(units)}; {lacks}")
    if not log.rows:
        raise log.table.refusal("must have a row or more")
    there = {name: x for name, x in (optional or {}).items() if name in known}
    wanted = {**units, **there}
    return {name: log.values(name, x) if x else log.raw(name) for name, x in wanted.items()}


def _count(field: str, size: Any) -> tuple[float, Powers]:
    """Size of a count: of counts a turn, or as it is stated."""
    if isinstance(size, str):
        for unit in ("m", "rad"):
            try:
                found = from_unit(size, unit)
            except ValueError:
                continue
            if found is not None:
                return found, powers_of((unit,))[0]
    turn = number(field, size, 1.0, 1e12)
    return math.tau / turn, powers_of(("rad",))[0]


@dataclass(frozen=True)
class _Unit:
    """The unit of a column among those that are accepted."""

    log: Log
    place: int
    accepted: tuple[str, ...]

    @property
    def head(self) -> Head:
        return self.log.table.heads[self.place]

    def size(self) -> tuple[float, Powers | None]:
        if self.place in self.log.sizes:
            size, powers = self.log.sizes[self.place]
            self._check(powers, "the unit that is stated")
            return size, powers
        stated = [self._known(x) for x in (self.head.given, *self.head.bracketed) if x]
        if len(set(stated)) > 1:
            raise self._refusal("must have one unit")
        return stated[0] if stated else self._last_words()

    def _known(self, text: str) -> tuple[float, Powers | None]:
        """Size and powers of a unit in the file."""
        if text.lower() in COUNTS:
            why = f"it is in {text}: state the counts a turn, or the size of one, as counts"
            raise self._refusal(f"{self._wants}; {why}")
        unit = parse_unit(text)
        if unit is None:
            raise self._refusal(f"{self._wants}; unknown unit {short(text)}")
        self._check(unit[1], text)
        return float(unit[0]), unit[1]

    def _check(self, powers: Powers, text: str) -> None:
        """Refuses a unit of another quantity."""
        wanted = powers_of(self.accepted)
        if wanted and powers not in wanted:
            hint = f"; a force is in {FORCES.get(text, 'kgf or lbf')}"
            kilograms = powers == MASS and FORCE in wanted
            raise self._refusal(f"{self._wants}, not in {one_line(text, 20)}{hint * kilograms}")

    def _last_words(self) -> tuple[float, Powers | None]:
        """The unit that the last words of the name are, if they can be one of those accepted."""
        wanted, last = powers_of(self.accepted), [x for _, x in self.head.last_words()]
        for text in last:
            unit = parse_unit(text)
            sure = text != "in" or AS_UNIT.search(self.head.text)
            if unit is not None and unit[1] in wanted and sure:
                return float(unit[0]), unit[1]
        for text in last[-1:] if wanted else ():
            abbreviated = 1 < len(text) <= LONGEST_WORD and parse_unit(text) is not None
            if abbreviated or text in DOUBTFUL:
                why = f"its name ends as if it were in {text!r}: state its unit as units"
                raise self._refusal(f"{self._wants}; {why}")
        return 1.0, None

    @property
    def _wants(self) -> str:
        return f"must be in {' or '.join(self.accepted) or 'a known unit'}"

    def _refusal(self, bound: str) -> ParameterError:
        return self.log.table.refusal(f"column {short(self.head.text)}: {bound}")
