"""Gain limits of a scenario where its handle is: the linear loop of both axes at a pose.

Away from the nominal pose the arm's mobility W couples the axes unless the servo shapes the
inertia, and so does clay with rotated axes. With H_ii = G C_i + W_ii S_i, H_ij = W_ij S_i, where
S_i is Sh without its gain, and T = Te + Th (a matrix) the loop of both axes is

    det(1 + H T) = 1 + tr(H T) + det H det T = 0,

which is linear in the gain K of either axis.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from ..model.constants import AXES
from ..model.operator import Operator
from ..scene.scenario import Scenario
from . import linear_loop, roots
from .gain_limits import continuous_limit
from .loops import TIMING, Loop

SPACING = 0.02  # [m] of places along a path: W changes little in between
BESIDE = 1e-6  # [m] from a border, where the clay of either side is met
MOST_PLACES = 48  # of a box at which limits are compared; of more, as many over all dampings
MOST_KNOWN = 192  # limits that searches of an axis compute

Known = dict[tuple[float, ...], float]


@dataclass(frozen=True)
class PlacedLimit:
    """The gain limit of one axis at a place.

    Attributes:
        K: the limit [1/kg]; inf for none.
        b: damping of the clay along the axis [N.s/m].
        place: position of the handle p [m]; None if the limit is the same at every pose.
    """

    K: float = math.inf
    b: float = 0.0
    place: tuple[float, float] | None = None

    def __str__(self) -> str:
        where = f" and p = ({self.place[0]:.4g}, {self.place[1]:.4g}) m" if self.place else ""
        return f"at b = {self.b:g} N.s/m{where}"


class PoseLimits:
    """Gain limits of a scenario by place, in continuous time without delay, each worked out once.

    The other axis has its own gain. Where that alone makes the loop unstable, its compensator is
    left out.

    Attributes:
        scenario: the run.
        known: limits of x and of y so far.

    Args:
        scenario: the run.
    """

    def __init__(self, scenario: Scenario):
        self.scenario = scenario
        self._coupled = not scenario.inertia_shaping or scenario.rotated
        self._loops: dict[tuple[int, float], _CoupledLoop] = {}
        self.known: tuple[Known, Known] = {}, {}
        self._tables: list[np.ndarray | None] = [None, None]  # of the keys of known

    def copied(self) -> PoseLimits:
        """With the limits known now; what one finds from now on is not known to the other."""
        made = copy.copy(self)
        made.known, made._tables = (dict(self.known[0]), dict(self.known[1])), list(self._tables)
        return made

    def at(self, i: int, p: tuple[float, float], b: tuple[float, float]) -> float:
        """The gain limit with the handle at a place [1/kg]; inf for none."""
        s, known = self.scenario, self.known[i]
        if s.controller is not None:
            return math.inf
        if not (any(b) or any(s.operators)):
            p = s.start  # free: the same everywhere
        key = (*b, *p) if self._coupled else (b[i],)
        if key not in known:
            self._tables[i] = None
            if len(known) >= MOST_KNOWN:
                del known[next(iter(known))]
            if not self._coupled:
                known[key] = continuous_limit(s, AXES[i], b[i])
            else:
                W = _mobility(s, p)
                known[key] = self._coupled_loop(i, s.gain[1 - i]).limit(W, b)
                if known[key] == 0.0 and s.gain[1 - i] > 0.0:
                    known[key] = self._coupled_loop(i, 0.0).limit(W, b)
        return known[key]

    def stable_if_shaped(self, i: int, b: float) -> bool:
        """Whether inertia shaping makes the loop of an axis stable at its gain, at every pose."""
        s = self.scenario
        if not self._coupled or s.rotated:
            return False
        shaped = replace(s, inertia_shaping=True)
        return s.gain[i] <= continuous_limit(shaped, AXES[i], b)

    def _coupled_loop(self, i: int, other: float) -> _CoupledLoop:
        if (i, other) not in self._loops:
            self._loops[i, other] = _CoupledLoop(self.scenario, i, other)
        return self._loops[i, other]

    def _near(self, i: int, p: tuple[float, float], b: tuple[float, float]) -> float:
        """As `at`; once MOST_KNOWN limits are known, that of the most similar clay and place."""
        if len(self.known[i]) < MOST_KNOWN:
            return self.at(i, p, b)
        here = np.array((*b, *p) if self._coupled else (b[i],))
        keys = self._tables[i]
        if keys is None:
            keys = self._tables[i] = np.array(list(self.known[i]))
        difference = np.abs(keys - here) / (np.ptp(keys, axis=0) + 1e-300)
        return list(self.known[i].values())[int(difference.sum(axis=1).argmin())]

    def least(self, i: int, low: tuple[float, float], high: tuple[float, float]) -> PlacedLimit:
        """The least gain limit over the places of a box.

        Places are multiples of SPACING, the start, and both sides of each border of the clay.
        """
        s, clay = self.scenario, self.scenario.clay
        edges = clay.edges if clay else ((), ())
        x, y = (_places(low[k], high[k], edges[k], s.start[k]) for k in (0, 1))
        x, y = (g.ravel() for g in np.meshgrid(x, y, indexing="ij"))
        b = clay.at(x, y) if clay else np.zeros((2, len(x)))
        if not self._coupled:
            b, first = np.unique(b, axis=1, return_index=True)
            x, y = x[first], y[first]
        order = np.argsort(b[i], kind="stable")
        if len(order) > MOST_PLACES:
            order = order[np.linspace(0, len(order) - 1, MOST_PLACES).astype(int)]
        found = PlacedLimit()
        for j in order.tolist():
            p, here = (float(x[j]), float(y[j])), (float(b[0, j]), float(b[1, j]))
            K = self._near(i, p, here)
            if K < found.K:
                own = max(here) if s.rotated else here[i]
                found = PlacedLimit(K, own, p if self._coupled else None)
        return found

    def ahead(self, i: int) -> PlacedLimit:
        """The least gain limit over the path to come, known before the run.

        A constant force along x alone moves the handle straight from start to length. A run that
        is driven otherwise may meet all of the clay. A run without a force stays at its start.
        """
        s = self.scenario
        force = s.steady_force
        pulled = s.length is not None and (force[0] > 0.0 or s.driven)
        ends = [(s.start[0], s.length) if pulled else s.start[:1], s.start[1:]]
        straight = force[1] == 0.0 and not s.driven and (pulled or force[0] == 0.0)
        if not straight and s.clay:
            ends = [(*own, *edges) for own, edges in zip(ends, s.clay.edges, strict=True)]
        reach = s.arm.reach[1]

        def corner(of: Callable[..., float]) -> tuple[float, float]:
            x, y = (
                min(max(float(of(x)), -reach - o), reach - o)
                for x, o in zip(ends, s.origin, strict=True)
            )
            return x, y

        return self.least(i, corner(min), corner(max))


def _places(low: float, high: float, edges: tuple[float, ...], start: float) -> np.ndarray:
    """Coordinates to look at between low and high [m], at least one."""
    even = SPACING * np.arange(math.ceil(low / SPACING), math.floor(high / SPACING) + 1)
    beside = np.array([e + d for e in edges for d in (-BESIDE, BESIDE)])
    found = np.unique(np.concatenate((even, beside, [start])))
    found = found[(found >= low) & (found <= high)]
    return found if len(found) else np.array([low])


class _CoupledLoop:
    """The loop of both axes for every gain of one: det(1 + H T) over poses and clay.

    Args:
        s: the run.
        i: axis whose gain varies.
        other: gain of the other axis; without one its C adds no poles.
    """

    def __init__(self, s: Scenario, i: int, other: float):
        self.s, self.i = s, i
        (D, c, n), (Dj, cj, nj) = _parts(s, i, True), _parts(s, 1 - i, other > 0.0)
        nj = other * nj
        self._apart = D * Dj, c * Dj, cj * D, nj * D
        self._together = c * cj, c * nj
        self._driven = n * Dj, n * cj, n * nj
        self._b: tuple[float, float] | None = None  # of the clay that _in_clay is of
        self._in_clay: tuple[np.ndarray, np.ndarray]

    def limit(self, W: np.ndarray, b: tuple[float, float]) -> float:
        """Least gain at which the loop is unstable, in clay of damping b."""
        wi, wj, w = W[self.i, self.i], W[1 - self.i, 1 - self.i], W[0, 1]
        if b != self._b:  # many places have the same clay
            self._b, self._in_clay = b, self._over_mobility(b)
        passive, driven = self._in_clay
        A = Polynomial([1.0, wi, wj, w, wi * wj - w * w] @ passive)
        return roots.first_crossing(A, Polynomial([1.0, wj] @ driven))[0]

    def _over_mobility(self, b: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """The loop without the gain and what it drives: rows times 1, W_ii, W_jj, W_ij, det W."""
        T = _environment(self.s, b)
        own, there, across = T[self.i][self.i], T[1 - self.i][1 - self.i], T[0][1]
        det = own * there - across * across
        (DD, cD, cDj, nD), (cc, cn), (nDj, ncj, nn) = self._apart, self._together, self._driven
        passive = DD + there * nD, own * cD + det * cn, there * cDj, across * (cD + cDj), det * cc
        return _rows(*passive), _rows(own * nDj + det * nn, det * ncj)


def _rows(*polynomials: Polynomial) -> np.ndarray:
    """Coefficients, lowest power first, a row of each."""
    n = max(len(p.coef) for p in polynomials)
    return np.array([np.pad(p.coef, (0, n - len(p.coef))) for p in polynomials])


def _parts(s: Scenario, i: int, gain: bool) -> tuple[Polynomial, Polynomial, Polynomial]:
    """D, c and n of an axis: S = c/D and G C/K = n/D."""
    shape = replace(s.servo[i].S, gain=1.0)
    if not gain:
        one = Polynomial([1.0])
        return Polynomial([shape.stiffness, shape.damping, 1.0]), one, 0.0 * one
    loop = Loop.of(s, AXES[i], 0.0)
    servo, unit = replace(loop.servo, S=shape), Operator(0.0, 0.0, 1.0)
    return linear_loop.loop_polynomials(replace(loop, operator=unit, servo=servo, **TIMING))


def _mobility(s: Scenario, p: tuple[float, float]) -> np.ndarray:
    """Gains of Sh of both axes at a place, shape (2, 2) [1/kg]."""
    if s.inertia_shaping:
        return np.diag([servo.S.gain for servo in s.servo])
    return linear_loop.mobility_at(s.planar_arm, s.origin[0] + p[0], s.origin[1] + p[1])


def _environment(s: Scenario, b: tuple[float, float]) -> list[list[Polynomial]]:
    """Te + Th of both axes; clay of damping b may be rotated."""
    angle = s.clay.angle if s.clay else 0.0
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    damping = turn @ np.diag(b) @ turn.T
    return [
        [
            Polynomial([th.spring, th.damper + damping[i, i], th.mass])
            if i == j
            else Polynomial([0.0, damping[0, 1]])
            for j in (0, 1)
        ]
        for i, th in enumerate(s.hands)
    ]
