"""A kick: the velocity step from the middle of the step before a sample to that of the step after.

It has no effect: the run takes the value or drops it. Each row of the table in docs/equations.md,
section 4, is a function here or in the module of its part.
"""

from __future__ import annotations

from ..model import arm, pieces
from . import hand, servo, springs, viscous, yielding
from .parts import INF
from .state import Kick, Load, Motion, Pose, Step


def pose_at(parts, q):
    """Jacobian, position and mobility of the arm."""
    a = parts.arm
    u = arm.jacobian(q[0], q[1], a.links)
    return Pose(u, (u[1] + u[3] - a.ox, -a.oy - u[0] - u[2]), arm.mobility(u, a.links))


def place(parts, q):
    """Position of the handle, (x, y) [m]."""
    x, y = arm.handle_position(q[0], q[1], parts.arm.links)
    return x - parts.arm.ox, y - parts.arm.oy


def step_around(before, after):
    """The steps around a sample."""
    span = before + after
    return Step(0.5 * span, before / span, after / span, before, after)


def muscle_force(parts, t, h):
    """Mean muscle force over [t - h, t + h], (x, y) [N]."""
    return with_signal(parts.muscle, steady_force(parts, t), t, h)


def steady_force(parts, t):
    """The part of the muscle force that is constant or changes evenly, (x, y) [N]."""
    since, x, y, rx, ry = parts.force
    return x + (t - since) * rx, y + (t - since) * ry


def with_signal(table, f, t, h):
    if table is None:
        return f
    x, y = pieces.mean_of_table(table, t, h)
    return f[0] + x, f[1] + y


def command_change(table, t0, t1, h):
    """Change of the command between two times, pieces by their mean over h around each (x, y) [m]."""
    if table is None:
        return 0.0, 0.0
    x0, y0 = pieces.mean_of_lines(table, t0, 0.0)
    x1, y1 = pieces.mean_of_lines(table, t1, 0.0)
    if pieces.has_pieces(table):
        ax, ay = pieces.mean_of_pieces(table, t0, min(h, t0))
        bx, by = pieces.mean_of_pieces(table, t1, min(h, t1))
        x1 += bx - ax
        y1 += by - ay
    return x1 - x0, y1 - y0


def loads(parts, s, step, pose, v, c, uh, k, pulled):
    """Every force on the handle that is linear in its velocity after the kick."""
    load = viscous.with_clay(parts.clay, parts.grain, Load(uh, (0.0, 0.0, 0.0)), k, v)
    load = springs.with_pull(parts.springs, load, pulled)
    return hand.with_hand(parts.hand, load, step, pose.p, v, c)


def moved(parts, s, step, pose, law, load, k, v, c, uh, pulled):
    """The handle in a kick, driven by a law."""
    load, rest, soft, owed = with_owed(parts.stiff, parts, s, step, pose, law, load, k, v, uh, pulled)
    u = servo.solve(law, load)
    u, felt = yielding.resist(parts, s, step, pose, law, load, v, u, c)
    f = servo.net(load, u, yielding.mean(felt))
    rest, owed = still_owed(parts.stiff, s.clay.owed, step, rest, soft, owed, u)
    return Motion(u, f, rest, owed, felt)


def with_owed(stiff, parts, s, step, pose, law, load, k, v, uh, pulled):
    """The load with what stiff clay owes from the step before, and owes to the next kick.

    Returns:
        The load; force returned [N]; part per unit of the velocity after the kick [N.s/m]; force
        owed [N].
    """
    none = 0.0, 0.0
    if stiff is None:
        return load, none, none, none
    if k.stiff == 0.0:
        return load, none, none, none
    rest = s.clay.owed[0] / step.H, s.clay.owed[1] / step.H
    kx, ky = viscous.springs(parts.hand)
    p, W, a = pose.p, law.W, law.rest
    hx, hy = uh[0] - kx * p[0] - pulled[0], uh[1] - ky * p[1] - pulled[1]
    g = a[0] + W[0] * hx + W[1] * hy, a[1] + W[1] * hx + W[2] * hy
    g = viscous.slow_force(k, W, g, v)
    g = yielding.creeping(parts.flow, parts.groove, s, k, step.L, g, v)
    owed = k.share[0] * g[0], k.share[1] * g[1]
    soft = 0.5 * step.after * kx * k.share[0], 0.5 * step.after * ky * k.share[1]
    load = servo.added(load, (owed[0] - rest[0], owed[1] - rest[1]), soft)
    return load, rest, soft, owed


def still_owed(stiff, kept, step, rest, soft, owed, u):
    """Clay force beside its dampers [N], and impulse owed to the next kick [N.s]."""
    if stiff is None:
        return rest, kept
    x, y = owed[0] - soft[0] * u[0], owed[1] - soft[1] * u[1]
    return (rest[0] - x, rest[1] - y), (step.H * x, step.H * y)


