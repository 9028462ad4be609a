"""Memory that a run may still use."""

from __future__ import annotations

import contextlib
import math
import os
from pathlib import Path

GROUPS = (  # limit and use of a control group (of containers), version 2 and version 1
    ("sys/fs/cgroup/memory.max", "sys/fs/cgroup/memory.current"),
    ("sys/fs/cgroup/memory/memory.limit_in_bytes", "sys/fs/cgroup/memory/memory.usage_in_bytes"),
)


def memory_left(root: Path = Path("/")) -> float:
    """Bytes that this process may still use, by machine, container and ulimit; inf if unknown."""
    return min(
        _machine(root),
        *(_group(root / most, root / taken) for most, taken in GROUPS),
        _process(root),
    )


def _machine(root: Path) -> float:
    with contextlib.suppress(OSError, ValueError, StopIteration):
        lines = (root / "proc/meminfo").read_text().splitlines()
        return 1024.0 * int(next(x for x in lines if x.startswith("MemAvailable:")).split()[1])
    with contextlib.suppress(
        AttributeError, OSError, ValueError
    ):  # not Linux: total memory, if known
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    return math.inf


def _group(most: Path, taken: Path) -> float:
    with contextlib.suppress(OSError, ValueError):  # no such group, or "max"
        cache = 0
        for line in most.with_name("memory.stat").read_text().splitlines():
            name, _, value = line.partition(" ")
            if name in ("inactive_file", "total_inactive_file"):  # reclaimable
                cache = int(value)
        return float(int(most.read_text()) - int(taken.read_text()) + cache)
    return math.inf


def _process(root: Path) -> float:
    with contextlib.suppress(ImportError, OSError, ValueError):
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            pages = int((root / "proc/self/statm").read_text().split()[0])
            return float(limit - pages * resource.getpagesize())
    return math.inf
