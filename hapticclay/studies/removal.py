"""Clay removed by the tool: a map of heights over the block, and the volume.

The tool is a round cutter of diameter `width` at depth `depth` in the block, and moves with the
handle. Clay is any region with damping. The module needs no graphics: the scene draws this map, and
a headless run computes it from the record.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np

from ..arguments import checked
from ..errors import ParameterError, number
from ..model.clay import Clay, extent
from ..model.tool import Tool
from ..scene.scenario import Scenario
from ..simulation.record import Record, in_plane

CELL_SIZE = 2e-3  # [m] largest cell of a picture's map
PICTURE_CELLS, VOLUME_CELLS = 10, 32  # least number of cells in the tool's width
PATH_TOLERANCE = 5e-4  # of the width: largest deviation of the path from its straight segments
MAP_MARGIN = 0.02  # [m] of a block without borders, before the start and beyond the end of the path
HIGHEST = 0.8  # of a block's thickness in a picture, above the floor of its grooves
MOST_CELLS = 20_000  # along one axis
HALF_BREADTH = 0.08  # [m] of a block without borders, across the path

TOOL = Tool()


def block_of_clay(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of the block of clay in a picture, or of the work area [m].

    The block ends at the borders of the clay; without borders it extends slightly beyond the path.
    """
    start, length = np.array(scenario.start), scenario.length
    low, high = start - HALF_BREADTH, start + HALF_BREADTH
    if length is not None:
        across = scenario.clay is not None and "y" in scenario.clay.y.along
        low, high[0] = low.copy(), length + MAP_MARGIN
        low[0] = start[0] - MAP_MARGIN
        if across:
            low[1] = start[1] - MAP_MARGIN
            high[1] = start[1] + 2.1 * (length - start[0]) + MAP_MARGIN
    for block in scenario.clay.blocks if scenario.clay else ():
        (x0, x1), (y0, y1) = block.x, block.y
        return np.array((x0, y0)), np.array((x1, y1))
    for i in (0, 1):
        spans = extent(scenario.clay, i)
        if scenario.clay and spans and all(f != math.inf for span in spans for f in map(abs, span)):
            low[i], high[i] = spans[0][0], spans[-1][1]
    return low, high


