"""The loop at an instant: forces, the servo's law and the limits of the torques.

The handle, the law that drives it and its load are those of a kick, in `s.k`, whose "velocity
after" is the acceleration.
"""

import math

from ..formulas import arm as arm_law
from ..formulas import numbers
from . import arm, hand, modes, own_laws, servo, signals, viscous

# ---- the loop ------------------------------------------------------------------------------------


def evaluate(m, s, z, since, row, out):
    """The loop at a point z of a step, some time after its start; `row`: of the signals ahead."""
    k, x, y, a, b = s.k, s.k.x, s.k.y, out.x, out.y
    t = s.t + since
    near = max(s.t + since - m.slack, s.t + m.slack) if m.ahead else t
    arm.handle_at(m, k, z.q1, z.q2, z.w1, z.w1 + z.w2)
    arm.turning(k, z.w1, z.w1 + z.w2)
    if m.modal:
        modes.stop(m, s, k)
    x.uh, y.uh = signals.push_at(m, t, near, row)
    x.delta, y.delta = z.x.delta, z.y.delta
    if m.command:
        dx, dy = signals.command_at(m, t, near, row)
        x.delta, y.delta = x.delta + dx, y.delta + dy
    a.b, b.b = viscous.damping_at_place(m, s, t, x.p, y.p)
    clayx, clayy = viscous.force(m, a.b, b.b, x.v, y.v)
    lawx = lawy = 0.0
    if m.laws:
        lawx, lawy = own_laws.force(m, x.p, y.p, x.v, y.v, since)
    x.f, y.f, x.d, y.d, k.dxy = x.uh - clayx - lawx, y.uh - clayy - lawy, 0.0, 0.0, 0.0
    if m.hand:
        for i in range(2):
            o = k.axis[i]
            o.f, o.d = o.f - hand.resistance(m, o.p, o.v, o.c, i), m.axis[i].mass
    servo_law(m, k, z)
    modes.respond(m, s, k, out)
    compute_torques(m, k, out)
    if abs(k.tau[0]) > m.limit[0] or abs(k.tau[1]) > m.limit[1]:
        if m.modal and (m.shaping or m.formed) and modes.rests_somewhere(s):
            hold(m, s, k, out)
        k.tau[0], k.tau[1] = arm.clipped(k.tau[0], m.limit[0]), arm.clipped(k.tau[1], m.limit[1])
        torque_law(m, k, k.tau[0], k.tau[1])
        modes.respond(m, s, k, out)
    finish(m, k, z, out)
    a.fe, b.fe = clayx + (lawx + a.r), clayy + (lawy + b.r)
    a.fh, b.fh = x.net + clayx + (lawx + a.r), y.net + clayy + (lawy + b.r)
    powers(m, k, z, out)


def servo_law(m, k, z):
    """The law of compensator and servo at an instant."""
    servo.put_mobility(m, k)
    for i in range(2):
        o, q, c = k.axis[i], z.axis[i], m.axis[i].servo
        o.delta, o.feed = servo.output_now(m, i, o.delta, q.z)
        o.n = 1.0
        o.a, o.ref = servo.acceleration(m, i, o.delta, q.y, q.yrate, o.p, o.v, o.c)
        o.ref_feed = c[2] * c[0] * o.feed
    if m.formed:
        k.Sxx, k.Syy = k.Sxx + k.x.ref_feed, k.Syy + k.y.ref_feed


def torque_law(m, k, t1, t2):
    """The same under given torques."""
    x, y = k.x, k.y
    x.n = y.n = 1.0
    x.a, y.a = arm.pushed(m, k.u, t1, t2)
    k.Sxx, k.Sxy, k.Syy = k.Wxx, k.Wxy, k.Wyy


def compute_torques(m, k, out):
    """Torques that give the handle its response."""
    k.g[0], k.g[1] = arm_law.joint_velocity(out.x.acc, out.y.acc, k.u, 1.0)
    arm.link_torques(m, k)


