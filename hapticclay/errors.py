"""The exception for bad parameters, and the checks that raise it."""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import functools
import itertools
import math
import numbers
import reprlib
import types
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    Union,
    get_args,
    get_origin,
    get_type_hints,
)

from .display import one_line
from .units import from_unit, is_quantity

if TYPE_CHECKING:
    import numpy as np


MOST_OF_VALUE, MOST_OF_NAME, MOST_OF_BOUND = 60, 120, 600  # characters in a message
MOST_COMPARED = 100  # characters of a word that is compared with known names


class ParameterError(ValueError):
    """A parameter was refused.

    Args:
        field: name of the parameter.
        value: the value that was given.
        bound: accepted values, in words.
    """

    def __init__(self, field: str, value: object, bound: str):
        text = bound if isinstance(bound, str) else _short(bound)
        self.field, self.value, self.bound = field, value, _middle_cut(text)
        name = one_line(field, MOST_OF_NAME) if isinstance(field, str) else _short(field)
        super().__init__(f"{name} = {_short(value)}: {self.bound}")

    def __reduce__(self):
        return type(self), (self.field, self.value, self.bound), self.__dict__


class Warning(UserWarning):  # as in `hc.Warning`
    """A scenario has implausible values, such as clay out of reach."""


class _Bounded(reprlib.Repr):
    """Text of a value in bounded time and length, however large or deep it is."""

    def __init__(self):
        super().__init__()
        self.maxlevel = 8
        self.maxstring = self.maxlong = 4 * MOST_OF_VALUE
        self.maxlist = self.maxtuple = self.maxdict = self.maxset = MOST_OF_VALUE // 2
        self.maxfrozenset = self.maxdeque = self.maxarray = MOST_OF_VALUE // 2
        self.maxother = 10**6

    def repr_int(self, x: int, level: int) -> str:
        if x.bit_length() > 4 * self.maxlong:  # Python refuses to write thousands of digits
            return f"<whole number of {x.bit_length()} bits>"
        return repr(x)

    def repr_dict(self, x: dict[Any, Any], level: int) -> str:
        """As by repr, in the order of the dictionary."""
        if x and level <= 0:
            return "{...}"
        items = itertools.islice(x.items(), self.maxdict)
        told = [f"{self.repr1(k, level - 1)}: {self.repr1(v, level - 1)}" for k, v in items]
        return "{" + ", ".join(told + ["..."] * (len(x) > self.maxdict)) + "}"

    def repr_bytes(self, x: bytes, level: int) -> str:
        return repr(x[: self.maxstring])

    def repr_instance(self, x: Any, level: int) -> str:
        try:
            return repr(x)
        except Exception:  # of a class that is not ours
            return f"<{type(x).__name__}>"


_bounded = _Bounded()


def _short(value: object) -> str:
    return one_line(_bounded.repr(value), MOST_OF_VALUE)


def _middle_cut(text: str) -> str:
    """A text without its middle if it is long: the nearest name stands at the end."""
    if len(text) <= MOST_OF_BOUND:
        return text
    half = MOST_OF_BOUND // 2 - 3
    return f"{text[:half]} ... {text[-half:]}"


def nearest(word: str, names: Collection[str]) -> list[str]:
    """The name most like a word, in a list; an empty list if none is."""
    return difflib.get_close_matches(word[:MOST_COMPARED], names, n=1)


def quantity(field: str, text: str, unit: str = "") -> float | None:
    """The number of a text like "5 cm", in the unit of a field; None for other texts."""
    try:
        return from_unit(text, unit)
    except ValueError as error:
        raise ParameterError(field, text, str(error)) from None


def number_in(field: str, text: object, unit: str = "") -> float:
    """The number that a text stands for, "5" or "5 cm", in the unit of a field."""
    given = quantity(field, text, unit) if isinstance(text, str) else None
    return float(text) if given is None else given  # type: ignore[arg-type]


def number(
    field: str,
    value: object,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: bool = False,
    unit: str = "",
) -> float:
    """Returns value as a finite float within [low, high], or (low, high] if above."""
    if type(value) is float and _is_within(value, low, high, above):
        return value
    given = quantity(field, value, unit) if isinstance(value, str) else value
    if not isinstance(given, bool) and isinstance(given, numbers.Real):
        try:
            x = float(given)
        except (OverflowError, ValueError):
            x = math.nan
        if _is_within(x, low, high, above):
            return x
    bound = "must be a finite number"
    if low > -math.inf:
        bound += f" {'>' if above else '>='} {low:g}"
    if high < math.inf:
        bound += f"{' and' if low > -math.inf else ''} <= {high:g}"
    raise ParameterError(field, value, bound + (f" {unit}" if unit else ""))


