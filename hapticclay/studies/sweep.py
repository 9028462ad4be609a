"""Many runs over a space of parameters, as a data set that survives anything.

A sweep is cut into chunks; each chunk is one Parquet file, written whole or not at all by the
process that ran it. Missing and damaged files are the work left, so that an interrupted sweep, even
a killed one, goes on where it stopped.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import logging
import math
import os
import platform
import re
import sys
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from ..arguments import checked
from ..errors import ParameterError
from ..files import atomic
from ..model.constants import AXES
from ..scene.experiments import parameter_unit
from ..simulation.batch import cores
from ..simulation.record import Record
from ..simulation.simulate import simulate
from ..theory import gain_limits
from .sampling import Sweep

CROSSINGS_KEPT = 3  # crossings that have columns of their own
MARKS = (b"hapticclay_sweep", b"hapticclay_part")  # metadata keys: sweep's digest, chunk's number
PROBES = 20  # runs that an estimate is made from ...
PROBE_TIME = 5.0  # ... or fewer after this time [s]
CHUNK_TIME = 1.5  # of one process, that a chunk should take [s]: an interruption waits for it
MOST_IN_CHUNK = 1024  # runs, where they are short
SCHEDULER_PATIENCE = 4.0  # until a scheduler answers [s]; dask tries for up to twice as long
FINISHING = "hapticclay: finishing the chunks in progress"
BAD_PARTS_NAMED = 5  # bad parts that a message names; it counts the others
NO_INDEX: dict[str, Any] = {"index_columns": [], "column_indexes": [], "columns": []}  # of pandas
RESULT_COLUMNS = {  # unit, what it is; crossing1 and x stand for their likes
    "run": ("", "number of the run"),
    "status": ("", "how it ended; refused if a parameter was out of bounds"),
    "axis": ("", "the unstable axis, empty for none"),
    "cause": ("", "what happened, or why it was refused"),
    "end_time": ("s", "simulated time of the end"),
    "crossing1": ("s", "when the handle crossed a border, of the first three"),
    "b_x": ("N.s/m", "damping of the stiffest clay that the handle met"),
    "fe_over_v_x": ("N.s/m", "force of that clay over the velocity, where the speed is steady"),
    "speed_x": ("m/s", "steady speed in that clay"),
    "gain_margin_x": ("factor on K", "gain limit of the linear loop in that clay, over K"),
    "energy_residual": ("share of the energy put through", "residual of the energy balance"),
    "wall_time": ("s", "run time"),
}


def column_told(name: str) -> tuple[str, str]:
    """Unit and description of a column of the data set, "" where there is none.

    Args:
        name: of the column: a result, or a parameter.
    """
    like = re.sub("_y$", "_x", re.sub(r"^crossing\d$", "crossing1", name))
    return RESULT_COLUMNS.get(like) or (parameter_unit(name), "parameter of the run")


class Stored(Protocol):
    """What is stored as a sweep is, besides a Sweep: it makes its own rows, chunk by chunk."""

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
        """All of it as data."""
        ...

    def digest(self) -> str:
        """Its fingerprint."""
        ...


Plan = Sweep | Stored
P = TypeVar("P", bound=Plan)


def result_row(
    index: int, names: list[str], point: np.ndarray, r: Record | None, refused: str = ""
) -> dict[str, Any]:
    """One row of the data set: parameters, outcome and measurements; NaN for none.

    Args:
        index: number of the run.
        names: names of its parameters.
        point: their values.
        r: its record; None if it was refused.
        refused: why it was refused.
    """
    nan = math.nan
    out: dict[str, Any] = {"run": index, **dict(zip(names, point.tolist(), strict=True))}
    out |= {
        "status": r.outcome.code if r else "refused",
        "axis": r.outcome.axis if r else "",
        "cause": r.outcome.cause if r else refused,
        "end_time": r.outcome.time if r else nan,
    }
    times = [c.time for c in r.crossings] if r else []
    out |= {f"crossing{k + 1}": times[k] if k < len(times) else nan for k in range(CROSSINGS_KEPT)}
    for i, axis in enumerate(AXES):
        deepest = max(r.regions(axis), key=lambda x: x[axis]["b"], default=None) if r else None
        entry = deepest[axis] if deepest else {}
        fe = entry.get("steady_fe_over_v") or {}
        speed = entry.get("steady_speed")
        out |= {
            f"b_{axis}": entry.get("b", nan),
            f"fe_over_v_{axis}": fe.get("mean", nan),
            f"speed_{axis}": nan if speed is None else speed,
        }
        margin = nan
        clay = r and r.scenario.clay
        linear = not clay or clay.viscous
        if r and linear and r.scenario.gain[i] > 0.0:
            limit = gain_limits.continuous_limit(r.scenario, axis, entry.get("b", 0.0))
            margin = limit / r.scenario.gain[i]
        out[f"gain_margin_{axis}"] = margin
    through = r.energy.get("throughput", 0.0) if r else 0.0
    out["energy_residual"] = abs(r.energy["residual"]) / through if r and through else nan
    out["wall_time"] = r.wall_time if r else nan
    return out


def run_point(sweep: Sweep, index: int, point: np.ndarray) -> dict[str, Any]:
    """Makes one run of a sweep and returns its row.

    Args:
        sweep: the sweep.
        index: number of the run.
        point: its parameters.
    """
    names = list(sweep.vary)
    try:
        scenario = sweep.run_scenario(point)
        return result_row(index, names, point, simulate(scenario))
    except ParameterError as error:
        return result_row(index, names, point, None, str(error))


def run_chunk(sweep: Plan, number: int, out: str) -> int:
    """Runs one chunk and writes its file, in any process; returns the number of its runs.

    Args:
        sweep: the sweep.
        number: the chunk.
        out: folder of the sweep.
    """
    runs = sweep.chunk_runs(number)
    if isinstance(sweep, Sweep):
        points = sweep.points(runs.start, runs.stop)
        rows = [run_point(sweep, index, point) for index, point in zip(runs, points, strict=True)]
    else:
        rows = sweep.chunk_rows(number)
    with atomic(sweep_part(Path(out), number)) as f:
        _write_part(rows, parquet_schema(sweep, number), f)
    return len(runs)


def parquet_schema(sweep: Plan, number: int) -> Any:
    """The pyarrow Schema of a chunk's file; its metadata tell the sweep and the chunk.

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


