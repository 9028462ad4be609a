"""Machine code as it is known without numba: where it is kept, and of which kinds of scene."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import platform
import re
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

from . import parts as p_

# measured: time to load machine code of a kind where numba is imported; to compile the whole steps
# of the plain cut; what numba needs for its own part before it compiles for the first time in a
# process; to compile a law of the user's own, which is not stored; what a part adds [s]
LOADING, COMPILING, STARTING, LAW = 0.03, 1.3, 1.2, 0.5
COMPILING_PART = {
    p_.Form: 1.2, p_.Special: 0.2, p_.Signal: 1.0, p_.Flow: 1.4, p_.Stiff: 1.2, p_.Sampler: 1.4,
    p_.Converter: 0.3, p_.Delay: 0.9, p_.Passivity: 0.4, p_.Modal: 2.0, p_.Own: LAW,
}  # fmt: skip
# what begins the kind of more than whole steps; times that it takes as long to compile
CARRY, COMPLETE = "many runs made together", "steps that may cross borders"
STEPWISE = "many runs made step by step"
TIMES = {CARRY: 2.7, COMPLETE: 1.6, STEPWISE: 2.5}
LONGEST_CAUSE = 200  # letters of the cause that a line shows
failures: list[str] = []  # why this process cannot compile, once that is known
MARK = ".kind"  # ending of a file that names a kind of scene with stored machine code


@functools.cache
def cache_folder() -> Path:
    """Folder of the machine code, in NUMBA_CACHE_DIR or the user's cache.

    It is named by all that the code depends on: sources, versions, processor.
    """
    packages = [version(x) for x in ("numba", "llvmlite", "mujoco", "numpy")]
    digest = hashlib.sha256(repr((sys.version, packages, _processor())).encode())
    package = Path(__file__).resolve().parents[1]
    for file in sorted((*package.glob("model/*.py"), *package.glob("stepping/*.py"))):
        digest.update(file.read_bytes())
    root = (
        os.environ.get("NUMBA_CACHE_DIR")
        or os.environ.get("XDG_CACHE_HOME")
        or Path.home() / ".cache"
    )
    return Path(root) / "hapticclay" / digest.hexdigest()[:16]


def give_up(error: Exception) -> None:
    """Notes that this process cannot compile, and prints a line the first time.

    Args:
        error: what the compiler raised.
    """
    failures.append(_cause(error))
    if len(failures) == 1:
        print(f"hapticclay: Python runs what native cannot: {failures[0]}", file=sys.stderr)


def _cause(error: Exception) -> str:
    """The cause of an error, whose text may have many lines and colours, in one line."""
    lines = [x.strip() for x in re.sub(r"\x1b\[[0-9;]*m", "", str(error)).splitlines()]
    lines = [x for x in lines if x and not x.startswith("Failed in ")]
    cause = lines[0][:LONGEST_CAUSE] if lines else "no reason"
    return f"{type(error).__name__}: {cause}"


def _processor() -> str:
    """Name and abilities of the processor."""
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text().splitlines()
        return "".join(sorted({x for x in lines if x.startswith(("model name", "flags", "Feat"))}))
    return f"{platform.machine()} {platform.processor()}"


def kind_of(part: Any) -> Any:
    """Key of scenes whose steps share the same machine code.

    Args:
        part: the parts of a scene.
    """
    if isinstance(part, tuple):
        return type(part), *map(kind_of, part)
    return None if part is None else type(part)


def mark(kind: Any) -> Path:
    """File that marks stored machine code of a kind.

    Args:
        kind: from `kind_of`.

    Raises:
        OSError, RuntimeError: there is no home folder, so nothing is stored.
    """
    return cache_folder() / (hashlib.sha256(repr(kind).encode()).hexdigest()[:16] + MARK)


def is_kept(kind: Any) -> bool:
    """Whether machine code of a kind is stored.

    Args:
        kind: from `kind_of`.
    """
    with contextlib.suppress(ImportError, OSError, RuntimeError):
        return mark(kind).exists()
    return False


def loading_time(kind: Any) -> float:
    """Time to load stored machine code of a kind, and to compile its law [s].

    Args:
        kind: as in `compile_time`.
    """
    return LOADING + (LAW if p_.Own in leaves(kind) else 0.0)


def compile_time(kind: Any, started: bool = True) -> float:
    """Time to compile the steps of a kind, measured [s].

    Args:
        kind: from `kind_of`, for whole steps; (CARRY or COMPLETE, kind, ...) for more.
        started: whether this process has compiled or loaded machine code.
    """
    times, whole = (TIMES[kind[0]], kind[1]) if kind[0] in TIMES else (1.0, kind)
    time = COMPILING + sum(COMPILING_PART.get(x, 0.0) for x in leaves(whole))
    return times * time + (0.0 if started else STARTING)


def known_time(kind: Any, started: bool = True) -> float | None:
    """As `compile_time`; None for kinds that take many times as long as the sum of their parts.

    Friction in the joints compiles the laws of physical clay beside each case of stick and slip.

    Args:
        kind: as in `compile_time`.
        started: as there.
    """
    parts = [dict(zip(p_.Sampler._fields, x[1:], strict=True)) for x in samplers(kind)]
    if any(x["friction"] is not None and x["special"] is not None for x in parts):
        return None
    return compile_time(kind, started)


def samplers(kind: Any) -> Iterator[Any]:
    """The kinds of sampled control in a kind.

    Args:
        kind: as in `compile_time`.
    """
    if isinstance(kind, tuple):
        if kind and kind[0] is p_.Sampler:
            yield kind
        for x in kind:
            yield from samplers(x)


def ready_time(kind: Any, started: bool = True) -> float:
    """Time to load machine code of a kind, or to compile it where none is stored [s].

    Args:
        kind: as in `compile_time`.
        started: as there.
    """
    return loading_time(kind) if is_kept(kind) else compile_time(kind, started)


def leaves(kind: Any) -> Iterator[Any]:
    """The types in a kind, one by one.

    Args:
        kind: from `kind_of`.
    """
    if isinstance(kind, tuple):
        for x in kind:
            yield from leaves(x)
    else:
        yield kind