class Removal:
    """Clay removed so far: the share of each cell of a grid that the tool has covered.

    A cell at the edge of the tool is covered in proportion, so a straight cut has its exact area
    for any cell size. Along a path, no cell straddles a border of the clay. Arrays of cells have
    shape (ny, nx), lengths are in m, `volume` in m^3. `clay` is the share of each cell that is
    clay; in a groove, height above its floor over the depth of the tool.
    """

    def __init__(
        self,
        scenario: Scenario,
        tool: Tool = TOOL,
        cell: float | None = None,
        path: np.ndarray | None = None,
    ):
        """Lays the grid over the block, or over the path of the handle [m], shape (n, 2)."""
        fit = tool.width / VOLUME_CELLS
        if path is None:
            fit = min(CELL_SIZE, tool.width / PICTURE_CELLS)
        self.tool = tool
        self.cell = number("cell", fit if cell is None else cell, 1e-4, 0.5 * tool.width, unit="m")
        low, high = block_of_clay(scenario)
        spans = [extent(scenario.clay, i) for i in (0, 1)]
        borders: list[list[float]] = [[], []]
        if path is not None and len(path):
            reach = 0.5 * tool.width + self.cell
            low, high = path.min(axis=0) - reach, path.max(axis=0) + reach
            for i in (0, 1):
                borders[i] = [e for span in spans[i] for e in span if low[i] < e < high[i]]
        if np.max((high - low) / self.cell) > MOST_CELLS:
            raise ParameterError("record", scenario.name, "path too long for a map of the clay")
        lines = [_border_lines(low[i], high[i], borders[i], self.cell) for i in (0, 1)]
        self.x, self.y = (0.5 * (at[1:] + at[:-1]) for at in lines)  # centres, then sizes
        self.wide, self.high = (np.diff(at) for at in lines)
        self.clay = _clay_share(scenario.clay, spans, lines)
        self._initial_cut = np.zeros(self.clay.shape)
        self.ground = scenario.clay.ground if scenario.clay else None
        if self.ground:
            edges, places = self.ground.edges, (self.x, self.y)
            at = [np.searchsorted(e, c, "right") for e, c in zip(edges, places, strict=True)]
            cells = np.ix_(*at)
            self.clay = np.pad(self.ground.relief, 1)[cells].T / tool.depth  # none beyond
            self._initial_cut = 1.0 - np.pad(self.ground.shares, 1)[cells].T
        self.restore()

    def restore(self) -> None:
        """Restores the uncut block."""
        self.cut, self.volume = self._initial_cut.copy(), 0.0

    def sweep(self, begin: Any, end: Any) -> float:
        """Moves the tool in a straight line; returns the volume removed [m^3]."""
        r, reach = 0.5 * self.tool.width, 0.5 * self.tool.width + self.cell
        (x0, y0), (x1, y1) = begin, end
        i = _cells_between(self.x, min(x0, x1) - reach, max(x0, x1) + reach)
        j = _cells_between(self.y, min(y0, y1) - reach, max(y0, y1) + reach)
        if i.start >= i.stop or j.start >= j.stop:
            return 0.0
        x, y = self.x[i] - x0, self.y[j] - y0
        dx, dy = x1 - x0, y1 - y0
        square = dx * dx + dy * dy
        x, y = x[None, :], y[:, None]
        if square > 0.0:
            along = np.minimum(np.maximum((x * dx + y * dy) / square, 0.0), 1.0)
            x, y = x - along * dx, y - along * dy
        wide, high = self.wide[i], self.high[j][:, None]
        away = np.maximum(np.sqrt(x * x + y * y), 1e-9)
        across = np.maximum(np.hypot(x * wide, y * high) / away, 1e-9)  # the cell's size that way
        cover = np.minimum(np.maximum(0.5 + (r - away) / across, 0.0), 1.0)
        cut = self.cut[j, i]
        np.maximum(cut, cover, out=cover)
        gained = float(((cover - cut) * self.clay[j, i] * wide * high).sum()) * self.tool.depth
        self.cut[j, i] = cover
        self.volume += gained
        return gained

    def heights(self, thickness: float) -> np.ndarray:
        """Height of each cell over the ground [m]; a groove is scaled to fit into the thickness."""
        if self.ground:
            scale = min(1.0, HIGHEST * thickness / (self.ground.highest or thickness))
            above = self.clay * self.tool.depth
            return thickness + scale * (above * (1.0 - self.cut) - self.ground.highest)
        return np.where(self.clay > 0.5, thickness - self.tool.depth * self.cut, 0.0)


