"""The free motion of an arm's joints in a run: growth, frequency and joint, under any controller.

Modes are read from samples of all joints by linear prediction of low rank (ESPRIT: Roy, Kailath,
IEEE Trans. ASSP 37, 1989).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .. import matrices
from ..arguments import checked, named
from ..errors import ParameterError
from ..results import Result, Tables
from ..simulation.record import Record

A_PERIOD = 12  # samples of a period from which modes are read
ROWS, LEAST_ROWS = 96, 12  # of the Hankel matrix, of all joints and of one
RANKED = 1e-5  # smaller singular values are nonlinear motion
STILL = 1e-12  # [rad] between two samples: less is rounding
FEWEST = 24  # samples from which modes are read
SEEN = 1e-2  # of the largest motion of a mode: smaller ones are no swing that a person would see
PERIODS = 1.5  # of a swing that a run must show
LARGEST = 0.05  # [rad, m] of motion about a pose
UNEXPLAINED = 0.02  # share of the motion that the modes may leave


class Mode(NamedTuple):
    """One motion of all joints: log of its factor a second, and shares of the joints."""

    s: complex  # [1/s, rad/s]
    shares: np.ndarray

    @property
    def frequency(self) -> float:
        """Frequency [Hz]."""
        return abs(self.s.imag) / (2.0 * math.pi)


@named
@dataclass(frozen=True, repr=False, eq=False)
class JointMotion(Result):
    """The swing of an arm's joints that grows fastest, or decays most slowly.

    Attributes:
        names: joints, shape (n,).
        joint: joint that moves most in it.
        growth: rate at which it grows [1/s]; negative if it decays.
        frequency: of the swing [Hz].
        shares: motion of each joint, of that of `joint`, shape (n,).
    """

    written_as = "motion"

    names: tuple[str, ...]
    joint: str
    growth: float
    frequency: float
    shares: np.ndarray

    def headline(self) -> str:
        """The swing in one line."""
        how = "grows" if self.growth > 0.0 else "decays"
        return (
            f"{self.joint} swings at {self.frequency:.4g} Hz, {how} by {abs(self.growth):.4g} 1/s"
        )

    def tables(self) -> Tables:
        """One row per joint."""
        return {"motion": {"joint": self.names, "share": self.shares.tolist()}}

    def contents(self) -> dict[str, Any]:
        """The table, with growth and frequency."""
        numbers = {"growth [1/s]": self.growth, "frequency [Hz]": self.frequency}
        return {"joint": self.joint, **numbers, "tables": self.tables()}


@checked
def joint_motion(record: Record) -> JointMotion:
    """Reads the swing of an arm's joints from a run, under whatever controller it was.

    The run is free: no force and no reference that varies. Where joints stick, hit their limits or
    are driven, the swing is no mode, and none is found.

    Args:
        record: a run of an arm from a file.

    Raises:
        ParameterError: the arm is not from a file, the run is too short, or no swing is in it.
    """
    arm, s = record.scenario.file_arm, record.scenario
    every = max(1, round(float(s.Ts or s.dt) / _step(record)))
    q, period = _small(record.q[:-1:every]), every * _step(record)
    modes, rest = modes_of_motion(q, period, _strongest(q, period))
    largest = max((mode.shares.max() for mode in modes), default=0.0)
    swings = [m for m in modes if m.frequency > 0.0 and m.shares.max() > SEEN * largest]
    mode = max(swings, key=lambda m: m.s.real, default=None)
    if mode is None or rest > UNEXPLAINED or mode.frequency * period * len(q) < PERIODS:
        bound = "must show a swing of its joints: none is in this run, or it is too short"
        raise ParameterError("record", f"{len(record.t)} samples", bound)
    shares = mode.shares / mode.shares.max()
    joint = arm.names[int(shares.argmax())]
    return JointMotion(arm.names, joint, mode.s.real, mode.frequency, shares)


def _small(q: np.ndarray) -> np.ndarray:
    """Positions from the start on, until the motion is too large to be that about a pose."""
    large = (np.abs(q - q[:1]) > LARGEST).any(axis=1)
    return q[: int(large.argmax())] if large.any() else q


def _step(record: Record) -> float:
    """Time between two samples of a record [s]."""
    return float(record.t[1] - record.t[0]) if len(record.t) > 1 else record.scenario.dt


def _strongest(q: np.ndarray, period: float) -> float:
    """The frequency at which joints move most [Hz]."""
    x = np.diff(q, axis=0)
    if len(x) < FEWEST:
        return 0.0
    power = (np.abs(np.fft.rfft(x * np.hanning(len(x))[:, None], axis=0)) ** 2).sum(axis=1)
    return float(np.fft.rfftfreq(len(x), period)[1 + int(power[1:].argmax())])


def modes_of_motion(q: np.ndarray, period: float, frequency: float) -> tuple[list[Mode], float]:
    """Modes in the motion of joints, none if it is too short; and the share that they leave.

    Args:
        q: positions of the joints [rad], shape (m, n).
        period: between two of them [s].
        frequency: about which modes are looked for [Hz]; 0 for slow motion.
    """
    n, skip = q.shape[1], max(1, len(q) // 600)
    if frequency > 0.0:
        skip = max(1, min(len(q) // 60, int(1.0 / (A_PERIOD * frequency * period))))
    x = np.diff(q[::skip], axis=0)
    if len(x) < FEWEST or np.abs(x).max() < STILL:
        return [], 1.0
    rows = min(len(x) // 2, max(ROWS // n, LEAST_ROWS))
    windows = np.lib.stride_tricks.sliding_window_view(x, rows, axis=0)
    hankel = windows.transpose(2, 1, 0).reshape(rows * n, -1)
    u, size, _ = matrices.svd(hankel, full_matrices=False)
    r = max(1, min(int(np.sum(size > RANKED * size[0])), len(size) // 2))
    u = u[:, :r]
    z = matrices.eigenvalues(matrices.least_squares(u[:-n], u[n:]))
    z = z[np.abs(z) > 1e-6].astype(complex)
    s = np.log(z) / (skip * period)
    late = np.where(np.abs(z) > 1.0, len(x) - 1, 0)  # one that grows fast would hide the others
    powers = np.exp((np.arange(len(x))[:, None] - late) * np.log(z))
    weights = matrices.least_squares(powers, x.astype(complex))
    rest = float(np.linalg.norm(powers @ weights - x) / np.linalg.norm(x))
    parts = zip(s, np.abs(weights), strict=True)
    return [Mode(complex(a.real, abs(a.imag)), row) for a, row in parts], rest
