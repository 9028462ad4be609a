"""The path of a run: samples, borders of the clay and the end, for every method.

A step ends on the next sample, or on the first border before it. A kick is a value, so that the
search for a border works out as many as it likes; the run takes the last.
"""

from __future__ import annotations

from ..model import regions
from . import borders, grooves, hits, rows, sampled, springs, viscous, yielding
from .drive import kick
from .engine_step import put
from .kick import command_change, handle_at, is_calm_end, is_finite, place, place_after, velocity
from .parts import INF
from .state import (
    FINISHED,
    NOT_FINITE,
    OPEN,
    TIME_LIMIT,
    UNRESOLVED,
    Axis,
    Body,
    Clay,
    Clock,
    Filled,
    Growth,
    Loop,
    Special,
    State,
    Status,
)

# times that the handle comes back to a region within one sample; a handle that slides along a
# border then completes the step
LANDINGS = 4
MOST_STEPS = 20_000  # from one sample to the next; a run that needs more ends as unresolved


# ---- time ----------------------------------------------------------------------------------------


def grid_after(time, i):
    """Time of the sample behind sample i [s]."""
    return (i + 1) * time.dt if i < time.last else time.t_max


def next_sample(time, t, i):
    """The next sample of a run: its time, the length of the step to it (0 at the end) [s]; whether
    now is a sample.
    """
    dt = time.dt
    on_grid = t == i * dt
    if i > time.last:
        return t, 0.0, on_grid
    target = grid_after(time, i)
    after = dt if on_grid and i < time.last else target - t
    return target, after if after > 1e-9 * dt else 0.0, on_grid


def next_stop(parts, s):
    """As `next_sample`, with events of sampled control between the samples."""
    target, after, on_grid = next_sample(parts.time, s.clock.t, s.clock.i)
    target, after = sampled.before_event(parts.sampler, parts.time.dt, s, target, after)
    return target, after, on_grid


# ---- status --------------------------------------------------------------------------------------


def begun(x, region, after, on_grid):
    """Status where a step begins that is looked at."""
    closing = TIME_LIMIT if x.closing == OPEN and after == 0.0 else x.closing
    if on_grid:
        ix, iy = region.index
        return Status(x.code, closing, 1, 0, (ix, ix, iy, iy))
    code = UNRESOLVED if x.careful >= MOST_STEPS else x.code
    return Status(code, closing, x.careful + 1, x.landings, x.seen)


def with_status(s, x):
    return State(s.clock, s.body, s.loop, s.clay, s.work, x, s.filled)


def with_filled(s, x):
    return State(s.clock, s.body, s.loop, s.clay, s.work, s.status, x)


def ended(s, code):
    """The state of a run that is over."""
    x = s.status
    return with_status(s, Status(code, x.closing, x.careful, x.landings, x.seen))


# ---- a step --------------------------------------------------------------------------------------


def same_growth(part, growth):
    if part is None:
        return growth
    return Growth(growth.rate, growth.rate)


def special_behind(special, parts, c, q, w, h):
    if special is None:
        return c
    x, table, at = c.special, parts.table, handle_at(parts.arm, Body(q, w, (0.0, 0.0)), 0.0)
    elastic = springs.moved(special.springs, x.elastic, c.region, table, at.p, h)
    b, old, cut = grooves.moved(special.groove, x.cut, c, at.p, at.v)
    felt = yielding.behind(special.flow, x.felt)
    c = Clay(c.region, b, old, c.growth, c.hit, Special(x.owed, x.split, felt, elastic, cut))
    return viscous.at_place(special.smooth, table, c, at.p)


def commanded(table, loop, t0, t1, h):
    """The loop with the change of the command in its output."""
    if table is None:
        return loop
    dx, dy = command_change(table, t0, t1, h)
    x, y = loop.x, loop.y
    x, y = Axis(x.delta + dx, x.rate, x.y, x.yrate), Axis(y.delta + dy, y.rate, y.y, y.yrate)
    return Loop(x, y, loop.form)


def noted(special, e, before, k, t, n):
    """Notes stops of the handle in a kick; how many are then noted."""
    if special is None:
        return n
    return yielding.noted(special.flow, e, k.motion.special.felt, before.felt, t, n)


def held_arm(special, e, state, w):
    """Joint rates; none of an arm that clay holds, which the engine's rounding would let creep."""
    if special is None:
        return w
    if yielding.is_still(special.flow, state.felt):
        put(e.w, 0, (0.0, 0.0))
        return 0.0, 0.0
    return w


def clay_behind(parts, clay, k, q, w, h):
    """The clay behind a step of length h after a kick, which led the arm to q, w."""
    if parts.clay is None:
        return clay
    growth, state = same_growth(parts.clay.growth, clay.growth), k.motion.special
    hit = hits.after_kick(parts.hits, parts, clay.hit, k)
    clay = Clay(clay.region, clay.b, clay.b, growth, hit, state)
    return special_behind(parts.special, parts, clay, q, w, h)


