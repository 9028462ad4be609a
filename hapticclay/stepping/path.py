"""The path of a run: samples, borders of the clay and the end, for every method.

A step ends on the next sample, or on the first border before it. A kick is a value: the search for
a border evaluates as many as it needs, and the run uses the last.
"""

from __future__ import annotations

from ..model import regions
from . import borders, ends, grooves, hits, laws, march, rows, sampled, springs, viscous, yielding
from .driver import kick, kick_by
from .engine_step import put
from .kick import commanded, handle_at, is_calm_end, place, velocity
from .parts import INF
from .state import (
    FINISHED,
    NOT_FINITE,
    OPEN,
    TIME_LIMIT,
    UNRESOLVED,
    Body,
    Clay,
    Clock,
    Filled,
    Laws,
    State,
    Status,
)

# times that the handle comes back to a region within one sample; a handle that slides along a
# border then completes the step
LANDINGS = 4
MOST_STEPS = 20_000  # from one sample to the next; a run that needs more ends as unresolved


# ---- time ----------------------------------------------------------------------------------------


def grid_after(time, i):
    """Time of the sample after sample i [s]."""
    return (i + 1) * time.dt if i < time.last else time.t_max


def next_sample(time, t, i):
    """The next sample of a run: its time and the length of the step to it [s]; whether now is one.

    The length is 0 at the end.
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
    """Status at the beginning of a step with event detection."""
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
    """The state of a run that has ended."""
    x = s.status
    return with_status(s, Status(code, x.closing, x.careful, x.landings, x.seen))


def closed(s):
    """The state of a run whose next row is the last."""
    x = s.status
    return with_status(s, Status(x.code, FINISHED, x.careful, x.landings, x.seen))


# ---- a step --------------------------------------------------------------------------------------


def noted(special, e, before, after, t, n):
    """Notes stops of the handle in a kick; returns the number then noted."""
    if special is None:
        return n
    return yielding.noted(special.flow, e, after.contact, before.contact, t, n)


def held_arm(special, e, reaction, w):
    """Joint rates; zero for an arm that clay holds, which the engine's rounding would let creep."""
    if special is None:
        return w
    if yielding.is_still(special.flow, reaction.contact):
        put(e.w, 0, (0.0, 0.0))
        return 0.0, 0.0
    return w


def clay_behind(part, parts, clay, hit, reaction, body, h):
    """The clay after a step of length h, which led the arm there.

    Args:
        part: the clay.
        parts: the scene.
        clay: before it.
        hit: a hit, after it.
        reaction: of its kick.
        body: the arm.
        h: its length [s].
    """
    if part is None:
        return clay
    growth = viscous.same_growth(part.growth, clay.growth)
    c = clay
    clay = Clay(c.region, c.b, c.b, growth, hit, reaction, c.laws)
    return laws_behind(parts.special, parts, clay, body, h)


def laws_behind(special, parts, c, body, h):
    if special is None:
        return c
    x, table, at = c.laws, parts.table, handle_at(parts.arm, body, 0.0)
    elastic = springs.moved(special.springs, x.elastic, c.region, table, at.p, h)
    b, old, cut = grooves.moved(special.groove, x.cut, c, at.p, at.v)
    more = laws.moved(special.more, x.more, at, h)
    x = Laws(yielding.behind(special.flow, x.flow), elastic, cut, more)
    c = Clay(c.region, b, old, c.growth, c.hit, c.reaction, x)
    return viscous.at_place(special.smooth, table, c, at.p)


def kicked(parts, s, e, k, after, work, filled):
    """The state after a kick and the following step, except the clock; the engine makes it."""
    special, clock, x, reaction = parts.special, s.clock, s.filled, k.motion.reaction
    q, w = sampled.stepped_arm(parts.sampler, parts, e, s, k, after)
    body = Body(q, held_arm(special, e, reaction, w), k.g)
    before, stops = sampled.noted_early(parts.sampler, e, s, x.stops)
    stops = noted(special, e, before, reaction, clock.t, stops)
    hit = hits.after_kick(parts.hits, parts, s.clay.hit, k)
    clay = clay_behind(parts.clay, parts, s.clay, hit, reaction, body, after)
    loop = sampled.taken(parts.sampler, parts, s, k)
    loop = commanded(parts.command, loop, parts.time.dt, clock, k.step)
    x = Filled(x.steps + 1, filled, x.crossings, stops)
    return State(clock, body, loop, clay, work, s.status, x)


