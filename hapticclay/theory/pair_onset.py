"""The least delay of a link at which a pair is unstable, both ways alike, any share of a sample.

With a share s of a sample the pair is unstable at whole samples N above an edge E(s), so at delays
N + s. Without force sensors that is one condition, continuous in the delay. A force is measured
just before a sample: where the torque from the other arm switches at a sample, it is a sample older
than where it switches a little earlier. So E jumps there, and such a pair may be stable again
between two delays at which it is not.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

from . import roots
from .pair_build import Build
from .pair_delays import Delays, Edge
from .pair_loop import PairLoop

LATEST = 2.0  # [s] largest one-way delay that is looked for
BEFORE = 1e-6  # of a sample: a switch just before one
BETWEEN = (0.0, 0.25, 0.5, 0.75, 1.0 - BEFORE)  # of a sample after a switch at a sample
SMALL = 200  # states of a map whose eigenvalues cost less than a count
FINE = 1e-9  # of a sample: of the delay that is found


class Onset(NamedTuple):
    """Where a pair turns unstable.

    Attributes:
        delay: one-way delay of the link [s].
        loop: the pair with it.
        z: the eigenvalue that leaves the circle.
    """

    delay: float
    loop: PairLoop
    z: complex

    @property
    def frequency(self) -> float:
        """Frequency of the motion [Hz]."""
        return abs(cmath.phase(self.z)) / (2.0 * math.pi * self.loop.Ts)


def onset(build: Build, gain: float = 1.0) -> Onset | None:
    """The least delay at which a pair is unstable, 0 if it is without; None for more than 2 s."""
    return _Search(build, gain).onset()


class _Unstable(NamedTuple):
    """An unstable pair: its delay in samples, and the edge below; None if it has none."""

    delay: float
    edge: Edge | None


class _Search:
    """Delays of a pair in samples, counted by `Delays`."""

    def __init__(self, build: Build, gain: float):
        self.build, self.gain, self.Ts = build, gain, build.pair.Ts

    def onset(self) -> Onset | None:
        """As `onset`."""
        without = self._delays(0.0)
        if without.unstable:
            return self._at(_Unstable(0.0, None))
        if self.build.architecture.whole:
            found = self._first(0.0)
            return found and self._at(found._replace(delay=found.delay - 1.0))
        if not any(end.control.feels for end in without.loop.ends):
            found = self._first(0.0)
            found = self._between(found.delay - 1.0 if found else math.inf) or found
            return found and self._at(self._crossed(found.delay - 1.0, found))
        return self._among_switches()

    def _among_switches(self) -> Onset | None:
        """The least over shares; between it and the share before, where instability begins."""
        switch = -self.build.pair.delay / self.Ts
        found = [self._first((switch + x) % 1.0) for x in BETWEEN]
        i, least = min(
            ((i, x) for i, x in enumerate(found) if x), key=lambda x: x[1].delay, default=(0, None)
        )
        if least is None:
            return None
        if i == 0:  # just before the switch it is stable
            return self._at(least)
        return self._at(self._crossed(least.delay - (BETWEEN[i] - BETWEEN[i - 1]), least))

    def _delays(self, late: float) -> Delays:
        """The pair with the share of a sample that a delay has."""
        share = self.build.samples(late * self.Ts)[1] * self.Ts
        return Delays(self.build.loop((share, share), self.gain))

    def _first(self, share: float) -> _Unstable | None:
        """The least delay with a share at which the pair is unstable."""
        found = self._delays(share)
        first = found.first_alike(2.0 * LATEST / self.Ts)
        return first and _Unstable(first[0] + share, first[1])

    def _between(self, before: float) -> _Unstable | None:
        """A delay at which the pair is unstable, in a window between whole samples, before one.

        Samples that are counted as real numbers say where it may be, the map whether it is.
        """
        for start, end, edge in self._delays(0.0).windows(2.0 * min(before, LATEST / self.Ts)):
            middle = 0.25 * (start + min(end, 2.0 * before))
            if middle < before and self._unstable(middle):
                return _Unstable(middle, edge)
        return None

    def _crossed(self, low: float, high: _Unstable) -> _Unstable:
        """Where instability begins between a stable delay and an unstable one, without a jump."""
        low, edge = max(low, 0.0), high.edge
        while low > 0.0 and self._unstable(low):  # of an edge that the search passed over
            low, high = max(low - 1.0, 0.0), high._replace(delay=low)
        if edge is not None and self._beyond(low, edge) > 0.0 >= self._beyond(high.delay, edge):
            high = high._replace(delay=self._passed(low, high.delay, edge))
            if high.delay - BEFORE <= low or not self._unstable(high.delay - BEFORE):
                return high
        width = FINE / max(high.delay, 1.0)  # another edge is passed before that one
        found = roots.bisect(lambda x: not self._unstable(x), low, high.delay, width)
        return high._replace(delay=found[1])

    def _passed(self, low: float, high: float, edge: Edge) -> float:
        from scipy.optimize import brentq

        return float(brentq(self._beyond, low, high, (edge,), xtol=FINE))  # type: ignore[arg-type]

    def _beyond(self, late: float, edge: Edge) -> float:
        """By how many samples there and back the edge lies beyond a delay."""
        return self._delays(late).near(edge).samples - 2.0 * self._whole(late)

    def _unstable(self, late: float) -> bool:
        """By the map where it is small, else by what is counted."""
        each = late * self.Ts
        loop = self.build.loop((each, each), self.gain)
        if loop.states <= SMALL:
            return not loop.stable()
        return self._delays(late).count(2.0 * self._whole(late)) > 0

    def _whole(self, late: float) -> int:
        return self.build.samples(late * self.Ts)[0]

    def _at(self, found: _Unstable) -> Onset:
        """The pair at the onset, and its motion."""
        late, edge = found.delay * self.Ts, found.edge
        loop = self.build.loop((late, late), self.gain)
        if edge is None:
            return Onset(late, loop, complex(loop.eigenvalues[0]))
        half = 0.5 * self._delays(found.delay).near(edge).samples
        return Onset(late, loop.between(half, half), cmath.exp(1j * edge.theta))
