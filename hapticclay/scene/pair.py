"""A leader and a follower: two arms, their joint laws, hands, what the follower touches, a link."""

from __future__ import annotations

import math
import os
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, part
from ..arms.joint_law import JointPD, checked_law
from ..arms.mechanism import STILL, Linear
from ..arms.mjcf_arm import MjcfArm
from ..errors import Bound, ParameterError, Real
from ..model import arm as closed_form
from ..model.arm import Arm
from ..model.clay import Clay
from ..model.hardware import Hardware
from ..model.operator import Operator
from ..model.shapes import Pulse
from ..model.signals import Signal
from . import pair_files
from .contact import Contact, Load, load_of
from .link import ENDS, Link
from .pair_hardware import check_hardware
from .virtual_wall import Device

NOMINAL = (0.5 * math.pi, -0.5 * math.pi)  # [rad] elbow square, link 2 along x
UNKNOWN_ROTOR = "rotor inertia (armature): part of the mass or inertia that is given"
TOUCH = Pulse((1.0, 0.0), 0.0, 0.05)  # [N] for 50 ms


@part("pair.", eq=False)
class Pair:
    """A leader that a hand moves, a follower that touches, and the link between them.

    Both hosts sample at the same instants. What a host computes acts `delay` after the sample; what
    depends on the other arm acts later by the link's delay.

    Attributes:
        leader: arm from a file at its pose; the two-link arm in closed form, elbow square; or a
            device of one axis. A rotary device has kg.m^2 and N.m.s/rad in place of kg and N.s/m,
            as have its law, hand and contact.
        follower: likewise, with as many joints.
        law: gains of the leader's joints, which pull it towards the follower.
        follower_law: gains of the follower's joints; None for the leader's.
        link: what is sent, and how late.
        Ts: control sample of both hosts [s], 1e-6 to 1.
        delay: from a sample to the torque computed from it [s], 0 to 10.
        leader_operator: the hand at the leader's handle; None for none.
        follower_clay: what the follower touches: an object that it never leaves, a wall, or clay,
            whose axes are those of the arm's plane, counted from the handle's pose. Theory takes
            the linear part of wall and clay. None for free motion.
        axes: for each joint of the follower, the number of the leader's joint that it follows, from
            1 on, negative for the opposite sense; None for the same order.
        muscle: in runs, muscle force of the leader's hand [N], any signal; None for none. By
            default 1 N along x for 50 ms.
        t_max: runs end at this time [s], > 0, at most 1e4.
        follower_operator: a hand at the follower's handle; None for none.
        leader_clay: what the leader touches, as `follower_clay`.
        leader_hardware: in runs, encoders, converters, torque limits and, of the two-link arm,
            joint friction; None for ideal ones. What cannot act in a pair is refused.
        follower_hardware: the same of the follower.
    """

    leader: MjcfArm | Arm | Device
    follower: MjcfArm | Arm | Device
    law: JointPD
    link: Link = Link()
    follower_law: JointPD | None = None
    Ts: Annotated[Real, Bound(1e-6, 1.0, "s")] = 1e-3
    delay: Annotated[Real, Bound(0.0, 10.0, "s")] = 0.0
    leader_operator: Operator | None = None
    follower_clay: Contact | Clay | None = None
    axes: Annotated[tuple[int, ...] | None, Bound(-1000, 1000)] = None
    muscle: Signal | None = TOUCH
    t_max: Annotated[Real, Bound(0.0, 1e4, "s", above=True)] = 2.0
    follower_operator: Operator | None = None
    leader_clay: Contact | Clay | None = None
    leader_hardware: Hardware | None = None
    follower_hardware: Hardware | None = None

    def __post_init__(self):
        n, m = len(joint_names(self.leader)), len(joint_names(self.follower))
        if n != m:
            bound = f"must have {n} joints, as the leader has, not {m}"
            raise ParameterError("pair.follower", self.follower, bound)
        checked_law(self.law, joint_names(self.leader))
        checked_law(self.laws[1], joint_names(self.follower))
        if self.axes is not None and sorted(map(abs, self.axes)) != list(range(1, n + 1)):
            bound = f"must name each of 1 to {n} once, with a sign"
            raise ParameterError("pair.axes", self.axes, bound)
        impedance = self.link.impedance
        if isinstance(impedance, tuple) and len(impedance) != n:
            bound = f"must be one number, or {n}, one for each joint"
            raise ParameterError("link.impedance", impedance, bound)
        if self.link.kind == "waves" and impedance is None and not min(self.laws[1].Kd) > 0.0:
            bound = "must be given where the follower has joints without Kd"
            raise ParameterError("link.impedance", None, bound)
        if self.link.kind == "waves" and self.laws[1].runs == "drive":
            bound = "must be 'host' with waves: the follower's gains act behind them"
            raise ParameterError("law.runs", "drive", bound)
        if self.link.passivity and "drive" in (law.runs for law in self.laws):
            bound = "must be 'host' with passivity controllers, which act on all of the torque"
            raise ParameterError("law.runs", "drive", bound)
        if self.link.passivity and self.delay > 0.0:
            bound = "must be 0 with passivity controllers: a damper that acts late feeds motion"
            raise ParameterError("pair.delay", self.delay, bound)
        for i in range(2):
            _check_touched(self, i)
            check_hardware(self, i, joint_names(self.arms[i]))

    def __repr__(self) -> str:
        names = (type(arm).__name__ for arm in self.arms)
        return f"<Pair {' and '.join(names)}: {self.link.kind}, {1.0 / self.Ts:g} Hz>"

    @property
    def arms(self) -> tuple[Any, Any]:
        """Leader and follower."""
        return self.leader, self.follower

    @property
    def laws(self) -> tuple[JointPD, JointPD]:
        """Joint laws of leader and follower."""
        return self.law, self.follower_law or self.law

    @property
    def operators(self) -> tuple[Operator | None, Operator | None]:
        """Hands at leader and follower."""
        return self.leader_operator, self.follower_operator

    @property
    def touched(self) -> tuple[Contact | Clay | None, Contact | Clay | None]:
        """What leader and follower touch."""
        return self.leader_clay, self.follower_clay

    @property
    def hardware(self) -> tuple[Hardware | None, Hardware | None]:
        """Hardware of leader and follower."""
        return self.leader_hardware, self.follower_hardware

    @property
    def n(self) -> int:
        """Number of joints of each arm."""
        return len(self.law)

    @property
    def mapping(self) -> np.ndarray:
        """Direction in which the follower's joints follow the leader's, shape (n, n)."""
        out = np.zeros((self.n, self.n))
        for i, j in enumerate(map(int, self.axes or range(1, self.n + 1))):
            out[i, abs(j) - 1] = math.copysign(1.0, j)
        return out

    @property
    def follows(self) -> np.ndarray:
        """Motion of the follower's joints that the link asks for per the leader's, (n, n)."""
        return self.link.scale[0] * self.mapping

    @classmethod
    @checked
    def load(cls, file: str | os.PathLike[str]) -> Pair:
        """Reads a pair from a TOML or JSON file.

        Tables [leader] and [follower] hold the fields of an arm: `file` for one from a file, l1,
        l2, I1, I2 for the two-link arm, mass and damper for a device; without [follower], both
        arms are alike. [law], [follower_law], [link], [leader_operator] and [follower_clay] hold
        the fields of those parts; `gains` in a law names a file of gains. Names of files count from
        the folder of the pair's file.

        Args:
            file: .toml or .json.

        Raises:
            ParameterError: the file cannot be read, or holds no pair.
        """
        return pair_files.read_pair(file, cls)