def moved_on(accurate, parts, s, e, k, after, work, filled):
    """The same of either method."""
    if accurate is None:
        return kicked(parts, s, e, k, after, work, filled)
    x, body, c = s.filled, Body(k.end.q, k.end.w, s.body.g), s.clay
    put(e.q, 0, body.q)
    put(e.w, 0, body.w)
    loop = march.course_behind(s.loop, k)
    stops = march.noted(parts.modal, e, s.loop.modes, loop.modes, s.clock.t, x.stops)
    clay = clay_behind(parts.clay, parts, c, c.hit, c.reaction, body, after)
    x = Filled(x.steps + 1, filled, x.crossings, stops)
    return State(s.clock, body, loop, clay, k.work, s.status, x)


def stepped(parts, s, e, k, after, target, work, filled):
    """The state after a step; rows filled and the ledger are given."""
    t, i = s.clock.t + after, s.clock.i
    if target - t <= 1e-9 * parts.time.dt:
        t, i = target, i + 1 if target == grid_after(parts.time, i) else i
    s = moved_on(parts.accurate, parts, s, e, k, after, work, filled)
    return State(Clock(t, i, after), s.body, s.loop, s.clay, s.work, s.status, s.filled)


# ---- what is kept --------------------------------------------------------------------------------


def kept(accurate, parts, s, e, k, after, shows):
    """The state with the results of a step: its row, if now is a sample, and its works."""
    if accurate is None:
        return kick_kept(parts, s, e, k, after, shows)
    x = s.filled
    if shows:
        march.write_shown(parts, e, x.rows, s.body, k.shown)
        x = Filled(x.steps, x.rows + 1, x.crossings, x.stops)
    return with_filled(s, x)


def kick_kept(parts, s, e, k, after, shows):
    """The same of a kick."""
    x = s.filled
    if shows:
        write_row(parts, s, e, k, after)
        x = Filled(x.steps, x.rows + 1, x.crossings, x.stops)
    work, w = sampled.ledger(parts.sampler, s, after)
    work = rows.with_work(parts, work, k, w)
    return State(s.clock, s.body, s.loop, s.clay, work, s.status, x)


def write_row(parts, s, e, k, after):
    """Writes the row of a kick, and the force of the clay where b v does not give it."""
    i, sampler = s.filled.rows, parts.sampler
    special = sampled.acting_laws(sampler, parts.special)
    v, f = velocity(special, parts.grain, k), rows.yield_force(special, k)
    if after == 0.0:
        v, f = slow_arrival(special, parts, s, v, f)
    b = viscous.now(parts.clay, s.clay, after == 0.0, s.clock.t)
    fh, delta, f = sampled.shown(sampler, parts, s, k, after, v, f)
    rows.write(e.rows, i, s.body.q, k, v, b, fh, delta)
    rows.write_force(parts.special, parts.grain, e, i, k, s.clay.laws, (f, v, b))
    sampled.write_held(sampler, parts, e, i, k)


# ---- borders -------------------------------------------------------------------------------------


def arrival(accurate, parts, s):
    """Velocity at the end of the step that led here, on its side of a border, (x, y) [m/s]."""
    if accurate is None:
        return kick_arrival(parts, s)
    return handle_at(parts.arm, s.body, 0.0).v


def kick_arrival(parts, s):
    """The same where kicks lead."""
    special = sampled.acting_laws(parts.sampler, parts.special)
    k = kick(parts, s.clock, s.body, s.loop, s.clay, 0.0)
    v = velocity(special, parts.grain, k)
    return slow_arrival(special, parts, s, v, (0.0, 0.0))[0]


