"""The store of many runs: a folder of Parquet files, each written whole or not at all.

A plan numbers its runs and makes their rows. Its fingerprint stands in sweep.json and in each file,
so that a folder holds the runs of one plan, and missing and damaged files are the work that
remains. One process at a time holds the folder.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import platform
import re
import sys
import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np

from ..arguments import checked
from ..errors import ParameterError, Warning, needing
from ..files import MOST_SETTINGS, Unfit, atomic, parse_json, read_bytes, versions
from .sweep_rows import RESULT_COLUMNS, Notes, column_note
from .workers import leave_if_imported

DIGEST, NUMBER = b"hapticclay_sweep", b"hapticclay_part"  # keys of a file's metadata ...
NOTE = b"unit", b"description"  # ... and of a column's
MOST_IN_PART = 1_000_000  # runs that a file can hold
NO_INDEX: dict[str, Any] = {"index_columns": [], "column_indexes": [], "columns": []}  # of pandas
BAD_PARTS_NAMED = 5  # damaged parts named in a message; the others are counted


class Plan(ABC):
    """Numbered runs, stored in files of `chunk` runs each.

    Without a chunk size a file holds the runs that a process has made in its time. The number of a
    file is that of its chunk, or that of its first run.
    """

    chunk: int | None
    notes: ClassVar[Notes] = RESULT_COLUMNS
    noun: ClassVar[str] = "sweep"
    remedy: ClassVar[str] = "choose another folder"

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def described(self) -> dict[str, Any]:
        """Everything that determines the rows, as plain data."""

    @abstractmethod
    def blank_row(self) -> dict[str, Any]:
        """A row with a value of its type in each column."""

    @abstractmethod
    def rows(self, runs: range, late: Callable[[], bool]) -> list[dict[str, Any]]:
        """Makes the runs of a file; without a chunk size it ends early once late() is true."""

    @property
    def chunks(self) -> int:
        """Number of files; without a chunk size, the largest possible one."""
        return -(-len(self) // (self.chunk or 1))

    def chunk_runs(self, number: int) -> range:
        """The runs of one file.

        Args:
            number: number of the file, from 0.
        """
        size = self.chunk or 1
        return range(number * size, min((number + 1) * size, len(self)))

    def part_number(self, runs: range) -> int:
        """The number of the file of some runs.

        Args:
            runs: the runs.
        """
        return runs.start // (self.chunk or 1)

    def digest(self) -> str:
        """Fingerprint of the plan and of the release that runs it."""
        text = json.dumps({**self.described(), "release": versions()["hapticclay"]}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


P = TypeVar("P", bound=Plan)


# ---- files of runs -------------------------------------------------------------------------------


def part_file(out: Path, number: int) -> Path:
    """A file of runs."""
    return out / "data" / f"part-{number:06d}.parquet"


def _part_files(out: Path) -> list[tuple[int, Path]]:
    """Files of runs in order, with the numbers in their names, -1 for another name."""
    files = (out / "data").glob("part-*.parquet") if os.path.isdir(out / "data") else ()
    names = {file: re.fullmatch(r"part-(\d{6,9})\.parquet", file.name, re.ASCII) for file in files}
    return sorted((int(name[1]) if name else -1, file) for file, name in names.items())


def last_part(out: Path) -> int:
    """Number of the last file; -1 if there is none."""
    return max((number for number, _ in _part_files(out)), default=-1)


def part_schema(plan: Plan, number: int) -> Any:
    """The pyarrow Schema of a file; its metadata identify plan and file.

    Metadata of each field are its unit and description.
    """
    import pyarrow as pa

    marks = {DIGEST: plan.digest().encode(), NUMBER: b"%d" % number}
    kinds = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string()}
    fields = []
    for name, x in plan.blank_row().items():
        field = pa.field(name, kinds.get(type(x)) or pa.array([x]).type)
        fields.append(_with_note(field, column_note(name, plan.notes)))
    return pa.schema(fields, marks)


def _with_note(field: Any, note: tuple[str, str]) -> Any:
    return field.with_metadata(dict(zip(NOTE, note, strict=True)))


def _table(rows: list[dict[str, Any]], schema: Any) -> Any:
    """Rows as a pyarrow Table."""
    import pyarrow as pa

    columns = [_array([row[field.name] for row in rows], field.type) for field in schema]
    return pa.Table.from_arrays(columns, schema=schema)


def _array(values: list[Any], kind: Any) -> Any:
    """Values as a pyarrow Array.

    Those of numbers and words are made of their bytes: `pyarrow.array` imports pandas, which takes
    as long as a thousand runs.
    """
    import pyarrow as pa

    if kind == pa.string():
        texts = [x.encode() for x in values]
        buffers = [np.cumsum([0, *map(len, texts)], dtype=np.int32), b"".join(texts)]
    elif kind == pa.bool_():
        buffers = [np.packbits(np.array(values, bool), bitorder="little")]
    elif kind in (pa.float64(), pa.int64()):
        buffers = [np.array(values, np.float64 if kind == pa.float64() else np.int64)]
    else:
        return pa.array(values, kind)
    return pa.Array.from_buffers(kind, len(values), [None, *map(pa.py_buffer, buffers)])


def write_part(plan: Plan, number: int, rows: list[dict[str, Any]], file: Any) -> None:
    """Writes rows to an open file."""
    import pyarrow.parquet as pq

    table = _table(rows, part_schema(plan, number))
    pq.write_table(table, file, write_page_checksum=True)


def read_part(file: Path) -> Any:
    """A file as a pyarrow Table, each page checked by its checksum; None if it is no such file."""
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


def _count_rows(file: Path) -> int:
    """Number of rows of a file, 0 for a damaged one."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    with contextlib.suppress(pa.ArrowException, OSError, ValueError):
        if file.is_file():
            return pq.read_metadata(file).num_rows
    return 0


