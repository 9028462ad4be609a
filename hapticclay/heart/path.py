"""The path of a run: samples, borders of the clay and the end, for every method.

A step ends on the next sample, or on the first border before it. A kick is a value, so that the
search for a border works out as many as it likes; the run takes the last.
"""

from __future__ import annotations

from ..model import regions
from . import engine_step, fast, grooves, rows, springs, viscous
from . import kick as kicks
from .parts import INF
from .state import (
    FINISHED,
    NOT_FINITE,
    OPEN,
    TIME_LIMIT,
    Before,
    Body,
    Clay,
    Clock,
    Filled,
    Hit,
    Region,
    State,
    Status,
    with_clay,
    with_filled,
    with_status,
)

TOUCH = 1e-13  # [m] a border is crossed when the handle is so far beyond it: hundreds of roundings
LANDINGS = 4  # on borders in one step; a handle that slides along one then completes the step


# ---- regions -------------------------------------------------------------------------------------


def region_at(parts, like, ix, iy, t):
    """The region with these indices, entered at a time."""
    low, high, base, rate = regions.enter_region(parts.table, ix, iy, t)
    return Region((ix, iy), low, high, base, rate, flow_of(parts.flow, like, parts.table, ix, iy))


def flow_of(flow, like, table, ix, iy):
    """Fy, K, n of x and of y in a region."""
    if flow is None:
        return like
    Fyx, Kx, nx = regions.enter_flow(table, 0, ix, iy)
    Fyy, Ky, ny = regions.enter_flow(table, 1, ix, iy)
    return Fyx, Kx, nx, Fyy, Ky, ny


def entered(parts, s, index, struck):
    """The state in another region."""
    c, p = s.clay, s.body.pose.p
    region = region_at(parts, c.region.flow, index[0], index[1], s.clock.t)
    elastic = springs.entered(parts.springs, c.elastic, region, parts.table, p)
    region, old = viscous.at_place(parts.smooth, parts.table, region, c.old, p)
    region, cut = grooves.entered(parts.groove, c.cut, region)
    hit = after_entry(c.hit, struck)
    return with_clay(s, Clay(region, old, c.owed, c.felt, elastic, cut, hit))


def after_entry(hit, struck):
    if hit is None:
        return hit
    return Hit(hit.fine, max(hit.struck, struck))


def side(p, low, high):
    """1 beyond the upper border, -1 beyond the lower, 0 within; a NaN is within."""
    return 1 if p > high + TOUCH else -1 if p < low - TOUCH else 0


def sides(r, p):
    """Borders of a region between it and a place, as `side`, (x, y)."""
    return side(p[0], r.low[0], r.high[0]), side(p[1], r.low[1], r.high[1])


def next_index(r, i, up):
    """Indices of the region beyond a border."""
    ix, iy = r.index
    if i == 0:
        return ix + up, iy
    return ix, iy + up


def is_same_beyond(parts, r, i, up):
    """Whether the clay beyond a border of a region is the same."""
    return regions.is_alike(parts.table, r.index[0], r.index[1], i, up)


def passed_alike(parts, s, p):
    """The state in the last region on the way to a place before clay that differs."""
    while True:
        r = s.clay.region
        sx, sy = sides(r, p)
        i, up = (1, sy) if sx == 0 else (0, sx)
        if (sx == 0) == (sy == 0) or not is_same_beyond(parts, r, i, up):
            return s
        s = entered(parts, s, next_index(r, i, up), 0.0)


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


# ---- borders -------------------------------------------------------------------------------------


def beyond(h, parts, s, e, i, border):
    """Distance by which a step of length h would pass a border of coordinate i [m]."""
    k = kicks.kick(parts, s, h)
    x, y = kicks.place_after(parts, s, k, h)
    return (y if i else x) - border


def find_root(f, b, fb, *args):
    """Root of f between 0 and b, to rounding (false position, Illinois).

    f may vanish at 0 itself, as when a handle enters stiff clay, stops and returns; the root of f/x
    is then found. Where f does not change its sign, the result lies next to 0.
    """
    first, end = 1e-9 * b, b
    a, fa = first, f(first, *args)
    leaves = fa == 0.0 or (fa > 0.0) == (fb > 0.0)
    if leaves:
        while fa == 0.0 or (fa > 0.0) == (fb > 0.0):
            a *= 8.0
            if a > 0.5 * b:
                return first
            fa = f(a, *args)
        fa, fb = fa / a, fb / b
    for _ in range(60):
        h = b - fb * (b - a) / (fb - fa)
        fh = f(h, *args)
        small = abs(fh) < 4e-16  # rounding of a position
        if leaves:
            fh /= h
        if (fh > 0.0) != (fb > 0.0):
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = h, fh
        if abs(b - a) <= 1e-12 * end or small:
            break
    return b


def first_border(parts, s, e, after, p, sx, sy):
    """The step that ends on the first border in its way: its length [s], coordinate, side."""
    span, axis, up = after, -1, 0
    for i in range(2):
        at = sy if i else sx
        if at != 0:
            border = border_of(s.clay.region, i, at)
            length = find_root(beyond, after, (p[1] if i else p[0]) - border, parts, s, e, i, border)
            if axis < 0 or length < span:
                span, axis, up = length, i, at
    return span, axis, up


def border_of(r, i, up):
    """Place of a border of a region [m]."""
    if i == 0:
        return r.high[0] if up > 0 else r.low[0]
    return r.high[1] if up > 0 else r.low[1]


