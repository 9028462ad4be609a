"""A step of the accurate method: the classic Runge-Kutta, fourth order.

The engine gives the acceleration of the arm at each stage; arm, controller and ledger are
integrated here. A step has no effect beside the engine's scratch; the run takes it or drops it.
"""

from __future__ import annotations

import math

from . import modes as m_
from . import viscous
from .engine_step import accelerations, put
from .instant import instant
from .kick import kick, place, place_after
from .parts import INF
from .rows import ROW
from .state import (
    UNRESOLVED,
    Axis,
    Body,
    Clay,
    Course,
    Felt,
    Point,
    Special,
    State,
    Status,
    Stride,
    Work,
)

GROWTH_BLOCK = 64  # samples for which the steps of clay that grows are chosen at once
NO_END = (0.0, 0.0)
TOUCH = 1e-13  # [m] a border is crossed when the handle is so far beyond it: hundreds of roundings
NEAR = 1e-6  # of a step: so close to its end is at its end


# ---- how a sample is divided ---------------------------------------------------------------------


def substeps(blocks, count, i):
    """Engine steps a sample."""
    if blocks is None:
        return count
    return int(blocks[i // GROWTH_BLOCK])


def paced(accurate, s, target, after, on_grid):
    """The state, and the length of the next step towards a sample, `after` away [s]."""
    if accurate is None:
        return s, after
    x, dt, status = s.loop, target - s.clock.t, s.status
    n = substeps(accurate.blocks, accurate.substeps, s.clock.i)
    left, share = x.left, x.share
    if on_grid or left == 0:
        left, share = n, after / n
    loop = Course(x.x, x.y, x.form, left, share, x.modes)
    if n > m_.SUBSTEPS:
        x = status
        status = Status(UNRESOLVED, x.closing, x.careful, x.landings, x.seen)
    s = State(s.clock, s.body, loop, s.clay, s.work, status, s.filled)
    if after == 0.0:
        return s, after
    return s, anywhere(accurate.modal, dt, n, share if left > 1 else dt)


def anywhere(modal, rest, n, after):
    """Length of the next of n steps a sample; those of clay that yields end anywhere."""
    if modal is None:
        return after
    count = math.ceil(rest / modal.dt * n - NEAR)
    return rest / count if count > 1 else rest


# ---- a step --------------------------------------------------------------------------------------


def arm_accelerations(probe, parts, z, now, modes):
    """Joint accelerations at a point of a step; none of an arm that clay holds [rad/s^2]."""
    a = accelerations(probe, parts.clay, z, now)
    if m_.has_mode(modes, 2):  # but for the engine's rounding
        return 0.0, 0.0
    return a


def stage(probe, parts, t, z, clay, modes, before):
    """The loop and joint accelerations at a point of a step; before: the stage before it."""
    if not abs(z.w[0]) + abs(z.w[1]) < INF:
        return before, z.w
    now = instant(parts, t, z, clay, modes)
    return now, arm_accelerations(probe, parts, z, now, modes)


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
        return None
    return moved_states(x[0], rate[0], h), moved_states(x[1], rate[1], h)


def moved_states(x, rate, h):
    (a, b, c, d), (p, q, r, s) = x, rate
    return a + h * p, b + h * q, c + h * r, d + h * s


def finished(x, v, a, b, c, d, h):
    """A coordinate and its rate at the end of a step, from its accelerations at the stages."""
    first, k = a + b + c, h / 6.0
    return x + h * (v + k * first), v + k * (first + (b + c + d))


def finished_axis(x, a, b, c, d, h):
    delta, rate = finished(x.delta, x.rate, a[0], b[0], c[0], d[0], h)
    y, yrate = finished(x.y, x.yrate, a[1], b[1], c[1], d[1], h)
    return Axis(delta, rate, y, yrate)


def finished_form(x, a, b, c, d, h):
    if x is None:
        return None
    return finished_states(x[0], a[0], b[0], c[0], d[0], h), finished_states(
        x[1], a[1], b[1], c[1], d[1], h
    )


def finished_states(x, a, b, c, d, h):
    k = h / 6.0
    return (
        x[0] + k * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]),
        x[1] + k * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]),
        x[2] + k * (a[2] + 2.0 * b[2] + 2.0 * c[2] + d[2]),
        x[3] + k * (a[3] + 2.0 * b[3] + 2.0 * c[3] + d[3]),
    )


def with_works(x, a, b, c, d, h):
    """The ledger behind a step, from the powers at its stages."""
    k = h / 6.0
    return Work(
        x.muscle + k * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]),
        x.motors + k * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]),
        x.clay + k * (a[2] + 2.0 * b[2] + 2.0 * c[2] + d[2]),
        x.hand + k * (a[3] + 2.0 * b[3] + 2.0 * c[3] + d[3]),
        x.through + k * (a[4] + 2.0 * b[4] + 2.0 * c[4] + d[4]),
    )


