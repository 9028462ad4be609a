"""The compiled kernel: whether it is there, whole, and built from these sources.

setup.py merges the modules that have a .pxd file, compiles them as the package `hapticclay.native`
and writes `native/built.py`: a checksum of each source and of each compiled module, or why there
are none. Nothing is loaded that was built from other sources or is damaged.
"""

from __future__ import annotations

import functools
import importlib
import os
import zlib
from array import array
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

from . import layout, records

PACKAGE = Path(__file__).parents[1]
ROOMS = ("formulas", "kernel")
IN_C = ("formulas/numbers", "kernel/memory")  # their .pxd files are all that is compiled
DECLARATIONS = ("kernel/layout.py", "kernel/records.py")
MODULES = ("kernel/loop", "kernel/machine")  # all of them merged, and the way in


def compiled() -> list[str]:
    """Names of the modules that are compiled, such as kernel/path."""
    names = []
    for room in ROOMS:
        there = set(os.listdir(PACKAGE / room))
        stems = sorted(x[:-4] for x in there if x.endswith(".pxd"))
        names += [f"{room}/{x}" for x in stems if f"{x}.py" in there]
    return [x for x in names if x not in IN_C]


def sources() -> list[str]:
    """Files that make the compiled kernel what it is, such as kernel/path.py."""
    files = [f"{x}.py" for x in compiled()]
    for room in ROOMS:
        there = sorted(os.listdir(PACKAGE / room))
        files += [f"{room}/{x}" for x in there if x.endswith((".pxd", ".pyx"))]
    return [*files, *DECLARATIONS]


def checksum(file: str | Path) -> int:
    """Checksum of a file, whatever the lines of a source end with."""
    with open(file, "rb") as f:
        text = f.read()
    is_source = str(file).endswith((".py", ".pyx", ".pxd"))
    return zlib.crc32(text.replace(b"\r\n", b"\n") if is_source else text)


@functools.cache
def machine() -> Any:
    """The compiled kernel."""
    try:
        built = importlib.import_module("hapticclay.native.built")
    except ModuleNotFoundError:
        raise ImportError("not built") from None
    if built.LACKED:
        raise ImportError(f"not built: {built.LACKED}")
    check_sources(built.SOURCES)
    check_modules(built.MODULES)
    try:
        made = importlib.import_module("hapticclay.native.kernel.machine")
    except ImportError as error:
        raise ImportError(f"cannot be loaded: {error}") from error
    check_numbers(made)
    return made


def check_sources(known: dict[str, int]) -> None:
    """Checks that the sources are those of the build."""
    there, root = set(sources()), str(PACKAGE)
    for name in sorted(there | set(known)):
        if name not in there or known.get(name) != checksum(f"{root}/{name}"):
            raise ImportError(f"built from other sources: {name} has changed")


def check_modules(known: dict[str, int]) -> None:
    """Checks that the compiled modules are whole, and the ones that Python will find."""
    folder = PACKAGE / "native"
    for name, value in known.items():
        file = folder / name
        stem, _, suffix = file.name.partition(".")
        if f".{suffix}" not in EXTENSION_SUFFIXES:
            raise ImportError(f"built for another Python: native/{name}")
        if not file.is_file():
            raise ImportError(f"incomplete: native/{name} is lacking")
        if checksum(file) != value:
            raise ImportError(f"damaged: native/{name} is not as it was built")
        for other in EXTENSION_SUFFIXES[: EXTENSION_SUFFIXES.index(f".{suffix}")]:
            if (file.parent / (stem + other)).exists():
                raise ImportError(
                    f"mixed: native/{file.parent.name}/{stem + other} is of another build"
                )


def check_numbers(made: Any) -> None:
    """Checks the layout of records and some formulas of compiled code against CPython."""
    from . import probe

    for name, size in made.SIZES.items():
        if size != layout.dtype_of(getattr(records, name)).itemsize:
            raise ImportError(f"miscompiled: the record {name} has another size")
    links = array("d", (0.4, 0.3, 0.05, 0.02, 19.0))
    ours, theirs = (array("d", bytes(8 * probe.SIZE)) for _ in range(2))
    probe.fill(links, ours)
    made.compute_probe(links.buffer_info()[0], theirs.buffer_info()[0])
    if ours.tobytes() != theirs.tobytes():
        raise ImportError("miscompiled: formulas give other numbers than in Python")


@functools.cache
def why_not() -> str:
    """Why there is no compiled kernel; "" where there is one."""
    try:
        machine()
    except (ImportError, OSError, AttributeError) as error:
        return " ".join(str(error).split()) or type(error).__name__
    return ""


def is_there() -> bool:
    """Whether runs can be compiled."""
    return not why_not()
