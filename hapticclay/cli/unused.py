"""Options that would do nothing, which a command refuses rather than ignores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..errors import ParameterError

Given = Mapping[str, Sequence[str]]  # values of the words that were given, by name


class Unused(NamedTuple):
    """Options that do nothing, in a command where a combination of others stands.

    A combination names words as "spec" (given), or "design=grid" (given with this value).
    """

    options: tuple[str, ...]  # names of the options, and of fields behind --set
    why: str  # what to do about them, for the error
    beside: tuple[str, ...] = ()  # words that are all given
    without: tuple[str, ...] = ()  # words none of which is given

    def refuse(self, given: Given) -> None:
        beside = all(_is_given(word, given) for word in self.beside)
        if not beside or any(_is_given(word, given) for word in self.without):
            return
        for name in self.options:
            if name in given:
                raise ParameterError(name, " ".join(given[name]) or True, self.why)


FIGURE_WORDS = "format", "dpi", "style", "data"


def undrawn(switch: str) -> Unused:
    """Options of figures beside an option that leaves the figures out."""
    return Unused(
        FIGURE_WORDS, f"is for figures, which --{switch} leaves out: give one of the two", (switch,)
    )


def _is_given(word: str, given: Given) -> bool:
    name, equals, value = word.partition("=")
    return name in given and (not equals or value in given[name])
