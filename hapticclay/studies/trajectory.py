"""Smooth motions under noisy positions, and a law of force fitted together with the motion.

A velocity differentiated from noisy positions is itself noisy, and a law fitted to it comes out
biased. Here position and force are fitted together: one spline per stretch fits the positions, and
the law applied to its derivative fits the forces (total least squares along a spline). The spline's
coefficients are eliminated from the normal equations, which are banded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..model.flow import N_MAX, N_MIN

DEGREE = 4  # of the spline; its velocity is a cubic, its acceleration continuous
LEAST_PER_KNOT = 8  # samples between knots: coarse enough to estimate the noise from the residuals
FIT_RANGES = {  # of the parameters, the logarithm of K, while a law is fitted
    "Fy": (-1e9, 1e9),
    "b": (-1e12, 1e12),
    "K": (math.log(1e-12), math.log(1e12)),
    "n": (N_MIN, N_MAX),
}
WINDOW = 5.0  # correlation times over which autocorrelations are summed (Sokal 1997)


class Stretch(NamedTuple):
    """Samples fitted by one spline."""

    t: np.ndarray  # [s], (n,), ascending
    bends: Sequence[float] = ()  # times at which the acceleration may jump [s]
    kept: np.ndarray | None = None  # mask of the samples that count, (n,); None for all

    @property
    def counted(self) -> np.ndarray:
        """Mask of the samples that count, (n,)."""
        return np.ones(len(self.t), dtype=bool) if self.kept is None else self.kept


class Motion:
    """Quartic splines over time, one for each stretch, and their velocities.

    Of `sliding` samples (indices; None for all) the velocity is used, in the direction `sign`.
    """

    def __init__(
        self,
        stretches: Sequence[Stretch],
        spacing: float,
        sliding: np.ndarray | None = None,
        sign: np.ndarray | None = None,
    ):
        knots = [_knots(x, spacing) for x in stretches]
        each = [len(x) - DEGREE - 1 for x in knots]
        self.size = sum(each)  # of the coefficients
        begin = np.cumsum([0, *map(len, knots[:-1])])
        within = [
            np.clip(np.searchsorted(u, x.t, "right") - 1, DEGREE, n - 1)  # an interval of knots
            for u, x, n in zip(knots, stretches, each, strict=True)
        ]
        at = np.concatenate([i + low for i, low in zip(within, begin, strict=True)])
        ahead = np.repeat(np.cumsum([0, *each[:-1]]) - begin, [len(x) for x in within])
        self._first = at + ahead - DEGREE
        times = np.concatenate([x.t for x in stretches])
        self._place, velocity = _basis(times, np.concatenate(knots), at)
        self.counted = np.concatenate([x.counted for x in stretches])
        self._place[~self.counted] = 0.0  # samples that do not count have position 0
        chosen = np.arange(len(velocity)) if sliding is None else sliding
        self._velocity, self._near = velocity[chosen], self._first[chosen]
        if sign is not None:
            self._velocity = self._velocity * sign[:, None]
        self._gram = self._products(self._place, self._first)

    def place(self, c: np.ndarray) -> np.ndarray:
        """Positions at the samples [m], from coefficients."""
        return np.einsum("ij,ij->i", self._place, c[_nearby(self._first)])

    def velocity(self, c: np.ndarray) -> np.ndarray:
        """Velocities of the samples that slide, forward [m/s]."""
        return np.einsum("ij,ij->i", self._velocity, c[_nearby(self._near)])

    def follow(self, p: np.ndarray) -> np.ndarray:
        """Coefficients of the best fit to samples."""
        return _solved(self._gram, self._gathered(self._place, self._first, p))

    def deviation(self, some: np.ndarray) -> np.ndarray:
        """Deviation of some velocities, by index, over that of the positions [1/s]."""
        rows = np.zeros((self.size, len(some)))
        for k, i in enumerate(some.tolist()):
            rows[_nearby(self._near[i : i + 1])[0], k] = self._velocity[i]
        return np.sqrt(np.sum(rows * _solved(self._gram, rows), axis=0))

    def eliminated(
        self, ratio: float, slope: np.ndarray, columns: np.ndarray, rest: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A^-1 g, A^-1 G and G of a Gauss-Newton step, with normal equations A c + G theta = g.

        `slope` and `columns` are changes of the forces by velocity and by theta, `rest` and `p`
        residuals of force and position, `ratio` the weight of a squared position.
        """
        A = ratio * self._gram + self._products(self._velocity, self._near, slope * slope)
        g = ratio * self._gathered(self._place, self._first, p)
        g += self._gathered(self._velocity, self._near, slope * rest)
        G = [self._gathered(self._velocity, self._near, slope * x) for x in columns.T]
        right = np.array([g, *G]).T
        found = _solved(A, right)
        return found[:, 0], found[:, 1:], right[:, 1:]

    def _products(
        self, X: np.ndarray, first: np.ndarray, weights: np.ndarray | None = None
    ) -> np.ndarray:
        """X' diag(weights) X in lower banded form."""
        out = np.zeros((DEGREE + 1, self.size))
        Y = X if weights is None else X * weights[:, None]
        for d in range(DEGREE + 1):
            for r in range(DEGREE + 1 - d):
                out[d] += np.bincount(first + r, Y[:, r] * X[:, r + d], self.size)
        return out

    def _gathered(self, X: np.ndarray, first: np.ndarray, y: np.ndarray) -> np.ndarray:
        """X' y."""
        return np.bincount(_nearby(first).ravel(), (X * y[:, None]).ravel(), self.size)


