"""Traits of parts: name, scenes with the part, and parts that cannot be combined with it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, NamedTuple, TypeVar

from ..errors import ParameterError

T = TypeVar("T", bound="Trait")
LEAST = 1e-9  # [N], [N/(m/s)^n] least resistance of clay that is scaled down
YES, LEFT_OUT, NO = "yes", "left out", "no"  # how linear theory treats a part


def _none(*_: Any) -> tuple[Any, ...]:
    return ()


@dataclass(frozen=True)
class Refusal:
    """Why two parts cannot be combined.

    Attributes:
        field: dotted name of the field in the error.
        bound: required value of that field.
    """

    field: str
    bound: str


@dataclass(frozen=True)
class Trait:
    """A part of a scene, or a method to step it.

    Attributes:
        name: in words.
        group: "method", "clay" or "part".
        has: whether a scene has it; for a clay trait, the argument is the clay.
        theory: whether linear theory covers it: "yes"; "left out", so that a gain limit is that of
            the scene without it; or "no", so that the scene is refused.
        refuses: parts that it cannot be combined with, by name.
        words: quantities of the part, from the argument of `has`.
    """

    name: str
    group: str
    has: Callable[[Any], bool]
    theory: str = YES
    refuses: Mapping[str, Refusal] = field(default_factory=dict)
    words: Callable[[Any], Sequence[Told]] = _none


class Told(NamedTuple):
    """A quantity of a part, for tables, titles and texts.

    Attributes:
        form: words, with {} in place of the values.
        values: values at different places or axes; empty for words alone.
        unit: of the values; "" for none.
    """

    form: str
    values: tuple[float, ...] = ()
    unit: str = ""

    def text(self, most: int = 1) -> str:
        """Words, values and unit, without repeated values."""
        some = sorted(set(self.values))
        shown = ", ".join(f"{v:.4g}" for v in some)
        if len(some) > most:
            shown = f"{some[0]:.4g} to {some[-1]:.4g}"
        return f"{self.form.format(shown)} {self.unit}".rstrip()


class Column(NamedTuple):
    """A column of a table of stretches.

    Attributes:
        name: name of the quantity, as in `Record.regions`.
        unit: its unit; "" for none.
    """

    name: str
    unit: str = ""


class Hold(NamedTuple):
    """A force that holds a tool at rest.

    Attributes:
        force: largest holding force [N].
        field: its cause, as named in a scenario.
        together: whether the pushes along both axes act on it together.
    """

    force: float
    field: str = ""
    together: bool = False


class Block(NamedTuple):
    """A rectangle of clay in addition to the laws of the axes.

    Attributes:
        x: where it begins and ends along x [m].
        y: the same along y.
        force: force on a tool that cuts it slowly [N].
        damping: additional force per speed [N.s/m].
        tool: tool that cuts it; None for any.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    force: float
    damping: float
    tool: Any = None

    def at_speed(self, speed: float) -> float:
        """Force on a tool that cuts it [N]."""
        return self.force + speed * self.damping

    def holds(self, x: Any, y: Any, margin: float = 0.0) -> Any:
        """Whether places lie in the block."""
        (x0, x1), (y0, y1), m = self.x, self.y, margin
        return (x >= x0 - m) & (x <= x1 + m) & (y >= y0 - m) & (y <= y1 + m)


class Soft(NamedTuple):
    """Clay whose damping the steps of the fast method must resolve, because no kick can be split.

    Attributes:
        damping: largest damping [N.s/m].
        where: place, in words.
        instead: alternative to a shorter step, in words.
    """

    damping: float
    where: str
    instead: str = ""


def _as_it_is(clay: Any, _: float) -> Any:
    return clay


@dataclass(frozen=True)
class Law(Trait):
    """A law of clay, as seen by tables, figures, texts and theory.

    Attributes:
        viscous: whether its force is damping times velocity, so that linear theory holds.
        of_velocity: whether its force depends on the velocity alone, through the damping and Fy, K
            and n of `Grid.flows_at`, so that theory gives the speed under a constant push.
        seen_in_b: whether the damping distinguishes its regions.
        along_motion: whether its force acts along the motion; else each axis resists by itself.
        varies: what the damping within a region depends on, "time" or "place"; "" if constant.
        columns: quantities of a stretch besides damping, returned by `at`.
        at: function of the law of one axis and a place (x, y) [m]: values of `columns`.
        here: function of clay and a place (x, y) [m]: quantities of both axes there.
        force: function of the law of one axis, a speed [m/s] and an indentation [m]: force of each
            cell [N]; None if the law adds no force.
        holds: function of clay and an axis, 0 or 1: what holds a tool at rest; None for nothing.
        blocks: function of clay: its rectangles.
        ground: function of clay: cells that a tool cuts permanently, as in `Groove` (`shape`,
            `edges`, `relief`, `shares`, `highest`); None if a tool does not change the clay.
        soft: function of clay: clay that steps must resolve; None for nothing.
        scaled: function of clay and a factor: clay with its resistance multiplied, within bounds.
    """

    viscous: bool = True
    of_velocity: bool = True
    seen_in_b: bool = True
    along_motion: bool = False
    varies: str = ""
    columns: tuple[Column, ...] = ()
    at: Callable[[Any, Any], Sequence[float]] = _none
    here: Callable[[Any, Any], Sequence[Told]] = _none
    force: Callable[[Any, float, float], Any] | None = None
    holds: Callable[[Any, int], Hold | None] | None = None
    blocks: Callable[[Any], Sequence[Block]] = _none
    ground: Callable[[Any], Any] | None = None
    soft: Callable[[Any], Soft | None] | None = None
    scaled: Callable[[Any, float], Any] = _as_it_is


def multiplied(values: Any, factor: float, most: float, least: float = 0.0) -> Any:
    """Numbers, or rows of them, multiplied and clipped to bounds; zeros stay zero."""
    if isinstance(values, tuple):
        return tuple(multiplied(x, factor, most, least) for x in values)
    return min(max(values * factor, least), most) if values else values


def told_values(form: str, values: Iterable[float], unit: str = "") -> tuple[Told, ...]:
    """A quantity over a scene, or nothing if all its values are 0."""
    some = tuple(v for v in dict.fromkeys(values) if v)
    return (Told(form, some, unit),) * bool(some)


def told_pair(form: str, values: Sequence[float], unit: str = "") -> tuple[Told, ...]:
    """A quantity of both axes at a place: one number if they agree, nothing if both are 0."""
    x, y = map(float, values)
    if not (x or y):
        return ()
    if x == y:
        return (Told(form, (x,), unit),)
    return (Told(form.format(f"({x:.4g}, {y:.4g})"), (), unit),)


def present(scene: Any, traits: Iterable[T]) -> list[T]:
    """The traits that a scene has."""
    return [x for x in traits if x.has(scene)]


def check_traits(found: Sequence[Trait], scene: Any, prefix: str = "") -> None:
    """Refuses traits that cannot be combined."""
    names = {x.name for x in found}
    for trait in found:
        for other, why in trait.refuses.items():
            if other in names:
                path = why.field.removeprefix(prefix).split(".")
                raise ParameterError(why.field, reduce(getattr, path, scene), why.bound)
