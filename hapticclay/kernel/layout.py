"""Records: each is declared once, and becomes a class with slots, a dtype and a C struct.

A declaration is a class with annotations. The class that `record` makes of it is what CPython runs
on. `dtype_of` gives the layout of rows in NumPy arrays; `header` and `declarations` write the same
layout for C and for Cython. A field that names other memory is an address in a row and the object
itself in CPython.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from typing import Any

CODES = {"double": "f8", "long long": "i8"}


class Kind:
    """Type of a field; `real[3]` is an array of three."""

    def __init__(self, c: str, shape: int = 0):
        self.c, self.shape = c, shape

    def __getitem__(self, n: int) -> Kind:
        return Kind(self.c, n)

    @property
    def is_place(self) -> bool:
        """Whether a row holds an address of other memory."""
        return self.c not in CODES

    @property
    def start(self) -> Any:
        """Value of a new record in CPython."""
        one: Any = None if self.is_place else 0.0 if self.c == "double" else 0
        return [one] * self.shape if self.shape else one


class Many:
    """An array of records."""

    def __init__(self, record: Any, n: int):
        self.record, self.n = record, n


real, whole = Kind("double"), Kind("long long")
floats, wholes, thing = Kind("double *"), Kind("long long *"), Kind("void *")


def many(record: Any, n: int) -> Many:
    """An array of n records."""
    return Many(record, n)


def record(declaration: type) -> Any:
    """The class with slots of a declaration; `x` and `y` name the records of a field `axis`."""
    fields = dict(declaration.__annotations__)
    makers = [(name, maker_of(kind)) for name, kind in fields.items()]
    has_axes = isinstance(fields.get("axis"), Many)

    def __init__(self):
        for name, make in makers:
            setattr(self, name, make())
        if has_axes:
            self.x, self.y = self.axis

    slots = [*fields, "x", "y"] if has_axes else list(fields)
    body = {"__slots__": slots, "__init__": __init__, "__doc__": declaration.__doc__}
    made: Any = type(declaration.__name__, (), body)
    made.__module__ = declaration.__module__
    made.kinds, made.copy = fields, staticmethod(copier_of(fields))
    return made


def maker_of(kind: Any) -> Any:
    """Makes the first value of a field."""
    if isinstance(kind, Many):
        return lambda: [kind.record() for _ in range(kind.n)]
    if isinstance(kind, Kind):
        return lambda: kind.start
    return kind


# ---- rows of NumPy arrays ------------------------------------------------------------------------


def dtype_of(made: Any) -> Any:
    """The dtype of rows of a record."""
    import numpy as np

    if "dtype" not in vars(made):
        parts: list[Any] = []
        for name, kind in made.kinds.items():
            if isinstance(kind, Many):
                parts.append((name, dtype_of(kind.record), (kind.n,)))
            elif isinstance(kind, Kind):
                code = CODES.get(kind.c, "i8")
                parts.append((name, code, (kind.shape,)) if kind.shape else (name, code))
            else:
                parts.append((name, dtype_of(kind)))
        made.dtype = np.dtype(parts, align=True)
    return made.dtype


C_TYPES = {"double": ctypes.c_double}  # all else is as wide as a long long


def struct_of(made: Any) -> Any:
    """A class of views of rows of a record in memory, with the attributes of the record."""
    if "struct" not in vars(made):
        fields: list[tuple[str, Any]] = []
        for name, kind in made.kinds.items():
            if isinstance(kind, Many):
                fields.append((name, struct_of(kind.record) * kind.n))
            elif isinstance(kind, Kind):
                c = C_TYPES.get(kind.c, ctypes.c_longlong)
                fields.append((name, c * kind.shape if kind.shape else c))
            else:
                fields.append((name, struct_of(kind)))
        body: dict[str, Any] = {"_fields_": fields}
        if "axis" in made.kinds:
            body |= {c: property(lambda view, i=i: view.axis[i]) for i, c in enumerate("xy")}
        made.struct = type(made.__name__, (ctypes.Structure,), body)
    return made.struct


def view_of(made: Any, row: Any) -> Any:
    """A view of a row of an array."""
    return struct_of(made).from_address(row.ctypes.data)


def load(view: Any, row: Any) -> None:
    """Fills a record from a row, except for what lies elsewhere."""
    for name, kind in type(view).kinds.items():
        x = row[name]
        if isinstance(kind, Many):
            for a, b in zip(getattr(view, name), x, strict=True):
                load(a, b)
        elif not isinstance(kind, Kind):
            load(getattr(view, name), x)
        elif not kind.is_place:
            setattr(view, name, x.tolist())


def save(view: Any, row: Any) -> None:
    """Writes a record into a row, except for what lies elsewhere."""
    for name, kind in type(view).kinds.items():
        x = getattr(view, name)
        if isinstance(kind, Many):
            for a, b in zip(x, row[name], strict=True):
                save(a, b)
        elif not isinstance(kind, Kind):
            save(x, row[name])
        elif not kind.is_place:
            row[name] = x


def copier_of(fields: dict[str, Any]) -> Any:
    """A function that copies a record into another of its kind, field by field, without a loop."""
    lines, names = ["def copy(to, of):", "    pass"], {}
    for name, kind in fields.items():
        if isinstance(kind, Many):
            names[f"_{name}"] = kind.record.copy
            lines += [f"    _{name}(to.{name}[{i}], of.{name}[{i}])" for i in range(kind.n)]
        elif not isinstance(kind, Kind):
            names[f"_{name}"] = kind.copy
            lines.append(f"    _{name}(to.{name}, of.{name})")
        elif kind.shape:
            lines.append(f"    to.{name}[:] = of.{name}")
        else:
            lines.append(f"    to.{name} = of.{name}")
    exec("\n".join(lines), names)
    return names["copy"]


# ---- C and Cython --------------------------------------------------------------------------------

HEAD = """\
/* Written from kernel/records.py. A record in a record is an array of one, which C takes for its
   address: so names refer to records, as in Python. x and y name the two axes. */
