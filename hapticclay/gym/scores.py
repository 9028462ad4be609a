"""Scores of AdaptiveGain: the returns that score 0 and 1, and the search that found them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..errors import ParameterError, choice
from .baselines import Fixed, Maker, Oracle, Scores, returns

ID = "AdaptiveGain-v0"
SEEDS = range(100)  # of the reference episodes
SHARES = tuple(round(0.05 * n, 2) for n in range(14, 25))  # of the gain limit, to begin with
FINE, AROUND = 0.01, 4  # step, and number of steps to either side of the best of these
FAMILIES: dict[str, Callable[[float], Maker]] = {"best fixed gain": Fixed, "best oracle": Oracle}


class Anchors(NamedTuple):
    """Policies whose mean returns score 0 and 1.

    Attributes:
        zero: name of the policy that scores 0.
        one: name of the policy that scores 1.
    """

    zero: str
    one: str


ANCHORS = {ID: Anchors("best fixed gain", "best oracle")}


def scores_of(id: str, means: Mapping[str, float]) -> dict[str, float]:
    """Scores of policies, from their mean returns over the same episodes."""
    if id not in ANCHORS:
        return {}
    for name in ANCHORS[id]:
        if name not in means:
            raise ParameterError("means", list(means), f"must have the return of {name!r}")
    low, high = (means[name] for name in ANCHORS[id])
    return {name: (x - low) / (high - low) for name, x in means.items()}


class Searched(NamedTuple):
    """Returns of the policies of a family.

    Attributes:
        shares: of the gain limit, shape (m,).
        totals: sum of rewards of each episode, shape (m, n).
        lost: whether the run diverged, shape (m, n).
    """

    shares: np.ndarray
    totals: np.ndarray
    lost: np.ndarray

    @property
    def best(self) -> float:
        """The share with the largest mean return; of several, the least."""
        return float(self.shares[np.argmax(self.totals.mean(axis=1))])


def search(
    family: str,
    shares: Sequence[float] = SHARES,
    seeds: Sequence[int] = SEEDS,
    *,
    around: int = AROUND,
    **options: Any,
) -> Searched:
    """Runs AdaptiveGain with shares of the gain limit, over the same episodes.

    The shares given come first, then those in steps of 0.01 around the best of them.
    """
    make = FAMILIES[choice("family", family, tuple(FAMILIES))]
    found: dict[float, Scores] = {}

    def run(wanted: Iterable[float]) -> Searched:
        for share in wanted:
            if share not in found:
                found[share] = returns(ID, make(share), seeds, **options)
        tried = sorted(found)
        totals = np.stack([found[x].total for x in tried])
        lost = np.stack([found[x].info["lost"] for x in tried]).astype(bool)
        return Searched(np.array(tried), totals, lost)

    best = run(shares).best
    return run(round(best + FINE * k, 2) for k in range(-around, around + 1))
