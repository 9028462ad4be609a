"""One thread of BLAS around small matrices.

BLAS splits even a product of small matrices among all cores, whose threads then wait for one
another: up to ten times as long on two cores, and more beside other programs.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from typing import Any

BRINGERS = ("numpy", "scipy.linalg")  # each brings a BLAS of its own


class OneThread(contextlib.ContextDecorator):
    """Limits BLAS to one thread while anything inside runs; the last to leave restores all.

    The number of threads belongs to the process, so threads of Python share the limit. Calls inside
    others cost a comparison; each limits what has been loaded since.
    """

    def __init__(self) -> None:
        self.inside = 0
        self.loaded: tuple[str, ...] = ()  # of BRINGERS, when the libraries were listed
        self.libraries: list[Any] = []
        self.before: dict[str, int] = {}  # threads of each library that is limited, by its path
        self._unlock()
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._unlock)

    def _unlock(self) -> None:
        """A lock for this process: that of a parent may be locked at a fork."""
        self.lock = threading.Lock()

    def __enter__(self) -> OneThread:
        with self.lock:
            loaded = tuple(x for x in BRINGERS if x in sys.modules)
            if loaded != self.loaded:
                self.libraries, self.loaded = _libraries(), loaded
            for library in self.libraries:
                if library.filepath not in self.before:
                    self.before[library.filepath] = library.num_threads
                    _set(library, 1)
            self.inside += 1
        return self

    def __exit__(self, *error: object) -> None:
        with self.lock:
            self.inside -= 1
            if not self.inside:
                for library in self.libraries:
                    _set(library, self.before[library.filepath])
                self.before.clear()


def _libraries() -> list[Any]:
    """All that is loaded of BLAS: a search of milliseconds."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController().select(user_api="blas").lib_controllers


def _set(library: Any, threads: int) -> None:
    """Sets the threads of a library, from any thread of Python.

    From 3.8 on, threadpoolctl lets the first that set them set them again, and no other.
    """
    release = getattr(library, "clear_controlling_thread", lambda force: None)
    release(force=True)
    library.set_num_threads(threads)
    release(force=True)


one_thread = OneThread()
