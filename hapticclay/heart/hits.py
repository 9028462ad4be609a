"""A hit that drives motors into their limits: no mean over a long step."""

from __future__ import annotations

from . import rows, viscous
from .kick import is_limited, kick
from .parts import INF
from .state import Body, Clay, Clock, Hit, Special, State

HIT_GROWTH = 1.01  # of each step of a hit over the one before


def longest(special, state, after):
    """The longest step on the way from a hit [s]."""
    if special is None:
        return after
    return longest_of(special.stiff, state.hit, after)


def longest_of(stiff, hit, after):
    if stiff is None:
        return after
    return min(after, hit.fine)


def struck(special, parts, s, after):
    """State and length of the first step in clay that the handle has come into.

    Its first step is short, and the step that led here ends with its half of the kick.
    """
    if special is None:
        return s, after
    return struck_stiff(special.stiff, parts, s, after)


def struck_stiff(stiff, parts, s, after):
    if stiff is None:
        return s, after
    if s.clay.special.hit.struck == 0.0 or after <= 0.0:
        return s, after
    s = with_hit(s, Hit(INF, 0.0))
    c = s.clay
    x, y = viscous.grown(parts.clay.growth, c.b, c.growth, 0, s.clock.t)
    b = max(x, y)
    first = stiff.first / b if b > 0.0 else INF
    if first >= after:
        return s, after
    half = halted(parts, s) if s.clock.before > 0.0 else s
    k = kick(parts, half.clock, half.body, half.loop, half.clay, first)
    if not is_limited(parts, k):
        return s, after
    return with_hit(half, Hit(first, 0.0)), first


def with_hit(s, hit):
    c = s.clay
    x = c.special
    x = Special(x.owed, x.split, hit, x.felt, x.elastic, x.cut)
    clay = Clay(c.region, c.b, c.old, c.growth, x)
    return State(s.clock, s.body, s.loop, clay, s.work, s.status)


def halted(parts, s):
    """The state behind half a kick that leads to the sample: the next kick starts from rest there."""
    k, c = kick(parts, s.clock, s.body, s.loop, s.clay, 0.0), s.clay
    body, clock = Body(s.body.q, k.w, k.g), Clock(s.clock.t, s.clock.i, 0.0)
    clay = Clay(c.region, c.b, c.old, c.growth, k.motion.special)
    work = rows.with_work(parts, s.work, k, s.body.w)
    return State(clock, body, k.loop, clay, work, s.status)


def hit_after(stiff, parts, hit, k):
    """The longest next step on the way from a hit."""
    if stiff is None:
        return hit
    if hit.fine < INF:
        return Hit(hit.fine * HIT_GROWTH if is_limited(parts, k) else INF, hit.struck)
    return hit
