"""Checks of a file that claims to be a record, before and after it is read."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np

from ..model.constants import AXES
from .memory import memory_left

SUMMARY_MOST = 2**26  # [bytes] of the summary of a record
LATEST = 9e9  # [s] the latest time that formats of whole nanoseconds hold


def check_headers(archive: zipfile.ZipFile) -> None:
    """Checks the headers of the arrays of an .npz file, without reading the arrays."""
    for member in archive.infolist():
        _check_header(archive, member)
    size = sum(x.file_size for x in archive.infolist())
    if size > 0.5 * memory_left():
        raise ValueError(f"it takes {size / 1e9:.3g} GB of memory, more than are left")


def _check_header(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> None:
    with archive.open(member) as f:
        version = np.lib.format.read_magic(f)
        read: Any = getattr(np.lib.format, f"read_array_header_{version[0]}_0", None)
        if read is None:
            raise ValueError(f"{member.filename} has a format of its own, {version}")
        shape, _, kind = read(f)
        left = member.file_size - f.tell()
    if kind.hasobject or math.prod(shape) * kind.itemsize != left:
        raise ValueError(f"{member.filename} holds {left} bytes, of another size than it says")
    if member.filename == "summary.npy" and left > SUMMARY_MOST:
        raise ValueError(f"its summary is larger than {SUMMARY_MOST} bytes")


def check_times(t: np.ndarray) -> None:
    """Checks the times of samples."""
    if len(t) and not 0.0 <= t[0] <= t[-1] <= LATEST:
        raise ValueError(f"array t must lie from 0 to {LATEST:g} s, are {t[0]:g} to {t[-1]:g} s")
    back = np.flatnonzero(np.diff(t) <= 0.0)
    if len(back):
        raise ValueError(f"array t must ascend, and {t[back[0]]:g} s is followed by one no later")


def _is_number(x: Any) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and math.isfinite(x)


def _is_count(x: Any) -> bool:
    return isinstance(x, int) and not isinstance(x, bool) and x >= 0


def _is_text(x: Any) -> bool:
    return isinstance(x, str)


def _is_axis(x: Any) -> bool:
    return x in (*AXES, "xy")


Check = Callable[[Any], bool]
PARTS: dict[str, dict[str, Check]] = {  # what stands in the summary of a record
    "": {"steps": _is_count, "wall_time_s": _is_number},
    "outcome": {
        "code": _is_text, "time": _is_number, "step": lambda x: x == -1 or _is_count(x),
        "axis": _is_text, "cause": _is_text, "advice": _is_text,
    },
    "crossings": {
        "axis": _is_axis, "border": _is_number, "time": _is_number, "speed": _is_number,
    },
    "stops": {
        "axis": _is_axis, "start": _is_number, "end": lambda x: x is None or _is_number(x),
    },
}  # fmt: skip
TABLES: dict[str, Check] = {"energy": _is_number, "versions": _is_text}  # names and values


def check_head(head: dict[str, Any]) -> None:
    """Checks the types of all entries in the summary of a record but the scenario."""
    _check_entries("", head, PARTS[""])
    _check_entries("outcome.", head["outcome"], PARTS["outcome"])
    for name in ("crossings", "stops"):
        rows = head.get(name, [])
        if not isinstance(rows, list):
            raise ValueError(f"{name} must be a list, is {rows!r:.40}")
        for i, row in enumerate(rows):
            _check_entries(f"{name}[{i}].", row, PARTS[name])
    for name, check in TABLES.items():
        names = head[name] if isinstance(head[name], dict) else ()
        _check_entries(f"{name}.", head[name], dict.fromkeys(names, check))
    if not isinstance(head.get("notes", {}), dict):
        raise ValueError("notes must be a table")


def _check_entries(where: str, entries: Any, checks: dict[str, Check]) -> None:
    if not isinstance(entries, dict):
        raise ValueError(f"{where.rstrip('.') or 'the summary'} must be a table")
    for name, check in checks.items():
        if name in entries and not check(entries[name]):
            raise ValueError(f"{where}{name} is {entries[name]!r:.40}")