#include <string.h>
#define copied(to, of) memcpy(to, of, sizeof *(of))
"""


def declared(made: Any) -> Iterator[tuple[str, str, int, bool]]:
    """C type, name and length of the fields of a record, and whether they are records."""
    for name, kind in made.kinds.items():
        if isinstance(kind, Many):
            yield kind.record.__name__, name, kind.n, True
        elif isinstance(kind, Kind):
            yield kind.c, name, kind.shape, False
        else:
            yield kind.__name__, name, 0, True


def header(records: Any, functions: str) -> str:
    """The C header of records, in an order in which each is known when it is used."""
    names = "".join(f"typedef struct {x.__name__}_s {x.__name__}_s;\n" for x in records)
    text = HEAD + names + functions
    for made in records:
        text += f"struct {made.__name__}_s {{\n"
        for c, name, n, is_record in declared(made):
            c = f"{c}_s" if is_record else c
            size = (f"[{n}]" if n else "") + ("[1]" if is_record else "")
            if name == "axis":
                text += f"    union {{ {c} axis{size}; struct {{ {c} x[1], y[1]; }}; }};\n"
            else:
                text += f"    {c} {name}{size};\n"
        text += f"}};\ntypedef struct {made.__name__}_s *{made.__name__};\n"
    return text


def declarations(records: Any, functions: str) -> str:
    """The same for Cython, as the text of a .pxd file."""
    text = "# Written from kernel/records.py.\n"
    text += 'cdef extern from "records.h" nogil:\n    void copied(...)\n'
    for made in records:
        text += f"    ctypedef struct {made.__name__}_s\n"
        text += f"    ctypedef {made.__name__}_s *{made.__name__}\n"
    text += functions
    for made in records:
        text += f"    ctypedef struct {made.__name__}_s:\n"
        for c, name, n, _ in declared(made):
            size = f"[{n}]" if n else ""
            text += f"        {c} {name}{size}\n"
            if name == "axis":
                text += f"        {c} x, y\n"
    return text
