"""Units in words: "5 cm" for a length in metres, "90 N.s/m" for a damping."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from functools import cache

QUANTITY = re.compile(
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![eE][-+]?\d)(\s*(?:[^\W\d]|°).*|\s+\S.*)"
)
RECIPROCAL = re.compile(  # "2/kg" for a field in 1/kg
    r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(/\s*[^\W\d].*)"
)
FACTOR = re.compile(r"1|([^\W\d]+)(?:\^?(-?\d))?")
SIGNS = str.maketrans({"µ": "u", "μ": "u", "·": ".", "*": ".", "°": "deg", "º": "deg", "−": "-"})
RAISED = str.maketrans("⁻⁰¹²³⁴", "-01234")
PREFIXES = {"n": "1e-9", "u": "1e-6", "m": "1e-3", "c": "1e-2", "k": "1e3", "M": "1e6", "G": "1e9"}
Powers = tuple[int, ...]  # of m, kg, s, rad and A
SIZES: dict[str, tuple[Decimal, Powers]] = {  # in SI; with prefixes
    "m": (Decimal(1), (1, 0, 0, 0, 0)),
    "g": (Decimal("1e-3"), (0, 1, 0, 0, 0)),
    "s": (Decimal(1), (0, 0, 1, 0, 0)),
    "rad": (Decimal(1), (0, 0, 0, 1, 0)),
    "A": (Decimal(1), (0, 0, 0, 0, 1)),
    "Hz": (Decimal(math.tau), (0, 0, -1, 1, 0)),
    "N": (Decimal(1), (1, 1, -2, 0, 0)),
    "J": (Decimal(1), (2, 1, -2, 0, 0)),
    "W": (Decimal(1), (2, 1, -3, 0, 0)),
    "V": (Decimal(1), (2, 1, -3, 0, -1)),
    "Pa": (Decimal(1), (-1, 1, -2, 0, 0)),
}
OTHERS = {  # without prefixes, by units of the table above
    "min": ("60", "s"),
    "h": ("3600", "s"),
    "in": ("0.0254", "m"),
    "ft": ("0.3048", "m"),
    "lb": ("453.59237", "g"),
    "oz": ("28.349523125", "g"),
    "gf": ("9.80665e-3", "N"),
    "kgf": ("9.80665", "N"),
    "lbf": ("4.4482216152605", "N"),
    "ozf": ("0.27801385095378125", "N"),
    "deg": (Decimal(math.pi) / 180, "rad"),
    "rev": (Decimal(math.tau), "rad"),
    "rpm": (Decimal(1) / 60, "Hz"),
}
SIZES |= {name: (Decimal(x) * SIZES[of][0], SIZES[of][1]) for name, (x, of) in OTHERS.items()}
WORDS = {
    **dict.fromkeys(("sec", "second"), "s"),
    **dict.fromkeys(("meter", "metre"), "m"),
    **dict.fromkeys(("inch", "inche"), "in"),
    **dict.fromkeys(("foot", "feet"), "ft"),
    **dict.fromkeys(("turn", "revolution"), "rev"),
    **dict.fromkeys(("amp", "ampere"), "A"),
    **{"newton": "N", "gram": "g", "radian": "rad", "degree": "deg", "hertz": "Hz", "volt": "V"},
    **{
        "minute": "min",
        "hour": "h",
        "min": "min",
        "hr": "h",
        "rad": "rad",
        "deg": "deg",
        "rpm": "rpm",
        "lbf": "lbf",
    },
    **{"kgf": "kgf", "joule": "J", "watt": "W", "pascal": "Pa"},
}
WORD = re.compile(
    rf"(m|u|n|k|c|milli|micro|nano|kilo|centi)?({'|'.join(sorted(WORDS, reverse=True))})s?"
)


@cache
def parse_unit(text: str) -> tuple[Decimal, Powers] | None:
    """Size of a unit in SI units and its powers of m, kg, s, rad and A; None if it is unknown."""
    text = text.replace("**", "^").translate(SIGNS)
    text = re.sub(r"[⁻⁰¹²³⁴]+", lambda x: f"^{x[0].translate(RAISED)}", text)
    text = re.sub(r"\s*([./])\s*", r"\1", text.replace(" per ", "/").strip())
    text = re.sub(r"(?<=[^\W\d_])-(?=[^\W\d_])", ".", re.sub(r"\s+", ".", text))
    text = re.sub(r"(?<![^\W\d_])([numk]?N)(?=(?:[cm]?m|s)\b)", r"\1.", text)
    size, powers = Decimal(1), (0, 0, 0, 0, 0)
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


def _known_unit(name: str) -> tuple[Decimal, Powers] | None:
    if name in SIZES:
        return SIZES[name]
    prefix, stem = PREFIXES.get(name[:1]), name[1:]
    if prefix and stem in SIZES and stem not in OTHERS:
        return Decimal(prefix) * SIZES[stem][0], SIZES[stem][1]
    word = WORD.fullmatch(name.lower())
    if word is None:
        return None
    start = {"milli": "m", "micro": "u", "nano": "n", "kilo": "k", "centi": "c"}
    size, powers = SIZES[WORDS[word[2]]]
    return Decimal(PREFIXES.get(start.get(word[1], word[1]), 1)) * size, powers


@cache
def si_unit(powers: Powers) -> str:
    """Name of the SI unit with these powers of m, kg, s, rad and A."""
    for name in ("m", "kg", "s", "rad", "A", "N", "N.m", "V", "W", "Pa", "N/m", "N.s/m"):
        known = parse_unit(name)
        if known is not None and known[1] == powers:
            return name
    both = zip(("m", "kg", "s", "rad", "A"), powers, strict=True)
    parts = [(x, n) for x, n in both if n]
    over = [x if n == 1 else f"{x}^{n}" for x, n in parts if n > 0]
    under = [x if n == -1 else f"{x}^{-n}" for x, n in parts if n < 0]
    return "/".join([".".join(over) or "1", *under])


def is_quantity(value: object) -> bool:
    """Whether a value is a text with a number and a unit."""
    return isinstance(value, str) and QUANTITY.fullmatch(value) is not None


def parts_of(text: str) -> tuple[Decimal, str] | None:
    """The number and the unit of a text like "5 cm"; None for other texts."""
    match = QUANTITY.fullmatch(text)
    return match and (Decimal(match[1]), match[2].strip())


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
