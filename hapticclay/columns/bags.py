"""Logs of MCAP and of ROS: a table for each topic, or all on the stamps of one."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
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
MOST_ITEMS = 64  # of an array in a message
Row = dict[str, float]


@dataclass
class Topic:
    """Messages of a topic as columns."""

    rows: list[Row] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)

    def columns(self) -> dict[str, np.ndarray]:
        """Columns that each message has."""
        names = [k for k in self.rows[0] if all(k in row for row in self.rows)]
        return {k: np.array([row[k] for row in self.rows]) for k in names}


def mcap(field: str, path: Path, table: str = "") -> ArrayTable:
    """An MCAP file: messages of JSON, or of ROS."""
    with needing("an MCAP log", "mcap", "logs"):
        from mcap.reader import make_reader

    with open(path, "rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        channels = [] if summary is None else list(summary.channels.values())
        if channels and any(x.message_encoding != "json" for x in channels):
            return bag(field, path, table)
        topics: dict[str, Topic] = {}
        logged: dict[str, list[float]] = {}
        start = None
        for schema, channel, message in reader.iter_messages():
            topic = topics.setdefault(channel.topic, Topic(units=_schema_units(schema)))
            start = message.log_time if start is None else start
            topic.rows.append(dict(_numbers(json.loads(message.data))))
            logged.setdefault(channel.topic, []).append(1e-9 * (message.log_time - start))
    for name, topic in topics.items():
        topic.rows = _clocked(topic.rows, logged[name])
    return _table(field, path, "MCAP", topics, table)


def _clocked(rows: list[Row], logged: list[float]) -> list[Row]:
    """Messages on a clock that each of them has; else on when they were logged."""
    if any(all(clock in row for row in rows) for clock in ("t", "time", "timestamp")):
        return rows
    timed = zip(logged, rows, strict=True)
    return [{"t": t} | {k: x for k, x in row.items() if k != "t"} for t, row in timed]


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
    """A bag of ROS 1 or 2, or an MCAP file with messages of ROS."""
    with needing("a ROS log", "rosbags", "logs"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore

    topics: dict[str, Topic] = {}
    received: dict[str, list[float]] = {}
    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        start = reader.start_time
        for connection, stamp, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            row = dict(_numbers(message, start=start))
            topics.setdefault(connection.topic, Topic()).rows.append(row)
            received.setdefault(connection.topic, []).append(1e-9 * (stamp - start))
    for name, topic in topics.items():
        topic.rows = _timed(topic.rows, received[name])
    return _table(field, path, "ROS", topics, table)


def _timed(rows: list[Row], received: list[float]) -> list[Row]:
    """Messages on their stamps; on when they were received where one has no stamp."""
    timed = zip(received, rows, strict=True)
    if all("stamp" in row for row in rows):
        return [row | {"received": t} for t, row in timed]
    return [{"t": t} | row for t, row in timed]


def _numbers(x: Any, name: str = "", start: int = 0) -> Iterator[tuple[str, float]]:
    """Numbers in a message by a name with points; stamps in seconds since the start."""
    if is_dataclass(x):
        x = {f.name: getattr(x, f.name) for f in fields(x) if not f.name.startswith("__")}
    if isinstance(x, Mapping):
        seconds = x.get("sec", x.get("secs"))
        nanos = x.get("nanosec", x.get("nsec", x.get("nsecs")))
        if seconds is not None and nanos is not None:
            whole = int(seconds) * 1_000_000_000 + int(nanos)
            if whole:
                yield name.removeprefix("header."), 1e-9 * (whole - start)
            return
        labels = x.get("name") if isinstance(x.get("name"), list) else []
        for key, value in x.items():
            yield from _items(value, f"{name}.{key}" if name else str(key), labels or [], start)
    elif isinstance(x, bool | int | float | np.number):
        yield name, float(x)


def _items(x: Any, name: str, labels: list[Any], start: int) -> Iterator[tuple[str, float]]:
    """Numbers of a field; those of an array by the names that the message gives, or by number."""
    if not isinstance(x, list | tuple | np.ndarray):
        yield from _numbers(x, name, start)
    elif len(x) <= MOST_ITEMS:
        keys = labels if len(labels) == len(x) else None
        for i, value in enumerate(x):
            yield from _numbers(value, f"{name}.{keys[i]}" if keys else f"{name}[{i}]", start)


def _table(
    where: str, path: Path, form: str, topics: Mapping[str, Topic], table: str
) -> ArrayTable:
    """One topic, or all that span most of the time, on the stamps of the fastest."""
    good = {k: x for k, x in topics.items() if len(x.rows) > 1 and len(x.columns()) > 1}
    if table and table not in good:
        bound = f"must be one of {one_line(', '.join(good), 200)}"
        raise ParameterError("table", table, bound)
    if not good:
        bound = "must hold messages with numbers"
        raise ParameterError(where, str(path), bound)
    if table or len(good) == 1:
        name = table or next(iter(good))
        return _made(where, path, f"{form}, topic {name}", good[name].columns(), good[name].units)
    return _joined(where, path, form, good)


def _joined(where: str, path: Path, form: str, topics: Mapping[str, Topic]) -> ArrayTable:
    """The topics that span most of the time of the fastest, on its stamps."""
    base = max(topics, key=lambda k: len(topics[k].rows))
    clock = topics[base].columns()
    t = _clock(clock)
    columns = {f"{base}.{k}" if k not in CLOCKS else k: x for k, x in clock.items()}
    units = {f"{base}.{k}": x for k, x in topics[base].units.items()}
    inside, notes = np.ones(len(t), dtype=bool), []
    for name, topic in topics.items():
        if name == base:
            continue
        own = topic.columns()
        covered, note = _covered(t, Stamps(_clock(own)))
        if covered is None:
            notes.append(f"topic {name} {note}: read it as --table {name}")
            continue
        inside &= covered
        notes.append(f"topic {name} is interpolated linearly onto the stamps of {base}{note}")
        columns |= {
            f"{name}.{k}": np.interp(t, _clock(own), x)
            for k, x in own.items()
            if k not in (*CLOCKS, "received")
        }
        units |= {f"{name}.{k}": x for k, x in topic.units.items()}
    columns = {k: x[inside] for k, x in columns.items()}
    return _made(where, path, f"{form}, {len(topics)} topics", columns, units, tuple(notes))


def _clock(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Stamps of a topic [s]."""
    return next((columns[k] for k in CLOCKS if k in columns), next(iter(columns.values())))


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
        note += f"; {lost} rows in its {gaps}, left out"
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
