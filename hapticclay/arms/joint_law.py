"""A proportional and derivative law at each joint."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Annotated, Any, Literal

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real
from . import gain_files
from .mjcf_arm import MjcfArm

MOST_GAIN = 1e9
FRICTION = ("Fc", "k", "Fv")  # of the torque Fc tanh(k w) + Fv w


@part()
class JointPD:
    """The torque -Kp (q - q_ref) - Kd w of each joint, held from sample to sample.

    Attributes:
        Kp: stiffness of each joint [N.m/rad], 0 to 1e9.
        Kd: damping of each joint [N.m.s/rad], 0 to 1e9; negative values are refused, since a
            friction feed-forward is given as such.
        velocity: how the rate w is had: "exact"; "difference" of the measured positions over a
            sample; or that behind a low-pass "filter":
            w_k = (w_k-1 + wc (q_k - q_k-1))/(1 + wc Ts).
        cutoff: wc of the filter [rad/s], > 0, at most 1e6.
        runs: where the law runs: on the "host", at Ts and behind the delay; or in the "drive",
            whose own loop is so fast that it counts as continuous, while gravity and friction are
            still fed forward by the host.
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
        return f"PD of {len(self)} joints in the {self.runs}, rates {rate}{fed}"

    @property
    def slopes(self) -> tuple[float, ...]:
        """Slope of the friction fed forward at rest, Fc k + Fv, of each joint [N.m.s/rad]."""
        return tuple(Fc * k + Fv for Fc, k, Fv in self._frictions)

    @property
    def _frictions(self) -> tuple[tuple[float, ...], ...]:
        return self.friction or ((0.0, 0.0, 0.0),) * len(self)

    @classmethod
    @checked
    def load(cls, file: str | os.PathLike[str], **changes: Any) -> JointPD:
        """Reads gains from a file, under the names that projects give them.

        A table with `Kp` and `Kd` (OpenArm's LeaderArmParam and FollowerArmParam, with Fc, k, Fv:
        its friction torque is Fc tanh(0.1 k w) + Fv w; its eighth joint, the gripper, is left
        out), with `position_kp` and `position_kd`, or with `position_p_coefficient` and
        `position_d_coefficient` (LeRobot).

        Args:
            file: .toml, .json, .yaml or .yml.
            **changes: fields of the law that are not in the file, or replace those that are.

        Raises:
            ParameterError: the file cannot be read, or holds no gains or two sets of them.
        """
        return cls(**{**gain_files.read_gains(file), **changes})


def rate_filter(cutoff: float | None, Ts: float) -> tuple[float, float]:
    """keep and gain of the estimated rate, v_k = keep v_k-1 + gain (q_k - q_k-1).

    cutoff: of the low-pass behind the difference [rad/s]; None for none.
    """
    if cutoff is None:
        return 0.0, 1.0 / Ts
    return 1.0 / (1.0 + cutoff * Ts), cutoff / (1.0 + cutoff * Ts)


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
