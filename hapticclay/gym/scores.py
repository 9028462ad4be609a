"""Scores of AdaptiveGain: the returns that score 0 and 1."""

from __future__ import annotations

from collections.abc import Mapping

from ..errors import ParameterError

ID = "AdaptiveGain-v0"
ANCHORS = {ID: ("best fixed gain", "best oracle")}  # policies whose mean returns score 0 and 1


def scores_of(id: str, means: Mapping[str, float]) -> dict[str, float]:
    """Scores of policies, from their mean returns over the same episodes."""
    if id not in ANCHORS:
        return {}
    for name in ANCHORS[id]:
        if name not in means:
            raise ParameterError("means", list(means), f"must have the return of {name!r}")
    low, high = (means[name] for name in ANCHORS[id])
    return {name: (x - low) / (high - low) for name, x in means.items()}
