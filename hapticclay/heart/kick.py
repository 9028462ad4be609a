"""A kick: the velocity step from the middle of the step before a sample to that of the step after.

It has no effect: the run takes the value or drops it. Each row of the table in docs/equations.md,
section 4, is a function here or in the module of its part.
"""

from __future__ import annotations

from math import cos, sin

from ..model import arm, pieces
from . import hand, servo, springs, stiff, viscous, yielding
from .parts import INF
from .state import Handle, Kick, Load, Motion, Special, Step

NONE = (0.0, 0.0)


def step_around(before, after):
    """The steps around a sample."""
    span = before + after
    return Step(0.5 * span, before / span, after / span, before, after)


def place(part, q):
    """Position of the handle, (x, y) [m]."""
    links, a = part.links, q[0] + q[1]
    x, y = links[0] * cos(q[0]) + links[1] * cos(a), links[0] * sin(q[0]) + links[1] * sin(a)
    return x - part.ox, y - part.oy


def handle_at(part, body, half):
    """The handle at a sample; `half` is half of the step before [s]."""
    (q1, q2), (r1, w2), (g1, g2) = body.q, body.w, body.g
    r2 = r1 + w2
    u = arm.jacobian(q1, q2, part.links)
    p = u[1] + u[3] - part.ox, -part.oy - u[0] - u[2]
    c = arm.centripetal(r1 + half * g1, r2 + half * g2, u)
    return Handle(u, p, arm.mobility(u, part.links), arm.handle_velocity(r1, r2, u), c)


def muscle_force(push, t, step):
    """Mean muscle force over a kick at t, (x, y) [N]."""
    t = t + 0.25 * (step.after - step.before)
    return with_signal(push.muscle, steady_force(push, t), t, 0.5 * step.H)


def steady_force(push, t):
    """Muscle force but for signals, (x, y) [N]."""
    since, x, y, rx, ry = push.steady
    return x + (t - since) * rx, y + (t - since) * ry


def with_signal(table, f, t, h):
    if table is None:
        return f
    x, y = pieces.mean_of_table(table, t, h)
    return f[0] + x, f[1] + y


def command_change(table, t0, t1, h):
    """Change of the command between two times, pieces by their mean over h around each (x, y) [m]."""
    x0, y0 = pieces.mean_of_lines(table, t0, 0.0)
    x1, y1 = pieces.mean_of_lines(table, t1, 0.0)
    if pieces.has_pieces(table):
        ax, ay = pieces.mean_of_pieces(table, t0, min(h, t0))
        bx, by = pieces.mean_of_pieces(table, t1, min(h, t1))
        x1 += bx - ax
        y1 += by - ay
    return x1 - x0, y1 - y0


def moved(special, grain, hand_, law, load, state, step, at, k, uh):
    """The handle in a kick, driven by a law."""
    if special is None:
        u = servo.solve(law, load)
        return Motion(u, servo.net(load, u, NONE), NONE, NONE, state)
    pulled = springs.pull(special.springs, state.elastic, step)
    load = springs.with_pull(load, pulled)
    split = state.split
    g = stiff.slow_force(special.stiff, split, law, at, k, hand_, uh, pulled)
    g = yielding.creeping(special.flow, special.groove, special.stiff, state.felt, k, step.L, g, at.v)
    load, back, owes, soft = stiff.with_owed(special.stiff, split, hand_, step, load, state.owed, g)
    u = servo.solve(law, load)
    u, felt = yielding.resist(special, grain, state.felt, step, at, law, load, u)
    r = yielding.mean(special.flow, felt)
    f = servo.net(load, u, r)
    rest, owed = stiff.still_owed(special.stiff, split, step, back, owes, soft, u)
    beside = rest[0] + r[0] + pulled[0], rest[1] + r[1] + pulled[1]
    return Motion(u, f, rest, beside, Special(owed, split, felt, state.elastic, state.cut))


def special_handle(special, state, step, at, w):
    """The handle in a kick of clay that stops it."""
    if special is None:
        return at
    return yielding.at_rest(special.flow, w, stiff.behind_sample(special.stiff, state.split, step, at))


