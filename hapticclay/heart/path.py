"""The path of a run: samples, borders of the clay and the end, for every method.

A step ends on the next sample, or on the first border before it. A kick is a value, so that the
search for a border works out as many as it likes; the run takes the last.
"""

from __future__ import annotations

from ..model import regions
from . import borders, ends, grooves, hits, march, rows, springs, viscous, yielding
from .engine_step import moved_arm, put
from .kick import command_change, handle_at, is_calm_end, kick, place, velocity
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


def next_sample(time, t, i):
    """The next sample of a run: its time, the length of the step to it (0 at the end) [s]; whether
    now is a sample.
    """
    dt = time.dt
    on_grid = t == i * dt
    if i > time.last:
        return t, 0.0, on_grid
    target = (i + 1) * dt if i < time.last else time.t_max
    after = dt if on_grid and i < time.last else target - t
    return target, after if after > 1e-9 * dt else 0.0, on_grid


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


def noted(special, e, before, state, t, n):
    """Notes stops of the handle in a step; how many are then noted."""
    if special is None:
        return n
    return yielding.noted(special.flow, e, state.felt, before.felt, t, n)


def held_arm(special, e, state, w):
    """Joint rates; none of an arm that clay holds, which the engine's rounding would let creep."""
    if special is None:
        return w
    if yielding.is_still(special.flow, state.felt):
        put(e.w, 0, (0.0, 0.0))
        return 0.0, 0.0
    return w


def clay_behind(parts, clay, hit, state, body, h):
    """The clay behind a step of length h, which led the arm there.

    Args:
        parts: the scene.
        clay: before it.
        hit: a hit, behind it.
        state: of the special laws, behind its kick.
        body: the arm.
        h: its length [s].
    """
    if parts.clay is None:
        return clay
    growth = same_growth(parts.clay.growth, clay.growth)
    clay = Clay(clay.region, clay.b, clay.b, growth, hit, state)
    return special_behind(parts.special, parts, clay, body.q, body.w, h)


def kicked(parts, s, e, k, after):
    """The state behind a kick and the step after it, but for the clock; the engine makes it."""
    special, clock, x, state = parts.special, s.clock, s.filled, k.motion.special
    q, w = moved_arm(parts, e, clock.before, s.body.w, k, after)
    w = held_arm(special, e, state, w)
    body = Body(q, w, k.g)
    stops = noted(special, e, s.clay.special, state, clock.t, x.stops)
    hit = hits.after_kick(parts.hits, parts, s.clay.hit, k)
    clay = clay_behind(parts, s.clay, hit, state, body, after)
    loop = commanded(parts.command, k.loop, clock.t, clock.t + after, 0.5 * parts.time.dt)
    x = Filled(x.steps + 1, x.rows, x.crossings, stops)
    return State(clock, body, loop, clay, s.work, s.status, x)


def marched(accurate, parts, s, e, k, after):
    """The same of either method."""
    if accurate is None:
        return kicked(parts, s, e, k, after)
    x, body, c = s.filled, Body(k.end.q, k.end.w, s.body.g), s.clay
    put(e.q, 0, body.q)
    put(e.w, 0, body.w)
    loop = march.course_behind(s.loop, k)
    stops = march.noted(parts.modal, e, s.loop.modes, loop.modes, s.clock.t, x.stops)
    clay = clay_behind(parts, c, c.hit, c.special, body, after)
    x = Filled(x.steps + 1, x.rows, x.crossings, stops)
    return State(s.clock, body, loop, clay, k.work, s.status, x)


def stepped(parts, s, e, k, after, target):
    """The state after a step."""
    t, i = s.clock.t + after, s.clock.i
    if target - t <= 1e-9 * parts.time.dt:
        t, i = target, i + 1
    s = marched(parts.accurate, parts, s, e, k, after)
    return State(Clock(t, i, after), s.body, s.loop, s.clay, s.work, s.status, s.filled)


# ---- what is kept --------------------------------------------------------------------------------


