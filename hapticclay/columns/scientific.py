"""Logs of MATLAB, HDF5, NetCDF and NumPy."""

from __future__ import annotations

import io
import re
import warnings
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..display import one_line
from ..errors import ParameterError, needing
from ..files import MOST_READ, read_bytes
from .array_tables import ArrayTable, Container
from .heads import is_unit
from .matlab_elements import check_elements, is_version_5

LABEL = re.compile(r"[^()]*\(([^()]*)\)\s*(.*)")  # "Lever positions (rad) master, slave"
UNIT_NAMES = ("units", "unit", "Units", "Unit")
DEEPEST = 12  # groups in one another
MOST_VALUES = 2**28  # numbers of an array


def matlab(field: str, path: Path, table: str = "") -> ArrayTable:
    """A MAT file of version 4 to 7.2: arrays and structures, and the scopes of Simulink."""
    from scipy.io import loadmat

    content = read_bytes(path, MOST_READ)
    if is_version_5(content):
        check_elements(content)
    with warnings.catch_warnings(action="ignore"):
        data = loadmat(io.BytesIO(content), simplify_cells=True)
    data = {k: x for k, x in data.items() if not k.startswith("__")}
    if opaque := [k for k, x in data.items() if _is_opaque(x)]:
        data = {k: x for k, x in data.items() if k not in opaque}
    units, parts = _stated(data)
    table, notes = (table, ()) if table else _largest(data)
    found = Container.of(field, path, "MATLAB", _with_signals(data), units, parts)
    found = replace(found, notes=notes)
    if opaque and not found.arrays:
        bound = (
            f"holds {', '.join(opaque)}, a table or an object, which only MATLAB reads: save "
            "table2struct(T, 'ToScalar', true)"
        )
        raise ParameterError(field, str(path), bound)
    return found.table(table)


def _is_opaque(x: Any) -> bool:
    return type(x).__name__ in ("MatlabOpaque", "MatlabFunction") or (
        isinstance(x, np.ndarray) and x.dtype.names is not None and "arr" in x.dtype.names
    )


def _stated(data: dict[str, Any]) -> tuple[dict[str, str], dict[str, Sequence[str]]]:
    """Units, and names of parts, that structures of these names state, as our exports do."""
    units, columns = data.get("units"), data.get("columns")
    if not isinstance(units, dict):
        return {}, {}
    del data["units"]
    parts: dict[str, Sequence[str]] = {}
    if isinstance(columns, dict):
        parts = {k: [str(y) for y in np.atleast_1d(x)] for k, x in columns.items()}
        del data["columns"]
    return {k: str(x) for k, x in units.items() if isinstance(x, str)}, parts


def _is_scope(x: Any) -> bool:
    """Whether it is a structure with time, as scopes of Simulink save them."""
    return isinstance(x, dict) and "time" in x and "signals" in x


def _with_signals(data: Any) -> Any:
    """Structures with time by the labels of their signals."""
    if not isinstance(data, dict):
        return data
    return {k: _scope(x) if _is_scope(x) else _with_signals(x) for k, x in data.items()}


def _scope(scope: dict[str, Any]) -> dict[str, Any]:
    """Time and signals of a structure with time."""
    signals, out = scope["signals"], {"time": scope["time"]}
    for i, signal in enumerate(signals if isinstance(signals, list | tuple) else [signals], 1):
        label = signal.get("label")
        label = label.strip() if isinstance(label, str) else ""
        for name, x in _labelled(label or f"signal {i}", signal["values"]).items():
            out[name if name not in out else f"{name} {i}"] = x
    return out


def _labelled(label: str, values: Any) -> dict[str, Any]:
    """Columns of a signal by the names and the unit of "Torque (Nm at lever) -tau_rm, tau_rs"."""
    found = LABEL.fullmatch(label)
    names = [x.strip() for x in found[2].split(",") if x.strip()] if found else []
    columns = np.asarray(values)
    columns = columns[:, None] if columns.ndim == 1 else columns
    if not found or columns.ndim != 2 or not 0 < columns.shape[1] <= len(names):
        return {label: values}
    word = "".join(found[1].split()[:1])
    unit = f" [{word}]" if is_unit(word) else ""
    return {f"{name}{unit}": x for name, x in zip(names, columns.T, strict=False)}


def _largest(data: dict[str, Any]) -> tuple[str, tuple[str, ...]]:
    """The scope with most columns, where there are several; and a note."""
    scopes = {k: x for k, x in data.items() if _is_scope(x) and np.size(x["time"]) > 1}
    if len(scopes) < 2:
        return "", ()
    most = max(scopes, key=lambda k: sum(_width(x) for x in _scope(scopes[k]).values()))
    others = one_line(", ".join(k for k in scopes if k != most), 80)
    return most, (f"scope {most}, which has most columns; read {others} by --table",)