def _nearby(first: np.ndarray) -> np.ndarray:
    return first[:, None] + np.arange(DEGREE + 1)


def _solved(banded: np.ndarray, right: np.ndarray) -> np.ndarray:
    from scipy.linalg import solveh_banded

    return solveh_banded(banded, right, lower=True, check_finite=False)


def _knots(stretch: Stretch, spacing: float) -> np.ndarray:
    """Knots of a stretch [s]: at a bend as many as let the acceleration jump."""
    k, t, counted = DEGREE, stretch.t, stretch.t[stretch.counted]
    ends = [float(t[0]), *stretch.bends, float(t[-1])]
    knots = [np.full(k + 1, t[0])]
    for i, (a, b) in enumerate(zip(ends, ends[1:], strict=False)):
        within = int(np.searchsorted(counted, b) - np.searchsorted(counted, a))
        most = max(1, within // LEAST_PER_KNOT)
        inner = np.linspace(a, b, min(max(round((b - a) / spacing), 1), most) + 1)
        knots += [inner[1:-1], np.full(k + 1 if i == len(ends) - 2 else k - 1, b)]
    return np.concatenate(knots)


def _basis(t: np.ndarray, knots: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of positions and of velocities, (n, DEGREE + 1), of times in intervals `at` of knots.

    By the recurrence of de Boor (1972) and Cox: a spline of degree d is a mean of two of d - 1.
    """
    near = knots[at[:, None] + np.arange(1 - DEGREE, DEGREE + 1)].T  # DEGREE on each side
    rows, share = [np.ones(len(t))], []
    for d in range(1, DEGREE + 1):
        low, high = near[DEGREE - d : DEGREE], near[DEGREE : DEGREE + d]
        share = [x / (b - a) for x, a, b in zip(rows, low, high, strict=True)]
        ahead = [x * (b - t) for x, b in zip(share, high, strict=True)]
        behind = [x * (t - a) for x, a in zip(share, low, strict=True)]
        rows = [a + b for a, b in zip([*ahead, 0.0], [0.0, *behind], strict=True)]
    slopes = [0.0, *(DEGREE * x for x in share), 0.0]
    velocity = [a - b for a, b in zip(slopes, slopes[1:], strict=False)]
    return np.stack(rows, axis=1), np.stack(velocity, axis=1)


class Series(NamedTuple):
    """Values to fit over stretches."""

    stretches: Sequence[Stretch]
    y: np.ndarray


def chosen_spacing(series: Sequence[Series]) -> tuple[float, list[float]]:
    """Spacing of knots [s] by Akaike's criterion, and the residual variance of each series."""
    times = [x.t for x in series[0].stretches]
    finest = LEAST_PER_KNOT * float(np.median(np.diff(times[0])))
    longest = max(2.0 * finest, *(float(t[-1] - t[0]) for t in times))
    count = max(2, math.ceil(2.0 * math.log2(longest / finest)))
    best: Any = None
    for spacing in np.geomspace(finest, longest, count).tolist():
        score, variances = 0.0, []
        for x in series:
            motion = Motion(x.stretches, spacing)
            y, n = np.where(motion.counted, x.y, 0.0), int(np.count_nonzero(motion.counted))
            left = float(np.sum((y - motion.place(motion.follow(y))) ** 2))
            # corrected for few samples (Hurvich, Tsai 1989)
            m = motion.size
            score += n * math.log(max(left, 1e-24 * float(y @ y) + 1e-300))
            score += n * (n + m) / max(n - m - 2, 1)
            variances.append(left / max(n - m, 1))
        if best is None or score < best[0]:
            best = score, spacing, variances
    return best[1:]


class ForceLaw(NamedTuple):
    """A law of force as a function of the speed; its theta holds log K in place of K."""

    names: tuple[str, ...]  # some of Fy, K, n, b

    def force(self, theta: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Forces [N] at speeds [m/s], above 0."""
        return self.slopes(theta, v)[0]

    def slopes(self, theta: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces [N], (n,), and their derivatives by speed, (n,), and by theta, (n, k)."""
        a = dict(zip(self.names, theta.tolist(), strict=True))
        force = np.full(len(v), a.get("Fy", 0.0))
        slope = np.full(len(v), a.get("b", 0.0))
        force += slope * v
        columns = {"Fy": np.ones(len(v)), "b": v}
        if "K" in a:
            power = np.exp(np.clip(a["K"] + a["n"] * np.log(v), -700.0, 300.0))
            force += power
            slope += a["n"] * power / v
            columns |= {"K": power, "n": power * np.log(v)}
        return force, slope, np.stack([columns[x] for x in self.names], axis=1)


class Minimum(NamedTuple):
    """The best joint fit of position and force."""

    theta: np.ndarray  # with log K in place of K
    c: np.ndarray  # coefficients of the motion [m]; empty where the speed is known
    sum: float  # of squared forces, without the part of velocity noise [N^2]
    spread: np.ndarray  # inverse normal matrix of theta; its covariance per variance of a force
    v: np.ndarray  # speeds [m/s], (n,)
    rest: np.ndarray  # residual forces [N], (n,)


class JointFit(NamedTuple):
    """Forces to fit together with positions, or at known speeds."""

    f: np.ndarray  # against the motion [N], (n,)
    p: np.ndarray  # in the direction of motion [m], (n,); empty where the speed is known
    motion: Motion | None  # None where the speed is known
    start: np.ndarray  # coefficients fitted to the positions alone, or the known speeds [m/s]
    ratio: float  # variance of a force over that of a position [N^2/m^2]
    slowest: float  # laws are continued by their tangents below this speed [m/s]

    def solve(
        self,
        law: ForceLaw,
        theta: np.ndarray,
        held: Sequence[bool] = (),
        near: np.ndarray | None = None,
    ) -> Minimum:
        """Least sum of squares by the Gauss-Newton method, from theta and coefficients `near`."""
        k = len(law.names)
        free = ~np.array(held, dtype=bool) if len(held) else np.ones(k, dtype=bool)
        low, high = np.array([FIT_RANGES[x] for x in law.names]).T
        theta = np.clip(theta, low, high)
        c = self.start if near is None else near
        alone = self._position_sum(self.start)
        now = self._look(law, theta, c)
        spread = np.zeros((k, k))
        for _ in range(60):
            step, turn, spread = self._step(law, theta, c, free)
            out = free & (((theta <= low) & (step < 0.0)) | ((theta >= high) & (step > 0.0)))
            if out.any():
                step, turn, spread = self._step(law, theta, c, free & ~out)
            scale = 1.0
            for _ in range(12):
                new = np.clip(theta + scale * step, low, high)
                moved = c + scale * turn if self.motion else c
                then = self._look(law, new, moved)
                if math.isfinite(then[0]) and then[0] <= now[0]:
                    break
                scale *= 0.5
            else:
                break
            gain = now[0] - then[0]
            theta, c, now = new, moved, then
            if gain <= 1e-9 * max(now[0] - alone, 0.0):
                break
        _, v, rest = now
        return Minimum(theta, c, max(now[0] - alone, 0.0), spread, v, rest)

    def _position_sum(self, c: np.ndarray) -> float:
        if self.motion is None:
            return 0.0
        return self.ratio * float(np.sum((self.p - self.motion.place(c)) ** 2))

    def _look(
        self, law: ForceLaw, theta: np.ndarray, c: np.ndarray
    ) -> tuple[float, np.ndarray, np.ndarray]:
        v = c if self.motion is None else self.motion.velocity(c)
        with np.errstate(over="ignore", invalid="ignore"):
            rest = self.f - self._continued(law, theta, v)[0]
            return float(rest @ rest) + self._position_sum(c), v, rest

    def _continued(self, law: ForceLaw, theta: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
        """Forces and slopes of a law, continued by its tangent below the slowest speed."""
        force, slope, columns = law.slopes(theta, np.maximum(v, self.slowest))
        return force + slope * np.minimum(v - self.slowest, 0.0), slope, columns

    def _step(
        self, law: ForceLaw, theta: np.ndarray, c: np.ndarray, free: np.ndarray
    ) -> tuple[np.ndarray, Any, np.ndarray]:
        """Step of the free parameters and of the motion; spread of the parameters."""
        v = c if self.motion is None else self.motion.velocity(c)
        force, slope, columns = self._continued(law, theta, v)
        rest, J = self.f - force, columns[:, free]
        H, g = J.T @ J, J.T @ rest
        turn, back = 0.0, np.zeros(J.shape[1])
        if self.motion is not None:
            off = self.p - self.motion.place(c)
            turn, back, G = self.motion.eliminated(self.ratio, slope, J, rest, off)
            H, g = H - G.T @ back, g - G.T @ turn
        size = np.sqrt(np.maximum(np.diag(H), 1e-300))
        inverse = np.linalg.pinv(H / np.outer(size, size), hermitian=True) / np.outer(size, size)
        step, spread = np.zeros(len(free)), np.zeros((len(free), len(free)))
        step[free], spread[np.ix_(free, free)] = inverse @ g, inverse
        return step, turn - back @ step[free], spread


def correlation_time(x: np.ndarray) -> float:
    """Samples per independent sample: 1 + 2 sum of the autocorrelations; 1 for white noise.

    The window grows until it holds WINDOW correlation times (A. Sokal 1997). A value within twice
    its standard deviation of 1 is set to 1.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(x)
    x = x - x.mean()
    power = np.abs(np.asarray(rfft(x, next_fast_len(2 * n, real=True)))) ** 2
    rho = np.asarray(irfft(power))[: n // 4]
    if not rho[0] > 0.0:
        return 1.0
    tau = 2.0 * np.cumsum(rho / rho[0]) - 1.0
    ends = np.arange(len(tau)) >= WINDOW * np.maximum(tau, 1.0)
    at = int(np.argmax(ends)) if ends.any() else len(tau) - 1
    noise = math.sqrt((4.0 * at + 2.0) / n)
    return float(tau[at]) if tau[at] > 1.0 + 2.0 * noise else 1.0
