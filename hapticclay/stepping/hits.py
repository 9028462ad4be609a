"""Hits that drive motors into their limits, where a mean over a long step fails."""

from __future__ import annotations

from . import rows, viscous
from .driver import kick
from .kick import is_limited
from .parts import INF
from .state import Body, Clay, Clock, Hit, State

HIT_GROWTH = 1.01  # growth of each step of a hit over the one before


def longest(part, hit, after):
    """The longest step after a hit [s]."""
    if part is None:
        return after
    return min(after, hit.fine)


def is_over(part, hit):
    """Whether no hit requires short steps."""
    if part is None:
        return True
    return hit.fine == INF and hit.struck == 0.0


def struck(part, parts, s, after):
    """State and length of the first step in clay that the handle has entered.

    Its first step is short, and the step that led here ends with its half of the kick.
    """
    if part is None:
        return s, after
    if s.clay.hit.struck == 0.0 or after <= 0.0:
        return s, after
    s = with_hit(s, Hit(INF, 0.0))
    c = s.clay
    x, y = viscous.grown(parts.clay.growth, c.b, c.growth, 0, s.clock.t)
    b = max(x, y)
    first = part.first / b if b > 0.0 else INF
    if first >= after:
        return s, after
    half = halted(parts, s) if s.clock.before > 0.0 else s
    k = kick(parts, half.clock, half.body, half.loop, half.clay, first)
    if not is_limited(parts, k):
        return s, after
    return with_hit(half, Hit(first, 0.0)), first


def with_hit(s, hit):
    c = s.clay
    clay = Clay(c.region, c.b, c.old, c.growth, hit, c.reaction, c.laws)
    return State(s.clock, s.body, s.loop, clay, s.work, s.status, s.filled)


def halted(parts, s):
    """The state after half a kick that leads to the sample; the next kick starts at rest there."""
    k, c = kick(parts, s.clock, s.body, s.loop, s.clay, 0.0), s.clay
    body, clock = Body(s.body.q, k.w, k.g), Clock(s.clock.t, s.clock.i, 0.0)
    clay = Clay(c.region, c.b, c.old, c.growth, c.hit, k.motion.reaction, c.laws)
    work = rows.with_work(parts, s.work, k, s.body.w)
    return State(clock, body, k.loop, clay, work, s.status, s.filled)


def after_kick(part, parts, hit, k):
    """The longest next step after a hit."""
    if part is None:
        return hit
    if hit.fine < INF:
        return Hit(hit.fine * HIT_GROWTH if is_limited(parts, k) else INF, hit.struck)
    return hit
