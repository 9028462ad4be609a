"""A hit that drives motors into their limits: short steps after it, which grow."""

import math

from . import kick, ledger, memory, viscous

GROWTH = 1.01  # growth of each step of a hit over the one before


def first_step(m, s, after):
    """Length of the first step in clay that the handle has entered; short where it hits [s].

    The step that led here then ends with its half of the kick, and the next begins at rest.
    """
    if s.entered == 0.0 or after <= 0.0:
        return after
    s.max_step, s.entered = math.inf, 0.0
    b = max(viscous.damping(m, s, 0, 0), viscous.damping(m, s, 1, 0))
    first = m.first_hit / b if b > 0.0 else math.inf
    if first >= after:
        return after
    e, halved = s.e, s.before > 0.0
    if halved:
        kick.by_servo(m, s, e, 0.0)
        ledger.add_work(m, s.work, s.work_at_event, e, e.o, s.now, s.q)
        swap(m, s, e)
    kick.by_servo(m, s, s.k, first)
    if kick.is_limited(m, s.k):
        if halved:
            memory.copied(s.work, s.work_at_event)
        s.max_step = first
        return first
    if halved:
        swap(m, s, e)
    return after


def swap(m, s, e):
    """Swaps a state with that after the half kick that ends at its sample."""
    s.w[0], e.w[0], s.w[1], e.w[1] = e.w[0], s.w[0], e.w[1], s.w[1]
    s.g[0], e.g[0], s.g[1], e.g[1] = e.g[0], s.g[0], e.g[1], s.g[1]
    s.before, e.after = e.after, s.before  # which is 0
    for i in range(2):
        z, o = s.axis[i], e.axis[i]
        z.delta, o.next_delta, z.rate, o.next_rate = o.next_delta, z.delta, o.next_rate, z.rate
        z.y, o.next_y, z.yrate, o.next_yrate = o.next_y, z.y, o.next_yrate, z.yrate
        z.owed, o.owed, z.stuck, o.stuck = o.owed, z.owed, o.stuck, z.stuck
        z.anchor, o.anchor = o.anchor, z.anchor
        if m.formed:
            for r in range(4):
                z.z[r], o.z[r] = o.z[r], z.z[r]


def grow(m, s):
    """The longest next step after a hit."""
    if s.max_step < math.inf:
        s.max_step = s.max_step * GROWTH if kick.is_limited(m, s.k) else math.inf
