"""Base of results of theory and studies: a line, tables, a text, a frame, figures, files."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import json
import math
import os
import pkgutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from .arguments import checked
from .display import fields_of, html_table, one_line, text_table
from .errors import ParameterError, choice, needing
from .fields import function_name
from .files import DAMAGED, atomic, parse_json, read_text, versions

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

RESULT_SCHEMA = "hapticclay-result-1"
ROOMS = (
    "model",
    "scene",
    "kernel",
    "theory",
    "simulation",
    "studies",
    "ports",
)  # packages of classes that a file may name
OWN_MODULES = ("arms.joint_law",)  # and modules of other packages
MOVED = {  # modules of earlier releases, and where their classes are
    "hapticclay.stepping.monitor": "hapticclay.simulation.monitor",
    "hapticclay.stepping.run": "hapticclay.simulation.run",
}
SHOWN_ROWS = 10  # rows of a table shown in a notebook
LONGEST_ITEM = 2**16  # bytes of one item of an array: a text
Tables = Mapping[str, Mapping[str, Sequence[Any]]]


class Result:
    """Base class of results; a subclass is a frozen dataclass.

    Attributes:
        drawn_by: "module:function" of the function that draws the result, imported when a figure is
            requested.
        written_as: name of the files that a command writes, and of their schema; by default that of
            the class in lower case.
        summary_units: units of the numbers in `summary` that are in no table.
        printed: tables that `text` shows, with their columns, () for all; by default the first.
            A column is meant whatever its unit.
        formats: formats of numbers by column, as ".3g", or "+.2f %" for a share; by default four
            significant digits.
    """

    drawn_by: ClassVar[str]
    written_as: ClassVar[str]
    summary_units: ClassVar[Mapping[str, Any]] = {}
    printed: ClassVar[Mapping[str, Sequence[str]]] = {}
    formats: ClassVar[Mapping[str, str]] = {}

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        if not hasattr(cls, "written_as"):
            cls.written_as = cls.__name__.lower()

    def headline(self) -> str:
        """The result in one line."""
        raise NotImplementedError

    def tables(self) -> Tables:
        """The result as tables by name; column headings include units."""
        raise NotImplementedError

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {one_line(self.headline(), 200)}>"

    def _repr_html_(self) -> str:
        name, table = next(iter(self.tables().items()))
        rows = [(one_line(k), _row(v)) for k, v in table.items()]
        return html_table(f"{type(self).__name__}: {self.headline()}; {name}", rows)

    def to_frame(self, table: str = "") -> DataFrame:
        """One table as a pandas DataFrame.

        Args:
            table: name of the table; the first by default.

        Raises:
            ParameterError: there is no such table, or pandas is not installed.
        """
        found = self.tables()
        name = choice("table", table, tuple(found)) if table else next(iter(found))
        with needing("to_frame", "pandas"):
            import pandas as pd
        out = pd.DataFrame({k: list(v) for k, v in found[name].items()})
        out.attrs["title"] = f"{self.headline()}; {name}"
        return out

    def text(self, form: str = "") -> str:
        """The result for a terminal: the tables of `printed`, then `remarks`.

        Args:
            form: form of the tables, one of the package tabulate, such as "pipe" for Markdown.
        """
        tables = self.tables()
        printed = self.printed or {next(iter(tables)): ()}
        shown = {name: columns for name, columns in printed.items() if name in tables}
        parts = []
        for name, columns in shown.items():
            table = tables[name]
            kept = _columns(table, columns) if columns else table
            shape = f"{name}:\n\n{{}}\n" if len(shown) > 1 else "{}"
            parts.append(shape.format(text_table(kept, self.formats, form)))
        return "\n".join([*parts, *self.remarks()])

    def remarks(self) -> Sequence[str]:
        """Lines below the tables of `text`."""
        return [self.headline()]

    def plot(self) -> Figure:
        """Draws the result, as the command does."""
        return pkgutil.resolve_name(self.drawn_by)(self)

    def figures(self) -> dict[str, Any]:
        """The figures of the result by file name, each a `views.figure.Figure`, drawn on demand."""
        return {self.written_as: figure_of(self)}

    def contents(self) -> Mapping[str, Any]:
        """Numbers and texts of the result by name, for `summary`; by default its tables."""
        return {"tables": self.tables()}

    def summary(self) -> dict[str, Any]:
        """The result as a command writes it: numbers with schema, units and versions.

        Null stands for NaN and infinity; `save` keeps exact values.
        """
        units = {"units": self.summary_units} if self.summary_units else {}
        return with_schema(self.written_as, {**self.contents(), **units})

    def write(self, folder: Path, asked: Mapping[str, Any] | None = None) -> None:
        """Writes NAME.json, the summary, as a command does.

        Args:
            folder: where to.
            asked: the question, which the file repeats.
        """
        write_json({**self.summary(), **(asked or {})}, folder / f"{self.written_as}.json")

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the result with exact values, whole or not at all.

        Args:
            path: the file, .json.

        Returns:
            The file.

        Raises:
            ParameterError: the file cannot be written, or the result holds something
                other than data, such as a function.
        """
        file = Path(path)
        if file.suffix.lower() != ".json":
            raise ParameterError("path", str(path), "must be a .json file")
        data = {"schema": RESULT_SCHEMA, "versions": versions(), "result": plain(self)}
        with atomic(file) as f:
            f.write((json.dumps(data, indent=1) + "\n").encode())
        return file

    @classmethod
    @checked
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Reads a file of `save`. No code is run, and only modules of this package are imported.

        Args:
            path: the file.

        Raises:
            ParameterError: the file cannot be read, or holds another result.
        """
        try:
            data = parse_json(read_text(path))
            choice("schema", data["schema"], (RESULT_SCHEMA,))
            found = of_plain(data["result"])
        except DAMAGED as error:
            if isinstance(error, ParameterError):
                raise
            told = getattr(error, "strerror", None) or " ".join(str(error).split())
            what = one_line(told, 200) or type(error).__name__
            raise ParameterError("path", str(path), f"must be a saved result ({what})") from None
        if not isinstance(found, cls):
            bound = f"must hold a {cls.__name__}, has a {type(found).__name__}"
            raise ParameterError("path", str(path), bound)
        return found


def _columns(table: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    """Columns of a table by their heads, or by these without the unit."""
    heads = {head.partition(" [")[0]: head for head in table} | {head: head for head in table}
    found = [heads.get(name) or heads.get(name.partition(" [")[0]) for name in names]
    return {head: table[head] for head in found if head}


def figure_of(found: Any, drawn_by: str = "", tables: Tables | None = None) -> Any:
    """A `views.figure.Figure` of an object, drawn by the function that it names or another one.

    Without other tables, the figure shows those of the object.
    """
    figure = pkgutil.resolve_name("hapticclay.views.figure:Figure")
    by = drawn_by or found.drawn_by
    return figure(lambda: pkgutil.resolve_name(by)(found), tables or found.tables)


def with_schema(name: str, data: Mapping[str, Any]) -> dict[str, Any]:
    """Data as it is written to a file of JSON: after its schema, before the versions."""
    return {"schema": f"hapticclay-{name}-1", **json_ready(data), "versions": versions()}


def write_json(data: Any, file: Path) -> None:
    """Writes data as JSON, whole or not at all; null stands for NaN and infinity."""
    with atomic(file) as f:
        f.write((json.dumps(json_ready(data), indent=2, allow_nan=False) + "\n").encode())


def json_ready(x: Any) -> Any:
    """Numbers, texts, arrays and parts as JSON has them; null stands for NaN and infinity."""
    if hasattr(x, "tolist"):  # an array or a number of NumPy
        x = x.tolist()
    if dataclasses.is_dataclass(x):
        x = fields_of(x)
    if isinstance(x, Mapping):
        return {k: json_ready(v) for k, v in x.items()}
    if isinstance(x, list | tuple):
        return [json_ready(v) for v in x]
    return None if isinstance(x, float) and not math.isfinite(x) else x


def _shown(x: Any) -> str:
    return f"{x:.5g}" if isinstance(x, float) else one_line(x)


def _row(values: Sequence[Any]) -> str:
    more = f", ... ({len(values)})" if len(values) > SHOWN_ROWS else ""
    return ", ".join(map(_shown, values[:SHOWN_ROWS])) + more


# ---- plain data ----------------------------------------------------------------------------------


def plain(value: Any) -> Any:
    """Converts a part or a result to plain data, exact to the last bit."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else {"float": str(float(value))}
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, list):
        return [plain(x) for x in value]
    if isinstance(value, dict):
        return {"pairs": [[plain(k), plain(v)] for k, v in value.items()]}
    if _is_part(type(value)):
        names = getattr(value, "_fields", None) or [f.name for f in dataclasses.fields(value)]
        fields = {name: plain(getattr(value, name)) for name in names}
        return {"part": f"{type(value).__module__}:{type(value).__qualname__}", "fields": fields}
    if isinstance(value, tuple):
        return {"tuple": [plain(x) for x in value]}
    if callable(value) and (name := function_name(value)):
        return name
    raise ParameterError("value", value, "must be data that can be written to a file")


