"""What a part says of itself: its name, which scenes have it, and what refuses it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from typing import Any, NamedTuple, TypeVar

from ..errors import ParameterError

T = TypeVar("T", bound="Trait")
LEAST = 1e-9  # [N], [N/(m/s)^n] of clay that is scaled down and goes on to resist
YES, LEFT_OUT, NO = "yes", "left out", "no"  # what linear theory makes of a part


def _none(*_: Any) -> tuple[Any, ...]:
    return ()


@dataclass(frozen=True)
class Refusal:
    """Why two parts cannot be combined.

    Attributes:
        field: dotted name of the field that the error is about.
        bound: what that field must be.
    """

    field: str
    bound: str


@dataclass(frozen=True)
class Trait:
    """A part of a scene, or a way to step it.

    Attributes:
        name: in words.
        group: "method", "clay" or "part".
        has: whether a scene has it; that of clay is asked of the clay.
        theory: whether linear theory knows it: "yes"; "left out", so that a gain limit is that of
            the scene without it; or "no", so that the scene is refused.
        refuses: what it cannot be combined with, by name of the other.
        words: of what `has` is asked of, its quantities.
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
        values: they, as different places or axes have them; empty for words alone.
        unit: of the values; "" for none.
    """

    form: str
    values: tuple[float, ...] = ()
    unit: str = ""

    def text(self, most: int = 1) -> str:
        """Words, values and unit; no value stands twice.

        Args:
            most: how many values are listed; of more, the least and the largest are shown.
        """
        some = sorted(set(self.values))
        shown = ", ".join(f"{v:.4g}" for v in some)
        if len(some) > most:
            shown = f"{some[0]:.4g} to {some[-1]:.4g}"
        return f"{self.form.format(shown)} {self.unit}".rstrip()


class Column(NamedTuple):
    """A column of a table of stretches.

    Attributes:
        name: of the quantity, as in `Record.regions`.
        unit: of it; "" for none.
    """

    name: str
    unit: str = ""


class Hold(NamedTuple):
    """What holds a tool at rest.

    Attributes:
        force: up to which it holds [N].
        field: what makes it, as a scenario names it.
        together: whether the pushes along both axes act on it together.
    """

    force: float
    field: str = ""
    together: bool = False


class Block(NamedTuple):
    """A rectangle of clay beside the laws of the axes.

    Attributes:
        x: where it begins and ends along x [m].
        y: the same along y.
        force: of a tool that cuts it slowly [N].
        damping: force per speed, beside it [N.s/m].
        tool: that cuts it; None for any.
    """

    x: tuple[float, float]
    y: tuple[float, float]
    force: float
    damping: float
    tool: Any = None

    def at_speed(self, speed: float) -> float:
        """Force of a tool that cuts it [N].

        Args:
            speed: of the tool [m/s].
        """
        return self.force + speed * self.damping

    def holds(self, x: Any, y: Any, margin: float = 0.0) -> Any:
        """Whether places lie in it.

        Args:
            x: coordinates [m].
            y: the same along y.
            margin: around it, which counts as in it [m].
        """
        (x0, x1), (y0, y1), m = self.x, self.y, margin
        return (x >= x0 - m) & (x <= x1 + m) & (y >= y0 - m) & (y <= y1 + m)


class Soft(NamedTuple):
    """Clay whose damping the steps of the fast method must resolve, as no kick may be split in it.

    Attributes:
        damping: the largest [N.s/m].
        where: in words.
        instead: what resolves it but a shorter step, in words.
    """

    damping: float
    where: str
    instead: str = ""


def _as_it_is(clay: Any, _: float) -> Any:
    return clay


@dataclass(frozen=True)
class Law(Trait):
    """A law of clay: what tables, figures, texts and theory show or assume of it.

    Attributes:
        viscous: whether its force is damping times velocity, so that linear theory holds.
        of_velocity: whether its force follows from the velocity alone, by the damping and by Fy, K
            and n of `Grid.flows_at`, so that theory knows the speed under a constant push.
        seen_in_b: whether the damping tells its regions apart.
        along_motion: whether its force has the direction of the motion; else each axis has its own.
        varies: what the damping of a region varies over, "time" or "place"; "" for one number.
        columns: quantities of a stretch beside its damping, which `at` returns.
        at: of the law of one axis and a place (x, y) [m], values of `columns`.
        here: of clay and a place (x, y) [m], quantities of both axes there.
        force: of the law of one axis, a speed [m/s] and an indentation [m], force of each cell at
            them [N]; None where it has none beside those of others.
        holds: of clay and an axis, 0 or 1, what holds a tool at rest; None where nothing does.
        blocks: of clay, its rectangles.
        ground: of clay, the cells that a tool cuts for good, as `Groove` has them (`shape`,
            `edges`, `relief`, `shares`, `highest`); None where a tool leaves clay as it was.
        soft: of clay, what steps must resolve of it; None for nothing.
        scaled: of clay and a factor, the clay with what resists multiplied by it, within bounds.
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
    """Numbers, or rows of them, multiplied within bounds; those that are 0 stay so.

    Args:
        values: they, or tuples of them.
        factor: on each.
        most: upper bound.
        least: lower bound of those that are not 0.
    """
    if isinstance(values, tuple):
        return tuple(multiplied(x, factor, most, least) for x in values)
    return min(max(values * factor, least), most) if values else values


def told_values(form: str, values: Iterable[float], unit: str = "") -> tuple[Told, ...]:
    """A quantity over a scene, or nothing where all its values are 0.

    Args:
        form: as `Told.form`.
        values: they.
        unit: of them.
    """
    some = tuple(v for v in dict.fromkeys(values) if v)
    return (Told(form, some, unit),) * bool(some)


def told_pair(form: str, values: Sequence[float], unit: str = "") -> tuple[Told, ...]:
    """A quantity of both axes at a place, one number where they agree, nothing where both are 0.

    Args:
        form: as `Told.form`.
        values: along x and along y.
        unit: of them.
    """
    x, y = map(float, values)
    if not (x or y):
        return ()
    if x == y:
        return (Told(form, (x,), unit),)
    return (Told(form.format(f"({x:.4g}, {y:.4g})"), (), unit),)


def present(scene: Any, traits: Iterable[T]) -> list[T]:
    """The traits that a scene has.

    Args:
        scene: a scenario; or clay, for those of clay.
        traits: to be looked for.
    """
    return [x for x in traits if x.has(scene)]


def check_traits(found: Sequence[Trait], scene: Any, prefix: str = "") -> None:
    """Refuses traits that cannot be combined.

    Args:
        found: the traits that there are.
        scene: a scenario, or clay.
        prefix: of the dotted names of the fields of `scene`.

    Raises:
        ParameterError: two of them cannot.
    """
    names = {x.name for x in found}
    for trait in found:
        for other, why in trait.refuses.items():
            if other in names:
                path = why.field.removeprefix(prefix).split(".")
                raise ParameterError(why.field, reduce(getattr, path, scene), why.bound)
