"""The largest eigenvalue of a pair with many messages on their way, without a state for each.

What goes around is H(z) = H_l H_f, and with N samples there and back z is an eigenvalue of the pair
where an eigenvalue of H is z^N. On a circle of radius r the eigenvalues of H are followed from
angle to angle. Each time that one of them, over z^N, crosses the real axis beyond 1, an eigenvalue
of the pair lies beyond the circle, or one less: with the poles of both ends there, that is
Nyquist's criterion for the circle. Newton's method starts where the phases match; the count says
that nothing is left beyond what it found.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from .. import matrices
from .joint_crossings import NO_SIZE
from .joint_loop import near_resonances
from .pair_branches import followed, log_size
from .pair_loop import PairLoop

BESIDE = 1e-9  # of a radius: by so much the circle of a count is larger than an eigenvalue
RIM = 1e-6  # the same of the circle around rest, near which rounding grows as 1/distance^2
BESIDE_POLE = 2.0**-50  # of it
EVEN, BY_FACTORS = 300, 150  # angles to begin with
LEAST = 1e-10  # [rad] smallest of them
LONGEST = 0.1  # step of Newton's method, of the logarithm
NEAR = 0.3  # logarithm of sizes that are computed where the phases match, not interpolated
TOPS = 24  # starts of Newton's method
STEPS, SMALL, SOLVED = 30, 1e-6, 1e-13  # its steps, its differences, and its end
FITS = 1e-7  # by how much an eigenvalue of H over z^N may miss 1
LARGEST = 1e6  # eigenvalue that is looked for
GONE = 1e-3  # eigenvalue whose motion is over at the next sample
CLOSE = 1e-5  # to 1: what may be rest, as far as Newton's method goes
CIRCLES = 100  # of a search
INWARD = 0.8  # where between a radius and 1 the next circle of a stable pair lies


def largest(loop: PairLoop, samples: float) -> complex:
    """The largest eigenvalue at a number of samples there and back, but for those of rest."""
    pair = _Pair(loop, samples)
    low, high, best = 0.0, 1.0 + pair.rim, 0j
    matches, count = pair.matches(high)
    best = pair.roots(high, matches)
    while count > 0 and high < LARGEST:
        low, high = high, 2.0 * high
        matches, count = pair.matches(high)
        best = max(best, pair.roots(high, matches), key=abs)
    for _ in range(CIRCLES):
        r = (1.0 + BESIDE) * max(abs(best), GONE)
        if r >= high or high - low <= BESIDE * low or (r > low and not pair.left(r)):
            break
        low = max(low, r)
        middle = low + (INWARD if high > 1.0 else 0.5) * (high - low)
        matches, count = pair.matches(middle)
        found = pair.roots(middle, matches)
        if abs(found) <= abs(best):
            found = pair.of_poles(abs(best))
        best = max(best, found, key=abs)
        if count > pair.at_rest(middle):
            low = middle
        else:
            high = middle
    return best


def beyond(loop: PairLoop, samples: float, r: float | None = None) -> int:
    """Number of eigenvalues beyond a circle that passes through none: of radius r, or around 1."""
    pair = _Pair(loop, samples)
    return pair.matches(r or 1.0 + pair.rim)[1]


class _Match(NamedTuple):
    """Where an eigenvalue of H has the phase of z^N on a circle, m times.

    Attributes:
        theta: the angle [rad], shape (m,).
        log: logarithm of the eigenvalue over r^N, shape (m,).
        slope: d ln H/d ln z, shape (m,).
        turn: full turns of z^N ahead of the eigenvalue, shape (m,).
        weight: eigenvalues of the pair beyond the circle, where it is beyond 1, shape (m,).
    """

    theta: np.ndarray
    log: np.ndarray
    slope: np.ndarray
    turn: np.ndarray
    weight: np.ndarray


class _Pair:
    def __init__(self, loop: PairLoop, samples: float):
        self.loop, self.N = loop, samples
        self.poles = loop.open_poles()
        self._singular: dict[complex, bool] = {}

    @property
    def rim(self) -> float:
        """Distance from 1 at which rounding does not hide eigenvalues of rest, where there are."""
        return RIM if self.loop.structural else BESIDE

    def values(self, log: np.ndarray) -> np.ndarray:
        """Eigenvalues of H at z = exp(log), shape (m, k)."""
        try:
            return matrices.eigenvalues(self.loop.around(-1j * log))
        except np.linalg.LinAlgError:  # on a pole: beside it, by less than its rounding
            return matrices.eigenvalues(self.loop.around(-1j * (log + BESIDE_POLE)))

    def at_rest(self, r: float) -> int:
        """Eigenvalues of rest beyond a circle."""
        return self.loop.structural + self.loop.free if r < 1.0 else 0

    def left(self, r: float) -> bool:
        """Whether eigenvalues other than those of rest lie beyond a circle."""
        return self.matches(r)[1] > self.at_rest(r)

    # ---- on a circle

    def followed(self, r: float) -> tuple[np.ndarray, np.ndarray]:
        """Angles from 0 to pi, and the eigenvalues of H there as branches, shape (m, k)."""
        start = [np.linspace(0.0, math.pi, EVEN + 1), np.geomspace(LEAST, 1.0, BY_FACTORS)]
        near = near_resonances(self.poles / r) if r > GONE else np.empty(0)
        start.append(near[(near > 0.0) & (near < math.pi)])
        theta = np.unique(np.concatenate(start))
        return followed(lambda x: self._on_circle(r, x), theta, self.N * math.log(r))

    def _on_circle(self, r: float, theta: np.ndarray) -> np.ndarray:
        values = self.values(math.log(r) + 1j * theta)
        ends = ((theta == 0.0) | (theta == math.pi))[:, None]
        real = ends & (np.abs(values.imag) <= FITS * np.abs(values))
        return np.where(real, values.real, values)

    def matches(self, r: float) -> tuple[_Match, int]:
        """Where phases match on a circle, and how many eigenvalues lie beyond it."""
        theta, values = self.followed(r)
        size = log_size(values) - self.N * math.log(r)
        log = size + 1j * np.unwrap(np.angle(values), axis=0)
        turns = (self.N * theta[:, None] - log.imag) / (2.0 * math.pi)
        ends, axis = turns[[0, -1]], np.round(turns[[0, -1]])
        real = np.abs(ends - axis) < FITS
        turns[[0, -1]] = np.where(real, axis, ends)
        between = _between(theta, log, turns)
        every = [self._sharpened(r, between), *_on_axis(theta, log, turns, real)]
        found = _Match(*(np.concatenate(x) for x in zip(*every, strict=True)))
        beyond = np.sum(found.weight[found.log.real > 0.0]) + np.sum(np.abs(self.poles) > r)
        return found, int(beyond)

    def _sharpened(self, r: float, found: _Match) -> _Match:
        """The same, computed instead of interpolated where the size is near 1."""
        theta, log, slope, turn, weight = found
        i, shift = np.flatnonzero(np.abs(log.real) < NEAR), self.N * math.log(r)
        for _ in range(STEPS if len(i) else 0):
            every = self.values(math.log(r) + 1j * theta[i])
            with np.errstate(over="ignore", invalid="ignore"):  # far beyond: no root is near
                value = _nearest(every, np.exp(log[i] + shift))
            turned = log[i].imag + np.angle(value * np.exp(-1j * log[i].imag))
            new = log_size(value) - shift + 1j * turned
            miss = self.N * theta[i] - turned - 2.0 * math.pi * turn[i]
            move = _bounded(-miss / (self.N - slope[i].real), LONGEST)
            theta[i] += move
            log[i] = new + 1j * slope[i] * move
            if np.abs(move).max() <= SOLVED:
                break
        return found

    # ---- off it

    def roots(self, r: float, found: _Match) -> complex:
        """The largest eigenvalue that Newton's method finds from where phases match; 0 for none."""
        excess = found.log.real
        start = math.log(r) + 1j * found.theta + excess / (self.N - found.slope)
        order = np.union1d(np.argsort(-start.real)[:TOPS], np.argsort(np.abs(excess))[:TOPS])
        value = np.exp(found.log[order] + self.N * math.log(r))
        z = self._newton(start[order], value)
        return max((x for x in z if self._moves(x)), key=abs, default=0j)

    def _moves(self, z: complex) -> bool:
        """Whether a root is none of rest: near 1, by a count on both sides of it."""
        if abs(z - 1.0) > CLOSE:
            return True
        if abs(abs(z) - 1.0) <= 2.0 * self.rim:
            return False
        sides = [self.matches((1.0 + x) * abs(z))[1] for x in (-BESIDE, BESIDE)]
        return sides[0] > sides[1]

    def _newton(self, log: np.ndarray, value: np.ndarray) -> list[complex]:
        """Eigenvalues near z = exp(log), where an eigenvalue of H is near a value."""
        miss = step = np.full(len(log), np.inf)
        for _ in range(STEPS if len(log) else 0):
            here, ahead = np.split(self.values(np.concatenate([log, log + SMALL])), 2)
            value = _nearest(here, value)
            with np.errstate(divide="ignore", invalid="ignore"):
                slope = np.log(_nearest(ahead, value) / value) / SMALL - self.N
                miss = np.log(value) - self.N * log
                miss -= 2j * math.pi * np.round(miss.imag / (2.0 * math.pi))
                step = _bounded(-miss / slope, LONGEST)
            log = log + step
            if np.all(np.abs(step) <= SOLVED):
                break
        good = (np.abs(miss) < FITS * max(self.N, 1.0)) & (np.abs(step) < FITS)
        z = np.exp(log[good])
        return np.where(np.abs(z.imag) <= SOLVED * np.abs(z), z.real, z).tolist()

    def of_poles(self, r: float) -> complex:
        """The largest eigenvalue beyond a circle that lies on or beside a pole of an end; 0 for
        none.

        Beside a pole an eigenvalue of H is R/(z - p), so z^N (z - p)/R is 1: smooth, unlike its
        logarithm. On it lies an eigenvalue of what nothing reaches.
        """
        p = self.poles[np.abs(self.poles) > max(r, GONE)]
        found = [*self._beside(p), *(x for x in p.tolist() if self._alone(x))]
        return max((z for z in found if abs(z) > r and self._moves(z)), key=abs, default=0j)

    def _beside(self, p: np.ndarray) -> list[complex]:
        z = p.astype(complex) * (1.0 + SMALL)
        miss = step = np.full(len(z), np.inf)
        for _ in range(STEPS if len(z) else 0):
            here, ahead = np.split(self._whole(np.concatenate([z, z * (1.0 + SMALL**2)])), 2)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = _bounded((1.0 - here) * SMALL**2 * z / (ahead - here), LONGEST * np.abs(z))
            miss, z = np.abs(here - 1.0), z + step
        return z[(miss < FITS) & (np.abs(step) < FITS)].tolist()

    def _whole(self, z: np.ndarray) -> np.ndarray:
        """z^N over the largest eigenvalue of H."""
        values = self.values(np.log(z))
        most = values[np.arange(len(z)), np.abs(values).argmax(axis=1)]
        with np.errstate(over="ignore", invalid="ignore"):
            return np.exp(self.N * np.log(z) - np.log(np.where(most == 0.0, NO_SIZE, most)))

    def _alone(self, p: complex) -> bool:
        if p not in self._singular:
            self._singular[p] = self.loop.singular(p)
        return self._singular[p]