def finish(m, k, z, out):
    """Torques, and the rates of compensator and reference."""
    out.tau1, out.tau2 = k.tau[0], k.tau[1]
    out.push1, out.push2 = arm_law.joint_torques(k.x.net, k.y.net, k.u)
    for i in range(2):
        o, q, a, c = k.axis[i], z.axis[i], out.axis[i], m.axis[i]
        a.shown, a.ddelta = o.delta + o.feed * o.net, 0.0
        if m.formed:
            servo.state_rates(m, i, q.z, o.net, a.dz)
            a.dy = o.ref + o.ref_feed * o.net
        else:
            a.ddelta, a.dy = c.K * o.net - c.pole * q.rate, o.ref


def powers(m, k, z, out):
    """Power of muscle, motors, clay, the damper of the hand, and the sum of the magnitudes [W]."""
    x, y, a, b, p = k.x, k.y, out.x, out.y, out.power
    p[0] = x.uh * x.v + y.uh * y.v
    p[1] = k.tau[0] * z.w1 + k.tau[1] * z.w2
    p[2] = a.fe * x.v + b.fe * y.v
    p[3] = m.x.damper * x.v * x.v + m.y.damper * y.v * y.v
    p[4] = abs(p[0]) + abs(p[1])


# ---- motors at their limits while clay holds -----------------------------------------------------


def hold(m, s, k, out):
    """Torques of motors at their limits while clay holds an axis.

    They depend on its force where inertia is shaped or C has feedthrough, and its force on them:
    of the nine cases of a motor free or at either limit, the one that fits best.
    """
    x, y = k.x, k.y
    law = x.a, y.a, k.Sxx, k.Sxy, k.Syy
    b1, b2 = requested_under(m, s, k, out, law, 0.0, 0.0)
    xx, yx = requested_under(m, s, k, out, law, 1.0, 0.0)
    xy, yy = requested_under(m, s, k, out, law, 0.0, 1.0)
    xx, yx, xy, yy = xx - b1, yx - b2, xy - b1, yy - b2
    best1, best2, least = 0.0, 0.0, math.inf
    for case in range(9):
        side1, side2 = side(case // 3), side(case % 3)
        t1, t2 = side1 * m.limit[0], side2 * m.limit[1]
        if side1 == 0.0 and side2 == 0.0:
            det = (1.0 - xx) * (1.0 - yy) - xy * yx
            t1 = numbers.ratio((1.0 - yy) * b1 + xy * b2, det)
            t2 = numbers.ratio((1.0 - xx) * b2 + yx * b1, det)
        elif side1 == 0.0:
            t1 = numbers.ratio(b1 + xy * t2, 1.0 - xx)
        elif side2 == 0.0:
            t2 = numbers.ratio(b2 + yx * t1, 1.0 - yy)
        w1, w2 = b1 + xx * t1 + xy * t2, b2 + yx * t1 + yy * t2
        # excess of a free motor over its limit, or shortfall of the request at a limit
        wrong1 = m.limit[0] - side1 * w1 if side1 != 0.0 else abs(t1) - m.limit[0]
        wrong2 = m.limit[1] - side2 * w2 if side2 != 0.0 else abs(t2) - m.limit[1]
        wrong = max(wrong1 / m.limit[0], wrong2 / m.limit[1])
        if wrong < least:
            best1, best2, least = t1, t2, wrong
    k.tau[0], k.tau[1] = best1, best2


def side(case):
    """A motor free, or at either limit."""
    return 0.0 if case == 0 else 1.0 if case == 1 else -1.0


def requested_under(m, s, k, out, law, t1, t2):
    """Torques that the servo requests where clay holds an axis under torques t1 and t2 [N.m]."""
    x, y, fx, fy = k.x, k.y, k.x.f, k.y.f
    torque_law(m, k, t1, t2)
    modes.respond(m, s, k, out)
    x.f, y.f = fx - out.x.r, fy - out.y.r
    x.a, y.a, k.Sxx, k.Sxy, k.Syy = law
    modes.plain_response(k, out)
    compute_torques(m, k, out)
    x.f, y.f = fx, fy
    return k.tau[0], k.tau[1]
