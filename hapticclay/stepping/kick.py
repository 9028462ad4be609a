"""A kick: the velocity step from the middle of the step before a sample to that of the step after.

It has no side effects: the run uses the value or discards it. Each row of the table in
docs/equations.md, section 4, is a function here or in the module of its part.
"""

from __future__ import annotations

from math import cos, sin

from ..model import arm, pieces
from . import hand, laws, servo, springs, stiff, viscous, yielding
from .parts import FASTEST
from .state import Acting, Axis, Handle, Kick, Load, Loop, Motion, Reaction, Step

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
    """The handle at a sample.

    Args:
        half: half of the step before [s].
    """
    (q1, q2), (r1, w2), (g1, g2) = body.q, body.w, body.g
    r2 = r1 + w2
    u = arm.jacobian(q1, q2, part.links)
    p = u[1] + u[3] - part.ox, -part.oy - u[0] - u[2]
    c = arm.centripetal(r1 + half * g1, r2 + half * g2, u)
    return Handle(u, p, arm.mobility(u, part.links), arm.handle_velocity(r1, r2, u), c)


def at_rates(at, w):
    """The handle at other joint rates."""
    r1, r2 = w[0], w[0] + w[1]
    return Handle(
        at.u, at.p, at.W, arm.handle_velocity(r1, r2, at.u), arm.centripetal(r1, r2, at.u)
    )


def steady_force(push, t):
    """Muscle force without its signal, (x, y) [N]."""
    since, x, y, rx, ry = push.steady
    return x + (t - since) * rx, y + (t - since) * ry


def muscle_force(parts, clock, step):
    """Mean muscle force over a kick, (x, y) [N]."""
    f = steady_force(parts.push, clock.t + 0.25 * (step.after - step.before))
    return with_signal(parts.push.muscle, f, parts.time.dt, clock, step)


def with_signal(signal, f, dt, clock, step):
    if signal is None:
        return f
    if is_whole(dt, clock, step):
        x, y = row_ahead(signal, clock.i)
    else:
        x, y = signal_in_half(signal.halves, signal, dt, clock, step)
    return f[0] + x, f[1] + y


def signal_in_half(halves, signal, dt, clock, step):
    """Mean of a muscle force over a kick that is not of whole steps, (x, y) [N]."""
    if halves is None:
        return signal_in_kick(signal, clock, step)
    if clock.t == clock.i * dt:
        i = clock.i - signal.first
        if step.before == dt and step.after == 0.0:
            return halves[i, 0], halves[i, 1]
        if step.before == 0.0 and step.after == dt:
            return halves[i, 2], halves[i, 3]
    return signal_in_kick(signal, clock, step)


def signal_in_kick(signal, clock, step):
    t = clock.t + 0.25 * (step.after - step.before)
    return pieces.mean_of_table(signal.table, t, 0.5 * step.H)


def push_now(push, dt, clock):
    """Muscle force at the beginning of a step in sampled control, (x, y) [N]."""
    return with_signal_now(push.muscle, steady_force(push, clock.t), dt, clock)


def with_signal_now(signal, f, dt, clock):
    if signal is None:
        return f
    if clock.t == clock.i * dt:
        i = clock.i - signal.first
        x, y = signal.halves[i, 4], signal.halves[i, 5]
    else:
        x, y = pieces.mean_of_table(signal.table, clock.t, 0.0)
    return f[0] + x, f[1] + y


def is_whole(dt, clock, step):
    """Whether the steps around a sample are whole."""
    return step.before == dt and step.after == dt and clock.t == clock.i * dt


def row_ahead(signal, i):
    """What a signal does at a sample, (x, y)."""
    n = i - signal.first
    return signal.ahead[n, 0], signal.ahead[n, 1]


def commanded(signal, loop, dt, clock, step):
    """The loop, with the change of the command over the step after a kick added to its output."""
    if signal is None:
        return loop
    if is_whole(dt, clock, step):
        dx, dy = row_ahead(signal, clock.i)
    else:
        dx, dy = command_change(signal.table, clock.t, clock.t + step.after, 0.5 * dt)
    x, y = loop.x, loop.y
    x, y = Axis(x.delta + dx, x.rate, x.y, x.yrate), Axis(y.delta + dy, y.rate, y.y, y.yrate)
    return Loop(x, y, loop.form)


def command_change(table, t0, t1, h):
    """Change of the command between two times, by its mean over h around each (x, y) [m].

    Args:
        t0: the first time [s].
        t1: the second [s].
    """
    x0, y0 = pieces.mean_of_lines(table, t0, 0.0)
    x1, y1 = pieces.mean_of_lines(table, t1, 0.0)
    if pieces.has_pieces(table):
        ax, ay = pieces.mean_of_pieces(table, t0, min(h, t0))
        bx, by = pieces.mean_of_pieces(table, t1, min(h, t1))
        x1 += bx - ax
        y1 += by - ay
    return x1 - x0, y1 - y0


