"""Storage of a sweep: Parquet files with its digest, in a folder locked by one process."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import platform
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from ..arguments import checked
from ..errors import ParameterError
from ..files import atomic
from .sampling import Sweep
from .sweep_rows import CHUNK_TIME, NO_INDEX, column_told, result_row, run_time

MARKS = (b"hapticclay_sweep", b"hapticclay_part")  # metadata keys: sweep's digest, chunk's number
MOST_IN_CHUNK = 1024  # runs, where they are short
BAD_PARTS_NAMED = 5  # damaged parts named in a message; the others are counted


class Stored(Protocol):
    """Protocol of runs stored like a Sweep: it makes its own rows, chunk by chunk."""

    def __len__(self) -> int: ...

    @property
    def chunks(self) -> int:
        """Number of files."""
        ...

    def chunk_runs(self, number: int) -> range:
        """The runs of one file.

        Args:
            number: of the file, from 0.
        """
        ...

    def chunk_rows(self, number: int) -> list[dict[str, Any]]:
        """Makes the runs of one file.

        Args:
            number: of the file, from 0.
        """
        ...

    def blank_row(self) -> dict[str, Any]:
        """A row, for the types of its columns."""
        ...

    def described(self) -> dict[str, Any]:
        """The runs as plain data."""
        ...

    def digest(self) -> str:
        """Fingerprint of the runs."""
        ...


Plan = Sweep | Stored
P = TypeVar("P", bound=Plan)


def parquet_schema(sweep: Plan, number: int) -> Any:
    """The pyarrow Schema of a chunk's file; its metadata identify sweep and chunk.

    Metadata of each field are its unit and description.

    Args:
        sweep: the sweep.
        number: the chunk.
    """
    import pyarrow as pa

    if isinstance(sweep, Sweep):
        empty = result_row(0, list(sweep.vary), np.zeros(len(sweep.vary)), None)
    else:
        empty = sweep.blank_row()
    marks = dict(zip(MARKS, (sweep.digest().encode(), b"%d" % number), strict=True))
    return _told(pa.Table.from_pylist([empty]).schema).with_metadata(marks)


def _told(schema: Any) -> Any:
    """A schema with unit and description of each field."""
    import pyarrow as pa

    told = {
        name: zip(("unit", "description"), column_told(name), strict=True) for name in schema.names
    }
    return pa.schema([f.with_metadata(dict(told[f.name])) for f in schema])


def write_part(rows: list[dict[str, Any]], schema: Any, file: Any) -> None:
    """Writes the rows of a chunk.

    Args:
        rows: the rows.
        schema: schema of the rows.
        file: path of the file.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.Table.from_pylist(rows, schema), file, write_page_checksum=True)


def _read_part(file: Path) -> Any:
    """A part as a pyarrow Table, each page checked by its checksum; None if it is damaged.

    Raises:
        ParameterError: it cannot be read at all.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        source = pa.BufferReader(file.read_bytes())
    except OSError as error:
        raise ParameterError("part", file.name, f"must be readable ({error.strerror})") from None
    with contextlib.suppress(pa.ArrowException, OSError, ValueError):
        # Arrow's threads abort some exits of Python
        return pq.ParquetFile(source, page_checksum_verification=True).read(use_threads=False)
    return None


def sweep_part(out: Path, number: int) -> Path:
    """The file of one chunk.

    Args:
        out: folder of the sweep.
        number: the chunk.
    """
    return out / "data" / f"part-{number:06d}.parquet"


def _part_files(out: Path) -> list[Path]:
    return sorted((out / "data").glob("part-*.parquet"))


def missing_parts(sweep: Plan, out: Path) -> list[int]:
    """Chunks without a file.

    Args:
        sweep: the sweep.
        out: its folder.
    """
    return [n for n in range(sweep.chunks) if not sweep_part(out, n).is_file()]


def stored_digest(out: Path) -> str | None:
    """Digest of the sweep in a folder; None if it holds none.

    Args:
        out: the folder.
    """
    begun = _begun(out)
    return None if begun is None else str(begun.get("digest", "unreadable"))


def begin_sweep(sweep: Plan, out: Path) -> list[int]:
    """Prepares the folder, or checks that it holds this same sweep; returns the chunks to run.

    Parts that are damaged or belong to another sweep or chunk are named and removed, as are
    temporary files of killed writers.

    Args:
        sweep: the sweep.
        out: its folder.

    Raises:
        ParameterError: the folder holds another sweep, or a file that is not part of a sweep.
    """
    _file, digest = out / "sweep.json", stored_digest(out)
    if digest is not None:
        if digest != sweep.digest():
            raise ParameterError(
                "out", str(out), "holds another sweep, or another release's: choose another folder"
            )
    else:
        text = json.dumps({"digest": sweep.digest(), **sweep.described()}, indent=1)
        with atomic(out / "sweep.json") as f:
            f.write(f"{text}\n".encode())
    numbers = {sweep_part(out, n): n for n in range(sweep.chunks)}
    for stray in set(_part_files(out)) - set(numbers):
        raise ParameterError(
            "part", stray.name, f"does not belong to the sweep in {out}: move it away"
        )
    wanted = parquet_schema(sweep, 0)
    bad = {f: fault for f in _part_files(out) if (fault := _fault(sweep, numbers[f], f, wanted))}
    if bad:
        named = [f"{f.name} ({fault})" for f, fault in bad.items()]
        more = len(named) - BAD_PARTS_NAMED
        named = named[:BAD_PARTS_NAMED] + ([f"{more} more"] if more > 0 else [])
        print(f"hapticclay: made again: {', '.join(named)}", file=sys.stderr)
    for left in (*bad, *(out / "data").glob(".part-*")):
        left.unlink(missing_ok=True)
    return missing_parts(sweep, out)


def _begun(out: Path) -> dict[str, Any] | None:
    """Content of a folder's sweep.json, empty if it is damaged; None if there is none."""
    file = out / "sweep.json"
    if not file.is_file():
        return None
    with contextlib.suppress(OSError, ValueError, RecursionError):
        found = json.loads(file.read_text())
        return found if isinstance(found, dict) else {}
    return {}


