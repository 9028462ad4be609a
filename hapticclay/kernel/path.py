"""The path of a run: samples, borders of the clay and the end, for every method.

A step ends on the next sample, or on the first border before it. The search for a border tries as
many steps as it needs, and the run takes the last.
"""

import math

from ..formulas import regions
from . import (
    arm,
    borders,
    ends,
    hits,
    laws,
    march,
    memory,
    methods,
    rows,
    sampled,
    springs,
    viscous,
)

OPEN, FINISHED, TIME_LIMIT, NOT_FINITE, UNRESOLVED = range(5)  # status of a run
# to a region within one sample: a handle that slides along a border then completes the step
MOST_RETURNS = 4
MOST_STEPS = 20_000  # from one sample to the next; a run that needs more ends as unresolved


# ---- time ----------------------------------------------------------------------------------------


def grid_after(m, i):
    """Time of the sample after sample i [s]."""
    return (i + 1) * m.dt if i < m.last else m.t_max


def next_sample(m, s):
    """Time of the next sample, length of the step to it, 0 at the end [s]; whether now is one."""
    on_grid = s.t == s.i * m.dt
    if s.i > m.last:
        return s.t, 0.0, on_grid
    target = grid_after(m, s.i)
    after = m.dt if on_grid and s.i < m.last else target - s.t
    return target, after if after > 1e-9 * m.dt else 0.0, on_grid


def next_stop(m, s):
    """As `next_sample`, with events of sampled control between the samples."""
    target, after, on_grid = next_sample(m, s)
    if m.method == methods.SAMPLED:
        target, after = sampled.before_event(m, s, target, after)
    return target, after, on_grid


# ---- a step --------------------------------------------------------------------------------------


def begin(s, after, on_grid):
    """Begins a step with event detection: counts it, and detects the end of the run."""
    seen = s.seen
    if s.closing == OPEN and after == 0.0:
        s.closing = TIME_LIMIT
    if on_grid:
        s.checked_steps, s.returns = 1, 0
        seen[0] = seen[1] = s.x.index
        seen[2] = seen[3] = s.y.index
    else:
        if s.checked_steps >= MOST_STEPS:
            s.code = UNRESOLVED
        s.checked_steps += 1


def take(m, s, after, target):
    """Takes the step tried: the state becomes that after it. A look ahead ends with its row."""
    if s.looks > 0 and s.row >= s.looks:
        return
    methods.take(m, s, after)
    s.steps += 1
    if m.hits:
        hits.grow(m, s)
    if m.clay:
        viscous.age(s)
        if m.special:
            k = s.e  # not needed any more
            arm.put_handle(m, s, k)
            laws.moved(m, s, k.x.p, k.y.p, k.x.v, k.y.v, after)
    t = s.t + after
    if target - t <= 1e-9 * m.dt:
        if target == grid_after(m, s.i):
            s.i += 1
        t = target
    s.t, s.before = t, after


def cross(m, s, i, up):
    """Notes a crossing and enters the clay beyond; at the end of the path the run is to close."""
    border, out, n, speed = borders.place_of(s, i, up), m.crossings, 4 * s.crossing, 0.0
    if s.before > 0.0:
        vx, vy = methods.arrive(m, s)
        speed = vy if i else vx
    out[n], out[n + 1], out[n + 2], out[n + 3] = 1.0 * i, border, s.t, speed
    s.crossing += 1
    if i == 0 and up > 0 and border == m.table[regions.END]:
        s.closing = FINISHED
        return
    x, y = arm.here(m, s)
    borders.enter_beyond(m, s, x, y, i, up, 1.0)


def bound(m, s, after):
    """Length of a step [s], bounded by a hit and by the method."""
    methods.control(m, s)
    if m.hits:
        after = hits.first_step(m, s, min(after, s.max_step))
    return methods.bound(m, s, after)


def try_step(m, s, after, overx, overy, first):
    """Tries the next step, shortened to the first border ahead."""
    axis, up = -1, 0
    herex, herey = arm.here(m, s)
    while True:
        if m.special and m.springs:
            after = springs.longest_step(s, after)
        if s.closing != OPEN:
            after = 0.0
        elif first:
            after = bound(m, s, after)
        first = False
        methods.attempt(m, s, after)
        if after == 0.0 or axis >= 0 or not methods.is_sound(m, s):
            return after, axis, up, False
        if m.modal:
            after, again = ends.shorten_to_end(m, s, after)
            if again:
                continue
        length, i, at, standing = border_ahead(m, s, after, herex, herey, overx, overy)
        if i < 0:
            return after, axis, up, False
        if borders.is_identical_beyond(m, s, i, at):
            borders.enter_beyond(m, s, herex, herey, i, at, 0.0)
        elif standing:
            return after, i, at, True
        else:
            after, axis, up = length, i, at
            if m.modal:
                ends.put_ends(s, 0.0, 0.0)


def border_ahead(m, s, after, herex, herey, overx, overy):
    """The first border that the step tried crosses: step to it [s], coordinate, side.

    The last value tells whether the handle already is on it.
    """
    px, py = methods.place_after(m, s, after)
    if borders.side(s.x, px) == 0 and borders.side(s.y, py) == 0:
        return after, -1, 0, False
    borders.skip_identical_regions(m, s, herex, herey, px, py)
    sx, sy = borders.side(s.x, px), borders.side(s.y, py)
    sx = sx if overx == 0 or overx == sx else 0
    sy = sy if overy == 0 or overy == sy else 0
    i, at = borders.border_at_handle(s, herex, herey, sx, sy)
    if at != 0:
        return 0.0, i, at, True
    if (sx == 0 and sy == 0) or s.returns >= MOST_RETURNS:
        return after, -1, 0, False
    length, i, at = borders.first_border(m, s, after, px, py, sx, sy)
    return length, i, at, False


