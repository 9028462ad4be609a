"""Heads of columns: the name, and the unit in brackets, in a row below, or as the last word."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from ..units import Powers, parse_unit

BRACKETED = re.compile(r"([\[(])\s*([^\[\]()]*?)\s*[\])]")  # "time [ms]", "force (N)"
WORD = re.compile(r"[^\s_/,:.\-\[\]()]+")  # of "t_ms", "force / mN", "time, s"
COPY = re.compile(r"#\d+$")  # of "Force#2", the second column of that name
PLACE = re.compile(r"[^\W_]*\d")  # of "joint_1", "action[1]", "arm.m2": a place, not a unit
COUNTS = ("count", "counts", "cnt", "cnts", "tick", "ticks", "lsb", "adc", "pulses")
# last words that are no letters of a name, and no unit that can be converted
DOUBTFUL = frozenset((*COUNTS, "g", "V", "mV", "A", "mA", "in", "min"))
RATE, ARMS = re.compile(r"s\^?\d?|sec|min"), ("m", "mm", "cm", "s")


@dataclass(frozen=True)
class Head:
    """What stands above a column.

    Attributes:
        text: the name as it is in the file.
        given: the unit that a row below or the file states; "" for none.
    """

    text: str
    given: str = ""

    @property
    def name(self) -> str:
        """The name without its unit."""
        bare = BRACKETED.sub(lambda x: "" if _has_letters(x[2]) else x[0], self.text)
        return re.sub(r" (?=#\d+$)", "", " ".join(bare.split())) or self.text

    @property
    def bracketed(self) -> tuple[str, ...]:
        """Texts in brackets that can be units; a word in round ones beside a known unit cannot."""
        found = [(x[1], x[2]) for x in BRACKETED.finditer(self.text) if _has_letters(x[2])]
        if any(is_unit(text) for _, text in found):
            found = [(mark, text) for mark, text in found if mark == "[" or is_unit(text)]
        return tuple(text for _, text in found)

    @property
    def unit(self) -> str:
        """The unit that is stated, "" for none; the last word of a name states none."""
        return self.given or next(iter(self.bracketed), "")

    @property
    def own_units(self) -> list[str]:
        """Units that the column may be in by what it states, or else by its last words."""
        return [self.unit] if self.unit else [unit for _, unit in self.last_words()]

    @property
    def stems(self) -> set[str]:
        """Names without last words that are a unit."""
        return {stem for stem, unit in self.last_words() if is_unit(unit)}

    def last_words(self) -> Iterator[tuple[str, str]]:
        """Stems and units as which the last words of a name can be read, the longest first."""
        text = COPY.sub("", self.text)
        words, copy = list(WORD.finditer(text)), self.text[len(text) :]
        for n in (4, 3, 2, 1):
            if len(words) > n and (unit := _joined([x[0] for x in words[-n:]])):
                yield text[: words[-n].start()].rstrip(" _/,:.-") + copy, unit


def numbered(heads: Sequence[Head]) -> tuple[Head, ...]:
    """Heads of which those with a name that came before are numbered: "Force", "Force#2"."""
    counts: Counter[str] = Counter()
    out = []
    for head in heads:
        counts[head.text] += 1
        copy = f"#{counts[head.text]}"
        out.append(head if copy == "#1" else replace(head, text=head.text + copy))
    return tuple(out)


def _joined(words: list[str]) -> str:
    """Words as a unit: "m", "per", "s" or "rad", "s" as a quotient, "N", "m" as a product."""
    if len(words) == 1:
        return "" if PLACE.fullmatch(words[0]) else words[0]
    if "per" in words[1:-1]:
        i = words.index("per")
        first, last = _joined(words[:i]), _joined(words[i + 1 :])
        return f"{first}/{last}" if first and last and is_unit(first) else ""
    if len(words) == 2 and is_unit(words[0]):
        if words[0] in ("N", "mN") and words[1] in ARMS:
            return ".".join(words)
        if RATE.fullmatch(words[1]) and words[0] not in ("s", "ms"):
            return "/".join(words)
    return ""


def is_unit(text: str) -> bool:
    """Whether a text is a unit, or counts of a converter."""
    return parse_unit(text) is not None or text.lower() in COUNTS


def bracketed(text: str) -> bool:
    """Whether a text stands in brackets."""
    return BRACKETED.fullmatch(text.strip()) is not None


def powers_of(units: tuple[str, ...]) -> tuple[Powers, ...]:
    """Powers of the base units of some known units."""
    found = [parse_unit(x) for x in units]
    return tuple(x[1] for x in found if x is not None)


def _has_letters(text: str) -> bool:
    return any(x.isalpha() or x in "%°\"'" for x in text)