def kept(accurate, parts, s, e, k, after, shows):
    """The state with what is kept of a step: its row, if now is a sample, and its works."""
    if accurate is None:
        return kick_kept(parts, s, e, k, after, shows)
    x = s.filled
    if shows:
        march.write_shown(parts.modal, e, x.rows, s.body, k.shown)
        x = Filled(x.steps, x.rows + 1, x.crossings, x.stops)
    return with_filled(s, x)


def kick_kept(parts, s, e, k, after, shows):
    """The same of a kick."""
    x = s.filled
    if shows:
        if after == 0.0:
            v = kick_arrival(parts, s)
        else:
            v = velocity(parts.special, parts.grain, k)
        b = clay_now(parts.clay, s.clay, after == 0.0, s.clock.t)
        rows.write(parts, e.rows, x.rows, s.body.q, k, v, b)
        rows.write_force(parts.special, parts.grain, e, x.rows, k, v, b)
        x = Filled(x.steps, x.rows + 1, x.crossings, x.stops)
    work = rows.with_work(parts, s.work, k, s.body.w)
    return State(s.clock, s.body, s.loop, s.clay, work, s.status, x)


def clay_now(part, clay, before, t):
    """Damping at a sample, or that before it, (x, y) [N.s/m]."""
    if part is None:
        return clay.b
    if before:
        return viscous.grown(part.growth, clay.old, clay.growth, 1, t)
    return viscous.grown(part.growth, clay.b, clay.growth, 0, t)


# ---- borders -------------------------------------------------------------------------------------


def arrival(accurate, parts, s):
    """Velocity at the end of the step that led here, on its side of a border, (x, y) [m/s]."""
    if accurate is None:
        return kick_arrival(parts, s)
    return handle_at(parts.arm, s.body, 0.0).v


def kick_arrival(parts, s):
    """The same where kicks lead."""
    special, k = parts.special, kick(parts, s.clock, s.body, s.loop, s.clay, 0.0)
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
    k = kick(parts, s.clock, s.body, s.loop, s.clay, s.clock.before)
    (x, y), soft = velocity(special, parts.grain, k), k.motion.special.split.soft
    return x if soft[0] > 0.0 else v[0], y if soft[1] > 0.0 else v[1]


def crossed(parts, s, e, i, up):
    """The state beyond a border, which is noted; at the end of the path, that of a run to close."""
    border, x = borders.border_of(s.clay.region, i, up), s.filled
    speed = 0.0
    if s.clock.before > 0.0:
        v = arrival(parts.accurate, parts, s)
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


def towards(probe, parts, s, after, over, first):
    """The step that leads on, shortened to the first border in its way.

    Args:
        probe: of the engine, for the accurate method.
        parts: the scene.
        s: the state.
        after: length that the step may have [s].
        over: sides of the borders stepped over without a step, (x, y): there is no way back over
            them, which must not hold the run.
        first: whether other clay has been met since the last look.

    Returns:
        The state, in the region of the step; the step, by its kick; length of the step [s];
        coordinate of the border that it ends on, or that is to be crossed without a step, -1 for
        none; its side; whether without a step.
    """
    axis, up, special = -1, 0, parts.special
    here = place(parts.arm, s.body.q)
    while True:
        after = shortened(special, s.clay.special, after)
        if s.status.closing != OPEN:
            after = 0.0
        elif first:
            after = hits.longest(parts.hits, s.clay.hit, after)
            s, after = hits.struck(parts.hits, parts, s, after)
            s, after = ends.acted(parts.modal, parts, s, after)
        first, k = False, march.worked(probe, parts, s, after)
        if after == 0.0 or axis >= 0 or not march.is_sound(probe, k):
            return s, k, after, axis, up, False
        s, after, again = ends.met(parts.modal, probe, parts, s, k, after)
        if again:
            continue
        p = march.place_behind(probe, parts.arm, s.body.q, k, after)
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
            length, i, side = borders.first_border(probe, parts, s, after, p, sx, sy)
        if borders.is_same_beyond(parts.table, s.clay.region, i, side):
            s = borders.moved_on(parts, s, here, i, side, 0.0)
        elif standing:
            return s, k, after, i, side, True
        else:
            s, after, axis, up = ends.ending(parts.modal, s, (0.0, 0.0)), length, i, side


