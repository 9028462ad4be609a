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
    """Why two parts cannot be combined: the field at fault, and the value it must have."""

    field: str  # dotted name
    bound: str


@dataclass(frozen=True)
class Trait:
    """A part of a scene, or a method to step it."""

    name: str
    group: str  # "method", "clay" or "part"
    has: Callable[[Any], bool]  # whether a scene has it; for a clay trait, the argument is the clay
    theory: str = YES  # how linear theory treats the part
    refuses: Mapping[str, Refusal] = field(default_factory=dict)  # by the name of the other part
    words: Callable[[Any], Sequence[Quantity]] = _none  # its quantities, from the argument of `has`


class Quantity(NamedTuple):
    """A quantity of a part, for tables, titles and texts."""

    form: str  # words, with {} in place of the values
    values: tuple[float, ...] = ()  # at different places or axes; empty for words alone
    unit: str = ""  # "" for none

    def text(self, most: int = 1) -> str:
        """Words, values and unit, without repeated values."""
        some = sorted(set(self.values))
        shown = ", ".join(f"{v:.4g}" for v in some)
        if len(some) > most:
            shown = f"{some[0]:.4g} to {some[-1]:.4g}"
        return f"{self.form.format(shown)} {self.unit}".rstrip()

    @classmethod
    def of_scene(cls, form: str, values: Iterable[float], unit: str = "") -> tuple[Quantity, ...]:
        """A quantity over a scene, or nothing if all its values are 0."""
        some = tuple(v for v in dict.fromkeys(values) if v)
        return (cls(form, some, unit),) * bool(some)

    @classmethod
    def of_axes(cls, form: str, values: Sequence[float], unit: str = "") -> tuple[Quantity, ...]:
        """A quantity of both axes: one number if they agree, nothing if both are 0."""
        x, y = map(float, values)
        if x != y:
            return (cls(form.format(f"({x:.4g}, {y:.4g})"), (), unit),)
        return cls.of_scene(form, (x,), unit)


class Column(NamedTuple):
    """A column of a table of stretches."""

    name: str  # as in `Record.regions`
    unit: str = ""  # "" for none


class Hold(NamedTuple):
    """The largest force that holds a tool at rest."""

    force: float  # [N]
    field: str = ""  # its cause, as named in a scenario
    together: bool = False  # whether the pushes along both axes act on it together


class Block(NamedTuple):
    """A rectangle of clay in addition to the laws of the axes."""

    x: tuple[float, float]  # begin and end [m]
    y: tuple[float, float]  # begin and end [m]
    force: float  # on a tool that cuts it slowly [N]
    damping: float  # additional force per speed [N.s/m]
    tool: Any = None  # that cuts it; None for any

    def at_speed(self, speed: float) -> float:
        """Force on a tool that cuts it [N]."""
        return self.force + speed * self.damping

    def holds(self, x: Any, y: Any, margin: float = 0.0) -> Any:
        """Whether places lie in the block."""
        (x0, x1), (y0, y1), m = self.x, self.y, margin
        return (x >= x0 - m) & (x <= x1 + m) & (y >= y0 - m) & (y <= y1 + m)


class Soft(NamedTuple):
    """Clay whose damping the steps of the fast method must resolve: no kick can be split in it."""

    damping: float  # the largest [N.s/m]
    where: str  # in words
    instead: str = ""  # alternative to a shorter step, in words


def _as_it_is(clay: Any, _: float) -> Any:
    return clay


@dataclass(frozen=True)
class Law(Trait):
    """A law of clay, as seen by tables, figures, texts and theory; `law` is that of one axis."""

    viscous: bool = True  # force is damping times velocity: linear theory holds
    of_velocity: bool = True  # force depends on velocity alone: theory gives the speed under a push
    seen_in_b: bool = True  # damping distinguishes its regions
    along_motion: bool = False  # else each axis resists by itself
    varies: str = ""  # what damping within a region depends on, "time" or "place"
    columns: tuple[Column, ...] = ()  # of a stretch, besides damping
    at: Callable[[Any, Any], Sequence[float]] = _none  # (law, (x, y) [m]): values of `columns`
    here: Callable[[Any, Any], Sequence[Quantity]] = _none  # (clay, (x, y) [m]): of both axes
    # (law, speed [m/s], indentation [m]): force of each cell [N]
    force: Callable[[Any, float, float], Any] | None = None
    holds: Callable[[Any, int], Hold | None] | None = None  # (clay, axis 0 or 1)
    blocks: Callable[[Any], Sequence[Block]] = _none
    ground: Callable[[Any], Any] | None = None  # (clay): cells that a tool cuts, as `Groove`
    soft: Callable[[Any], Soft | None] | None = None
    # (clay, factor): clay with its resistance multiplied, within bounds
    scaled: Callable[[Any, float], Any] = _as_it_is


def multiplied(values: Any, factor: float, most: float, least: float = 0.0) -> Any:
    """Numbers, or rows of them, multiplied and clipped to bounds; zeros stay zero."""
    if isinstance(values, tuple):
        return tuple(multiplied(x, factor, most, least) for x in values)
    return min(max(values * factor, least), most) if values else values


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
