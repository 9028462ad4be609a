"""A hit that drives motors into their limits, in the fast method."""

from __future__ import annotations

from ..model import arm
from . import kick as kicks
from . import rows, viscous
from .parts import INF
from .state import Body, Clay, Clock, Hit, Loop, State, with_clay

HIT_GROWTH = 1.01  # of each step of a hit over the one before


def struck(stiff, parts, s, e, after):
    """State and length of the first step in clay that the handle has come into.

    A hit that saturates the motors is no mean over a long step: its first step is short, and the
    step that led here ends with its half of the kick.
    """
    if stiff is None:
        return s, after
    if s.clay.hit.struck == 0.0 or after <= 0.0:
        return s, after
    c, r, t, before = s.clay, s.clay.region, s.clock.t, s.clock.before
    x, y = viscous.damping(parts.growth, r.base, r.rate, t)
    s = with_clay(s, Clay(r, c.old, c.owed, c.felt, c.elastic, c.cut, Hit(INF, 0.0)))
    b = max(x, y)
    first = stiff.first / b if b > 0.0 else INF
    if first >= after:
        return s, after
    half, k0 = s, kicks.kick(parts, s, first)
    if before > 0.0:
        k0 = kicks.kick(parts, s, 0.0)
        half = halted(parts, s, k0)
    k = kicks.kick(parts, half, first)
    if not kicks.limited(parts, k):
        return s, after
    if before > 0.0:
        half = rows.worked(parts, half, k0)
    c = half.clay
    hit = Hit(first, 0.0)
    half = with_clay(half, Clay(c.region, c.old, c.owed, c.felt, c.elastic, c.cut, hit))
    e.w[0], e.w[1] = half.body.w
    return half, first


def halted(parts, s, k):
    """The state behind half a kick that leads to the sample: the next kick starts from rest there."""
    b, c = s.body, s.clay
    body = Body(b.q, k.w, k.g, b.pose)
    clay = Clay(c.region, c.old, k.motion.owed, c.felt, c.elastic, c.cut, c.hit)
    clock = Clock(s.clock.t, s.clock.i, 0.0)
    return State(clock, body, Loop(k.x, k.y, k.form), clay, s.ledger, s.status, s.filled, s.machine)


def hit_after(stiff, parts, hit, k):
    """The longest next step on the way from a hit."""
    if stiff is None:
        return hit
    if hit.fine < INF:
        return Hit(hit.fine * HIT_GROWTH if kicks.limited(parts, k) else INF, hit.struck)
    return hit