def crossed(parts, s, e, i, up):
    """The state beyond a border, which is noted; at the end of the path, that of a run to close."""
    border, n, f = border_of(s.clay.region, i, up), s.filled.crossings, s.filled
    e.crossings[n, 0], e.crossings[n, 1], e.crossings[n, 2] = float(i), border, s.clock.t
    e.crossings[n, 3] = speed(parts, s, i)
    s = with_filled(s, Filled(f.rows, n + 1, f.stops))
    if i == 0 and up > 0 and border == parts.table[regions.END]:
        x = s.status
        return with_status(s, Status(x.code, FINISHED, x.landings, x.steps))
    return entered(parts, s, next_index(s.clay.region, i, up), 1.0)


def speed(parts, s, i):
    """Velocity of a coordinate at a border, on its near side [m/s]."""
    before = s.clock.before
    if before == 0.0:
        return 0.0
    return border_speed(parts.stiff, parts, s, i, before)


def border_speed(stiff, parts, s, i, before):
    if stiff is None:
        u = kicks.kick(parts, s, 0.0).motion.u
        return u[1] if i else u[0]
    # half a kick has led to the border; in stiff clay that half holds too little of the clay,
    # and the velocity is that of a whole kick, with the step before it repeated
    k = kicks.kick(parts, s, before)
    soft = k.viscous.soft
    if (soft[1] if i else soft[0]) > 0.0:
        v = kicks.velocity(parts, k)
        return v[1] if i else v[0]
    u = kicks.kick(parts, s, 0.0).motion.u
    return u[1] if i else u[0]


# ---- one step ------------------------------------------------------------------------------------


def limit_of_hit(hit, after):
    if hit is None:
        return after
    return min(after, hit.fine)


def towards(parts, s, e, after):
    """The kick that leads on, with the step after it shortened to the first border in its way.

    Returns:
        The state, in the region of the step; the kick; length of the step [s]; coordinate of the
        border that it ends on, -1 for none; its side.
    """
    axis, up, overx, overy, most = -1, 0, 0, 0, after
    while True:
        after = springs.longest(parts.springs, s.clay.elastic, after)
        if s.status.closing != OPEN:
            after = 0.0
        elif axis < 0:
            after = limit_of_hit(s.clay.hit, after)
        s, after = fast.struck(parts.stiff, parts, s, e, after)
        k = kicks.kick(parts, s, after)
        if after == 0.0 or axis >= 0 or not kicks.is_finite(k):
            break
        p = kicks.place_after(parts, s, k, after)
        sx, sy = sides(s.clay.region, p)
        if sx == 0 and sy == 0:
            break
        s = passed_alike(parts, s, p)
        sx, sy = sides(s.clay.region, p)
        # no way back over a border: it must not hold the run
        sx, sy = sx if overx in (0, sx) else 0, sy if overy in (0, sy) else 0
        if sx == 0 and sy == 0:
            k = kicks.kick(parts, s, after)
            break
        herex, herey = sides(s.clay.region, s.body.pose.p)
        if sx != 0 and herex != 0:
            i, over, overx = 0, sx, sx
        elif sy != 0 and herey != 0:
            i, over, overy = 1, sy, sy
        elif s.status.landings >= LANDINGS:
            break
        else:
            length, i, over = first_border(parts, s, e, after, p, sx, sy)
            if is_same_beyond(parts, s.clay.region, i, over):
                s = entered(parts, s, next_index(s.clay.region, i, over), 0.0)
            else:
                after, axis, up = length, i, over
            continue
        if is_same_beyond(parts, s.clay.region, i, over):
            s = entered(parts, s, next_index(s.clay.region, i, over), 0.0)
            continue
        s = crossed(parts, s, e, i, over)
        after = most
        if s.status.closing != OPEN and s.clock.before == 0.0:
            break
    return s, k, after, axis, up


def step(parts, s, e):
    """The state after one step; the last one ends the run."""
    target, after, on_grid = next_sample(parts.time, s.clock.t, s.clock.i)
    x = s.status
    closing = TIME_LIMIT if x.closing == OPEN and after == 0.0 else x.closing
    landings = 0 if on_grid else x.landings
    s = with_status(s, Status(x.code, closing, landings, x.steps))
    s, k, after, axis, up = towards(parts, s, e, after)
    closing = s.status.closing
    if s.clock.before > 0.0 or closing == OPEN:
        if on_grid or closing != OPEN:
            s = rows.written(parts, s, e, k, after)
        s = rows.worked(parts, s, k)
    if closing != OPEN:
        return ended(s, closing)
    if not kicks.is_finite(k):
        return ended(s, NOT_FINITE)
    s = engine_step.taken(parts, s, e, k, after, target)
    if axis >= 0:
        x = s.status
        s = with_status(s, Status(x.code, x.closing, x.landings + 1, x.steps))
        s = crossed(parts, s, e, axis, up)
    return s


def ended(s, code):
    x = s.status
    return with_status(s, Status(code, x.closing, x.landings, x.steps))


def advance(parts, s, e, room):
    """Steps until rows or crossings are full, or the run is over."""
    most, stops = len(e.crossings) - 3, len(e.stops) - 8
    while s.status.code == OPEN and s.filled.rows < room and s.filled.crossings < most:
        if s.filled.stops > stops and stops > 0:
            break
        s = step(parts, s, e)
    return s
