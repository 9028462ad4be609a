"""Storage of a sweep: Parquet files with its digest, in a folder locked by one process."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import platform
import re
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from ..arguments import checked
from ..errors import ParameterError, Warning
from ..files import MOST_SETTINGS, Unfit, atomic, parse_json, read_bytes
from .sampling import Sweep
from .sweep_rows import CHUNK_TIME, NO_INDEX, column_told, result_row
from .workers import leave_if_imported

MARKS = (b"hapticclay_sweep", b"hapticclay_part")  # metadata keys: sweep's digest, part's number
MOST_IN_PART = 1_000_000  # runs that a file can hold
MOST_IN_CHUNK = 20_000  # runs in a file, where they are short and no chunk was given
BAD_PARTS_NAMED = 5  # damaged parts named in a message; the others are counted


class Stored(Protocol):
    """Protocol of runs stored like a Sweep: it makes its own rows, chunk by chunk."""

    def __len__(self) -> int: ...

    @property
    def chunk(self) -> int | None:
        """Runs of one file."""
        ...

    @property
    def chunks(self) -> int:
        """Number of files."""
        ...

    def chunk_runs(self, number: int) -> range:
        """The runs of one file."""
        ...

    def chunk_rows(self, number: int) -> list[dict[str, Any]]:
        """Makes the runs of one file."""
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


def part_number(sweep: Plan, runs: range) -> int:
    """Number of the file of some runs: of their chunk, or of the first run without a chunk size."""
    return runs.start // (sweep.chunk or 1)


def parquet_schema(sweep: Plan, number: int) -> Any:
    """The pyarrow Schema of a file; its metadata identify sweep and file.

    Metadata of each field are its unit and description.
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
    """Writes the rows of a file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.Table.from_pylist(rows, schema), file, write_page_checksum=True)


def _read_part(file: Path) -> Any:
    """A part as a pyarrow Table, each page checked by its checksum; None if it is no such file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        source = pa.BufferReader(read_bytes(file))
    except Unfit:
        return None
    except OSError as error:
        raise ParameterError("part", file.name, f"must be readable ({error.strerror})") from None
    with contextlib.suppress(pa.ArrowException, OSError, ValueError):
        part = pq.ParquetFile(source, page_checksum_verification=True)
        if part.metadata.num_rows <= MOST_IN_PART:
            return part.read(use_threads=False)  # Arrow's threads abort some exits of Python
    return None


def sweep_part(out: Path, number: int) -> Path:
    """A file of a sweep."""
    return out / "data" / f"part-{number:06d}.parquet"


def _number_in(file: Path) -> int:
    """Number in the name of a part; -1 for none."""
    found = re.fullmatch(r"part-(\d{6,9})\.parquet", file.name, re.ASCII)
    return int(found[1]) if found else -1


def _part_files(out: Path) -> list[Path]:
    files = (out / "data").glob("part-*.parquet") if os.path.isdir(out / "data") else ()
    return sorted(files, key=lambda file: (_number_in(file), file.name))


def missing_parts(sweep: Plan, out: Path) -> list[range]:
    """Runs without a file, in ranges: each a chunk, or all between two files."""
    if sweep.chunk is not None:
        chunks = ((sweep.chunk_runs(n), sweep_part(out, n)) for n in range(sweep.chunks))
        return [runs for runs, file in chunks if not file.is_file()]
    gaps, at = [], 0
    for file in _part_files(out):
        first, rows = _number_in(file), _count_rows(file)
        if first >= at and rows:
            gaps.append(range(at, first))
            at = first + rows
    return [gap for gap in (*gaps, range(at, len(sweep))) if gap]


