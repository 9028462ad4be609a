"""What the tool takes out of the clay: a map of heights over the block, and the volume removed.

The tool is a round cutter of `width` that stands `depth` deep in the block and is led by the handle; clay is
where some damping is. Nothing here needs graphics: the scene draws this map, a headless run computes it
from the record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .clay import there_is
from .errors import ParameterError, number
from .params import Scenario
from .record import Record

CELL = 2e-3  # [m] of the map
MARGIN = 0.02  # of a block without borders, before the start and beyond the end of the path [m]
HALF = 0.08  # half the breadth of a block without borders, where the path has none [m]


@dataclass(frozen=True)
class Tool:
    """The cutter at the handle.

    Attributes:
        width: of its round footprint [m]. depth: of the cut [m].
    """

    width: float = 0.02
    depth: float = 0.01

    def __post_init__(self):
        object.__setattr__(self, "width", number("tool.width", self.width, 2.0 * CELL, 0.1, unit="m"))
        object.__setattr__(self, "depth", number("tool.depth", self.depth, 1e-4, 0.025, unit="m"))


TOOL = Tool()


def block(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the block of clay to be seen, shape (2,) each [m]; without clay, of the work area.

    Where the clay has borders they are the block's; where it has none, the block reaches a little beyond the path.
    """
    start, length = np.array(scenario.start), scenario.length
    low, high = start - HALF, start + HALF
    if length is not None:
        across = scenario.clay is not None and scenario.clay.y.along == "y"
        low, high[0] = low.copy(), length + MARGIN
        low[0] = start[0] - MARGIN
        if across:
            low[1], high[1] = start[1] - MARGIN, start[1] + 2.1 * (length - start[0]) + MARGIN
    for i in (0, 1):
        spans = there_is(scenario.clay, i)
        if scenario.clay and spans and all(f != math.inf for span in spans for f in map(abs, span)):
            low[i], high[i] = spans[0][0], spans[-1][1]
    return low, high


class Removal:
    """How much of the clay is left: coverage of each cell of a grid by what the tool has passed over.

    A cell that the edge of the tool passes through is covered in part, in proportion; so a straight cut has its exact
    area whatever the cell.

    Attributes:
        x, y: centres of the cells [m], shape (nx,), (ny,).
        cut: share of each cell that is cut, 0 to 1, shape (ny, nx).
        volume: removed so far [m^3].
    """

    def __init__(self, scenario: Scenario, tool: Tool = TOOL, cell: float = CELL, path: np.ndarray | None = None):
        """For the block of the scenario, and as far beyond as the tool goes along path [m], shape (n, 2)."""
        self.tool, self.cell = tool, number("cell", cell, 1e-4, 0.5 * tool.width, unit="m")
        low, high = block(scenario)
        if path is not None and len(path):
            reach = 0.5 * tool.width + cell
            low, high = np.minimum(low, path.min(axis=0) - reach), np.maximum(high, path.max(axis=0) + reach)
        count = np.maximum(np.ceil((high - low) / cell - 1e-9), 2).astype(int)
        if count.max() > 20_000:
            raise ParameterError("record", scenario.name, "the path is too long for a map of the clay")
        self.x, self.y = (low[i] + cell * (np.arange(count[i]) + 0.5) for i in (0, 1))
        left = [1.0 - _share(there_is(scenario.clay, i), centres, cell) for i, centres in ((0, self.x), (1, self.y))]
        self.clay = 1.0 - left[1][:, None] * left[0][None, :]  # share of each cell that is clay
        self.cut = np.zeros(self.clay.shape)
        self.volume = 0.0

    def sweep(self, a: Any, b: Any) -> float:
        """Leads the tool from a to b [m], each (2,); returns the volume that this removes [m^3]."""
        r, h = 0.5 * self.tool.width, self.cell
        (ax, ay), (bx, by) = a, b
        i = _window(self.x, min(ax, bx) - r - h, max(ax, bx) + r + h)
        j = _window(self.y, min(ay, by) - r - h, max(ay, by) + r + h)
        if i.start >= i.stop or j.start >= j.stop:
            return 0.0
        x, y = self.x[i] - ax, self.y[j] - ay
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        x, y = x[None, :], y[:, None]
        if square > 0.0:
            along = np.clip((x * dx + y * dy) / square, 0.0, 1.0)
            x, y = x - along * dx, y - along * dy
        cover = np.clip(0.5 + (r - np.sqrt(x * x + y * y)) / h, 0.0, 1.0)
        cut = self.cut[j, i]
        np.maximum(cut, cover, out=cover)
        gained = float(((cover - cut) * self.clay[j, i]).sum()) * h * h * self.tool.depth
        self.cut[j, i] = cover
        self.volume += gained
        return gained

    def heights(self, thickness: float) -> np.ndarray:
        """Height of the clay over the ground, where its block is so thick [m], at the cells, shape (ny, nx)."""
        return np.where(self.clay > 0.5, thickness - self.tool.depth * self.cut, 0.0)


def removed(
    record: Record, width: float = TOOL.width, depth: float = TOOL.depth, cell: float = CELL
) -> tuple[np.ndarray, np.ndarray]:
    """Volume of clay that a tool at the handle has removed in a run.

    Args:
        record: of the run. width, depth: of the tool [m]. cell: of the map [m].

    Returns:
        (volume [m^3], rate [m^3/s]), at the samples of the record, shape (n,) each.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    p = record.p
    tool = Tool(width, depth)
    volume, rate = np.zeros(len(p)), np.zeros(len(p))
    if record.scenario.clay is None or not len(p):
        return volume, rate
    grid = Removal(record.scenario, tool, cell, p)
    way = np.concatenate(((0.0,), np.cumsum(np.hypot(*np.diff(p, axis=0).T))))
    knots = np.append(np.arange(0.0, way[-1], cell), way[-1])
    moving = np.concatenate(((True,), np.diff(way) > 0.0))
    at = np.column_stack([np.interp(knots, way[moving], p[moving, i]) for i in (0, 1)]).tolist()
    gained = [grid.sweep(at[0], at[0]), *(grid.sweep(a, b) for a, b in zip(at, at[1:], strict=False))]
    total = np.cumsum(gained)
    if len(knots) < 2:
        return np.full(len(p), total[0]), rate
    slope = np.diff(total) / np.maximum(np.diff(knots), 1e-300)
    piece = np.clip(np.searchsorted(knots, way, "right") - 1, 0, len(slope) - 1)
    return np.interp(way, knots, total), slope[piece] * np.hypot(*record.v.T)


def _share(spans: list[tuple[float, float]], centres: np.ndarray, cell: float) -> np.ndarray:
    """Share of each cell that lies in the spans."""
    out = np.zeros(len(centres))
    for low, high in spans:
        out += np.clip(np.minimum(centres + 0.5 * cell, high) - np.maximum(centres - 0.5 * cell, low), 0.0, cell) / cell
    return out


def _window(centres: np.ndarray, low: float, high: float) -> slice:
    begin, end = np.searchsorted(centres, (low, high))
    return slice(int(begin), int(end))
