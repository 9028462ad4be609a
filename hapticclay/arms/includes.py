"""MJCF from a file whose parts may lie in other folders."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from ..display import one_line
from ..errors import ParameterError
from . import file_kinds
from .places import place_of

MOST_PARTS = 200
LACKS = re.compile(r"(?:Error opening file|Could not open file) '([^']+)'")


def spec_of(path: Path) -> tuple[Any, tuple[str, ...]]:
    """The spec of an MJCF file, and notes on parts from other folders.

    Raises:
        ParameterError: a part is not there.
        ValueError: MuJoCo cannot parse it.
    """
    from ..physics import mujoco

    parts: dict[str, bytes] = {}
    notes: list[str] = []
    while True:
        try:
            if path.suffix == ".xml" and not parts:
                return mujoco.MjSpec.from_file(str(path)), ()
            return _from_text(path, parts), tuple(notes)
        except ValueError as error:
            if isinstance(error, ParameterError):
                raise
            lacks = LACKS.search(str(error))
            if lacks is None or len(parts) >= MOST_PARTS:
                raise
            name, place = _part(path, lacks[1], parts)
            parts[name] = file_kinds.content(place)
            if place.resolve() != (path.parent / name).resolve():
                notes.append(f"{name} of the file was found at {place}")


def _from_text(path: Path, parts: dict[str, bytes]) -> Any:
    """The spec of a file's text; parts by the names that it has for them."""
    from ..physics import mujoco

    text = file_kinds.content(path).decode("utf-8-sig", errors="replace")
    spec = mujoco.MjSpec.from_string(text, include=parts)
    spec.modelfiledir = str(path.parent)
    return spec


def _part(path: Path, name: str, parts: dict[str, bytes]) -> tuple[str, Path]:
    """A part's name, relative to the file, and its place."""
    folder = str(path.parent)
    name = name.removeprefix(folder).lstrip("/") if name.startswith(f"{folder}/") else name
    place = None if name in parts else place_of(name, path, path.parent)
    if place is None:
        bound = f"includes {one_line(name, 200)}, which is not there, nor in a folder above"
        raise ParameterError("file", str(path), bound)
    return name, place
