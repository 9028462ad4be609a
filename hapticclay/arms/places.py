"""Where the files are that a robot's file names: beside it, or in a folder above."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

HIGHEST = 8  # folders above the file that are searched
SCHEME = re.compile(r"^\w+:/+|^\$\(find ([\w.-]+)\)/*")


def place_of(name: str, file: Path, *folders: Path) -> Path | None:
    """The file that a name in a robot's file means; None if it is not there.

    Args:
        name: as it stands: relative, absolute, package://PACKAGE/..., model://..., file:///....
        file: the robot's file.
        *folders: where it should be, searched first.
    """
    if name.startswith("file://"):
        name = name.removeprefix("file://")
    if os.path.isabs(name):
        return Path(name) if os.path.isfile(name) else None
    plain = name.replace("\\", "/")
    is_package = SCHEME.match(plain) is not None
    parts = [x for x in SCHEME.sub(r"\1/", plain).split("/") if x not in ("", ".")]
    for folder in () if is_package else folders:
        if os.path.isfile(folder / plain):
            return folder / plain
    return next(filter(os.path.isfile, _candidates(parts, Path(os.path.abspath(file)))), None)


def _candidates(parts: list[str], file: Path) -> Iterator[Path]:
    """Places in the folders above a file; a package lies there, or is one of them."""
    parts = [x for x in parts if x != ".."]
    for folder in list(file.parents)[:HIGHEST]:
        yield folder.joinpath(*parts)
        if parts and folder.name == parts[0]:
            yield folder.joinpath(*parts[1:])
    for first in range(1, len(parts) - 1):  # of a package under another name: its own folders
        for folder in list(file.parents)[:HIGHEST]:
            yield folder.joinpath(*parts[first:])