def rests(special, motion):
    """Whether clay holds the handle behind a kick."""
    if special is None:
        return False
    return yielding.is_still(special.flow, motion.special.felt)


def link_torques(links, u, g, f):
    """Motor torques that, beside a force on the handle, give link accelerations [N.m]."""
    t2 = links[3] * g[1] - u[2] * f[0] - u[3] * f[1]
    return links[2] * g[0] - u[0] * f[0] - u[1] * f[1] + t2, t2


def clipped(tau, limit):
    """Torques within their limits."""
    return min(max(tau[0], -limit[0]), limit[0]), min(max(tau[1], -limit[1]), limit[1])


def kick(parts, clock, body, loop, clay, after):
    """The kick of the continuous law at a sample, before a step of length `after`."""
    part, hand_, links, limit = parts.clay, parts.hand, parts.arm.links, parts.limits
    special, grain = parts.special, parts.grain
    step = step_around(clock.before, after)
    at = handle_at(parts.arm, body, 0.5 * clock.before)
    uh = muscle_force(parts.push, clock.t, step)
    k, state = viscous.damping(part, special, clay, clock.t, hand_, step)
    at = special_handle(special, state, step, at, body.w)
    load, (cx, cy), d = viscous.with_clay(part, grain, Load(uh, (0.0, 0.0, 0.0)), k, at.v)
    load = hand.with_hand(hand_, load, step, at)
    law, delta, feed, rates, pushes = servo.servo_law(parts, step, at, loop)
    m = moved(special, grain, hand_, law, load, state, step, at, k, uh)
    u, v, f, w, H = m.u, at.v, m.f, body.w, step.H
    g = arm.joint_velocity(u[0] - v[0], u[1] - v[1], at.u, H)
    tau = link_torques(links, at.u, g, f)
    if abs(tau[0]) > limit[0] or abs(tau[1]) > limit[1]:
        tau = clipped(tau, limit)
        law = servo.torque_law(links, step, at, tau)
        m = moved(special, grain, hand_, law, load, state, step, at, k, uh)
        u, f = m.u, m.f
        g = arm.joint_velocity(u[0] - v[0], u[1] - v[1], at.u, H)
    w = w[0] + H * g[0], w[1] + H * (g[1] - g[0])
    if rests(special, m):
        w = 0.0, 0.0
    x, y = d[0] * u[0] + d[2] * u[1], d[1] * u[1] + d[2] * u[0]
    rates = rates[0] + pushes[0] * f[0], rates[1] + pushes[1] * f[1]
    return Kick(
        step, at, k, m, w, g, (x, y), (cx + x + m.beside[0], cy + y + m.beside[1]), uh, tau,
        (delta[0] + feed[0] * f[0], delta[1] + feed[1] * f[1]),
        servo.advanced(parts.lag, parts.form, step, loop, rates, f),
    )  # fmt: skip


def is_limited(parts, k):
    """Whether a motor is at its limit in a kick."""
    return abs(k.tau[0]) >= parts.limits[0] or abs(k.tau[1]) >= parts.limits[1]


def velocity(special, grain, k):
    """Velocity of the handle at the sample, (x, y) [m/s]."""
    v, u, L = k.at.v, k.motion.u, k.step.L
    slow = v[0] + L * (u[0] - v[0]), v[1] + L * (u[1] - v[1])
    if special is None:
        return slow
    m = k.motion
    slow = stiff.at_sample(special.stiff, m.special.split, k.viscous, v, u, m.rest, slow)
    return yielding.at_sample(special.flow, special.stiff, grain, m.special, slow)


def is_finite(k):
    """Whether the rates after a kick are finite."""
    return abs(k.w[0]) + abs(k.w[1]) < INF


def is_calm_end(part, r, q, w, h):
    """Whether a step with joint rates w ends within a region."""
    w1, w2 = w
    if not abs(w1) + abs(w2) < INF:
        return False
    x, y = place(part, (q[0] + h * w1, q[1] + h * w2))
    return r.low[0] <= x <= r.high[0] and r.low[1] <= y <= r.high[1]


def place_after(part, q, k, h):
    """Position of the handle after the step behind a kick, (x, y) [m]."""
    return place(part, (q[0] + h * k.w[0], q[1] + h * k.w[1]))
