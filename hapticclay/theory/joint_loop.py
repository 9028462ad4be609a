"""The sampled loop of n joints at a pose: a matrix, and responses on the unit circle.

Between samples M q'' + D q' + S q = tau is linear. At sample k the host measures q_k and has the
rate v_k; its torque tau_k = -(P q_k + R v_k) acts after `delay` and is held for Ts (zero-order
hold; a fraction of a sample splits the hold). The map from sample to sample is exact for small
motions about the pose. Friction, encoder counts, torque limits and the links' elasticity are left
out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from .. import matrices
from ..arms import joint_law
from ..display import time_words
from ..errors import ParameterError
from . import gain_crossings, linear_loop
from .rest import FREE, Rest, balanced

MOST_STATES = 1200  # largest order of a map whose eigenvalues are computed
AT_REST = 1e-6  # modes this near to z = 1 may be rest
ROUNDING = 1e-10  # of an eigenvalue
NO_MOTION = 1e-14  # change over a sample of a motion that nothing resists: rest, to rounding
UNRESOLVED = 1e-8  # distance from 1 of eigenvalues of motion that a large damping slows
WEAK, EVENLY = 0.5, 24  # gain around the loop of a weak one, and even angles at which it is read
BESIDE = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # half widths of a resonance, likewise
HALVED, TERMS = 0.5, 14  # norm of a matrix whose exponential is a sum of so many terms


class Drive(NamedTuple):
    """What drives hold from sample to sample of their own: -(position q + rate q').

    Attributes:
        position: [N.m/rad], shape (n, n).
        rate: [N.m.s/rad], shape (n, n).
        samples: of the drives in one of the host.
    """

    position: np.ndarray
    rate: np.ndarray
    samples: int


@dataclass(frozen=True, eq=False)
class JointLoop:
    """Joints, and the torque that a host holds.

    Attributes:
        inertia: M [kg.m^2], shape (n, n).
        damping: D of what acts between samples, drives included [N.m.s/rad], shape (n, n).
        stiffness: S likewise [N.m/rad], shape (n, n).
        position: P of the held torque [N.m/rad], shape (n, n).
        rate: R of the held torque [N.m.s/rad], shape (n, n).
        Ts: control sample [s].
        delay: from a sample to its torque [s].
        velocity: how the rate is had.
        cutoff: of the filter behind the difference [rad/s].
        drive: the part of D and S that drives hold from sample to sample; None for none.
    """

    inertia: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    position: np.ndarray
    rate: np.ndarray
    Ts: float
    delay: float = 0.0
    velocity: Literal["exact", "difference", "filter"] = "exact"
    cutoff: float | None = None
    drive: Drive | None = None

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.inertia)

    @cached_property
    def hold(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Transition of (q, q') over a sample, response to the torque due in it, to the one before.

        Shapes (2n, 2n), (2n, n), (2n, n).
        """
        change, now, before = self.change
        return np.eye(2 * self.n) + change, now, before

    @cached_property
    def change(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `hold`, of the change of (q, q') over a sample: slow motion keeps its digits."""
        share = self.late[1]
        if self.drive is not None:
            return self._held_by(self.drive, share)
        whole = self._transition(self.Ts, self.damping, self.stiffness)
        rest = (1.0 - share) * self.Ts
        late = self._transition(rest, self.damping, self.stiffness) if share else whole
        return whole[0], late[1], whole[1] - late[1]

    def _held_by(self, drive: Drive, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`change` with drives that take what the host sends at the next of their own samples."""
        samples = drive.samples
        loose = self.damping - drive.rate, self.stiffness - drive.position
        step, given = self._transition(self.Ts / samples, *loose)
        step = step - given @ np.hstack([drive.position, drive.rate])
        late = math.ceil(share * samples - ROUNDING)
        change, sums = np.zeros_like(step), [0.0 * given]
        for _ in range(samples):
            sums.append(sums[-1] + given + change @ given)
            change = change + step + step @ change
        return change, sums[samples - late], sums[samples] - sums[samples - late]

    def _transition(
        self, t: float, damping: np.ndarray, stiffness: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        n, inverse = self.n, np.linalg.inv(self.inertia)
        a = np.zeros((3 * n, 3 * n))
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n] = np.hstack([-inverse @ stiffness, -inverse @ damping, inverse])
        with np.errstate(over="ignore", invalid="ignore"):
            e = _expm1(a * t)
        if not np.isfinite(e).all():
            bound = "must be shorter: the joints alone grow beyond all numbers within it"
            raise ParameterError("Ts", self.Ts, bound)
        return e[: 2 * n, : 2 * n], e[: 2 * n, 2 * n :]

    @cached_property
    def late(self) -> tuple[int, float]:
        """Whole samples of the delay, and the rest as a share of a sample."""
        return linear_loop.whole_samples(self.delay, self.Ts)

    @property
    def samples_late(self) -> int:
        """Whole samples of the delay."""
        return self.late[0]

    @property
    def states(self) -> int:
        """Order of the map, at most."""
        return self.n * (4 + self.late[0])

    # ---- the matrix

    def map(self) -> np.ndarray:
        """State matrix x(k+1) = A x(k): q, q', the last q, the filtered rate, torques to come.

        Raises:
            ParameterError: the delay makes it larger than 1,200 states.
        """
        change = self.map_change()
        return np.eye(len(change)) + change

    def map_change(self) -> np.ndarray:
        """The state matrix less 1, without the rounding of a difference."""
        n, (whole, share) = self.n, self.late
        measured = self._measured_groups
        queue = whole + (share > 0.0)
        size = n * (2 + measured + queue)
        if size > MOST_STATES:
            most = (MOST_STATES // n - 4) * self.Ts
            raise ParameterError("delay", self.delay, f"must be at most {most:g} s at this rate")
        unit = np.eye(size).reshape(-1, n, size)  # rows of each group of n states
        q, w, memory, queued = unit[0], unit[1], unit[2 : 2 + measured], unit[2 + measured :]
        keep, gain = self.rate_filter
        v = w if not measured else gain * (q - memory[0]) + (keep * memory[1] if keep else 0.0)
        torques = [-(self.position @ q + self.rate @ v), *queued]
        step, now, before = self.change
        out = np.zeros((size, size))
        out[: 2 * n] = step @ np.vstack([q, w]) + now @ torques[whole]
        if share > 0.0:
            out[: 2 * n] += before @ torques[whole + 1]
        rest = [*[q, v][:measured], *torques[:queue]]
        if rest:
            out[2 * n :] = np.vstack(rest) - unit[2:].reshape(-1, size)
        return out

    @property
    def _measured_groups(self) -> int:
        """Groups of n states of the estimate of rates."""
        return {"exact": 0, "difference": 1, "filter": 2}[self.velocity]

    def equations(self, z: complex) -> np.ndarray:
        """T(z) of positions, rates and the host's torques, shape (3n, 3n)."""
        n, (change, now, before), (whole, share) = self.n, self.change, self.late
        out = np.zeros((3 * n, 3 * n), complex)
        out[: 2 * n, : 2 * n] = (z - 1.0) * np.eye(2 * n) - change
        out[: 2 * n, 2 * n :] = -(now + before / z if share > 0.0 else now) * z**-whole
        out[2 * n :, :n], out[2 * n :, 2 * n :] = self.position, np.eye(n)
        if self.velocity == "exact":
            out[2 * n :, n : 2 * n] = self.rate
        else:
            keep, gain = self.rate_filter
            out[2 * n :, :n] += self.rate * gain * (z - 1.0) / (z - keep)
        return out

    @property
    def rate_filter(self) -> tuple[float, float]:
        """v_k = keep v_k-1 + gain (q_k - q_k-1)."""
        return joint_law.rate_filter(self.cutoff, self.Ts)

    # ---- rest, and the verdict

    @cached_property
    def _stiffness(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Eigenvalues and eigenvectors of the whole stiffness, and the size of one that is none."""
        total = self.stiffness + self.position
        scale = max(np.abs(self.stiffness).max(), np.abs(self.position).max())
        size, directions = np.linalg.eigh(0.5 * (total + total.T))
        return size, directions, FREE * float(scale)

    @cached_property
    def _rest_directions(self) -> np.ndarray:
        """Directions of motion without stiffness, columns of shape (n, k)."""
        size, directions, none = self._stiffness
        return directions[:, np.abs(size) <= none]

    @property
    def structural(self) -> int:
        """Number of directions of motion without stiffness, which rest anywhere."""
        return self._rest_directions.shape[1]

    @property
    def falls(self) -> int:
        """Number of directions in which the joints are pushed away from their pose at rest.

        An odd number puts a real eigenvalue beyond 1, whatever the damping: det(z - A) is negative
        at z = 1.
        """
        size, _, none = self._stiffness
        return int(np.sum(size < -none))

    @cached_property
    def rest(self) -> Rest:
        """Rest and steady motion."""
        return Rest(self.equations, self.structural)

    @cached_property
    def moving(self) -> np.ndarray:
        """Eigenvalues of the map less 1, without those of rest anywhere.

        A direction u of rest is a known eigenvector at z = 1, so its coordinate is eliminated
        instead of its eigenvalue: what resists steady motion has one close to it.
        """
        change, u = self.map_change(), self._rest_directions
        if u.shape[1]:
            from scipy.linalg import qr

            positions = [u, 0.0 * u, *[u, 0.0 * u][: self._measured_groups]]
            queue = len(change) // self.n - len(positions)
            vectors = np.vstack([*positions, *[-self.position @ u] * queue])
            factors: Any = qr(u.T, pivoting=True)
            own = np.sort(factors[2][: u.shape[1]])
            others = np.delete(np.arange(len(change)), own)
            follow = np.linalg.solve(vectors[own].T, vectors[others].T).T
            change = change[np.ix_(others, others)] - follow @ change[np.ix_(own, others)]
        return gain_crossings.eigenvalues(change)

    @property
    def growth(self) -> float:
        """Logarithm of the largest size of an eigenvalue, without regard to rounding."""
        z = self.moving
        beyond = (2.0 * z.real + np.abs(z) ** 2).max(initial=-1.0)
        return 0.5 * math.log1p(beyond) if beyond > -1.0 else -math.inf

    @cached_property
    def _sizes(self) -> np.ndarray:
        """Sizes of these eigenvalues of the map; 1 within rounding."""
        z = self.moving
        beyond = z.real + 0.5 * np.abs(z) ** 2
        on_circle = np.abs(beyond) <= np.maximum(ROUNDING * np.abs(z), NO_MOTION)
        return np.where(on_circle, 1.0, np.abs(1.0 + z))

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """Eigenvalues of the map, largest first, without those of rest anywhere (z = 1)."""
        return 1.0 + self.moving[np.argsort(-self._sizes, kind="stable")]

    def radius(self) -> float:
        """Largest size of an eigenvalue: beyond 1 the loop is unstable."""
        size = float(self._sizes.max(initial=0.0))
        if self.falls % 2 or (self.falls and size > 1.0 - UNRESOLVED):
            return max(size, math.nextafter(1.0, 2.0))
        return size

    def stable(self) -> bool:
        """Whether no motion grows."""
        return self.radius() <= 1.0

    def shape(self, z: complex) -> np.ndarray:
        """Motion of the joints at an eigenvalue, shape (n,); near 1 that which is no rest."""
        if abs(z - 1.0) > AT_REST:
            values, vectors = matrices.eigenvectors(self.map())
            return vectors[: self.n, np.abs(values - z).argmin()]
        whole, _, columns = balanced(self.equations(z))
        return (columns * matrices.svd(whole)[2][-1].conj())[: self.n]

    def resistance(self) -> np.ndarray:
        """What resists steady motion along directions of rest [N.m.s/rad], one a direction."""
        return (
            matrices.eigenvalues(self.rest.resistance(slice(2 * self.n, None), slice(0, self.n)))
            * self.Ts
        )

    def drift(self) -> np.ndarray:
        """Measured rates per constant torque of the host in steady motion, shape (n, n)."""
        n = self.n
        if not self.structural:
            return np.zeros((n, n))
        moved, level = self.rest.drift(np.eye(3 * n)[:, 2 * n :])
        return level[n : 2 * n] if self.velocity == "exact" else moved[:n] / self.Ts

    # ---- on the unit circle

    def responses(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and measured rate per torque added to the host's, both (m, n, n), of the loop.

        At z = exp(i theta), theta of shape (m,), > 0 and <= pi.
        """
        q, v = self.open_responses(theta)
        back = np.linalg.inv(np.eye(self.n) + self.position @ q + self.rate @ v)
        return q @ back, v @ back

    def open_responses(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and measured rate per held torque, both (m, n, n), of the joints alone."""
        n, (change, now, before), (whole, share) = self.n, self.change, self.late
        z, ahead = (f(1j * theta)[:, None, None] for f in (np.exp, np.expm1))
        given = now + before / z if share > 0.0 else now
        x = np.linalg.solve(ahead * np.eye(2 * n) - change, given * z**-whole)
        q, w = x[:, :n], x[:, n:]
        return q, w if self.velocity == "exact" else self.measured(theta)[:, None, None] * q

    def opened(self, theta: np.ndarray) -> np.ndarray:
        """The open loop, from a held torque around to the host's, shape (m, n, n)."""
        q, v = self.open_responses(theta)
        return -(self.position @ q + self.rate @ v)

    def weak(self) -> bool:
        """Whether what the host holds is too weak to undo the stability of the joints alone.

        Half a small gain, on angles spread evenly and at the joints' own resonances.
        """
        if self.drive is not None:
            return False
        if not self.position.any() and not self.rate.any():
            return True
        alone = self._own_poles * self.Ts
        if alone.real.max() >= 0.0:
            return False
        near = np.abs(alone.imag[:, None] - alone.real[:, None] * BESIDE) % (2.0 * math.pi)
        near = np.minimum(near, 2.0 * math.pi - near).ravel()
        theta = np.concatenate([np.linspace(0.0, math.pi, EVENLY)[1:], near[near > 0.0]])
        units = np.sqrt(np.diag(self.inertia))
        gains = self.opened(theta) * units / units[:, None]
        return bool(np.linalg.norm(gains, axis=(1, 2)).max() < WEAK)

    @property
    def turn(self) -> float:
        """Angle by which the fastest motion of the joints alone turns in a sample [rad]."""
        return float(np.abs(self._own_poles.imag).max()) * self.Ts

    @property
    def _own_poles(self) -> np.ndarray:
        """Poles of the joints alone [1/s]."""
        n, inverse = self.n, np.linalg.inv(self.inertia)
        lower = np.hstack([-inverse @ self.stiffness, -inverse @ self.damping])
        return matrices.eigenvalues(np.vstack([np.eye(2 * n)[n:], lower]))

    def between_responses(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and measured rate per torque of a sine between samples, in the closed loop.

        Both (m, n, n); theta of shape (m,) is the turn of the sine in a sample, > 0 and <= pi.
        """
        s = 1j * theta[:, None, None] / self.Ts
        q = np.linalg.inv(self.inertia * s**2 + self.damping * s + self.stiffness)
        v = self.measured(theta)[:, None, None] * q
        back, rate = self.responses(theta)
        fed = self.position @ q + self.rate @ v
        return q - back @ fed, v - rate @ fed

    def measured(self, theta: np.ndarray) -> np.ndarray:
        """Measured rate per position of a sine at the samples, shape (m,)."""
        if self.velocity == "exact":
            return 1j * theta / self.Ts
        (keep, gain), back = self.rate_filter, np.exp(-1j * theta)
        return gain * (1.0 - back) / (1.0 - keep * back)

    def at_rest(self) -> np.ndarray:
        """Position per constant torque added to the host's [rad/(N.m)], shape (n, n)."""
        return matrices.pseudo_inverse(self.stiffness + self.position, FREE)

    # ---- the same with other numbers

    def with_delay(self, delay: float) -> JointLoop:
        """The loop with another delay [s]."""
        return replace(self, delay=delay)

    def feeding(self, position: np.ndarray, rate: np.ndarray) -> JointLoop:
        """The loop with more feedback in the held torque, shapes (n, n)."""
        found = replace(self, position=self.position + position, rate=self.rate + rate)
        return found.held_as(self)

    def held_as(self, other: JointLoop) -> JointLoop:
        """The loop itself, with what another one of the same joints, Ts and delay has computed."""
        self.__dict__["change"] = other.change
        return self


def _expm1(a: np.ndarray) -> np.ndarray:
    """exp(a) - 1, slow motion as accurate as fast: twice the time makes 2 e + e e of it."""
    size = float(np.abs(a).sum(axis=1).max())
    doublings = max(0, math.frexp(size / HALVED)[1]) if math.isfinite(size) else 0
    part = a * 2.0**-doublings
    out, one = np.zeros_like(a), np.eye(len(a))
    for k in range(TERMS, 0, -1):
        out = part @ (one + out) / k
    for _ in range(doublings):
        out = 2.0 * out + out @ out
    return out


def is_stable(radius: Any) -> Any:
    """Whether loops with these largest eigenvalues are stable, to rounding."""
    return radius < 1.0 + ROUNDING


def timing_words(Ts: float, delay: float) -> str:
    """Rate and delay, as headlines say them."""
    return f"{1.0 / Ts:.4g} Hz, {time_words(delay)} late"


def grid(loop: Any) -> np.ndarray:
    """Angles of a search, > 0 and <= pi: even, by factors, and dense at resonances."""
    return np.unique(np.concatenate([even_grid(loop), resonant_grid(loop)]))


def even_grid(loop: Any) -> np.ndarray:
    """Angles of a search that depend on whole samples of delay alone, > 0 and <= pi."""
    even = np.linspace(0.0, math.pi, 400 * (1 + loop.samples_late // 8) + 1)[1:]
    return np.concatenate([even, np.geomspace(1e-6, 1.0, 400)])


def resonant_grid(loop: Any) -> np.ndarray:
    """Angles of a search around eigenvalues near the unit circle, > 0 and <= pi."""
    if loop.states > MOST_STATES // 3:
        return np.empty(0)
    near = near_resonances(matrices.eigenvalues(loop.map()))
    return near[(near > 0.0) & (near <= math.pi)]


def near_resonances(z: np.ndarray) -> np.ndarray:
    """Angles dense around those of eigenvalues near the unit circle."""
    z = z[(np.abs(z) > 0.5) & (z.imag >= 0.0)]
    near = np.tan(np.linspace(-1.5, 1.5, 15))
    return (np.angle(z)[:, None] + np.abs(1.0 - np.abs(z))[:, None] * near).ravel()
