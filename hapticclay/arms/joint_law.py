"""A proportional and derivative law at each joint."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real
from . import gain_files
from .mjcf_arm import MjcfArm

MOST_GAIN = 1e9
WHOLE = 1e-6  # relative error of a multiple
FRICTION = ("Fc", "k", "Fv")  # of the torque Fc tanh(k w) + Fv w


@part()
class JointPD:
    """The torque -Kp (q - q_ref) - Kd w of each joint, held from sample to sample.

    Attributes:
        Kp: stiffness of each joint [N.m/rad], 0 to 1e9; of joints that slide [N/m], as numbers.
        Kd: damping of each joint [N.m.s/rad], likewise [N.s/m], 0 to 1e9; negative values are
            refused, since a friction feed-forward is given as such.
        velocity: how the rate w is had: "exact"; "difference" of the measured positions over a
            sample; or that behind a low-pass "filter":
            w_k = (w_k-1 + wc (q_k - q_k-1))/(1 + wc Ts).
        cutoff: wc of the filter [rad/s], > 0, at most 1e6.
        runs: where the law runs: on the "host", at Ts and behind the delay; or in the "drive", in
            a loop of its own, while gravity and friction are still fed forward by the host.
        drive_rate: rate at which drives measure and hold their torque, without delay [Hz], 10 to
            1e6, a whole multiple of the host's; None for drives so fast that they count as
            continuous.
        friction: friction that the host feeds forward at each joint, (Fc, k, Fv) of the torque
            Fc tanh(k w) + Fv w [N.m, s/rad, N.m.s/rad]; None for none.
        gravity: whether the host feeds gravity forward; None for as the arm says.
        reference: joint positions to which the law pulls [rad], in runs, -1e3 to 1e3; [m] of
            joints that slide; None for the arm's pose, or the angles at the start.
        velocity_bits: bits of the converter of the rates, 2 to 32; None for none.
        velocity_range: that converter spans -range to range [rad/s], > 0.
    """

    Kp: Annotated[tuple[Real, ...], Bound(0.0, MOST_GAIN, "N.m/rad")]
    Kd: Annotated[tuple[Real, ...], Bound(0.0, MOST_GAIN, "N.m.s/rad")]
    velocity: Literal["exact", "difference", "filter"] = "exact"
    cutoff: Annotated[Real | None, Bound(0.0, 1e6, "rad/s", above=True)] = None
    runs: Literal["host", "drive"] = "host"
    drive_rate: Annotated[Real | None, Bound(10.0, 1e6, "Hz")] = None
    friction: Annotated[tuple[tuple[float, ...], ...] | None, Bound(0.0, 1e6)] = None
    gravity: bool | None = None
    reference: Annotated[tuple[Real, ...] | None, Bound(-1e3, 1e3, "rad")] = None
    velocity_bits: Annotated[int | None, Bound(2, 32)] = None
    velocity_range: Annotated[Real | None, Bound(0.0, 1e6, "rad/s", above=True)] = None

    def __post_init__(self):
        n = len(self.Kp)
        if not n:
            raise ParameterError("Kp", self.Kp, "must have a number for each joint")
        if len(self.Kd) != n:
            raise ParameterError("Kd", self.Kd, f"must have a number for each joint, as Kp ({n})")
        if len(self._frictions) != n or len(self._frictions[0]) != len(FRICTION):
            bound = f"must have ({', '.join(FRICTION)}) for each of {n} joints"
            raise ParameterError("friction", self.friction, bound)
        if self.reference is not None and len(self.reference) != n:
            raise ParameterError("reference", self.reference, f"must have {n} numbers, as Kp")
        if (self.velocity_bits is None) is not (self.velocity_range is None):
            what = "must be given with velocity_bits, and left out without"
            raise ParameterError("velocity_range", self.velocity_range, what)
        if self.drive_rate is not None and self.runs != "drive":
            bound = "must be left out where the law runs on the host"
            raise ParameterError("drive_rate", self.drive_rate, bound)
        if (self.velocity == "filter") is not (self.cutoff is not None):
            what = "must be given with" if self.cutoff is None else "must be left out without"
            raise ParameterError("cutoff", self.cutoff, f"{what} velocity 'filter'")

    def __len__(self) -> int:
        return len(self.Kp)

    @property
    def words(self) -> str:
        """The law in a few words."""
        rates = {"difference": "by difference", "filter": f"filtered at {self.cutoff} rad/s"}
        rate = rates.get(self.velocity, "exact")
        fed = " with friction fed forward" * (self.friction is not None)
        own = "" if self.runs == "host" else f" ({self.drive_words})"
        return f"PD of {len(self)} joints in the {self.runs}{own}, rates {rate}{fed}"

    @property
    def drive_words(self) -> str:
        """The loop of the drives in a few words."""
        return "continuous" if self.drive_rate is None else f"sampled at {self.drive_rate:g} Hz"

    def drive_samples(self, Ts: float) -> int | None:
        """Samples of the drives in one of the host; None where they count as continuous.

        Args:
            Ts: control sample of the host [s].

        Raises:
            ParameterError: the drives' rate is no whole multiple of the host's.
        """
        if self.drive_rate is None:
            return None
        many = self.drive_rate * Ts
        if round(many) < 1 or abs(many - round(many)) > WHOLE * many:
            near = ", ".join(f"{k / Ts:g}" for k in {max(1, int(many)), int(many) + 1})
            bound = f"must be a whole multiple of the host's {1.0 / Ts:g} Hz, such as {near}"
            raise ParameterError("drive_rate", self.drive_rate, bound)
        return round(many)

    @property
    def slopes(self) -> tuple[float, ...]:
        """Slope of the friction fed forward at rest, Fc k + Fv, of each joint [N.m.s/rad]."""
        return tuple(Fc * k + Fv for Fc, k, Fv in self._frictions)

    @property
    def _frictions(self) -> tuple[tuple[float, ...], ...]:
        return self.friction or ((0.0, 0.0, 0.0),) * len(self)

    def in_runs(self, Ts: float, delay: float) -> tuple[JointPD, float, float]:
        """The law, control sample and delay of a run: drives that sample are a host of their rate.

        Gravity and friction are then fed forward at that rate, too.

        Args:
            Ts: control sample of the host [s].
            delay: from a sample of the host to its torque [s].
        """
        if self.drive_rate is None:
            return self, Ts, delay
        changes = {"runs": "host", "drive_rate": None, "velocity": "exact", "cutoff": None}
        return replace(self, **changes), 1.0 / self.drive_rate, 0.0

    @classmethod
    @checked
    def of(cls, arm: MjcfArm, **changes: Any) -> JointPD:
        """The gains that the actuators of an arm's file give its joints.

        Those of position and velocity servos, general ones with an affine bias, PID and motors with
        a controller, with gear and damping ratio, where each pulls at one joint of the arm.

        Args:
            arm: an arm from a file.
            **changes: fields of the law that the file does not have, or replace those that it has.

        Raises:
            ParameterError: the file has no gains.
        """
        if not arm.servo.taken:
            n, names = len(arm.names), ", ".join(arm.names)
            each = f", or {n} numbers each ({names})" * (n > 1)
            bound = (
                "must be given, since the arm's file has none: --gains FILE, or --Kp and --Kd, "
                f"one number for all joints{each}"
            )
            raise ParameterError("gains", None, bound)
        return cls(**{"Kp": arm.servo.Kp, "Kd": arm.servo.Kd, **changes})

    @classmethod
    @checked
    def load(
        cls,
        file: str | os.PathLike[str],
        joints: tuple[str, ...] | None = None,
        **changes: Any,
    ) -> JointPD:
        """Reads gains from a file, under the names that projects give them.

        A table with `Kp` and `Kd` (OpenArm's LeaderArmParam and FollowerArmParam, with Fc, k, Fv:
        its friction torque is Fc tanh(0.1 k w) + Fv w; its eighth joint, the gripper, is left
        out), `position_kp` and `position_kd`, or `position_p_coefficient` and
        `position_d_coefficient` (LeRobot), `k_gains` and `d_gains` (Franka), `kps` and `kds`
        (Unitree), or with `p`, `i` = 0 and `d` of each joint (ros2_control).

        Args:
            file: .toml, .json, .yaml or .yml; with several tables of gains FILE:TABLE.
            joints: the arm's joints, in whose order gains by name are put; None for the file's.
            **changes: fields of the law that are not in the file, or replace those that are.

        Raises:
            ParameterError: the file cannot be read, or holds no gains, or several tables of them
                and none is chosen.
        """
        return cls(**{**gain_files.read_gains(file, joints), **changes})


def rate_filter(cutoff: float | None, Ts: float) -> tuple[float, float]:
    """keep and gain of the estimated rate, v_k = keep v_k-1 + gain (q_k - q_k-1).

    cutoff: of the low-pass behind the difference [rad/s]; None for none.
    """
    if cutoff is None:
        return 0.0, 1.0 / Ts
    return 1.0 / (1.0 + cutoff * Ts), cutoff / (1.0 + cutoff * Ts)


def fed_friction(law: JointPD, w: np.ndarray) -> np.ndarray:
    """The friction torque that the host feeds forward at measured rates w [N.m], shape (n,)."""
    Fc, k, Fv = np.array(law._frictions).T
    return Fc * np.tanh(k * w) + Fv * w


def compensated(arm: Any, law: JointPD | None) -> bool:
    """Whether the host of an arm feeds gravity forward: as its law says, or the arm."""
    if law is not None and law.gravity is not None:
        return law.gravity
    return isinstance(arm, MjcfArm) and arm.gravity == "compensated"


def checked_law(law: JointPD, names: Sequence[str]) -> JointPD:
    """The law of an arm's joints.

    Raises:
        ParameterError: it has gains for more or fewer joints.
    """
    if len(law) != (n := len(names)):
        many = "1 number, for the" if n == 1 else f"{n} numbers, one for each"
        bound = f"must have {many} joint ({', '.join(names)})"
        raise ParameterError("Kp", law.Kp, bound)
    return law