def _check_touched(pair: Pair, i: int) -> None:
    """Refuses a wall without an axis, and an axis along which the handle cannot move."""
    touched, arm = pair.touched[i], pair.arms[i]
    if not isinstance(touched, Contact):
        return
    if touched.unilateral and touched.axis is None and not isinstance(arm, Device):
        bound = "must be given for a wall that an arm of more than one axis may leave"
        raise ParameterError("contact.axis", None, bound)
    if touched.axis is None or not has_handle(arm):
        return
    if not np.abs(linear_arm(arm).jacobian["xyz".index(touched.axis)]).max() > STILL:
        bound = f"must be one along which the {ENDS[i]}'s handle can move"
        raise ParameterError("contact.axis", touched.axis, bound)


def touched_load(pair: Pair, i: int) -> Load:
    """What an arm of a pair touches, linear, along x, y and z."""
    arm, touched = pair.arms[i], pair.touched[i]
    if not isinstance(touched, Clay):
        return load_of(touched, "xy")
    return load_of(touched, axes_of(arm)[:2])


def axes_of(arm: Any) -> str:
    """Axes of the world along which forces act on the handle of an arm of a pair, in order."""
    return arm.axes if isinstance(arm, MjcfArm) else "xy"


def joint_unit(names: tuple[str, ...]) -> str:
    """Unit of joint positions, "m" for a device of one axis, which may be rotary."""
    return "m" if names == ("x",) else "rad"


def joint_names(arm: Any) -> tuple[str, ...]:
    """Names of the joints of an arm of a pair."""
    if isinstance(arm, MjcfArm):
        return arm.names
    return ("joint1", "joint2") if isinstance(arm, Arm) else ("x",)


def linear_arm(arm: Any) -> Linear:
    """An arm of a pair, linear about its pose."""
    if isinstance(arm, MjcfArm):
        return arm.linear()
    if isinstance(arm, Arm):
        inertia = np.array([[arm.I1 + arm.I2, arm.I2], [arm.I2, arm.I2]])
        u1x, u1y, u2x, u2y = closed_form.jacobians(*NOMINAL, arm.links)
        jacobian = np.array([[u1x + u2x, u2x], [u1y + u2y, u2y], [0.0, 0.0]])
        return _plain(inertia, np.zeros((2, 2)), jacobian)
    one, along = np.ones((1, 1)), np.array([[1.0], [0.0], [0.0]])
    return _plain(arm.mass * one, arm.damper * one, along)


def _plain(inertia: np.ndarray, damping: np.ndarray, jacobian: np.ndarray) -> Linear:
    none = np.zeros_like(inertia)
    return Linear(inertia, damping, none, none, none, jacobian)


def notes_of(arm: Any) -> tuple[str, ...]:
    """What an arm leaves open, a sentence each."""
    return arm.notes if isinstance(arm, MjcfArm) else (UNKNOWN_ROTOR,)


def has_handle(arm: Any) -> bool:
    """Whether an arm has a handle."""
    return not isinstance(arm, MjcfArm) or arm.site is not None