def _marks(table: Any) -> tuple[bytes, bytes]:
    """Digest and number in the metadata of a file; empty if missing."""
    marks = table.schema.metadata or {}
    return marks.get(DIGEST, b""), marks.get(NUMBER, b"")


def row_size(plan: Plan, rows: list[dict[str, Any]]) -> float:
    """Disk space [bytes] per run in files of a whole chunk."""
    import pyarrow as pa

    sizes = []
    for some in (rows, rows[:1]):
        write_part(plan, 0, some, file := pa.BufferOutputStream())
        sizes.append(file.tell())
    each = (sizes[0] - sizes[1]) / max(1, len(rows) - 1)
    return each + (sizes[1] - each) / len(plan.chunk_runs(0))


# ---- the folder ----------------------------------------------------------------------------------


def _head(out: Path) -> dict[str, Any] | None:
    """Content of a folder's sweep.json, empty if it is damaged; None if there is none."""
    file = out / "sweep.json"
    if not os.path.isfile(file):
        return None
    with contextlib.suppress(OSError, ValueError):
        found = parse_json(read_bytes(file, MOST_SETTINGS))
        return found if isinstance(found, dict) else {}
    return {}


def stored_digest(out: Path) -> str | None:
    """Digest of the plan in a folder; None if it holds none."""
    head = _head(out)
    return None if head is None else str(head.get("digest", "unreadable"))


def check_begun(plan: Plan, out: Path) -> None:
    """Checks, before a file is written, that the folder is still that of the plan."""
    if stored_digest(out) != plan.digest():
        raise FileNotFoundError(
            f"{out} was removed or replaced while the sweep ran: its runs there are lost"
        )


def save_part(plan: Plan, number: int, rows: list[dict[str, Any]], out: Path) -> None:
    """Writes rows to their file, whole or not at all, unless the folder is no longer the plan's."""
    check_begun(plan, out)
    try:
        with atomic(part_file(out, number)) as f:
            write_part(plan, number, rows, f)
    except ParameterError:
        check_begun(plan, out)  # it may have been removed meanwhile
        raise


