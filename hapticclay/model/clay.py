"""Virtual clay: position-dependent viscous damping, fe = b(p) v (Eqs. 3, 4)."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import checked, named
from ..errors import Bound, ParameterError, check_fields, number, numbers_of, pair, table_of
from ..units import is_quantity
from . import flow, groove, spring
from .constants import AXES, B_MAX
from .flow import Consistency, Flow, FlowIndex, YieldForce
from .groove import Groove
from .spring import Spring
from .traits import (
    LEFT_OUT,
    Block,
    Column,
    Hold,
    Law,
    Refusal,
    Soft,
    Told,
    check_traits,
    multiplied,
    present,
    told_pair,
    told_values,
)


def halved_damping(b0, b1, L, R):
    """Damping in a kick of clay that a step cannot overshoot: half of a step's on either side.

    Args:
        b0: damping before the sample, (x, y) [N.s/m].
        b1: damping after the sample, (x, y) [N.s/m].
        L: share of the kick before the sample.
        R: share of the kick after the sample.

    Returns:
        Damping on the velocity before the kick, and on that after it, (x, y) each [N.s/m].
    """
    return (L * b0[0], L * b0[1]), (R * b1[0], R * b1[1])


def split_damping(b0, b1, H, L, R, W, damperx, dampery):
    """Splits the clay's damping in one kick between the velocities before and after it.

    A step gives half of its clay to the kick before it and half to the kick after it:
    Crank-Nicolson, second order. Where the half that acts on the velocity before the kick would
    overshoot, b h W > 2, it is reduced to the value that just stops the handle, and the kick before
    the step takes the rest. The two parts sum to b h, so the impulse of a step is exactly b times
    its distance. `slow_force` corrects the effect of the uneven split on slow motion.

    Args:
        b0: damping before the sample, (x, y) [N.s/m].
        b1: damping after the sample, (x, y) [N.s/m].
        H: length of the kick [s].
        L: share of the kick before the sample.
        R: share of the kick after the sample.
        W: largest acceleration per unit of force over all directions [1/kg].
        damperx: of the operator's arm, which acts beside the clay, x [N.s/m].
        dampery: the same, y [N.s/m].

    Returns:
        (x0, x1, y0, y1, stiff, sharex, sharey, softx, softy): fe = x0 v- + x1 v+ on x, y0 and y1 on
        y [N.s/m]; in stiff clay, fe is less by share times `slow_force`, which the next kick
        returns.
        stiff: 1.0 if any part is reduced, else 0.0. soft: 1/b [m/(N.s)] where both steps are stiff.
    """
    most = 1.0 / (H * W)
    (x0, y0), (x1, y1) = halved_damping(b0, b1, L, R)
    stiff, sharex, sharey, softx, softy = 0.0, 0.0, 0.0, 0.0, 0.0
    if x0 > most or y0 > most or x1 > most or y1 > most:
        stiff = 1.0
        if x1 > most:
            sharex = (x1 - most) / (b1[0] + damperx)
            softx = 1.0 / b1[0] if x0 > most else 0.0
            x1 += x1 - most
        if y1 > most:
            sharey = (y1 - most) / (b1[1] + dampery)
            softy = 1.0 / b1[1] if y0 > most else 0.0
            y1 += y1 - most
        x0, y0 = min(x0, most), min(y0, most)
    return x0, x1, y0, y1, stiff, sharex, sharey, softx, softy


def slow_force(g, W, share, f):
    """Force of stiff clay on a handle in slow motion that nothing else supports.

    Args:
        g: acceleration of the handle without clay, (x, y) [m/s^2].
        W: acceleration per unit of force, (xx, xy, yy) [1/kg].
        share: from `split_damping`, (x, y); nonzero where the clay is stiff.
        f: clay force where the clay is not stiff, (x, y) [N].

    Returns:
        (x, y) [N].
    """
    (gx, gy), (xx, xy, yy) = g, W
    if share[0] and share[1]:
        det = xx * yy - xy * xy
        x = (yy * gx - xy * gy) / det
        y = (xx * gy - xy * gx) / det
    else:
        x = (gx - xy * f[1]) / xx
        y = (gy - xy * f[0]) / yy
    return x, y


def rotated_force(c, s, bx, by, vx, vy):
    """Force of clay with rotated axes, fe = R diag(bx, by) R' v.

    Args:
        c: cosine of the angle by which its axes are rotated.
        s: sine of that angle.
        bx: damping along its first axis [N.s/m].
        by: damping along its second axis [N.s/m].
        vx: velocity, x [m/s].
        vy: velocity, y [m/s].

    Returns:
        (fex, fey) [N].
    """
    first, second = bx * (c * vx + s * vy), by * (c * vy - s * vx)
    return c * first - s * second, s * first + c * second


def rotated_damping(c, s, bx, by):
    """The damping tensor of clay with rotated axes, R diag(bx, by) R'.

    Args:
        c: cosine of the angle by which its axes are rotated.
        s: sine of that angle.
        bx: damping along its first axis [N.s/m].
        by: damping along its second axis [N.s/m].

    Returns:
        (xx, yy, xy) [N.s/m].
    """
    return c * c * bx + s * s * by, s * s * bx + c * c * by, c * s * (bx - by)


@checked
def slab(resists: float | Flow, start: float | None = None, end: float | None = None) -> Clay:
    """A slab across the x axis that resists motion along both axes alike (Sec. 4.1).

    Args:
        resists: damping [N.s/m], 0 to 1e9, or a flow, whose force is then opposite to the motion.
        start: lower border on x [m]; None for clay without borders.
        end: upper border on x [m], given with start.

    Returns:
        The clay.

    Raises:
        ParameterError: a value is out of bounds, or one border alone is given.
    """
    if (start is None) != (end is None):
        raise ParameterError("end", end, f"must be a border where start is one: start = {start}")
    if isinstance(resists, str) and not is_quantity(resists):
        bound = f"must be a damping, or a flow as hc.materials.material({resists!r}) returns"
        raise ParameterError("resists", resists, bound)
    flow = (
        resists
        if isinstance(resists, Flow)
        else Flow(b=number("b", resists, 0.0, B_MAX, unit="N.s/m"))
    )
    edges = () if start is None or end is None else (start, end)

    def of(x: float, outside: float = 0.0) -> tuple[float, ...]:
        return (outside, x, outside) if edges else (x,)

    n = of(flow.n, 1.0) if flow.K else ()
    profile = Profile(edges, of(flow.b), Fy=of(flow.Fy), K=of(flow.K), n=n)
    return Clay(profile, profile, isotropic=profile.yields)


def extent(clay: Clay | None, i: int) -> list[tuple[float, float]]:
    """Intervals of coordinate i that contain clay on the evidence of that coordinate alone.

    Args:
        clay: the clay; None for none.
        i: coordinate, 0 for x, 1 for y.

    Returns:
        Disjoint intervals (low, high) [m], ascending, possibly infinite.
    """
    out: list[tuple[float, float]] = []
    for law in clay.laws if clay else ():
        if AXES[i] in law.along:
            edges = (-math.inf, *law.lines[i], math.inf)
            some = np.any(law.some, axis=1 - i)
            out += [(edges[k], edges[k + 1]) for k in np.flatnonzero(some).tolist()]
    merged: list[tuple[float, float]] = []
    for low, high in sorted(out):
        if merged and low <= merged[-1][1]:
            low, high = merged[-1][0], max(high, merged[-1][1])
            merged.pop()
        merged.append((low, high))
    return merged


def damping_at(
    base: tuple[float, float], rate: tuple[float, float], t: float
) -> tuple[float, float]:
    """Damping at a time, b = base + rate t, at most B_MAX.

    Args:
        base: damping at t = 0, (x, y) [N.s/m].
        rate: growth, (x, y) [N.s/m per s].
        t: time [s].

    Returns:
        (x, y) [N.s/m].
    """
    x, y = base
    if rate[0] or rate[1]:
        x, y = min(x + rate[0] * t, B_MAX), min(y + rate[1] * t, B_MAX)
    return x, y


def smooth_damping(table, at, x, y):
    """Damping at a place by a cubic B-spline in each coordinate; its tangents are continuous.

    Never below the least of its control points nor above the largest.

    Args:
        table: from `regions.region_table`; at `at` it holds `Smooth.numbers`.
        at: where in it.
        x: place, x [m].
        y: place, y [m].

    Returns:
        [N.s/m].
    """
    most, rows = table[at + 2], table[at + 5]
    u = (x - table[at]) * table[at + 1]
    v = (y - table[at + 3]) * table[at + 4]
    # beyond, all four control points are alike; NaN is put there too
    u = 0.0 if not u > 0.0 else most if u > most else u
    v = 0.0 if not v > 0.0 else rows if v > rows else v
    i, j = int(u), int(v)
    u, v = u - i, v - j
    n = int(rows) + 4
    a = at + 6 + i * n + j
    b = a + n
    c = b + n
    d = c + n
    w = 1.0 - v
    k0, k3 = w * w * w, v * v * v
    k1 = 4.0 - 6.0 * v * v + 3.0 * k3
    k2 = 6.0 - k0 - k1 - k3
    w = 1.0 - u
    h0, h3 = w * w * w, u * u * u
    h1 = 4.0 - 6.0 * u * u + 3.0 * h3
    h2 = 6.0 - h0 - h1 - h3
    return (
        h0 * (k0 * table[a] + k1 * table[a + 1] + k2 * table[a + 2] + k3 * table[a + 3])
        + h1 * (k0 * table[b] + k1 * table[b + 1] + k2 * table[b + 2] + k3 * table[b + 3])
        + h2 * (k0 * table[c] + k1 * table[c + 1] + k2 * table[c + 2] + k3 * table[c + 3])
        + h3 * (k0 * table[d] + k1 * table[d + 1] + k2 * table[d + 2] + k3 * table[d + 3])
    ) / 36.0


OPTIONAL = ("growth", "Fy", "K", "n")  # of each region or cell, beside values


class CellLaw:
    """What the laws of one axis share: damping that is constant in each cell of a grid.

    They have `borders`, `damping`, `rates` and `along`, as `Grid`.
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
        """Whether it has a yield force or a consistency anywhere."""
        return bool(self.Fy or self.K)

    def at(self: Any, x: Any, y: Any) -> np.ndarray:
        """Damping at some places, growth aside [N.s/m].

        Args:
            x: coordinates [m].
            y: the same along y.
        """
        return self.damping[self.index(x, y)]

    def flows_at(self: Any, x: Any, y: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Yield force [N], consistency [N/(m/s)^n] and flow index at some places.

        Args:
            x: coordinates [m].
            y: the same along y.
        """
        cell = self.index(x, y)
        Fy, K, n = (part[cell] for part in self.flows)
        return Fy, K, n

    def index(self: Any, x: Any, y: Any) -> tuple[Any, Any]:
        """Cells of some places; on a line between them, the one beyond it.

        Args:
            x: coordinates [m].
            y: the same along y.

        Returns:
            Indices along x and along y.
        """
        at = zip(self.lines, (x, y), strict=True)
        i, j = (np.searchsorted(edges, place, side="right") for edges, place in at)
        return i, j

    def forces(self: Any, speed: float, dent: float) -> np.ndarray:
        """Force of each cell on a tool, growth aside [N], shape (n, m).

        Args:
            speed: of the tool [m/s].
            dent: how far the tool has gone into the cell [m].
        """
        some = dict.fromkeys(x.force for x in LAWS if x.force)
        return functools.reduce(np.add, [force(self, speed, dent) for force in some])

    def forces_at(self: Any, x: Any, y: Any, speed: float, dent: float) -> np.ndarray:
        """As `forces`, at some places.

        Args:
            x: coordinates [m].
            y: the same along y.
            speed: of the tool [m/s].
            dent: how far the tool has gone into the cell [m].
        """
        return self.forces(speed, dent)[self.index(x, y)]

    def within(self: Any, low: tuple[float, float], high: tuple[float, float]) -> list[float]:
        """Damping of the cells in a box [N.s/m].

        Args:
            low: its lowest corner [m].
            high: its highest corner [m].
        """
        (i, j), (k, m) = self.index(*low), self.index(*high)
        return self.damping[i : k + 1, j : m + 1].ravel().tolist()


@named
@dataclass(frozen=True)
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

    edges: Annotated[tuple[float, ...], Bound(unit="m")]
    values: Annotated[tuple[float, ...], Bound(0.0, B_MAX, "N.s/m")]
    along: Literal["x", "y"] = "x"
    growth: Annotated[tuple[float, ...], Bound(0.0, B_MAX, "N.s/m per s")] = ()
    Fy: Annotated[tuple[float, ...], YieldForce] = ()
    K: Annotated[tuple[float, ...], Consistency] = ()
    n: Annotated[tuple[float, ...], FlowIndex] = ()
    springs: tuple[Spring, ...] = ()

    def __post_init__(self):
        check_fields(self, "clay.")
        regions = range(len(self.edges) + 1)
        if self.springs and len(self.springs) != len(regions):
            bound = f"must be {len(regions)} springs, one a region, got {len(self.springs)}"
            raise ParameterError("clay.springs", self.springs, bound)
        if not any(x.k or x.k1 for x in self.springs):
            object.__setattr__(self, "springs", ())
        for name in ("values", *OPTIONAL):
            given = getattr(self, name)
            if len(given) != len(regions) and (given or name == "values"):
                numbers_of(f"clay.{name}", given, [str(i) for i in regions])  # tells what is amiss
        check_ascending("clay.edges", self.edges)
        _leave_out(self)

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


@named
@dataclass(frozen=True)
class Grid(CellLaw):
    """Damping b of one axis on a grid of cells, constant in each.

    A border between cells alike is none: no step ends on it, and no crossing is reported.

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

    x_edges: Annotated[tuple[float, ...], Bound(unit="m")]
    y_edges: Annotated[tuple[float, ...], Bound(unit="m")]
    values: Annotated[tuple[tuple[float, ...], ...], Bound(0.0, B_MAX, "N.s/m")]
    growth: Annotated[tuple[tuple[float, ...], ...], Bound(0.0, B_MAX, "N.s/m per s")] = ()
    Fy: Annotated[tuple[tuple[float, ...], ...], YieldForce] = ()
    K: Annotated[tuple[tuple[float, ...], ...], Consistency] = ()
    n: Annotated[tuple[tuple[float, ...], ...], FlowIndex] = ()

    def __post_init__(self):
        check_fields(self, "clay.")
        check_ascending("clay.x_edges", self.x_edges)
        check_ascending("clay.y_edges", self.y_edges)
        shape = len(self.x_edges) + 1, len(self.y_edges) + 1
        for name in ("values", *OPTIONAL):
            table = getattr(self, name)
            got = len(table), len(table[0]) if table else 0
            if got != shape and (name == "values" or table):
                bound = f"must have shape {shape}, one more than borders each way, has {got}"
                raise ParameterError(f"clay.{name}", table, bound)
        _leave_out(self)

    @property
    def borders(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Borders along x and along y [m]."""
        return self.x_edges, self.y_edges

    @functools.cached_property
    def damping(self) -> np.ndarray:
        """Damping on entry, a line of cells along y for each along x [N.s/m], shape (n, m)."""
        return np.array(self.values)

    @functools.cached_property
    def rates(self) -> np.ndarray:
        """Rates at which it grows [N.s/m per s], as damping."""
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
    def of_function(
        cls,
        b: Callable[[float, float], float],
        x_edges: Sequence[float],
        y_edges: Sequence[float],
        outside: float = 0.0,
    ) -> Grid:
        """A grid with the values of a function at the centres of its cells.

        Args:
            b: damping at a place (x, y) [m] [N.s/m].
            x_edges: borders along x [m], two or more; the first and the last are the outline.
            y_edges: the same along y.
            outside: b beyond the outline [N.s/m].

        Raises:
            ParameterError: there are fewer borders than two, or the function has a value that is
                out of bounds.
        """
        names = ("clay.x_edges", x_edges), ("clay.y_edges", y_edges)
        x, y = (
            numbers_of(field, edges, [str(i) for i in range(len(edges))], unit="m")
            for field, edges in names
        )
        for field, edges in names:
            if len(edges) < 2:
                raise ParameterError(field, edges, "must be two borders or more, an outline")
        middles = [[0.5 * (a + b) for a, b in zip(e, e[1:], strict=False)] for e in (x, y)]
        inner = [[b(at, across) for across in middles[1]] for at in middles[0]]
        return cls(x, y, _framed(inner, outside))

    @classmethod
    def of_image(
        cls,
        image: Any,
        x: tuple[float, float],
        y: tuple[float, float],
        b: tuple[float, float],
        outside: float = 0.0,
    ) -> Grid:
        """A grid with a cell for each pixel of an image; see also `gray_image`.

        Args:
            image: brightness from 0 (black) to 1 (white), shape (rows, columns); the first row is
                that of the largest y.
            x: where the image begins and ends along x [m].
            y: the same along y.
            b: damping at black and at white [N.s/m].
            outside: b beyond the image [N.s/m].

        Raises:
            ParameterError: the image is no table of numbers from 0 to 1, or another argument is out
                of bounds.
        """
        (x0, x1), (y0, y1) = _outline(x, y)
        inner = _pixels(image, b)
        columns, rows = inner.shape
        edges = np.linspace(x0, x1, columns + 1), np.linspace(y0, y1, rows + 1)
        along_x, along_y = (tuple(e.tolist()) for e in edges)
        return cls(along_x, along_y, _framed(inner, outside))


@named
@dataclass(frozen=True)
class Smooth(CellLaw):
    """Damping b of one axis that changes smoothly with the place, by a cubic B-spline.

    The values are control points at the nodes of an even grid: b is a mean of the sixteen around a
    place, never below the least of them nor above the largest, twice continuously differentiable,
    and constant from one spacing beyond the outline on. It has no borders: no step ends in it.

    Attributes:
        x: first and last node along x [m], ascending.
        y: first and last node along y [m], ascending.
        values: control points [N.s/m], shape (n, m), 0 to 1e9; b is the same all along an axis with
            one node.
    """

    x: Annotated[tuple[float, float], Bound(unit="m")]
    y: Annotated[tuple[float, float], Bound(unit="m")]
    values: Annotated[tuple[tuple[float, ...], ...], Bound(0.0, B_MAX, "N.s/m")]

    def __post_init__(self):
        check_fields(self, "clay.")
        _outline(self.x, self.y, "clay.")
        if not self.values or not self.values[0]:
            raise ParameterError("clay.values", self.values, "must have a node or more each way")

    borders = ((), ())
    growth = Fy = K = springs = ()

    @functools.cached_property
    def damping(self) -> np.ndarray:
        """The control points, a line along y for each along x [N.s/m], shape (n, m)."""
        return np.array(self.values)

    @property
    def rates(self) -> np.ndarray:
        """As `Grid.rates`: zeros."""
        return np.zeros(self.damping.shape)

    @property
    def flows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `Grid.flows`: it does not yield."""
        none = np.zeros(self.damping.shape)
        return none, none, none + 1.0

    def flows_at(self, x: Any, y: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `Grid.flows_at`: it does not yield.

        Args:
            x: coordinates [m].
            y: the same along y.
        """
        none = np.zeros(np.broadcast(x, y).shape)
        return none, none, none + 1.0

    @property
    def along(self) -> str:
        """As `Grid.along`."""
        return "".join(a for a, n in zip(AXES, self.damping.shape, strict=True) if n > 1) or "x"

    @functools.cached_property
    def numbers(self) -> np.ndarray:
        """What `smooth_damping` takes.

        Along x, then along y: begin [m], nodes per length [1/m], intervals; control points, with
        those of the outline beyond it: two lines before the first node, three behind the last.
        """
        head = []
        for (low, high), n in zip((self.x, self.y), self.damping.shape, strict=True):
            per = (n - 1) / (high - low)
            head += [low - 1.0 / per if per else low, per, n + 1.0]
        return np.append(head, np.pad(self.damping, ((2, 3), (2, 3)), mode="edge"))

    @property
    def lines(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Knots along x and along y [m]: the nodes, and one more at each end."""
        begin_x, per_x, most_x, begin_y, per_y, most_y = self.numbers[:6].tolist()
        ways = (begin_x, per_x, most_x), (begin_y, per_y, most_y)
        x, y = (
            tuple(low + k / per for k in range(int(most) + 1)) if per else ()
            for low, per, most in ways
        )
        return x, y

    @property
    def some(self) -> np.ndarray:
        """Whether there is clay between the knots, shape (n + 3, m + 3), or 1 where n or m is."""
        near = np.pad(self.damping, 3, mode="edge")
        n, m = (len(e) + 1 for e in self.lines)
        windows = np.lib.stride_tricks.sliding_window_view(near, (4, 4))[:n, :m]
        return windows.max(axis=(2, 3)) > 0.0

    def at(self, x: Any, y: Any) -> np.ndarray:
        """Damping at some places [N.s/m].

        Args:
            x: coordinates [m].
            y: the same along y.
        """
        numbers: Any = self.numbers
        table = memoryview(numbers)
        return np.vectorize(lambda x, y: smooth_damping(table, 0, x, y), otypes=[float])(x, y)

    def forces_at(self, x: Any, y: Any, speed: float, dent: float) -> np.ndarray:
        """As `Grid.forces_at`: it is damping alone.

        Args:
            x: coordinates [m].
            y: the same along y.
            speed: of the tool [m/s].
            dent: has no effect.
        """
        return speed * self.at(x, y)

    def within(self, low: tuple[float, float], high: tuple[float, float]) -> list[float]:
        """Control points of the damping in a box [N.s/m].

        Args:
            low: its lowest corner [m].
            high: its highest corner [m].
        """
        (i, j), (k, m) = self.index(*low), self.index(*high)
        last = np.array(self.damping.shape) - 1
        first, end = np.clip((i - 3, j - 3), 0, last), np.clip((k, m), 0, last) + 1
        return self.damping[first[0] : end[0], first[1] : end[1]].ravel().tolist()

    @classmethod
    def of_function(
        cls,
        b: Callable[[float, float], float],
        x: tuple[float, float],
        y: tuple[float, float],
        nodes: tuple[int, int],
    ) -> Smooth:
        """Smooth clay whose control points are the values of a function at its nodes.

        Args:
            b: damping at a place (x, y) [m] [N.s/m].
            x: first and last node along x [m].
            y: the same along y.
            nodes: how many there are along x and along y, one or more.

        Raises:
            ParameterError: an argument, or a value of the function, is out of bounds.
        """
        ends = _outline(x, y)
        count = pair("nodes", nodes, 1.0, 1e6)
        for name, k in zip(AXES, count, strict=True):
            if k != int(k):
                raise ParameterError(f"nodes[{name}]", k, "must be a whole number")
        at_x, at_y = (np.linspace(*e, int(k)).tolist() for e, k in zip(ends, count, strict=True))
        return cls(*ends, tuple(tuple(b(at, across) for across in at_y) for at in at_x))

    @classmethod
    def of_image(
        cls,
        image: Any,
        x: tuple[float, float],
        y: tuple[float, float],
        b: tuple[float, float],
    ) -> Smooth:
        """Smooth clay with a node at the centre of each pixel of an image; see also `gray_image`.

        Args:
            image: brightness from 0 (black) to 1 (white), shape (rows, columns); the first row is
                that of the largest y.
            x: where the image begins and ends along x [m].
            y: the same along y.
            b: damping at black and at white [N.s/m].

        Raises:
            ParameterError: the image is no table of numbers from 0 to 1, or another argument is out
                of bounds.
        """
        spans, values = _outline(x, y), _pixels(image, b)
        ends = []
        for (low, high), n in zip(spans, values.shape, strict=True):
            half = 0.5 * (high - low) / n if n > 1 else 0.0
            ends.append((low + half, high - half))
        return cls(ends[0], ends[1], values)  # pyright: ignore[reportArgumentType]


def _flow_of(law: Profile | Grid) -> tuple[Any, tuple[float, float, float]]:
    """Fy, K and n of a law as given, and what stands for those left out."""
    return (law.Fy, law.K, law.n), (0.0, 0.0, 1.0)


def _leave_out(law: Profile | Grid) -> None:
    """Empties what changes nothing, so that laws alike are equal; refuses n without any K."""
    if not law.K and law.n and np.any(np.array(law.n) != 1.0):
        raise ParameterError("clay.n", law.n, "must be empty without K")
    for name in ("growth", "Fy", "K"):
        given = getattr(law, name)
        if given and not (any(given) if isinstance(law, Profile) else np.any(given)):
            object.__setattr__(law, name, ())
    if not law.K and law.n:
        object.__setattr__(law, "n", ())


def _outline(
    x: tuple[float, float], y: tuple[float, float], prefix: str = ""
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Begin and end along x and along y [m], checked."""
    spans = pair(f"{prefix}x", x, unit="m"), pair(f"{prefix}y", y, unit="m")
    for field, span in zip(AXES, spans, strict=True):
        check_ascending(prefix + field, span)
    return spans


def _pixels(image: Any, b: tuple[float, float]) -> np.ndarray:
    """Damping of the pixels of an image [N.s/m], from the lowest x and y on, along x first."""
    gray = np.array(table_of("image", image, 0.0, 1.0))
    black, white = pair("b", b, 0.0, B_MAX, unit="N.s/m")
    if not gray.size:
        raise ParameterError("image", image, "must have pixels")
    return ((1.0 - gray) * black + gray * white)[::-1].T


def _framed(inner: Any, outside: float) -> Any:
    """Values of cells, with those of the outer cells around them."""
    value = number("outside", outside, 0.0, B_MAX, unit="N.s/m")
    return np.pad(np.asarray(inner), 1, constant_values=value)


def check_ascending(field: str, edges: tuple[float, ...]) -> None:
    """Refuses borders that do not ascend.

    Args:
        field: name for the error.
        edges: the borders [m].

    Raises:
        ParameterError: they do not.
    """
    if any(b <= a for a, b in zip(edges, edges[1:], strict=False)):
        raise ParameterError(field, edges, "must be strictly ascending")


NOTHING = Profile((), (0.0,))


def _yield_alike(x: Profile | Grid | Smooth, y: Profile | Grid | Smooth) -> bool:
    return x.borders == y.borders and all(map(np.array_equal, x.flows, y.flows))


@named
@dataclass(frozen=True)
class Clay:
    """Clay: fe = B v with B = R diag(bx, by) R' (Eqs. 3, 4 with m = k = 0, R = 1), or clay that
    also yields, with Fy_i sign v_i + K_i |v_i|^n_i sign v_i beside it along each axis.

    Attributes:
        x: law of motion along x, or along the clay's own first axis where they are rotated.
        y: law of motion along y, or along the clay's own second axis.
        angle: by which those axes are rotated from x and y, counterclockwise [rad], -pi to pi.
        isotropic: whether Fy and K, alike on both axes, resist along the motion whatever its
            direction, (Fy + K |v|^n) v/|v|; else each axis yields by itself.
        groove: a block of clay that stays cut, beside x and y, which then neither yield, grow nor
            spring back and are not smooth; None for none.
    """

    x: Profile | Grid | Smooth
    y: Profile | Grid | Smooth
    angle: Annotated[float, Bound(-math.pi, math.pi, "rad")] = 0.0
    isotropic: bool = False
    groove: Groove | None = None

    def __post_init__(self):
        check_fields(self, "clay.")
        x, y = self.laws
        if self.isotropic and not (x is y or _yield_alike(x, y)):
            raise ParameterError(
                "clay.isotropic", True, "must be False where Fy, K or n differ between the axes"
            )
        check_traits(present(self, LAWS), self, "clay.")

    @classmethod
    def of_groove(cls, groove: Groove) -> Clay:
        """Clay that stays cut, and none beside it.

        Args:
            groove: the block.
        """
        return cls(NOTHING, NOTHING, groove=groove)

    @property
    def laws(self) -> tuple[Profile | Grid | Smooth, Profile | Grid | Smooth]:
        """Of x and of y."""
        return self.x, self.y

    def laws_on(self, i: int) -> tuple[Profile | Grid | Smooth, ...]:
        """Laws that resist along an axis: both where the axes of the clay are rotated.

        Args:
            i: axis, 0 for x, 1 for y.
        """
        return self.laws if self.angle else self.laws[i : i + 1]

    @property
    def smooth(self) -> int:
        """Which axes have smooth clay: 0 for none, 1 for x, 2 for y, 3 for both."""
        return sum(k for k, law in zip((1, 2), self.laws, strict=True) if isinstance(law, Smooth))

    @property
    def along(self) -> str:
        """Coordinates that decide, "x", "y" or "xy"."""
        return "".join(a for a in AXES if any(a in law.along for law in self.laws))

    @property
    def edges(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Borders along x and along y [m], ascending."""
        x, y = (tuple(sorted({e for f in self.laws for e in f.borders[i]})) for i in (0, 1))
        return x, y

    @property
    def largest(self) -> float:
        """Largest damping, growth aside [N.s/m]."""
        most = float(max(law.damping.max() for law in self.laws))
        return most + self.groove.thickest if self.groove else most

    @property
    def fastest(self) -> float:
        """Largest rate at which it grows [N.s/m per s]."""
        return float(max(law.rates.max() for law in self.laws))

    @property
    def grows(self) -> bool:
        """Whether it grows anywhere."""
        return bool(self.x.growth or self.y.growth)

    @property
    def yields(self) -> bool:
        """Whether it has a yield force or a consistency anywhere; a groove has."""
        return self.x.yields or self.y.yields or self.groove is not None

    @property
    def springs(self) -> bool:
        """Whether it springs back anywhere."""
        return any(getattr(law, "springs", ()) for law in self.laws)

    def __getstate__(self) -> dict[str, Any]:
        # its fields alone: `kinds` is kept in the instance and holds functions, which do not pickle
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @functools.cached_property
    def kinds(self) -> tuple[Law, ...]:
        """The laws of LAWS that it has."""
        return tuple(present(self, LAWS))

    @property
    def viscous(self) -> bool:
        """Whether its force is damping times velocity, so that linear theory holds."""
        return all(x.viscous for x in self.kinds)

    def viscous_at(self, place: tuple[float, float]) -> bool:
        """Whether its force at a place is damping times velocity.

        Args:
            place: (x, y) [m].
        """
        return not any(x.here(self, place) for x in self.kinds if not x.viscous)

    @property
    def of_velocity(self) -> bool:
        """Whether its force follows from the velocity alone."""
        return all(x.of_velocity for x in self.kinds)

    @property
    def seen_in_b(self) -> bool:
        """Whether its damping tells its regions apart."""
        return all(x.seen_in_b for x in self.kinds)

    @property
    def along_motion(self) -> bool:
        """Whether it resists along the motion, whatever its direction."""
        return self.isotropic or any(x.along_motion for x in self.kinds)

    @property
    def varies(self) -> set[str]:
        """What the damping of a region varies over, "time", "place"; empty for one number each."""
        return {x.varies for x in self.kinds if x.varies}

    def resists_otherwise(self, i: int) -> bool:
        """Whether anything but damping times velocity resists along one of its axes.

        Args:
            i: axis, 0 for x, 1 for y.
        """
        return any(
            np.any(x.force(self.laws[i], 1.0, 1.0)) for x in self.kinds if x.force and not x.viscous
        )

    @property
    def holding(self) -> bool:
        """Whether it can hold a tool at rest somewhere."""
        return any(x.holds for x in self.kinds)

    def hold(self, i: int) -> Hold:
        """The strongest of what holds a tool at rest along an axis.

        Args:
            i: axis, 0 for x, 1 for y.
        """
        found = [x.holds(self, i) for x in self.kinds if x.holds]
        return max((x for x in found if x), key=lambda x: x.force, default=Hold(0.0))

    @property
    def blocks(self) -> list[Block]:
        """Rectangles of clay beside the laws of the axes."""
        return [block for x in self.kinds for block in x.blocks(self)]

    @property
    def ground(self) -> Any:
        """The cells that a tool cuts for good; None where it leaves the clay as it was."""
        return next((x.ground(self) for x in self.kinds if x.ground), None)

    @property
    def soft(self) -> list[Soft]:
        """What the steps of the fast method must resolve."""
        found = (x.soft(self) for x in self.kinds if x.soft)
        return [x for x in found if x]

    def scaled(self, factor: float) -> Clay:
        """Returns the same clay with a multiple of its damping, yield force and the like.

        Clay that yields goes on to do so, however little: a run cannot turn into one of other clay.

        Args:
            factor: on all of them, within their bounds.
        """
        return functools.reduce(lambda clay, kind: kind.scaled(clay, factor), self.kinds, self)

    @property
    def columns(self) -> list[Column]:
        """Quantities that tables show of a stretch beside its damping."""
        return list(dict.fromkeys(c for x in self.kinds for c in x.columns))

    def values_at(self, i: int, place: Any) -> dict[str, float]:
        """Values of `columns` at a place.

        Args:
            i: axis, 0 for x, 1 for y.
            place: (x, y) [m].
        """
        out: dict[str, float] = {}
        for kind in self.kinds:
            values = map(float, kind.at(self.laws[i], place))
            out |= dict(zip((c.name for c in kind.columns), values, strict=True))
        return out

    @property
    def words(self) -> list[Told]:
        """What it resists with over the whole scene."""
        return [x for kind in self.kinds for x in kind.words(self)] or [Told("b = {}", (0.0,))]

    def here(self, place: tuple[float, float], b: Any = None) -> list[Told]:
        """What it resists with at a place; empty where nothing resists.

        Args:
            place: (x, y) [m].
            b: damping there, along x and y [N.s/m]; None for that of `at`.
        """
        told = [x for kind in self.kinds for x in kind.here(self, place)]
        return [*told, *told_pair("b = {}", self.at(*place).tolist() if b is None else b, "N.s/m")]

    def at(self, x: Any, y: Any) -> np.ndarray:
        """Damping of both axes at some places, growth aside.

        Args:
            x: coordinates [m], any shape.
            y: coordinates [m], any shape that goes with it.

        Returns:
            [N.s/m], shape (2, ...).
        """
        b = self.x.at(x, y)
        return np.stack([b, b if self.y is self.x else self.y.at(x, y)])


_ACROSS = Refusal(
    "clay.angle", "must be 0 for a passivity controller or a coupling, which act along x and y"
)


def _damping_values(clay: Clay) -> list[float]:
    return [v for law in clay.laws for v in law.damping.ravel().tolist()]


def _rates(clay: Clay) -> list[float]:
    return [v for law in clay.laws for v in law.rates.ravel().tolist()]


def _scaled(name: str) -> Callable[[Clay, float], Clay]:
    """What multiplies a quantity of the laws of both axes."""

    def of(law: Any, factor: float) -> Any:
        given = getattr(law, name)
        return replace(law, **{name: multiplied(given, factor, B_MAX)}) if given else law

    return lambda clay, factor: replace(clay, x=of(clay.x, factor), y=of(clay.y, factor))


def _soft(clay: Clay) -> Soft:
    most = max(float(x.damping.max()) for x in clay.laws if isinstance(x, Smooth))
    return Soft(most, "smooth clay", "; or integrator 'accurate', or clay of cells")


TRAITS = (
    Law(
        "viscous", "clay", lambda c: any(x.damping.any() for x in c.laws),
        words=lambda c: told_values("b = {}", _damping_values(c), "N.s/m"),
        force=lambda law, speed, _: law.damping * speed, scaled=_scaled("values"),
    ),
    Law(
        "growth", "clay", lambda c: c.grows, LEFT_OUT, seen_in_b=False, varies="time",
        words=lambda c: told_values("grows by {}", _rates(c), "N.s/m per s"),
        scaled=_scaled("growth"),
    ),
    Law("cells", "clay", lambda c: any(isinstance(x, Grid) for x in c.laws)),
    Law(
        "smooth", "clay", lambda c: bool(c.smooth), seen_in_b=False, varies="place", soft=_soft,
    ),
    Law(
        "rotated axes", "clay", lambda c: c.angle != 0.0,
        refuses={"passivity controller": _ACROSS, "virtual coupling": _ACROSS},
        words=lambda c: told_values("axes rotated by {}", (math.degrees(c.angle),), "degrees"),
    ),
)  # fmt: skip
LAWS: tuple[Law, ...] = (*groove.TRAITS, *flow.TRAITS, *TRAITS, *spring.TRAITS)
"""In the order in which texts tell them."""
