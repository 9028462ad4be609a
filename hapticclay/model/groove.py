"""Clay that stays cut: the remainder of a block on a grid, and its force on a tool."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real
from ..formulas.constants import B_MAX
from .constants import AXES
from .flow import FY_MAX
from .materials import SMALL_TOOL, material
from .tool import Tool
from .traits import LEAST, LEFT_OUT, Block, Hold, Law, Quantity, Refusal, Soft

CELLS = 20  # default number of cells in the width of the tool
COARSEST = 8  # fewest cells in that width
MOST_CELLS = 4_000_000


@part("groove.")
class Groove:
    """A block of clay that stays cut: a tool at the handle removes the clay under it.

    The tool is a disc that cuts down to a floor. The block is a grid of cells. The share of each
    cell under the tool is removed; the edge of the tool is spread over two cells on each side. The
    clay in front of the tool resists along the motion with its pressure times its cross-section.
    It also holds a tool at rest: in fresh clay with (pressure + gradient depth/2) width depth.

    Attributes:
        x: where the block begins and ends along x [m], ascending.
        y: the same along y [m].
        pressure: force per cross-section of the cut, at the surface [Pa], 0 to 1e8.
        gradient: by which it grows with the depth below the surface [Pa/m], 0 to 1e10.
        damping: force per cross-section and speed, that is per volume rate [N.s/m^3], 0 to 1e12.
        tool: width of the disc, and depth of the cut; 10 mm and 5 mm by default.
        cells: how many there are along x and along y, 8 or more in the width of the tool; None for
            20 in it.
        heights: of the clay above the floor of the cut [m], a line along y for each cell along x,
            0 to 0.1; empty where it is flat, tool.depth everywhere.
        left: remaining share of each cell, as heights, 0 to 1; empty for a whole block.
    """

    x: Annotated[tuple[Real, Real], Bound(unit="m")]
    y: Annotated[tuple[Real, Real], Bound(unit="m")]
    pressure: Annotated[Real, Bound(0.0, 1e8, "Pa")] = 0.0
    gradient: Annotated[Real, Bound(0.0, 1e10, "Pa/m")] = 0.0
    damping: Annotated[Real, Bound(0.0, 1e12, "N.s/m^3")] = 0.0
    tool: Tool = SMALL_TOOL
    cells: Annotated[tuple[float, float] | None, Bound(1.0, 1e5)] = None
    heights: Annotated[tuple[tuple[Real, ...], ...], Bound(0.0, 0.1, "m")] = ()
    left: Annotated[tuple[tuple[float, ...], ...], Bound(0.0, 1.0)] = ()

    def __post_init__(self):
        for axis, (low, high) in zip(AXES, (self.x, self.y), strict=True):
            if high <= low:
                raise ParameterError(f"groove.{axis}", (low, high), "must be strictly ascending")
        for axis, n in zip(AXES, self.cells or (), strict=False):
            if n != int(n):
                raise ParameterError(f"groove.cells[{axis}]", n, "must be a whole number")
        (wx, wy), (n, m), most = self.sizes, self.shape, self.tool.width / COARSEST
        if max(wx, wy) > most * (1.0 + 1e-9):
            need = [math.ceil((b - a) / most - 1e-9) for a, b in (self.x, self.y)]
            bound = f"must be {need[0]} by {need[1]} or more, {COARSEST} in the tool's width"
            raise ParameterError("groove.cells", (n, m), bound)
        if n * m > MOST_CELLS:
            raise ParameterError("groove.cells", (n, m), f"must be at most {MOST_CELLS} in all")
        for name in ("heights", "left"):
            table = getattr(self, name)
            got = len(table), len(table[0]) if table else 0
            if table and got != (n, m):
                bound = f"must have shape {(n, m)}, one number per cell, has {got}"
                raise ParameterError(f"groove.{name}", table, bound)
        if not (self.pressure or self.gradient or self.damping):
            bound = "must be above 0 without gradient and damping: the block would not resist"
            raise ParameterError("groove.pressure", self.pressure, bound)
        if self.hardest > FY_MAX:
            bound = f"must give at most {FY_MAX:g} N, gives {self.hardest:.3g} N"
            raise ParameterError("groove.pressure", self.pressure, bound)
        if self.thickest > B_MAX:
            bound = f"must give at most {B_MAX:g} N.s/m, gives {self.thickest:.3g} N.s/m"
            raise ParameterError("groove.damping", self.damping, bound)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of cells along x and along y."""
        if self.cells:
            return int(self.cells[0]), int(self.cells[1])
        w = self.tool.width / CELLS
        n, m = (math.ceil((b - a) / w - 1e-9) for a, b in (self.x, self.y))
        return n, m

    @property
    def sizes(self) -> tuple[float, float]:
        """Of a cell, along x and along y [m]."""
        x, y = ((b - a) / n for (a, b), n in zip((self.x, self.y), self.shape, strict=True))
        return x, y

    @property
    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Borders between the cells, and those of the block, along x and along y [m]."""
        x, y = (
            np.linspace(a, b, n + 1) for (a, b), n in zip((self.x, self.y), self.shape, strict=True)
        )
        return x, y

    @functools.cached_property
    def relief(self) -> np.ndarray:
        """Height of each cell above the floor of the cut, before any cut [m], shape (n, m)."""
        return np.array(self.heights) if self.heights else np.full(self.shape, self.tool.depth)

    @functools.cached_property
    def shares(self) -> np.ndarray:
        """Remaining share of each cell, shape (n, m)."""
        return np.array(self.left) if self.left else np.ones(self.shape)

    @property
    def highest(self) -> float:
        """Largest height above the floor of the cut [m]."""
        return float(self.relief.max()) if self.heights else self.tool.depth

    @property
    def hardest(self) -> float:
        """Force on the tool when its whole width is engaged in the highest clay [N]."""
        mean = self.pressure + 0.5 * self.gradient * self.highest
        return mean * self.tool.width * self.highest

    @property
    def thickest(self) -> float:
        """Damping there [N.s/m]."""
        return self.damping * self.tool.width * self.highest

    @property
    def numbers(self) -> tuple[float, ...]:
        """Arguments of `cut`: start of the block (x, y) [m], sizes of a cell [m], numbers of cells,
        radius of the tool and the larger size of a cell [m], pressure [Pa], gradient [Pa/m].
        """
        (wx, wy), (n, m) = self.sizes, self.shape
        r, cell = 0.5 * self.tool.width, max(wx, wy)
        return (
            self.x[0], self.y[0], wx, wy, float(n), float(m), r, cell, self.pressure, self.gradient
        )  # fmt: skip

    @classmethod
    @checked
    def of_material(
        cls, name: str, x: tuple[float, float], y: tuple[float, float], tool: Tool = SMALL_TOOL
    ) -> Groove:
        """A block of a material with uniform pressure: that on the tool's face, Fy/(w d).

        Args:
            name: as for `material`.
            x: where the block begins and ends along x [m].
            y: the same along y.
            tool: the tool.

        Raises:
            ParameterError: there is no such material, or its force is not a pressure, because it
                depends on a power of the speed.
        """
        flow, face = material(name, tool), tool.width * tool.depth
        if flow.K:
            raise ParameterError("material", name, "must be without K |v|^n in clay that stays cut")
        return cls(x, y, pressure=flow.Fy / face, damping=flow.b / face, tool=tool)

    def volume(self, ground: Any = None) -> float:
        """Volume of the block, to rounding [m^3].

        Args:
            ground: remaining height of each cell, as Record.ground [m], shape (n, m); None
                for the initial block.
        """
        heights = self.relief * self.shares if ground is None else np.asarray(ground, float)
        wx, wy = self.sizes
        return math.fsum((heights * (wx * wy)).ravel().tolist())

    def after(self, ground: Any) -> Groove:
        """The block after a run.

        Args:
            ground: remaining height of each cell, as Record.ground [m], shape (n, m).

        Raises:
            ParameterError: the shape is wrong, or a cell is higher than the block.
        """
        relief, ground = self.relief, np.asarray(ground, dtype=float)
        if ground.shape != relief.shape:
            bound = f"must have shape {relief.shape}, has {ground.shape}"
            raise ParameterError("ground", ground, bound)
        shares = np.divide(ground, relief, out=np.ones(self.shape), where=relief > 0.0)
        return replace(self, left=shares)  # pyright: ignore[reportArgumentType]


_UNCUT = Refusal(
    "hardware", "must be without passivity controller and coupling in clay that stays cut"
)
_BESIDE = Refusal(
    "clay.groove", "must be None with laws that yield, grow, spring back or are smooth"
)


def _words(clay: Any) -> tuple[Quantity, ...]:
    return (Quantity("permanent cut, up to {}", (clay.groove.hardest,), "N"),)


def _here(clay: Any, place: tuple[float, float]) -> tuple[Quantity, ...]:
    """Its force where the tool touches it."""
    touched = _block(clay.groove).holds(*place, 0.5 * clay.groove.tool.width)
    return (Quantity("holds with up to {}", (clay.groove.hardest,), "N"),) * bool(touched)


def _block(groove: Groove) -> Block:
    return Block(groove.x, groove.y, groove.hardest, groove.thickest, groove.tool)


def _scaled(clay: Any, factor: float) -> Any:
    """The clay with its pressure and damping multiplied; it still resists."""
    groove = clay.groove
    most = min(FY_MAX / (groove.hardest or FY_MAX), B_MAX / (groove.thickest or B_MAX))
    k = min(max(factor, LEAST), most)
    names = "pressure", "gradient", "damping"
    return replace(clay, groove=replace(groove, **{x: k * getattr(groove, x) for x in names}))


TRAITS = (
    Law(
        "groove", "clay", lambda c: c.groove is not None, LEFT_OUT,
        {
            **dict.fromkeys(
                ("yield by axis", "yield along the motion", "growth", "smooth", "springs"), _BESIDE
            ),
            "accurate": Refusal("integrator", "must be 'fast' in clay that stays cut"),
            "passivity controller": _UNCUT,
            "virtual coupling": _UNCUT,
        },
        viscous=False, of_velocity=False, seen_in_b=False, words=_words, here=_here,
        holds=lambda c, _: Hold(c.groove.hardest, "the pressure", True),
        blocks=lambda c: (_block(c.groove),), ground=lambda c: c.groove,
        soft=lambda c: Soft(c.largest, "clay that stays cut"), scaled=_scaled,
    ),
)  # fmt: skip
