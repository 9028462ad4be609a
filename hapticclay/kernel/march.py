"""A step of the accurate method: the classic Runge-Kutta, fourth order.

Joints, compensator and reference are second-order in time, so the sums over its stages are those
of the accelerations.
"""

import math

from . import arm, instant, memory, modes, yielding

GROWTH_BLOCK = 64  # samples for which the steps of clay that grows are chosen at once
TOUCH = 1e-13  # [m] as borders.TOUCH
NEAR = 1e-6  # share of a step: a time so close to its end counts as its end
EVEN = 1e-4  # share of the slack of signals: a time so close to a prepared one counts as that one
OPEN, UNRESOLVED = 0, 4
FASTEST = 1e30  # [rad/s] faster joints have no state: their powers would leave the floats
ROW = 16


# ---- how a sample is divided ---------------------------------------------------------------------


def substeps(m, i):
    """Engine steps per sample."""
    return m.blocks[i // GROWTH_BLOCK] if m.grows else m.substeps


def pace(m, s, target, after, on_grid):
    """Length of the next step towards a stop that is `after` away [s]."""
    if m.ahead:
        target, after = before_break(m, s.t, target, after)
    rest, n = target - s.t, substeps(m, s.i)
    if on_grid or s.steps_left == 0:
        s.steps_left, s.step_length = n, after / n
    if n > modes.SUBSTEPS:
        s.code = UNRESOLVED
    if after == 0.0:
        return after
    step = s.step_length if s.steps_left > 1 else rest
    if m.modal:  # steps in yielding clay end anywhere
        count = math.ceil(rest / m.dt * n - NEAR)
        return rest / count if count > 1.0 else rest
    return step


def index_after(times, count, t):
    """Index of the first of ascending times after a time."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if times[middle] > t:
            high = middle
        else:
            low = middle + 1
    return low


def next_break(m, t):
    """The next time at which a signal jumps, infinite for none [s]."""
    return m.breaks[index_after(m.breaks, m.breaks_count, t + m.slack)]


def before_break(m, t, target, after):
    """The next stop of the steps, and the time to it [s]: the next jump of a signal, if earlier."""
    stop = next_break(m, t)
    if after > 0.0 and stop < target - m.slack:
        return stop, stop - t
    return target, after


def is_even(m, t, target):
    """Whether no signal jumps up to the next sample."""
    return not m.ahead or next_break(m, t) >= target + m.slack


def signal_row(m, t, h):
    """Row of the signals ahead for a step of length h, -1 for none."""
    if not m.ahead:
        return -1
    times, near = m.times, EVEN * m.slack
    i = index_after(times, m.times_count, t - near)
    if h == 0.0 or i + 2 >= m.times_count or next_break(m, t) < t + h + m.slack:
        return -1
    far = max(abs(times[i] - t), abs(times[i + 1] - t - 0.5 * h), abs(times[i + 2] - t - h))
    return i if far < near else -1


# ---- a step --------------------------------------------------------------------------------------


def march(m, s, h):
    """Tries the step of length h; for length 0, only its start."""
    a, t, z, sums, now = s.a, s.t, s.a.z, s.a.sums, s.a.now
    a.length, still = h, m.modal and modes.rests(s)
    start(m, s, a.begin)
    memory.copied(z, a.begin)
    clear_sums(sums)
    row = signal_row(m, t, h)
    for i in range(4):
        at = 0.0 if i == 0 else h if i == 3 else 0.5 * h
        instant.evaluate(m, s, z, at, row + (i + 1) // 2 if row >= 0 else row, now)
        if i == 0:
            keep_start(s)
            if h == 0.0:
                break
        a1, a2 = arm.accelerations(m, z, now)
        if still:  # except for the engine's rounding
            a1 = a2 = 0.0
        add_stage(m, sums, i, now, a1, a2)
        lead = 0.5 * h if i < 2 else h if i == 2 else 0.0
        move(m, a.begin, z, now, a1, a2, lead)
        if not is_finite(z):
            break
    end(m, s, h)
    memory.copied(a.last, now.grip)


def start(m, s, z):
    """The start of a step."""
    z.q1, z.q2, z.w1, z.w2 = s.q[0], s.q[1], s.w[0], s.w[1]
    for i in range(2):
        a, o = s.axis[i], z.axis[i]
        o.delta, o.rate, o.y, o.yrate = a.delta, a.rate, a.y, a.yrate
        if m.formed:
            memory.copied4(o.z, a.z)


def keep_start(s):
    """Keeps the instant at the start of a step, which its row shows."""
    a, k = s.a, s.k
    memory.copied(a.shown, a.now)
    a.p1, a.p2, a.v1, a.v2 = k.x.p, k.y.p, k.x.v, k.y.v


def clear_sums(sums):
    """Puts the sums to 0."""
    for j in range(6):
        sums.first[j] = sums.last[j] = 0.0
    for j in range(8):
        sums.z[j] = 0.0
    for j in range(5):
        sums.power[j] = 0.0


def add_stage(m, sums, i, now, a1, a2):
    """Adds a stage to the sums."""
    first, last = 0.0 if i == 3 else 1.0, 0.0 if i == 0 else 1.0
    weight = 1.0 if i == 0 or i == 3 else 2.0
    f, e = sums.first, sums.last
    f[0], f[1] = f[0] + first * a1, f[1] + first * a2
    e[0], e[1] = e[0] + last * a1, e[1] + last * a2
    for j in range(2):
        o, at = now.axis[j], 2 + 2 * j
        f[at], f[at + 1] = f[at] + first * o.ddelta, f[at + 1] + first * o.dy
        e[at], e[at + 1] = e[at] + last * o.ddelta, e[at + 1] + last * o.dy
        if m.formed:
            for r in range(4):
                sums.z[4 * j + r] += weight * o.dz[r]
    for j in range(5):
        sums.power[j] += weight * now.power[j]


def move(m, begin, z, now, a1, a2, h):
    """Moves a stage to the point h after the start of the step, by what holds at it."""
    z.q1, z.q2 = begin.q1 + h * z.w1, begin.q2 + h * z.w2
    z.w1, z.w2 = begin.w1 + h * a1, begin.w2 + h * a2
    for i in range(2):
        o, a, n = begin.axis[i], z.axis[i], now.axis[i]
        a.delta, a.rate = o.delta + h * a.rate, o.rate + h * n.ddelta
        a.y, a.yrate = o.y + h * a.yrate, o.yrate + h * n.dy
        if m.formed:
            for r in range(4):
                a.z[r] = o.z[r] + h * n.dz[r]


def end(m, s, h):
    """The end of a step, and the ledger there."""
    a, k, sums = s.a, h / 6.0, s.a.sums
    o, z, w, p = a.begin, a.end, a.work, sums.power
    z.q1, z.w1 = finish(o.q1, o.w1, sums, 0, h)
    z.q2, z.w2 = finish(o.q2, o.w2, sums, 1, h)
    for i in range(2):
        b, c = o.axis[i], z.axis[i]
        c.delta, c.rate = finish(b.delta, b.rate, sums, 2 + 2 * i, h)
        c.y, c.yrate = finish(b.y, b.yrate, sums, 3 + 2 * i, h)
        if m.formed:
            for r in range(4):
                c.z[r] = b.z[r] + k * sums.z[4 * i + r]
    if not is_finite(a.z):
        memory.copied(z, a.z)
    elif h > 0.0 and m.modal:
        modes.back_to_rest(m, s, z)
    memory.copied(w, s.work)
    w.muscle, w.motors, w.clay = w.muscle + k * p[0], w.motors + k * p[1], w.clay + k * p[2]
    w.hand, w.through = w.hand + k * p[3], w.through + k * p[4]


def finish(x, v, sums, i, h):
    """A coordinate and its rate at the end of a step."""
    k, f = h / 6.0, sums.first[i]
    return x + h * (v + k * f), v + k * (f + sums.last[i])


def is_finite(z):
    """Whether the joint rates of a point are those of an arm."""
    return abs(z.w1) + abs(z.w2) < FASTEST


# ---- what is kept of it --------------------------------------------------------------------------


def write(m, s):
    """Writes the row of a sample."""
    a, o, row, n = s.a, s.a.shown, m.rows, ROW * s.row
    row[n], row[n + 1], row[n + 2], row[n + 3] = s.q[0], s.q[1], a.p1, a.p2
    row[n + 4], row[n + 5], row[n + 6], row[n + 7] = a.v1, a.v2, o.x.fh, o.y.fh
    row[n + 8], row[n + 9], row[n + 10], row[n + 11] = o.tau1, o.tau2, o.x.shown, o.y.shown
    row[n + 12], row[n + 13], row[n + 14], row[n + 15] = o.x.b, o.y.b, s.w[0], s.w[1]
    if m.records_clay_force:
        out = m.rendered
        out[3 * s.row], out[3 * s.row + 1] = o.x.fe, o.y.fe


def take(m, s):
    """Takes the step tried: the state becomes that at its end."""
    z, q, w = s.a.end, m.engine.q, m.engine.w
    q[0], q[1], w[0], w[1] = z.q1, z.q2, z.w1, z.w2
    s.q[0], s.q[1], s.w[0], s.w[1] = z.q1, z.q2, z.w1, z.w2
    for i in range(2):
        a, o = s.axis[i], z.axis[i]
        a.delta, a.rate, a.y, a.yrate = o.delta, o.rate, o.y, o.yrate
        if m.formed:
            memory.copied4(a.z, o.z)
    memory.copied(s.work, s.a.work)
    s.steps_left -= 1
    if m.modal:
        age_modes(m, s)


def age_modes(m, s):
    """Modes after a step: what ended it, and whether the clay has stopped the handle."""
    for i in range(2):
        a = s.mode[i]
        before, a.stuck = a.stuck, modes.is_stopped(s, i)
        a.ended, a.ends = a.ends, 0.0
        if a.stuck != before and (i == 0 or m.modal == 1):
            yielding.note_stop(m, s, 2.0 if m.modal == 2 else 1.0 * i, a.stuck, 0.0)


def evaluate_end(m, s, h):
    """What yielding clay does at the end of the step tried, of length h, in its modes."""
    instant.evaluate(m, s, s.a.end, h, -1, s.a.now)