def check_complete(plan: Plan, out: Path) -> None:
    """Checks, after the last run, that the folder still holds all runs."""
    missing = sum(map(len, missing_parts(plan, out)))
    if missing:
        raise FileNotFoundError(
            f"{len(plan) - missing} of {len(plan)} runs are in {out}: files were removed while "
            "the sweep ran; the same command makes them again"
        )


def missing_parts(plan: Plan, out: Path) -> list[range]:
    """Runs without a file, in ranges: each a chunk, or all between two files."""
    if plan.chunk is not None:
        there = {number for number, file in _part_files(out) if file.is_file()}
        return [plan.chunk_runs(n) for n in range(plan.chunks) if n not in there]
    gaps, at = [], 0
    for first, file in _part_files(out):
        if first >= at and (rows := _count_rows(file)):
            gaps.append(range(at, first))
            at = first + rows
    return [gap for gap in (*gaps, range(at, len(plan))) if gap]


@contextlib.contextmanager
def claimed(plan: P, out: Path) -> Iterator[tuple[P, list[range]]]:
    """Locks the folder for this process and prepares it.

    Yields the plan, with the chunk size of the folder if it had none, and the runs to make.
    """
    with needing("a sweep", "pyarrow", "sweep"):
        import pyarrow  # noqa: F401
    try:
        out.mkdir(parents=True, exist_ok=True)
        # not through a link: what it names would be emptied
        lock = os.open(out / ".lock", os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
    except OSError as error:
        raise ParameterError(
            "out", str(out), f"must be a writable folder ({error.strerror})"
        ) from None
    try:
        _lock(lock, out, plan.noun)
        size = (_head(out) or {}).get("chunk")
        if plan.chunk is None and type(size) is int and size > 0:
            plan = dataclasses.replace(plan, chunk=size)  # type: ignore[type-var]
        yield plan, begin(plan, out)
    finally:
        os.close(lock)


def _lock(lock: int, out: Path, noun: str) -> None:
    """Locks an open file; the system releases the lock when the process ends, even if killed."""
    try:
        import fcntl

        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        leave_if_imported()
        who = os.read(lock, 200).decode(errors="replace")
        bound = f"is where another {noun} is at work ({who}): let it end first"
        raise ParameterError("out", str(out), bound) from None
    except (ImportError, OSError):
        print(f"hapticclay: no file locks in {out}: start no second {noun} there", file=sys.stderr)
    with contextlib.suppress(OSError):  # writing the parts reports a full disk
        os.truncate(lock, 0)
        os.write(lock, f"process {os.getpid()} on {platform.node()}".encode())


def begin(plan: Plan, out: Path) -> list[range]:
    """Prepares the folder, or checks that it holds this same plan; returns the runs to make.

    Parts that are damaged or belong elsewhere are named and removed, as are temporary files of
    killed writers.
    """
    head = _head(out)
    if head is None:
        content = {"digest": plan.digest(), "total": len(plan), **plan.described()}
        with atomic(out / "sweep.json") as f:
            f.write(f"{json.dumps(content, indent=1)}\n".encode())
    elif head.get("digest") != plan.digest():
        fault = f"holds another {plan.noun}{_difference(plan, head)}: {plan.remedy}"
        raise ParameterError("out", str(out), fault)
    faulty = _faulty_parts(plan, out)
    for file in (*faulty, *(out / "data").glob(".part-*")):
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            bound = f"is damaged and cannot be removed ({error.strerror}): move it away"
            raise ParameterError("part", file.name, bound) from None
    return missing_parts(plan, out)


def _difference(plan: Plan, head: dict[str, Any]) -> str:
    """How the plan in a folder differs from another one."""
    for name, value in json.loads(json.dumps(plan.described())).items():
        if name in head and head[name] != value:
            return f" ({name} = {head[name]!r})"
    return ", or another release's"


def _faulty_parts(plan: Plan, out: Path) -> list[Path]:
    """Files that must be made again; a line names them. Files that do not belong are refused."""
    wanted, end, bad = part_schema(plan, 0), 0, {}
    for number, file in _part_files(out):
        if file != part_file(out, number) or number >= plan.chunks:
            bound = f"does not belong to the {plan.noun} in {out}: move it away"
            raise ParameterError("part", file.name, bound)
        fault, runs = _fault(plan, number, file, wanted)
        if not fault and runs.start < end:
            fault = "has runs of another"
        if fault:
            bad[file] = fault
        else:
            end = runs.stop
    if bad:
        named = [f"{f.name} ({fault})" for f, fault in bad.items()]
        more = len(named) - BAD_PARTS_NAMED
        named = named[:BAD_PARTS_NAMED] + ([f"{more} more"] if more > 0 else [])
        print(f"hapticclay: made again: {', '.join(named)}", file=sys.stderr)
    return list(bad)


def _fault(plan: Plan, number: int, file: Path, wanted: Any) -> tuple[str, range]:
    """The fault of a file, "" for none, and its runs; wanted is the schema of any file."""
    runs, table = plan.chunk_runs(number), read_part(file)
    if table is None:
        return "damaged", runs
    digest, marked = _marks(table)
    if digest != wanted.metadata[DIGEST]:
        return "of another sweep", runs
    if marked != b"%d" % number:
        return f"a copy of part {marked.decode(errors='replace')}", runs
    if plan.chunk is None:
        runs = range(number, number + table.num_rows)
    whole = table.schema.equals(wanted) and table["run"].to_pylist() == list(runs)
    return "" if whole and runs and runs.stop <= len(plan) else "incomplete", runs


# ---- reading -------------------------------------------------------------------------------------


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
    with needing("a sweep", "pyarrow", "sweep"):
        import pyarrow as pa

    files = _part_files(Path(out))
    if not files:
        raise ParameterError(
            "sweep", str(out), "must be a folder that hapticclay sweep has written"
        )
    tables: list[Any] = []
    for _, file in files:
        tables.append(read_part(file))
        if fault := _fault_beside(tables[-1], tables[0], file):
            bound = f"is {fault}: the command of the sweep in {out} makes it again"
            raise ParameterError("part", file.name, bound)
    table = pa.concat_tables(tables)
    numbers = np.concatenate([np.empty(0, int), *map(np.from_dlpack, table["run"].chunks)])
    if np.any(np.diff(numbers) <= 0):
        raise ParameterError("sweep", str(out), "must have each run once")
    total = (_head(Path(out)) or {}).get("total")
    if isinstance(total, int) and table.num_rows < total:
        warnings.warn(f"{table.num_rows} of {total} runs are in {out}", Warning, stacklevel=2)
    notes = {field.name: _note(field) for field in table.schema}
    attrs = {
        "units": {name: unit for name, (unit, _) in notes.items() if unit},
        "descriptions": {name: text for name, (_, text) in notes.items()},
    }
    pandas = {b"pandas": json.dumps({"attributes": attrs, **NO_INDEX}).encode()}
    schema = pa.schema([_with_note(x, notes[x.name]) for x in table.schema], pandas)
    return pa.Table.from_arrays(table.columns, schema=schema)  # a cast imports pyarrow.compute


def _note(field: Any) -> tuple[str, str]:
    """Unit and description of a column; a file of 0.1.0 has none."""
    kept = field.metadata or {}
    if all(key in kept for key in NOTE):
        unit, description = (kept[key].decode() for key in NOTE)
        return unit, description
    return column_note(field.name)


def _fault_beside(table: Any, first: Any, file: Path) -> str:
    """The fault of a file of a folder, beside the first one; "" for none."""
    if table is None:
        return "damaged"
    digest, number = _marks(table)
    if digest != _marks(first)[0] or not table.schema.equals(first.schema):
        return "of another sweep"
    if number and file.name != f"part-{number.decode(errors='replace'):0>6}.parquet":
        return "a copy of another part"  # parts of 0.1.0 have no marks
    return ""
