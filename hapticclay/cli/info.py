"""`hapticclay info`: what is in a saved record."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..display import one_line, printable, text_table
from ..files import versions
from .options import Loose

if TYPE_CHECKING:
    from ..simulation.record import Record


@dataclass(frozen=True)
class InfoCommand:
    """Print what a saved record holds: scenario, outcome, samples, arrays with units and ranges.

    Attributes:
        record: The record: its folder, or its record.npz.
    """

    record: Loose[Path]

    def __call__(self) -> int:
        from ..simulation.record import Record

        record = Record.load(self.record)
        file = self.record / "record.npz" if os.path.isdir(self.record) else self.record
        print(record_text(record, file.stat().st_size))
        return 0


def record_text(record: Record, size: int) -> str:
    """What a record holds, for a terminal."""
    import numpy as np

    from ..scene.text import scenario_rows
    from ..simulation.engines import made_by
    from ..simulation.record import RECORD_SCHEMA

    r, n = record, len(record.t)
    lines = [f"record of {one_line(r.scenario.name)}, {RECORD_SCHEMA}, {_size_text(size)}"]
    rows = [("status", r.status)]
    rows += [("advice", r.outcome.advice)] * bool(r.outcome.advice)
    span = f"{n}, from {r.t[0]:.6g} to {r.t[-1]:.6g} s" if n else "0"
    step = f", every {np.median(np.diff(r.t)):.6g} s" if n > 1 else ""
    rows.append(("samples", span + step))
    rows.append(("run", f"{r.steps} steps in {r.wall_time:.2f} s"))
    events = [f"{len(r.crossings)} borders crossed", f"held still {len(r.stops)} times"]
    rows.append(("events", ", ".join(events[: 1 + bool(r.stops)])))
    rows += [("error", one_line(r.error, 200))] * (r.error is not None)
    rows += [("notes", ", ".join(r.notes))] * bool(r.notes)
    rows += scenario_rows(r.scenario)
    rows.append(("written by", "  ".join(f"{k} {v}" for k, v in r.versions.items())))
    now = versions()["hapticclay"]
    if r.versions.get("hapticclay") != now:
        rows.append(("read by", f"hapticclay {now}"))
    rows.append(("runs here", f"made by {made_by()}"))
    width = max(len(name) for name, _ in rows)
    lines += [f"{name:{width}}  {value}" for name, value in rows]
    return printable("\n".join([*lines, "", array_table(r)]))


def array_table(record: Record) -> str:
    """Shape, unit and range of each array, for a terminal."""
    import numpy as np

    from ..simulation.columns import COLUMNS
    from ..simulation.tables import recorded_arrays

    arrays = recorded_arrays(record)
    if record.ground is not None:
        arrays["ground"] = record.ground
    known = [x[np.isfinite(x)] for x in arrays.values()]
    table = {
        "array": list(arrays),
        "shape": [" x ".join(map(str, x.shape)) for x in arrays.values()],
        "unit": [COLUMNS[name].unit for name in arrays],
        "lowest": [x.min() if x.size else np.nan for x in known],
        "highest": [x.max() if x.size else np.nan for x in known],
        "what it is": [COLUMNS[name].words for name in arrays],
    }
    return text_table(table, {"lowest": ".6g", "highest": ".6g"})


def _size_text(size: float) -> str:
    for unit in ("bytes", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.3g} {unit}"
        size /= 1000.0
    return f"{size:.3g} GB"