def careful(parts, s, e):
    """The state after one step with a look at its end, on a border if one is in the way."""
    target, most, on_grid = next_sample(parts.time, s.clock.t, s.clock.i)
    s = with_status(s, begun(s.status, s.clay.region, most, on_grid))
    s, most = march.paced(parts.accurate, parts.modal, s, target, most, on_grid)
    if s.status.code != OPEN:
        return s
    over, after, first = (0, 0), most, True
    while True:
        s, k, after, axis, up, standing = towards(e.probe, parts, s, after, over, first)
        if not standing:
            break
        over = (up, over[1]) if axis == 0 else (over[0], up)
        s, first = crossed(parts, s, e, axis, up), True
        if s.status.closing != OPEN and s.clock.before == 0.0:
            return ended(s, s.status.closing)
    closing = s.status.closing
    if s.clock.before > 0.0 or closing == OPEN:
        shows = on_grid or closing != OPEN
        s = kept(parts.accurate, parts, s, e, k, after, shows)
    if closing != OPEN:
        return ended(halted_arm(parts.accurate, s, k), closing)
    if not march.is_sound(e.probe, k):
        return ended(s, NOT_FINITE)
    put(e.w, 0, s.body.w)  # after a hit it starts from the velocity behind half a kick
    s = stepped(parts, s, e, k, after, target)
    if axis >= 0:
        s = crossed(parts, s, e, axis, up)
    return s


def halted_arm(accurate, s, k):
    """The state with the joint rates behind its last kick."""
    if accurate is None:
        return State(
            s.clock, Body(s.body.q, k.w, k.g), s.loop, s.clay, s.work, s.status, s.filled
        )
    return s


def is_calm(special, state):
    """Whether the springs of the clay ask for no short steps."""
    if special is None:
        return True
    return springs.is_calm(special.springs, state.elastic)


def may_glide(parts, s):
    """Whether a whole step may follow without a look at more than its end."""
    c, clay = s.clock, s.clay
    whole = c.before == parts.time.dt and c.t == c.i * parts.time.dt and c.i < parts.time.last
    calm = hits.is_over(parts.hits, clay.hit) and is_calm(parts.special, clay.special)
    return whole and calm and s.status.closing == OPEN


def has_room(e, x, room):
    """Whether a step may write its row, crossings and stops."""
    return x.rows < room and x.crossings < e.most_crossings and x.stops < e.most_stops


def glide(accurate, parts, s, e, room):
    """Whole steps within one region, up to one that `careful` has to look at."""
    if accurate is None:
        return glide_kicks(parts, s, e, room)
    c = s.clock
    if c.t != c.i * parts.time.dt or c.i >= parts.time.last or s.status.closing != OPEN:
        return s
    s, fine = ends.acted(parts.modal, parts, s, INF)
    while has_room(e, s.filled, room) and s.clock.i < parts.time.last:
        target, after, on_grid = next_sample(parts.time, s.clock.t, s.clock.i)
        if on_grid:
            s = with_status(s, begun(s.status, s.clay.region, after, on_grid))
        s, after = march.paced(accurate, parts.modal, s, target, after, on_grid)
        if s.status.code != OPEN or fine < after:
            break
        k = march.march(e.probe, parts, s, after)
        if not march.is_calm(parts.modal, parts.arm, s.clay.region, s.loop.modes, k, after):
            break
        s = kept(accurate, parts, s, e, k, after, on_grid)
        s = stepped(parts, s, e, k, after, target)
    return s


def glide_kicks(parts, s, e, room):
    """The same of the fast method."""
    dt = parts.time.dt
    while has_room(e, s.filled, room) and may_glide(parts, s):
        k = kick(parts, s.clock, s.body, s.loop, s.clay, dt)
        if not is_calm_end(parts.arm, s.clay.region, s.body.q, k.w, dt):
            break
        s = stepped(parts, kick_kept(parts, s, e, k, dt, True), e, k, dt, (s.clock.i + 1) * dt)
    return s


def advance(parts, s, e, room):
    """Steps until rows, crossings or stops are full, or the run is over."""
    while s.status.code == OPEN and has_room(e, s.filled, room):
        s = glide(parts.accurate, parts, s, e, room)
        if has_room(e, s.filled, room):
            s = careful(parts, s, e)
    return s