def _is_within(x: float, low: float, high: float, above: bool) -> bool:
    return low < x < high or (
        (x == high or (x == low and not above)) and low <= x <= high and math.isfinite(x)
    )


def integer(field: str, value: object, low: int, high: int) -> int:
    """Returns value as an int within [low, high]."""
    if type(value) is int and low <= value <= high:
        return value
    if (
        isinstance(value, bool)
        or not isinstance(value, numbers.Integral)
        or not low <= int(value) <= high
    ):
        raise ParameterError(field, value, f"must be a whole number from {low} to {high}")
    return int(value)


def flag(field: str, value: object) -> bool:
    """Returns value if it is a bool."""
    if not isinstance(value, bool):
        raise ParameterError(field, value, "must be True or False")
    return value


def is_series(value: object) -> bool:
    """Whether a value can be iterated over and is no text; a NumPy scalar only seems so."""
    plain = isinstance(value, Iterable) and not isinstance(value, str | bytes)
    return plain and getattr(value, "ndim", 1) != 0


def numbers_of(
    field: str,
    value: object,
    names: Sequence[str],
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: bool = False,
    unit: str = "",
) -> tuple[float, ...]:
    """Returns value as a tuple of floats, each checked by `number`."""
    if type(value) is tuple and len(value) == len(names):
        for x in value:
            if type(x) is not float or not _is_within(x, low, high, above):
                break
        else:
            return value
    if not is_series(value):
        bound = f"must be {len(names)} numbers ({', '.join(names)})"
        raise ParameterError(field, value, bound)
    items = tuple(value)  # type: ignore[arg-type]
    if len(items) != len(names):
        bound = f"must be {len(names)} numbers ({', '.join(names)})"
        raise ParameterError(field, value, f"{bound}, got {len(items)}")
    return tuple(
        number(f"{field}[{name}]", item, low, high, above=above, unit=unit)
        for name, item in zip(names, items, strict=True)
    )


def table_of(
    field: str,
    value: object,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: bool = False,
    unit: str = "",
) -> tuple[tuple[float, ...], ...]:
    """Returns value as rows of floats of equal length, each checked by `number`."""
    import numpy as np

    bound = "must be rows of numbers, all of one length"
    try:
        table = np.asarray(value)
        if table.dtype.kind == "U" and table.ndim == 2 and any(map(is_quantity, table.flat)):
            rows: Any = value
            given = [
                [number(f"{field}[{i}, {j}]", x, unit=unit) for j, x in enumerate(row)]
                for i, row in enumerate(rows)
            ]
            table = np.asarray(given)
    except (TypeError, ValueError) as error:
        if isinstance(error, ParameterError):
            raise
        raise ParameterError(field, value, bound) from None
    if table.size == 0 and table.dtype.kind == "f":
        return ()
    if table.ndim != 2 or table.dtype.kind not in "fiu":
        raise ParameterError(field, value, bound)
    good = np.isfinite(table) & (table >= low) & (table <= high)
    for i, j in np.argwhere(~good | (table == low) if above else ~good)[:1].tolist():
        number(f"{field}[{i}, {j}]", table[i, j].item(), low, high, above=above, unit=unit)
    return tuple(map(tuple, table.astype(float).tolist()))


def array_of(field: str, value: object, bound: str = "must be numbers") -> np.ndarray:
    """Returns a copy of value as an array of floats."""
    import numpy as np

    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(field, value, bound) from None


def pair(
    field: str,
    value: object,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: bool = False,
    unit: str = "",
) -> tuple[float, float]:
    """Returns value as an (x, y) pair of floats, each checked by `number`."""
    x, y = numbers_of(field, value, ("x", "y"), low, high, above=above, unit=unit)
    return x, y


def choice(field: str, value: object, valid: Sequence[str]) -> str:
    """Returns value if it is one of the valid names."""
    if isinstance(value, str) and value in valid:
        return value
    near = nearest(value, valid) if isinstance(value, str) else []
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise ParameterError(field, value, f"must be one of {', '.join(valid)}{hint}")


