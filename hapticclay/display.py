"""Short texts and small HTML tables of objects, for prompts and notebooks."""

from __future__ import annotations

import html
from collections.abc import Iterable

TABLE_STYLE = "border-collapse:collapse;margin:0.3em 0;color:inherit;background:transparent"
CELL_STYLE = (  # this grey is visible on white and on black
    "padding:0.15em 0.8em 0.15em 0;border:0;border-top:1px solid rgba(128,128,128,0.4);"
    "text-align:left;vertical-align:top;color:inherit;background:transparent"
)


def one_line(text: object, most: int = 60) -> str:
    """A text on one line, cut to a number of characters.

    Args:
        text: the text; other objects are converted by str.
        most: characters to keep.
    """
    line = " ".join(printable(text).split())
    return line if len(line) <= most else f"{line[: most - 3]}..."


def printable(text: object) -> str:
    """A text without terminal control characters, except line ends.

    Args:
        text: the text; another object gives its str.
    """
    return "".join(x if x.isprintable() or x == "\n" else " " for x in str(text))


def html_table(title: str, rows: Iterable[tuple[str, str]]) -> str:
    """A table of names and values in HTML, in the colours of the page around it, dark or light.

    Args:
        title: caption, plain text.
        rows: name and value of each row, plain text; line ends are kept.
    """
    lines = [
        f'<tr><th style="{CELL_STYLE};font-weight:600">{html.escape(name)}</th>'
        f'<td style="{CELL_STYLE};white-space:pre-line">{html.escape(value)}</td></tr>'
        for name, value in rows
    ]
    caption = f'<caption style="text-align:left;color:inherit">{html.escape(title)}</caption>'
    return f'<table style="{TABLE_STYLE}">{caption}{"".join(lines)}</table>'
