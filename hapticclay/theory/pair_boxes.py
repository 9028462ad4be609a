"""A pair in many hands, against many things: the corners of a box, and random members of it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named
from ..errors import Bound, ParameterError
from ..model.clay import Clay
from ..model.operator import Operator
from ..results import Result, Tables
from ..scene.pair import Contact, Pair, touched_load
from .hand_boxes import Box
from .pair_onset import LATEST
from .pair_verdict import Study

CORNERS = "the corners and random members: no proof for those between"


@named
@dataclass(frozen=True, repr=False, eq=False)
class PairHands(Result):
    """A pair in m hands with m contacts.

    Attributes:
        kind: kind of the link.
        hands: mass, damper and spring of the leader's hand [kg, N.s/m, N/m], shape (m, 3).
        contacts: mass, damping and stiffness at the follower [kg, N.s/m, N/m], shape (m, 3).
        stable: whether the pair is stable with its link, shape (m,).
        delay: largest one-way delay [s], shape (m,); 0 if unstable without, inf for more than 2 s.
        present: one-way delay of the link, the mean of both ways [s].
        assumed: what the numbers rest on, a sentence each.
    """

    drawn_by = "hapticclay.views.pair_plots:hands_plot"
    written_as = "hands"
    printed = {"worst": ()}

    kind: str
    hands: np.ndarray
    contacts: np.ndarray
    stable: np.ndarray
    delay: np.ndarray
    present: float
    assumed: tuple[str, ...] = ()

    @property
    def worst(self) -> int:
        """Number of the member with the least delay."""
        return int(self.delay.argmin())

    def headline(self) -> str:
        """The result in one line."""
        share = float(np.mean(self.stable))
        least = 1e3 * float(self.delay.min())
        late = f"any delay up to {LATEST:g} s" if math.isinf(least) else f"{least:.3g} ms"
        return (
            f"{self.kind}: stable in {share:.0%} of {len(self.stable)} hands; the worst has {late}"
        )

    def remarks(self) -> Sequence[str]:
        """What the numbers rest on."""
        return [self.headline(), CORNERS, *self.assumed]

    def tables(self) -> Tables:
        """The worst member, and all."""
        every = self._rows(slice(None))
        return {"worst": self._rows(slice(self.worst, self.worst + 1)), "members": every}

    def _rows(self, which: slice) -> dict[str, Any]:
        names = ("mass [kg]", "damper [N.s/m]", "spring [N/m]")
        return {
            **{f"hand {x}": self.hands[which, i] for i, x in enumerate(names)},
            **{f"contact {x}": self.contacts[which, i] for i, x in enumerate(names)},
            "stable": self.stable[which],
            "largest delay [s]": self.delay[which],
        }


@checked
def pair_hands(
    pair: Pair,
    hands: Box,
    contacts: Box | None = None,
    samples: Annotated[int, Bound(0, 100_000)] = 40,
    seed: Annotated[int, Bound(0, 2**63 - 1)] = 0,
) -> PairHands:
    """The largest delay of a pair over hands at the leader and contacts at the follower.

    All corners of the boxes together, then random members, drawn evenly.

    Args:
        pair: two arms, their laws and the link between them; its own hand takes no part.
        hands: the hands; a rigid one is refused.
        contacts: mass, damper and spring of what the follower touches; None for the pair's own
            contact. They act as that does, along all axes or one.
        samples: number of random members.
        seed: seed of their draw.

    Raises:
        ParameterError: as `pair_limits`, or a box has a rigid arm.
    """
    for name, box in (("hands", hands), ("contacts", contacts)):
        if box is not None and box.rigid:
            raise ParameterError(f"{name}.rigid", True, "must be False for a pair")
    own = pair.follower_clay
    touched = [None] if contacts is None else contacts.corners()
    members = list(itertools.product(hands.corners(), touched))
    drawn = touched * samples if contacts is None else contacts.sample(samples, seed + 1)
    members += zip(hands.sample(samples, seed), drawn, strict=True)
    axis = own.axis if isinstance(own, Contact) else None
    found = [_member(pair, hand, _contact(each, own, axis)) for hand, each in members]
    hand, clay, stable, delay = zip(*found, strict=True)
    study = Study(pair)
    return PairHands(
        pair.link.kind,
        np.array(hand),
        np.array(clay),
        np.array(stable),
        np.array(delay),
        study.present,
        study.build.assumed(),
    )


def _contact(drawn: Operator | None, own: Any, axis: Any) -> Contact | Clay | None:
    return own if drawn is None else Contact(drawn.spring, drawn.damper, drawn.mass, axis)


def _member(pair: Pair, hand: Operator, clay: Any) -> tuple[Any, Any, bool, float]:
    study = Study(replace(pair, leader_operator=hand, follower_clay=clay))
    touched = tuple(float(x.max()) for x in touched_load(study.pair, 1))
    return (hand.mass, hand.damper, hand.spring), touched, study.stable, study.delay()
