"""The kick of a scene: of the continuous law, or of sampled control."""

from __future__ import annotations

from . import torque
from .kick import servo_kick


def kick(parts, clock, body, loop, clay, after):
    """The kick at a sample, before a step of length `after`."""
    return kick_by(parts.sampler, parts, clock, body, loop, clay, after)


def kick_by(sampler, parts, clock, body, loop, clay, after):
    if sampler is None:
        return servo_kick(parts, clock, body, loop, clay, after)
    return torque.sampled_kick(sampler, parts, clock, body, loop, clay, after)
