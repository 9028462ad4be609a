"""What a log holds: columns, units, ranges, rate, gaps, and the command to go on with."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..columns.finding import UNITS, candidates
from ..columns.heads import Head, is_unit, powers_of
from ..columns.log import Log
from ..columns.stamps import Stamps, times_of
from ..display import table_of
from ..errors import ParameterError
from ..results import Result
from ..units import Powers, parse_unit, si_unit
from .even_columns import begins_again, held_rows, unwrapped
from .measurement import LEAST_ROWS, ROTARY
from .outliers import runs_of, times
from .pair_log import is_pair
from .restarts import episodes

FEW = 3  # places that a remark names
STUCK = 0.02  # share of the rows, in a run at the largest or smallest value, that is suspicious
TREATED = "identify and fit say what they do about it (docs/logs.md)"
HUGE = 1e50  # a value beyond it is none: squares and sums of others do not overflow
LEAST = 20  # rows in which columns are judged
NO_TIME = "no time is known: name its column by --columns t=NAME, or state the rate by --rate 50"
NO_POSITION = (
    "no column of a position is known: name all by --columns t=NAME input=NAME output=NAME"
)
NO_FORCE = "no force or command is known beside the position: name it by --columns input=NAME"
MOST_COLUMNS = 1000  # of a report: a log has tens


@named
@dataclass(frozen=True, eq=False, repr=False)
class LogReport(Result):
    """What a log holds.

    Attributes:
        name: of the file.
        form: its format, in words.
        rows: number of rows.
        time: name of the column of time; "" without one.
        table: name, unit, range and remark of each column.
        t: time [s], (n,); None without one.
        columns: columns of numbers by name and unit, in SI units where theirs is known, (n,) each.
        notes: of the reader, one sentence each.
        warnings: what is suspicious, one sentence each.
        commands: commands to go on with.
    """

    drawn_by = "hapticclay.views.log_plots:log_plot"
    written_as = "columns"
    printed = {"columns": ()}

    name: str
    form: str
    rows: int
    time: str
    table: dict[str, list[Any]]
    t: np.ndarray | None
    columns: dict[str, np.ndarray]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    commands: tuple[str, ...]

    @property
    def stamps(self) -> Stamps | None:
        """Steps of the time; None without one."""
        return None if self.t is None else Stamps(self.t)

    def headline(self) -> str:
        """Name, format, rows and rate, in one line."""
        parts = [f"{self.name}: {self.form}", f"{self.rows} rows"]
        if self.stamps is not None and self.stamps.step > 0.0:
            bursts = f", in bursts of {self.stamps.burst}" if self.stamps.burst > 1 else ""
            parts.append(f"{self.stamps.duration:.6g} s at {self.stamps.rate:.6g} Hz{bursts}")
        return ", ".join(parts)

    def tables(self) -> dict[str, dict[str, Any]]:
        """The columns, and the stamps of time."""
        stamps = {} if self.stamps is None else {"time": _stamps_table(self.stamps)}
        return {"columns": self.table, **stamps}

    def remarks(self) -> list[str]:
        """Stamps of time, notes of the reader, warnings and commands."""
        lines = [self.headline()]
        if self.stamps is not None:
            table = _stamps_table(self.stamps)
            lines.append("time: " + ", ".join(f"{k} {v[0]:.6g}" for k, v in table.items()))
        lines += [f"note: {x}" for x in self.notes]
        lines += [f"warning: {x}" for x in self.warnings]
        return [*lines, *(f"go on with: {x}" for x in self.commands)]


def _stamps_table(stamps: Stamps) -> dict[str, list[float]]:
    return {
        "step [s]": [stamps.step],
        "jitter [s]": [stamps.jitter],
        "even [%]": [100.0 * stamps.even],
        "gaps": [len(stamps.gaps)],
        "repeated": [len(stamps.repeats)],
        "backward": [len(stamps.backward)],
    }


@checked
def log_report(log: Log) -> LogReport:
    """What a log holds, with what is suspicious in it.

    Args:
        log: the log.

    Raises:
        ParameterError: it has more than 1000 columns.
    """
    _check_columns(log)
    found = candidates(log, "time")
    time = found[0] if found else ""
    stamps, keep, warnings = _stamps(log, time)
    if stamps is not None:
        warnings += [_beside(log, other, stamps, keep) for other in found[1:]]
    if stamps is not None and stamps.even < 1.0:
        share = 100.0 * (1.0 - stamps.even)
        warnings.append(f"{share:.3g} % of the steps are off by more than 5 %: {TREATED}")
    rows, accepted, columns = [], _accepted(log), {}
    unknown: set[str] = set()  # columns whose unit is
    still: set[str] = set()  # those that do not change
    for place, head in enumerate(log.table.heads):
        size, unit, faults = _unit(log, place, accepted.get(head.text, ()))
        unknown |= {head.text} if faults else set()
        x = log.table.loose_numbers(place)
        kept = x[np.isfinite(x)] * size
        low, high = (float(kept.min()), float(kept.max())) if len(kept) else (math.nan, math.nan)
        still |= set() if low < high else {head.text}
        rows.append((head.text, unit, low, high, "; ".join([*faults, *_remarks(x)])))
        if len(kept) and head.text != time:
            columns[_label(head, unit)] = size * np.where(np.abs(x) > HUGE, math.nan, x)[keep]
    warnings += _unstated([x.name for x in log.table.heads if x.text in unknown])
    table = table_of(("column", "unit", "lowest", "highest", "remarks"), rows)
    commands: list[str] = []
    if stamps is not None and time not in unknown:
        commands, more = _commands(log, time, stamps, unknown | still)
        warnings += more
    t = None if stamps is None else stamps.t
    said = tuple(log.table.notes), tuple(warnings), tuple(commands)
    name, form = log.path.name, log.table.form
    return LogReport(name, form, log.rows, time, table, t, columns, *said)


def _check_columns(log: Log) -> None:
    """Refuses a table that lies on its side."""
    count, unnamed = len(log.names), all(x.isdigit() for x in log.names)
    if count <= MOST_COLUMNS and not (unnamed and log.rows < LEAST < count):
        return
    most = f"must have at most {MOST_COLUMNS} columns" if count > MOST_COLUMNS else "must have rows"
    bound = f"{most}, has {count} columns of {log.rows} rows: are rows and columns exchanged?"
    raise ParameterError("file", str(log.path), bound)


def _label(head: Head, unit: str) -> str:
    """Name of a column with the unit in which it is shown."""
    si = unit.rpartition("shown in ")[2]
    if not si or not parse_unit(si) or unit == "none: SI":
        return head.text
    stem = next((stem for stem, word in head.last_words() if is_unit(word)), head.text)
    return f"{head.name if head.unit else stem} [{si}]"


def _stamps(log: Log, time: str) -> tuple[Stamps | None, Any, list[str]]:
    """The stamps of a log, the rows that have one, and what is suspicious in them."""
    every = slice(None)
    if not log.rows:
        return None, every, ["there are no rows of numbers"]
    if not time:
        return None, every, [NO_TIME]
    try:
        t, out = times_of(log, time, holes=True)
    except ParameterError as error:
        return None, every, [f"{time} is no time: {error.bound}"]
    keep = np.isfinite(t)
    if not keep.any():
        return None, every, [f"{time} is no time: it holds no numbers"]
    if lost := int(np.count_nonzero(~keep)):
        out.append(f"{_several(lost, 'row')} without a time: left out")
    stamps = Stamps(t[keep])
    t = stamps.t
    if len(gaps := stamps.gaps):
        longest = float(np.max(stamps.steps))
        out.append(
            f"{_several(len(gaps), 'gap')}, the longest {longest:.4g} s, at t = {times(t[gaps])} s"
        )
    if len(again := stamps.repeats):
        first = f"{_several(len(again), 'stamp')} as the one before"
        out.append(f"{first}, at t = {times(t[again])} s")
    if len(back := stamps.backward):
        out.append(
            f"{_several(len(back), 'stamp')} before the one before, at t = {times(t[back])} s"
        )
    if stamps.step > 0.0 and not 1.0 <= stamps.rate <= 1e5:
        out.append(f"a rate of {stamps.rate:.3g} Hz: is the time in seconds?")
    return stamps, keep, out


def _several(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"


def _beside(log: Log, other: str, stamps: Stamps, keep: Any) -> str:
    """How another clock runs beside that of the stamps."""
    x = log.table.loose_numbers(log.place(other))[keep] * log.size(log.place(other))[0]
    good = np.isfinite(x)
    if np.count_nonzero(good) < LEAST or not np.ptp(x[good]) * np.ptp(stamps.t[good]) > 0.0:
        return f"{other} is no clock"
    rate, start = np.polyfit(stamps.t[good], x[good], 1)
    rest = x[good] - start - rate * stamps.t[good]
    return (
        f"a second clock, {other}: it runs {1e6 * (rate - 1.0):+.0f} ppm fast beside the first, "
        f"with a deviation of {np.std(rest):.2g} s; name the one to use by --columns t=NAME"
    )


def _accepted(log: Log) -> dict[str, tuple[str, ...]]:
    """Units of the quantity that a name means, by the name of the column."""
    meanings = ("command", "position", "force", "time")
    return {name: UNITS[x] for x in meanings for name in candidates(log, x)}


def _unit(log: Log, place: int, accepted: tuple[str, ...]) -> tuple[float, str, list[str]]:
    """Size of the unit of a column, the unit in words, and what is wrong with it."""
    head = log.table.heads[place]
    try:
        size, powers = log.size(place, () if place in log.sizes else accepted)
    except ParameterError as error:
        return 1.0, head.unit, [error.bound.partition("; ")[2] or error.bound]
    if powers is None:
        words = [text for _, text in head.last_words() if parse_unit(text)]
        return 1.0, f"{words[0]}, by its name?" if words else "none: SI", []
    si = si_unit(powers)
    own = head.unit or next((x for _, x in head.last_words() if _has(x, powers)), "stated")
    return size, si if size == 1.0 else f"{own}, shown in {si}", []


def _has(unit: str, powers: Powers) -> bool:
    known = parse_unit(unit)
    return known is not None and known[1] == powers


def _unstated(unknown: list[str]) -> list[str]:
    """What to state where units are unknown."""
    if not unknown:
        return []
    pairs = " ".join(shlex.quote(f"{name}=UNIT") for name in unknown[:FEW])
    return [
        f"no command for {_several(len(unknown), 'column')} without a known unit: state it by "
        f"--units {pairs}, as N, mm or deg (--counts for those of an encoder)"
    ]


def _remarks(x: np.ndarray) -> list[str]:
    """What is suspicious in a column."""
    out, huge = [], np.abs(x) > HUGE
    if count := int(np.count_nonzero(huge)):
        out.append(f"{count} beyond {HUGE:g}")
    x = np.where(huge, math.nan, x)
    good = np.isfinite(x)
    if not good.any():
        return [*out, "no numbers"]
    if missing := int(np.count_nonzero(~good & ~huge)):
        out.append(f"{missing} missing")
    if (span := float(np.ptp(x[good]))) == 0.0:
        return [*out, "constant"]
    if len(x) < LEAST:
        return out
    ends = [np.isfinite(x) & (x == edge) for edge in (x[good].min(), x[good].max())]
    if (rows := held_rows(x)) > 1:
        out.append(f"changes every {rows} rows: held")
    stuck = sum(b - a for end in ends for a, b in runs_of(end) if b - a > FEW)
    if stuck > STUCK * len(x) and len(np.unique(x[good])) > LEAST:
        out.append("limited?")
    if len(at := unwrapped(x[good])[2]):
        return [*out, f"begins again {_several(len(at), 'time')}: an encoder that wraps"]
    steps = np.abs(np.diff(x[good]))
    if np.count_nonzero(steps > 0.5 * span) in range(1, max(len(x) // 50, 2)):
        count = int(np.count_nonzero(steps > 0.5 * span))
        out.append(f"{_several(count, 'jump')} of more than half the range")
    return out


def _commands(log: Log, time: str, stamps: Stamps, unfit: set[str]) -> tuple[list[str], list[str]]:
    """Commands that the columns suit, and why there are none; `unfit`: columns to leave out."""
    if log.rows < LEAST_ROWS:
        return [], [f"fewer than {LEAST_ROWS} rows: too few for identify and fit"]
    words, runs = shlex.quote(str(log.path)) + log.reading.words(), None
    if begins_again(stamps.t):
        runs = episodes(log, time)
        if runs is None:
            return [], ["the time goes back for long: two logs in one file? Split it there"]
        words += f" --where {shlex.quote(runs.where())}"
    if is_pair(log, unfit):
        return [f"hapticclay pair --data {words}"], []
    fit = {x: _of_quantity(log, x, unfit) for x in ("force", "position", "command")}
    place = next(iter(fit["position"]), None)
    if place is None:
        return [], [NO_POSITION]
    inputs = {x: _beside_place(log, names, place) for x, names in fit.items()}
    t = {} if log.clock else {"t": time}
    out = []
    for meaning, what in (("command", "G"), ("force", "S")):
        if inputs[meaning]:
            chosen = t | {"input": inputs[meaning], "output": place}
            out.append(f"hapticclay identify {words} --what {what} --columns {_pairs(chosen)}")
    if inputs["force"]:
        if inputs["command"]:  # in a closed loop the force follows from the motion too
            out.append(f"{out[-1]} {_pairs({'reference': inputs['command']})}")
        if log.powers(log.place(place)) not in ROTARY:
            chosen = t | {"p": place, "f": inputs["force"]}
            out.append(f"hapticclay fit {words} --columns {_pairs(chosen)}")
    return out, [] if out else [NO_FORCE]


def _of_quantity(log: Log, meaning: str, unfit: set[str]) -> list[str]:
    """Names of columns that can be meant and are in no unit of another quantity."""
    wanted = (None, *powers_of(UNITS[meaning]))
    return [
        x for x in candidates(log, meaning) if x not in unfit and _powers(log, x, meaning) in wanted
    ]


def _powers(log: Log, name: str, meaning: str) -> Powers | None:
    return log.size(log.place(name), () if log.place(name) in log.sizes else UNITS[meaning])[1]


def _beside_place(log: Log, names: Sequence[str], place: str) -> str:
    """The column that goes with a position: about an axis as it is, and of the same part.

    A part is the end of its name, as [1] or .j2. Returns "" where there is none.
    """
    end = re.search(r"(\[\d+\]|\.[^.]*)?$", place)
    rotary = log.powers(log.place(place))
    some = [x for x in names if x != place and _go_together(rotary, log.powers(log.place(x)))]
    same = [x for x in some if end and end[0] and x.endswith(end[0])]
    return next(iter(same or some), "")


def _go_together(place: Powers | None, other: Powers | None) -> bool:
    """Whether a position and a force or command are both along a line or both about an axis."""
    return None in (place, other) or (place in ROTARY) == (other in ROTARY)


def _pairs(names: Mapping[str, str]) -> str:
    return shlex.join(f"{key}={name}" for key, name in names.items())
