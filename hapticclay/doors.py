"""Public names of a package: imported when first used; an unknown one names the nearest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import lazy_loader


def attach(
    package: str, file: str, name: str | None = None, doors: Sequence[str] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """`lazy_loader.attach_stub`, with the nearest name where there is no such name.

    Args:
        package: the package that the stub's relative imports start from.
        file: path of the module; its stub lies beside it.
        name: dotted name of the module; by default that of the package.
        doors: modules of the package whose names are suggested too.

    Returns:
        `__getattr__`, `__dir__` and `__all__` of the module.
    """
    found, listed, names = lazy_loader.attach_stub(package, file)
    module = name or package

    def __getattr__(wanted: str) -> Any:
        if wanted in names or wanted.startswith("__"):
            return found(wanted)
        raise AttributeError(_unknown(module, wanted, names, doors))

    return __getattr__, listed, names


def _unknown(module: str, wanted: str, names: Sequence[str], doors: Sequence[str]) -> str:
    """The message for an unknown name."""
    import difflib
    import importlib

    paths = {
        x: f"{module}.{door}.{x}"
        for door in doors
        for x in importlib.import_module(f"{module}.{door}").__all__
    }
    paths |= {x: f"{module}.{x}" for x in names}
    near = difflib.get_close_matches(wanted, paths, 1)
    return f"no name {wanted!r} in {module}" + (f"; did you mean {paths[near[0]]}?" if near else "")