def _write_part(rows: list[dict[str, Any]], schema: Any, file: Any) -> None:
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
    """What tells the sweep of a folder from others; None if it holds none.

    Args:
        out: the folder.
    """
    begun = _begun(out)
    return None if begun is None else str(begun.get("digest", "unreadable"))


def begin_sweep(sweep: Plan, out: Path) -> list[int]:
    """Prepares the folder, or checks that it holds this same sweep; returns the chunks to run.

    Parts that are damaged, or of another sweep or place, are named and removed, as are the remains
    of killed writers.

    Args:
        sweep: the sweep.
        out: its folder.

    Raises:
        ParameterError: the folder holds another sweep, or a file that is no part of any.
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
    """What a folder's sweep.json holds, empty if it is damaged; None where there is none."""
    file = out / "sweep.json"
    if not file.is_file():
        return None
    with contextlib.suppress(OSError, ValueError, RecursionError):
        found = json.loads(file.read_text())
        return found if isinstance(found, dict) else {}
    return {}


def _with_chunk(sweep: P, out: Path) -> P:
    """The sweep with runs in a file: as given, as the folder has it, or by the time they take."""
    if not isinstance(sweep, Sweep) or sweep.chunk is not None:
        return sweep
    begun = _begun(out)
    size = begun.get("chunk") if begun is not None else _chunk_size(run_time(sweep))
    return dataclasses.replace(sweep, chunk=size)


def _chunk_size(seconds: float) -> int:
    """Runs that make up CHUNK_TIME, where one takes these seconds."""
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
        ParameterError: the folder holds another sweep, another process works in it, a file cannot
            be written, or a package is missing.
    """
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        raise ParameterError(
            "sweep", "pyarrow", "is not installed: pip install 'hapticclay[sweep]'"
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
    """Takes the lock, an open file's; the system releases it when the process ends, even killed."""
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


@checked
def run_sweep(
    sweep: Sweep,
    out: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int], None] | None = None,
) -> int:
    """Runs the missing chunks of a sweep; returns the number of runs made.

    Args:
        sweep: the sweep.
        out: folder of sweep.json and data/.
        workers: as in `run_chunks`.
        scheduler: as in `run_chunks`.
        progress: called with the number of runs of each finished chunk.

    Raises:
        ParameterError: as `claimed` and `run_chunks`.
    """
    done, out = 0, Path(out)
    with (
        claimed(sweep, out) as (plan, todo),
        contextlib.closing(run_chunks(plan, out, todo, workers, scheduler)) as results,
    ):
        for n in results:
            done += n
            if progress:
                progress(n)
    return done


def run_chunks(
    sweep: Plan,
    out: Path,
    todo: list[int],
    workers: int | None = None,
    scheduler: str | None = None,
) -> Generator[int, None, None]:
    """Runs chunks of a sweep whose folder is claimed; yields the number of runs of each.

    Args:
        sweep: the sweep.
        out: its folder.
        todo: the chunks.
        workers: processes on this machine; None for one a core.
        scheduler: address of a dask scheduler to use instead.

    Raises:
        ParameterError: a file cannot be written, or a package is missing.
        ChildProcessError: a worker here was killed.
        ConnectionError: the scheduler has gone.
    """
    return (
        _run_on_cluster(sweep, out, todo, scheduler)
        if scheduler
        else _run_here(sweep, out, todo, processes(todo, workers))
    )


def processes(todo: list[int], workers: int | None) -> int:
    """Number of processes that run chunks on this machine.

    Args:
        todo: the chunks.
        workers: the most to use; None for one a core.
    """
    return max(1, min(workers or cores(), len(todo)))


