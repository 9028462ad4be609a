"""Damping that varies smoothly in space, by a cubic B-spline."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real
from ..formulas.constants import B_MAX
from ..formulas.smooth import smooth_damping
from .cells import BlackWhite, CellLaw, Image, Span, check_outline, pixels
from .constants import AXES


@part("clay.")
class Smooth(CellLaw):
    """Damping b of one axis that varies smoothly in space, by a cubic B-spline.

    The values are control points at the nodes of an even grid. At any place b is a weighted mean
    of the sixteen control points around it. So b stays within their range, is twice continuously
    differentiable, and is constant from one spacing beyond the outline on. There are no borders.

    Attributes:
        x: first and last node along x [m], ascending.
        y: first and last node along y [m], ascending.
        values: control points [N.s/m], shape (n, m), 0 to 1e9; b is the same all along an axis with
            one node.
    """

    x: Span
    y: Span
    values: Annotated[tuple[tuple[Real, ...], ...], Bound(0.0, B_MAX, "N.s/m")]

    def __post_init__(self):
        check_outline(self.x, self.y, "clay.")
        if not self.values or not self.values[0]:
            raise ParameterError("clay.values", self.values, "must have a node or more each way")

    borders = ((), ())
    growth = Fy = K = springs = ()

    @functools.cached_property
    def damping(self) -> np.ndarray:
        """The control points, one row along y per node along x [N.s/m], shape (n, m)."""
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
        none = np.zeros(np.broadcast(x, y).shape)
        return none, none, none + 1.0

    @property
    def along(self) -> str:
        """As `Grid.along`."""
        return "".join(a for a, n in zip(AXES, self.damping.shape, strict=True) if n > 1) or "x"

    @functools.cached_property
    def numbers(self) -> np.ndarray:
        """Arguments of `smooth_damping`.

        Along x, then along y: start [m], nodes per length [1/m], intervals; then control points,
        extended beyond the outline: two rows before the first node, three after the last.
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
        numbers: Any = self.numbers
        table = memoryview(numbers)
        return np.vectorize(lambda x, y: smooth_damping(table, 0, x, y), otypes=[float])(x, y)

    def forces_at(self, kinds: Any, x: Any, y: Any, speed: float, dent: float) -> np.ndarray:
        return speed * self.at(x, y)

    def within(self, low: tuple[float, float], high: tuple[float, float]) -> list[float]:
        (i, j), (k, m) = self.index(*low), self.index(*high)
        last = np.array(self.damping.shape) - 1
        first, end = np.clip((i - 3, j - 3), 0, last), np.clip((k, m), 0, last) + 1
        return self.damping[first[0] : end[0], first[1] : end[1]].ravel().tolist()

    @classmethod
    @checked
    def of_function(
        cls,
        b: Callable[[float, float], float],
        x: Span,
        y: Span,
        nodes: Annotated[tuple[float, float], Bound(1.0, 1e6)],
    ) -> Smooth:
        """Smooth clay whose control points are the values of a function at its nodes.

        Args:
            b: damping at a place (x, y) [m] [N.s/m].
            x: first and last node along x [m].
            y: the same along y.
            nodes: number of nodes along x and along y, one or more.

        Raises:
            ParameterError: an argument, or a value of the function, is out of bounds.
        """
        check_outline(x, y)
        for name, k in zip(AXES, nodes, strict=True):
            if k != int(k):
                raise ParameterError(f"nodes[{name}]", k, "must be a whole number")
        at_x, at_y = (np.linspace(*e, int(k)).tolist() for e, k in ((x, nodes[0]), (y, nodes[1])))
        return cls(x, y, tuple(tuple(b(at, across) for across in at_y) for at in at_x))

    @classmethod
    @checked
    def of_image(
        cls,
        image: Image,
        x: Span,
        y: Span,
        b: BlackWhite,
    ) -> Smooth:
        """Smooth clay with a node at the centre of each pixel of an image; see also `gray_image`.

        Args:
            image: brightness from 0 (black) to 1 (white), shape (rows, columns); the first row is
                at the largest y.
            x: where the image begins and ends along x [m].
            y: the same along y.
            b: damping at black and at white [N.s/m].

        Raises:
            ParameterError: the image is not a table of numbers from 0 to 1, or another argument
                is out of bounds.
        """
        check_outline(x, y)
        values, ends = pixels(image, b), []
        for (low, high), n in zip((x, y), values.shape, strict=True):
            half = 0.5 * (high - low) / n if n > 1 else 0.0
            ends.append((low + half, high - half))
        return cls(ends[0], ends[1], values)  # pyright: ignore[reportArgumentType]
