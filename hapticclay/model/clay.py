"""Virtual clay: position-dependent viscous damping, fe = b(p) v (Eqs. 3, 4)."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, part
from ..errors import Bound, ParameterError, Real, number
from ..formulas.constants import B_MAX
from ..units import is_quantity
from . import flow, groove, spring
from .cells import Grid, Profile
from .constants import AXES
from .flow import Flow
from .groove import Groove
from .smooth import Smooth
from .traits import (
    LEFT_OUT,
    Block,
    Column,
    Hold,
    Law,
    Quantity,
    Refusal,
    Soft,
    check_traits,
    multiplied,
    present,
)


@checked
def slab(resists: float | Flow, start: float | None = None, end: float | None = None) -> Clay:
    """A slab across the x axis with the same resistance along both axes (Sec. 4.1).

    Args:
        resists: damping [N.s/m], 0 to 1e9, or a flow, whose force is then opposite to the motion.
        start: lower border on x [m]; None for clay without borders.
        end: upper border on x [m], given with start.

    Raises:
        ParameterError: a value is out of bounds, or only one border is given.
    """
    if (start is None) != (end is None):
        raise ParameterError(
            "end", end, "must be a border where start is one, and None where it is None"
        )
    if isinstance(resists, str) and not is_quantity(resists):
        bound = f"must be a damping, or a flow as hc.materials.material({resists!r}) returns"
        raise ParameterError("resists", resists, bound)
    flow = (
        resists
        if isinstance(resists, Flow)
        else Flow(b=number("b", resists, 0.0, B_MAX, unit="N.s/m"))
    )
    edges = () if start is None or end is None else (start, end)

    def of(x: float, outside: float = 0.0) -> tuple[float, ...]:
        return (outside, x, outside) if edges else (x,)

    n = of(flow.n, 1.0) if flow.K else ()
    profile = Profile(edges, of(flow.b), Fy=of(flow.Fy), K=of(flow.K), n=n)
    return Clay(profile, profile, isotropic=profile.yields)


def extent(clay: Clay | None, i: int) -> list[tuple[float, float]]:
    """Ascending intervals [m] of coordinate i that contain clay, judged by i alone."""
    out: list[tuple[float, float]] = []
    for law in clay.laws if clay else ():
        if AXES[i] in law.along:
            edges = (-math.inf, *law.lines[i], math.inf)
            some = np.any(law.some, axis=1 - i)
            out += [(edges[k], edges[k + 1]) for k in np.flatnonzero(some).tolist()]
    merged: list[tuple[float, float]] = []
    for low, high in sorted(out):
        if merged and low <= merged[-1][1]:
            low, high = merged[-1][0], max(high, merged[-1][1])
            merged.pop()
        merged.append((low, high))
    return merged


NOTHING = Profile((), (0.0,))


def _yield_alike(x: Profile | Grid | Smooth, y: Profile | Grid | Smooth) -> bool:
    return x.borders == y.borders and all(map(np.array_equal, x.flows, y.flows))


@part("clay.")
class Clay:
    """Clay: fe = B v with B = R diag(bx, by) R' (Eqs. 3, 4 with m = k = 0, R = 1), or clay that
    also yields, with Fy_i sign v_i + K_i |v_i|^n_i sign v_i beside it along each axis.

    Attributes:
        x: law of motion along x, or along the clay's own first axis where they are rotated.
        y: law of motion along y, or along the clay's own second axis.
        angle: by which those axes are rotated from x and y, counterclockwise [rad], -pi to pi.
        isotropic: whether Fy and K, equal on both axes, resist along the motion in every
            direction, (Fy + K |v|^n) v/|v|; else each axis yields by itself.
        groove: a block of clay that stays cut, beside x and y, which then neither yield, grow nor
            spring back and are not smooth; None for none.
    """

    x: Profile | Grid | Smooth
    y: Profile | Grid | Smooth
    angle: Annotated[Real, Bound(-math.pi, math.pi, "rad")] = 0.0
    isotropic: bool = False
    groove: Groove | None = None

    def __post_init__(self):
        x, y = self.laws
        if self.isotropic and not (x is y or _yield_alike(x, y)):
            raise ParameterError(
                "clay.isotropic", True, "must be False where Fy, K or n differ between the axes"
            )
        check_traits(present(self, LAWS), self, "clay.")

    @classmethod
    @checked
    def of_groove(cls, groove: Groove) -> Clay:
        """Clay that stays cut, and no other clay.

        Args:
            groove: the block.
        """
        return cls(NOTHING, NOTHING, groove=groove)

    @property
    def laws(self) -> tuple[Profile | Grid | Smooth, Profile | Grid | Smooth]:
        """Of x and of y."""
        return self.x, self.y

    def laws_on(self, i: int) -> tuple[Profile | Grid | Smooth, ...]:
        """Laws that resist along an axis: both laws if the axes of the clay are rotated.

        Args:
            i: axis, 0 for x, 1 for y.
        """
        return self.laws if self.angle else self.laws[i : i + 1]

    @property
    def smooth(self) -> int:
        """Which axes have smooth clay: 0 for none, 1 for x, 2 for y, 3 for both."""
        return sum(k for k, law in zip((1, 2), self.laws, strict=True) if isinstance(law, Smooth))

    @property
    def along(self) -> str:
        """Coordinates that decide, "x", "y" or "xy"."""
        return "".join(a for a in AXES if any(a in law.along for law in self.laws))

    @property
    def edges(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Borders along x and along y [m], ascending."""
        x, y = (tuple(sorted({e for f in self.laws for e in f.borders[i]})) for i in (0, 1))
        return x, y

    @property
    def largest(self) -> float:
        """Largest damping, without growth [N.s/m]."""
        most = float(max(law.damping.max() for law in self.laws))
        return most + self.groove.thickest if self.groove else most

    @property
    def fastest(self) -> float:
        """Largest growth rate of the damping [N.s/m per s]."""
        return float(max(law.rates.max() for law in self.laws))

    @property
    def grows(self) -> bool:
        """Whether the damping grows anywhere."""
        return bool(self.x.growth or self.y.growth)

    @property
    def yields(self) -> bool:
        """Whether the clay has a yield force or a consistency anywhere; a groove does."""
        return self.x.yields or self.y.yields or self.groove is not None

    @property
    def springs(self) -> bool:
        """Whether the clay springs back anywhere."""
        return any(getattr(law, "springs", ()) for law in self.laws)

    def __getstate__(self) -> dict[str, Any]:
        # fields only: the cached `kinds` holds functions, which cannot be pickled
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @functools.cached_property
    def kinds(self) -> tuple[Law, ...]:
        """The laws of LAWS that apply to this clay."""
        return tuple(present(self, LAWS))

    @property
    def viscous(self) -> bool:
        """Whether the force is damping times velocity, so that linear theory holds."""
        return all(x.viscous for x in self.kinds)

    def viscous_at(self, place: tuple[float, float]) -> bool:
        """Whether the force at a place is damping times velocity.

        Args:
            place: (x, y) [m].
        """
        return not any(x.here(self, place) for x in self.kinds if not x.viscous)

    @property
    def of_velocity(self) -> bool:
        """Whether the force depends on the velocity alone."""
        return all(x.of_velocity for x in self.kinds)

    @property
    def seen_in_b(self) -> bool:
        """Whether damping distinguishes the regions of the clay."""
        return all(x.seen_in_b for x in self.kinds)

    @property
    def along_motion(self) -> bool:
        """Whether the force is opposite to the motion in every direction."""
        return self.isotropic or any(x.along_motion for x in self.kinds)

    @property
    def varies(self) -> set[str]:
        """What damping within a region depends on, "time", "place"; empty if constant."""
        return {x.varies for x in self.kinds if x.varies}

    def resists_otherwise(self, i: int) -> bool:
        """Whether a force other than damping times velocity acts along an axis of the clay.

        Args:
            i: axis, 0 for x, 1 for y.
        """
        return any(
            np.any(x.force(self.laws[i], 1.0, 1.0)) for x in self.kinds if x.force and not x.viscous
        )

    @property
    def holding(self) -> bool:
        """Whether the clay can hold a tool at rest anywhere."""
        return any(x.holds for x in self.kinds)

    def hold(self, i: int) -> Hold:
        """The largest force that holds a tool at rest along an axis.

        Args:
            i: axis, 0 for x, 1 for y.
        """
        found = [x.holds(self, i) for x in self.kinds if x.holds]
        return max((x for x in found if x), key=lambda x: x.force, default=Hold(0.0))

    @property
    def blocks(self) -> list[Block]:
        """Rectangles of clay in addition to the laws of the axes."""
        return [block for x in self.kinds for block in x.blocks(self)]

    @property
    def ground(self) -> Any:
        """Cells that a tool cuts permanently; None if the tool does not change the clay."""
        return next((x.ground(self) for x in self.kinds if x.ground), None)

    @property
    def soft(self) -> list[Soft]:
        """Clay whose damping the steps of the fast method must resolve."""
        found = (x.soft(self) for x in self.kinds if x.soft)
        return [x for x in found if x]

    def scaled(self, factor: float) -> Clay:
        """Returns the same clay with its resistance (damping, yield force and so on) multiplied.

        Clay that yields keeps a small yield force: a run cannot switch to another kind of clay.

        Args:
            factor: factor on all resistances, limited to their bounds.
        """
        return functools.reduce(lambda clay, kind: kind.scaled(clay, factor), self.kinds, self)

    @property
    def columns(self) -> list[Column]:
        """Quantities that tables of stretches show besides damping."""
        return list(dict.fromkeys(c for x in self.kinds for c in x.columns))

    def values_at(self, i: int, place: Any) -> dict[str, float]:
        """Values of `columns` at a place.

        Args:
            i: axis, 0 for x, 1 for y.
            place: (x, y) [m].
        """
        out: dict[str, float] = {}
        for kind in self.kinds:
            values = map(float, kind.at(self.laws[i], place))
            out |= dict(zip((c.name for c in kind.columns), values, strict=True))
        return out

    @property
    def words(self) -> list[Quantity]:
        """Resistance of the clay over the whole scene."""
        return [x for kind in self.kinds for x in kind.words(self)] or [Quantity("b = {}", (0.0,))]

    def here(self, place: tuple[float, float], b: Any = None) -> list[Quantity]:
        """Resistance at a place; empty where there is none.

        Args:
            place: (x, y) [m].
            b: damping there, along x and y [N.s/m]; None for that of `at`.
        """
        others = [x for kind in self.kinds for x in kind.here(self, place)]
        b = self.at(*place).tolist() if b is None else b
        return [*others, *Quantity.of_axes("b = {}", b, "N.s/m")]

    def at(self, x: Any, y: Any) -> np.ndarray:
        """Damping of both axes at given places, without growth [N.s/m], shape (2, ...).

        Args:
            x: coordinates [m], any shape.
            y: coordinates [m], any shape that broadcasts with x.
        """
        b = self.x.at(x, y)
        return np.stack([b, b if self.y is self.x else self.y.at(x, y)])


