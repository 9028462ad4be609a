"""Ctrl-C at a chosen line: what a call does that is interrupted there, and again on its way out.

A trace counts the lines of the package that a call runs, and raises KeyboardInterrupt before one of
them. A second interruption comes at one of the next calls or returns, by a profile.
"""

import contextlib
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


def interrupted(call, k, again=None):
    """Makes a call, ended by Ctrl-C before its k-th line; returns whether it was.

    Args:
        call: without arguments.
        k: number of the line, from 1.
        again: after how many calls and returns a second Ctrl-C comes; None for none.
    """
    left, more = k, again

    def local(frame, event, _):
        nonlocal left
        left -= event == "line"
        if left == 0:
            if again is not None:
                sys.setprofile(profile)
            raise KeyboardInterrupt
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
