"""A log: the columns of a file, with their names and units, in SI units."""

from __future__ import annotations

import contextlib
import math
import os
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..arguments import checked, named
from ..display import one_line
from ..errors import ParameterError, choice, number
from ..units import Powers, parse_unit, parts_of, si_unit
from .cells import short
from .heads import COUNTS, DOUBTFUL, Head, numbered, powers_of
from .tables import Chosen, Clocked, Picked, Table, open_table

if TYPE_CHECKING:
    import numpy as np

FORCES = {"kg": "kgf", "lb": "lbf", "lbs": "lbf", "oz": "ozf", "g": "gf"}  # by the mass meant
MASS, FORCE = (0, 1, 0, 0, 0), (1, 1, -2, 0, 0)
AS_UNIT = re.compile(r"[,/]\s*\w+$")  # "pos / in", where "pos_in" may be an input
LONGEST_WORD = 3  # of a unit that is an abbreviation
MOST_RATE = 1e9  # [Hz]
AMPERES = 4  # place among the powers of a unit


@dataclass(frozen=True)
class Reading:
    """How a file is read, beside what it says itself."""

    units: Mapping[str, str] = field(default_factory=dict)
    counts: Mapping[str, Any] = field(default_factory=dict)
    table: str = ""
    where: Mapping[str, float] = field(default_factory=dict)
    rate: float | None = None  # [Hz]

    def words(self) -> str:
        """The same as options of a command line, each behind a space."""
        out = ""
        for option in ("units", "counts", "where"):
            pairs = getattr(self, option).items()
            texts = [f"{k}={x:g}" if isinstance(x, float) else f"{k}={x}" for k, x in pairs]
            out += f" --{option} {shlex.join(texts)}" if texts else ""
        out += f" --table {shlex.quote(self.table)}" if self.table else ""
        return out + (f" --rate {self.rate:.10g}" if self.rate else "")