def stepped(parts, s, e, k, after, target):
    """The state after the step behind a kick."""
    special, clock, x, dt = parts.special, s.clock, s.filled, parts.time.dt
    q, w = sampled.stepped_arm(parts.sampler, parts, e, s, k, after)
    w = held_arm(special, e, k.motion.special, w)
    before, stops = sampled.noted_early(parts.sampler, e, s, x.stops)
    stops = noted(special, e, before, k, clock.t, stops)
    clay = clay_behind(parts, s.clay, k, q, w, after)
    t, i = clock.t + after, clock.i
    loop, status = sampled.taken(parts.sampler, parts, s, k)
    loop = commanded(parts.command, loop, clock.t, t, 0.5 * dt)
    if target - t <= 1e-9 * dt:
        t, i = target, i + 1 if target == grid_after(parts.time, i) else i
    clock, x = Clock(t, i, after), Filled(x.steps + 1, x.rows, x.crossings, stops)
    return State(clock, Body(q, w, k.g), loop, clay, s.work, status, x)


# ---- what is kept --------------------------------------------------------------------------------


def kept(parts, s, e, k, after, shows):
    """The state with what is kept of a kick: its row, if now is a sample, and its works."""
    x = s.filled
    if shows:
        write_row(parts, s, e, k, after)
        x = Filled(x.steps, x.rows + 1, x.crossings, x.stops)
    work, w = sampled.ledger(parts.sampler, s, after)
    work = rows.with_work(parts, work, k, w)
    return State(s.clock, s.body, s.loop, s.clay, work, s.status, x)


def write_row(parts, s, e, k, after):
    """Writes the row of a kick, and the force of the clay where b v does not tell it."""
    grain, i, sampler = parts.grain, s.filled.rows, parts.sampler
    if after == 0.0:
        v = arrival(parts, s)
    else:
        v = velocity(sampled.acting_laws(sampler, parts.special), grain, k)
    b = viscous.now(parts.clay, s.clay, after == 0.0, s.clock.t)
    fh, delta, f = sampled.shown(sampler, parts, s, k, after, v)
    rows.write(e.rows, i, s.body.q, k, v, b, fh, delta)
    rows.write_force(parts.special, grain, e, i, k, v, b, f)
    sampled.write_held(sampler, parts, e, i, k)


# ---- borders -------------------------------------------------------------------------------------


def arrival(parts, s):
    """Velocity at the end of the step that led here, on its side of a border, (x, y) [m/s]."""
    special = sampled.acting_laws(parts.sampler, parts.special)
    k = kick(parts, s.clock, s.body, s.loop, s.clay, 0.0)
    return slow_arrival(special, parts, s, velocity(special, parts.grain, k))


def slow_arrival(special, parts, s, v):
    if special is None:
        return v
    return stiff_arrival(special.stiff, special, parts, s, v)


def stiff_arrival(stiff, special, parts, s, v):
    """As `arrival`: half a kick has led here; in stiff clay that half holds too little of the clay,
    and the velocity is that of a whole kick, with the step before it repeated.
    """
    if stiff is None:
        return v
    s = sampled.without_event(parts.sampler, s)
    k = kick(parts, s.clock, s.body, s.loop, s.clay, s.clock.before)
    (x, y), soft = velocity(special, parts.grain, k), k.motion.special.split.soft
    return x if soft[0] > 0.0 else v[0], y if soft[1] > 0.0 else v[1]


def crossed(parts, s, e, i, up):
    """The state beyond a border, which is noted; at the end of the path, that of a run to close."""
    border, x = borders.border_of(s.clay.region, i, up), s.filled
    speed = 0.0
    if s.clock.before > 0.0:
        v = arrival(parts, s)
        speed = v[1] if i else v[0]
    put(e.crossings, 4 * x.crossings, (float(i), border, s.clock.t, speed))
    closes = i == 0 and up > 0 and border == parts.table[regions.END]
    s = with_filled(s, Filled(x.steps, x.rows, x.crossings + 1, x.stops))
    if closes:
        x = s.status
        return with_status(s, Status(x.code, FINISHED, x.careful, x.landings, x.seen))
    return borders.moved_on(parts, s, place(parts.arm, s.body.q), i, up, 1.0)


def shortened(special, state, after):
    """The longest step that the clay allows [s]."""
    if special is None:
        return after
    return springs.longest(special.springs, state.elastic, after)


