"""Public names of a package: imported when first used; an unknown one names the nearest."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

import lazy_loader


def attach(
    package: str, file: str, name: str | None = None, doors: Sequence[str] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`lazy_loader.attach_stub`, with the nearest name where there is no such name."""
    found, listed, names = lazy_loader.attach_stub(package, file)
    module = name or package

    def __getattr__(wanted: str) -> Any:
        if wanted not in names:
            near = "" if wanted.startswith("_") else _nearest(module, wanted, names, doors)
            raise AttributeError(f"no name {wanted[:100]!r} in {module}{near}")
        own, start = vars(sys.modules[module]), vars(sys.modules[package])
        before = start.get(wanted, start)
        value = own[wanted] = found(wanted)
        if own is not start:  # the loader keeps what it found in the package, too
            _restore(start, wanted, before)
        return value

    return __getattr__, listed, names


def _restore(names: dict[str, Any], name: str, before: Any) -> None:
    """Puts back what a name stood for, or takes it away where it stood for nothing."""
    if before is names:
        names.pop(name, None)
    else:
        names[name] = before


def _nearest(module: str, wanted: str, names: Sequence[str], doors: Sequence[str]) -> str:
    """The end of the message for an unknown name: the nearest that there is, if any."""
    import difflib
    import importlib

    paths = {
        x: f"{module}.{door}.{x}"
        for door in doors
        for x in importlib.import_module(f"{module}.{door}").__all__
    }
    paths |= {x: f"{module}.{x}" for x in names}
    near = difflib.get_close_matches(wanted[:100], paths, 1)
    return f"; did you mean {paths[near[0]]}?" if near else ""