def _array(value: np.ndarray) -> dict[str, Any]:
    if np.iscomplexobj(value):
        return {"real": _array(value.real), "imaginary": _array(value.imag)}
    values = [plain(x) for x in value.ravel().tolist()]
    return {"array": value.dtype.str, "shape": list(value.shape), "values": values}


def of_plain(data: Any) -> Any:
    """Restores the object from plain data of `plain`."""
    if isinstance(data, list):
        return [of_plain(x) for x in data]
    if not isinstance(data, dict):
        return data
    if "part" in data:
        return _made(data["part"], {k: of_plain(v) for k, v in data["fields"].items()})
    if "tuple" in data:
        return tuple(map(of_plain, data["tuple"]))
    if "pairs" in data:
        return {of_plain(k): of_plain(v) for k, v in data["pairs"]}
    if "float" in data:
        return float(data["float"])
    if "real" in data:
        return _complex(of_plain(data["real"]), of_plain(data["imaginary"]))
    values, kind = list(map(of_plain, data["values"])), np.dtype(data["array"])
    if kind.kind not in "biufcU" or kind.itemsize > LONGEST_ITEM:
        raise ValueError(f"arrays of {one_line(kind)} are not read")
    return np.array(values, kind).reshape(data["shape"])


def _complex(real: np.ndarray, imaginary: np.ndarray) -> np.ndarray:
    """Both parts in one array: a sum with 1j makes NaN of infinity and loses signs of zeros."""
    out = np.empty(real.shape, np.result_type(real, np.complex64))
    out.real, out.imag = real, imaginary
    return out


def _made(name: str, fields: Mapping[str, Any]) -> Any:
    """Makes a part of the package from its fields."""
    module, _, kind = name.partition(":")
    module = MOVED.get(module, module)
    found = None
    if _is_own(module):
        with contextlib.suppress(ImportError):
            found = getattr(importlib.import_module(module), kind)
    if found is None or not _is_part(found):
        raise ValueError(f"{one_line(name)} is not a part of this package")
    return found(**fields)


def _is_own(module: str) -> bool:
    package, *rooms = module.split(".")
    own = rooms[:1] != [] and (rooms[0] in ROOMS or ".".join(rooms) in OWN_MODULES)
    return package == __package__ and own


def _is_part(kind: type) -> bool:
    """Whether a class is a dataclass or a named tuple from the packages with data."""
    data = dataclasses.is_dataclass(kind) or hasattr(kind, "_fields")
    return isinstance(kind, type) and _is_own(kind.__module__) and data
