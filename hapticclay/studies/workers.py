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

UNGUARDED = 77  # exit status of a worker whose import of the script reached a study
ALONE = "use workers=1 (--workers 1)"
NO_GUARD = (
    'the study must stand below `if __name__ == "__main__":`, since each worker process imports '
    f"the script; or {ALONE}"
)
NO_FILE = (
    "worker processes import the script that starts them, and this one comes from no file: save "
    f"it, or {ALONE}"
)
NOT_BEGUN = (
    "the worker processes ended while they imported the script that started them (its error "
    f"stands above): mend it, or {ALONE}"
)
KILLED = "a worker was killed (memory?); the same command resumes the sweep"
DAEMON = f"a daemonic process, as of multiprocessing.Pool, can start no workers: {ALONE}"
_end: Any = None  # in a worker: the event that stops it after the present run


@contextlib.contextmanager
def started(crew: int) -> Iterator[Callable[..., Future[Any]]]:
    """Processes that call functions; yields the function that submits a call.

    At the end no further call begins, `ended` is true in those at work, and they are waited for.
    """
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool

    leave_if_imported()
    if multiprocessing.current_process().daemon:
        raise ChildProcessError(DAEMON)
    if _has_lost_script():
        raise ChildProcessError(NO_FILE)
    # the engine's threads do not survive a fork
    context = _Tracked(multiprocessing.get_context("spawn"))
    try:
        end, begun = context.Event(), context.Event()
        pool = ProcessPoolExecutor(
            crew,
            mp_context=context,  # type: ignore[arg-type]
            initializer=_begin,
            initargs=(end, begun),
        )
    except (OSError, ImportError) as error:  # semaphores live in shared memory
        raise ChildProcessError(_no_semaphores(error)) from None

    def submit(*call: Any) -> Future[Any]:
        try:
            return pool.submit(*call)
        except BrokenProcessPool:
            raise
        except (OSError, RuntimeError) as error:  # the latter for a thread
            reason = getattr(error, "strerror", None) or error
            fault = f"a worker process cannot be started ({reason}): use fewer, or {ALONE}"
            raise ChildProcessError(fault) from None

    try:
        yield submit
    except BrokenProcessPool:
        pool.shutdown(wait=True, cancel_futures=True)  # how each has ended is known only then
        raise ChildProcessError(_cause(context.made, begun.is_set())) from None
    finally:
        end.set()
        pool.shutdown(wait=True, cancel_futures=True)


class _Tracked:
    """A context of multiprocessing that keeps the processes it makes: a pool hides its own."""

    def __init__(self, context: Any):
        self.context, self.made = context, []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.context, name)

    def Process(self, *args: Any, **given: Any) -> Any:
        """A process, as made by the context."""
        self.made.append(self.context.Process(*args, **given))
        return self.made[-1]


def _no_semaphores(error: Exception) -> str:
    reason = getattr(error, "strerror", None) or error
    return (
        f"worker processes cannot be started ({reason}): they need shared memory, on Linux a "
        f"writable /dev/shm; mount it, or {ALONE}"
    )


def _has_lost_script() -> bool:
    """Whether workers could not import the script, as one from standard input."""
    main = sys.modules.get("__main__")
    file = getattr(main, "__file__", None)
    return getattr(main, "__spec__", None) is None and bool(file) and not os.path.exists(file)


def _cause(workers: list[BaseProcess], begun: bool) -> str:
    """Why workers ended, in words."""
    if any(p.exitcode == UNGUARDED for p in workers):
        return NO_GUARD
    return KILLED if begun else NOT_BEGUN


def leave_if_imported() -> None:
    """Ends a worker whose import of a script without main guard has reached a study.

    Left alone, Python would raise an error of many lines in each worker; instead the process that
    started them gives the reason. IPython's %run replaces `__main__` too, in the first process,
    where `__mp_main__` is the `__main__` of before.
    """
    imported = sys.modules.get("__mp_main__")
    if getattr(imported, "__name__", "") != "__mp_main__":
        return
    if sys.modules.get("__main__") is not imported:
        raise SystemExit(UNGUARDED)


def batch_threads() -> int | None:
    """Threads of a batch in this process: one in a worker, beside others; None for all cores."""
    import multiprocessing

    return None if multiprocessing.parent_process() is None else 1


def ended() -> bool:
    """Whether this worker should make no further run."""
    return _end is not None and _end.is_set()


def _begin(end: Any, begun: Any) -> None:
    """Prepares a worker: it ignores signals of the terminal, and ends with its parent."""
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