@dataclass(frozen=True)
class Bound:
    """Bounds and unit of a number, or of each number in a tuple: `Annotated[float, Bound(...)]`.

    Attributes:
        low: smallest value, or the name of the field that holds it.
        high: largest value.
        unit: unit, as in "N.s/m".
        above: whether low itself is refused.
        names: names of the numbers in a tuple of fixed length.
    """

    low: float | str = -math.inf
    high: float = math.inf
    unit: str = ""
    above: bool = False
    names: tuple[str, ...] = ("x", "y")


Check = Callable[[str, Any, Any], Any]  # (name for the error, value, part that has the field)


def check_fields(part: Any, prefix: str = "") -> None:
    """Checks each field of a frozen dataclass by its annotation.

    Numbers become floats, sequences become tuples. Fields may be float, int, bool, str, Literal,
    tuples of floats, other dataclasses, pairs (x, y) of them, or a union of these with None; float
    and int take a `Bound`.
    """
    for name, told, check, good in _checks_to_make(type(part), prefix):
        value = getattr(part, name)
        if value is good:
            continue
        checked = check(told, value, part)
        if checked is not value:
            object.__setattr__(part, name, checked)


@functools.cache
def field_types(kind: type) -> dict[str, tuple[Any, Bound | None]]:
    """Type without annotations, and bound, of each field of a dataclass."""
    hints = get_type_hints(kind, include_extras=True)
    out: dict[str, tuple[Any, Bound | None]] = {}
    for field in dataclasses.fields(kind):
        hint, *notes = (
            get_args(hints[field.name])
            if get_origin(hints[field.name]) is Annotated
            else (hints[field.name],)
        )
        out[field.name] = hint, next((n for n in notes if isinstance(n, Bound)), None)
    return out


@functools.cache
def _field_checks(kind: type, prefix: str) -> list[tuple[str, str, Check]]:
    return [
        (name, prefix + name, _check_of(hint, bound or Bound()))
        for name, (hint, bound) in field_types(kind).items()
    ]


@functools.cache
def _checks_to_make(kind: type, prefix: str) -> list[tuple[str, str, Check, Any]]:
    """As `_field_checks`, with the default if it needs no check; else MISSING."""
    defaults = {f.name: f.default for f in dataclasses.fields(kind)}
    out = []
    for name, told, check in _field_checks(kind, prefix):
        bound, good = field_types(kind)[name][1], defaults[name]
        try:  # not if the bound is another field
            if (bound and isinstance(bound.low, str)) or check(told, good, None) is not good:
                good = dataclasses.MISSING
        except ParameterError:
            good = dataclasses.MISSING
        out.append((name, told, check, good))
    return out


def _check_of(hint: Any, bound: Bound, optional: str = "") -> Check:
    """The check for values of a type."""
    origin, args = get_origin(hint), get_args(hint)
    if origin in (Union, types.UnionType):
        return _check_union(args, bound)
    if origin is Literal:
        return lambda field, value, part: choice(field, value, args)
    if _is_pair(hint):
        return _check_each_axis(hint, [], bound)
    if origin is tuple:
        return _check_tuple(args, bound)
    if hint is float:
        return _check_number(bound)
    if hint is int:
        high = int(bound.high)
        return lambda field, value, part: integer(
            field, value, _bound_limits(bound, part)["low"], high
        )
    if hint is bool:
        return lambda field, value, part: flag(field, value)
    if hint is str:
        return _check_text
    if hint is Any:  # the part itself checks it
        return lambda field, value, part: value
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        article = "an" if hint.__name__[0] in "AEIOU" else "a"
        return _check_part(hint, f"must be {article} {hint.__name__}{optional}")
    raise TypeError(f"{hint}: no check for fields of this type")


def _check_number(bound: Bound) -> Check:
    low, high, above, unit = bound.low, bound.high, bound.above, bound.unit
    if isinstance(low, str):
        return lambda field, value, part: number(field, value, **_bound_limits(bound, part))
    return lambda field, value, part: number(field, value, low, high, above=above, unit=unit)


def _bound_limits(bound: Bound, part: Any) -> dict[str, Any]:
    low = getattr(part, bound.low) if isinstance(bound.low, str) else bound.low
    return {"low": low, "high": bound.high, "above": bound.above, "unit": bound.unit}