def link_torques(links, pose, g, f):
    """Motor torques that, beside a force on the handle, give link accelerations [N.m]."""
    x, y = arm.joint_torques(f[0], f[1], pose.u)
    t2 = links[3] * g[1] - y
    return links[2] * g[0] + links[3] * g[1] - x, t2


def kick(parts, s, after):
    """The kick of the continuous law at the sample of s, before a step of length `after`."""
    pose, links = s.body.pose, parts.arm.links
    step = step_around(s.clock.before, after)
    r1, r2 = s.body.w[0], s.body.w[0] + s.body.w[1]
    v = arm.handle_velocity(r1, r2, pose.u)
    half = 0.5 * s.clock.before
    c = arm.centripetal(r1 + half * s.body.g[0], r2 + half * s.body.g[1], pose.u)
    uh = muscle_force(parts, s.clock.t + 0.25 * (after - s.clock.before), 0.25 * (s.clock.before + after))
    k = viscous.split(parts, s, step)
    c = viscous.centripetal(parts.stiff, k, step, c, v, pose.u)
    c = yielding.at_rest(parts.flow, s.body.w, c)
    pulled = springs.pull(parts.springs, s.clay.elastic, step.L)
    load = loads(parts, s, step, pose, v, c, uh, k, pulled)
    servo.ready_form(parts.form, step)
    dx, feedx = servo.shown(parts.form, 0, s.loop.x, s.loop.form)
    dy, feedy = servo.shown(parts.form, 1, s.loop.y, s.loop.form)
    x = servo.servo_axis(parts.servo[0], step, s.loop.x, dx, feedx, v[0], pose.p[0], c[0])
    y = servo.servo_axis(parts.servo[1], step, s.loop.y, dy, feedy, v[1], pose.p[1], c[1])
    law = servo.servo_law(parts, step, pose, v, c, x, y)
    m = moved(parts, s, step, pose, law, load, k, v, c, uh, pulled)
    g = arm.joint_velocity(m.u[0] - v[0], m.u[1] - v[1], pose.u, step.H)
    tau = link_torques(links, pose, g, m.f)
    limit = parts.limits
    if abs(tau[0]) > limit[0] or abs(tau[1]) > limit[1]:
        tau = clipped(tau, limit)
        law = servo.torque_law(links, step, pose, v, tau)
        m = moved(parts, s, step, pose, law, load, k, v, c, uh, pulled)
        g = arm.joint_velocity(m.u[0] - v[0], m.u[1] - v[1], pose.u, step.H)
    w = r1 + step.H * g[0], s.body.w[1] + step.H * (g[1] - g[0])
    if yielding.still(m.felt):
        w = 0.0, 0.0
    f = m.f
    ax = servo.advanced(parts.lag, parts.form, 0, parts.servo[0], step, s.loop.x, x[3] + x[4] * f[0], f[0])
    ay = servo.advanced(parts.lag, parts.form, 1, parts.servo[1], step, s.loop.y, y[3] + y[4] * f[1], f[1])
    return Kick(
        step, v, w, g, k, m, clay_force(parts, k, v, m, pulled), uh, tau,
        (dx + feedx * f[0], dy + feedy * f[1]), ax, ay, servo.states_after(parts.form, s.loop.form, f),
    )  # fmt: skip


def clay_force(parts, k, v, m, pulled):
    """Mean force of the clay in a kick, (x, y) [N]."""
    x, y = viscous.mean_force(parts.clay, parts.grain, k, v, m.u)
    r = yielding.mean(m.felt)
    return x + m.rest[0] + r[0] + pulled[0], y + m.rest[1] + r[1] + pulled[1]


def clipped(tau, limit):
    """Torques within their limits."""
    return min(max(tau[0], -limit[0]), limit[0]), min(max(tau[1], -limit[1]), limit[1])


def limited(parts, k):
    """Whether a motor is at its limit in a kick."""
    return abs(k.tau[0]) >= parts.limits[0] or abs(k.tau[1]) >= parts.limits[1]


def hand_force(parts_hand, k):
    """Mean force of the operator in a kick, (x, y) [N]."""
    if parts_hand is None:
        return k.uh
    return k.motion.f[0] + k.fe[0], k.motion.f[1] + k.fe[1]


def velocity(parts, k):
    """Velocity of the handle at the sample, (x, y) [m/s]."""
    m = k.motion
    slow = viscous.velocity_at_sample(parts.stiff, k.step, k.viscous, k.v, m.u, m.rest)
    return yielding.at_sample(parts.flow, parts.grain, m.felt, k.viscous.soft, slow, m.u)


def is_finite(k):
    """Whether the rates after a kick are finite."""
    return abs(k.w[0]) + abs(k.w[1]) < INF


def place_after(parts, s, k, h):
    """Position of the handle after the step behind a kick, (x, y) [m]."""
    q = s.body.q
    return place(parts, (q[0] + h * k.w[0], q[1] + h * k.w[1]))
