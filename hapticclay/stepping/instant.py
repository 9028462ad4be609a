"""The loop at an instant: forces, the servo's law and the limits of the torques.

It is computed as a kick of one second from rest: the velocity after it is the acceleration.
"""

from __future__ import annotations

from ..model import arm, pieces
from . import hand, laws, servo, viscous
from . import modes as m_
from .kick import clipped, handle_at, link_torques, steady_force
from .parts import INF
from .state import Axis, Body, Handle, Instant, Load, Moment, Point, Step

NONE = (0.0, 0.0)
SECOND = Step(1.0, 0.5, 0.5, 1.0, 1.0)
SIDES = (0.0, 1.0, -1.0)  # a motor free, or at either limit


def wanted(links, at, x):
    """Torques that produce a response [N.m]."""
    return link_torques(links, at.u, arm.joint_velocity(x.g[0], x.g[1], at.u, 1.0), x.f)


def under_torques(links, at, tau):
    """The law at an instant under given torques."""
    return servo.torque_law(links, SECOND, Handle(at.u, at.p, at.W, NONE, at.c), tau)


# ---- what changes with time ----------------------------------------------------------------------


def moment(ahead, t, h, row):
    """The moment h after the start of a step at t.

    Args:
        ahead: Accurate.ahead.
        t: start of the step [s].
        h: time since then [s].
        row: of the signals ahead, -1 for none.
    """
    if ahead is None:
        return Moment(t + h, t + h, -1, h)
    return Moment(t + h, max(t + h - ahead.slack, t + ahead.slack), row, h)


def muscle_at(push, when):
    """Muscle force, (x, y) [N]."""
    return with_muscle(push.muscle, steady_force(push, when.t), when)


def with_muscle(signal, f, when):
    if signal is None:
        return f
    if when.row >= 0:
        x, y = row_at(signal, when.row)
    else:
        x, y = pieces.value_of_table(signal.table, when.t, when.near)
    return f[0] + x, f[1] + y


def row_at(signal, i):
    return signal.ahead[i, 0], signal.ahead[i, 1]


def commanded(signal, z, when):
    """A point with the change of the command since t = 0 added to the compensator outputs."""
    if signal is None:
        return z
    if when.row >= 0:
        dx, dy = row_at(signal, when.row)
    else:
        x0, y0 = pieces.mean_of_lines(signal.table, 0.0, 0.0)
        x1, y1 = pieces.value_of_table(signal.table, when.t, when.near)
        dx, dy = x1 - x0, y1 - y0
    x, y = z.x, z.y
    x, y = Axis(x.delta + dx, x.rate, x.y, x.yrate), Axis(y.delta + dy, y.rate, y.y, y.yrate)
    return Point(z.q, z.w, x, y, z.form)


# ---- laws that are modules of their own ----------------------------------------------------------


def law_force(special, clay, at, when):
    """Force of the laws of the clay that are modules of their own, (x, y) [N]."""
    if special is None:
        return NONE
    return more_force(special.more, clay.laws.more, at, when)


def more_force(more, states, at, when):
    if more is None:
        return NONE
    if when.since > 0.0:
        states = laws.moved(more, states, at, when.since)
    return laws.force(more, states, at.p, at.v)


# ---- the loop ------------------------------------------------------------------------------------


