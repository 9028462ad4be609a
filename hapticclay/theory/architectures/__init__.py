"""What the ends of a pair compute from their own motion and from what they receive."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ...scene.pair import Pair
from . import four_channel, position_force, position_position, waves
from .control import Control


class Architecture(NamedTuple):
    """What a kind of link makes of a pair.

    Attributes:
        controls: controls of leader and follower.
        leader_law: whether the leader's own gains act.
        whole: whether what arrives is read at a control sample, one after it was sent at least.
    """

    controls: Callable[[Pair], tuple[Control, Control]]
    leader_law: bool = True
    whole: bool = False


ARCHITECTURES = {
    "position-position": Architecture(position_position.controls),
    "position-force": Architecture(position_force.controls, leader_law=False),
    "four-channel": Architecture(four_channel.controls),
    "waves": Architecture(waves.controls, leader_law=False, whole=True),
}
"""Architectures by the kind of the link."""