NOTHING_STATED = Reading()


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
        reading: how it was read.
    """

    path: Path
    table: Table
    sizes: Mapping[int, tuple[float, Powers]] = field(default_factory=dict)
    reading: Reading = NOTHING_STATED

    @classmethod
    @checked
    def read(
        cls,
        path: str | os.PathLike[str],
        units: Mapping[str, str] | None = None,
        counts: Mapping[str, Any] | None = None,
        table: str = "",
        where: Mapping[str, float] | None = None,
        rate: float | None = None,
    ) -> Log:
        """Reads a file.

        Args:
            path: the file.
            units: unit of a column by name, in place of what the file says, as {"x": "mm"}; or the
                scale of a sensor, as {"current_mA": "0.05 N.m/A"}, which makes torques of it.
            counts: of an encoder's column by name: counts a turn, as 4096, or the size of a count,
                as "0.01 mm", "0.088 deg" or "5 mN".
            table: name of a group, a topic or a sheet, where a file has several.
            where: only the rows in which columns have these values, as {"episode_index": 3}.
            rate: rows in a second [Hz], of a file without a time or in place of its own.

        Raises:
            ParameterError: the file cannot be read or holds no table, a name is not one of its
                columns, or a unit is unknown.
        """
        reading = Reading(units or {}, counts or {}, table, where or {}, rate)
        return open_log("path", path, reading)

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
            place = self.place(name, "units")
            sizes[place] = self._stated_size(f"units.{name}", place, unit)
        for name, size in (counts or {}).items():
            sizes[self.place(name, "counts")] = _count(f"counts.{name}", size)
        reading = replace(
            self.reading,
            units={**self.reading.units, **(units or {})},
            counts={**self.reading.counts, **(counts or {})},
        )
        return replace(self, sizes={**self.sizes, **sizes}, reading=reading)

    @property
    def clock(self) -> str:
        """Name of the time by the rate that is stated; "" without one."""
        return self.table.clock if isinstance(self.table, Clocked) else ""

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

    def check_once(self, names: Iterable[str]) -> None:
        """Refuses names of which there are several columns with different values.

        Args:
            names: as in the file.
        """
        for name in names:
            if f"{name}#2" in self.names:
                raise self.table.refusal(f"must have the column {short(name)} once")

    def values(self, name: str, units: Sequence[str] = (), holes: bool = False) -> np.ndarray:
        """A column in SI units, shape (n,).

        Args:
            name: as it is in the file, or without its unit.
            units: units of the quantities that are accepted, as ("N", "N.m"); without any, the
                column is converted if its unit is stated.
            holes: whether missing cells are NaN; else they are refused.

        Raises:
            ParameterError: there is no such column, a cell is no finite number, or its unit is
                unknown or of another quantity.
        """
        place = self.place(name)
        size = self.size(place, units)[0]
        found = self.table.numbers(place, holes)
        return found if size == 1.0 else size * found

    def raw(self, name: str, holes: bool = False) -> np.ndarray:
        """A column in the unit of the file, shape (n,).

        Args:
            name: as it is in the file, or without its unit.
            holes: whether missing cells are NaN; else they are refused.
        """
        return self.table.numbers(self.place(name), holes)

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

    def _stated_size(self, field: str, place: int, text: str) -> tuple[float, Powers]:
        """Size and powers of a unit, of a multiple of one, or of a sensor's scale as "0.05 N.m/A".

        A scale is per unit of the column, or per ampere or volt where the column states no unit.
        """
        unit = parse_unit(text)
        if unit is not None:
            return float(unit[0]), unit[1]
        known = _scaled_unit(text)
        if known is None:
            bound = "must be a unit, as mm, N or deg, or a scale, as 0.05N.m/A or 20N/V"
            raise ParameterError(field, text, bound)
        over, _, under = text.rpartition("/")
        per, scale = parse_unit(under), _scaled_unit(over)
        if per is None or scale is None:
            return known
        own = next((x for x in map(parse_unit, self.table.heads[place].own_units) if x), None)
        if own is not None and own[1] == per[1]:
            return scale[0] * float(own[0] / per[0]), scale[1]
        return scale if own is None and per[1][AMPERES] else known

    def _names(self) -> list[list[set[str]]]:
        """Names of the columns: as in the file, without units, without units as last words."""
        heads = self.table.heads
        whole, bare = [{head.text} for head in heads], [{head.name} for head in heads]
        stems = [{head.name, *head.stems} for head in heads]
        return [whole, bare, stems]


def open_log(
    field: str, path: str | os.PathLike[str] | Log, reading: Reading = NOTHING_STATED
) -> Log:
    """As `Log.read`, with the name of the path for errors; a log is taken as it is."""
    if isinstance(path, Log):
        log = path.stating(reading.units, reading.counts)
        return log if reading.rate is None else _clocked(log, reading.rate)
    table = _told_apart(open_table(field, Path(path), reading.table))
    log = Log(Path(path), table, reading=Reading(table=reading.table))
    log = log.stating(reading.units, reading.counts)
    log = _chosen(log, reading.where) if reading.where else log
    return log if reading.rate is None else _clocked(log, reading.rate)


def _clocked(log: Log, rate: float) -> Log:
    """The log with a time by the rate of its rows."""
    rate = number("rate", rate, 0.0, MOST_RATE, above=True, unit="Hz")
    reading = replace(log.reading, rate=rate)
    return replace(log, table=Clocked(log.table, rate), reading=reading)


def _told_apart(table: Table) -> Table:
    """A table in which each name stands once: columns that are the same are taken as one."""
    import numpy as np

    names = [head.text for head in table.heads]
    if len(set(names)) == len(names):
        return table
    kept: list[int] = []
    for place, name in enumerate(names):
        before = [table.loose_numbers(i) for i in kept if names[i] == name]
        if not any(np.array_equal(table.loose_numbers(place), x, equal_nan=True) for x in before):
            kept.append(place)
    heads = numbered([table.heads[i] for i in kept])
    notes = []
    for name in dict.fromkeys(x for x in names if names.count(x) > 1):
        mine = [head.text for i, head in zip(kept, heads, strict=True) if names[i] == name]
        words = f"they are {', '.join(mine)}" if len(mine) > 1 else "they are the same, read as one"
        notes.append(f"{names.count(name)} columns are named {name}: {words}")
    return Picked(table, tuple(kept), heads, (*table.notes, *notes))


def _chosen(log: Log, where: Mapping[str, float]) -> Log:
    """The rows in which columns have some values."""
    import numpy as np

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
    reading = replace(log.reading, where=dict(where))
    return replace(log, table=Chosen(log.table, rows, (*log.table.notes, note)), reading=reading)


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
    log.check_once(units)
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


def _scaled_unit(text: str) -> tuple[float, Powers] | None:
    """Size and powers of "0.01 mm"; None for another text."""
    parts = parts_of(text)
    unit = parts and parse_unit(parts[1])
    return unit and parts and (float(parts[0] * unit[0]), unit[1])


def _count(field: str, size: Any) -> tuple[float, Powers]:
    """Size of a count: of counts a turn, or as it is stated."""
    if isinstance(size, str) and (unit := _scaled_unit(size)) is not None:
        return unit
    with contextlib.suppress(ValueError):  # "4096", as words of a command line are
        size = float(size) if isinstance(size, str) else size
    if isinstance(size, str):
        bound = "must be counts a turn, as 4096, or the size of a count, as 0.01mm or 0.088deg"
        raise ParameterError(field, size, bound)
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
            self._check(powers, f"{si_unit(powers)}, as stated")
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
            raise self._refusal(f"{self._wants}, not in {one_line(text, 40)}{hint * kilograms}")

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