_ACROSS = Refusal(
    "clay.angle", "must be 0 for a passivity controller or a coupling, which act along x and y"
)


def _words(form: str, name: str, unit: str) -> Callable[[Clay], tuple[Quantity, ...]]:
    """A quantity of the cells of both axes."""
    return lambda clay: Quantity.of_scene(
        form, (v for law in clay.laws for v in getattr(law, name).ravel().tolist()), unit
    )


def _scaled(name: str) -> Callable[[Clay, float], Clay]:
    """Clay with a quantity of the laws of both axes multiplied."""

    def of(law: Any, factor: float) -> Any:
        given = getattr(law, name)
        return replace(law, **{name: multiplied(given, factor, B_MAX)}) if given else law

    return lambda clay, factor: replace(clay, x=of(clay.x, factor), y=of(clay.y, factor))


def _soft(clay: Clay) -> Soft:
    most = max(float(x.damping.max()) for x in clay.laws if isinstance(x, Smooth))
    return Soft(most, "smooth clay", "; or integrator 'accurate', or clay of cells")


TRAITS = (
    Law(
        "viscous", "clay", lambda c: any(x.damping.any() for x in c.laws),
        words=_words("b = {}", "damping", "N.s/m"),
        force=lambda law, speed, _: law.damping * speed, scaled=_scaled("values"),
    ),
    Law(
        "growth", "clay", lambda c: c.grows, LEFT_OUT, seen_in_b=False, varies="time",
        words=_words("grows by {}", "rates", "N.s/m per s"),
        scaled=_scaled("growth"),
    ),
    Law("cells", "clay", lambda c: any(isinstance(x, Grid) for x in c.laws)),
    Law(
        "smooth", "clay", lambda c: bool(c.smooth), seen_in_b=False, varies="place", soft=_soft,
    ),
    Law(
        "rotated axes", "clay", lambda c: c.angle != 0.0,
        refuses={"passivity controller": _ACROSS, "virtual coupling": _ACROSS},
        words=lambda c: [Quantity("axes rotated by {}", (math.degrees(c.angle),), "degrees")],
    ),
)  # fmt: skip
# in the order of texts
LAWS: tuple[Law, ...] = (*groove.TRAITS, *flow.TRAITS, *TRAITS, *spring.TRAITS)
