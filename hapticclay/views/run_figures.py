"""The figures of a run that `hapticclay run` writes, and the numbers that they show."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from ..model.cells import Profile
from ..model.constants import AXES
from ..scene.scenario import Scenario
from ..simulation.columns import COLUMNS, parts_of
from ..simulation.record import Record, in_plane
from . import figure as shown
from .arm_plots import arm_path_plot, handle_plot, joints_plot
from .flow_plots import force_velocity_plot
from .path_plots import ground_of, ground_plot, path_plot
from .run_axes import is_viscous, main_axis
from .run_plots import force_ratio_plot, maneuver_plot, velocity_plot


def _clay_along_both_axes(s: Scenario) -> bool:
    return s.clay is not None and s.clay.along == "xy"


def shown_axes(s: Scenario) -> str:
    """The axes whose velocity is drawn: "xy" where the clay changes along both, or the main one."""
    return "xy" if _clay_along_both_axes(s) else main_axis(s)


def _bare(s: Scenario) -> bool:
    """Whether the arm is one from a file, without clay: `handle` shows its velocity and force."""
    return s.clay is None and not s.is_closed_form


def _joints(record: Record) -> Figure | None:
    return None if record.scenario.is_closed_form or not len(record.t) else joints_plot(record)


def _handle(record: Record) -> Figure | None:
    return None if record.scenario.is_closed_form or not len(record.t) else handle_plot(record)


def _velocity(record: Record) -> Figure | None:
    s = record.scenario
    if _bare(s):
        return None
    if s.muscle is not None and s.clay is None:
        return None
    return velocity_plot(in_plane(record), shown_axes(s))


def _force(record: Record) -> Figure | None:
    s = record.scenario
    if _bare(s):
        return None
    if s.muscle is not None or not is_viscous(s):
        return maneuver_plot([in_plane(record)], main_axis(s))
    return None if _clay_along_both_axes(s) else force_ratio_plot(in_plane(record), main_axis(s))


def _path(record: Record) -> Figure | None:
    """The path, if the handle may leave a straight line: driven, or in clay of an image."""
    s = record.scenario
    if not s.is_closed_form:
        return arm_path_plot(record) if len(record.t) else None
    if s.clay is None or record.ground is not None:  # which shows the path
        return None
    image = any(not isinstance(law, Profile) for law in s.clay.laws)
    return path_plot(record) if s.driven or image or _clay_along_both_axes(s) else None


def _force_position(record: Record) -> Figure | None:
    s = record.scenario
    applies = (s.muscle is not None or record.ground is not None) and not _bare(s)
    return maneuver_plot([in_plane(record)], main_axis(s), "position") if applies else None


def _force_velocity(record: Record) -> Figure | None:
    clay = record.scenario.clay
    applies = clay is not None and clay.of_velocity and not clay.viscous
    return force_velocity_plot(in_plane(record)) if applies and len(record.t) else None


def _ground(record: Record) -> Figure | None:
    return ground_plot(record) if record.ground is not None and len(record.t) else None


def _stretches(record: Record) -> dict[str, dict[str, Any]]:
    """Steady and expected speed of each stretch."""
    rows = [(axis, r[axis]) for axis in AXES for r in record.regions(axis)]
    return {
        "stretches": {
            "axis": [axis for axis, _ in rows],
            "from [m]": [r["from_m"] for _, r in rows],
            "to [m]": [r["to_m"] for _, r in rows],
            "steady speed [m/s]": [r["steady_speed"] for _, r in rows],
            "expected speed [m/s]": [r["expected_speed"] for _, r in rows],
        }
    }


def _cells(record: Record) -> dict[str, dict[str, Any]]:
    """Remaining clay in each cell of clay that stays cut."""
    if record.ground is None:
        return {}
    x, y = (0.5 * (e[1:] + e[:-1]) for e in ground_of(record).edges)
    i, j = (a.ravel() for a in np.indices(record.ground.shape))
    return {"cells": {"x [m]": x[i], "y [m]": y[j], "left [m]": record.ground.ravel()}}


class RunFigure(NamedTuple):
    """A figure of a run: how it is drawn, and the numbers that it shows."""

    draw: Callable[[Record], Figure | None]  # None if it does not apply
    columns: tuple[str, ...]  # of the record
    tables: Callable[[Record], dict[str, dict[str, Any]]] = lambda _: {}  # by table and column


FIGURES = {
    "joints": RunFigure(_joints, ("q", "qd", "tau")),
    "handle": RunFigure(_handle, ("p", "v", "fh", "fe")),
    "velocity": RunFigure(_velocity, ("p", "v"), _stretches),
    "force": RunFigure(_force, ("p", "v", "fh", "fe", "b")),
    "path": RunFigure(_path, ("p",)),
    "force_position": RunFigure(_force_position, ("p", "fh", "fe")),
    "force_velocity": RunFigure(_force_velocity, ("v", "fe")),
    "ground": RunFigure(_ground, ("p",), _cells),
}
"""The figures of a run by file name. To add a plot to `hapticclay run`, add an entry."""


def record_figures(record: Record) -> dict[str, shown.Figure]:
    """Returns every figure of FIGURES, for any style; some may not apply to the run."""
    return {
        name: shown.Figure(
            functools.partial(kind.draw, record), functools.partial(run_tables, record, name)
        )
        for name, kind in FIGURES.items()
    }


def run_tables(record: Record, figure: str) -> dict[str, dict[str, Any]]:
    """Returns the numbers that a figure of FIGURES shows."""
    samples: dict[str, Any] = {"time [s]": record.t}
    for part in FIGURES[figure].columns:
        for i, axis in enumerate(parts_of(part, record.scenario)):
            name = axis if part == "p" else f"{part}_{axis}"
            samples[f"{name} [{COLUMNS[part].unit}]"] = getattr(record, part)[:, i]
    return {"samples": samples, **FIGURES[figure].tables(record)}


def figure_files(folder: Path) -> set[Path]:
    """Lists the files of the FIGURES, in any format, and of their numbers in a folder."""
    ends = [f".{kind}" for kind in (*shown.FORMATS, "csv")] + ["-*.csv"]
    return {path for name in FIGURES for end in ends for path in folder.glob(name + end)}


def figures(record: Record) -> dict[str, Figure]:
    """Draws the figures of FIGURES that apply to a run."""
    drawn = {name: kind.draw(record) for name, kind in FIGURES.items()}
    return {name: figure for name, figure in drawn.items() if figure is not None}
