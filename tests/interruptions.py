"""Ctrl-C at a chosen line: what a call does that is interrupted there, and again on its way out.

A trace counts the lines of the package that a call runs, and raises KeyboardInterrupt before one of
them. A second interruption comes at one of the next calls or returns, by a profile.
"""

import contextlib
import signal
import sys
from pathlib import Path

import hapticclay

PACKAGE = str(Path(hapticclay.__file__).parent)


def is_ours(frame):
    return frame.f_code.co_filename.startswith(PACKAGE)


def lines_of(call):
    """Number of lines of the package that a call runs."""
    count = 0

    def local(frame, event, _):
        nonlocal count
        count += event == "line"
        return local

    before = sys.gettrace()
    sys.settrace(lambda frame, *_: local if is_ours(frame) else None)
    try:
        call()
    finally:
        sys.settrace(before)
    return count


def interrupted(call, k, again=None, by_signal=False):
    """Makes a call, ended by Ctrl-C before its k-th line; returns whether it was.

    Args:
        call: without arguments.
        k: number of the line, from 1.
        again: after how many calls and returns a second Ctrl-C comes; None for none.
        by_signal: whether the signal comes there, which handlers may put off, or its exception.
    """
    left, more = k, again

    def local(frame, event, _):
        nonlocal left
        left -= event == "line"
        if left == 0 and event == "line":
            if again is not None:
                sys.setprofile(profile)
            if not by_signal:
                raise KeyboardInterrupt
            signal.raise_signal(signal.SIGINT)
        return local

    def profile(frame, event, _):
        nonlocal more
        if not is_ours(frame):
            return
        more -= 1
        if more == 0:
            raise KeyboardInterrupt

    before = sys.gettrace()
    sys.settrace(lambda frame, *_: local if is_ours(frame) else None)
    try:
        with contextlib.suppress(KeyboardInterrupt):
            call()
            return False
        return True
    finally:
        sys.setprofile(None)
        sys.settrace(before)


@contextlib.contextmanager
def signals_within(file):
    """Lets Ctrl-C raise KeyboardInterrupt within the functions of a file of the package alone."""

    def raise_within(number, frame):
        while frame is not None and not frame.f_code.co_filename.endswith(file):
            frame = frame.f_back
        if frame is not None:
            raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, raise_within)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
