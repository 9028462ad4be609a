"""What the text of an MJCF file asks for before MuJoCo reads it, which may take all memory."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from ..errors import ParameterError
from . import file_kinds

COPIES, CELLS, PIXELS = 100_000, 10_000_000, 100_000_000
MOST = {  # of an element: attributes whose product counts, the most of them, what they are
    "composite": (("count",), COPIES, "elements"),
    "flexcomp": (("count",), COPIES, "vertices"),
    "hfield": (("nrow", "ncol"), CELLS, "heights"),
    "texture": (("width", "height"), PIXELS, "pixels"),
}


def check(path: Path) -> None:
    """Refuses a file that is nested too deep, attaches itself, or makes more than fits.

    Raises:
        ParameterError: it is or does, or is no XML.
    """
    _check(path, (path.resolve(),), set())


def _check(path: Path, above: tuple[Path, ...], seen: set[Path]) -> None:
    root = file_kinds.tree(path)
    seen.add(above[-1])
    for element in root.iter():
        if element.tag in MOST:
            _check_size(path, element)
        file = element.get("file", "")
        if file and (element.tag, element.get("content_type")) in _PARTS:
            part = (path.parent / file).resolve()
            if part in above:
                bound = f"must not contain itself (<{element.tag} file={file!r}>)"
                raise ParameterError("file", str(path), bound)
            if part.is_file() and part not in seen:
                _check(part, (*above, part), seen)
    _check_copies(path, root)


_PARTS = (("model", None), ("model", "text/xml"), ("include", None))


def _check_size(path: Path, element: Element) -> None:
    names, most, what = MOST[element.tag]
    size = math.prod(_number(x) for name in names for x in element.get(name, "1").split())
    if size > most:
        raise _too_many(path, element, size, most, what)


def _check_copies(path: Path, root: Element) -> None:
    """Refuses copies of elements by the number of all of them."""

    def made(element: Element) -> float:
        inner = 1.0 + sum(map(made, element))
        times = _number(element.get("count", "1")) if element.tag == "replicate" else 1.0
        if times * inner > COPIES and element.tag == "replicate":
            raise _too_many(path, element, times * inner, COPIES, "elements")
        return times * inner

    made(root)


def _number(text: Any) -> float:
    """A count; 1 of what is none, which MuJoCo refuses."""
    try:
        return max(1.0, float(text))
    except ValueError:
        return 1.0


def _too_many(path: Path, element: Element, n: float, most: int, what: str) -> ParameterError:
    name = f" {element.get('name')!r}" if element.get("name") else ""
    bound = f"must have at most {most} {what} in <{element.tag}{name}>, not {n:g}"
    return ParameterError("file", str(path), bound)
