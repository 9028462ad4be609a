"""The exception for bad parameters, and the checks that raise it."""

from __future__ import annotations

import contextlib
import difflib
import itertools
import math
import numbers
import os
import reprlib
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

from .display import names_words, one_line
from .units import from_unit, is_quantity

if TYPE_CHECKING:
    import numpy as np


MOST_OF_VALUE, MOST_OF_NAME, MOST_OF_BOUND = 60, 120, 600  # characters in a message
MOST_OF_PATH, MOST_OF_FILE = 4096, 255  # of a path, and the name of a file: none are longer
MOST_COMPARED = 100  # characters of a word that is compared with known names
SYNONYMS = {
    **dict.fromkeys(("max_time", "end_time", "t_end", "duration", "sim_time"), "t_max"),
    **dict.fromkeys(("timestep", "time_step", "step"), "dt"),
    **dict.fromkeys(("sample_time", "sampling_time", "sample_period"), "Ts"),
    **dict.fromkeys(("latency", "lag"), "delay"),
}
"""Names elsewhere of what has another name here."""


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


class MissingPackage(ParameterError):
    """Something needs a package that is not installed.

    Args:
        what: what needs it, in words.
        package: its name.
        extra: the extra of hapticclay that installs it.
    """

    def __init__(self, what: str, package: str, extra: str):
        bound = f"must be installed: pip install 'hapticclay[{extra}]'"
        super().__init__(what, package, bound)
        self.args = (f"{what} needs {package}, which {bound}",)
        self.extra = extra

    def __reduce__(self):
        return type(self), (self.field, self.value, self.extra), self.__dict__


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
        texts = [f"{self.repr1(k, level - 1)}: {self.repr1(v, level - 1)}" for k, v in items]
        return "{" + ", ".join(texts + ["..."] * (len(x) > self.maxdict)) + "}"

    def repr_bytes(self, x: bytes, level: int) -> str:
        return repr(x[: self.maxstring])

    def repr_instance(self, x: Any, level: int) -> str:
        try:
            return repr(x)
        except Exception:  # of a class that is not ours
            return f"<{type(x).__name__}>"


_bounded = _Bounded()


