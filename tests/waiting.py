"""Waiting for what a thread, a process or a browser does: for the thing, never for a time.

A busy machine may take minutes for what takes milliseconds; a test that hangs is to end all the
same.
"""

import contextlib
import signal
import time

PATIENCE = 300.0  # [s] after which nothing comes any more


def until(condition, pause=0.01, alive=lambda: True):
    """Wait until a condition holds; fail if it never does, or its process ends before.

    Args:
        condition: a function without arguments; what it returns, once true, is returned.
        pause: between two looks [s].
        alive: whether it can still come true.
    """
    end = time.monotonic() + PATIENCE
    while not (value := condition()):
        assert alive(), "it ended before"
        assert time.monotonic() < end, f"not within {PATIENCE:g} s"
        time.sleep(pause)
    return value


@contextlib.contextmanager
def alarm():
    """Raises TimeoutError in a block that never ends."""

    def late(number, frame):
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, PATIENCE)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