def _check_union(kinds: tuple[Any, ...], bound: Bound) -> Check:
    """None, a word, or a value of the only other type."""
    nullable, words = type(None) in kinds, [k for k in kinds if get_origin(k) is Literal]
    others = [k for k in kinds if k is not type(None) and k not in words]
    pairs = [k for k in others if _is_pair(k)]
    if pairs:  # of parts, or one part for both axes
        return _check_each_axis(pairs[0], [k for k in kinds if k not in pairs], bound)
    other = _check_of((others or words)[0], bound, " or None" if nullable else "")
    if len(others) > 1:
        told = " or ".join(f"a {k.__name__}" for k in others) + " or None" * nullable
        other = _check_part(tuple(others), f"must be {told}")
    word = _check_of(words[0], bound) if words else other

    def check(field: str, value: Any, part: Any) -> Any:
        if value is None and nullable:
            return None
        spoken = isinstance(value, str) and not is_quantity(value)
        return (word if spoken else other)(field, value, part)

    return check


def _is_pair(hint: Any) -> bool:
    """Whether a type is a pair of parts, one per axis."""
    kinds = get_args(hint)
    two = get_origin(hint) is tuple and len(kinds) == 2 and kinds[1] is not ...
    return two and _part_of(kinds[0]) is not None


def _part_of(hint: Any) -> Any:
    """The dataclass in a type, or in its union with None; None if there is none."""
    kinds = get_args(hint) or (hint,)
    return next((k for k in kinds if isinstance(k, type) and dataclasses.is_dataclass(k)), None)


def _check_each_axis(pair_hint: Any, single: list[Any], bound: Bound) -> Check:
    """A pair (x, y) of parts; or one of the single types, where there are any."""
    each = _check_of(get_args(pair_hint)[0], bound)
    whole = _check_of(Union[tuple(single)], bound) if single else None  # noqa: UP007
    part = _part_of(get_args(pair_hint)[0]).__name__

    def check(field: str, value: Any, owner: Any) -> Any:
        if isinstance(value, tuple | list):
            if len(value) != 2:
                raise ParameterError(field, value, f"must be a pair (x, y) of {part}")
            x, y = (each(f"{field}.{axis}", v, owner) for axis, v in zip("xy", value, strict=True))
            return (x, y)
        if whole is None:
            raise ParameterError(field, value, f"must be a pair (x, y) of {part}")
        return whole(field, value, owner)

    return check


def _check_tuple(kinds: tuple[Any, ...], bound: Bound) -> Check:
    """As many floats as the bound names, or any number of them, of rows of them, or of parts."""
    if get_origin(kinds[0]) is tuple:
        return lambda field, value, part: table_of(field, value, **_bound_limits(bound, part))
    if _part_of(kinds[0]) is not None:
        return _check_parts(kinds[0])

    def check(field: str, value: Any, part: Any) -> Any:
        names: Sequence[str] = bound.names
        if kinds[1:] == (...,):
            if not is_series(value) or not hasattr(value, "__len__"):
                raise ParameterError(field, value, "must be a sequence of numbers")
            names = _place_names(len(value))
        return numbers_of(field, value, names, **_bound_limits(bound, part))

    return check


@functools.lru_cache(maxsize=64)
def _place_names(n: int) -> list[str]:
    """Names of n numbers."""
    return [str(i) for i in range(n)]


def _check_parts(kind: type) -> Check:
    """Any number of parts of one class."""

    def check(field: str, value: Any, part: Any) -> Any:
        if not isinstance(value, tuple | list):
            raise ParameterError(field, value, f"must be a sequence of {kind.__name__}")
        for i, x in enumerate(value):
            if not isinstance(x, kind):
                raise ParameterError(f"{field}[{i}]", x, f"must be a {kind.__name__}")
        return tuple(value)

    return check


def _check_part(kind: type | tuple[type, ...], told: str) -> Check:
    def check(field: str, value: Any, part: Any) -> Any:
        if not isinstance(value, kind):
            raise ParameterError(field, value, told)
        return value

    return check


def _check_text(field: str, value: Any, part: Any) -> Any:
    if not isinstance(value, str) or not value:
        raise ParameterError(field, value, "must be a non-empty string")
    return value


@contextlib.contextmanager
def needing(what: str, package: str, extra: str = "data") -> Iterator[None]:
    """Explains how to install a package if its import fails."""
    try:
        yield
    except ImportError:
        bound = f"must be installed: pip install 'hapticclay[{extra}]'"
        raise ParameterError(what, package, bound) from None
