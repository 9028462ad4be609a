"""Logs of MCAP and of ROS: a table for each topic, or all on the stamps of one."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..display import one_line
from ..errors import ParameterError, needing
from .array_tables import ArrayTable
from .heads import Head
from .stamps import Stamps

COVERED = 0.8  # share of the base's time that a topic spans, to be read beside it
CLOCKS = "stamp", "t", "time", "timestamp"
TIMES = (*CLOCKS, "received")
MOST_ITEMS = 64  # of an array in a message
DAY = 86_400_000_000_000  # [ns]: stamps that are farther from the log's are of another clock
OWN_CLOCK = (
    "stamps of {} are of another clock than the log's: taken from their start, and joined by when "
    "messages were received"
)


class Instant(int):
    """A time [ns]."""


Row = dict[str, "float | Instant"]
Decode = Callable[[bytes], Any]


@dataclass
class Topic:
    """Messages of a topic as columns."""

    start: int  # of the log [ns]
    rows: list[Row] = field(default_factory=list)
    received: list[float] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    lost: int = 0  # messages that cannot be read
    why: str = ""

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """Columns of numbers; NaN where a message has no such number."""
        names = dict.fromkeys(k for row in self.rows for k in row)
        return {k: self._column(k) for k in names}

    def _column(self, name: str) -> np.ndarray:
        values = [row.get(name, math.nan) for row in self.rows]
        known = [x for x in values if isinstance(x, Instant)]
        if known:
            start = known[0] if self._is_far(known) else self.start
            values = [1e-9 * (x - start) if isinstance(x, Instant) else math.nan for x in values]
        return np.array(values, dtype=float)

    @property
    def has_own_clock(self) -> bool:
        """Whether its stamps are of another clock than that of the log."""
        return self._is_far([x for row in self.rows if isinstance(x := row.get("stamp"), Instant)])

    def _is_far(self, stamps: list[Instant]) -> bool:
        return bool(stamps) and abs(stamps[len(stamps) // 2] - self.start) > DAY

    def publishers(self, name: str) -> dict[str, Topic]:
        """The topic by name, in parts where messages have nothing but their clock in common."""
        parts: list[tuple[set[str], list[int]]] = []
        for i, row in enumerate(self.rows):
            keys = {k for k in row if k not in TIMES}
            mine = [x for x in parts if x[0] & keys]
            merged = set.union(keys, *(x[0] for x in mine)), sum((x[1] for x in mine), [i])
            parts = [x for x in parts if x not in mine] + [merged] if len(mine) != 1 else parts
            if len(mine) == 1:
                mine[0][0].update(keys)
                mine[0][1].append(i)
        parts.sort(key=lambda x: -len(x[1]))
        names = [name, *(f"{name}#{n}" for n in range(2, len(parts) + 1))]
        return {
            each: replace(
                self,
                rows=[self.rows[i] for i in sorted(at)],
                received=[self.received[i] for i in sorted(at)],
            )
            for each, (_, at) in zip(names, parts, strict=False)
        }


class Unread(Exception):
    """A topic cannot be read.

    Args:
        why: in words.
    """


@dataclass
class Messages:
    """Messages of a log by topic, and topics that are not read, with the cause."""

    topics: dict[str, Topic] = field(default_factory=dict)
    unread: dict[str, str] = field(default_factory=dict)
    start: int | None = None

    def add(self, name: str, at: int, data: bytes, decode: Decode, units: dict[str, str]) -> None:
        """Adds a message that was received at a time [ns]."""
        self.start = at if self.start is None else self.start
        topic = self.topics.setdefault(name, Topic(self.start, units=units))
        try:
            row = dict(_numbers(decode(data)))
        except Exception as error:  # whatever a library raises of a damaged message
            topic.lost, topic.why = topic.lost + 1, one_line(error, 60) or type(error).__name__
            return
        topic.rows.append(row)
        topic.received.append(1e-9 * (at - self.start))

    def notes(self) -> list[str]:
        """What is not read, one sentence each."""
        out = [f"topic {name} is not read: {why}" for name, why in self.unread.items()]
        return out + [
            f"topic {name}: {x.lost} of {x.lost + len(x.rows)} messages cannot be read ({x.why})"
            for name, x in self.topics.items()
            if x.lost
        ]


def mcap(field: str, path: Path, table: str = "") -> ArrayTable:
    """An MCAP file: messages of JSON, or of ROS."""
    with needing("an MCAP log", "mcap", "logs"):
        from mcap.reader import make_reader

    found, ways = Messages(), {}
    with open(path, "rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        known = None
        if summary is not None and summary.channels:
            every = [(x, summary.schemas.get(x.schema_id)) for x in summary.channels.values()]
            known = {x.topic for x, schema in every if _way(found, ways, x, schema) is not None}
        for schema, x, message in reader.iter_messages(known) if known != set() else ():
            decode = _way(found, ways, x, schema)
            if decode is not None:
                found.add(x.topic, message.log_time, message.data, decode, _schema_units(schema))
    for topic in found.topics.values():
        topic.rows = _timed(topic.rows, topic.received)
    return _table(field, path, "MCAP", found, table)


def _way(
    found: Messages, ways: dict[int, Decode | None], channel: Any, schema: Any
) -> Decode | None:
    """How messages of a channel are read; None, with the cause noted, for one that is not read."""
    if channel.id not in ways:
        try:
            text = None if schema is None else schema.data.decode("utf-8", "replace")
            kind, form = ("", "") if schema is None else (schema.name, schema.encoding)
            encoding = channel.message_encoding
            ways[channel.id] = (
                json.loads if encoding == "json" else _of_ros(encoding, kind, form, text)
            )
        except Unread as error:
            ways[channel.id], found.unread[channel.topic] = None, str(error)
    return ways[channel.id]


def _of_ros(encoding: str, kind: str, form: str, text: str | None) -> Decode:
    """How messages of ROS of a type are read, by the text of its definition in some form."""
    if encoding not in ("cdr", "ros1"):
        raise Unread(encoding or "without an encoding")
    with needing("a ROS log", "rosbags", "logs"):
        from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
    try:
        store = get_typestore(Stores.LATEST if text is None else Stores.EMPTY)
        for part in [] if text is None else re.split(r"^=+\nIDL: .*\n", text, flags=re.MULTILINE):
            if part.strip():
                is_idl = form in ("ros2idl", "idl")
                types = get_types_from_idl(part) if is_idl else get_types_from_msg(part, kind)
                store.register({k: x for k, x in types.items() if k not in store.fielddefs})
        kind = kind if kind in store.fielddefs else kind.replace("/", "/msg/")
        if kind not in store.fielddefs:
            raise KeyError(kind)
    except Exception as error:  # whatever its parser raises
        raise Unread(f"its type {kind} cannot be parsed ({one_line(error, 60)})") from None
    unpack = store.deserialize_cdr if encoding == "cdr" else store.deserialize_ros1
    return lambda data: unpack(data, kind)


def _schema_units(schema: Any) -> dict[str, str]:
    """Units that the descriptions of a JSON schema end with, as in "position [m]"."""
    try:
        properties = json.loads(schema.data)["properties"]
        found = {
            k: re.search(r"\[([^\]]*)\]$", x.get("description", "")) for k, x in properties.items()
        }
        return {k: x[1] for k, x in found.items() if x}
    except (AttributeError, KeyError, TypeError, ValueError):
        return {}


def bag(field: str, path: Path, table: str = "") -> ArrayTable:
    """A bag of ROS 1 or 2."""
    with needing("a ROS log", "rosbags", "logs"):
        from rosbags.highlevel import AnyReader

    if files := sorted(path.glob("*.mcap")) if path.is_dir() else []:
        if len(files) == 1:
            return mcap(field, files[0], table)
    found, ways = Messages(), {}
    (reader,) = AnyReader([path]).readers
    with reader:
        for x in reader.connections:
            form, text = x.msgdef.format.name.lower(), x.msgdef.data
            encoding = "ros1" if path.suffix == ".bag" else "cdr"
            try:
                known = None if form == "none" else text
                ways[x.topic, x.msgtype] = _of_ros(encoding, x.msgtype, form, known)
            except Unread as error:
                found.unread[x.topic] = str(error)
        for x, at, data in reader.messages():
            if decode := ways.get((x.topic, x.msgtype)):
                found.add(x.topic, at, data, decode, {})
    for topic in found.topics.values():
        topic.rows = _timed(topic.rows, topic.received)
    return _table(field, path, "ROS", found, table)


def _timed(rows: list[Row], received: list[float]) -> list[Row]:
    """Messages on a clock that each of them has; else on when they were received."""
    timed = zip(received, rows, strict=True)
    if all("stamp" in row for row in rows):
        return [row | {"received": t} for t, row in timed]
    if any(all(clock in row for row in rows) for clock in ("t", "time", "timestamp")):
        return rows
    return [{"t": t} | {k: x for k, x in row.items() if k != "t"} for t, row in timed]


def _numbers(x: Any, name: str = "") -> Iterator[tuple[str, float | Instant]]:
    """Numbers in a message by a name with points, and its times."""
    if is_dataclass(x):
        x = {f.name: getattr(x, f.name) for f in fields(x) if not f.name.startswith("__")}
    if isinstance(x, Mapping):
        seconds = x.get("sec", x.get("secs"))
        nanos = x.get("nanosec", x.get("nsec", x.get("nsecs")))
        if seconds is not None and nanos is not None:
            whole = int(seconds) * 1_000_000_000 + int(nanos)
            if whole:
                yield name.removeprefix("header."), Instant(whole)
            return
        labels = x.get("name") if isinstance(x.get("name"), list) else []
        for key, value in x.items():
            yield from _items(value, f"{name}.{key}" if name else str(key), labels or [])
    elif isinstance(x, bool | int | float | np.number):
        yield name, float(x)


def _items(x: Any, name: str, labels: list[Any]) -> Iterator[tuple[str, float | Instant]]:
    """Numbers of a field; those of an array by the names that the message gives, or by number."""
    if not isinstance(x, list | tuple | np.ndarray):
        yield from _numbers(x, name)
    elif len(x) <= MOST_ITEMS:
        keys = labels if len(labels) == len(x) else None
        for i, value in enumerate(x):
            yield from _numbers(value, f"{name}.{keys[i]}" if keys else f"{name}[{i}]")


def _table(where: str, path: Path, form: str, found: Messages, table: str) -> ArrayTable:
    """One topic, or all that span most of the time, on the stamps of the fastest."""
    notes = found.notes()
    good: dict[str, Topic] = {}
    for name, topic in found.topics.items():
        parts = topic.publishers(name)
        good |= {k: x for k, x in parts.items() if len(x.rows) > 1 and len(x.columns) > 1}
        if len(parts) > 1 and (not table or name == table):
            notes.append(f"{name} has {len(parts)} publishers: {', '.join(parts)}")
    if table and table not in good:
        why = f"; {table} is not read: {found.unread[table]}" if table in found.unread else ""
        bound = f"must be one of {one_line(', '.join(good), 200)}{why}"
        raise ParameterError("table", table, bound)
    if not good:
        unread = "; ".join(f"{k}: {x}" for k, x in found.unread.items())
        bound = "must hold messages of numbers, of JSON or ROS"
        raise ParameterError(where, str(path), f"{bound}; {unread}" if unread else bound)
    some = {k: x for k, x in good.items() if not table or k == table or _is_copy(k, table)}
    if len(some) == 1:
        ((name, topic),) = some.items()
        words = f"{form}, topic {name}"
        return _made(where, path, words, topic.columns, topic.units, tuple(notes))
    return _joined(where, path, form, some, notes)


def _is_copy(name: str, table: str) -> bool:
    """Whether a name is that of another publisher of a topic."""
    return re.fullmatch(r"#\d+", name.removeprefix(table)) is not None


def _joined(
    where: str, path: Path, form: str, topics: Mapping[str, Topic], notes: list[str]
) -> ArrayTable:
    """The topics that span most of the time of the fastest, on its stamps."""
    base = max(topics, key=lambda k: len(topics[k].rows))
    others = [k for k in topics if k != base]
    alone = all(_is_copy(k, base) for k in others)  # publishers of one topic
    strange = [k for k, x in topics.items() if x.has_own_clock]
    notes += [OWN_CLOCK.format(", ".join(strange))] if strange else []
    clocks = {k: _clock(x.columns, bool(strange)) for k, x in topics.items()}
    t = clocks[base]
    columns = {k if alone or k in CLOCKS else f"{base}.{k}": x
               for k, x in topics[base].columns.items()}  # fmt: skip
    units = {k if alone else f"{base}.{k}": x for k, x in topics[base].units.items()}
    for name in others:
        topic, own = topics[name], clocks[name]
        covered, note = _covered(t, Stamps(own))
        if covered is None:
            notes.append(f"topic {name} {note}: read it as --table {name}")
            continue
        notes.append(f"topic {name} is interpolated linearly onto the stamps of {base}{note}")
        mine = {k: x for k, x in topic.columns.items() if k not in TIMES}
        columns |= {
            k if alone else f"{name}.{k}": np.where(covered, _at(t, own, x), math.nan)
            for k, x in mine.items()
        }
        units |= {k if alone else f"{name}.{k}": x for k, x in topic.units.items()}
    count = f"topic {base}" if alone else f"{len(topics)} topics"
    return _made(where, path, f"{form}, {count}", columns, units, tuple(notes))


def _at(t: np.ndarray, own: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A column at other times; messages without it are passed over."""
    good = np.isfinite(x)
    return np.interp(t, own[good], x[good]) if good.any() else np.full(len(t), math.nan)


