"""What holds a handle and what it touches, as verdicts say it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..model.clay import Clay
from ..model.operator import Operator
from ..scene.link import ENDS
from ..scene.pair_hardware import FELT

if TYPE_CHECKING:
    from ..scene.contact import Contact
    from ..scene.pair import Pair

FREE = "free motion"


def hand_words(operator: Operator | None) -> str:
    """A hand in words."""
    if operator is None:
        return "no hand"
    return f"a hand of {operator.mass:g} kg, {operator.damper:g} N.s/m, {operator.spring:g} N/m"


def pair_words(pair: Pair) -> str:
    """What holds both arms of a pair, and what they touch."""
    if all(x is None for x in (*pair.operators, *pair.touched)):
        felt = pair.link.kind in FELT
        more = ", so forces that are sent close no loop" if felt else ""
        return f"{FREE}: no hand, and nothing is touched{more}"
    return "; ".join(
        f"{name}: {hand_words(hand)}, {_touched_words(touched)}"
        for name, hand, touched in zip(ENDS, pair.operators, pair.touched, strict=True)
    )


def _touched_words(touched: Contact | Clay | None) -> str:
    if touched is None:
        return "nothing is touched"
    if isinstance(touched, Clay):
        return "in clay"
    what = "at a wall" if touched.unilateral else "at an object"
    mass = f"{touched.mass:g} kg, " if touched.mass else ""
    return f"{what} of {mass}{touched.B:g} N.s/m, {touched.K:g} N/m"