def slow_arrival(special, parts, s, v, f):
    """Velocity there [m/s], and force of yielding [N], from those of half a kick."""
    if special is None:
        return v, f
    return stiff_arrival(special.stiff, special, parts, s, v, f)


def stiff_arrival(stiff, special, parts, s, v, f):
    """As `slow_arrival`, in stiff clay.

    Half a kick has led here and holds too little of stiff clay. Velocity and force are those of a
    whole kick, with the step before it repeated.
    """
    if stiff is None or s.clock.before == 0.0:
        return v, f
    s = sampled.without_event(parts.sampler, s)
    k = kick(parts, s.clock, s.body, s.loop, s.clay, s.clock.before)
    (x, y), (fx, fy) = velocity(special, parts.grain, k), rows.yield_force(special, k)
    soft = k.motion.reaction.split.soft
    x, fx = (x, fx) if soft[0] > 0.0 else (v[0], f[0])
    y, fy = (y, fy) if soft[1] > 0.0 else (v[1], f[1])
    return (x, y), (fx, fy)


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
        return closed(s)
    return borders.moved_on(parts, s, place(parts.arm, s.body.q), i, up, 1.0)


def shortened(special, laws_, after):
    """The longest step that the clay allows [s]."""
    if special is None:
        return after
    return springs.longest(special.springs, laws_.elastic, after)


def towards(probe, parts, s, after, over, first):
    """The next step, shortened to the first border ahead.

    Args:
        probe: of the engine, for the accurate method.
        parts: the scene.
        s: the state.
        after: longest length of the step [s].
        over: sides of the borders crossed without a step, (x, y). They cannot be crossed back, so
            that the run cannot stall there.
        first: whether different clay has been entered since the last check.

    Returns:
        The state, in the region of the step; the kick of the step; length of the step [s];
        coordinate of the border that it ends on or that is crossed without a step, -1 for none;
        side of this border; whether it is crossed without a step.
    """
    axis, up, special = -1, 0, parts.special
    here = place(parts.arm, s.body.q)
    while True:
        after = shortened(special, s.clay.laws, after)
        if s.status.closing != OPEN:
            after = 0.0
        elif first:
            s = sampled.acted(parts.sampler, parts, s)
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
        if sx == 0 and sy == 0:
            return s, k, after, axis, up, False
        i, side = borders.stood_on(s.clay.region, here, sx, sy)
        length, standing = 0.0, side != 0
        if not standing:
            if s.status.landings >= LANDINGS:
                return s, k, after, axis, up, False
            length, i, side = borders.first_border(probe, parts, s, after, p, sx, sy)
        if borders.is_same_beyond(parts.table, s.clay.region, i, side):
            s = borders.moved_on(parts, s, here, i, side, 0.0)
        elif standing:
            return s, k, after, i, side, True
        else:
            s, after, axis, up = ends.ending(parts.modal, s, (0.0, 0.0)), length, i, side


def step_to_event(parts, s, e):
    """The state after one step with event detection, which ends on a border if one is ahead."""
    target, most, on_grid = next_stop(parts, s)
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
    if s.status.code != OPEN:
        return s
    closing = s.status.closing
    if s.clock.before > 0.0 or closing == OPEN:
        shows = on_grid or closing != OPEN
        s = kept(parts.accurate, parts, s, e, k, after, shows)
    if closing != OPEN:
        return ended(halted_arm(parts.accurate, s, k), closing)
    if not march.is_sound(e.probe, k):
        return ended(s, NOT_FINITE)
    put(e.w, 0, s.body.w)  # after a hit it starts from the velocity after half a kick
    s = stepped(parts, s, e, k, after, target, s.work, s.filled.rows)
    if axis >= 0:
        s = crossed(parts, s, e, axis, up)
    return s


def halted_arm(accurate, s, k):
    """The state after its last kick, at its sample."""
    if accurate is None:
        body, c = Body(s.body.q, k.w, k.g), s.clock
        return State(Clock(c.t, c.i, 0.0), body, s.loop, s.clay, s.work, s.status, s.filled)
    return s


