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
from . import linear_loop
from .rest import FREE

MOST_STATES = 1200  # largest order of a map whose eigenvalues are computed
AT_REST = 1e-6  # modes this near to z = 1 may be rest
ROUNDING = 1e-10  # of an eigenvalue


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
        share = self.late[1]
        if self.drive is not None:
            return self._held_by(self.drive, share)
        whole = self._transition(self.Ts, self.damping, self.stiffness)
        rest = (1.0 - share) * self.Ts
        late = self._transition(rest, self.damping, self.stiffness) if share else whole
        return whole[0], late[1], whole[1] - late[1]

    def _held_by(self, drive: Drive, share: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`hold` with drives that take what the host sends at the next of their own samples."""
        samples = drive.samples
        loose = self.damping - drive.rate, self.stiffness - drive.position
        step, given = self._transition(self.Ts / samples, *loose)
        step = step - given @ np.hstack([drive.position, drive.rate])
        late = math.ceil(share * samples - ROUNDING)
        power, sums = np.eye(2 * self.n), [0.0 * given]
        for _ in range(samples):
            sums.append(sums[-1] + power @ given)
            power = step @ power
        return power, sums[samples - late], sums[samples] - sums[samples - late]

    def _transition(
        self, t: float, damping: np.ndarray, stiffness: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        n, inverse = self.n, np.linalg.inv(self.inertia)
        a = np.zeros((3 * n, 3 * n))
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n] = np.hstack([-inverse @ stiffness, -inverse @ damping, inverse])
        with np.errstate(over="ignore", invalid="ignore"):
            e = matrices.exponential(a * t)
        if not np.isfinite(e).all():
            bound = f"must be smaller at this rate: motion over {t:g} s is beyond all numbers"
            raise ParameterError("damping", float(np.abs(damping).max()), bound)
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
        n, (whole, share) = self.n, self.late
        measured = {"exact": 0, "difference": 1, "filter": 2}[self.velocity]
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
        step, now, before = self.hold
        out = np.zeros((size, size))
        out[: 2 * n] = step @ np.vstack([q, w]) + now @ torques[whole]
        if share > 0.0:
            out[: 2 * n] += before @ torques[whole + 1]
        rest = [*[q, v][:measured], *torques[:queue]]
        if rest:
            out[2 * n :] = np.vstack(rest)
        return out

    @property
    def rate_filter(self) -> tuple[float, float]:
        """v_k = keep v_k-1 + gain (q_k - q_k-1)."""
        return joint_law.rate_filter(self.cutoff, self.Ts)

    @cached_property
    def structural(self) -> int:
        """Directions of motion without stiffness, which rest anywhere."""
        total = self.stiffness + self.position
        size = matrices.singular_values(total)
        scale = max(np.abs(self.stiffness).max(), np.abs(self.position).max())
        return int(np.sum(size <= FREE * scale)) if scale else self.n

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """Eigenvalues of the map, largest first, without those of rest anywhere (z = 1)."""
        z = matrices.eigenvalues(self.map())
        for _ in range(2 * self.structural):
            i = int(np.abs(z - 1.0).argmin())
            if abs(z[i] - 1.0) > AT_REST:
                break
            z = np.delete(z, i)
        return z[np.argsort(-np.abs(z), kind="stable")]

    def radius(self) -> float:
        """Largest size of an eigenvalue: below 1 the loop is stable."""
        return float(np.abs(self.eigenvalues).max(initial=0.0))

    def stable(self) -> bool:
        """Whether all motion but rest decays."""
        return bool(is_stable(self.radius()))

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
        n, (step, now, before), (whole, share) = self.n, self.hold, self.late
        z = np.exp(1j * theta)[:, None, None]
        given = now + before / z if share > 0.0 else now
        x = np.linalg.solve(z * np.eye(2 * n) - step, given * z**-whole)
        q, w = x[:, :n], x[:, n:]
        return q, w if self.velocity == "exact" else self.measured(theta)[:, None, None] * q

    def opened(self, theta: np.ndarray) -> np.ndarray:
        """The open loop, from a held torque around to the host's, shape (m, n, n)."""
        q, v = self.open_responses(theta)
        return -(self.position @ q + self.rate @ v)

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
        self.__dict__["hold"] = other.hold
        return self


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
