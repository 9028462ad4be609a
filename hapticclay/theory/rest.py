"""What the equations of a sampled loop say at z = 1: where it rests, and what resists it there.

T(z) X = B e are the equations. A direction R c of rest has T(1) R = 0: its eigenvalue 1 is no
verdict. Along it the loop may move steadily, X = R c/(z - 1) + Y; what resists is L' T'(1) R with
L' T(1) = 0. Where that drag is singular an eigenvalue passes through 1: stability ends or begins
there without a motion on the unit circle.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from .. import matrices

FREE = 1e-9  # of the largest stiffness or drag: smaller ones are none
NO_DRAG = 1e-12  # of balanced equations
TURN = 1e-5  # of z: of differences of derivatives
STEP = 1e-30  # of a complex step: a derivative without rounding


class Rest:
    """Rest and steady motion of a loop.

    Attributes:
        equations: T(z), shape (k, k), analytic in z around 1.
        directions: in which it rests anywhere.
    """

    def __init__(self, equations: Callable[[complex], np.ndarray], directions: int):
        self.equations, self.directions = equations, directions

    @cached_property
    def _vectors(self) -> tuple[np.ndarray, np.ndarray]:
        """L and R: T(1) R = 0 and L' T(1) = 0, as many columns as directions of rest."""
        whole, rows, columns = balanced(self.equations(1.0).real)
        left, _, right = matrices.svd(whole)
        kept = len(whole) - self.directions
        return rows[:, None] * left[:, kept:], columns[:, None] * right[kept:].T

    def _slope(self, z: float = 1.0) -> np.ndarray:
        """T'(z)."""
        return self.equations(z + 1j * STEP).imag / STEP

    @cached_property
    def drag(self) -> np.ndarray:
        """Resistance to steady motion, L' T'(1) R: singular where a direction of rest has none."""
        L, R = self._vectors
        return L.T @ self._slope() @ R

    def resistance(self, pushed: slice, moved: slice) -> np.ndarray:
        """Push per sample's step of steady motion, whatever the basis of L and R.

        Args:
            pushed: equations in which the push stands.
            moved: unknowns that move.
        """
        L, R = self._vectors
        return np.linalg.solve(L[pushed].T @ R[moved], self.drag)

    @cached_property
    def free(self) -> int:
        """Directions of rest in which nothing resists steady motion: eigenvalues 1 once more."""
        if not self.directions:
            return 0
        size = matrices.singular_values(self.drag)
        return int(np.sum(size <= max(FREE * size[0], NO_DRAG)))

    def unresisted(self) -> np.ndarray:
        """Y of the steady motions X = R u/(z - 1) + Y that nothing resists, shape (k, free).

        T Y = -T' R u, where drag u = 0.
        """
        R = self._vectors[1]
        null = matrices.svd(self.drag)[2][self.directions - self.free :].T
        return self._beside(-self._slope() @ R @ null)

    def _beside(self, pushed: np.ndarray) -> np.ndarray:
        """The least Y of T(1) Y = pushed."""
        whole, rows, columns = balanced(self.equations(1.0).real)
        Y = matrices.least_squares(whole, rows[:, None] * pushed, FREE)
        return columns[:, None] * Y

    def trend(self, later: Rest) -> int:
        """What a change does where drag is singular: 1 if the real eigenvalue 1 leaves, else -1.

        With z = 1 + e and a change h of T: e (w' L' (T''/2 R u + T' X)) = -h w' dD/dh u, where
        D u = 0, w' D = 0 and T X = -T' R u.

        Args:
            later: the loop after a change.
        """
        L, R = self._vectors
        left, _, right = matrices.svd(self.drag)
        w, u = L @ left[:, -1], R @ right[-1]
        first = self._slope()
        second = (self._slope(1.0 + TURN) - self._slope(1.0 - TURN)) / (2.0 * TURN)
        X = matrices.least_squares(self.equations(1.0).real, -first @ u, FREE)
        change = later._slope() - first
        return 1 if (w @ (0.5 * second @ u + first @ X)) * (w @ change @ u) < 0.0 else -1

    def drift(self, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """R c and Y of the steady motion X = R c/(z - 1) + Y that constant inputs B keep up.

        T Y = B - T' R c. Shapes (k, m) each, of inputs (k, m).
        """
        L, R = self._vectors
        moved = R @ matrices.least_squares(self.drag, L.T @ inputs, NO_DRAG)
        return moved, self._beside(inputs - self._slope() @ moved)


class Resting:
    """What a loop behind whole samples of delay says of its rest and steady motion."""

    there: float
    back: float
    _rest: Any  # a Rest, which the loop keeps

    def between(self, there: float, back: float) -> Any:
        """The same loop behind other whole samples."""
        raise NotImplementedError

    @property
    def free(self) -> int:
        """Directions of rest in which nothing resists steady motion: eigenvalues 1 once more."""
        return self._rest.free

    def drag(self) -> np.ndarray:
        """Resistance to steady motion: singular where a direction of rest has none."""
        return self._rest.drag

    def steady_trend(self) -> int:
        """What one more sample does where drag is singular: 1 if the real eigenvalue 1 leaves."""
        return self._rest.trend(self.between(self.there + 1, self.back)._rest)


def balanced(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A matrix with rows and columns of like size, and their factors."""
    rows, columns = np.ones(len(matrix)), np.ones(matrix.shape[1])
    for _ in range(3):
        scaled = rows[:, None] * matrix * columns
        rows /= np.sqrt(_sizes(scaled, 1))
        columns /= np.sqrt(_sizes(scaled, 0))
    return rows[:, None] * matrix * columns, rows, columns


def _sizes(matrix: np.ndarray, axis: int) -> np.ndarray:
    largest = np.abs(matrix).max(axis)
    return np.where(largest > 0.0, largest, 1.0)
