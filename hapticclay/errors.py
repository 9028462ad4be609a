"""The one exception a caller has to know, and the checks that raise it at the door."""

from __future__ import annotations

import difflib
import math
import numbers
from collections.abc import Iterable, Sequence


class ParameterError(ValueError):
    """A parameter was refused.

    Attributes:
        field: name of the parameter.
        value: the value that was given.
        bound: what would have been accepted, in words.
    """

    def __init__(self, field: str, value: object, bound: str):
        self.field, self.value, self.bound = field, value, bound
        super().__init__(f"{field} = {_short(value)}: {bound}")

    def __reduce__(self):
        return type(self), (self.field, self.value, self.bound), self.__dict__


def _short(value: object) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else text[:57] + "..."


def number(
    field: str,
    value: object,
    low: float = -math.inf,
    high: float = math.inf,
    *,
    above: bool = False,
    unit: str = "",
) -> float:
    """Returns value as a finite float within [low, high], or (low, high] if above.

    Raises:
        ParameterError: wrong type, NaN, infinite, or out of bounds.
    """
    bound = "must be a finite number"
    if low > -math.inf:
        bound += f" {'>' if above else '>='} {low:g}"
    if high < math.inf:
        bound += f" {'and' if low > -math.inf else ''} <= {high:g}".replace("  ", " ")
    bound += f" {unit}" if unit else ""
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        raise ParameterError(field, value, bound)
    try:
        x = float(value)
    except (OverflowError, ValueError):
        raise ParameterError(field, value, bound) from None
    if not math.isfinite(x) or x < low or x > high or (above and x == low):
        raise ParameterError(field, value, bound)
    return x


def integer(field: str, value: object, low: int, high: int) -> int:
    """Returns value as an int within [low, high]; raises ParameterError otherwise."""
    if (
        isinstance(value, bool)
        or not isinstance(value, numbers.Integral)
        or not low <= int(value) <= high
    ):
        raise ParameterError(field, value, f"must be a whole number from {low} to {high}")
    return int(value)


def flag(field: str, value: object) -> bool:
    """Returns value if it is a bool; raises ParameterError otherwise."""
    if not isinstance(value, bool):
        raise ParameterError(field, value, "must be True or False")
    return value


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
    """Returns value as a tuple of len(names) floats, each checked by `number`."""
    bound = f"must be {len(names)} numbers ({', '.join(names)})"
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        raise ParameterError(field, value, bound)
    items = list(value)
    if len(items) != len(names):
        raise ParameterError(field, value, f"{bound}, got {len(items)}")
    return tuple(
        number(f"{field}[{name}]", item, low, high, above=above, unit=unit)
        for name, item in zip(names, items, strict=True)
    )


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
    """Returns value if it is one of valid; otherwise the error names the nearest."""
    if isinstance(value, str) and value in valid:
        return value
    near = difflib.get_close_matches(str(value), valid, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise ParameterError(field, value, f"must be one of {', '.join(valid)}{hint}")
