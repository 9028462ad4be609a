"""Short texts and small HTML tables of objects, for prompts and notebooks."""

from __future__ import annotations

import dataclasses
import html
import math
import numbers
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

TABLE_STYLE = "border-collapse:collapse;margin:0.3em 0;color:inherit;background:transparent"
FEW = 4  # numbers of a tuple that are all shown
MANY_DIGITS = 1e4, 1e7  # sizes of numbers that are shown to the last whole digit
_NUMBER = r"[-+]?\d[\d.]*(e[-+]\d+)?"
NUMERIC = re.compile(rf"(< )?{_NUMBER}( (to|-) {_NUMBER})?( \S+)?|-|any")
WIDEST = 80  # [characters] of a table whose headings stand on one line
CELL_STYLE = (  # this grey is visible on white and on black
    "padding:0.15em 0.8em 0.15em 0;border:0;border-top:1px solid rgba(128,128,128,0.4);"
    "text-align:left;vertical-align:top;color:inherit;background:transparent"
)


def one_line(text: object, most: int = 60) -> str:
    """A text on one line, cut to a number of characters."""
    line = " ".join(printable(text).split())
    return line if len(line) <= most else f"{line[: most - 3]}..."


def names_words(names: Sequence[str], most: int = 200) -> str:
    """Names with commas, whole ones up to a number of characters, and how many more there are."""
    shown, length = 0, 0
    for name in names:
        length += len(name) + 2
        if shown and length > most:
            break
        shown += 1
    more = f" and {len(names) - shown} more" * (shown < len(names))
    return f"{', '.join(names[:shown])}{more}"


def printable(text: object) -> str:
    """A text without terminal control characters, except line ends."""
    return "".join(x if x.isprintable() or x == "\n" else " " for x in str(text))


def time_words(x: float, most: float = math.inf) -> str:
    """A time given in seconds, in words of three digits: ms below a second; "more than most"."""
    if x > most:
        return f"more than {most:g} s"
    return f"{x:.3g} s" if x >= 0.9995 else f"{1e3 * x:.3g} ms"


def html_table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """A table of names and values in HTML, in the colours of the page around it, dark or light."""
    lines = [
        f'<tr><th style="{CELL_STYLE};font-weight:600">{html.escape(name)}</th>'
        f'<td style="{CELL_STYLE};white-space:pre-line">{html.escape(value)}</td></tr>'
        for name, value in rows
    ]
    caption = f'<caption style="text-align:left;color:inherit">{html.escape(title)}</caption>'
    return f'<table style="{TABLE_STYLE}">{caption}{"".join(lines)}</table>'


def fields_of(part: Any, *left_out: str) -> dict[str, Any]:
    """Fields of a dataclass by name, without some."""
    names = [f.name for f in dataclasses.fields(part) if f.name not in left_out]
    return {name: getattr(part, name) for name in names}


def table_of(head: Sequence[str], rows: Iterable[Any]) -> dict[str, list[Any]]:
    """Columns by heading of rows: each is a sequence, or a dataclass whose fields are the cells."""
    cells = [[*fields_of(x).values()] if dataclasses.is_dataclass(x) else x for x in rows]
    return {name: [row[i] for row in cells] for i, name in enumerate(head)}


def text_table(
    columns: Mapping[str, Iterable[Any]], formats: Mapping[str, str] | None = None, form: str = ""
) -> str:
    """A table of columns by heading for a terminal: numbers to the right, all else to the left.

    A format is that of a number, as ".3g", or of a share in percent, as "+.2f %"; without one, a
    number has four significant digits. A form is one of tabulate, "pipe" for Markdown.
    """
    from tabulate import tabulate

    formats = formats or {}
    cells = {
        name: [cell_text(x, formats.get(name, "")) for x in column]
        for name, column in columns.items()
    }
    width = sum(2 + max(map(len, [name, *column])) for name, column in cells.items())
    if width > WIDEST and not form:  # the unit stands below the name
        cells = {name.replace(" [", "\n["): column for name, column in cells.items()}
    sides = ["right" if _are_numbers(column) else "left" for column in cells.values()]
    empty = not any(cells.values())
    return tabulate(
        cells, "keys", form or "simple", colalign=None if empty else sides, disable_numparse=True
    )


def _are_numbers(cells: Iterable[str]) -> bool:
    """Whether most texts are numbers or ranges, with or without a unit."""
    matches = [NUMERIC.fullmatch(x) is not None for x in cells if x]
    return 2 * sum(matches) > len(matches)


def cell_text(x: Any, form: str = "") -> str:
    """A value of a table as text: nothing for None, "-" for NaN, "any" for infinity."""
    if x is None or isinstance(x, str):
        return x or ""
    if isinstance(x, bool):
        return "yes" if x else "no"
    if math.isnan(x) or x == math.inf:
        return "any" if x > 0.0 else "-"
    if form.endswith(" %"):
        return f"{100.0 * x:{form[:-2]}} %"
    if form:
        return f"{x:{form}}"
    if isinstance(x, numbers.Integral):
        return str(x)
    if MANY_DIGITS[0] <= abs(x) < MANY_DIGITS[1]:
        return f"{x:.0f}"
    return f"{x:.4g}"


def brief(value: Any, /) -> str:
    """A dataclass or named tuple on one line: numbers, and of arrays their shape and range."""
    names = getattr(value, "_fields", None) or [f.name for f in dataclasses.fields(value)]
    parts = (f"{name} {_brief_value(getattr(value, name))}" for name in names)
    return f"<{type(value).__name__}: {', '.join(parts)}>"


def _brief_value(x: Any) -> str:
    if isinstance(x, bool | str) or x is None:
        return one_line(repr(x))
    if isinstance(x, numbers.Complex):  # those of NumPy are, too
        return f"{x:.5g}"
    if hasattr(x, "__array__"):
        return _brief_array(x)
    if isinstance(x, tuple | list | dict):
        if isinstance(x, tuple) and len(x) <= FEW and all(isinstance(y, int | float) for y in x):
            return f"({', '.join(map(_brief_value, x))})"
        return f"({len(x)})"
    return type(x).__name__


def _brief_array(x: Any) -> str:
    """Shape of an array, and the range of its finite numbers."""
    import numpy as np

    shape = " x ".join(map(str, np.shape(x)))
    values = np.asarray(x)
    finite = values[np.isfinite(values)] if values.dtype.kind in "fiu" else values[:0]
    return f"({shape}) {finite.min():.5g} to {finite.max():.5g}" if finite.size else f"({shape})"