def step_to_event(m, s):
    """A step with event detection, which ends on a border if one is ahead."""
    target, most, on_grid = next_stop(m, s)
    begin(s, most, on_grid)
    most = methods.pace(m, s, target, most, on_grid)
    if s.code != OPEN:
        return
    after, overx, overy, first = most, 0, 0, True
    while True:
        after, axis, up, standing = try_step(m, s, after, overx, overy, first)
        if not standing:
            break
        if axis == 0:
            overx = up
        else:
            overy = up
        cross(m, s, axis, up)
        first = True
        if s.closing != OPEN and s.before == 0.0:
            s.code = s.closing
            return
    if s.code != OPEN:
        return
    closing = s.closing
    if s.before > 0.0 or closing == OPEN:
        methods.keep(m, s, after, on_grid or closing != OPEN)
    if closing != OPEN:
        methods.halt(m, s)
        s.code = closing
    elif not methods.is_sound(m, s):
        s.code = NOT_FINITE
    else:
        take(m, s, after, target)
        if axis >= 0:
            cross(m, s, axis, up)


# ---- whole steps ---------------------------------------------------------------------------------


def may_step_whole(m, s):
    """Whether the next step needs no check but that of its end.

    This is a whole step between whole steps; where events lie between the samples, any step but
    the first and the last.
    """
    if s.code != OPEN or s.closing != OPEN or s.i >= m.last:
        return False
    if m.hits and (s.max_step < math.inf or s.entered != 0.0):
        return False
    if m.springs and s.spring_step < math.inf:
        return False
    if m.uneven:
        return s.before > 0.0
    return s.before == m.dt and s.t == s.i * m.dt


def has_room(m, s, room):
    """Whether a step may write its row, crossings and stops; between samples it has no row."""
    fits = (s.row < room or s.t != s.i * m.dt) and not m.halts
    return fits and s.crossing < m.max_crossings and s.stopped < m.max_stops


def ends_in_region(m, s, after):
    """Whether the step tried ends within its region."""
    if not methods.is_sound(m, s):
        return False
    zx, zy = s.x, s.y
    x, y = methods.place_after(m, s, after)
    return zx.low <= x and x <= zx.high and zy.low <= y and y <= zy.high


def whole_step(m, s):
    """Makes a step within one region; returns whether it was possible."""
    target, after, on_grid = next_stop(m, s)
    if after < m.dt:
        begin(s, after, on_grid)
    methods.control(m, s)
    if s.code != OPEN:
        return False
    methods.attempt(m, s, after)
    if not ends_in_region(m, s, after):
        return False
    methods.keep(m, s, after, on_grid)
    take(m, s, after, target)
    return True


def whole_steps(m, s, room):
    """Makes whole steps within one region, until one needs `step_to_event`."""
    if m.method == methods.ACCURATE:
        accurate_whole_steps(m, s, room)
        return
    while has_room(m, s, room) and may_step_whole(m, s) and whole_step(m, s):
        pass


def accurate_whole_steps(m, s, room):
    """As `whole_steps`, by the accurate method."""
    if s.t != s.i * m.dt or s.closing != OPEN:
        return
    allowed = math.inf
    while s.i < m.last:
        target, after, on_grid = next_sample(m, s)
        if on_grid:
            if not (march.is_even(m, s.t, target) and has_room(m, s, room)):
                return
            begin(s, after, on_grid)
            # at each sample, so that it makes no difference where a call of this ends
            allowed = methods.bound(m, s, math.inf)
        after = march.pace(m, s, target, after, on_grid)
        if s.code != OPEN or allowed < after:
            return
        march.march(m, s, after)
        if not ends.is_calm(m, s, after):
            return
        methods.keep(m, s, after, on_grid)
        take(m, s, after, target)


def advance(m, s, room):
    """Steps until rows, crossings or stops are full, or the run is over."""
    while s.code == OPEN and has_room(m, s, room):
        whole_steps(m, s, room)
        if s.code == OPEN and has_room(m, s, room):
            step_to_event(m, s)
        if m.drops_events:
            s.crossing = s.stopped = 0


# ---- a look ahead --------------------------------------------------------------------------------


def peek(m, s, spare):
    """Writes the row of the next step without making it; `spare` is another state."""
    memory.copied(spare, s)
    for j in range(m.spans):
        memory.copied_row(m.span[j].kept, m.span[j].at, m.span[j].size)
    s.looks = s.row + 1
    advance(m, s, s.looks)
    memory.copied(s, spare)
    for j in range(m.spans):
        memory.copied_row(m.span[j].at, m.span[j].kept, m.span[j].size)
    arm.put(m, s)


def show(m, s, spare, out):
    """Writes the row of the next step, and the force of the clay in it; see `peek`."""
    n = s.row
    peek(m, s, spare)
    for i in range(rows.ROW):
        out[i] = m.rows[rows.ROW * n + i]
    if m.records_clay_force:
        out[rows.ROW], out[rows.ROW + 1] = m.rendered[3 * n], m.rendered[3 * n + 1]
    else:
        out[rows.ROW], out[rows.ROW + 1] = viscous.force(m, out[12], out[13], out[4], out[5])
