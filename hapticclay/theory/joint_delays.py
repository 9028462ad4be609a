"""How much more delay the joints of an arm carry."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .. import matrices
from . import joint_scan, roots
from .joint_crossings import Crossing
from .joint_loop import JointLoop
from .pair_delays import Delays, Edge
from .rest import Rest, Resting

LATEST = 2.0  # [s] largest added delay that is looked for
SHARES = 8  # of a sample that are looked at, evenly
SHORT, FEW = 12.0, 120  # samples, and states of a map, up to which loops are followed instead
EXACT = 1e-12  # samples within which a delay is found


def delay_left(loop: JointLoop) -> Crossing:
    """Delay that may be added to a stable loop [s], and the angle of the eigenvalue there.

    0 for an unstable loop, inf for more than 2 s.
    """
    return Crossing(0.0, math.nan) if not loop.stable() else _Search(loop).left()


@dataclass(frozen=True, eq=False)
class Late(Resting):
    """Joints behind whole samples of delay, as messages on their way.

    Attributes:
        loop: the joints, with the share of a sample that the delay has.
        there: whole samples.
    """

    loop: JointLoop
    there: float = 0
    back: float = 0

    @property
    def states(self) -> int:
        """Order of the map."""
        return self.loop.states

    @cached_property
    def _delayed(self) -> JointLoop:
        return replace(self.loop, delay=self.loop.delay + self.there * self.loop.Ts)

    @property
    def eigenvalues(self) -> np.ndarray:
        """Those of the map without those of rest."""
        return self._delayed.eigenvalues

    def open_poles(self) -> np.ndarray:
        """Eigenvalues without torques of the host."""
        none = np.zeros((self.loop.n, self.loop.n))
        return matrices.eigenvalues(replace(self.loop, position=none, rate=none).map())

    def around(self, theta: np.ndarray) -> np.ndarray:
        """The open loop without the whole samples, shape (m, n, n)."""
        return self.loop.opened(theta)

    def between(self, there: float, back: float) -> Late:
        """The same with other whole samples."""
        return replace(self, there=there, back=back)

    @property
    def structural(self) -> int:
        """Directions of rest."""
        return self.loop.structural

    @cached_property
    def _rest(self) -> Rest:
        def equations(z: complex) -> np.ndarray:
            out, held = self.loop.equations(z), slice(2 * self.loop.n, None)
            out[: held.start, held] *= z**-self.there
            return out

        return Rest(equations, self.structural)


class _Unstable(NamedTuple):
    """A delay [samples] at which the joints are unstable, and the edge before it."""

    delay: float
    edge: Edge | None


class _Search:
    """The least delay beyond the present one at which a stable loop is unstable."""

    def __init__(self, loop: JointLoop):
        self.loop, self.Ts = loop, loop.Ts
        self.present = sum(loop.late)
        self.most = self.present + LATEST / loop.Ts

    def left(self) -> Crossing:
        """The delay left [s], and the angle there."""
        if self.loop.weak():
            return Crossing(math.inf, math.nan)
        first = [x for x in map(self._first, {0.0, self.loop.late[1]}) if x]
        most = min((x.delay for x in first), default=math.inf)
        if most - self.present > SHORT or self.loop.n * (4 + most) > FEW:
            shares = {i / SHARES for i in range(SHARES)} | {self.loop.late[1]}
            first = [x for x in map(self._first, sorted(shares)) if x]
            if not first:
                return Crossing(math.inf, math.nan)
            return self._less(self._crossed(min(first, key=lambda x: x.delay)))
        whole = map(float, range(math.ceil(self.present), math.ceil(most)))
        points = sorted({self.present, *whole, most})
        return self._less(next(joint_scan.changes(self._at, points)))

    def _less(self, found: Crossing) -> Crossing:
        return Crossing(max(0.0, found.change - self.present) * self.Ts, found.theta)

    def _at(self, samples: float) -> JointLoop:
        return self.loop.with_delay(samples * self.Ts)

    def _delays(self, share: float) -> Delays:
        return Delays(Late(self._at(share)))  # type: ignore[arg-type]

    def _first(self, share: float) -> _Unstable | None:
        """The least delay with a share of a sample at which the joints are unstable."""
        found = self._delays(share)
        start = max(math.ceil(self.present - share), int(found.least))
        count, last = found.unstable, None
        edges = itertools.groupby(found.edges(self.most), lambda x: math.ceil(x.samples))
        for whole, crossed in itertools.chain(edges, [(math.inf, [])]):
            if count > 0 and whole > start:
                break
            for edge in crossed:
                count += edge.change
                last = edge if edge.change > 0 else last
            start = max(start, whole)
        if count <= 0 or start > self.most:
            return None
        return _Unstable(start + share, last)

    def _crossed(self, high: _Unstable) -> Crossing:
        """Where instability begins below a delay."""
        low = max(self.present, high.delay - 1.0 / SHARES)
        if self.loop.n * (4 + high.delay) <= FEW or high.edge is None:
            return next(joint_scan.changes(self._at, np.linspace(low, high.delay, 3).tolist()))
        edge, whole = high.edge, math.floor(high.delay)

        def stable(samples: float) -> bool:
            near = self._delays(samples - whole).near(edge)
            return near.samples > whole

        ends = roots.bisect(stable, low, high.delay, EXACT / max(1.0, high.delay))
        return Crossing(ends[1], self._delays(ends[1] - whole).near(edge).theta)
