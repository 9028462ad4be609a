"""A record as a file for other programs: netCDF, Parquet, CSV, MCAP, Rerun, MATLAB."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..display import one_line
from ..errors import ParameterError, choice, needing
from ..files import atomic
from . import tables
from .columns import COLUMNS, Recorded, parts_of
from .stored import check_times

TOPIC = "/hapticclay"  # of MCAP
RECORDING = "hapticclay"  # application of a Rerun recording
ROWS = 4096  # lines of a text file that are written at once


def export_record(record: Recorded, path: str | os.PathLike[str], kind: str | None = None) -> Path:
    """Writes a record in a format of EXPORTS, whole or not at all; an older file is replaced."""
    file = Path(path)
    if kind is None:
        kind = file.suffix[1:].lower()
    write = EXPORTS[choice("format", kind, tuple(EXPORTS))]
    try:
        check_times(record.t)
    except ValueError as error:
        raise ParameterError("record", record.scenario.name, str(error)) from None
    with atomic(file) as f:
        write(record, f)
    return file


def _netcdf(record: Recorded, file: IO[bytes]) -> None:
    with needing("nc", "h5netcdf"):
        import h5netcdf  # noqa: F401  # xarray finds it by name
        import h5py  # noqa: F401
    file.write(tables.to_xarray(record).to_netcdf(engine="h5netcdf"))


def _parquet(record: Recorded, file: IO[bytes]) -> None:
    frame = tables.to_frame(record).reset_index()
    with needing("parquet", "pyarrow"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    units = frame.attrs["units"]
    table = pa.Table.from_pandas(frame, preserve_index=False)
    fields = [f.with_metadata({"unit": units[f.name]}) for f in table.schema]
    pq.write_table(table.cast(pa.schema(fields, table.schema.metadata)), file)


def _csv(record: Recorded, file: IO[bytes]) -> None:
    columns, units = tables.record_columns(record), tables.column_units(record)
    title = f"{one_line(record.scenario.name)}: {one_line(record.status, 200)}"
    labels = ", ".join(f"{name} [{unit}]" for name, unit in units.items())
    file.write(f"# {title}\n# {labels}\n{','.join(columns)}\n".encode())
    values = np.column_stack(list(columns.values()))
    for i in range(0, len(values), ROWS):  # repr preserves the float exactly
        rows = values[i : i + ROWS].tolist()
        file.write("".join(f"{','.join(map(repr, row))}\n" for row in rows).encode())


def _mcap(record: Recorded, file: IO[bytes]) -> None:
    with needing("mcap", "mcap"):
        from mcap.writer import Writer
    attributes = tables.attributes_of(record)
    writer = Writer(file)
    writer.start(library=attributes["source"])
    writer.add_metadata("hapticclay", {k: str(v) for k, v in attributes.items()})
    schema = writer.register_schema(
        "hapticclay.Sample", "jsonschema", json.dumps(_sample_schema(record)).encode()
    )
    channel = writer.register_channel(TOPIC, "json", schema)
    arrays = {name: x.tolist() for name, x in tables.recorded_arrays(record).items()}
    parts = {name: parts_of(name, record.scenario) for name in arrays}
    for i, t in enumerate(arrays["t"]):
        sample = {name: _entry(parts[name], x[i]) for name, x in arrays.items()}
        at = round(1e9 * t)
        writer.add_message(channel, at, json.dumps(sample).encode(), at, i)
    writer.finish()


def _entry(parts: tuple[str, ...], x: Any) -> Any:
    """A number or numbers by part for JSON, which has null for NaN."""
    if parts:
        return {part: _entry((), one) for part, one in zip(parts, x, strict=True)}
    return x if math.isfinite(x) else None


def _sample_schema(record: Recorded) -> dict[str, Any]:
    """The JSON schema of a sample."""

    def entry(name: str) -> dict[str, Any]:
        (unit, words, _), parts = COLUMNS[name], parts_of(name, record.scenario)
        kind: dict[str, Any] = {"type": "object" if parts else "number"}
        kind["description"] = f"{words} [{unit}]"
        return kind | ({"properties": {x: {"type": "number"} for x in parts}} if parts else {})

    names = tables.recorded_arrays(record)
    return {"type": "object", "properties": {name: entry(name) for name in names}}


def _rerun(record: Recorded, file: IO[bytes]) -> None:
    with needing("rrd", "rerun-sdk", "rerun"):
        import rerun as rr
    attributes = tables.attributes_of(record)
    recording = rr.RecordingStream(RECORDING)
    memory = recording.memory_recording()  # a file written by Rerun itself would hide a full disk
    for name, text in attributes.items():
        recording.log(f"about/{name}", rr.TextDocument(str(text)), static=True)
    whole = np.rint(1e9 * record.t).astype("timedelta64[ns]")  # floats would be truncated
    time = rr.TimeColumn("t", duration=whole)
    for name, x in tables.recorded_arrays(record).items():
        if name == "t":
            continue
        lines = [f"{name}_{part}" for part in parts_of(name, record.scenario)] or [name]
        labels = [f"{line} [{COLUMNS[name].unit}]" for line in lines]
        recording.log(name, rr.SeriesLines(names=labels), static=True)
        if len(x):
            recording.send_columns(name, indexes=[time], columns=rr.Scalars.columns(scalars=x))
    content = memory.drain_as_bytes()
    if content is None:
        raise ParameterError("format", "rrd", "rerun gave no recording")
    file.write(content)


def _matlab(record: Recorded, file: IO[bytes]) -> None:
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    arrays = tables.recorded_arrays(record)
    units = {name: COLUMNS[name].unit for name in arrays}
    if record.ground is not None:
        arrays, units = arrays | {"ground": record.ground}, units | {"ground": "m"}
    attributes = tables.attributes_of(record)
    parts = {name: parts_of(name, record.scenario) or ("",) for name in units}
    axes = {name: np.array(x, dtype=object) for name, x in parts.items()}
    try:
        savemat(file, {**arrays, "units": units, "columns": axes, **attributes}, oned_as="column")
    except MatWriteError as error:
        bound = f"must be smaller for a MAT file ({error}): use nc, which MATLAB reads"
        raise ParameterError("format", "mat", bound) from None


EXPORTS: dict[str, Callable[[Recorded, IO[bytes]], None]] = {
    "nc": _netcdf,
    "parquet": _parquet,
    "csv": _csv,
    "mcap": _mcap,
    "rrd": _rerun,
    "mat": _matlab,
}
"""Name of each format, and the end of its files; the function that writes a record into a file. To
add a format, add an entry."""