def _short(value: object) -> str:
    if isinstance(value, str | os.PathLike) and (end := _end_of_path(os.fspath(value))):
        return end
    if isinstance(value, list | tuple) and all(type(x) is str for x in value[: MOST_OF_VALUE // 2]):
        return _names(value)
    return one_line(_bounded.repr(value), MOST_OF_VALUE)


def _end_of_path(path: str | bytes) -> str:
    """The end of a long path, with the whole name of its file; "" of all other texts."""
    if isinstance(path, bytes) or not MOST_OF_VALUE < len(path) < MOST_OF_PATH:
        return ""
    *folders, name = path.split("/")
    if not folders or len(name) > MOST_OF_FILE or not path.isprintable() or "<" in path:
        return ""
    for folder in reversed(folders):
        if len(folder) + 1 + len(name) > MOST_OF_VALUE:
            break
        name = f"{folder}/{name}"
    return repr(f"...{name}")


def _names(names: list[str] | tuple[str, ...]) -> str:
    """Names, none of them cut."""
    if len(_bounded.repr(names)) <= MOST_OF_NAME or len(names) < 2:
        return one_line(_bounded.repr(names), MOST_OF_NAME)
    return f"[{names_words([repr(x) for x in names], MOST_OF_NAME)}]"


def _middle_cut(text: str) -> str:
    """A text without its middle if it is long: the nearest name stands at the end."""
    if len(text) <= MOST_OF_BOUND:
        return text
    half = MOST_OF_BOUND // 2 - 3
    return f"{text[:half]} ... {text[-half:]}"


def nearest(word: str, names: Collection[str]) -> list[str]:
    """The name that a word means or is most like, in a list; an empty list if there is none."""
    same = SYNONYMS.get(word)
    if same is not None and same in names:
        return [same]
    alike = [name for name in names if name.lower() == word.lower()]
    return alike[:1] or difflib.get_close_matches(word[:MOST_COMPARED], names, n=1)


def quantity(field: str, text: str, unit: str = "") -> float | None:
    """The number of a text like "5 cm", in the unit of a field; None for other texts."""
    try:
        return from_unit(text, unit)
    except ValueError as error:
        raise ParameterError(field, text, str(error)) from None


def number_in(field: str, text: object, unit: str = "") -> float:
    """The number that a text stands for, "5" or "5 cm", in the unit of a field.

    Raises ValueError or TypeError if it is no number, ParameterError for another unit.
    """
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
    """Returns value, a number or "5 cm", as a finite float in [low, high], (low, high] if above."""
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
    raise ParameterError(field, value, f"must be {Bound(low, high, unit, above).number_words()}")


def _is_within(x: float, low: float, high: float, above: bool) -> bool:
    return low < x < high or (
        (x == high or (x == low and not above)) and low <= x <= high and math.isfinite(x)
    )


def integer(field: str, value: object, low: float, high: float) -> int:
    """Returns value as an int within [low, high]."""
    if type(value) is int and low <= value <= high:
        return value
    if (
        isinstance(value, bool)
        or not isinstance(value, numbers.Integral)
        or not low <= int(value) <= high
    ):
        raise ParameterError(field, value, f"must be {Bound(low, high).integer_words()}")
    return int(value)


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
    field: str, value: object, low: float, high: float, *, above: bool, unit: str
) -> tuple[tuple[float, ...], ...]:
    """Returns value, shape (n, m) or empty, as rows of floats, each checked by `number`."""
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
    """Returns a copy of value as an array of floats of any shape."""
    import numpy as np

    try:
        return np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(field, value, bound) from None


def pair(field: str, value: object, *limits: float, **how: Any) -> tuple[float, float]:
    """Returns value as an (x, y) pair of floats, each checked by `number`."""
    x, y = numbers_of(field, value, ("x", "y"), *limits, **how)
    return x, y


def choice(field: str, value: object, valid: Sequence[str], wants: str = "") -> str:
    """Returns value if it is one of the valid names; wants: what else is valid, with them."""
    if isinstance(value, str) and value in valid:
        return value
    near = nearest(value, valid) if isinstance(value, str) else []
    hint = f"; did you mean {near[0]!r}?" if near else ""
    wants = wants or f"one of {', '.join(valid)}"
    raise ParameterError(field, value, f"must be {wants}{hint}")


if TYPE_CHECKING:  # a caller may write 0.002 or "2 ms", which is checked when it arrives
    Real: TypeAlias = float | Any
else:
    Real = float  # what arrives


@dataclass(frozen=True)
class Bound:
    """Bounds and unit of a number, or of each number in a tuple: `Annotated[float, Bound(...)]`.

    With a unit it is `Annotated[Real, Bound(...)]`, which type checkers let be a text.

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

    def number_words(self) -> str:
        """What a number within these bounds is."""
        low, high = self.low, self.high
        limits = [f"{'>' if self.above else '>='} {_spelled(low)}"] * (low != -math.inf)
        limits += [f"<= {high:g}"] * (high < math.inf)
        unit = self.unit if limits or not self.unit else f"in {self.unit}"
        words = ["a finite number", " and ".join(limits), unit]
        return " ".join(filter(None, words))

    def integer_words(self) -> str:
        """What a whole number within these bounds is."""
        some = self.high < math.inf
        return f"a whole number from {self.low} to {self.high}" if some else "a whole number"


def _spelled(low: float | str) -> str:
    return low if isinstance(low, str) else f"{low:g}"


@contextlib.contextmanager
def needing(what: str, package: str, extra: str = "data") -> Iterator[None]:
    """Explains how to install a package if its import fails."""
    try:
        yield
    except ImportError:
        raise MissingPackage(what, package, extra) from None
