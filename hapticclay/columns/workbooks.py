"""Logs in sheets of Excel."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from ..errors import ParameterError, needing
from .text_tables import TextTable


def excel(field: str, path: Path, table: str = "") -> TextTable:
    """A sheet of an Excel file, by its name, or the one that holds a table."""
    with needing("an Excel log", "openpyxl", "logs"):
        from openpyxl import load_workbook

    with contextlib.closing(load_workbook(path, read_only=True, data_only=True)) as book:
        names = [x.title for x in book.worksheets]
        if table and table not in names:
            raise ParameterError("table", table, f"must be one of {', '.join(names)}")
        sheets = {name: _text(book[name]) for name in ([table] if table else names)}
    filled = {name: text for name, text in sheets.items() if text.strip()}
    if not filled:
        raise ParameterError(field, str(path), "must hold a table; it is empty")
    name = max(filled, key=lambda x: filled[x].count("\n"))
    made = TextTable.of_text(field, path, filled[name], f"Excel, sheet {name}")
    others = [x for x in filled if x != name]
    return made.with_note(f"other sheets: {', '.join(others)}") if others else made


def _text(sheet: Any) -> str:
    """The cells of a sheet, parted by tabs."""
    return "".join(
        "\t".join(_cell(x) for x in row) + "\n" for row in sheet.iter_rows(values_only=True)
    )


def _cell(x: Any) -> str:
    if x is None:
        return ""
    if isinstance(x, float):
        return repr(x)
    if hasattr(x, "isoformat"):
        return x.isoformat().replace("T", " ")
    return str(x).replace("\t", " ").replace("\n", " ").replace('"', "'")
