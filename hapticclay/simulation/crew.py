"""Threads that work side by side, none of which an interruption leaves at work."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any


class Job:
    """A call for a thread, which can be called off as long as it has not begun."""

    def __init__(self, call: Callable[[], Any]):
        self._call, self._turn, self._is_off = call, threading.Lock(), False

    def __call__(self) -> None:
        with self._turn:
            if not self._is_off:
                self._call()

    def end(self) -> None:
        """Calls it off; where it has begun, waits for its end."""
        self._is_off = True
        with self._turn:
            pass


class Crew:
    """Threads that make calls side by side.

    Ctrl-C may end a call of `do` anywhere, several times. Then `is_at_work`, until `end` has waited
    for the threads; nothing they use may be touched before.
    """

    def __init__(self, threads: int):
        self._threads = threads
        self._pool: ThreadPoolExecutor | None = None
        self._process = 0  # to which its threads belong: a fork has none of them
        self._jobs: list[Job] = []

    @property
    def is_at_work(self) -> bool:
        """Whether threads may be at work that an interrupted call has left."""
        return bool(self._jobs)

    def do(self, calls: Sequence[Callable[[], Any]]) -> None:
        """Makes calls, the first one in this thread; raises what a call raises."""
        if len(calls) == 1:
            calls[0]()
            return
        self._jobs = [Job(call) for call in calls[1:]]
        if self._pool is None or self._process != os.getpid():
            self._pool, self._process = ThreadPoolExecutor(self._threads), os.getpid()
        futures = [self._pool.submit(job) for job in self._jobs]
        calls[0]()
        for future in futures:
            future.result()
        self._jobs = []

    def end(self) -> None:
        """Calls off what has not begun, and waits for the rest, whatever interrupts the wait."""
        outlast(self._end)

    def _end(self) -> None:
        is_ours = self._process == os.getpid()
        for job in self._jobs if is_ours else ():
            job.end()
        pool, self._pool = self._pool, None  # it may hold calls that are off
        if pool is not None and is_ours:
            pool.shutdown(wait=False, cancel_futures=True)
        self._jobs = []


def outlast(wait: Callable[[], Any]) -> None:
    """Waits to the end, again after each Ctrl-C; raises the last one then."""
    interruption: BaseException | None = None
    while True:
        try:
            wait()
            break
        except KeyboardInterrupt as error:
            interruption = error
    if interruption is not None:
        raise interruption