def _clock(columns: Mapping[str, np.ndarray], by_receipt: bool) -> np.ndarray:
    """Stamps of a topic [s], or the times at which its messages were received."""
    clocks = ("received", "t") if by_receipt else CLOCKS
    return next((columns[k] for k in clocks if k in columns), next(iter(columns.values())))


def _covered(t: np.ndarray, own: Stamps) -> tuple[np.ndarray | None, str]:
    """Times at which another topic is between stamps that are no gap; None for too few."""
    if len(own.backward) or len(own.repeats):
        return None, "has stamps that do not go ahead"
    within = (t >= own.t[0]) & (t <= own.t[-1])
    if np.mean(within) < COVERED:
        return None, "spans too little of the time"
    inside = within.copy()
    for i in own.gaps.tolist():
        inside &= (t <= own.t[i]) | (t >= own.t[i + 1])
    note = f"{1.0 / own.step:.4g} Hz"
    if lost := int(np.count_nonzero(within & ~inside)):
        count, longest = len(own.gaps), float(own.steps.max())
        gaps = f"{count} gap{'s' * (count > 1)}, the longest {longest:.3g} s"
        if np.mean(inside) < COVERED:
            return None, f"has {gaps}"
        note += f"; {lost} rows in its {gaps} have no value of it"
    return inside, f" ({note})"


def _made(
    where: str,
    path: Path,
    form: str,
    columns: Mapping[str, np.ndarray],
    units: Mapping[str, str],
    notes: tuple[str, ...] = (),
) -> ArrayTable:
    """A table; the unit of a vector is that of its parts."""
    heads = [
        Head(k, next((u for name, u in units.items() if _within(k, name)), "")) for k in columns
    ]
    return ArrayTable(where, path, tuple(heads), tuple(columns.values()), form, notes)


def _within(name: str, of: str) -> bool:
    return name == of or name.startswith((f"{of}.", f"{of}["))
