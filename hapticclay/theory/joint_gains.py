"""Which gain, rate and delay an arm's joints carry: exact limits of their sampled loop."""

from __future__ import annotations

import cmath
import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import JointPD, checked_law, compensated
from ..arms.joint_units import Joints, table_of
from ..arms.mechanism import Linear
from ..arms.mjcf_arm import MjcfArm
from ..display import time_words
from ..results import Result, Tables
from . import file_servo, joint_changes, joint_scan
from .client_loop import Delay, Sample
from .joint_advice import Room, advise, factor_words
from .joint_changes import Edge, Number, slopes
from .joint_crossings import Crossing
from .joint_delays import LATEST, delay_left
from .joint_families import Circle, Family, Limit
from .joint_loop import Drive, JointLoop, timing_words

SLOWEST = 1.0  # [s] largest control sample that is looked for
PERIODS = 120  # control samples tried, evenly in their logarithm
SLOW = 0.1  # [rad] that a joint of typical gains moves by while its torque is late
BEYOND = 1e-6  # share beyond a limit at which its motion is looked at
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
        least_scale: least factor of all Kp, mostly 0; NaN if no factor is stable.
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
        advised: what to change first, in words, tried by the exact map.
        change: fields of the law, Ts or delay with that change; empty for no change.
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
    least_scale: float
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
    advised: str = ""
    change: dict[str, Any] = field(default_factory=dict)

    @property
    def stable(self) -> bool:
        """Whether the present gains are stable, to rounding."""
        return self.radius <= 1.0

    def headline(self) -> str:
        """The verdict in one line."""
        at = timing_words(self.Ts, self.delay)
        if not self.stable:
            size = f"{self.radius:.4g}" if self.radius > 1.0005 else f"1 + {self.radius - 1.0:.2g}"
            motion = f"radius {size}, {self.frequency:.4g} Hz, {self.joint}"
            return f"unstable at {at}: {motion}; {self._way_back()}"
        return f"stable at {at}: {self._room()}, delay left {self._left}, {self.joint} first"

    def _room(self) -> str:
        """By how much the gains may rise, in words."""
        if self.stiffness.any():
            kind, high, at = "Kp", self.scale, f" ({self.buzz:.3g} Hz)"
        else:
            kind, high, at = "Kd", self.Kd_scale[1], ""
            if not self.damping.any():
                return "no gains"
        more = "any factor" if math.isinf(high) else f"{high:.4g} times{at}"
        return f"{'no Kp, ' if kind == 'Kd' else ''}all {kind} up to {more}"

    @property
    def _left(self) -> str:
        """Delay that may be added, in words."""
        return time_words(self.delay_left, LATEST)

    def _way_back(self) -> str:
        for kind, gains, (low, high) in (
            ("Kp", self.stiffness, (self.least_scale, self.scale)),
            ("Kd", self.damping, self.Kd_scale),
        ):
            if gains.any() and low <= high:
                return factor_words(kind, low, high)
        return "no common factor of Kp or of Kd is stable"

    def remarks(self) -> Sequence[str]:
        """What to change first, and what the verdict rests on."""
        return [self.headline(), f"first to change: {self.advice()}", *self.assumed]

    def advice(self) -> str:
        """The change that gains most, or that brings an unstable loop back."""
        return self.advised

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
            "least factor of all Kp": self.least_scale,
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
    of_Kp, of_Kd = ([study.family(kind, j).limit() for j in joints] for kind in ("Kp", "Kd"))
    scale, of_all_Kd = all_Kp.limit(), study.family("Kd").limit()
    of_friction = study.friction_limits(of_Kd)
    radius, frequency, _ = worst_motion(loop)
    slope = np.array(law.slopes)
    slopes = slope - np.array([x.free_low for x in of_friction])
    left, longest = delay_left(loop), slowest_rate(study)
    slowest = 1.0 / min(longest.change, SLOWEST)
    room = Room(of_Kp, of_Kd, scale, of_all_Kd, slopes, left.change, slowest)
    advice = advise(study, room)
    return JointLimits(
        names=arm.names,
        stiffness=np.array(law.Kp),
        damping=np.array(law.Kd),
        Ts=loop.Ts,
        delay=loop.delay,
        radius=radius,
        frequency=frequency,
        joint=arm.names[first_joint(all_Kp, scale)],
        least_scale=scale.low,
        scale=scale.high,
        buzz=scale.frequency(loop.Ts),
        Kp=_ends(of_Kp),
        Kp_buzz=np.array([x.frequency(loop.Ts) for x in of_Kp]),
        Kd=_ends(of_Kd),
        Kd_scale=(of_all_Kd.low, of_all_Kd.high),
        delay_left=left.change,
        slowest_rate=slowest,
        slope=slope,
        friction_slope=slopes,
        **study.changes(of_Kp, of_Kd, of_friction, (scale, of_all_Kd)),
        **study.timing_changes(left, longest),
        assumed=study.assumed(),
        advised=advice.words,
        change=advice.change,
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
        self._begin()

    def _begin(self) -> None:
        self.loop = self.remade()
        self.circle = Circle(self.loop)

    def at(self, **changes: Any) -> Study:
        """The same arm under another law, at another Ts or delay."""
        out = copy.copy(self)
        for name, value in changes.items():
            setattr(out, name, value)
        out._known = {}
        out.__dict__.pop("_numbers", None)
        out._begin()
        return out

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
        size = present or self._size(kind, joint or 0)
        return Family(self.circle, of, left, right, present, changed, size, held)  # type: ignore[arg-type]

    def _size(self, kind: str, joint: int) -> float:
        """A typical gain of a joint that has none."""
        mass = float(self.linear.inertia[joint, joint])
        return mass * (SLOW / (self.Ts + self.delay)) ** (2 if kind == "Kp" else 1)

    def friction_limits(self, of_Kd: Sequence[Limit]) -> list[Limit]:
        """Stable damping that the host may add to each joint; less is friction fed forward."""
        if self.law.runs == "host":
            Kd = self.law.Kd
            return [x.moved(-own) for x, own in zip(of_Kd, Kd, strict=True)]
        out = []
        for j, e in enumerate(np.eye(len(self.law))):
            along, size = e[:, None], self._size("Kd", j)
            held = Family(
                self.circle, "rate", along, along, 0.0, self.fed(e), size, least=-math.inf
            )
            out.append(held.limit())
        return out

    def fed(self, along: np.ndarray) -> Callable[..., JointLoop]:
        """The loop at a damping u that the host adds along a joint, and other changes."""
        square = np.outer(along, along)

        def changed(u: float, **changes: Any) -> JointLoop:
            return self.remade(**changes).feeding(0.0 * square, u * square)

        return changed

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
        size = size or self._size(kind, joint or 0)

        def at(x: float, **changes: Any) -> JointLoop:
            return changed(x - present, **changes)

        return slopes(Edge(at, *end, size), over)

    def changes(
        self,
        of_Kp: Sequence[Limit],
        of_Kd: Sequence[Limit],
        of_friction: Sequence[Limit],
        common: tuple[Limit, Limit],
    ) -> dict[str, Any]:
        """How limits of gains change with rotor inertia, damping and delay, by name."""
        (rotors, dampings, late), n = self._numbers, len(self.law)

        over = [[rotors[j], dampings[j], *late] for j in range(n)]

        def own(kind: str, ends: Sequence[tuple[float, float]]) -> np.ndarray:
            return np.array([self._slopes(kind, j, ends[j], over[j]) for j in range(n)])

        def of_slope(j: int) -> np.ndarray:
            edge = Edge(self.fed(np.eye(n)[j]), *of_friction[j].lower, self._size("Kd", j))
            return -slopes(edge, over[j])

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
            "friction_slope_change": np.array([of_slope(j) for j in range(n)]),
            "scale_change": scale[0],
            "scale_per_delay": scale[1],
            "Kd_scale_change": np.array([least[0], largest[0]]),
            "Kd_scale_per_delay": (least[1], largest[1]),
        }

    def timing_changes(self, left: Crossing, longest: Crossing) -> dict[str, Any]:
        """How the delay left and the lowest rate change, by name."""
        (rotors, dampings, late), n = self._numbers, len(self.law)
        most = Edge(
            lambda T, **changes: self.remade(delay=T, **changes),
            self.delay + left.change,
            left.theta,
            self.Ts,
        )
        by_delay = slopes(most, [*rotors, *dampings]).reshape(2, n).T
        Ts = longest.change
        most_Ts = Edge(lambda T, **changes: self.remade(Ts=T, **changes), Ts, longest.theta, Ts)
        by_rate = -slopes(most_Ts, [*rotors, *dampings, *late]) / Ts**2
        return {
            "delay_change": by_delay,
            "rate_change": by_rate[:-1].reshape(2, n).T,
            "rate_per_delay": float(by_rate[-1]),
        }

    def _elsewhere(self) -> tuple[str, float]:
        """Where else the law may run, the host or drives, and the radius of its loop there."""
        if self.law.runs == "drive":
            at = timing_words(self.Ts, self.delay)
            return f"in a host at {at}", self.remade(
                law=replace(self.law, runs="host", drive_rate=None)
            ).radius()
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
    z = complex(loop.eigenvalues[0])
    energy = np.abs(loop.shape(z)) * np.sqrt(np.diag(loop.inertia))
    return loop.radius(), abs(cmath.phase(z)) / (2.0 * math.pi * loop.Ts), int(energy.argmax())


def first_joint(family: Family, limit: Limit) -> int:
    """The joint that moves most in an unstable loop, or just beyond the limit of a stable one."""
    beyond = family.circle.stable and math.isfinite(limit.high)
    change = (1.0 + BEYOND) * limit.high - family.present if beyond else 0.0
    return worst_motion(family.changed(change))[2]


def slowest_rate(study: Study) -> Crossing:
    """Longest sample up to which a stable loop stays so, and the angle of the eigenvalue there.

    At the same delay, [s]; NaN if the loop is unstable, inf for more than 1 s.
    """
    if not study.loop.stable():
        return Crossing(math.nan, math.nan)
    points = np.geomspace(study.Ts, SLOWEST, PERIODS).tolist()
    found = joint_scan.changes(lambda Ts: study.remade(Ts=Ts), points)
    return next(found, Crossing(math.inf, math.nan))
