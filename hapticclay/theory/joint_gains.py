"""Which gain, rate and delay an arm's joints carry: exact limits of their sampled loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from .. import matrices
from ..arguments import checked, named
from ..arms.joint_law import JointPD, checked_law, compensated
from ..arms.joint_units import Joints, of_joint, table_of
from ..arms.mechanism import Linear
from ..arms.mjcf_arm import MjcfArm
from ..display import time_words
from ..results import Result, Tables
from . import file_servo, joint_changes, joint_crossings, roots
from .client_loop import Delay, Sample
from .joint_changes import Edge, Number, slopes
from .joint_crossings import Crossing
from .joint_families import Circle, Family, Limit
from .joint_loop import Drive, JointLoop, grid, is_stable, timing_words

LATEST = 2.0  # [s] largest added delay that is looked for
SLOWEST = 1.0  # [s] largest control sample that is looked for
PERIODS = 120  # control samples tried, evenly in their logarithm
BEYOND = 1e-6  # share beyond a limit at which its motion is looked at
ROUNDS = 30  # of the search for a delay
SMALL = "small motions about the pose"
IGNORED = "joint friction, counts, converters, torque limits, backlash, elastic links: left out"


@named
@dataclass(frozen=True, repr=False, eq=False)
class JointLimits(Joints, Result):
    """What the joints of an arm carry at a pose, all coupled.

    A pair (least, largest) is the interval of a gain around the present one in which the loop is
    stable, the others as they are; of an unstable loop the nearest such interval, NaN if there is
    none.

    Attributes:
        names: joints, shape (n,).
        stiffness: present Kp [N.m/rad], shape (n,).
        damping: present Kd [N.m.s/rad], shape (n,).
        Ts: control sample [s].
        delay: from a sample to its torque [s].
        radius: largest eigenvalue of the map over a sample: below 1 the loop is stable.
        frequency: of that motion [Hz].
        joint: joint that moves most in it.
        scale: largest factor of all Kp; NaN if no factor is stable.
        buzz: frequency at that factor [Hz].
        Kp: least and largest Kp of each joint [N.m/rad], shape (n, 2).
        Kp_buzz: frequency at the largest [Hz], shape (n,); NaN without one.
        Kd: least and largest Kd of each joint [N.m.s/rad], shape (n, 2).
        Kd_scale: least and largest factor of all Kd.
        delay_left: delay that may be added [s]; 0 if the loop is unstable; inf for more than 2 s.
        slowest_rate: lowest rate up to the present one down to which the loop is stable [Hz].
        slope: present slope of the friction fed forward at rest [N.m.s/rad], shape (n,).
        friction_slope: largest slope of a friction fed forward at rest, Fc k + Fv, of each joint
            [N.m.s/rad], shape (n,).
        Kp_change: change of the largest Kp of each joint with its rotor inertia
            [N.m/rad/(kg.m^2)], its damping [1/s] and the delay [N.m/rad/s], shape (n, 3).
        Kd_change: the same of the largest Kd [1/s, 1, N.m/rad], shape (n, 3).
        friction_slope_change: the same of the largest slope, shape (n, 3); a least Kd above 0
            changes by its negative.
        scale_change: change of the factor of all Kp with rotor inertia and damping of each joint
            [1/(kg.m^2), rad/(N.m.s)], shape (n, 2).
        scale_per_delay: change of that factor with the delay [1/s].
        Kd_scale_change: the same of the least and the largest factor of all Kd, shape (2, n, 2).
        Kd_scale_per_delay: change of these with the delay [1/s].
        delay_change: change of the delay left with rotor inertia and damping of each joint
            [s/(kg.m^2), rad/(N.m)], shape (n, 2); with the delay it changes by -1.
        rate_change: change of the lowest rate with these [Hz/(kg.m^2), Hz.rad/(N.m.s)],
            shape (n, 2).
        rate_per_delay: change of the lowest rate with the delay [Hz/s].
        assumed: what the verdict rests on, and what it leaves out, a sentence each.
        slides: whether each joint slides; then its units are those of forces and lengths.
    """

    drawn_by = "hapticclay.views.joint_plots:limits_plot"
    written_as = "limits"
    printed = {
        "joints": (
            "joint",
            "Kp [N.m/rad]",
            "largest Kp [N.m/rad]",
            "buzz [Hz]",
            "Kd [N.m.s/rad]",
            "least Kd [N.m.s/rad]",
            "largest Kd [N.m.s/rad]",
        )
    }

    names: tuple[str, ...]
    stiffness: np.ndarray
    damping: np.ndarray
    Ts: float
    delay: float
    radius: float
    frequency: float
    joint: str
    scale: float
    buzz: float
    Kp: np.ndarray
    Kp_buzz: np.ndarray
    Kd: np.ndarray
    Kd_scale: tuple[float, float]
    delay_left: float
    slowest_rate: float
    slope: np.ndarray
    friction_slope: np.ndarray
    Kp_change: np.ndarray
    Kd_change: np.ndarray
    friction_slope_change: np.ndarray
    scale_change: np.ndarray
    scale_per_delay: float
    Kd_scale_change: np.ndarray
    Kd_scale_per_delay: tuple[float, float]
    delay_change: np.ndarray
    rate_change: np.ndarray
    rate_per_delay: float
    assumed: tuple[str, ...] = ()
    slides: tuple[bool, ...] = ()

    @property
    def stable(self) -> bool:
        """Whether the present gains are stable, to rounding."""
        return bool(is_stable(self.radius))

    def headline(self) -> str:
        """The verdict in one line."""
        at = timing_words(self.Ts, self.delay)
        if not self.stable:
            told = (
                f"unstable at {at}: radius {self.radius:.4g}, {self.frequency:.4g} Hz, {self.joint}"
            )
            return told + f"; {self._way_back()}"
        more = (
            "any factor"
            if math.isinf(self.scale)
            else f"{self.scale:.4g} times ({self.buzz:.3g} Hz)"
        )
        return f"stable at {at}: all Kp up to {more}, delay left {self._left}, {self.joint} first"

    @property
    def _left(self) -> str:
        """Delay that may be added, in words."""
        return time_words(self.delay_left, LATEST)

    def _way_back(self) -> str:
        if math.isnan(self.scale):
            return "no common factor of Kp is stable"
        return f"all Kp times {self.scale:.4g} or less would be stable"

    def remarks(self) -> Sequence[str]:
        """What to change first, and what the verdict rests on."""
        return [self.headline(), f"first to change: {self.advice()}", *self.assumed]

    def advice(self) -> str:
        """The change that gains most, or that brings an unstable loop back."""
        j = self.names.index(self.joint)
        if not self.stable:
            slope, most = self.slope[j], self.friction_slope[j]
            if slope > 0.0 and not slope < most:
                limit = "" if math.isnan(most) else f", at most {most:.4g}"
                unit = of_joint("N.m.s/rad", self.turning[j])
                return f"friction fed forward at {self.joint}: slope {slope:.4g} {unit}{limit}"
            low, high = self.Kp[j]
            if high > low and high < self.stiffness[j]:
                unit = of_joint("N.m/rad", self.turning[j])
                return f"Kp of {self.joint}, {self.stiffness[j]:.4g} to {high:.4g} {unit} or less"
            return "delay and rate: no Kp of one joint is stable" if math.isnan(high) else "Kp"
        if math.isinf(self.scale):
            return "nothing: no factor of Kp buzzes"
        if self.delay:
            shorter = min(self.delay, 1e-3)
            gain = -shorter * self.scale_per_delay
            less = f"{1e3 * shorter:.3g} ms less raises the factor of all Kp by {gain:.3g}"
            return f"delay ({self._left} left): {less}"
        return f"rate ({1.0 / self.Ts:.4g} Hz, at least {self.slowest_rate:.4g} Hz needed)"

    def tables(self) -> Tables:
        """Gains and limits of each joint; how the limits move; the whole arm."""
        joints: dict[str, Any] = {
            "joint": self.names,
            "Kp [N.m/rad]": self.stiffness,
            "least Kp [N.m/rad]": self.Kp[:, 0],
            "largest Kp [N.m/rad]": self.Kp[:, 1],
            "buzz [Hz]": self.Kp_buzz,
            "Kd [N.m.s/rad]": self.damping,
            "least Kd [N.m.s/rad]": self.Kd[:, 0],
            "largest Kd [N.m.s/rad]": self.Kd[:, 1],
            "friction slope [N.m.s/rad]": self.slope,
            "largest friction slope [N.m.s/rad]": self.friction_slope,
        }
        moves: dict[str, Any] = {"joint": self.names}
        for name, by, unit in (
            ("largest Kp", self.Kp_change, "N.m/rad"),
            ("largest Kd", self.Kd_change, "N.m.s/rad"),
            ("largest friction slope", self.friction_slope_change, "N.m.s/rad"),
        ):
            moves |= {f"{name} per {x}": by[:, i] for i, x in enumerate(_per(unit))}
        for name, by, unit in (
            ("factor of Kp", self.scale_change, "1"),
            ("least factor of Kd", self.Kd_scale_change[0], "1"),
            ("largest factor of Kd", self.Kd_scale_change[1], "1"),
            ("delay left", self.delay_change, "s"),
            ("lowest rate", self.rate_change, "Hz"),
        ):
            moves |= {f"{name} per {x}": by[:, i] for i, x in enumerate(_per(unit)[:2])}
        arm: dict[str, Any] = {
            "radius": self.radius,
            "frequency [Hz]": self.frequency,
            "joint": self.joint,
            "largest factor of all Kp": self.scale,
            "buzz [Hz]": self.buzz,
            "least factor of all Kd": self.Kd_scale[0],
            "largest factor of all Kd": self.Kd_scale[1],
            "delay left [s]": self.delay_left,
            "lowest rate [Hz]": self.slowest_rate,
            "factor of Kp per delay [1/s]": self.scale_per_delay,
            "least factor of Kd per delay [1/s]": self.Kd_scale_per_delay[0],
            "largest factor of Kd per delay [1/s]": self.Kd_scale_per_delay[1],
            "lowest rate per delay [Hz/s]": self.rate_per_delay,
        }
        by_joint = {"joints": joints, "sensitivity": moves}
        shown = {name: table_of(table, self.turning) for name, table in by_joint.items()}
        return {**shown, "arm": {k: [v] for k, v in arm.items()}}


def _per(unit: str) -> list[str]:
    """Numbers over which a limit of a unit changes, with units."""
    over = (("rotor inertia", "kg.m^2"), ("damping", "N.m.s/rad"), ("delay", "s"))
    return [f"{name} [({unit})/({by})]" for name, by in over]


def joint_loop(
    linear: Linear,
    law: JointPD,
    Ts: float,
    delay: float,
    compensated: bool,
    gains: tuple[np.ndarray, np.ndarray] | None = None,
) -> JointLoop:
    """The loop of an arm at a pose under a law; what a continuous drive does acts between samples.

    Gains, if given, replace Kp and Kd of the law, and may be negative.
    """
    stiffness, damping = (np.diag(x) for x in gains or (law.Kp, law.Kd))
    held, driven = (1.0, 0.0) if law.runs == "host" else (0.0, 1.0)
    drive = None
    if law.drive_rate is not None:
        drive = Drive(stiffness, damping, max(1, round(law.drive_rate * Ts)))
    forward = linear.gravity_stiffness * float(compensated)
    return JointLoop(
        linear.inertia,
        linear.damping + driven * damping,
        linear.stiffness + linear.gravity_stiffness + driven * stiffness,
        held * stiffness - forward,
        held * damping - np.diag(law.slopes),
        Ts,
        delay,
        law.velocity,
        law.cutoff,
        drive,
    )


@checked
def joint_limits(arm: MjcfArm, law: JointPD, Ts: Sample, delay: Delay = 0.0) -> JointLimits:
    """Exact limits of gains, delay and rate of an arm's joints, at its pose.

    The arm is linear about its pose: M(q), damping and gravity as the engine has them, constraints
    as rigid. The host's torques act `delay` after the sample and are held for Ts.

    Args:
        arm: the arm at its pose.
        law: gains of the joints, and where they act.
        Ts: control sample [s], 1e-6 to 1.
        delay: from a sample to the torque computed from it [s], 0 to 10.

    Raises:
        ParameterError: the law has another number of joints, or a value is out of its bounds.
    """
    study = Study(arm, law, Ts, delay)
    loop, joints = study.loop, range(len(law))
    all_Kp = study.family("Kp")
    of_Kp, scale = [study.family("Kp", j).limit() for j in joints], all_Kp.limit()
    of_Kd, of_all_Kd = [study.family("Kd", j).limit() for j in joints], study.family("Kd").limit()
    radius, frequency, _ = worst_motion(loop)
    slope = np.array(law.slopes)
    left, rate = delay_crossing(loop), slowest_rate(study)
    return JointLimits(
        names=arm.names,
        stiffness=np.array(law.Kp),
        damping=np.array(law.Kd),
        Ts=loop.Ts,
        delay=loop.delay,
        radius=radius,
        frequency=frequency,
        joint=arm.names[first_joint(all_Kp, scale)],
        scale=scale.high,
        buzz=scale.frequency(loop.Ts),
        Kp=_ends(of_Kp),
        Kp_buzz=np.array([x.frequency(loop.Ts) for x in of_Kp]),
        Kd=_ends(of_Kd),
        Kd_scale=(of_all_Kd.low, of_all_Kd.high),
        delay_left=left.change,
        slowest_rate=rate,
        slope=slope,
        friction_slope=slope + np.array(law.Kd) - np.array([x.free_low for x in of_Kd]),
        **study.changes(of_Kp, of_Kd, (scale, of_all_Kd)),
        **study.timing_changes(left, rate),
        assumed=study.assumed(),
        slides=tuple(not turns for turns in arm.mechanism.turning),
    )


def gravity_words(compensated: bool) -> str:
    """What holds the arm, as results say it."""
    return f"gravity: {'fed forward from the measured pose' if compensated else 'acts'}"


def _ends(limits: Sequence[Limit]) -> np.ndarray:
    return np.array([[x.low, x.high] for x in limits])


class Study:
    """An arm at its pose under a law, remade with other numbers."""

    def __init__(
        self,
        arm: MjcfArm,
        law: JointPD,
        Ts: float,
        delay: float,
        q: Sequence[float] | np.ndarray | None = None,
    ):
        self.Ts, self.delay = Ts, delay
        self._known: dict[tuple[int, float, float], tuple[Linear, JointLoop]] = {}
        self.arm, self.law = arm, checked_law(law, arm.names)
        law.drive_samples(Ts)  # refuses a rate that is no multiple
        self.compensated = compensated(arm, law)
        self.linear = arm.linear(q)
        self.loop = self.remade()
        self.circle = Circle(self.loop)

    def remade(self, **changes: Any) -> JointLoop:
        """The loop with another linear arm, law, gains, Ts or delay."""
        now = {name: getattr(self, name) for name in ("linear", "law", "Ts", "delay")} | changes
        loop = joint_loop(**now, compensated=self.compensated)
        if now["law"].runs == "drive":
            return loop
        key = id(now["linear"]), loop.Ts, loop.delay  # gains of the host alone differ
        return loop.held_as(self._known.setdefault(key, (now["linear"], loop))[1])

    def changed(self, kind: str, joint: int | None = None) -> Callable[..., JointLoop]:
        """The loop at a change u of Kp or Kd of a joint, or of their common factor, and others."""
        i, weights = self._weights(kind, joint)

        def changed(u: float, **changes: Any) -> JointLoop:
            gains = np.array([self.law.Kp, self.law.Kd])
            gains[i] += u * weights
            return self.remade(gains=(gains[0], gains[1]), **changes)

        return changed

    def _weights(self, kind: str, joint: int | None) -> tuple[int, np.ndarray]:
        i = ("Kp", "Kd").index(kind)
        of_all = np.array((self.law.Kp, self.law.Kd)[i])
        return i, of_all if joint is None else np.eye(len(self.law))[joint]

    def family(self, kind: str, joint: int | None = None) -> Family:
        """Loops of other gains Kp or Kd of a joint; of a common factor of all joints for None."""
        (i, weights), unit = self._weights(kind, joint), np.eye(len(self.law))
        used = slice(None) if joint is None else slice(joint, joint + 1)
        left, right = (weights[:, None] * unit)[:, used], unit[:, used]
        present = 1.0 if joint is None else float((self.law.Kp, self.law.Kd)[i][joint])
        of, held = ("position", "rate")[i], self.law.runs == "host"
        changed = self.changed(kind, joint)
        return Family(self.circle, of, left, right, present, changed, held)  # type: ignore[arg-type]

    # ---- how limits move

    @cached_property
    def _numbers(self) -> list[list[Number]]:
        return joint_changes.numbers(self.linear, self.delay, self.Ts)

    def _slopes(
        self, kind: str, joint: int | None, end: tuple[float, float], over: Sequence[Number]
    ) -> np.ndarray:
        """Change of a limit and of its angle, of a gain or a common factor, per number."""
        gains, changed = (self.law.Kp, self.law.Kd)["Kp" != kind], self.changed(kind, joint)
        present, size = (1.0, 1.0) if joint is None else (gains[joint], max(gains))

        def at(x: float, **changes: Any) -> JointLoop:
            return changed(x - present, **changes)

        return slopes(Edge(at, *end, size), over)

    def changes(
        self, of_Kp: Sequence[Limit], of_Kd: Sequence[Limit], common: tuple[Limit, Limit]
    ) -> dict[str, Any]:
        """How limits of gains change with rotor inertia, damping and delay, by name."""
        (rotors, dampings, late), n = self._numbers, len(self.law)

        def own(kind: str, ends: Sequence[tuple[float, float]]) -> np.ndarray:
            over = [[rotors[j], dampings[j], *late] for j in range(n)]
            return np.array([self._slopes(kind, j, ends[j], over[j]) for j in range(n)])

        def whole(kind: str, end: tuple[float, float]) -> tuple[np.ndarray, float]:
            *by_arm, by_delay = self._slopes(kind, None, end, [*rotors, *dampings, *late]).tolist()
            return np.array(by_arm).reshape(2, n).T, by_delay

        scale, least, largest = (
            whole("Kp", common[0].upper),
            whole("Kd", common[1].lower),
            whole("Kd", common[1].upper),
        )
        return {
            "Kp_change": own("Kp", [x.upper for x in of_Kp]),
            "Kd_change": own("Kd", [x.upper for x in of_Kd]),
            "friction_slope_change": -own("Kd", [x.lower for x in of_Kd]),
            "scale_change": scale[0],
            "scale_per_delay": scale[1],
            "Kd_scale_change": np.array([least[0], largest[0]]),
            "Kd_scale_per_delay": (least[1], largest[1]),
        }

    def timing_changes(self, left: Crossing, rate: float) -> dict[str, Any]:
        """How the delay left and the lowest rate change, by name."""
        (rotors, dampings, late), n = self._numbers, len(self.law)
        most = Edge(
            lambda T, **changes: self.remade(delay=T, **changes),
            self.delay + left.change,
            left.theta,
            self.Ts,
        )
        by_delay = slopes(most, [*rotors, *dampings]).reshape(2, n).T
        Ts = 1.0 / rate
        theta = _angle(self.remade(Ts=Ts)) if SLOWEST > Ts > self.Ts else math.nan
        longest = Edge(lambda T, **changes: self.remade(Ts=T, **changes), Ts, theta, Ts)
        by_rate = -(rate**2) * slopes(longest, [*rotors, *dampings, *late])
        return {
            "delay_change": by_delay,
            "rate_change": by_rate[:-1].reshape(2, n).T,
            "rate_per_delay": float(by_rate[-1]),
        }

    def _elsewhere(self) -> tuple[str, float]:
        """Where else the law may run, the host or drives, and the radius of its loop there."""
        if self.law.runs == "drive":
            at = timing_words(self.Ts, self.delay)
            return f"in a host at {at}", self.remade(law=replace(self.law, runs="host")).radius()
        loop = self.remade(law=replace(self.law, runs="drive"))
        return "in drives, whose own loops count as continuous (runs drive)", loop.radius()

    def assumed(self) -> tuple[str, ...]:
        """What the verdict rests on, a sentence each."""
        held = f"{SMALL}, no hand at the handle"
        law = f"law: {self.law.words}"
        own = file_servo.words(self.arm, self.law, self._elsewhere())
        return (*own, *self.arm.notes, gravity_words(self.compensated), law, held, IGNORED)


# ---- present motion, delay and rate --------------------------------------------------------------


def worst_motion(loop: JointLoop) -> tuple[float, float, int]:
    """Size of the largest eigenvalue, its frequency [Hz], and the joint that moves most in it."""
    values, vectors = matrices.eigenvectors(loop.map())
    size = loop.radius()
    i = int(np.argmin(np.abs(np.abs(values) - size)))
    frequency = abs(np.angle(values[i])) / (2.0 * math.pi * loop.Ts)
    energy = np.abs(vectors[: loop.n, i]) * np.sqrt(np.diag(loop.inertia))
    return size, float(frequency), int(energy.argmax())


def first_joint(family: Family, limit: Limit) -> int:
    """The joint that moves most in an unstable loop, or just beyond the limit of a stable one."""
    beyond = family.circle.stable and math.isfinite(limit.high)
    change = (1.0 + BEYOND) * limit.high - family.present if beyond else 0.0
    return worst_motion(family.changed(change))[2]


def delay_crossing(loop: JointLoop) -> Crossing:
    """Delay that may be added to a stable loop [s], and the angle of the eigenvalue there.

    0 for an unstable loop, inf for more than 2 s. With whole samples more of delay, a crossing is
    where an eigenvalue of the open loop has size 1 and turns into 1. The share of a sample moves it
    little, so a few rounds find it.
    """
    if not loop.stable():
        return Crossing(0.0, math.nan)
    total, theta = loop.delay, math.nan
    for turn in range(ROUNDS):
        samples, theta = samples_left(loop.with_delay(total), 0.5 if turn else 0.0)
        more = samples * loop.Ts
        if math.isinf(more) or total + more - loop.delay > LATEST:
            return Crossing(math.inf, math.nan)
        total += more
        if abs(more) <= 1e-12 * (total + loop.Ts):
            break
    return Crossing(max(0.0, total - loop.delay), theta)


def samples_left(loop: JointLoop, before: float = 0.0) -> Crossing:
    """Whole samples of delay, as a real number, until the first crossing; inf for none.

    Args:
        loop: the loop.
        before: how far a crossing may lie before the present delay [samples].
    """
    theta, x = joint_crossings.zeros(loop.opened, grid(loop), joint_crossings.log_size)
    late = np.angle(x)[:, None] / theta[:, None] + np.arange(-1, 3) * 2.0 * math.pi / theta[:, None]
    late = np.where(late >= -before, late, math.inf)
    if not len(theta):
        return Crossing(math.inf, math.nan)
    i = int(late.min(axis=1).argmin())
    return Crossing(float(late[i].min()), float(theta[i]))


def _angle(loop: JointLoop) -> float:
    """Angle of the largest eigenvalue of the map [rad]."""
    return abs(float(np.angle(loop.eigenvalues[0])))


def slowest_rate(study: Study) -> float:
    """Lowest rate down to which a stable loop stays so, at the same delay [Hz]; NaN if unstable."""
    if not study.loop.stable():
        return math.nan

    def stable(Ts: float) -> bool:
        return study.remade(Ts=Ts).stable()

    low = study.Ts
    for high in np.geomspace(study.Ts, SLOWEST, PERIODS)[1:].tolist():
        if not stable(high):
            return 1.0 / roots.bisect(stable, low, high, 1e-9)[0]
        low = high
    return 1.0 / SLOWEST