def is_calm(special, laws_):
    """Whether the springs of the clay require no short steps."""
    if special is None:
        return True
    return springs.is_calm(special.springs, laws_.elastic)


def may_follow(parts, s):
    """Whether the next step needs no check but that of its end."""
    x = s.status
    calm = hits.is_over(parts.hits, s.clay.hit) and is_calm(parts.special, s.clay.laws)
    follows = sampled.may_follow(parts.sampler, parts.time, s.clock)
    return follows and calm and x.code == OPEN and x.closing == OPEN


def has_room(time, s, e, room):
    """Whether a step may write its row, crossings and stops; between samples it has no row."""
    x, c = s.filled, s.clock
    fits = x.rows < room or c.t != c.i * time.dt
    return fits and x.crossings < e.most_crossings and x.stops < e.most_stops


def whole_step(parts, s, e):
    """A step within one region: whether it was possible, and the state after it."""
    target, after, on_grid = next_stop(parts, s)
    if after < parts.time.dt:
        s = with_status(s, begun(s.status, s.clay.region, after, on_grid))
    s, n = sampled.acted(parts.sampler, parts, s), s.filled.rows
    if s.status.code != OPEN:
        return False, s
    k = kick_by(parts.sampler, parts, s.clock, s.body, s.loop, s.clay, after)
    if not is_calm_end(parts.arm, s.clay.region, s.body.q, k.w, after):
        return False, s
    if on_grid:
        write_row(parts, s, e, k, after)
        n += 1
    work, w = sampled.ledger(parts.sampler, s, after)
    work = rows.with_work(parts, work, k, w)
    return True, stepped(parts, s, e, k, after, target, work, n)


def run_whole_steps(parts, s, e, room):
    """Whole steps within one region, up to one that `step_to_event` must handle."""
    return whole_steps_of(parts.accurate, parts, s, e, room)


def whole_steps_of(accurate, parts, s, e, room):
    if accurate is None:
        return whole_kicks(parts, s, e, room)
    c = s.clock
    if c.t != c.i * parts.time.dt or c.i >= parts.time.last or s.status.closing != OPEN:
        return s
    fine = INF
    while s.clock.i < parts.time.last:
        target, after, on_grid = next_sample(parts.time, s.clock.t, s.clock.i)
        if on_grid:
            even = march.is_even(accurate.ahead, s.clock.t, target)
            if not (even and has_room(parts.time, s, e, room)):
                break
            s = with_status(s, begun(s.status, s.clay.region, after, on_grid))
            # at each sample, so that it makes no difference where a call of this ends
            s, fine = ends.acted(parts.modal, parts, s, INF)
        s, after = march.paced(accurate, parts.modal, s, target, after, on_grid)
        if s.status.code != OPEN or fine < after:
            break
        k = march.march(e.probe, parts, s, after)
        if not march.is_calm(parts.modal, parts.arm, s.clay.region, s.loop.modes, k, after):
            break
        s = kept(accurate, parts, s, e, k, after, on_grid)
        s = stepped(parts, s, e, k, after, target, s.work, s.filled.rows)
    return s


def whole_kicks(parts, s, e, room):
    """The same of the fast method."""
    made = True
    while made and has_room(parts.time, s, e, room) and may_follow(parts, s):
        made, s = whole_step(parts, s, e)
    return s


def step(parts, s, e):
    """The state after one step, or after those to the next sample."""
    c, made, rows_ = s.clock, s.filled.steps, s.filled.rows
    room = rows_ + 1 if c.t == c.i * parts.time.dt else rows_  # and what lies between the samples
    s = run_whole_steps(parts, s, e, room)
    return step_to_event(parts, s, e) if s.filled.steps == made else s


def advance(parts, s, e, room):
    """Steps until rows, crossings or stops are full, or the run is over."""
    while s.status.code == OPEN and has_room(parts.time, s, e, room):
        s = run_whole_steps(parts, s, e, room)
        if has_room(parts.time, s, e, room):
            s = step_to_event(parts, s, e)
    return s
