"""Records: each is declared once, and becomes a class with slots, a dtype and a C struct.

A declaration is a class with annotations. The class that `record` makes of it is what CPython runs
on. `struct_of` and `dtype_of` give the layout of rows in memory; `header` and `declarations` write
the same layout for C and for Cython. A field that names other memory is an address in a row and the
object itself in CPython.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any

# C types of numbers: their value in a new record, and how ctypes names them
NUMBERS = {"double": (0.0, ctypes.c_double), "long long": (0, ctypes.c_longlong)}


class Kind:
    """Type of a field: a C type or a record, and how many of them; 0 for one that is no array."""

    def __init__(self, of: Any, n: int = 0):
        self.of, self.n = of, n
        self.is_record = not isinstance(of, str)
        self.is_place = not self.is_record and of not in NUMBERS  # a row holds an address

    def __getitem__(self, n: int) -> Kind:
        return Kind(self.of, n)


real, whole = Kind("double"), Kind("long long")
floats, wholes, thing = Kind("double *"), Kind("long long *"), Kind("void *")


def many(record: Any, n: int) -> Kind:
    """An array of n records."""
    return Kind(record, n)


def record(declaration: type) -> Any:
    """The class with slots of a declaration; `x`, `y`, `z` name the records of a field `axis`.

    A declaration that extends a record begins with its fields.
    """
    own = declaration.__annotations__.items()
    fields = {**getattr(declaration, "kinds", {})}
    fields |= {name: x if isinstance(x, Kind) else Kind(x) for name, x in own}
    slots = [*fields, *axes_of(fields)]
    body = {"__slots__": slots, "__init__": starter_of(fields), "__doc__": declaration.__doc__}
    made: Any = type(declaration.__name__, (), body)
    made.__module__ = declaration.__module__
    made.kinds, made.copy = fields, staticmethod(copier_of(fields))
    made.copy_numbers = staticmethod(copier_of(fields, with_places=False))
    return made


def axes_of(fields: dict[str, Kind]) -> str:
    """Names of the records of a field `axis`, a letter each."""
    return "xyz"[: fields["axis"].n] if "axis" in fields else ""


def starter_of(fields: dict[str, Kind]) -> Any:
    """A function that starts a record of CPython, field by field, without a loop."""
    lines, names = ["def start(self):"], {}
    for name, kind in fields.items():
        if kind.is_record:
            names[f"_{name}"] = kind.of
            one = f"_{name}()"
        else:
            one = "None" if kind.is_place else repr(NUMBERS[kind.of][0])
        value = f"[{', '.join([one] * kind.n)}]" if kind.n else one
        lines.append(f"    self.{name} = {value}")
    lines += [f"    self.{axis} = self.axis[{i}]" for i, axis in enumerate(axes_of(fields))]
    exec("\n".join(lines), names)
    return names["start"]


def copier_of(fields: dict[str, Kind], with_places: bool = True) -> Any:
    """A function that copies a record into another of its kind, field by field, without a loop.

    Without what lies elsewhere, one of both may be a view of a row.
    """
    lines, names = ["def copy(to, of):", "    pass"], {}
    for name, kind in fields.items():
        if kind.is_record:
            names[f"_{name}"] = kind.of.copy if with_places else kind.of.copy_numbers
            parts = [f"{name}[{i}]" for i in range(kind.n)] or [name]
            lines += [f"    _{name}(to.{part}, of.{part})" for part in parts]
        elif with_places or not kind.is_place:
            whole = "[:]" if kind.n else ""
            lines.append(f"    to.{name}{whole} = of.{name}")
    exec("\n".join(lines), names)
    return names["copy"]


# ---- rows of NumPy arrays ------------------------------------------------------------------------


@functools.cache
def struct_of(made: Any) -> Any:
    """A class of views of rows of a record in memory, with the attributes of the record."""
    fields: list[tuple[str, Any]] = []
    for name, kind in made.kinds.items():
        c = "long long" if kind.is_place else kind.of  # an address is as wide
        one = struct_of(c) if kind.is_record else NUMBERS[c][1]
        fields.append((name, one * kind.n if kind.n else one))
    body: dict[str, Any] = {"_fields_": fields}
    names = enumerate(axes_of(made.kinds))
    body |= {c: property(lambda view, i=i: view.axis[i]) for i, c in names}
    return type(made.__name__, (ctypes.Structure,), body)


@functools.cache
def dtype_of(made: Any) -> Any:
    """The dtype of rows of a record."""
    import numpy as np

    return np.dtype(struct_of(made))


def view_of(made: Any, row: Any) -> Any:
    """A view of a row, shape (1,)."""
    return struct_of(made).from_address(row.ctypes.data)


def load(view: Any, row: Any) -> None:
    """Fills a record from a row, shape (1,), except for what lies elsewhere."""
    view.copy_numbers(view, view_of(type(view), row))


def save(view: Any, row: Any) -> None:
    """Writes a record into a row, shape (1,), except for what lies elsewhere."""
    view.copy_numbers(view_of(type(view), row), view)


# ---- C and Cython --------------------------------------------------------------------------------

HEAD = """\
/* Written from kernel/records.py. A record in a record is an array of one, which C takes for its
   address: so names refer to records, as in Python. x, y, z name the axes. */
#include <string.h>
#define copied(to, of) memcpy(to, of, sizeof *(of))
"""


def header(records: Any, functions: str) -> str:
    """The C header of records, in an order in which each is known when it is used."""
    names = "".join(f"typedef struct {x.__name__}_s {x.__name__}_s;\n" for x in records)
    text = HEAD + names + functions
    for made in records:
        text += f"struct {made.__name__}_s {{\n"
        for name, kind in made.kinds.items():
            c = f"{kind.of.__name__}_s" if kind.is_record else kind.of
            size = (f"[{kind.n}]" if kind.n else "") + ("[1]" if kind.is_record else "")
            if name == "axis":
                each = ", ".join(f"{x}[1]" for x in axes_of(made.kinds))
                text += f"    union {{ {c} axis{size}; struct {{ {c} {each}; }}; }};\n"
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
        for name, kind in made.kinds.items():
            c = kind.of.__name__ if kind.is_record else kind.of
            text += f"        {c} {name}" + (f"[{kind.n}]\n" if kind.n else "\n")
            if name == "axis":
                text += f"        {c} {', '.join(axes_of(made.kinds))}\n"
    return text