def _run_here(sweep: Plan, out: Path, todo: list[int], workers: int) -> Generator[int, None, None]:
    import multiprocessing
    from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
    from concurrent.futures.process import BrokenProcessPool

    if workers == 1:
        for number in todo:
            with _finishing():
                made = run_chunk(sweep, number, str(out))
            yield made
        return
    context = multiprocessing.get_context("spawn")  # the engine's threads do not survive a fork
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker) as pool:
        try:
            jobs: set[Future[int]] = set()
            left = iter(todo)
            while True:  # one chunk a worker: none waits in the pool, which would finish it too
                jobs |= {
                    pool.submit(run_chunk, sweep, number, str(out))
                    for number in itertools.islice(left, workers - len(jobs))
                }
                if not jobs:
                    return
                done, jobs = wait(jobs, return_when=FIRST_COMPLETED)
                yield from (job.result() for job in done)
        except (KeyboardInterrupt, GeneratorExit):  # struck here, or in who takes the results
            print(FINISHING, file=sys.stderr, flush=True)
            raise
        except BrokenProcessPool:
            raise ChildProcessError(
                "a worker was killed (memory?); the same command resumes the sweep"
            ) from None
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def _finishing() -> Iterator[None]:
    """Lets Ctrl-C wait for the work in hand, and says so; a second one does not wait."""
    import signal
    import threading

    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    caught: list[int] = []

    def note(number: int, frame: Any) -> None:
        caught.append(number)
        signal.signal(signal.SIGINT, before)
        print(FINISHING, file=sys.stderr, flush=True)

    signal.signal(signal.SIGINT, note)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if caught:
        raise KeyboardInterrupt


def _start_worker() -> None:
    """Leaves signals of the terminal to the parent, so that a worker finishes; ends with it."""
    import signal
    import threading

    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    assert parent
    parent.join()
    os._exit(1)  # a killed parent takes no report


def _run_on_cluster(
    sweep: Plan, out: Path, todo: list[int], address: str
) -> Generator[int, None, None]:
    from concurrent.futures import CancelledError

    try:
        from distributed import Client, as_completed
    except ImportError:
        raise ParameterError(
            "scheduler", address, "needs dask: pip install 'hapticclay[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=SCHEDULER_PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise ParameterError(
            "scheduler", address, f"must be the address of a dask scheduler ({error})"
        ) from None
    with _quiet("distributed"), client:
        jobs = client.map(
            lambda n: run_chunk(sweep, n, str(out.resolve())), todo, pure=False, retries=10
        )
        try:
            for job in as_completed(jobs, loop=client.loop):
                yield job.result()
        except CancelledError:
            raise ConnectionError(
                f"the dask scheduler {address} has gone; the same command resumes the sweep"
            ) from None


@contextlib.contextmanager
def _quiet(name: str) -> Iterator[None]:
    """Keeps the log of a package silent: errors that it logs are raised too, and told once."""
    logger = logging.getLogger(name)
    before = logger.level
    logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        logger.setLevel(before)


def estimate_time(sweep: Sweep) -> tuple[float, float]:
    """Time [s] of one process and room on disk [bytes] that a run takes, from a random sample.

    Args:
        sweep: the sweep.
    """
    _probed(sweep, 0.0)  # the first run loads and compiles
    rows, spent = _probed(sweep, PROBE_TIME)
    each = spent / len(rows)
    if sweep.chunk is None:
        sweep = dataclasses.replace(sweep, chunk=_chunk_size(each))
    return each, row_size(sweep, rows)


def run_time(sweep: Sweep) -> float:
    """Time [s] that a run takes, from one random run if it is long, from a few if it is short.

    Args:
        sweep: the sweep.
    """
    (first,), _ = _probed(sweep, 0.0)  # loads and compiles, before its own time begins
    if first["wall_time"] > CHUNK_TIME:
        return first["wall_time"]
    rows, spent = _probed(sweep, CHUNK_TIME / 10)
    return spent / len(rows)


def _probed(sweep: Sweep, patience: float) -> tuple[list[dict[str, Any]], float]:
    """Rows of random runs, PROBES or fewer after this patience [s], and the time they took [s]."""
    rows, spent, begin = [], 0.0, time.perf_counter()
    for i in np.random.default_rng(0).integers(0, len(sweep), PROBES).tolist():
        rows.append(run_point(sweep, i, sweep.points(i, i + 1)[0]))
        spent = time.perf_counter() - begin
        if spent > patience:
            break
    return rows, spent


def row_size(sweep: Plan, rows: list[dict[str, Any]]) -> float:
    """Room on disk [bytes] that a run takes in files of a whole chunk.

    Args:
        sweep: the sweep.
        rows: some of its rows.
    """
    import pyarrow as pa

    sizes = []
    for some in (rows, rows[:1]):
        _write_part(some, parquet_schema(sweep, 0), file := pa.BufferOutputStream())
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
        ParameterError: there is none, or a part is damaged or does not belong to the others.
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
