"""What kind of file a robot's description is, and what to do with one that is not read."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from ..errors import ParameterError
from ..files import MOST_SETTINGS, read_bytes

DEEPEST = 300  # elements in one another
PART = "mujocoinclude"
MOST_TRIED = 200  # files in which a part's name is looked for
ROOTS = {
    PART: "is a part of a model (mujocoinclude): give the file that includes it",
    "sdf": "is SDF: MJCF and URDF are read",
    "world": "is a world: MJCF and URDF are read",
}
ENDINGS = {
    ".mjb": "is a compiled model: give the MJCF or URDF that it was compiled of",
    ".usd": "is USD: MJCF and URDF are read",
    ".usda": "is USD: MJCF and URDF are read",
    ".usdc": "is USD: MJCF and URDF are read",
    ".stl": "is a mesh: give the MJCF or URDF that it belongs to",
    ".obj": "is a mesh: give the MJCF or URDF that it belongs to",
    ".dae": "is a mesh: give the MJCF or URDF that it belongs to",
    ".zip": "is an archive: unpack it, and give the MJCF or URDF in it",
}


class _Read(Exception):
    """The first element was read."""


def is_urdf(path: Path) -> bool:
    """Whether a file is URDF; False for MJCF.

    Raises:
        ParameterError: it is neither; the message says what it is, and what to do.
    """
    name = path.name.lower()
    if name.endswith(".xacro"):
        raise ParameterError("file", str(path), xacro_words(path))
    tag = _first_tag(path)
    if tag not in ("robot", "mujoco"):
        other = f"is XML of another kind (<{tag}>): MJCF (<mujoco>) and URDF (<robot>) are read"
        of = f", such as {whole}" if tag == PART and (whole := _includer(path)) else ""
        raise ParameterError("file", str(path), ROOTS.get(tag, other) + of)
    return tag == "robot"


def _includer(path: Path) -> str:
    """A model beside a part, or a folder above, that includes it; "" if none is found."""
    named = re.compile(
        rb"""<include\s+file\s*=\s*["'](?:[^"']*/)?%s["']""" % re.escape(path.name.encode())
    )
    for folder in (path.parent, path.absolute().parent.parent):
        for other in sorted(folder.glob("*.xml"))[:MOST_TRIED]:
            with contextlib.suppress(ParameterError):  # of a file that cannot be read, or is no XML
                if named.search(content(other)) and _first_tag(other) == "mujoco":
                    return other.name if folder == path.parent else str(other)
    return ""


def xacro_words(path: Path) -> str:
    """What to do with a file of xacro."""
    stem = path.name
    for ending in (".xacro", ".urdf"):
        stem = stem.removesuffix(ending)
    made = f"{stem}.urdf" if f"{stem}.urdf" != path.name else f"{stem}_expanded.urdf"
    return f"is xacro, which makes URDF: run `xacro {path.name} > {made}` and give that"


def content(path: Path) -> bytes:
    """The bytes of a file.

    Raises:
        ParameterError: it cannot be read.
    """
    try:
        return read_bytes(path, MOST_SETTINGS)
    except OSError as error:
        bound = f"must be a file that can be read ({error.strerror})"
        raise ParameterError("file", str(path), bound) from None


def _first_tag(path: Path) -> str:
    found: list[str] = []

    def start(tag: str, _: object) -> None:
        found.append(tag)
        raise _Read

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EntityDeclHandler = _refuse_entities(path)
    try:
        parser.Parse(content(path), True)
    except _Read:
        pass
    except (expat.ExpatError, LookupError) as error:  # of an unknown encoding, too
        other = f"must be MJCF or URDF, which are XML ({error})"
        raise ParameterError("file", str(path), ENDINGS.get(path.suffix.lower(), other)) from None
    return found[0] if found else ""


def _refuse_entities(path: Path):
    def refuse(*_: object) -> None:
        raise ParameterError("file", str(path), "must declare no XML entities (<!ENTITY>)")

    return refuse


def tree(path: Path) -> Element:
    """The elements of a file, with names as they stand in it, prefixes included.

    Raises:
        ParameterError: it is no XML, declares entities, or is nested too deep.
    """
    builder, depth = TreeBuilder(), 0
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            bound = f"must not be nested deeper than {DEEPEST} elements"
            raise ParameterError("file", str(path), bound)
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.EntityDeclHandler = _refuse_entities(path)
    try:
        parser.Parse(content(path), True)
    except (expat.ExpatError, LookupError) as error:
        raise ParameterError("file", str(path), f"must be XML ({error})") from None
    return builder.close()
