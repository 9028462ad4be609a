"""The compiled kernel: whether it is there, and was built from these sources."""

from __future__ import annotations

import functools
import importlib
from typing import Any

from . import layout, records


@functools.cache
def machine() -> Any:
    """The compiled kernel.

    Raises:
        ImportError: it is lacking, or was built from other sources or for another Python.
    """
    made = importlib.import_module("hapticclay.native.kernel.machine")
    for name, size in made.SIZES.items():
        if size != layout.dtype_of(getattr(records, name)).itemsize:
            raise ImportError(f"the compiled kernel has another {name}: it is stale")
    return made


@functools.cache
def why_not() -> str:
    """Why there is no compiled kernel; "" where there is one."""
    try:
        machine()
    except (ImportError, OSError, AttributeError) as error:
        return str(error) or type(error).__name__
    return ""


def is_there() -> bool:
    """Whether runs can be compiled."""
    return not why_not()