@checked
def removed(
    record: Record, width: float = TOOL.width, depth: float = TOOL.depth, cell: float | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Volume [m^3] of clay removed by a tool at the handle, to 0.5 %, and its rate [m^3/s], (n,).

    In clay that stays cut (`Clay.groove`) it is the volume removed in the run by its own tool.

    Args:
        record: record of the run.
        width: diameter of the tool [m]; not used in clay that stays cut.
        depth: depth of the cut [m]; not used in clay that stays cut.
        cell: largest cell of the map [m]; None for 1/32 of the width, which the accuracy requires.
    """
    record = in_plane(record)
    p = record.p
    tool = Tool(width, depth)
    volume, rate = np.zeros(len(p)), np.zeros(len(p))
    if record.scenario.clay is None or not len(p):
        return volume, rate
    own = record.extra.get("removed")
    if record.ground is not None and own is not None and len(own) == len(p) > 1:
        step = np.gradient(record.t)
        return own, np.divide(np.gradient(own), step, out=rate, where=step > 0.0)
    grid = Removal(record.scenario, tool, cell, p)
    way = np.concatenate(((0.0,), np.cumsum(np.hypot(*np.diff(p, axis=0).T))))
    moving = np.concatenate(((True,), np.diff(way) > 0.0))
    bends = way[moving][_bends(p[moving], PATH_TOLERANCE * tool.width)]
    knots = np.union1d(np.arange(0.0, way[-1], grid.cell), bends)
    at = np.column_stack([np.interp(knots, way[moving], p[moving, i]) for i in (0, 1)]).tolist()
    gained = [grid.sweep(a, b) for a, b in itertools.pairwise([at[0], *at])]
    total = np.cumsum(gained)
    if len(knots) < 2:
        return np.full(len(p), total[0]), rate
    slope = np.diff(total) / np.maximum(np.diff(knots), 1e-300)
    piece = np.clip(np.searchsorted(knots, way, "right") - 1, 0, len(slope) - 1)
    return np.interp(way, knots, total), slope[piece] * np.hypot(*record.v.T)


def _bends(p: np.ndarray, tolerance: float) -> np.ndarray:
    """Mask of the points whose polygon stays within tolerance of a path (Douglas, Peucker)."""
    keep = np.zeros(len(p), dtype=bool)
    keep[[0, -1]] = True
    spans = [(0, len(p) - 1)]
    while spans:
        a, b = spans.pop()
        if b - a < 2:
            continue
        x, y = (p[a + 1 : b] - p[a]).T
        dx, dy = p[b] - p[a]
        along = np.clip((x * dx + y * dy) / max(dx * dx + dy * dy, 1e-300), 0.0, 1.0)
        off = np.hypot(x - along * dx, y - along * dy)
        i = int(np.argmax(off))
        if off[i] > tolerance:
            i += a + 1
            keep[i] = True
            spans += [(a, i), (i, b)]
    return keep


def _border_lines(low: float, high: float, borders: list[float], cell: float) -> np.ndarray:
    """Edges of the cells from low to high or a little beyond [m], one of them at each border."""
    if not borders:
        return low + cell * np.arange(max(math.ceil((high - low) / cell - 1e-9), 2) + 1)
    ends = np.unique([low, *borders, high])
    pieces = [
        np.linspace(a, b, math.ceil((b - a) / cell) + 1)[:-1] for a, b in itertools.pairwise(ends)
    ]
    return np.append(np.concatenate(pieces), high)


def _share(spans: list[tuple[float, float]], lines: np.ndarray) -> np.ndarray:
    """Share of each cell between the lines that lies in the spans."""
    inside = sum(
        np.clip(lines, low, high) - low if low > -math.inf else np.minimum(lines, high)
        for low, high in spans
    )
    return np.diff(inside) / np.diff(lines) if spans else np.zeros(len(lines) - 1)


def _clay_share(clay: Clay | None, spans: list[Any], lines: list[np.ndarray]) -> np.ndarray:
    """Share of clay in each cell between the lines along x and along y, shape (ny, nx)."""
    if clay is None or all(len(law.along) == 1 for law in clay.laws):
        left = [1.0 - _share(spans[i], lines[i]) for i in (0, 1)]
        return 1.0 - left[1][:, None] * left[0][None, :]
    edges = [np.unique([e for law in clay.laws for e in law.lines[i]]) for i in (0, 1)]
    x, y = (np.concatenate((e[:1] - 1.0, 0.5 * (e[1:] + e[:-1]), e[-1:] + 1.0)) for e in edges)
    some = np.zeros((len(x), len(y)), dtype=bool)
    for law in clay.laws:
        some |= law.some[law.index(x[:, None], y)]
    parts = [_cell_parts(e, at) for e, at in zip(edges, lines, strict=True)]
    return parts[1] @ some.T @ parts[0].T


def _cell_parts(edges: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """Share of each cell between the lines that lies between two edges, shape (n, m)."""
    low, high = np.append(-math.inf, edges), np.append(edges, math.inf)
    return np.diff(np.clip(lines[:, None], low, high), axis=0) / np.diff(lines)[:, None]


def _cells_between(centres: np.ndarray, low: float, high: float) -> slice:
    begin, end = centres.searchsorted((low, high))
    return slice(int(begin), int(end))
