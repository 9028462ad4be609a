"""Clay law of one axis: damping, growth, yielding and springs, constant per region or cell."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real, numbers_of
from ..fields import Axis
from ..formulas.constants import B_MAX
from .constants import AXES
from .flow import Consistency, FlowIndex, YieldForce
from .spring import Spring
from .traits import (
    Law,
)

OPTIONAL = ("growth", "Fy", "K", "n")  # further values of each region or cell
Edges = Annotated[tuple[Real, ...], Bound(unit="m")]
Span = Annotated[tuple[Real, Real], Bound(unit="m")]
Image = Annotated[tuple[tuple[float, ...], ...], Bound(0.0, 1.0)]
BlackWhite = Annotated[tuple[Real, Real], Bound(0.0, B_MAX, "N.s/m", names=("black", "white"))]
Outside = Annotated[Real, Bound(0.0, B_MAX, "N.s/m")]


class CellLaw:
    """Base of the laws of one axis: damping that is constant in each cell of a grid.

    Subclasses have `borders`, `damping`, `rates` and `along`, as `Grid`.
    """

    @property
    def lines(self: Any) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Lines along x and along y between cells [m]."""
        return self.borders

    @property
    def some(self: Any) -> np.ndarray:
        """Whether each cell between the lines holds clay, shape (n, m)."""
        Fy, K, _ = self.flows
        some = (self.damping > 0.0) | (self.rates > 0.0) | (Fy > 0.0) | (K > 0.0)
        return some | (self.elastic[..., 0] + self.elastic[..., 2] > 0.0)

    @property
    def elastic(self: Any) -> np.ndarray:
        """Springs of the cells, see `Profile.elastic`: none."""
        return np.broadcast_to(Spring().numbers, (*self.damping.shape, 5))

    @property
    def yields(self: Any) -> bool:
        """Whether any cell has a yield force or a consistency."""
        return bool(self.Fy or self.K)

    def at(self: Any, x: Any, y: Any) -> np.ndarray:
        """Damping at given places, without growth [N.s/m].

        Args:
            x: coordinates [m].
            y: the same along y.
        """
        return self.damping[self.index(x, y)]

    def flows_at(self: Any, x: Any, y: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Yield force [N], consistency [N/(m/s)^n] and flow index at given places.

        Args:
            x: coordinates [m].
            y: the same along y.
        """
        cell = self.index(x, y)
        Fy, K, n = (part[cell] for part in self.flows)
        return Fy, K, n

    def index(self: Any, x: Any, y: Any) -> tuple[Any, Any]:
        """Indices of the cells at given places; on a line between two cells, the one beyond it.

        Args:
            x: coordinates [m].
            y: the same along y.
        """
        at = zip(self.lines, (x, y), strict=True)
        i, j = (np.searchsorted(edges, place, side="right") for edges, place in at)
        return i, j

    def forces(self: Any, kinds: Iterable[Law], speed: float, dent: float) -> np.ndarray:
        """Force of each cell on a tool, without growth [N], shape (n, m).

        Args:
            kinds: laws of the clay.
            speed: of the tool [m/s].
            dent: how far the tool has gone into the cell [m].
        """
        own = [x.force(self, speed, dent) for x in kinds if x.force]
        return functools.reduce(np.add, own, np.zeros(self.damping.shape))

    def forces_at(
        self: Any, kinds: Iterable[Law], x: Any, y: Any, speed: float, dent: float
    ) -> np.ndarray:
        """As `forces`, at given places.

        Args:
            kinds: laws of the clay.
            x: coordinates [m].
            y: the same along y.
            speed: of the tool [m/s].
            dent: how far the tool has gone into the cell [m].
        """
        return self.forces(kinds, speed, dent)[self.index(x, y)]

    def within(self: Any, low: tuple[float, float], high: tuple[float, float]) -> list[float]:
        """Damping of the cells in a box [N.s/m].

        Args:
            low: lowest corner of the box [m].
            high: highest corner of the box [m].
        """
        (i, j), (k, m) = self.index(*low), self.index(*high)
        return self.damping[i : k + 1, j : m + 1].ravel().tolist()


@part("clay.")
class Profile(CellLaw):
    """Damping b of one axis as a piecewise constant function of one coordinate.

    Attributes:
        edges: borders [m], ascending, shape (n,).
        values: b in each region [N.s/m], shape (n + 1,), 0 to 1e9; region i lies between edges
            i - 1 and i.
        along: coordinate that decides, "x" or "y".
        growth: rate at which b of each region grows from when the handle first enters it
            [N.s/m per s], shape (n + 1,), 0 to 1e9; empty for none (Sec. 4.2).
        Fy: yield force of each region [N], as values, 0 to 1e6; empty for none.
        K: consistency of each region [N/(m/s)^n], as values, 0 to 1e6; empty for none.
        n: flow index of each region, as values, 0.05 to 4; empty for 1, and without K.
        springs: spring of each region, along the axis of the law, as values; empty for none.
    """

    edges: Annotated[tuple[Real, ...], Bound(unit="m")]
    values: Annotated[tuple[Real, ...], Bound(0.0, B_MAX, "N.s/m")]
    along: Axis = "x"
    growth: Annotated[tuple[Real, ...], Bound(0.0, B_MAX, "N.s/m per s")] = ()
    Fy: Annotated[tuple[Real, ...], YieldForce] = ()
    K: Annotated[tuple[Real, ...], Consistency] = ()
    n: Annotated[tuple[float, ...], FlowIndex] = ()
    springs: tuple[Spring, ...] = ()

    def __post_init__(self):
        regions = range(len(self.edges) + 1)
        if self.springs and len(self.springs) != len(regions):
            bound = f"must be {len(regions)} springs, one a region, got {len(self.springs)}"
            raise ParameterError("clay.springs", self.springs, bound)
        if not any(x.k or x.k1 for x in self.springs):
            object.__setattr__(self, "springs", ())
        for name in ("values", *OPTIONAL):
            given = getattr(self, name)
            if len(given) != len(regions) and (given or name == "values"):
                numbers_of(f"clay.{name}", given, [str(i) for i in regions])  # raises the error
        check_ascending("clay.edges", self.edges)
        _drop_zeros(self)

    @property
    def borders(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Borders along x and along y [m]."""
        return (self.edges, ()) if self.along == "x" else ((), self.edges)

    @property
    def damping(self) -> np.ndarray:
        """As `Grid.damping`."""
        return self._cells(self.values)

    @property
    def rates(self) -> np.ndarray:
        """As `Grid.rates`."""
        return self._cells(self.growth or (0.0,) * len(self.values))

    @property
    def flows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `Grid.flows`."""
        Fy, K, n = (
            self._cells(x or (usual,) * len(self.values))
            for x, usual in zip(*_flow_of(self), strict=True)
        )
        return Fy, K, n

    @property
    def elastic(self) -> np.ndarray:
        """`Spring.numbers` of each cell, shape (n, m, 5)."""
        rows = np.array([x.numbers for x in self.springs or (Spring(),) * len(self.values)])
        return rows[:, None] if self.along == "x" else rows[None]

    def _cells(self, values: tuple[float, ...]) -> np.ndarray:
        return np.array([values]).T if self.along == "x" else np.array([values])


@part("clay.")
class Grid(CellLaw):
    """Damping b of one axis on a grid of cells, constant in each.

    Equal neighbouring cells have no border: no step ends there, no crossing is reported.

    Attributes:
        x_edges: borders along x [m], ascending, shape (n,).
        y_edges: borders along y [m], ascending, shape (m,).
        values: b in each cell [N.s/m], shape (n + 1, m + 1), 0 to 1e9; cell (i, j) lies between
            x_edges i - 1 and i and y_edges j - 1 and j; the outer cells have no end.
        growth: rate at which b of each cell grows from when the handle first enters it
            [N.s/m per s], as values, 0 to 1e9; empty for none.
        Fy: yield force of each cell [N], as values, 0 to 1e6; empty for none.
        K: consistency of each cell [N/(m/s)^n], as values, 0 to 1e6; empty for none.
        n: flow index of each cell, as values, 0.05 to 4; empty for 1, and without K.
    """

    x_edges: Edges
    y_edges: Edges
    values: Annotated[tuple[tuple[Real, ...], ...], Bound(0.0, B_MAX, "N.s/m")]
    growth: Annotated[tuple[tuple[Real, ...], ...], Bound(0.0, B_MAX, "N.s/m per s")] = ()
    Fy: Annotated[tuple[tuple[Real, ...], ...], YieldForce] = ()
    K: Annotated[tuple[tuple[Real, ...], ...], Consistency] = ()
    n: Annotated[tuple[tuple[float, ...], ...], FlowIndex] = ()

    def __post_init__(self):
        check_ascending("clay.x_edges", self.x_edges)
        check_ascending("clay.y_edges", self.y_edges)
        shape = len(self.x_edges) + 1, len(self.y_edges) + 1
        for name in ("values", *OPTIONAL):
            table = getattr(self, name)
            got = len(table), len(table[0]) if table else 0
            if got != shape and (name == "values" or table):
                bound = f"must have shape {shape}, one more than borders each way, has {got}"
                raise ParameterError(f"clay.{name}", table, bound)
        _drop_zeros(self)

    @property
    def borders(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Borders along x and along y [m]."""
        return self.x_edges, self.y_edges

    @functools.cached_property
    def damping(self) -> np.ndarray:
        """Damping on entry, one row of cells along y per cell along x [N.s/m], shape (n, m)."""
        return np.array(self.values)

    @functools.cached_property
    def rates(self) -> np.ndarray:
        """Growth rates of the damping [N.s/m per s], as damping."""
        return np.array(self.growth) if self.growth else np.zeros(self.damping.shape)

    @functools.cached_property
    def flows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Yield force [N], consistency [N/(m/s)^n] and flow index, each as damping."""
        shape = self.damping.shape
        Fy, K, n = (
            np.array(x) if x else np.full(shape, usual)
            for x, usual in zip(*_flow_of(self), strict=True)
        )
        return Fy, K, n

    @property
    def along(self) -> str:
        """Coordinates that decide, "x", "y" or "xy"."""
        return "".join(a for a, e in zip(AXES, self.borders, strict=True) if e) or "x"

    @classmethod
    @checked
    def of_function(
        cls,
        b: Callable[[float, float], float],
        x_edges: Edges,
        y_edges: Edges,
        outside: Outside = 0.0,
    ) -> Grid:
        """Makes a grid with the values of a function at the centres of its cells.

        Args:
            b: damping at a place (x, y) [m] [N.s/m].
            x_edges: borders along x [m], two or more; the first and the last are the outline.
            y_edges: the same along y.
            outside: b beyond the outline [N.s/m].

        Raises:
            ParameterError: there are fewer than two borders, or a value of the function is out of
                bounds.
        """
        both = {"clay.x_edges": x_edges, "clay.y_edges": y_edges}
        for field, edges in both.items():
            if len(edges) < 2:
                raise ParameterError(field, edges, "must have at least two edges per axis")
        middles = [[0.5 * (a + b) for a, b in zip(e, e[1:], strict=False)] for e in both.values()]
        inner = [[b(at, across) for across in middles[1]] for at in middles[0]]
        return cls(x_edges, y_edges, _framed(inner, outside))

    @classmethod
    @checked
    def of_image(
        cls,
        image: Image,
        x: Span,
        y: Span,
        b: BlackWhite,
        outside: Outside = 0.0,
    ) -> Grid:
        """Makes a grid with one cell per pixel of an image; see also `gray_image`.

        Args:
            image: brightness from 0 (black) to 1 (white), shape (rows, columns); the first row is
                at the largest y.
            x: where the image begins and ends along x [m].
            y: the same along y.
            b: damping at black and at white [N.s/m].
            outside: b beyond the image [N.s/m].

        Raises:
            ParameterError: the image is not a table of numbers from 0 to 1, or another argument
                is out of bounds.
        """
        check_outline(x, y)
        inner = pixels(image, b)
        columns, rows = inner.shape
        edges = np.linspace(*x, columns + 1), np.linspace(*y, rows + 1)
        along_x, along_y = (tuple(e.tolist()) for e in edges)
        return cls(along_x, along_y, _framed(inner, outside))


def _flow_of(law: Profile | Grid) -> tuple[Any, tuple[float, float, float]]:
    """Fy, K and n of a law, with defaults for omitted values."""
    return (law.Fy, law.K, law.n), (0.0, 0.0, 1.0)


def _drop_zeros(law: Profile | Grid) -> None:
    """Empties values without effect, so that equivalent laws compare equal; refuses n without K."""
    if not law.K and law.n and np.any(np.array(law.n) != 1.0):
        raise ParameterError("clay.n", law.n, "must be empty without K")
    for name in ("growth", "Fy", "K"):
        given = getattr(law, name)
        if given and not (any(given) if isinstance(law, Profile) else np.any(given)):
            object.__setattr__(law, name, ())
    if not law.K and law.n:
        object.__setattr__(law, "n", ())


def check_outline(x: tuple[float, float], y: tuple[float, float], prefix: str = "") -> None:
    """Refuses an outline [m] that does not ascend."""
    check_ascending(f"{prefix}x", x)
    check_ascending(f"{prefix}y", y)


def pixels(image: tuple[tuple[float, ...], ...], b: tuple[float, float]) -> np.ndarray:
    """Damping of the pixels of an image [N.s/m], starting at the lowest x and y, x first."""
    gray, (black, white) = np.array(image), b
    if not gray.size:
        raise ParameterError("image", image, "must have pixels")
    return ((1.0 - gray) * black + gray * white)[::-1].T


def _framed(inner: Any, outside: float) -> Any:
    """The damping of cells within a frame of outer cells."""
    return np.pad(np.asarray(inner), 1, constant_values=outside)


def check_ascending(field: str, edges: tuple[float, ...]) -> None:
    """Refuses borders [m] that do not ascend."""
    if any(b <= a for a, b in zip(edges, edges[1:], strict=False)):
        raise ParameterError(field, edges, "must be strictly ascending")