def instant(parts, when, z, clay, modes):
    """The loop at a point of a step."""
    links, limit, modal = parts.arm.links, parts.limits, parts.modal
    at = m_.without_rest(modes, modal, handle_at(parts.arm, Body(z.q, z.w, NONE), 0.0))
    uh, v, z = muscle_at(parts.push, when), at.v, commanded(parts.command, z, when)
    b = viscous.at_instant(parts.clay, parts.special, parts.table, clay, when.t, at.p)
    x, y = viscous.force(parts.grain, b, v)
    mx, my = law_force(parts.special, clay, at, when)
    load = Load((uh[0] - x - mx, uh[1] - y - my), (0.0, 0.0, 0.0))
    load = hand.with_hand_now(parts.hand, load, at)
    law, delta, feed, drive, pushes = servo.law_now(parts, at, z)
    a = m_.answer(modal, modes, law, load, at)
    tau = wanted(links, at, a)
    if abs(tau[0]) > limit[0] or abs(tau[1]) > limit[1]:
        tau = held_torques(modes, parts, law, load, at, tau)
        tau = clipped(tau, limit)
        a = m_.answer(modal, modes, under_torques(links, at, tau), load, at)
    f, r, w = a.f, a.r, z.w
    (ddx, ddy), form = servo.rates_now(parts.form, parts.lag, z, f)
    dx, dy = hand.dampers(parts.hand)
    muscle, motors = uh[0] * v[0] + uh[1] * v[1], tau[0] * w[0] + tau[1] * w[1]
    fx, fy, r = f[0] + x, f[1] + y, (mx + r[0], my + r[1])
    push, x, y = arm.joint_torques(f[0], f[1], at.u), x + r[0], y + r[1]
    return Instant(
        at.p, v, b, (x, y), (fx + r[0], fy + r[1]), tau, push,
        (delta[0] + feed[0] * f[0], delta[1] + feed[1] * f[1]),
        (ddx, drive[0] + pushes[0] * f[0]), (ddy, drive[1] + pushes[1] * f[1]), form,
        (
            muscle, motors, x * v[0] + y * v[1], dx * v[0] * v[0] + dy * v[1] * v[1],
            abs(muscle) + abs(motors),
        ),
        a.grip,
    )  # fmt: skip


# ---- motors at their limits while clay holds -----------------------------------------------------


def held_torques(modes, parts, law, load, at, tau):
    """Torques that the servo requests, with the force of clay that holds an axis [N.m]."""
    if modes is None:
        return tau
    if m_.has_mode(modes, 1):
        return by_shaping(parts.shaping, parts, modes, law, load, at, tau)
    return tau


def by_shaping(shaping, parts, modes, law, load, at, tau):
    """The same; they depend on that force where inertia is shaped or C has feedthrough."""
    if shaping is None:
        return by_form(parts.form, parts, modes, law, load, at, tau)
    return torques_that_hold(parts, modes, law, load, at)


def by_form(form, parts, modes, law, load, at, tau):
    if form is None:
        return tau
    return torques_that_hold(parts, modes, law, load, at)


def torques_that_hold(parts, modes, law, load, at):
    """Torques of motors at their limits while clay holds an axis [N.m].

    The servo responds to the force of the clay, which depends on the torques. Each motor is free
    or at either limit; of these nine cases, one is consistent.
    """
    limit1, limit2 = parts.limits
    b1, b2 = wanted_under(parts, modes, law, load, at, (0.0, 0.0))
    xx, yx = wanted_under(parts, modes, law, load, at, (1.0, 0.0))
    xy, yy = wanted_under(parts, modes, law, load, at, (0.0, 1.0))
    xx, yx, xy, yy = xx - b1, yx - b2, xy - b1, yy - b2
    best1, best2, least = 0.0, 0.0, INF
    for case in range(9):
        side1, side2 = SIDES[case // 3], SIDES[case % 3]
        t1, t2 = side1 * limit1, side2 * limit2
        if side1 == 0.0 and side2 == 0.0:
            det = (1.0 - xx) * (1.0 - yy) - xy * yx
            t1, t2 = ((1.0 - yy) * b1 + xy * b2) / det, ((1.0 - xx) * b2 + yx * b1) / det
        elif side1 == 0.0:
            t1 = (b1 + xy * t2) / (1.0 - xx)
        elif side2 == 0.0:
            t2 = (b2 + yx * t1) / (1.0 - yy)
        w1, w2 = b1 + xx * t1 + xy * t2, b2 + yx * t1 + yy * t2
        # excess of a free motor over its limit, or shortfall of the request at a limit
        wrong1 = limit1 - side1 * w1 if side1 != 0.0 else abs(t1) - limit1
        wrong2 = limit2 - side2 * w2 if side2 != 0.0 else abs(t2) - limit2
        wrong = max(wrong1 / limit1, wrong2 / limit2)
        if wrong < least:
            best1, best2, least = t1, t2, wrong
    return best1, best2


def wanted_under(parts, modes, law, load, at, tau):
    """Torques that the servo requests where clay holds an axis under other torques [N.m]."""
    links = parts.arm.links
    r = m_.answer(parts.modal, modes, under_torques(links, at, tau), load, at).r
    load = Load((load.f[0] - r[0], load.f[1] - r[1]), load.d)
    return wanted(links, at, m_.plain_answer(law, load))
