"""Units in words: "5 cm" for a length in metres, "90 N.s/m" for a damping."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from functools import cache

QUANTITY = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![eE][-+]?\d)(\s*[^\W\d].*|\s+\S.*)"
)
RECIPROCAL = re.compile(  # "2/kg" for a field in 1/kg
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(/\s*[^\W\d].*)"
)
FACTOR = re.compile(r"1|([^\W\d]+)(?:\^(-?\d))?")
PREFIXES = {"n": "1e-9", "u": "1e-6", "m": "1e-3", "c": "1e-2", "k": "1e3", "M": "1e6", "G": "1e9"}
SIZES: dict[str, tuple[Decimal, tuple[int, ...]]] = {  # in SI; powers of m, kg, s and rad
    "m": (Decimal(1), (1, 0, 0, 0)),
    "g": (Decimal("1e-3"), (0, 1, 0, 0)),
    "s": (Decimal(1), (0, 0, 1, 0)),
    "rad": (Decimal(1), (0, 0, 0, 1)),
    "deg": (Decimal(math.pi) / 180, (0, 0, 0, 1)),
    "Hz": (Decimal(math.tau), (0, 0, -1, 1)),
    "N": (Decimal(1), (1, 1, -2, 0)),
    "J": (Decimal(1), (2, 1, -2, 0)),
    "Pa": (Decimal(1), (-1, 1, -2, 0)),
}


@cache
def parse_unit(text: str) -> tuple[Decimal, tuple[int, ...]] | None:
    """Size of a unit in SI units and its powers of m, kg, s and rad; None if it is unknown."""
    for sign, plain in (("µ", "u"), ("μ", "u"), ("²", "^2"), ("³", "^3"), ("·", "."), ("*", ".")):
        text = text.replace(sign, plain)
    text = re.sub(r"\s*([./])\s*", r"\1", text.replace(" per ", "/").strip())
    text = re.sub(r"\bN(?=[sm]\b)", "N.", re.sub(r"\s+", ".", text))
    size, powers = Decimal(1), (0, 0, 0, 0)
    for stroke, factor in re.findall(r"(^|[./])([^./]*)", text):
        found = FACTOR.fullmatch(factor.strip())
        if not found:
            return None
        if found[1] is None:  # the digit 1, as in 1/s
            continue
        unit = _known_unit(found[1])
        if unit is None:
            return None
        n = int(found[2] or 1) * (-1 if stroke == "/" else 1)
        size *= unit[0] ** n
        powers = tuple(p + n * q for p, q in zip(powers, unit[1], strict=True))
    return size, powers


def _known_unit(name: str) -> tuple[Decimal, tuple[int, ...]] | None:
    if name in SIZES:
        return SIZES[name]
    prefix, stem = PREFIXES.get(name[:1]), SIZES.get(name[1:])
    return (Decimal(prefix) * stem[0], stem[1]) if prefix and stem else None


def is_quantity(value: object) -> bool:
    """Whether a value is a text with a number and a unit."""
    return isinstance(value, str) and QUANTITY.fullmatch(value) is not None


def from_unit(text: str, unit: str) -> float | None:
    """The number of a text like "5 cm", in the unit of a field; None for other texts."""
    found = QUANTITY.fullmatch(text)
    if not found and unit.startswith("1/"):
        found = RECIPROCAL.fullmatch(text)
    if not found:
        return None
    given = found[2].strip()
    given = f"1{given}" if given.startswith("/") else given
    bound = f"must be a number{f' in {unit}' if unit else ' without a unit'}"
    own, other = parse_unit(unit), parse_unit(given)
    if other is None:
        raise ValueError(f"{bound}; unknown unit {given!r}")
    if own is None or not unit or own[1] != other[1]:
        raise ValueError(f"{bound}, not in {given}")
    try:
        return float(Decimal(found[1]) * (other[0] / own[0]))  # rounded once
    except ArithmeticError:
        return math.inf
