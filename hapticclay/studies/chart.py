"""A chart as data: named curves over labelled axes, independent of how it is drawn or printed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

CurveKind = Literal["line", "dashed", "marks", "steps"]
LogAxes = Literal["", "x", "y", "xy"]


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of a chart.

    Attributes:
        name: in the legend; "" for none.
        x: in the unit of the chart's x axis, shape (n,).
        y: in the unit of its y axis, shape (n,).
        kind: "line" and "dashed" for theory, "marks" for runs, "steps" for a sequence of levels.
    """

    name: str
    x: np.ndarray
    y: np.ndarray
    kind: CurveKind = "line"


@dataclass(frozen=True, eq=False)
class Chart:
    """Curves over two axes.

    Attributes:
        name: of its file.
        title: in a few words.
        caption: description of the content.
        x: label of the x axis, with its unit.
        y: label of the y axis, with its unit.
        curves: in the order in which they are drawn.
        log: axes that are logarithmic.
    """

    drawn_by = "hapticclay.views.chart_plots:chart_plot"

    name: str
    title: str
    caption: str
    x: str
    y: str
    curves: tuple[Curve, ...]
    log: LogAxes = ""

    def tables(self) -> dict[str, dict[str, Any]]:
        """The numbers of the chart, one table per curve."""
        return {
            (c.name or f"curve {i}"): {self.x: c.x, self.y: c.y} for i, c in enumerate(self.curves)
        }


def curve(name: str, x: Any, y: Any, kind: CurveKind = "line") -> Curve:
    """A curve of two sequences of numbers."""
    return Curve(name, np.asarray(x, dtype=float), np.asarray(y, dtype=float), kind)