def march(probe, parts, s, h):
    """The step of length h; of length 0 its start alone."""
    t, body, x, clay, modes = s.clock.t, s.body, s.loop, s.clay, s.loop.modes
    start = Point(body.q, body.w, x.x, x.y, x.form)
    n0 = instant(parts, t, start, clay, modes)
    if h == 0.0:
        return Stride(n0, n0.grip, body.q, body.w, x, s.work)
    a0 = arm_accelerations(probe, parts, start, n0, modes)
    z = moved(start, start, n0, a0, 0.5 * h)
    n1, a1 = stage(probe, parts, t + 0.5 * h, z, clay, modes, n0)
    z = moved(start, z, n1, a1, 0.5 * h)
    n2, a2 = stage(probe, parts, t + 0.5 * h, z, clay, modes, n1)
    z = moved(start, z, n2, a2, h)
    n3, a3 = stage(probe, parts, t + h, z, clay, modes, n2)
    (qx, qy), (wx, wy) = body.q, body.w
    qx, wx = finished(qx, wx, a0[0], a1[0], a2[0], a3[0], h)
    qy, wy = finished(qy, wy, a0[1], a1[1], a2[1], a3[1], h)
    q, w = m_.back_to_rest(modes, parts.accurate.modal, parts.arm, (qx, qy), (wx, wy))
    loop = Course(
        finished_axis(x.x, n0.x, n1.x, n2.x, n3.x, h),
        finished_axis(x.y, n0.y, n1.y, n2.y, n3.y, h),
        finished_form(x.form, n0.form, n1.form, n2.form, n3.form, h),
        x.left - 1, x.share, m_.with_end(modes, NO_END),
    )  # fmt: skip
    work = with_works(s.work, n0.power, n1.power, n2.power, n3.power, h)
    return Stride(n0, n3.grip, q, w, loop, work)


# ---- a step of either method ---------------------------------------------------------------------


def worked(probe, parts, s, after):
    """The next step: of the fast method its kick."""
    if probe is None:
        return kick(parts, s.clock, s.body, s.loop, s.clay, after)
    return march(probe, parts, s, after)


def place_behind(probe, parts, s, k, after):
    """Position of the handle at its end, (x, y) [m]."""
    if probe is None:
        return place_after(parts.arm, s.body.q, k, after)
    return place(parts.arm, k.q)


def is_calm(accurate, parts, s, k, h):
    """Whether a step ends within its region, and with its modes."""
    if not abs(k.w[0]) + abs(k.w[1]) < INF:
        return False
    p, r = place(parts.arm, k.q), s.clay.region
    within = r.low[0] - TOUCH <= p[0] <= r.high[0] + TOUCH
    if not (within and r.low[1] - TOUCH <= p[1] <= r.high[1] + TOUCH):
        return False
    return keeps_modes(accurate.modal, parts, s, k, h)


def keeps_modes(modal, parts, s, k, h):
    if modal is None:
        return True
    m, v = s.loop.modes, m_.velocity(modal, parts.arm, k.q, k.w)
    return m.mode[0] != m_.TURNED_IN and m_.goes_on(
        modal, m, s.clay.special.felt.law, h, v, k.now.grip, k.grip
    )


# ---- what is kept of it --------------------------------------------------------------------------


def write_now(special, e, i, body, now):
    """Writes the row of a sample."""
    (q1, q2), (w1, w2), p, v, fh, tau = body.q, body.w, now.p, now.v, now.fh, now.tau
    delta, b = now.delta, now.b
    put(
        e.rows, ROW * i,
        (
            q1, q2, p[0], p[1], v[0], v[1], fh[0], fh[1], tau[0], tau[1], delta[0], delta[1],
            b[0], b[1], w1, w2,
        ),
    )  # fmt: skip
    write_felt(special, e, i, now.fe)


def write_felt(special, e, i, fe):
    if special is None:
        return
    write_yielding(special.flow, e, i, fe)


def write_yielding(flow, e, i, fe):
    if flow is None:
        return
    put(e.rendered, 3 * i, fe)


def stuck_in(special, state, modes):
    """State of the special laws with the axes that rest."""
    if special is None:
        return state
    return flow_stuck_in(special.flow, state, modes)


def flow_stuck_in(flow, x, modes):
    if flow is None:
        return x
    f = x.felt
    stuck = stopped(modes, f.law, 0), stopped(modes, f.law, 1)
    felt = Felt(f.law, f.old, f.mean, f.v, f.f, stuck, f.anchor, f.still, f.times)
    return Special(x.owed, x.split, felt, x.elastic, x.cut)


def stopped(modes, law, i):
    """Whether an axis rests in clay that can bring it to rest, 1.0 or 0.0."""
    thins = law[3 * i + 1] > 0.0 and law[3 * i + 2] < 1.0
    return 1.0 if modes.mode[i] == 0.0 and (law[3 * i] > 0.0 or thins) else 0.0
