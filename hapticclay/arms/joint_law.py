"""A proportional and derivative law at each joint."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from ..arguments import checked, named
from ..errors import Bound, ParameterError, is_series, numbers_of
from ..fields import check_fields
from . import gain_files

MOST_GAIN = 1e9
Gains = tuple[float, ...]
FRICTION = ("Fc", "k", "Fv")  # of the torque Fc tanh(k w) + Fv w


@named
@dataclass(frozen=True)
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
    """

    Kp: Gains
    Kd: Gains
    velocity: Literal["exact", "difference", "filter"] = "exact"
    cutoff: Annotated[float | None, Bound(0.0, 1e6, "rad/s", above=True)] = None
    runs: Literal["host", "drive"] = "host"
    friction: tuple[tuple[float, float, float], ...] | None = None
    gravity: bool | None = None

    def __post_init__(self):
        for name, unit in (("Kp", "N.m/rad"), ("Kd", "N.m.s/rad")):
            object.__setattr__(self, name, _gains(name, getattr(self, name), unit))
        if len(self.Kd) != len(self.Kp):
            bound = f"must have a number for each joint, as Kp ({len(self.Kp)})"
            raise ParameterError("Kd", self.Kd, bound)
        if self.friction is not None:
            object.__setattr__(self, "friction", _frictions(self.friction, len(self.Kp)))
        check_fields(self)
        if (self.velocity == "filter") is not (self.cutoff is not None):
            what = (
                "must be given with velocity 'filter'" if self.cutoff is None else "is for it alone"
            )
            raise ParameterError("cutoff", self.cutoff, f"{what} (velocity = {self.velocity!r})")

    def __len__(self) -> int:
        return len(self.Kp)

    @property
    def slopes(self) -> tuple[float, ...]:
        """Slope of the friction fed forward at rest, Fc k + Fv, of each joint [N.m.s/rad]."""
        return tuple(Fc * k + Fv for Fc, k, Fv in self.friction or ((0.0, 0.0, 0.0),) * len(self))

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


def _gains(name: str, given: Any, unit: str) -> Gains:
    """A number for each joint, from a sequence or from one number for one joint."""
    values = list(given) if is_series(given) else [given]
    if not values:
        raise ParameterError(name, given, "must have a number for each joint")
    places = [str(i) for i in range(len(values))]
    return numbers_of(name, values, places, 0.0, MOST_GAIN, unit=unit)


def _frictions(given: Any, n: int) -> tuple[tuple[float, float, float], ...]:
    rows: list[Any] = list(given) if is_series(given) else []
    if len(rows) != n:
        raise ParameterError("friction", given, f"must have (Fc, k, Fv) for each of {n} joints")
    out = [numbers_of(f"friction[{i}]", row, FRICTION, 0.0, 1e6) for i, row in enumerate(rows)]
    return tuple((Fc, k, Fv) for Fc, k, Fv in out)


def checked_law(law: JointPD, names: Sequence[str]) -> JointPD:
    """The law of an arm's joints.

    Raises:
        ParameterError: it has gains for more or fewer joints.
    """
    if not isinstance(law, JointPD):
        raise ParameterError("law", law, "must be a JointPD")
    if len(law) != len(names):
        bound = f"must have {len(names)} numbers, one for each joint ({', '.join(names)})"
        raise ParameterError("Kp", law.Kp, bound)
    return law