def _count_rows(file: Path) -> int:
    """Number of rows of a part, 0 for a damaged one."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with contextlib.suppress(pa.ArrowException, OSError, ValueError):
        if file.is_file():
            return pq.read_metadata(file).num_rows
    return 0


def check_complete(sweep: Plan, out: Path) -> None:
    """Checks, after the last run, that the folder still holds all runs."""
    missing = sum(map(len, missing_parts(sweep, out)))
    if missing:
        raise FileNotFoundError(
            f"{len(sweep) - missing} of {len(sweep)} runs are in {out}: files were removed while "
            "the sweep ran; the same command makes them again"
        )


def check_begun(sweep: Plan, out: Path) -> None:
    """Checks, before a file is written, that the folder is still that of the sweep."""
    if stored_digest(out) != sweep.digest():
        raise FileNotFoundError(
            f"{out} was removed or replaced while the sweep ran: its runs there are lost"
        )


def stored_digest(out: Path) -> str | None:
    """Digest of the sweep in a folder; None if it holds none."""
    begun = _begun(out)
    return None if begun is None else str(begun.get("digest", "unreadable"))


def begin_sweep(sweep: Plan, out: Path) -> list[range]:
    """Prepares the folder, or checks that it holds this same sweep; returns the runs to make.

    They come as from `missing_parts`.

    Parts that are damaged or belong elsewhere are named and removed, as are temporary files of
    killed writers.
    """
    _file, digest = out / "sweep.json", stored_digest(out)
    if digest is not None:
        if digest != sweep.digest():
            raise ParameterError(
                "out", str(out), "holds another sweep, or another release's: choose another folder"
            )
    else:
        head = {"digest": sweep.digest(), "total": len(sweep)}
        text = json.dumps({**head, **sweep.described()}, indent=1)
        with atomic(out / "sweep.json") as f:
            f.write(f"{text}\n".encode())
    files, last = _part_files(out), len(sweep) if sweep.chunk is None else sweep.chunks
    for file in files:
        number = _number_in(file)
        if not 0 <= number < last or file != sweep_part(out, number):
            raise ParameterError(
                "part", file.name, f"does not belong to the sweep in {out}: move it away"
            )
    _remove([*_faulty(sweep, files), *(out / "data").glob(".part-*")])
    return missing_parts(sweep, out)


def _faulty(sweep: Plan, files: list[Path]) -> list[Path]:
    """Parts that must be made again; a line names them."""
    wanted, at, bad = parquet_schema(sweep, 0), 0, {}
    for file in files:
        number = _number_in(file)
        fault, rows = _fault(sweep, number, file, wanted)
        if not fault and sweep.chunk is None and number < at:
            fault = "has runs of another"
        if fault:
            bad[file] = fault
        else:
            at = number + rows
    if bad:
        named = [f"{f.name} ({fault})" for f, fault in bad.items()]
        more = len(named) - BAD_PARTS_NAMED
        named = named[:BAD_PARTS_NAMED] + ([f"{more} more"] if more > 0 else [])
        print(f"hapticclay: made again: {', '.join(named)}", file=sys.stderr)
    return list(bad)


def _remove(files: list[Path]) -> None:
    for file in files:
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            bound = f"is damaged and cannot be removed ({error.strerror}): move it away"
            raise ParameterError("part", file.name, bound) from None


def _begun(out: Path) -> dict[str, Any] | None:
    """Content of a folder's sweep.json, empty if it is damaged; None if there is none."""
    file = out / "sweep.json"
    if not os.path.isfile(file):
        return None
    with contextlib.suppress(OSError, ValueError):
        found = parse_json(read_bytes(file, MOST_SETTINGS))
        return found if isinstance(found, dict) else {}
    return {}


def _with_chunk(sweep: P, out: Path) -> P:
    """The sweep with its chunk size: as given, or as stored in the folder."""
    if not isinstance(sweep, Sweep) or sweep.chunk is not None:
        return sweep
    size = (_begun(out) or {}).get("chunk")
    return dataclasses.replace(sweep, chunk=size if type(size) is int and size > 0 else None)


def chunk_size(seconds: float) -> int:
    """Number of runs that take CHUNK_TIME."""
    return max(1, min(MOST_IN_CHUNK, int(CHUNK_TIME / max(seconds, 1e-6))))


def _fault(sweep: Plan, number: int, file: Path, wanted: Any) -> tuple[str, int]:
    """The fault of a part, "" for none, and its rows; wanted: the schema of any part."""
    table = _read_part(file)
    if table is None:
        return "damaged", 0
    digest, of = _marks(table)
    if digest != wanted.metadata[MARKS[0]]:
        return "of another sweep", 0
    if of != b"%d" % number:
        return f"a copy of part {of.decode(errors='replace')}", 0
    rows = table.num_rows
    runs = range(number, number + rows) if sweep.chunk is None else sweep.chunk_runs(number)
    whole = (
        table.schema.equals(wanted)
        and 0 < rows <= len(sweep) - runs.start
        and table["run"].to_pylist() == list(runs)
    )
    return "" if whole else "incomplete", rows


def _marks(table: Any) -> tuple[bytes, ...]:
    """Digest and number in a part's metadata; empty if missing."""
    return tuple((table.schema.metadata or {}).get(key, b"") for key in MARKS)


@contextlib.contextmanager
def claimed(sweep: P, out: Path) -> Iterator[tuple[P, list[range]]]:
    """Locks the folder for this process and prepares it.

    Yields the sweep, with the chunk of the folder if it was None, and the runs to make.
    """
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        raise ParameterError(
            "sweep", "pyarrow", "must be installed: pip install 'hapticclay[sweep]'"
        ) from None
    try:
        out.mkdir(parents=True, exist_ok=True)
        # not through a link: what it names would be emptied
        lock = os.open(out / ".lock", os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
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
        leave_if_imported()
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
    """Disk space [bytes] per run in files of a whole chunk."""
    import pyarrow as pa

    sizes = []
    for some in (rows, rows[:1]):
        write_part(some, parquet_schema(sweep, 0), file := pa.BufferOutputStream())
        sizes.append(file.tell())
    each = (sizes[0] - sizes[1]) / max(1, len(rows) - 1)
    return each + (sizes[1] - each) / len(sweep.chunk_runs(0))


@checked
def read_sweep(out: str | os.PathLike[str]):
    """The data set of a sweep, all its files, as a pyarrow Table in the order of the runs.

    Warns if runs are missing, as while a sweep is at work and after an interruption.

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
    if np.any(np.diff(table["run"].to_numpy()) <= 0):
        raise ParameterError("sweep", str(out), "must have each run once")
    total = (_begun(Path(out)) or {}).get("total")
    if isinstance(total, int) and table.num_rows < total:
        warnings.warn(f"{table.num_rows} of {total} runs are in {out}", Warning, stacklevel=2)
    told = {name: column_told(name) for name in table.column_names}
    attrs = {
        "units": {name: unit for name, (unit, _) in told.items() if unit},
        "descriptions": {name: text for name, (_, text) in told.items()},
    }
    more = {b"pandas": json.dumps({"attributes": attrs, **NO_INDEX}).encode()}
    return table.cast(_told(table.schema).with_metadata(more))
