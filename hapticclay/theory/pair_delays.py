"""At which delays of its link a pair is stable, without states for messages on their way.

What goes around is H(z) = H_l H_f, and with N samples there and back an eigenvalue z of the pair is
where an eigenvalue of H is z^N. So it lies on the unit circle where an eigenvalue of H has size 1,
and N = arg/theta. With N growing it leaves the circle where that size falls with theta, and enters
where it rises: the number of unstable eigenvalues at any N follows from that at the least one. Rest
(z = 1) is crossed where steady motion loses its resistance, which is linear in N. Where an
eigenvalue of H is larger than 1 at z = -1, more and more eigenvalues of the pair come up there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .. import matrices
from . import joint_crossings, pair_branches
from .joint_loop import MOST_STATES, ROUNDING, near_resonances
from .pair_loop import PairLoop
from .rest import FREE, NO_DRAG

SLOWEST = 1e-6  # [rad] least angle of the search
NOISE = 1e-16  # of the logarithm of a size, times the square of the angle
TURN = 1e-6  # of an angle: of differences
EVEN, BY_FACTORS = 300, 300  # angles of the search
REAL = 1e-9  # imaginary part over size of an eigenvalue that counts as real
AXIS = 1e-6  # of a sample: how long an eigenvalue on the negative axis is one
AROUND = 9  # angles around an edge of another loop


class Edge(NamedTuple):
    """A number of samples there and back at which eigenvalues cross the circle.

    Attributes:
        samples: N, a real number.
        theta: their angle [rad]; 0 for steady motion.
        change: of the number of unstable eigenvalues.
    """

    samples: float
    theta: float
    change: int


class Delays:
    """A pair at all whole delays of its link.

    Attributes:
        loop: the pair with the least of them, one sample more than it was given where its steady
            motion meets no resistance without delay.
        least: samples there and back in it.
    """

    def __init__(self, loop: PairLoop):
        self.loop = loop.between(loop.there + 1, loop.back) if loop.free else loop
        self.least = self.loop.there + self.loop.back

    @cached_property
    def unstable(self) -> int:
        """Unstable eigenvalues at the least delay."""
        return int(np.sum(np.abs(self.loop.eigenvalues) > 1.0 + ROUNDING))

    @cached_property
    def angles(self) -> np.ndarray:
        """Angles of the search to begin with."""
        even = np.linspace(0.0, math.pi, EVEN + 1)[1:]
        found = [
            even,
            np.geomspace(SLOWEST, 1.0, BY_FACTORS),
            near_resonances(self.loop.open_poles()),
        ]
        if self.loop.states <= MOST_STATES // 3:
            found.append(near_resonances(self.loop.eigenvalues))
        every = np.concatenate(found)
        return np.unique(every[(every >= SLOWEST) & (every <= math.pi)])

    @cached_property
    def _crossings(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles at which an eigenvalue of H has size 1, its argument, and how its size moves."""
        theta, values = pair_branches.followed(self._values, self.angles, noise=NOISE)
        size = joint_crossings.log_size(values)
        # near rest H is 1 but for the square of the angle, and rounding, which grows as its inverse
        unclear = np.abs(size) * theta[:, None] ** 2 < NOISE
        side = np.where(unclear, 0.0, np.sign(size))
        for i in range(len(side) - 2, -1, -1):
            side[i] = np.where(side[i] == 0.0, side[i + 1], side[i])
        i, branch = np.nonzero(side[:-1] * side[1:] < 0.0)
        ends = (theta[i], theta[i + 1]), (values[i, branch], values[i + 1, branch])
        theta, x = joint_crossings.refined(self.loop.around, joint_crossings.log_size, *ends)
        slope = np.array([self._slope(*each) for each in zip(theta, x, strict=True)])
        return theta, np.angle(x), slope

    def _values(self, theta: np.ndarray) -> np.ndarray:
        return matrices.eigenvalues(self.loop.around(theta))

    def _slope(self, theta: float, x: complex) -> float:
        sides = []
        for turn in (1.0 - TURN, 1.0 + TURN):
            values = matrices.eigenvalues(self.loop.around(np.array([turn * theta])))[0]
            sides.append(abs(values[np.argmin(np.abs(values - x))]))
        return sides[1] - sides[0]

    def edges(self, most: float) -> list[Edge]:
        """Edges above the least delay, up to a number of samples there and back, sorted."""
        out = [edge for edge in self._of_steady_motion() if edge.samples <= most]
        out += self._at_nyquist(most)
        for theta, argument, slope in zip(*self._crossings, strict=True):
            turn = 2.0 * math.pi
            first = math.ceil((self.least * theta - argument) / turn - 1e-12)
            last = math.floor((most * theta - argument) / turn)
            change = 2 if slope < 0.0 else -2
            samples = [float((argument + turn * k) / theta) for k in range(first, last + 1)]
            out += [Edge(x, float(theta), change) for x in samples]
        return sorted(out)

    def _at_nyquist(self, most: float) -> list[Edge]:
        """Where eigenvalues come up at z = -1, outside the circle: on the axis, then as pairs."""
        values = matrices.eigenvalues(self.loop.around(np.array([math.pi])))[0]
        out = []
        for x in values[np.abs(values) > 1.0]:
            argument = float(np.angle(x)) / math.pi
            if on_axis := abs(x.imag) <= REAL * abs(x):
                argument = round(argument)
            first = math.floor((self.least - argument) / 2.0) + 1
            for k in range(first, math.floor((most - argument) / 2.0) + 1):
                at = argument + 2.0 * k
                sides = (at - AXIS, at + AXIS) if on_axis else (at, at)
                out += [Edge(side, math.pi, 1) for side in sides]
            if on_axis and (self.least - argument) % 2 == 0:
                out.append(Edge(self.least + AXIS, math.pi, 1))
        return out

    def _of_steady_motion(self) -> list[Edge]:
        """Where steady motion loses or finds its resistance."""
        if not self.loop.structural:
            return []
        here = self.loop.drag()
        later = self.loop.between(self.loop.there + 1, self.loop.back).drag()
        # a direction without resistance at any delay, as of an arm that nothing holds, has no edge
        none = max(FREE, NO_DRAG / max(float(np.linalg.norm(here, 2)), joint_crossings.NO_SIZE))
        if none >= 1.0:
            return []
        values = matrices.eigenvalues(matrices.pseudo_inverse(here, none) @ (here - later))
        real = values[(np.abs(values.imag) <= REAL * np.abs(values)) & (values.real > REAL)]
        return [self._steady_edge(1.0 / x) for x in real.real.tolist()]

    def _steady_edge(self, more: float) -> Edge:
        """The edge a number of samples beyond the least."""
        loop = self.loop.between(self.loop.there + more, self.loop.back)
        return Edge(self.least + more, 0.0, loop.steady_trend())

    def count(self, samples: float) -> int:
        """Unstable eigenvalues at a number of samples there and back."""
        return self.unstable + sum(edge.change for edge in self.edges(samples))

    def first(self, most: float) -> Edge | None:
        """The edge at which the pair, stable at the least delay, turns unstable; None for none."""
        return next((edge for edge in self.edges(most) if edge.change > 0), None)

    def windows(self, most: float) -> Iterator[tuple[float, float, Edge | None]]:
        """Where the pair is unstable: from and up to which samples, and the edge it begins at."""
        count, start, first = self.unstable, float(self.least), None
        for edge in self.edges(most):
            before, count = count, count + edge.change
            if before <= 0 < count:
                start, first = edge.samples, edge
            elif count <= 0 < before:
                yield start, edge.samples, first
        if count > 0:
            yield start, math.inf, first

    def first_alike(self, most: float) -> tuple[int, Edge | None] | None:
        """The least whole delay, both ways alike, at which the pair is unstable; None for none.

        With it, the edge behind which it is.
        """
        for start, end, edge in self.windows(most):
            whole = math.ceil(0.5 * start)
            if start <= 2.0 * whole < end and 2.0 * whole <= most:
                return whole, edge
        return None

    def near(self, edge: Edge) -> Edge:
        """The edge of this loop nearest to one of another loop."""
        if edge.theta == 0.0:
            found = self._of_steady_motion() or [edge]
            return min(found, key=lambda x: abs(x.samples - edge.samples))
        angles = np.unique(np.minimum(edge.theta * np.linspace(0.9, 1.1, AROUND), math.pi))
        theta, x = joint_crossings.zeros(self.loop.around, angles, joint_crossings.log_size)
        if not len(theta):
            return edge
        turns = np.round((edge.samples * theta - np.angle(x)) / (2.0 * math.pi))
        samples = (np.angle(x) + 2.0 * math.pi * turns) / theta
        i = int(np.abs(samples - edge.samples).argmin())
        return Edge(float(samples[i]), float(theta[i]), edge.change)
