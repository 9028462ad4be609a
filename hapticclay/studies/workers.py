"""Processes of this machine that make runs of a study."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from concurrent.futures import Future
    from multiprocessing.process import BaseProcess

UNGUARDED = 77  # exit status of a worker that came upon a study while it imported the script
NO_GUARD = (
    'the study must stand below `if __name__ == "__main__":`, since each worker process imports '
    "the script; or use workers=1"
)
NOT_BEGUN = (
    "the worker processes ended while they imported the script that started them (its error "
    "stands above): mend it, or use workers=1"
)
KILLED = "a worker was killed (memory?); the same command resumes the sweep"
DAEMON = "a daemonic process, as of multiprocessing.Pool, can start no workers: use workers=1"
_end: Any = None  # in a worker: the event that tells it to take no further run


@contextlib.contextmanager
def started(crew: int) -> Iterator[Callable[..., Future[Any]]]:
    """Processes that call functions; yields the function that submits a call.

    At the end no further call begins, `ended` is true in those at work, and they are waited for.

    Args:
        crew: number of processes.

    Raises:
        ChildProcessError: processes cannot be started, or one ended before its time.
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool

    leave_if_imported()
    if multiprocessing.current_process().daemon:
        raise ChildProcessError(DAEMON)
    context = multiprocessing.get_context("spawn")  # the engine's threads do not survive a fork
    try:
        end, begun = context.Event(), context.Event()
        pool = ProcessPoolExecutor(
            crew, mp_context=context, initializer=_begin, initargs=(end, begun)
        )
    except (OSError, ImportError) as error:  # semaphores live in shared memory
        raise ChildProcessError(_no_semaphores(error)) from None
    others, workers = set(multiprocessing.active_children()), set()

    def submit(*call: Any) -> Future[Any]:
        try:
            job = pool.submit(*call)
        except BrokenProcessPool:
            raise
        except (OSError, RuntimeError) as error:  # the latter for a thread
            told = getattr(error, "strerror", None) or error
            bound = f"a worker process cannot be started ({told}): use fewer workers, or workers=1"
            raise ChildProcessError(bound) from None
        workers.update(multiprocessing.active_children())
        return job

    try:
        yield submit
    except BrokenProcessPool:
        raise ChildProcessError(_cause(workers - others, begun.is_set())) from None
    finally:
        end.set()
        pool.shutdown(wait=True, cancel_futures=True)


def _no_semaphores(error: Exception) -> str:
    told = getattr(error, "strerror", None) or error
    return (
        f"worker processes need shared memory, on Linux a writable /dev/shm ({told}): mount it, "
        "or use workers=1"
    )


def _cause(workers: set[BaseProcess], begun: bool) -> str:
    """Why workers ended, in words."""
    if any(p.exitcode == UNGUARDED for p in workers):
        return NO_GUARD
    return KILLED if begun else NOT_BEGUN


def leave_if_imported() -> None:
    """Ends a worker that imports a script without main guard and has come to a study in it.

    The process that started it says why. To start processes in turn, Python would raise an error
    of many lines in each worker.
    """
    imported = sys.modules.get("__mp_main__")
    if imported is not None and sys.modules.get("__main__") is not imported:
        raise SystemExit(UNGUARDED)


def ended() -> bool:
    """Whether this worker shall take no further run."""
    return _end is not None and _end.is_set()


def _begin(end: Any, begun: Any) -> None:
    """Ignores signals of the terminal, so a worker finishes; the worker ends with its parent."""
    import signal
    import threading

    global _end
    _end = end
    begun.set()
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    import multiprocessing

    parent = multiprocessing.parent_process()
    assert parent
    parent.join()
    os._exit(1)  # a killed parent receives no report
