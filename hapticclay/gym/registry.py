"""The ids of the environments, and where their classes are."""

from __future__ import annotations

from typing import NamedTuple

import gymnasium

NAMESPACE = "hapticclay"


class Entry(NamedTuple):
    """An environment: its module in this package, and its class."""

    module: str
    name: str  # that of the vector environment adds Vector
    # control periods after which an episode is truncated; None if it ends by itself
    limit: int | None


ENTRIES = {
    "CutLine-v0": Entry("cut_line", "CutLine", 500),
    "PareEdge-v0": Entry("pare_edge", "PareEdge", 500),
    "AdaptiveGain-v0": Entry("adaptive_gain", "AdaptiveGain", 500),
    "ProbeClay-v0": Entry("probe_clay", "ProbeClay", None),
}
IDS = tuple(f"{NAMESPACE}/{name}" for name in ENTRIES)


def register_all() -> None:
    """Registers all environments that are not registered yet."""
    for id, entry in zip(IDS, ENTRIES.values(), strict=True):
        if id not in gymnasium.registry:
            place = f"{__package__}.{entry.module}:{entry.name}"
            gymnasium.register(
                id,
                entry_point=place,
                vector_entry_point=f"{place}Vector",
                max_episode_steps=entry.limit,
            )