def towards(parts, s, after, over, first):
    """The kick that leads on, with the step after it shortened to the first border in its way.

    Args:
        parts: the scene.
        s: the state.
        after: length that the step may have [s].
        over: sides of the borders stepped over without a step, (x, y): there is no way back over
            them, which must not hold the run.
        first: whether other clay has been met since the last look.

    Returns:
        The state, in the region of the step; the kick; length of the step [s]; coordinate of the
        border that it ends on, or that is to be crossed without a step, -1 for none; its side;
        whether without a step.
    """
    axis, up, special = -1, 0, parts.special
    here = place(parts.arm, s.body.q)
    while True:
        after = shortened(special, s.clay.special, after)
        if s.status.closing != OPEN:
            after = 0.0
        elif first:
            s = sampled.acted(parts.sampler, parts, s)
            after = hits.longest(parts.hits, s.clay.hit, after)
            s, after = hits.struck(parts.hits, parts, s, after)
        first = False
        k = kick(parts, s.clock, s.body, s.loop, s.clay, after)
        if after == 0.0 or axis >= 0 or not is_finite(k):
            return s, k, after, axis, up, False
        p = place_after(parts.arm, s.body.q, k, after)
        sx, sy = borders.sides(s.clay.region, p)
        if sx == 0 and sy == 0:
            return s, k, after, axis, up, False
        s = borders.passed_alike(parts, s, here, p)
        sx, sy = borders.sides(s.clay.region, p)
        sx, sy = sx if over[0] in (0, sx) else 0, sy if over[1] in (0, sy) else 0
        herex, herey = borders.sides(s.clay.region, here)
        if sx == 0 and sy == 0:
            return s, k, after, axis, up, False
        standing = sx != 0 and herex != 0 or sy != 0 and herey != 0
        if standing:
            i, side = (0, sx) if sx != 0 and herex != 0 else (1, sy)
        elif s.status.landings >= LANDINGS:
            return s, k, after, axis, up, False
        else:
            length, i, side = borders.first_border(parts, s, after, p, sx, sy)
        if borders.is_same_beyond(parts.table, s.clay.region, i, side):
            s = borders.moved_on(parts, s, here, i, side, 0.0)
        elif standing:
            return s, k, after, i, side, True
        else:
            after, axis, up = length, i, side


def careful(parts, s, e):
    """The state after one step with a look at its end, which lies on a border if one is in the way."""
    target, most, on_grid = next_stop(parts, s)
    s = with_status(s, begun(s.status, s.clay.region, most, on_grid))
    if s.status.code != OPEN:
        return s
    over, after, first = (0, 0), most, True
    while True:
        s, k, after, axis, up, standing = towards(parts, s, after, over, first)
        if not standing:
            break
        over = (up, over[1]) if axis == 0 else (over[0], up)
        s, first = crossed(parts, s, e, axis, up), True
        if s.status.closing != OPEN and s.clock.before == 0.0:
            return ended(s, s.status.closing)
    closing = s.status.closing
    if s.clock.before > 0.0 or closing == OPEN:
        s = kept(parts, s, e, k, after, on_grid or closing != OPEN)
    if closing != OPEN:
        return ended(halted_arm(s, k), closing)
    if not is_finite(k):
        return ended(s, NOT_FINITE)
    put(e.w, 0, s.body.w)  # after a hit it starts from the velocity behind half a kick
    s = stepped(parts, s, e, k, after, target)
    if axis >= 0:
        s = crossed(parts, s, e, axis, up)
    return s


def halted_arm(s, k):
    """The state with the joint rates behind its last kick."""
    body = Body(s.body.q, k.w, k.g)
    return State(s.clock, body, s.loop, s.clay, s.work, s.status, s.filled)


def is_calm(special, state):
    """Whether the springs of the clay ask for no short steps."""
    if special is None:
        return True
    return springs.is_calm(special.springs, state.elastic)


def may_glide(parts, s):
    """Whether a step may follow without a look at more than its end."""
    x = s.status
    calm = hits.is_over(parts.hits, s.clay.hit) and is_calm(parts.special, s.clay.special)
    follows = sampled.may_follow(parts.sampler, parts.time, s.clock)
    return follows and calm and x.code == OPEN and x.closing == OPEN


def has_room(e, x, room):
    """Whether a step may write its row, crossings and stops."""
    return x.rows < room and x.crossings < e.most_crossings and x.stops < e.most_stops


def glide(parts, s, e, room):
    """Steps within one region, up to one that `careful` has to look at."""
    while has_room(e, s.filled, room) and may_glide(parts, s):
        target, after, on_grid = next_stop(parts, s)
        if after < parts.time.dt:
            s = with_status(s, begun(s.status, s.clay.region, after, on_grid))
        s = sampled.acted(parts.sampler, parts, s)
        k = kick(parts, s.clock, s.body, s.loop, s.clay, after)
        if not is_calm_end(parts.arm, s.clay.region, s.body.q, k.w, after):
            break
        s = stepped(parts, kept(parts, s, e, k, after, on_grid), e, k, after, target)
    return s


def advance(parts, s, e, room):
    """Steps until rows, crossings or stops are full, or the run is over."""
    while s.status.code == OPEN and has_room(e, s.filled, room):
        s = glide(parts, s, e, room)
        if has_room(e, s.filled, room):
            s = careful(parts, s, e)
    return s
