"""Limit cycles of joints whose friction is fed forward in excess: harmonic balance.

Fc tanh(k w) + Fv w is fed forward from the measured rate w, held and late, against the joint's own
Coulomb friction f sign(w) and viscous damping. The rest of the loop is linear and exact: its
responses to sines at the samples. The describing functions of both (Gelb, Vander Velde,
Multiple-Input Describing Functions and Nonlinear System Design, 1968), 4 f/(pi V) and
(4/pi) int Fc tanh(k A sin) sin/A, give a first cycle; then all odd harmonics are balanced.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import JointPD
from ..arms.joint_units import Joints, of_joint, table_of
from ..arms.mjcf_arm import MjcfArm
from ..errors import Bound, ParameterError
from ..results import Result, Tables
from . import roots
from .client_loop import Delay, Sample
from .joint_gains import Study
from .joint_loop import JointLoop, timing_words
from .rest import FREE

DECADES = 3  # of the rate 1/k, searched on either side of it
PER_DECADE = 6
POINTS = 1024  # of a period
HARMONICS = 20  # odd ones that are balanced
FASTEST = 0.9 * math.pi  # largest turn of a harmonic in a sample
WIDE = 3.0  # logarithm of the frequency, that a balance changes at most
SOLVED = 1e-9  # residual of a balance, of the fundamental
BACKWARDS = 1e-3  # of the largest rate: more of it in the wrong direction is sticking
COUNTED = 20_000  # samples of which the torque behind an encoder is the mean
FEW, MANY = 0.02, 8.0  # counts in a sample at which that mean is taken
RATES = 60  # their number
LEFT_OUT = "torque limits, backlash and elastic links: left out"
OTHERS = (
    "other joints move with their linear law: their Coulomb friction and what is fed forward for "
    "it cancel"
)


@named
@dataclass(frozen=True, repr=False, eq=False)
class FrictionCycle(Joints, Result):
    """Oscillations of the joints of an arm under friction fed forward in excess.

    n joints, m oscillations. A joint with Coulomb friction of its own may rest, too: motion between
    its threshold and its limit cycle grows, smaller motion comes to rest. A cycle within the
    distance at which friction holds the joint would stop, and is none.

    Attributes:
        names: joints, shape (n,).
        Ts: control sample [s].
        delay: from a sample to its torque [s].
        counts: encoder counts a turn; None for a position without steps.
        stable: whether the law without Fc is stable; if not, nothing is looked for.
        coulomb: friction of the joints [N.m], shape (n,).
        fed: Fc of the law [N.m], shape (n,).
        rests: distance from the set point at which a joint may rest, friction over stiffness [rad],
            shape (n,); inf without stiffness.
        slope: slope of what is fed forward at rest, Fc k + Fv, as the encoder lets it act
            [N.m.s/rad], shape (n,).
        joint: number of the joint that oscillates, shape (m,).
        kind: "limit cycle" if nearby motions converge to it; "threshold" if smaller ones decay and
            larger ones grow; "drift" if the joint has no stiffness and keeps turning.
        amplitude: of the joint's position [rad], shape (m,); NaN for a drift.
        frequency: [Hz], shape (m,); 0 for a drift.
        rate: largest rate of the joint [rad/s], shape (m,).
        harmonics: number of odd harmonics balanced, shape (m,); 1, the describing function, for a
            threshold, and where more are not found.
        first_amplitude: by the fundamental alone, the describing function [rad], shape (m,).
        first_frequency: likewise [Hz], shape (m,); where it is off by more than a half, that of
            all harmonics is good to some ten percent only.
        line_rate: largest rates of a sine, by joint [rad/s], shape (n, l).
        line_growth: growth of the motion at them [1/s], shape (n, l); NaN without a law.
        assumed: what the verdict rests on, and what it leaves out, a sentence each.
        slides: whether each joint slides; then its units are those of forces and lengths.
    """

    drawn_by = "hapticclay.views.joint_plots:friction_plot"
    written_as = "friction"

    names: tuple[str, ...]
    Ts: float
    delay: float
    counts: int | None
    stable: bool
    coulomb: np.ndarray
    fed: np.ndarray
    rests: np.ndarray
    slope: np.ndarray
    joint: np.ndarray
    kind: tuple[str, ...]
    amplitude: np.ndarray
    frequency: np.ndarray
    rate: np.ndarray
    harmonics: np.ndarray
    first_amplitude: np.ndarray
    first_frequency: np.ndarray
    line_rate: np.ndarray
    line_growth: np.ndarray
    assumed: tuple[str, ...] = ()
    slides: tuple[bool, ...] = ()

    def headline(self) -> str:
        """The largest lasting motion in one line."""
        at = timing_words(self.Ts, self.delay)
        at += f", {self.counts} counts a turn" if self.counts else ""
        if not self.stable:
            return f"friction fed forward at {at}: the law is unstable without it, too"
        lasting = [i for i, kind in enumerate(self.kind) if kind != "threshold"]
        if not lasting:
            return f"friction fed forward at {at}: no limit cycle"
        i = max(lasting, key=lambda i: np.nan_to_num(self.amplitude[i], nan=math.inf))
        name, turns = self.names[self.joint[i]], self.turning[self.joint[i]]
        if self.kind[i] == "drift":
            rate = f"{self.rate[i]:.3g} {of_joint('rad/s', turns)}"
            return f"friction fed forward at {at}: {name} drifts at {rate}"
        size = f"{1e3 * self.amplitude[i]:.3g} {of_joint('mrad', turns)}"
        told = f"{size} at {self.frequency[i]:.3g} Hz"
        return f"friction fed forward at {at}: limit cycle of {name}, {told}"

    def remarks(self) -> Sequence[str]:
        """The verdict, and what it rests on."""
        return [self.headline(), *self.assumed]

    def tables(self) -> Tables:
        """The oscillations; what is fed forward at each joint; growth over the rate."""
        cycles: dict[str, Any] = {
            "joint": [self.names[j] for j in self.joint],
            "kind": self.kind,
            "amplitude [rad]": self.amplitude,
            "frequency [Hz]": self.frequency,
            "largest rate [rad/s]": self.rate,
            "harmonics": self.harmonics,
            "amplitude by the fundamental [rad]": self.first_amplitude,
            "frequency by the fundamental [Hz]": self.first_frequency,
        }
        joints: dict[str, Any] = {
            "joint": self.names,
            "friction [N.m]": self.coulomb,
            "fed forward [N.m]": self.fed,
            "rests within [rad]": self.rests,
            "slope at rest [N.m.s/rad]": self.slope,
        }
        growth: dict[str, Any] = {}
        rows = zip(self.names, self.turning, self.line_rate, self.line_growth, strict=True)
        for name, turns, x, y in rows:
            growth[f"rate of {name} [{of_joint('rad/s', turns)}]"] = x
            growth[f"growth of {name} [1/s]"] = y
        oscillating = [self.turning[j] for j in self.joint]
        return {
            "cycles": table_of(cycles, oscillating),
            "joints": table_of(joints, self.turning),
            "growth": growth,
        }

    printed = {
        "cycles": ("joint", "kind", "amplitude [rad]", "frequency [Hz]"),
        "joints": (),
    }


class _Cycle(NamedTuple):
    joint: int
    kind: str
    amplitude: float
    frequency: float
    rate: float
    harmonics: int
    first_amplitude: float
    first_frequency: float


@checked
def friction_cycle(
    arm: MjcfArm,
    law: JointPD,
    Ts: Sample,
    delay: Delay = 0.0,
    counts: Annotated[int | None, Bound(1, 10**9)] = None,
) -> FrictionCycle:
    """Limit cycles of the joints of an arm under the friction that its law feeds forward.

    Args:
        arm: the arm at its pose, with Coulomb friction and damping of its joints.
        law: gains of the joints, and the friction fed forward, Fc tanh(k w) + Fv w.
        Ts: control sample [s], 1e-6 to 1.
        delay: from a sample to the torque computed from it [s], 0 to 10.
        counts: encoder counts a turn, from which the rate is had: it makes steps of
            2 pi/(counts Ts), and so caps the slope at rest at about Fc counts Ts/(2 pi).

    Raises:
        ParameterError: the law has another number of joints or feeds no friction forward, counts
            are given with an exact velocity, or a value is out of its bounds.
    """
    study = Study(arm, law, Ts, delay)
    if law.friction is None:
        raise ParameterError(
            "friction", None, "must be given in the law: (Fc, k, Fv) of each joint"
        )
    if counts is not None and law.velocity == "exact":
        raise ParameterError("counts", counts, "must be None where the velocity is exact")
    _check_turns(arm, law, counts)
    linear = replace(law, friction=tuple((0.0, 0.0, Fv) for _, _, Fv in law.friction))
    loop = study.remade(law=linear)
    fed = [Fed(Fc, k, loop, counts) for Fc, k, _ in law.friction]
    rubbed: Any = arm.friction
    joints = [Joint(loop, j, rubbed[j], fed[j]) for j in range(loop.n)]
    found = [cycle for joint in joints for cycle in joint.cycles()]
    columns: Any = list(zip(*found, strict=True)) or [()] * len(_Cycle._fields)
    bare = [name for name, x in zip(arm.names, joints, strict=True) if x.fed.Fc and not x.coulomb]
    told = f"no Coulomb friction at {', '.join(bare)}: all that is fed forward is excess"
    values: tuple[Any, ...] = (
        arm.names,
        loop.Ts,
        loop.delay,
        counts,
        loop.stable(),
        np.array(arm.friction),
        np.array([x.Fc for x in fed]),
        np.array([x.rests for x in joints]),
        np.array([x.slope + row[2] for x, row in zip(fed, law.friction, strict=True)]),
        np.array(columns[0], int),
        columns[1],
        *(np.array(column, float) for column in columns[2:5]),
        np.array(columns[5], int),
        *(np.array(column, float) for column in columns[6:]),
        np.array([joint.speeds for joint in joints]),
        np.array([joint.growth for joint in joints]),
        (*study.assumed()[:-1], *([told] if bare else []), OTHERS, LEFT_OUT),
        tuple(not turns for turns in arm.mechanism.turning),
    )
    return FrictionCycle(*values)


def _check_turns(arm: MjcfArm, law: JointPD, counts: int | None) -> None:
    """Refuses counts a turn of a joint that slides and is fed friction."""
    fed = zip(arm.names, arm.mechanism.turning, law.friction or (), strict=True)
    sliding = [name for name, turns, (Fc, *_) in fed if Fc and not turns]
    if counts is not None and sliding:
        bound = f"must be None: they are a turn, and {', '.join(sliding)} slides"
        raise ParameterError("counts", counts, bound)


# ---- what is fed forward -------------------------------------------------------------------------


class Fed:
    """The torque Fc tanh(k w) of a measured rate w; behind an encoder its mean at a true rate.

    Counts arrive one by one at slow rates. Each is a pulse of the measured rate, whose torque
    saturates; so the mean is below the law.
    """

    def __init__(self, Fc: float, k: float, loop: JointLoop, counts: int | None):
        self.Fc, self.k = Fc, k
        self._table: Any = None  # true rates [rad/s], and the mean torque at them [N.m]
        if counts is not None and Fc and k:
            self._table = self._mean(loop, 2.0 * math.pi / counts)

    def _law(self, w: np.ndarray) -> np.ndarray:
        return self.Fc * np.tanh(self.k * w)

    def _mean(self, loop: JointLoop, count: float) -> tuple[np.ndarray, np.ndarray]:
        """True rates [rad/s], and the mean torque at them [N.m]."""
        from scipy.signal import lfilter

        keep, gain = loop.rate_filter
        per_sample = np.geomspace(FEW * (1.0 - keep), MANY, RATES)
        read = np.floor(np.outer(per_sample, np.arange(COUNTED)))
        rates: Any = lfilter([gain * count, -gain * count], [1.0, -keep], read, axis=1)
        mean = self._law(rates[:, COUNTED // 2 :]).mean(axis=1)
        return per_sample * count / loop.Ts, mean

    def __call__(self, w: np.ndarray) -> np.ndarray:
        """Torque at rates [N.m]."""
        if self._table is None:
            return self._law(w)
        rates, mean = self._table
        size = np.abs(w)
        inside = np.interp(size, np.append(0.0, rates), np.append(0.0, mean))
        return np.sign(w) * np.where(size < rates[-1], inside, self._law(size))

    @property
    def slope(self) -> float:
        """At rest [N.m.s/rad]."""
        if self._table is None:
            return self.Fc * self.k
        return float(self._table[1][0] / self._table[0][0])

    def describing_function(self, A: float) -> float:
        """Its damping at a sine of the measured rate [N.m.s/rad]: that which it takes away."""
        sine = np.sin(0.5 * math.pi * (np.arange(POINTS) + 0.5) / POINTS)
        return float(2.0 * np.mean(self(A * sine) * sine) / A)


# ---- one joint -----------------------------------------------------------------------------------


class Joint:
    """A joint of a linear loop, with its Coulomb friction and what is fed forward for it."""

    def __init__(self, loop: JointLoop, j: int, coulomb: float, fed: Fed):
        self.loop, self.j, self.coulomb, self.fed = loop, j, coulomb, fed

    @cached_property
    def speeds(self) -> np.ndarray:
        """Rates searched [rad/s]."""
        n = 2 * DECADES * PER_DECADE + 1
        return np.geomspace(10.0**-DECADES, 10.0**DECADES, n) / (self.fed.k or 1.0)

    @cached_property
    def _stiffness(self) -> float:
        """That of the joint and its law, 0 for none [N.m/rad]."""
        total = self.loop.stiffness + self.loop.position
        own = abs(float(total[self.j, self.j]))
        return own if own > FREE * np.abs(total).max() else 0.0

    @property
    def rests(self) -> float:
        """Distance from the set point at which friction holds the joint [rad]."""
        return self.coulomb / self._stiffness if self._stiffness else math.inf

    @cached_property
    def _motions(self) -> np.ndarray:
        """Growth [1/s] and angular frequency [rad/s] of the motion at those rates, shape (2, l)."""
        found = [(math.nan, 0.0)]
        for V in self.speeds.tolist():
            found.append(self._motion(V, found[-1][1]))
        return np.array(found[1:]).T

    @property
    def growth(self) -> np.ndarray:
        """Growth of the motion at those rates [1/s], of a steady rate for a joint that drifts."""
        if not (self.fed.Fc * self.fed.k and self.loop.stable()):
            return np.full(len(self.speeds), math.nan)
        if self._stiffness:
            return self._motions[0]
        mass = 1.0 / np.linalg.inv(self.loop.inertia)[self.j, self.j]
        return np.array([self._excess(w) / (mass * w) for w in self.speeds.tolist()])

    def _motion(self, V: float, omega: float) -> tuple[float, float]:
        """Growth [1/s] and angular frequency [rad/s] of the largest motion of the loop.

        Args:
            V: largest rate of the joint [rad/s].
            omega: about its angular frequency, for the measured rate over the true one [rad/s].
        """
        loop, Ts = self.loop, self.loop.Ts
        measured = (
            V / omega * float(np.abs(loop.measured(np.array([omega * Ts])))[0]) if omega else V
        )
        damping, rate = loop.damping.copy(), loop.rate.copy()
        damping[self.j, self.j] += 4.0 * self.coulomb / (math.pi * V)
        rate[self.j, self.j] -= self.fed.describing_function(measured)
        z = replace(loop, damping=damping, rate=rate).eigenvalues[0]
        return math.log(max(abs(z), 1e-300)) / Ts, max(abs(float(np.angle(z))), 1e-9) / Ts

    def cycles(self) -> Iterator[_Cycle]:
        """Drifts, thresholds and limit cycles."""
        if not self.loop.stable():
            return
        if not self._stiffness:
            yield from self._drifts()
            return
        grows, before = self.growth > 0.0, []
        for i in np.flatnonzero(grows[:-1] != grows[1:]).tolist():
            first = self._first(i, bool(grows[i]))
            if grows[i + 1]:
                before = [self._cycle("threshold", first, first, 1)]
                continue
            found = self._limit_cycle(first)
            if found.amplitude > self.rests:  # else it stops where it turns around
                yield from (*before, found)
            before = []
        yield from before

    def _limit_cycle(self, first: _Balance) -> _Cycle:
        """The cycle with all harmonics, if they are found and it does not stick."""
        theta = first.omega * self.loop.Ts
        n = max(1, min(HARMONICS, int((FASTEST / theta + 1.0) / 2.0)))
        whole = self._balanced(n, first.rate, first.omega)
        if whole and whole.forward:
            return self._cycle("limit cycle", whole, first, n)
        return self._cycle("limit cycle", first, first, 1)

    def _first(self, i: int, grows: bool) -> _Balance:
        """The balance of the fundamental between two rates; by bisection if it is not found."""
        low, high = self.speeds[i : i + 2].tolist()
        omega = float(self._motions[1, i if grows else i + 1])
        found = self._balanced(1, math.sqrt(low * high), omega)
        if found and 0.5 * low < found.rate < 2.0 * high:
            return found
        V = roots.bisect(lambda V: (self._motion(V, omega)[0] > 0.0) is grows, low, high, 1e-9)[0]
        omega = self._motion(V, omega)[1]
        return _Balance(V / omega, omega, V, True)

    def _cycle(self, kind: str, best: _Balance, first: _Balance, n: int) -> _Cycle:
        hertz = [x.omega / (2.0 * math.pi) for x in (best, first)]
        return _Cycle(
            self.j, kind, best.amplitude, hertz[0], best.rate, n, first.amplitude, hertz[1]
        )

    def _excess(self, w: float) -> float:
        """Torque that speeds a steady rate up: what is fed forward less friction and damping."""
        brake = float((self.loop.damping + self.loop.rate)[self.j, self.j])
        return float(self.fed(np.array([w]))[0]) - self.coulomb - brake * w

    def _drifts(self) -> Iterator[_Cycle]:
        """Steady rates to which nearby ones tend."""
        speeds = self.speeds.tolist()
        for a, b in zip(speeds[:-1], speeds[1:], strict=True):
            if self._excess(a) > 0.0 >= self._excess(b):
                w = roots.bisect(lambda x: self._excess(x) > 0.0, a, b, 1e-9)[0]
                yield _Cycle(self.j, "drift", math.nan, 0.0, w, 1, math.nan, 0.0)

    def _balanced(self, n: int, V: float, omega: float) -> _Balance | None:
        """The cycle with n odd harmonics near a rate and frequency; None if it is not found."""
        from scipy.optimize import root

        order = 2 * np.arange(n) + 1
        square = -4j * self.coulomb / (math.pi * order)  # friction of a rate that is > 0 first

        def over_time(waves: np.ndarray) -> np.ndarray:
            spectrum = np.zeros(POINTS // 2 + 1, complex)
            spectrum[order] = 0.5 * POINTS * waves
            return np.fft.irfft(spectrum)

        def waves(x: np.ndarray) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
            """Angular frequency, and harmonics: measured rate assumed, found, position."""
            omega_, v = (
                omega * math.exp(np.clip(x[0], -WIDE, WIDE)),
                V * (x[1 : n + 1] + 1j * x[n + 1 :]),
            )
            theta = omega_ * self.loop.Ts * order
            q_held, v_held = (y[:, self.j, self.j] for y in self.loop.responses(theta))
            q_own, v_own = (y[:, self.j, self.j] for y in self.loop.between_responses(theta))
            torque = 2.0 / POINTS * np.fft.rfft(self.fed(over_time(v)))[order]
            found = v_held * torque - v_own * square
            return omega_, v, found, q_held * torque - q_own * square

        def misses(x: np.ndarray) -> np.ndarray:
            omega_, v, found, q = waves(x)
            miss = (v - found) / V
            return np.concatenate(
                [[np.sum((1j * omega_ * order * q).real) / V], miss.real, miss.imag]
            )

        start = np.zeros(2 * n + 1)
        first = self.loop.measured(np.array([omega * self.loop.Ts]))[0] / (1j * omega) * -1j
        start[[1, n + 1]] = first.real, first.imag
        solution = root(misses, start, tol=1e-12)
        if not np.abs(misses(solution.x)).max() < SOLVED:
            return None
        omega_, _, _, q = waves(solution.x)
        rate = over_time(1j * omega_ * order * q)
        forward = rate[: POINTS // 2].min() > -BACKWARDS * rate.max()
        return _Balance(float(abs(np.sum(q.real))), omega_, float(rate.max()), bool(forward))


class _Balance(NamedTuple):
    amplitude: float
    omega: float
    rate: float
    forward: bool  # whether it does not turn around within half a period