def _between(theta: np.ndarray, log: np.ndarray, turns: np.ndarray) -> _Match:
    """Where branches pass full turns between two angles, interpolated."""
    low, high = np.floor(turns[:-1]), np.floor(turns[1:])
    i, branch = np.nonzero(low != high)
    times = np.abs(high - low)[i, branch].astype(int)
    i, branch = np.repeat(i, times), np.repeat(branch, times)
    passed = np.arange(len(i)) - np.repeat(np.cumsum(times) - times, times)
    turn = np.minimum(low, high)[i, branch] + 1.0 + passed
    at_end = ((i == 0) & (turn == turns[0, branch])) | (
        (i == len(theta) - 2) & (turn == turns[-1, branch])
    )
    weight = np.where(high > low, 2, -2)[i, branch]  # with the conjugate one
    i, branch, turn, weight = i[~at_end], branch[~at_end], turn[~at_end], weight[~at_end]
    share = (turn - turns[i, branch]) / (turns[i + 1, branch] - turns[i, branch])
    gap, rise = theta[i + 1] - theta[i], log[i + 1, branch] - log[i, branch]
    at = theta[i] + share * gap, log[i, branch] + share * rise
    return _Match(*at, rise / (1j * gap), turn, weight)


def _on_axis(
    theta: np.ndarray, log: np.ndarray, turns: np.ndarray, real: np.ndarray
) -> list[_Match]:
    """Where branches are at full turns at the angles 0 and pi."""
    out = []
    for end, beside, ahead in ((0, 1, 1.0), (-1, -2, -1.0)):
        j = np.flatnonzero(real[end])
        slope = (log[beside, j] - log[end, j]) / (1j * (theta[beside] - theta[end]))
        weight = np.sign(ahead * (turns[beside, j] - turns[end, j])).astype(int)
        at = np.full(len(j), theta[end])
        out.append(_Match(at, log[end, j], slope, turns[end, j], weight))
    return out


def _nearest(values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Of some values in each row the one nearest to that wanted."""
    return values[np.arange(len(values)), np.abs(values - wanted[:, None]).argmin(axis=1)]


def _bounded(step: np.ndarray, most: Any) -> np.ndarray:
    """Steps of no more than a size, none where there is no number."""
    step = np.where(np.isfinite(step), step, 0.0)
    return step * np.minimum(1.0, most / np.maximum(np.abs(step), NO_SIZE))