def _with_chunk(sweep: P, out: Path) -> P:
    """The sweep with its chunk size: as given, as stored in the folder, or from the run time."""
    if not isinstance(sweep, Sweep) or sweep.chunk is not None:
        return sweep
    begun = _begun(out)
    size = begun.get("chunk") if begun is not None else chunk_size(run_time(sweep))
    return dataclasses.replace(sweep, chunk=size)


def chunk_size(seconds: float) -> int:
    """Number of runs that take CHUNK_TIME.

    Args:
        seconds: duration of one run.
    """
    return max(1, min(MOST_IN_CHUNK, int(CHUNK_TIME / max(seconds, 1e-6))))


def _fault(sweep: Plan, number: int, file: Path, wanted: Any) -> str:
    """The fault of a chunk's file, "" for none; wanted: the schema of any chunk."""
    table = _read_part(file)
    if table is None:
        return "damaged"
    digest, of = _marks(table)
    if digest != wanted.metadata[MARKS[0]]:
        return "of another sweep"
    if of != b"%d" % number:
        return f"a copy of part {of.decode(errors='replace')}"
    whole = table.schema.equals(wanted) and table["run"].to_pylist() == list(
        sweep.chunk_runs(number)
    )
    return "" if whole else "incomplete"


def _marks(table: Any) -> tuple[bytes, ...]:
    """Digest and number in a part's metadata; empty if missing."""
    return tuple((table.schema.metadata or {}).get(key, b"") for key in MARKS)


@contextlib.contextmanager
def claimed(sweep: P, out: Path) -> Iterator[tuple[P, list[int]]]:
    """Locks the folder for this process and prepares it.

    Yields the sweep, its chunk chosen if it was None, and the chunks to run.

    Args:
        sweep: the sweep.
        out: its folder.

    Raises:
        ParameterError: the folder holds another sweep, another process uses it, a file cannot be
            written, or a package is missing.
    """
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        raise ParameterError(
            "sweep", "pyarrow", "must be installed: pip install 'hapticclay[sweep]'"
        ) from None
    try:
        out.mkdir(parents=True, exist_ok=True)
        lock = os.open(out / ".lock", os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise ParameterError(
            "out", str(out), f"must be a writable folder ({error.strerror})"
        ) from None
    try:
        _hold(lock, out)
        sweep = _with_chunk(sweep, out)
        yield sweep, begin_sweep(sweep, out)
    finally:
        os.close(lock)


def _hold(lock: int, out: Path) -> None:
    """Locks an open file; the system releases the lock when the process ends, even if killed."""
    try:
        import fcntl

        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        who = os.read(lock, 200).decode(errors="replace")
        raise ParameterError(
            "out", str(out), f"is where another sweep is at work ({who}): let it end first"
        ) from None
    except (ImportError, OSError):
        print(f"hapticclay: no file locks in {out}: start no second sweep there", file=sys.stderr)
    with contextlib.suppress(OSError):  # writing the parts reports a full disk
        os.truncate(lock, 0)
        os.write(lock, f"process {os.getpid()} on {platform.node()}".encode())


def row_size(sweep: Plan, rows: list[dict[str, Any]]) -> float:
    """Disk space [bytes] per run in files of a whole chunk.

    Args:
        sweep: the sweep.
        rows: some of its rows.
    """
    import pyarrow as pa

    sizes = []
    for some in (rows, rows[:1]):
        write_part(some, parquet_schema(sweep, 0), file := pa.BufferOutputStream())
        sizes.append(file.tell())
    each = (sizes[0] - sizes[1]) / max(1, len(rows) - 1)
    return each + (sizes[1] - each) / len(sweep.chunk_runs(0))


@checked
def read_sweep(out: str | os.PathLike[str]):
    """The data set of a sweep, all its chunks, as a pyarrow Table in the order of the runs.

    Metadata of each field are its unit and description; the DataFrame of `to_pandas()` has them by
    column in attrs["units"] and attrs["descriptions"].

    Args:
        out: folder of the sweep.

    Raises:
        ParameterError: there is no sweep, or a part is damaged or belongs to another sweep.
    """
    import pyarrow as pa

    files = _part_files(Path(out))
    if not files:
        raise ParameterError(
            "sweep", str(out), "must be a folder that hapticclay sweep has written"
        )
    tables = []
    for file in files:
        table = _read_part(file)
        digest, of = _marks(table) if table is not None else (b"", b"")
        if table is None:
            fault = "damaged"
        elif tables and (
            digest != _marks(tables[0])[0] or not table.schema.equals(tables[0].schema)
        ):
            fault = "of another sweep"
        elif of and file.name != f"part-{of.decode(errors='replace'):0>6}.parquet":
            fault = "a copy of another part"  # parts of 0.1.0 have no marks
        else:
            tables.append(table)
            continue
        raise ParameterError(
            "part", file.name, f"is {fault}: the command of the sweep in {out} makes it again"
        )
    table = pa.concat_tables(tables)
    told = {name: column_told(name) for name in table.column_names}
    attrs = {
        "units": {name: unit for name, (unit, _) in told.items() if unit},
        "descriptions": {name: text for name, (_, text) in told.items()},
    }
    more = {b"pandas": json.dumps({"attributes": attrs, **NO_INDEX}).encode()}
    return table.cast(_told(table.schema).with_metadata(more))
