"""What an arm of a pair touches: an object that it never leaves, a wall, or clay."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from ..arguments import part
from ..errors import Bound, ParameterError, Real
from ..formulas.constants import B_MAX
from ..model.cells import Profile
from ..model.clay import NOTHING, Clay
from ..model.spring import STIFFNESS_MAX, Spring

AXES = ("x", "y", "z")


@part("contact.")
class Contact:
    """What an arm touches: an object that it never leaves, or a wall that it may leave.

    Attributes:
        K: stiffness [N/m], 0 to 1e9.
        B: damping [N.s/m], 0 to 1e9; viscous clay has this alone.
        mass: mass that moves along [kg], 0 to 1e6.
        axis: axis of the world along which it acts; None for all, and for an arm of one axis.
        unilateral: whether it is a wall, which pushes with K e + B e' at a depth e and never pulls.
            Runs leave it; theory takes it for one that is never left.
        start: where the wall begins, from the handle's pose along its axis [m], -10 to 10. It
            fills what lies beyond: a handle that moves on meets it there, at 0 at once.
    """

    K: Annotated[Real, Bound(0.0, STIFFNESS_MAX, "N/m")] = 0.0
    B: Annotated[Real, Bound(0.0, B_MAX, "N.s/m")] = 0.0
    mass: Annotated[Real, Bound(0.0, 1e6, "kg")] = 0.0
    axis: Literal["x", "y", "z"] | None = None
    unilateral: bool = False
    start: Annotated[Real, Bound(-10.0, 10.0, "m")] = 0.0

    def __post_init__(self):
        if not self.unilateral and self.start:
            raise ParameterError("contact.start", self.start, "must be 0 without unilateral")
        if self.unilateral and not self.K > 0.0:
            raise ParameterError("contact.K", self.K, "must be > 0 N/m for a unilateral wall")
        if self.unilateral and self.mass > 0.0:
            bound = "must be 0 for a unilateral wall, which stays where it is"
            raise ParameterError("contact.mass", self.mass, bound)

    @property
    def wall(self) -> Clay:
        """A unilateral wall as clay, its axis the clay's first."""
        rigid, none = Spring(self.K, unilateral=True), Spring()
        if self.start < 0.0:
            law = Profile((self.start,), (self.B, 0.0), springs=(rigid, none))
        else:
            law = Profile((self.start,), (0.0, self.B), springs=(none, rigid))
        return Clay(law, NOTHING)


class Load(NamedTuple):
    """What a handle meets along x, y and z of the world, linear: three matrices (3, 3)."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray


def load_of(touched: Contact | Clay | None, plane: str) -> Load:
    """The linear part of what an arm touches; plane: axes of the world that clay names x and y.

    That of clay is its largest damping and stiffness, wherever they lie.
    """
    none = np.zeros((3, 3))
    if touched is None:
        return Load(none, none, none)
    if isinstance(touched, Contact):
        along = np.eye(3)
        if touched.axis is not None:
            along = np.diag([float(c == touched.axis) for c in AXES])
        return Load(touched.mass * along, touched.B * along, touched.K * along)
    turn = np.eye(3)[:, ["xyz".index(c) for c in plane]]
    c, s = np.cos(touched.angle), np.sin(touched.angle)
    turn = turn @ np.array([[c, -s], [s, c]])
    groove = touched.groove.thickest if touched.groove else 0.0
    damping = [float(law.damping.max()) + groove for law in touched.laws]
    stiffness = [_stiffest(law) for law in touched.laws]
    return Load(none, turn @ np.diag(damping) @ turn.T, turn @ np.diag(stiffness) @ turn.T)


def _stiffest(law: Any) -> float:
    """Largest stiffness of a law, with its relaxing spring [N/m]."""
    if not getattr(law, "springs", ()):
        return 0.0
    return float((law.elastic[..., 0] + law.elastic[..., 2]).max())


def left_out(touched: Contact | Clay | None) -> str:
    """What theory leaves out of it, in words; "" for nothing."""
    if isinstance(touched, Clay):
        return (
            "clay: as its largest damping and stiffness, never left; yield, growth and cuts left "
            "out"
        )
    return "wall on one side: as if never left" if touched and touched.unilateral else ""
