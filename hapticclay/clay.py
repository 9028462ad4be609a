"""Virtual clay: position-dependent viscous damping, fe = b(p) v (Eqs. 3, 4)."""

from __future__ import annotations

import bisect

from .params import AXES, B_MAX, Clay, Profile


def kick(b0: tuple[float, float], b1: tuple[float, float], H: float, L: float, R: float, w: float) -> tuple[float, ...]:
    """Splits the clay's damping in one kick between the velocities before and after it.

    Each side of the sample keeps its own part of the kick: Crank-Nicolson, second order, and across a
    border an impulse of exactly b times the distance travelled inside. Where the part before would
    overshoot, L b H w > 1, the excess acts on the velocity after: the least implicit split without
    overshoot, so that no stiffness rings. One share serves both axes, which keeps the energy that the
    clay takes positive however the axes are coupled.

    Args:
        b0, b1: damping before and after the sample on each axis [N.s/m].
        H: length of the kick [s]. L, R: its shares before and after the sample.
        w: largest acceleration per unit of force over all directions [1/kg].

    Returns:
        (before x, after x, before y, after y [N.s/m], felt [1]): fe = before v- + after v+, and the
        velocity that the clay feels at the sample is v- + felt (v+ - v-).
    """
    z = L * max(b0) * H * w
    share = 1.0 / z if z > 1.0 else 1.0
    x, y = share * L * b0[0], share * L * b0[1]
    return x, L * b0[0] - x + R * b1[0], y, L * b0[1] - y + R * b1[1], 1.0 - share * (1.0 - L)


def constant_profile(b: float, start: float, end: float, along: str = "x") -> Profile:
    """Damping b [N.s/m] for start <= coordinate < end [m], none elsewhere."""
    return Profile(edges=(start, end), values=(0.0, b, 0.0), along=along)


def slab(b: float, start: float, end: float) -> Clay:
    """A slab across the x axis that damps both axes alike (the constant cut, Sec. 4.1)."""
    profile = constant_profile(b, start, end)
    return Clay(x=profile, y=profile)


def there_is(clay: Clay | None, i: int) -> list[tuple[float, float]]:
    """Where coordinate i alone says that there is clay: disjoint spans of it [m], ascending, perhaps infinite."""
    inf = float("inf")
    out: list[tuple[float, float]] = []
    for profile in (clay.x, clay.y) if clay else ():
        if profile.along == AXES[i]:
            edges = (-inf, *profile.edges, inf)
            grown = profile.growth or (0.0,) * len(profile.values)
            spans = zip(edges, edges[1:], profile.values, grown, strict=False)
            out += [(low, high) for low, high, b, g in spans if b > 0.0 or g > 0.0]
    merged: list[tuple[float, float]] = []
    for low, high in sorted(out):
        if merged and low <= merged[-1][1]:
            low, high = merged[-1][0], max(high, merged[-1][1])
            merged.pop()
        merged.append((low, high))
    return merged


class Regions:
    """Which region of the clay the handle is in, and how far that region reaches.

    Attributes:
        low, high: borders of the present region on each coordinate [m].
        base, rate: the clay there is b = base + rate t on each axis [N.s/m, N.s/m per s].
        grows: whether any region's clay grows.
    """

    def __init__(self, clay: Clay | None, length: float | None, p: tuple[float, float]):
        inf = float("inf")
        self._profiles = (clay.x, clay.y) if clay else ()
        self._edges = [sorted({e for f in self._profiles if f.along == axis for e in f.edges}) for axis in AXES]
        self._end = length
        if length is not None:
            self._edges[0] = sorted({e for e in self._edges[0] if e < length} | {length})
        self._index = [bisect.bisect_right(self._edges[i], p[i]) for i in (0, 1)]
        self._entered: dict[tuple[int, int], float] = {}  # (axis, region of its profile) -> time [s]
        self.grows = any(f.growth for f in self._profiles)
        self.low, self.high = [-inf, -inf], [inf, inf]
        self.base = self.rate = (0.0, 0.0)
        self._settle(0.0)

    def _settle(self, t: float) -> None:
        for i in (0, 1):
            edges, k = self._edges[i], self._index[i]
            self.low[i] = edges[k - 1] if k else -float("inf")
            self.high[i] = edges[k] if k < len(edges) else float("inf")
        if self._profiles:
            laws = [self._law(i, f, t) for i, f in enumerate(self._profiles)]
            self.base = laws[0][0], laws[1][0]
            self.rate = laws[0][1], laws[1][1]

    def _law(self, axis: int, profile: Profile, t: float) -> tuple[float, float]:
        low = self.low[AXES.index(profile.along)]
        j = sum(1 for e in profile.edges if e <= low)
        value, rate = profile.values[j], profile.growth[j] if profile.growth else 0.0
        return value - rate * self._entered.setdefault((axis, j), t) if rate else value, rate

    def b(self, t: float) -> tuple[float, float]:
        """Damping of the present region at time t [s] on each axis [N.s/m]."""
        return at(self.base, self.rate, t)

    def change(self, clay: Clay, t: float) -> None:
        """Puts other damping between the same borders, from time t [s] on."""
        self._profiles = clay.x, clay.y
        self._settle(t)

    def cross(self, i: int, up: bool, t: float) -> float:
        """Steps over the border of coordinate i at time t [s], upwards or downwards; returns its place [m]."""
        border = self.high[i] if up else self.low[i]
        self._index[i] += 1 if up else -1
        self._settle(t)
        return border

    def at_end(self, i: int, up: bool) -> bool:
        """True if the border ahead on coordinate i is the end of the path."""
        return i == 0 and up and self._end is not None and self.high[0] == self._end


def at(base: tuple[float, float], rate: tuple[float, float], t: float) -> tuple[float, float]:
    """b = base + rate t on each axis [N.s/m]; growth ends at the largest damping there is."""
    if rate == (0.0, 0.0):
        return base
    x, y = (min(b + r * t, B_MAX) for b, r in zip(base, rate, strict=True))
    return x, y