def moved(special, parts, clay, a, law):
    """Motion of the handle in a kick, driven by a law."""
    if special is None:
        u = servo.solve(law, a.load)
        return Motion(u, servo.net(a.load, u, NONE), NONE, NONE, clay.reaction)
    hand_, states, before = parts.hand, clay.laws, clay.reaction
    pulled = springs.pull(special.springs, states.elastic, a.step)
    bare = springs.with_pull(a.load, pulled)
    all_ = laws.with_loads(special.more, states.more, bare, a.step, a.at)
    g = stiff.slow_force(special.stiff, hand_, a, law, pulled)
    g = yielding.creeping(special.flow, special.stiff, special.groove, states.flow, a, g)
    load, back, owes, soft = stiff.with_owed(special.stiff, hand_, a, all_, before.owed, g)
    u = servo.solve(law, load)
    u, contact = yielding.resist(special.flow, special.groove, parts.grain, clay, a, law, load, u)
    r = yielding.mean(special.flow, contact)
    rest, owed = stiff.still_owed(special.stiff, a, back, owes, soft, u)
    x, y = servo.taken(bare, all_, u)
    beside = rest[0] + r[0] + pulled[0] + x, rest[1] + r[1] + pulled[1] + y
    return Motion(u, servo.net(load, u, r), rest, beside, Reaction(owed, a.split, contact))


def stopped_handle(special, split, step, at, w):
    """Motion of the handle in a kick of clay that stops it."""
    if special is None:
        return at
    return yielding.at_rest(special.flow, w, stiff.behind_sample(special.stiff, split, step, at))


def rests(special, motion):
    """Whether clay holds the handle after a kick."""
    if special is None:
        return False
    return yielding.is_still(special.flow, motion.reaction.contact)


def link_torques(links, u, g, f):
    """Motor torques that give link accelerations together with a force on the handle [N.m]."""
    t2 = links[3] * g[1] - u[2] * f[0] - u[3] * f[1]
    return links[2] * g[0] - u[0] * f[0] - u[1] * f[1] + t2, t2


def clipped(tau, limit):
    """Torques within their limits."""
    return min(max(tau[0], -limit[0]), limit[0]), min(max(tau[1], -limit[1]), limit[1])


def acting(parts, part, special, clock, step, at, w, clay):
    """What acts on the handle in a kick, with joint rates w before it, in the clay `part`."""
    uh = muscle_force(parts, clock, step)
    k, split = viscous.damping(part, special, clay, clock.t, parts.hand, step)
    at = stopped_handle(special, split, step, at, w)
    load, f, d = viscous.with_clay(part, parts.grain, Load(uh, (0.0, 0.0, 0.0)), k, at.v)
    return Acting(step, at, k, split, hand.with_hand(parts.hand, load, step, at), f, d, uh)


def driven(special, parts, clay, a, law):
    """The handle under what acts on it in a kick, driven by a law; link accelerations [rad/s^2]."""
    m, v = moved(special, parts, clay, a, law), a.at.v
    return m, arm.joint_velocity(m.u[0] - v[0], m.u[1] - v[1], a.at.u, a.step.H)


def rates_after(special, m, H, w, g):
    """Joint rates after a kick [rad/s]."""
    if rests(special, m):
        return 0.0, 0.0
    return w[0] + H * g[0], w[1] + H * (g[1] - g[0])


def kicked(a, m, w, g, tau, delta, loop):
    """The value of a kick, with joint rates w after it."""
    (cx, cy), d, u, beside = a.f, a.d, m.u, m.beside
    x, y = d[0] * u[0] + d[2] * u[1], d[1] * u[1] + d[2] * u[0]
    fe = cx + x + beside[0], cy + y + beside[1]
    return Kick(a.step, a.at, a.viscous, m, w, g, (x, y), fe, a.uh, tau, delta, loop)


def servo_kick(parts, clock, body, loop, clay, after):
    """The kick of the continuous law at a sample, before a step of length `after`."""
    special, links, limit = parts.special, parts.arm.links, parts.limits
    step = step_around(clock.before, after)
    at = handle_at(parts.arm, body, 0.5 * clock.before)
    a = acting(parts, parts.clay, special, clock, step, at, body.w, clay)
    law, delta, feed, rates, pushes = servo.servo_law(parts, step, a.at, loop)
    m, g = driven(special, parts, clay, a, law)
    tau = link_torques(links, at.u, g, m.f)
    if abs(tau[0]) > limit[0] or abs(tau[1]) > limit[1]:
        tau = clipped(tau, limit)
        m, g = driven(special, parts, clay, a, servo.torque_law(links, step, a.at, tau))
    f = m.f
    rates = rates[0] + pushes[0] * f[0], rates[1] + pushes[1] * f[1]
    return kicked(
        a, m, rates_after(special, m, step.H, body.w, g), g, tau,
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
    slow = stiff.at_sample(special.stiff, m.reaction.split, k.viscous, v, u, m.rest, slow)
    return yielding.at_sample(special.flow, special.stiff, grain, m.reaction, slow)


def is_finite(k):
    """Whether the rates after a kick are those of an arm."""
    return abs(k.w[0]) + abs(k.w[1]) < FASTEST


def is_calm_end(part, r, q, w, h):
    """Whether a step with joint rates w ends within a region."""
    w1, w2 = w
    if not abs(w1) + abs(w2) < FASTEST:
        return False
    x, y = place(part, (q[0] + h * w1, q[1] + h * w2))
    return r.low[0] <= x <= r.high[0] and r.low[1] <= y <= r.high[1]


def place_after(part, q, k, h):
    """Position of the handle after the step behind a kick, (x, y) [m]."""
    return place(part, (q[0] + h * k.w[0], q[1] + h * k.w[1]))