def _width(x: Any) -> int:
    return np.shape(x)[1] if np.ndim(x) == 2 else 1


def hdf5(field: str, path: Path, table: str = "") -> ArrayTable:
    """An HDF5 file, which NetCDF 4 and MATLAB 7.3 are too."""
    with needing("an HDF5 log", "h5py", "logs"):
        import h5py

    arrays: dict[str, Any] = {}
    units: dict[str, str] = {}
    parts: dict[str, Sequence[str]] = {}
    with h5py.File(path, "r") as file:
        is_matlab = any("MATLAB_class" in x.attrs for x in file.values())
        for name, x in _datasets(file, is_matlab):
            arrays[name] = x[()]
            for key in UNIT_NAMES:
                if isinstance(unit := _text(x.attrs.get(key)), str):
                    units[name] = unit
            if labels := _labels(x, file):
                parts[name] = labels
        form = "MATLAB 7.3" if is_matlab else "NetCDF 4" if "_NCProperties" in file.attrs else ""
    if is_matlab:
        arrays = {k: np.asarray(x).T for k, x in arrays.items()}
    return Container.of(field, path, form or "HDF5", arrays, units, parts).table(table)


def _datasets(group: Any, is_matlab: bool, name: str = "", depth: int = 0) -> Any:
    """Names and data sets of numbers in a group, and in groups below it."""
    for key, x in group.items():
        path = f"{name}.{key}" if name else key
        if key.startswith("#") or depth > DEEPEST:
            continue
        if hasattr(x, "items"):
            yield from _datasets(x, is_matlab, path, depth + 1)
        elif x.dtype.kind in "biuf" and x.size < MOST_VALUES and x.ndim and not _is_text(x):
            yield path, x
        elif x.dtype.names and x.ndim == 1:
            for column in x.dtype.names:
                yield f"{path}.{column}", _Part(x, column)


class _Part:
    """A column of a data set of records."""

    attrs: dict[str, Any] = {}
    dims = ()

    def __init__(self, whole: Any, name: str):
        self.whole, self.name = whole, name

    def __getitem__(self, key: Any) -> np.ndarray:
        return self.whole[self.name][key]


def _is_text(x: Any) -> bool:
    """Whether a data set is a text of MATLAB, or says that it holds nothing."""
    kind, name = _text(x.attrs.get("MATLAB_class")), str(_text(x.attrs.get("NAME", "")))
    empty = "MATLAB_empty" in x.attrs or name.startswith("This is a netCDF dimension but not")
    return kind in ("char", "cell") or empty


def _text(x: Any) -> Any:
    return x.decode("utf-8", "replace") if isinstance(x, bytes) else x


def _labels(x: Any, file: Any) -> list[str]:
    """Names of the columns of a data set, from the scale of its second dimension."""
    if len(getattr(x, "dims", ())) != 2 or len(x.dims[1]) == 0:
        return []
    scale = x.dims[1][0]
    values = scale[()]
    return [str(_text(y)) for y in values] if values.dtype.kind in "OSU" else []


def netcdf3(field: str, path: Path, table: str = "") -> ArrayTable:
    """A NetCDF file of version 3."""
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        data = {k: np.array(x[:]) for k, x in file.variables.items()}
        units = {k: _text(getattr(x, "units", b"")) for k, x in file.variables.items()}
    return Container.of(field, path, "NetCDF", data, units).table(table)


def numpy_array(field: str, path: Path, table: str = "") -> ArrayTable:
    """A .npy file: named columns, or columns by number."""
    found = np.load(path, allow_pickle=False)
    if found.dtype.names:
        data: Any = {name: found[name] for name in found.dtype.names}
    else:
        columns = np.atleast_2d(found.squeeze())
        columns = columns if columns.shape[0] > columns.shape[1] else columns.T
        data = {str(i + 1): x for i, x in enumerate(columns.T)}
    return Container.of(field, path, "NumPy", data).table(table)


def numpy_arrays(field: str, path: Path, table: str = "") -> ArrayTable:
    """An .npz file: arrays by name."""
    with np.load(path, allow_pickle=False) as file:
        data = {name: x for name in file.files if (x := _plain_array(file, name)) is not None}
    return Container.of(field, path, "NumPy", data).table(table)


def _plain_array(file: Any, name: str) -> np.ndarray | None:
    """An array of an .npz file; None for one that is pickled."""
    try:
        return file[name]
    except (ValueError, zipfile.BadZipFile):
        return None
