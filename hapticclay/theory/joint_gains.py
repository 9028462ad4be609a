"""Which gain, rate and delay an arm's joints carry: exact limits of their sampled loop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import JointPD, checked_law
from ..arms.mechanism import Linear
from ..arms.mjcf_arm import MjcfArm
from ..results import Result, Tables
from . import joint_crossings, roots
from .client_loop import Delay, Sample
from .joint_families import Circle, Family, Limit
from .joint_loop import JointLoop, grid, timing_words

LATEST = 2.0  # [s] largest added delay that is looked for
SLOWEST = 1.0  # [s] largest control sample that is looked for
PERIODS = 120  # control samples tried, evenly in their logarithm
STEP = 1e-4  # relative step of differences
LEAST = 1e-6  # [kg.m^2 or N.m.s/rad] of a number whose step is relative
BEYOND = 1e-6  # share beyond a limit at which its motion is looked at
ROUNDS = 30  # of the search for a delay
IGNORED = "joint friction, encoder counts, torque limits, backlash and elastic links: left out"


@named
@dataclass(frozen=True, repr=False, eq=False)
class JointLimits(Result):
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
        scale_change: change of the factor with these of each joint [1/(kg.m^2), rad/(N.m.s)],
            shape (n, 2).
        scale_per_delay: change of the factor with the delay [1/s].
        assumed: what the verdict rests on, and what it leaves out, a sentence each.
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
    scale_change: np.ndarray
    scale_per_delay: float
    assumed: tuple[str, ...] = ()

    @property
    def stable(self) -> bool:
        """Whether the present gains are stable."""
        return self.radius < 1.0

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
        left = "any" if math.isinf(self.delay_left) else f"{1e3 * self.delay_left:.3g} ms"
        return f"stable at {at}: all Kp up to {more}, delay left {left}, {self.joint} first"

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
                return f"friction fed forward at {self.joint}: slope {slope:.4g} N.m.s/rad{limit}"
            low, high = self.Kp[j]
            if high > low and high < self.stiffness[j]:
                return f"Kp of {self.joint}, {self.stiffness[j]:.4g} to {high:.4g} N.m/rad or less"
            return "delay and rate: no Kp of one joint is stable" if math.isnan(high) else "Kp"
        if math.isinf(self.scale):
            return "nothing: no factor of Kp buzzes"
        if self.delay:
            left = "any" if math.isinf(self.delay_left) else f"{1e3 * self.delay_left:.3g} ms"
            shorter = min(self.delay, 1e-3)
            gain = -shorter * self.scale_per_delay
            less = f"{1e3 * shorter:.3g} ms less raises the factor of all Kp by {gain:.3g}"
            return f"delay ({left} left): {less}"
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
        moves: dict[str, Any] = {
            "joint": self.names,
            "largest Kp per rotor inertia [1/s^2]": self.Kp_change[:, 0],
            "largest Kp per damping [1/s]": self.Kp_change[:, 1],
            "largest Kp per delay [N.m/rad/s]": self.Kp_change[:, 2],
            "factor per rotor inertia [1/(kg.m^2)]": self.scale_change[:, 0],
            "factor per damping [rad/(N.m.s)]": self.scale_change[:, 1],
        }
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
            "factor per delay [1/s]": self.scale_per_delay,
        }
        return {"joints": joints, "sensitivity": moves, "arm": {k: [v] for k, v in arm.items()}}


def joint_loop(
    linear: Linear,
    law: JointPD,
    Ts: float,
    delay: float,
    compensated: bool,
    gains: tuple[np.ndarray, np.ndarray] | None = None,
) -> JointLoop:
    """The loop of an arm at a pose under a law; what a drive does acts between samples.

    Gains, if given, replace Kp and Kd of the law, and may be negative.
    """
    stiffness, damping = (np.diag(x) for x in gains or (law.Kp, law.Kd))
    held, drive = (1.0, 0.0) if law.runs == "host" else (0.0, 1.0)
    forward = linear.gravity_stiffness * float(compensated)
    return JointLoop(
        linear.inertia,
        linear.damping + drive * damping,
        linear.stiffness + linear.gravity_stiffness + drive * stiffness,
        held * stiffness - forward,
        held * damping - np.diag(law.slopes),
        Ts,
        delay,
        law.velocity,
        law.cutoff,
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
    Kp = [study.family("Kp", j) for j in joints]
    all_Kp = study.family("Kp")
    of_Kp, scale = [x.limit() for x in Kp], all_Kp.limit()
    of_Kd, of_all_Kd = [study.family("Kd", j).limit() for j in joints], study.family("Kd").limit()
    radius, frequency, _ = worst_motion(loop)
    slope = np.array(law.slopes)
    largest_slope = slope + np.array(law.Kd) - np.array([x.free_low for x in of_Kd])
    return JointLimits(
        arm.names,
        np.array(law.Kp),
        np.array(law.Kd),
        loop.Ts,
        loop.delay,
        radius,
        frequency,
        arm.names[first_joint(all_Kp, scale)],
        scale.high,
        scale.frequency(loop.Ts),
        _ends(of_Kp),
        np.array([x.frequency(loop.Ts) for x in of_Kp]),
        _ends(of_Kd),
        (of_all_Kd.low, of_all_Kd.high),
        delay_left(loop),
        slowest_rate(study),
        slope,
        largest_slope,
        *study.changes([*map(Edge, Kp, of_Kp)], Edge(all_Kp, scale)),
        study.assumed(),
    )


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
        self.arm, self.law = arm, checked_law(law, arm.names)
        self.compensated = arm.gravity == "compensated" if law.gravity is None else law.gravity
        self.linear = arm.linear(q)
        self.loop = self.remade()
        self.circle = Circle(self.loop)

    def remade(self, **changes: Any) -> JointLoop:
        """The loop with another linear arm, law, gains, Ts or delay."""
        now = {name: getattr(self, name) for name in ("linear", "law", "Ts", "delay")} | changes
        return joint_loop(**now, compensated=self.compensated)

    def family(self, kind: str, joint: int | None = None) -> Family:
        """Loops of other gains Kp or Kd of a joint; of a common factor of all joints for None."""
        gains = np.array([self.law.Kp, self.law.Kd])
        i, unit = ("Kp", "Kd").index(kind), np.eye(len(self.law))
        used = slice(None) if joint is None else slice(joint, joint + 1)
        weights = gains[i] if joint is None else unit[joint]

        def changed(u: float) -> JointLoop:
            now = gains.copy()
            now[i] += u * weights
            return self.remade(gains=(now[0], now[1]))

        left, right = (weights[:, None] * unit)[:, used], unit[:, used]
        present = 1.0 if joint is None else float(gains[i, joint])
        of, held = ("position", "rate")[i], self.law.runs == "host"
        return Family(self.circle, of, left, right, present, changed, held)  # type: ignore[arg-type]

    def changes(self, of_Kp: Sequence[Edge], common: Edge) -> tuple[np.ndarray, np.ndarray, float]:
        """How the largest Kp and the factor change with rotor inertia, damping and delay."""
        n = len(self.law)
        of_joint, of_all = np.full((n, 3), math.nan), np.full((n, 2), math.nan)
        step = STEP * self.Ts
        late = [self.remade(delay=self.delay + i * step) for i in (0, 1, 2)]
        for j, edge in enumerate(of_Kp):
            for k, name in enumerate(("inertia", "damping")):
                size = STEP * max(getattr(self.linear, name)[j, j], LEAST)
                sides = [self._nudged(name, j, sign * size) for sign in (1.0, -1.0)]
                of_joint[j, k] = edge.slope(sides, 2.0 * size)
                of_all[j, k] = common.slope(sides, 2.0 * size)
            of_joint[j, 2] = edge.slope(late, step)
        return of_joint, of_all, common.slope(late, step)

    def _nudged(self, name: str, j: int, by: float) -> JointLoop:
        matrix = getattr(self.linear, name).copy()
        matrix[j, j] += by
        return self.remade(linear=self.linear._replace(**{name: matrix}))

    def assumed(self) -> tuple[str, ...]:
        """What the verdict rests on, a sentence each."""
        gravity = "fed forward from the measured pose" if self.compensated else "acts"
        return (*self.arm.notes, f"gravity: {gravity}", IGNORED)


class Edge:
    """The upper limit of a held gain, and how it moves with a number a of the loop.

    At the limit an eigenvalue x = -1/u of the response is real. A change of a moves theta so that
    it stays real: dx/da = Re x_a - Re x_theta Im x_a/Im x_theta, and du/da = dx/da / x^2.
    """

    def __init__(self, family: Family, limit: Limit):
        theta, pi = limit.theta, math.pi
        self._family, self._at = family, np.array([theta])
        self.known = family.held and 0.0 < theta <= pi
        self._along: complex | None = None  # x_theta; None at z = -1, where all stays real
        if not self.known:
            return
        near = -1.0 / (limit.high - family.present)
        self._x = _eigenvalue(family.response(self._at)[0], near)
        if turn := min(1e-6 * theta, 0.5 * (pi - theta)):
            around = family.response(np.array([theta + turn, theta - turn]))
            right, left = (_eigenvalue(matrix, self._x) for matrix in around)
            self._along = (right - left) / (2.0 * turn)

    def slope(self, loops: Sequence[JointLoop], step: float) -> float:
        """Change of the limit per a; NaN for a limit that is not on the circle.

        The loops are those at a + step/2 and a - step/2, or at a, a + step and a + 2 step.
        """
        if not self.known:
            return math.nan
        weights = (1.0, -1.0) if len(loops) == 2 else (-1.5, 2.0, -0.5)
        found = [_eigenvalue(self._family.response(self._at, x)[0], self._x) for x in loops]
        by = sum(w * y for w, y in zip(weights, found, strict=True)) / step
        if self._along is not None:
            by = by.real - self._along.real * by.imag / self._along.imag
        return float(np.real(by) / self._x.real**2)


def _eigenvalue(matrix: np.ndarray, near: complex) -> complex:
    values = np.linalg.eigvals(matrix)
    return complex(values[np.argmin(np.abs(values - near))])


# ---- present motion, delay and rate --------------------------------------------------------------


def worst_motion(loop: JointLoop) -> tuple[float, float, int]:
    """Size of the largest eigenvalue, its frequency [Hz], and the joint that moves most in it."""
    values, vectors = np.linalg.eig(loop.map())
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


def delay_left(loop: JointLoop) -> float:
    """Delay that may be added to a stable loop [s]; 0 for an unstable one, inf for more than 2 s.

    With whole samples more of delay, a crossing is where an eigenvalue of the open loop has size 1
    and turns into -1. The share of a sample moves it little, so a few rounds find it.
    """
    if not loop.stable():
        return 0.0
    total = loop.delay
    for turn in range(ROUNDS):
        more = samples_left(loop.with_delay(total), 0.5 if turn else 0.0) * loop.Ts
        if math.isinf(more) or total + more - loop.delay > LATEST:
            return math.inf
        total += more
        if abs(more) <= 1e-12 * (total + loop.Ts):
            break
    return max(0.0, total - loop.delay)


def samples_left(loop: JointLoop, before: float = 0.0) -> float:
    """Whole samples of delay, as a real number, until the first crossing; inf for none.

    Args:
        loop: the loop.
        before: how far a crossing may lie before the present delay [samples].
    """

    def opened(angles: np.ndarray) -> np.ndarray:
        q, v = loop.open_responses(angles)
        return -(loop.position @ q + loop.rate @ v)

    theta, x = joint_crossings.zeros(opened, grid(loop), lambda values: np.log(np.abs(values)))
    late = np.angle(x)[:, None] / theta[:, None] + np.arange(-1, 3) * 2.0 * math.pi / theta[:, None]
    late = late[late >= -before]
    return float(late.min(initial=math.inf))


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
