"""A record as columns, as a pandas DataFrame and as an xarray Dataset."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import needing
from ..fields import plain_data
from ..model.constants import AXES
from ..model.hardware import JOINTS
from .columns import ARRAYS, COLUMNS, Recorded, parts_of

if TYPE_CHECKING:
    from pandas import DataFrame
    from xarray import Dataset


def recorded_arrays(record: Recorded) -> dict[str, np.ndarray]:
    """The arrays over time of a record by name, t among them, then those in `extra`."""
    return {name: getattr(record, name) for name in ARRAYS} | record.extra


def record_columns(record: Recorded) -> dict[str, np.ndarray]:
    """Each number of a sample as a column, shape (n,): t, p_x, p_y, v_x, ..., tau_elbow, ..."""
    out = {}
    for name, x in recorded_arrays(record).items():
        parts = parts_of(name, record.scenario)
        out |= {f"{name}_{part}": x[:, i] for i, part in enumerate(parts)} if parts else {name: x}
    return out


def column_units(record: Recorded) -> dict[str, str]:
    """Unit of each of the `record_columns`."""
    return {
        f"{name}_{part}" if part else name: COLUMNS[name].unit
        for name in recorded_arrays(record)
        for part in parts_of(name, record.scenario) or ("",)
    }


def attributes_of(record: Recorded) -> dict[str, Any]:
    """Texts and numbers that go with the arrays into any file."""
    summary = {k: v for k, v in record.summary().items() if k not in ("scenario", "regions")}
    return {
        "title": f"hapticclay record: {record.scenario.name}",
        "source": f"hapticclay {record.versions.get('hapticclay', 'unknown')}",
        "status": record.status,
        "outcome": record.outcome.code,
        "end_time": float(record.outcome.time),
        "scenario": json.dumps(plain_data(record.scenario, left_out=[])),
        "summary": json.dumps(summary),
    }


def to_frame(record: Recorded) -> DataFrame:
    """A record as a pandas DataFrame: see `Record.to_frame`."""
    with needing("to_frame", "pandas"):
        import pandas as pd

    columns = record_columns(record)
    out = pd.DataFrame(columns, index=pd.Index(columns.pop("t"), name="t"))
    out.attrs |= {"units": column_units(record), **attributes_of(record)}
    return out


def to_xarray(record: Recorded) -> Dataset:
    """A record as an xarray Dataset: see `Record.to_xarray`."""
    with needing("to_xarray", "xarray"):
        import xarray as xr

    dims = {(): ("time",), AXES: ("time", "axis"), JOINTS: ("time", "joint")}
    values: dict[str, Any] = {
        name: (dims[COLUMNS[name].parts], x, _labels(name))
        for name, x in recorded_arrays(record).items()
    }
    coords = {
        "time": ("time", values.pop("t")[1], _labels("t")),
        "axis": list(record.scenario.axes),
        "joint": list(record.scenario.joints),
    }
    block = record.scenario.clay and record.scenario.clay.ground
    if record.ground is not None and block:
        for name, edges in zip(("cell_x", "cell_y"), block.edges, strict=True):
            labels = {"units": "m", "long_name": f"centre of a cell of clay along {name[-1]}"}
            coords[name] = (name, 0.5 * (edges[1:] + edges[:-1]), labels)
        values["ground"] = (("cell_x", "cell_y"), record.ground, _labels("ground"))
    return xr.Dataset(values, coords, attributes_of(record))


def _labels(name: str) -> dict[str, str]:
    return {"units": COLUMNS[name].unit, "long_name": COLUMNS[name].words}
