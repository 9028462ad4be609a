"""Runs of an arm from a file at its gains and beside their limit, against the exact map.

The runs are those of the map: small motion about the pose, without Coulomb friction and torque
limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from .. import matrices
from ..arguments import checked, named
from ..arms.joint_law import JointPD, compensated
from ..arms.joint_ranges import without_ranges
from ..arms.mjcf_arm import MjcfArm
from ..errors import ParameterError
from ..model.hardware import Hardware
from ..model.sampled_controller import Controller
from ..results import Result, Tables
from ..scene.scenario import Scenario
from ..simulation.record import Record
from ..simulation.simulate import simulate
from ..theory.client_loop import Delay, Sample
from ..theory.joint_gains import Study
from ..theory.joint_loop import JointLoop, timing_words
from .joint_motion import Mode, modes_of_motion
from .sampled_drive import SampledDrive

BESIDE = 0.005  # share of the common limit at which runs are made on either side
PARTS = 8, 4  # physics steps a control sample, of a serial arm and of a closed chain
LEAST_STEP = 1e-6  # [s]
SIZE, LEAST_SIZE = 1e-4, 1e-8  # [rad] of the motion at the start; of one that grows in few samples
GROWN, DECAYED = 30.0, 150.0  # a run ends where the motion has grown or decayed by so much ...
PERIODS, LONGEST = 30.0, 4.0  # ... or after so many periods, or at this time [s]
FEWEST = 80  # control samples of a run
AGREEMENT = 0.1  # of the expected growth or decay ...
SLACK = 1e-4  # ... and of the angular frequency: what such a step leaves, of damped light joints
ALIKE = 0.95  # of the largest motion: a joint that moves so much is not another one
OFFSET, BUILT = 0.01, 1.0  # [rad] of the reference, and length [s], of the run as built


@named
@dataclass(frozen=True, repr=False, eq=False)
class JointRuns(Result):
    """Runs at the gains and beside the common limit of Kp, and what the exact map expects.

    Attributes:
        names: joints, shape (n,).
        Ts: control sample [s].
        delay: from a sample to its torque [s].
        scale: largest factor of all Kp, by theory.
        limit: factor at which the motion of the runs neither grows nor decays; NaN if no run is
            beside a limit.
        factor: of all Kp in each run, shape (m,).
        growth: rate at which the motion of each run grows [1/s], shape (m,); NaN if unreadable.
        expected: that rate by the map [1/s], shape (m,).
        frequency: of that motion in each run [Hz], shape (m,).
        expected_frequency: by the map [Hz], shape (m,).
        joint: joint that moves most in it, in each run.
        expected_joint: by the map.
        agrees: whether each run does, shape (m,).
        built: how a run as built ended, from rest 10 mrad off its reference, with Coulomb friction
            and torque limits.
        times: samples of each run [s].
        motion: position of that joint, less the one at which it rests [rad], in each run.
        assumed: what the runs leave out, a sentence each.
    """

    drawn_by = "hapticclay.views.joint_run_plots:joint_runs_plot"
    written_as = "runs"

    names: tuple[str, ...]
    Ts: float
    delay: float
    scale: float
    limit: float
    factor: np.ndarray
    growth: np.ndarray
    expected: np.ndarray
    frequency: np.ndarray
    expected_frequency: np.ndarray
    joint: tuple[str, ...]
    expected_joint: tuple[str, ...]
    agrees: np.ndarray
    built: str
    times: tuple[np.ndarray, ...]
    motion: tuple[np.ndarray, ...]
    assumed: tuple[str, ...] = ()

    def headline(self) -> str:
        """Whether the runs agree with the theory, in one line."""
        told = "agree" if bool(np.all(self.agrees)) else "DISAGREE"
        out = f"runs and theory {told} at {timing_words(self.Ts, self.delay)}"
        if math.isnan(self.limit):
            return out + "; no factor of all Kp is a limit"
        by_runs = f"limit of all Kp by runs {self.limit:.4g} times, by theory {self.scale:.4g}"
        return f"{out}: {by_runs} ({self.joint[-1]}, {self.frequency[-1]:.3g} Hz)"

    def remarks(self) -> list[str]:
        """The verdict, the run as built, and what is left out."""
        return [self.headline(), f"as built, 10 mrad off its reference: {self.built}"]

    def tables(self) -> Tables:
        """One row per run."""
        rows: dict[str, dict[str, Any]] = {
            "runs": {
                "all Kp times": self.factor,
                "joint": self.joint,
                "by theory": self.expected_joint,
                "frequency [Hz]": self.frequency,
                "by theory [Hz]": self.expected_frequency,
                "growth [1/s]": self.growth,
                "by theory [1/s]": self.expected,
                "agrees": ["yes" if x else "no" for x in self.agrees],
            }
        }
        return rows

    def contents(self) -> dict[str, Any]:
        """The table, with both limits and the run as built."""
        more = {"scale": self.scale, "limit": self.limit, "built": self.built}
        return {**more, "tables": self.tables(), "assumed": self.assumed}


@checked
def joint_runs(
    arm: MjcfArm,
    law: JointPD,
    Ts: Sample,
    delay: Delay = 0.0,
    progress: Callable[[Iterable[float]], Iterable[float]] | None = None,
) -> JointRuns:
    """Runs an arm at its gains, and at 0.5 % to either side of the common limit of Kp.

    Each run starts near its pose; the growth, frequency and joint of its slowest motion stand
    beside those of the exact map. A last run is as built.

    Args:
        arm: the arm at its pose.
        law: gains of the joints, and where they act.
        Ts: control sample [s], 1e-6 to 1.
        delay: from a sample to the torque computed from it [s], 0 to 100 Ts.
        progress: wraps the factors of the runs, to show how many are done.

    Raises:
        ParameterError: as `joint_limits`; a joint is outside its range, or has no Kp and a weight
            or spring pulls it away from the pose.
    """
    study = Study(arm, law, Ts, delay)
    scale = study.family("Kp").limit().high
    factors = [1.0]
    if math.isfinite(scale) and scale > 0.0:
        factors += [scale * (1.0 - BESIDE), scale * (1.0 + BESIDE)]
    built = simulate(built_scenario(arm, law, Ts, delay))
    rows = [_beside(study, f) for f in (progress(factors) if progress else factors)]
    names, growth = arm.names, np.array([row.found.s.real for row in rows])
    expected = np.array([row.expected.s.real for row in rows])
    omega = np.array([abs(row.expected.s.imag) for row in rows])
    same = np.array([row.joint == row.expected_joint for row in rows])
    near = np.abs(growth - expected) <= AGREEMENT * np.abs(expected) + SLACK * omega
    return JointRuns(
        names=names,
        Ts=study.Ts,
        delay=study.delay,
        scale=scale,
        limit=_limit(factors, growth),
        factor=np.array(factors),
        growth=growth,
        expected=expected,
        frequency=np.array([row.found.frequency for row in rows]),
        expected_frequency=np.array([row.expected.frequency for row in rows]),
        joint=tuple(names[row.joint] for row in rows),
        expected_joint=tuple(names[row.expected_joint] for row in rows),
        agrees=same & near & (np.sign(growth) == np.sign(expected)),
        built=built.status,
        times=tuple(row.record.t for row in rows),
        motion=tuple(row.motion for row in rows),
        assumed=study.assumed(),
    )


class _Beside(NamedTuple):
    """A run, its motion, and the motion that the map expects."""

    record: Record
    found: Mode
    expected: Mode
    weights: np.ndarray  # root of each joint's inertia

    @property
    def joint(self) -> int:
        moved = self.found.shares * self.weights
        if moved[self.expected_joint] >= ALIKE * moved.max():
            return self.expected_joint
        return int(moved.argmax())

    @property
    def motion(self) -> np.ndarray:
        """Position of the joint, less the one at which it rests [rad]."""
        s, j = self.record.scenario, self.joint
        arm, law = s.file_arm, s.controller
        if isinstance(law, Controller):
            drive: SampledDrive = law.law
            arm, law, reference = drive.arm, drive.law, drive.reference
        else:
            assert law is not None
            reference = law.reference
        rests = arm.q[j] + reference[j] - holding(arm, law)[j]  # type: ignore[index]
        return self.record.q[:, j] - rests

    @property
    def expected_joint(self) -> int:
        return int((self.expected.shares * self.weights).argmax())


def _beside(study: Study, factor: float) -> _Beside:
    loop = study.family("Kp").changed(factor - 1.0)
    expected = expected_mode(loop)
    record = simulate(near_limit(study.arm, study.law, study.Ts, study.delay, factor))
    found = mode_of_run(record, loop, expected)
    return _Beside(record, found, expected, np.sqrt(np.diag(loop.inertia)))


def expected_mode(loop: JointLoop) -> Mode:
    """The motion of a map that grows fastest, or decays most slowly."""
    values, vectors = matrices.eigenvectors(loop.map())
    i = int(np.argmin(np.abs(np.abs(values) - loop.radius())))
    s = np.log(complex(values[i])) / loop.Ts
    return Mode(complex(s.real, abs(s.imag)), np.abs(vectors[: loop.n, i]))


def buzz(arm: MjcfArm, law: JointPD, Ts: float, delay: float) -> tuple[Record, Mode]:
    """A run just beyond the common limit of Kp, or of an unstable loop as it is; and its motion."""
    study = Study(arm, law, Ts, delay)
    scale = study.family("Kp").limit().high
    beyond = study.loop.stable() and math.isfinite(scale)
    factor = scale * (1.0 + BESIDE) if beyond else 1.0
    mode = expected_mode(study.family("Kp").changed(factor - 1.0))
    return simulate(near_limit(arm, law, Ts, delay, factor)), mode


def near_limit(arm: MjcfArm, law: JointPD, Ts: float, delay: float, factor: float) -> Scenario:
    """Small motion of an arm at its pose, with all Kp times a factor: what the map describes."""
    n = len(arm.names)
    free = without_ranges(replace(arm, friction=(0.0,) * n, torque_limit=(math.inf,) * n))
    scaled = replace(law, Kp=tuple(factor * k for k in law.Kp))
    mode = expected_mode(Study(free, scaled, Ts, delay).loop)
    span, size = _length(mode, Ts)
    shape = mode.shares / mode.shares.max()
    reference = holding(free, scaled) + size * shape
    controller: Any = replace(scaled, reference=tuple(reference.tolist()))
    if law.drive_rate is not None:
        drive = SampledDrive(free, scaled, reference, Ts, delay)
        controller, free = drive.controller(free.q), replace(free, gravity="acts")
        Ts, delay = 1.0 / law.drive_rate, 0.0
    return Scenario(
        name=f"{arm.name}, all Kp times {factor:.5g}",
        arm=free,
        controller=controller,
        Ts=Ts,
        dt=Ts / _parts(arm, Ts),
        t_max=span,
        hardware=Hardware(delay=delay) if delay else None,
        stop_when_unstable=False,
    )


def _parts(arm: MjcfArm, Ts: float) -> int:
    """Physics steps in a control sample."""
    most = PARTS[bool(arm.mechanism.following)]
    return max(1, min(most, int(Ts / LEAST_STEP)))


def _length(mode: Mode, Ts: float) -> tuple[float, float]:
    """Length of a run that shows a motion [s], and how large it starts [rad]."""
    rate = mode.s.real
    most = math.log(GROWN if rate > 0.0 else DECAYED) / max(abs(rate), 1e-9)
    periods = PERIODS / mode.frequency if mode.frequency > 0.0 else math.inf
    span = min(most, periods, LONGEST)
    if span >= FEWEST * Ts:
        return span, SIZE
    return FEWEST * Ts, LEAST_SIZE if rate > 0.0 else SIZE


def built_scenario(arm: MjcfArm, law: JointPD, Ts: float, delay: float) -> Scenario:
    """An arm as built, from rest 10 mrad off its reference."""
    law, Ts, delay = law.in_runs(Ts, delay)
    if law.runs == "drive":  # whose torque limits are not simulated
        arm = replace(arm, torque_limit=(math.inf,) * len(arm.names))
    low, high = arm.ranges.T
    inward = np.where(arm.q + OFFSET > high, -OFFSET, OFFSET)
    reference = np.clip(holding(arm, law) + inward, low, high)
    return Scenario(
        name=arm.name,
        arm=arm,
        controller=replace(law, reference=tuple(reference.tolist())),
        Ts=Ts,
        t_max=max(BUILT, FEWEST * Ts),
        hardware=Hardware(delay=delay) if delay else None,
    )


def holding(arm: MjcfArm, law: JointPD) -> np.ndarray:
    """Reference at which a law holds an arm at its pose [rad], against weights and springs.

    Raises:
        ParameterError: a joint that they pull has no Kp.
    """
    arm.mechanism.at(arm.q)
    pull = arm.mechanism.moving(np.zeros(len(arm.names))).bias
    if compensated(arm, law):
        pull = pull - arm.mechanism.weights()
    pulled, Kp = np.abs(pull) > 1e-9, np.array(law.Kp)
    if np.any(pulled & (Kp <= 0.0)):
        name = arm.names[int(np.argmax(pulled & (Kp <= 0.0)))]
        bound = f"must be > 0 at {name}, which its weight or spring pulls away from the pose"
        raise ParameterError("Kp", law.Kp, bound)
    return arm.q + np.where(pulled, pull / np.where(Kp > 0.0, Kp, 1.0), 0.0)


def mode_of_run(record: Record, loop: JointLoop, expected: Mode) -> Mode:
    """The motion of a run that is nearest to an expected one; NaN if the run is too short."""
    held = round(loop.Ts / record.scenario.dt)
    q = record.q[:-1:held]  # the last step may be short
    modes, _ = modes_of_motion(q, loop.Ts, expected.frequency)
    if not modes:
        return Mode(complex(math.nan, math.nan), np.zeros(loop.n))
    return min(modes, key=lambda mode: abs(mode.s - expected.s))


def _limit(factors: list[float], growth: np.ndarray) -> float:
    """Factor at which the growth beside a limit is 0."""
    if len(factors) < 3 or not growth[1] < 0.0 < growth[2]:
        return math.nan
    return float(np.interp(0.0, growth[1:], factors[1:]))
