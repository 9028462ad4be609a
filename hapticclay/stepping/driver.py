"""The kick of a scene: by the continuous law, or by the torques that sampled control holds."""

from __future__ import annotations

from . import friction, servo
from .kick import acting, driven, handle_at, kicked, rates_after, servo_kick, step_around
from .state import Clay, Held

NONE = (0.0, 0.0)


def pushed(sampler, parts, clock, step, at, w, clay, hold):
    """The kick under the actuator output, with joint rates w before it."""
    special = sampler.special
    a = acting(parts, sampler.clay, special, clock, step, at, w, clay)
    slip = friction.torques(sampler.friction, special, parts, clay, a, w, hold.tau)
    law = servo.torque_law(parts.arm.links, step, a.at, friction.on_joints(slip, hold.tau))
    m, g = driven(special, parts, clay, a, law)
    w = rates_after(special, m, step.H, w, g)
    return kicked(a, m, w, g, hold.tau, NONE, Held(hold, slip))


def sampled_kick(sampler, parts, clock, body, loop, clay, after):
    """The next kick: from an event if there is one, else across the sample."""
    e = loop.event
    if e.on > 0.0 and after > 0.0:
        step, hold = step_around(0.0, after), e.machine.hold
        clay = behind(sampler.special, clay, e.reaction)
        return pushed(sampler, parts, clock, step, e.at, e.w, clay, hold)
    at = handle_at(parts.arm, body, 0.0)
    step, hold = step_around(clock.before, after), loop.machine.hold
    return pushed(sampler, parts, clock, step, at, body.w, clay, hold)


def behind(special, clay, reaction):
    """The clay after a kick that led to an event."""
    if special is None:
        return clay
    c = clay
    return Clay(c.region, c.b, c.old, c.growth, c.hit, reaction, c.laws)


def kick(parts, clock, body, loop, clay, after):
    """The kick at a sample, before a step of length `after`."""
    return kick_by(parts.sampler, parts, clock, body, loop, clay, after)


def kick_by(sampler, parts, clock, body, loop, clay, after):
    if sampler is None:
        return servo_kick(parts, clock, body, loop, clay, after)
    return sampled_kick(sampler, parts, clock, body, loop, clay, after)
