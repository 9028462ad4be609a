"""A step of the accurate method: the classic Runge-Kutta, fourth order.

The engine gives the acceleration of the arm at each stage; arm, controller and ledger are
integrated here. A step changes only the engine's scratch; the run uses or discards it.
"""

from __future__ import annotations

import math

from . import modes as m_
from .driver import kick
from .engine_step import accelerations, put
from .instant import instant, moment
from .kick import is_finite, place, place_after
from .parts import FASTEST
from .rows import ROW
from .state import (
    UNRESOLVED,
    Axis,
    Course,
    Modes,
    Point,
    Shown,
    State,
    Status,
    Stride,
    Sums,
    Work,
)
from .yielding import note

GROWTH_BLOCK = 64  # samples for which the steps of clay that grows are chosen at once
TOUCH = 1e-13  # [m] a border is crossed when the handle is so far beyond it: hundreds of roundings
NEAR = 1e-6  # share of a step: a time so close to its end counts as its end
EVEN = 1e-4  # share of the slack of signals: a time so close to a prepared one counts as that one


# ---- how a sample is divided ---------------------------------------------------------------------


def substeps(blocks, n, i):
    """Engine steps per sample."""
    if blocks is None:
        return n
    return int(blocks[i // GROWTH_BLOCK])


def paced(accurate, modal, s, target, after, on_grid):
    """The state, and the length of the next step towards a sample that is `after` away [s]."""
    if accurate is None:
        return s, after
    target, after = before_break(accurate.ahead, s.clock.t, target, after)
    x, dt, status = s.loop, target - s.clock.t, s.status
    n = substeps(accurate.blocks, accurate.substeps, s.clock.i)
    left, share = x.left, x.share
    if on_grid or left == 0:
        left, share = n, after / n
    loop = Course(x.x, x.y, x.form, left, share, x.modes)
    if n > m_.SUBSTEPS:
        was = status
        status = Status(UNRESOLVED, was.closing, was.careful, was.landings, was.seen)
    s = State(s.clock, s.body, loop, s.clay, s.work, status, s.filled)
    if after == 0.0:
        return s, after
    return s, anywhere(modal, dt, n, share if left > 1 else dt)


def place_in(times, t):
    """Index of the first of ascending times behind a time."""
    low, high = 0, len(times)
    while low < high:
        middle = (low + high) // 2
        if times[middle] > t:
            high = middle
        else:
            low = middle + 1
    return low


def next_break(ahead, t):
    """The next time at which a signal jumps, INF for none [s]."""
    return ahead.breaks[place_in(ahead.breaks, t + ahead.slack)]


def before_break(ahead, t, target, after):
    """The next stop of the steps, and the time to it [s]: the next jump of a signal, if earlier."""
    if ahead is None:
        return target, after
    stop = next_break(ahead, t)
    if after > 0.0 and stop < target - ahead.slack:
        return stop, stop - t
    return target, after


def is_even(ahead, t, target):
    """Whether no signal jumps up to the next sample."""
    if ahead is None:
        return True
    return next_break(ahead, t) >= target + ahead.slack


def row_of(ahead, t, h):
    """Row of the signals ahead for a step of length h, -1 for none."""
    if ahead is None:
        return -1
    times, near = ahead.times, EVEN * ahead.slack
    i = place_in(times, t - near)
    if h == 0.0 or i + 2 >= len(times) or next_break(ahead, t) < t + h + ahead.slack:
        return -1
    far = max(abs(times[i] - t), abs(times[i + 1] - t - 0.5 * h), abs(times[i + 2] - t - h))
    return i if far < near else -1


def anywhere(modal, rest, n, after):
    """Length of the next of n steps per sample; steps in yielding clay end anywhere."""
    if modal is None:
        return after
    count = math.ceil(rest / modal.dt * n - NEAR)
    return rest / count if count > 1 else rest


# ---- a step --------------------------------------------------------------------------------------

# of the stages: where each and the next one is, rows of the signals ahead, weights in Sums.first,
# Sums.last and the other sums
AT, AHEAD, ROWS = (0.0, 0.5, 0.5, 1.0), (0.5, 0.5, 1.0, 0.0), (0, 1, 1, 2)
FIRST, LAST, WEIGHT = (1.0, 1.0, 1.0, 0.0), (0.0, 1.0, 1.0, 1.0), (1.0, 2.0, 2.0, 1.0)


def moved(start, z, now, a, h):
    """The point h after the start of a step, from the stage at z."""
    q, w, u = start.q, start.w, z.w
    q, w = (q[0] + h * u[0], q[1] + h * u[1]), (w[0] + h * a[0], w[1] + h * a[1])
    return Point(
        q, w, moved_axis(start.x, z.x, now.x, h), moved_axis(start.y, z.y, now.y, h),
        moved_form(start.form, now.form, h),
    )  # fmt: skip


def moved_axis(x, z, a, h):
    return Axis(x.delta + h * z.rate, x.rate + h * a[0], x.y + h * z.yrate, x.yrate + h * a[1])


def moved_form(x, rate, h):
    if x is None:
        return x
    return added_states(x[0], h, rate[0]), added_states(x[1], h, rate[1])


def added_states(x, h, a):
    return x[0] + h * a[0], x[1] + h * a[1], x[2] + h * a[2], x[3] + h * a[3]


def no_sums(form):
    """Sums over no stage."""
    six = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    return Sums(six, six, no_form(form), (0.0, 0.0, 0.0, 0.0, 0.0))


def no_form(form):
    if form is None:
        return form
    return (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)


def with_stage(sums, i, now, a):
    """The sums with those of a stage."""
    six = a[0], a[1], now.x[0], now.x[1], now.y[0], now.y[1]
    m, n, p = WEIGHT[i], sums.power, now.power
    power = (
        n[0] + m * p[0], n[1] + m * p[1], n[2] + m * p[2], n[3] + m * p[3], n[4] + m * p[4],
    )  # fmt: skip
    first, last = added_six(sums.first, FIRST[i], six), added_six(sums.last, LAST[i], six)
    return Sums(first, last, moved_form(sums.form, now.form, m), power)


def added_six(x, h, a):
    return (
        x[0] + h * a[0], x[1] + h * a[1], x[2] + h * a[2], x[3] + h * a[3], x[4] + h * a[4],
        x[5] + h * a[5],
    )  # fmt: skip


def finished(x, v, sums, i, h):
    """A coordinate and its rate at the end of a step."""
    k, f = h / 6.0, sums.first[i]
    return x + h * (v + k * f), v + k * (f + sums.last[i])


def end_of(start, sums, h):
    """The end of a step."""
    (q1, q2), (w1, w2), x, y = start.q, start.w, start.x, start.y
    (q1, w1), (q2, w2) = finished(q1, w1, sums, 0, h), finished(q2, w2, sums, 1, h)
    (dx, ex), (yx, vx) = finished(x.delta, x.rate, sums, 2, h), finished(x.y, x.yrate, sums, 3, h)
    (dy, ey), (yy, vy) = finished(y.delta, y.rate, sums, 4, h), finished(y.y, y.yrate, sums, 5, h)
    form = moved_form(start.form, sums.form, h / 6.0)
    return Point((q1, q2), (w1, w2), Axis(dx, ex, yx, vx), Axis(dy, ey, yy, vy), form)


def with_works(a, p, h):
    """The ledger after a step."""
    k = h / 6.0
    return Work(
        a.muscle + k * p[0], a.motors + k * p[1], a.clay + k * p[2], a.hand + k * p[3],
        a.through + k * p[4], a.hardware,
    )  # fmt: skip


def point_of(body, loop):
    return Point(body.q, body.w, loop.x, loop.y, loop.form)


def march(probe, parts, s, h):
    """The step of length h; for length 0, only its start."""
    t, clay, modes, start = s.clock.t, s.clay, s.loop.modes, point_of(s.body, s.loop)
    z, sums, still = start, no_sums(start.form), m_.has_mode(modes, 2)
    ahead = parts.accurate.ahead
    row = row_of(ahead, t, h)
    for i in range(4):
        when = moment(ahead, t, AT[i] * h, row + ROWS[i] if row >= 0 else row)
        now = instant(parts, when, z, clay, modes)
        if i == 0:
            first = now
            if h == 0.0:
                break
        a = accelerations(probe, z, now)
        if still:  # except for the engine's rounding
            a = 0.0, 0.0
        sums = with_stage(sums, i, now, a)
        z = moved(start, z, now, a, AHEAD[i] * h)
        if not is_finite_point(z):
            break
    end = end_of(start, sums, h)
    if not is_finite_point(z):
        end = z
    elif h > 0.0:
        end = m_.back_to_rest(modes, parts.modal, parts.arm, end)
    x = first  # type: ignore[possibly-unbound]
    shown = Shown(x.p, x.v, x.fh, x.tau, x.delta, x.b, x.fe)
    last = now.grip  # type: ignore[possibly-unbound]
    return Stride(shown, force_of(x.grip), last, end, with_works(s.work, sums.power, h))


def force_of(grip):
    if grip is None:
        return grip
    return grip.f


def is_finite_point(z):
    """Whether the joint rates of a point are those of an arm."""
    return abs(z.w[0]) + abs(z.w[1]) < FASTEST


# ---- a step of either method ---------------------------------------------------------------------


def worked(probe, parts, s, after):
    """The next step: of the fast method its kick."""
    if probe is None:
        return kick(parts, s.clock, s.body, s.loop, s.clay, after)
    return march(probe, parts, s, after)


def place_behind(probe, part, q, k, after):
    """Handle position at the end of a step, (x, y) [m]; q are the joint angles at its start."""
    if probe is None:
        return place_after(part, q, k, after)
    return place(part, k.end.q)


def is_sound(probe, k):
    """Whether a step ends with finite rates."""
    if probe is None:
        return is_finite(k)
    return is_finite_point(k.end)


def is_calm(modal, part, r, modes, k, h):
    """Whether a step ends within its region r and keeps its modes."""
    if not is_finite_point(k.end):
        return False
    p = place(part, k.end.q)
    within = r.low[0] - TOUCH <= p[0] <= r.high[0] + TOUCH
    if not (within and r.low[1] - TOUCH <= p[1] <= r.high[1] + TOUCH):
        return False
    return keeps_modes(modal, part, modes, k, h)


def keeps_modes(modal, part, modes, k, h):
    if modal is None:
        return True
    v = m_.velocity(modal, part, k.end.q, k.end.w)
    return modes.mode[0] != m_.TURNED_IN and m_.goes_on(modal, modes, h, v, k.begin, k.last)


# ---- what is kept of it --------------------------------------------------------------------------


def write_shown(parts, e, i, body, x):
    """Writes the row of a sample."""
    (q1, q2), (w1, w2), p, v, fh, tau = body.q, body.w, x.p, x.v, x.fh, x.tau
    delta, b = x.delta, x.b
    put(
        e.rows, ROW * i,
        (
            q1, q2, p[0], p[1], v[0], v[1], fh[0], fh[1], tau[0], tau[1], delta[0], delta[1],
            b[0], b[1], w1, w2,
        ),
    )  # fmt: skip
    write_force(parts.modal, parts.special, e, i, x.fe)


def write_force(modal, special, e, i, fe):
    """Writes the force of the clay where b v does not give it."""
    if modal is None:
        return write_more(special, e, i, fe)
    put(e.rendered, 3 * i, fe)


def write_more(special, e, i, fe):
    if special is None:
        return
    write_own(special.more, e, i, fe)


def write_own(more, e, i, fe):
    if more is None:
        return
    put(e.rendered, 3 * i, fe)


def course_behind(x, k):
    """The controller after a step."""
    z = k.end
    return Course(z.x, z.y, z.form, x.left - 1, x.share, modes_behind(x.modes))


def modes_behind(m):
    if m is None:
        return m
    stuck = m_.stopped(m, 0), m_.stopped(m, 1)
    return Modes(m.law, m.mode, m.way, m.anchor, m.ends, (0.0, 0.0), stuck, m.fine)


def noted(modal, e, before, modes, t, n):
    """Notes where yielding clay stops or releases the handle; returns the number then noted."""
    if modal is None:
        return n
    if modes.stuck[0] != before.stuck[0]:
        n = note(e.stops, n, axis_of(modal.along), modes.stuck[0], t)
    if modes.stuck[1] != before.stuck[1] and axis_of(modal.along) == 0.0:
        n = note(e.stops, n, 1.0, modes.stuck[1], t)
    return n


def axis_of(along):
    """Coordinate of the first axis in a note."""
    if along is None:
        return 0.0
    return 2.0
