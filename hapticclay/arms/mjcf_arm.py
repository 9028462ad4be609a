"""An arm from a file: its mechanism at a pose, and what the file leaves open."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..arguments import named
from ..errors import ParameterError, array_of, choice
from .loading import load
from .mechanism import Linear, Mechanism
from .servo_gains import ServoGains

PerJoint = Mapping[str, float] | Sequence[float] | float | None
Pose = Mapping[str, float] | Sequence[float] | str | int | None


@named
@dataclass(frozen=True, eq=False, repr=False)
class MjcfArm:
    """An arm that MuJoCo loads: any chain of hinges and slides, open or closed by constraints.

    Joints between the handle and the world, or a floating base, are the arm's, unless `joints`
    names others; a joint that constraints of the file tie to them follows; all others are locked at
    the pose, and the base is held. The file's contacts and the forces of its actuators take no
    part. What the file leaves open, and what is locked, is in `notes`.

    Attributes:
        file: MJCF or URDF file, an mujoco.MjSpec, or the name of an arm of the package: planar_2r,
            five_bar, haptic_3, leader_7.
        site: site, or body, at which the hand holds the arm; None for the only site at the end of
            an arm. Without any the arm ends where its hand branches, and has no handle.
        joints: names of the arm's joints, in the order of its gains; None for those between the
            handle and the world. Then those in use. Joints without a name in the file are joint 1,
            joint 2, ... in its order.
        pose: joint positions [rad or m] by name, or one for each joint of the arm; or a key frame
            of the file, by name or number; None for the key frame "home", or the positions of the
            file. Then those of all joints, by name; of a base that floats elsewhere than in the
            file, its place (x, y, z and a quaternion).
        armature: reflected inertia of the rotors [kg.m^2], 0 to 1e3, by joint name, one for all,
            or one for each joint of the arm; None for the file's, actuators included. Then those
            of the arm's joints.
        damping: viscous damping of the joints [N.m.s/rad], 0 to 1e6, likewise.
        friction: Coulomb friction of the joints [N.m], 0 to 1e6, likewise; that of joints which
            follow them included.
        gravity: "compensated" if the host holds the arm against gravity under any controller, by
            the torque for the measured joint positions; "acts" if nothing does.
        torque_limit: largest torque of each joint's motor [N.m], > 0, likewise; None for that of
            the file's joints and actuators, or none.
        plane: in runs, the axes of the world, such as "xy" or "zx", in which clay and forces lie
            and which p, v and forces name x and y; None for the first two along which the handle
            moves.
    """

    file: Any
    site: str | None = None
    joints: Sequence[str] | None = None
    pose: Pose = None
    armature: PerJoint = None
    damping: PerJoint = None
    friction: PerJoint = None
    gravity: Literal["compensated", "acts"] = "compensated"
    torque_limit: PerJoint = None
    plane: str | None = None

    def __post_init__(self):
        choice("gravity", self.gravity, ("compensated", "acts"))
        if self.plane is not None:
            choice("plane", self.plane, tuple(map("".join, itertools.permutations("xyz", 2))))
        loaded = load(self)
        for name, value in loaded.fields.items():
            object.__setattr__(self, name, value)
        object.__setattr__(self, "_loaded", loaded)

    def __reduce__(self) -> Any:
        fields = {x.name: getattr(self, x.name) for x in dataclasses.fields(self)}
        if not isinstance(self.file, str):  # a spec, whose defaults and assets its XML has
            fields["file"] = self.file.to_xml()
        return _arm_of, (fields, isinstance(self.file, str))

    def __eq__(self, other: object) -> bool:
        """Whether it is the same arm, from whatever file."""
        if not isinstance(other, MjcfArm):
            return NotImplemented
        return self._given == other._given and self.mechanism == other.mechanism

    def __hash__(self) -> int:
        return hash((self.site, self.joints))

    @property
    def _given(self) -> list[Any]:
        return [getattr(self, x.name) for x in dataclasses.fields(self) if x.name != "file"]

    def __repr__(self) -> str:
        return f"<MjcfArm {self.name}: {', '.join(self.names)}>"

    @property
    def name(self) -> str:
        """Name of the model in the file."""
        return self._loaded.name  # type: ignore[attr-defined]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the arm's joints."""
        return self.joints  # type: ignore[return-value]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the file leaves open, and what of it takes no part, a sentence each."""
        return self._loaded.notes  # type: ignore[attr-defined]

    @property
    def q(self) -> np.ndarray:
        """Positions of the arm's joints at the pose [rad or m], shape (n,)."""
        return np.array([self.pose[name] for name in self.names])  # type: ignore[index]

    @property
    def ranges(self) -> np.ndarray:
        """Least and largest position of each joint [rad or m], infinite for none, shape (n, 2)."""
        return self._loaded.ranges.copy()  # type: ignore[attr-defined]

    @property
    def servo(self) -> ServoGains:
        """Gains that the file's actuators give the joints; zeros if there are none."""
        return self._loaded.servo  # type: ignore[attr-defined]

    @property
    def mechanism(self) -> Mechanism:
        """The compiled model with the arm's joints."""
        return self._loaded.mechanism  # type: ignore[attr-defined]

    @property
    def axes(self) -> str:
        """Axes of the world that p, v and forces of runs have, in this order, as "xyz".

        Raises:
            ParameterError: the arm has no handle, or it does not move along the plane.
        """
        self.check_handle()
        found = "".join("xyz"[i] for i in self.mechanism.axes)
        plane = self.plane or (found + "".join(c for c in "xyz" if c not in found))[:2]
        return plane + "".join(c for c in found if c not in plane)

    def linear(self, q: Sequence[float] | np.ndarray | None = None) -> Linear:
        """The arm linearised at a pose: all that its linear theory needs.

        Args:
            q: joint positions [rad or m], shape (n,); None for the arm's pose.

        Raises:
            ParameterError: q is not n finite numbers, or its chains cannot be closed there.
        """
        return self.mechanism.linear(self._place(q))

    def mass_matrix(self, q: Sequence[float] | np.ndarray | None = None) -> np.ndarray:
        """Inertia M(q) of the joints, rotors included [kg.m^2], shape (n, n).

        Args:
            q: joint positions [rad or m], shape (n,); None for the arm's pose.

        Raises:
            ParameterError: as `linear`.
        """
        return self.mechanism.at(self._place(q)).inertia

    def gravity_stiffness(self, q: Sequence[float] | np.ndarray | None = None) -> np.ndarray:
        """Change of the gravity torques with the joint positions [N.m/rad], shape (n, n).

        Args:
            q: joint positions [rad or m], shape (n,); None for the arm's pose.

        Raises:
            ParameterError: as `linear`.
        """
        return self.linear(q).gravity_stiffness

    def jacobian(self, q: Sequence[float] | np.ndarray | None = None) -> np.ndarray:
        """Velocity of the handle along x, y, z per joint rate [m], shape (3, n).

        Args:
            q: joint positions [rad or m], shape (n,); None for the arm's pose.

        Raises:
            ParameterError: as `linear`, or the arm has no handle.
        """
        self.check_handle()
        return self.mechanism.at(self._place(q)).jacobian

    def handle(self, q: Sequence[float] | np.ndarray | None = None) -> np.ndarray:
        """Position of the handle in the world [m], shape (3,).

        Args:
            q: joint positions [rad or m], shape (n,); None for the arm's pose.

        Raises:
            ParameterError: as `jacobian`.
        """
        self.check_handle()
        return self.mechanism.handle(self._place(q))

    def check_handle(self) -> None:
        """Refuses an arm that has no handle.

        Raises:
            ParameterError: neither `site` nor the file names one.
        """
        if self.site is None:
            names = self._loaded.handles  # type: ignore[attr-defined]
            such = f", such as {', '.join(names)}" * bool(names)
            bound = f"must name a site or body at the handle (--site NAME){such}"
            raise ParameterError("site", None, bound)

    def _place(self, q: Sequence[float] | np.ndarray | None) -> np.ndarray:
        if q is None:
            return self.q
        place = array_of("q", q)
        if place.shape != (len(self.names),) or not np.isfinite(place).all():
            bound = f"must be {len(self.names)} finite numbers ({', '.join(self.names)})"
            raise ParameterError("q", place.tolist(), bound)
        return place


def _arm_of(fields: dict[str, Any], is_file: bool) -> MjcfArm:
    """An arm again, from its fields and the XML of its spec."""
    if not is_file:
        from ..physics import mujoco

        fields["file"] = mujoco.MjSpec.from_string(fields["file"])
    return MjcfArm(**fields)
