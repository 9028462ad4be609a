"""What drives the handle in a kick: the law of compensator and servo, or given torques."""

from ..formulas import compensator, controller, numbers
from . import arm, memory

# ---- the compensator -----------------------------------------------------------------------------


def prepare_form(m, s, k):
    """Makes compensator.form_kick for the steps around a sample, unless it is ready."""
    if s.form_before != k.before or s.form_after != k.after:
        for i in range(2):
            compensator.form_kick(m.form, m.order, i, k.before, k.after, s.form_work, s.form_kick)
        s.form_before, s.form_after = k.before, k.after


def output(m, s, k):
    """Output at the sample without the force of the kick [m], and what each unit adds [m/N]."""
    if m.formed:
        prepare_form(m, s, k)
    for i in range(2):
        z, o = s.axis[i], k.axis[i]
        o.delta, o.feed = z.delta, 0.0
        if m.formed:
            c, j = s.form_kick, compensator.KICK * i
            o.delta += c[j] * z.z[0] + c[j + 1] * z.z[1] + c[j + 2] * z.z[2] + c[j + 3] * z.z[3]
            o.feed = m.axis[i].K * c[j + compensator.FEED]


def output_now(m, i, delta, z):
    """Output of an axis at an instant without the net force [m], and what each unit adds [m/N]."""
    if not m.formed:
        return delta, 0.0
    c, j = m.form, compensator.FORM * i + 20
    delta += c[j] * z[0] + c[j + 1] * z[1] + c[j + 2] * z[2] + c[j + 3] * z[3]
    return delta, m.axis[i].K * c[j + 4]


def advance_states(m, s, k, i):
    """States of a compensator of another shape after the step."""
    z, o = s.axis[i], k.axis[i]
    c, j, g = s.form_kick, compensator.KICK * i + 5, compensator.KICK * i + 21
    f = m.axis[i].K * o.net
    for r in range(4):
        q = j + 4 * r
        o.z[r] = (
            c[q] * z.z[0] + c[q + 1] * z.z[1] + c[q + 2] * z.z[2] + c[q + 3] * z.z[3] + c[g + r] * f
        )


def state_rates(m, i, z, f, out):
    """Rates of the states of a compensator of another shape at an instant."""
    c, j = m.form, compensator.FORM * i
    f = m.axis[i].K * f
    for r in range(4):
        q = j + 4 * r
        out[r] = (
            c[q] * z[0] + c[q + 1] * z[1] + c[q + 2] * z[2] + c[q + 3] * z[3] + c[j + 16 + r] * f
        )


def advance(m, s, k):
    """Compensator and reference model after the step."""
    for i in range(2):
        a, z, o = m.axis[i], s.axis[i], k.axis[i]
        yrate = o.ref + o.ref_feed * o.net if m.formed else o.ref
        if m.formed:
            o.next_delta, o.next_rate = z.delta, 0.0
            advance_states(m, s, k, i)
        else:
            n = 1.0 / k.H + a.pole * k.R
            o.next_rate = (1.0 / k.H - a.pole * k.L) / n * z.rate + 1.0 / n * a.K * o.net
            o.next_delta = z.delta + k.after * o.next_rate
        o.next_y, o.next_yrate = z.y + k.after * yrate, yrate


def take(m, s, k):
    """Takes the step: compensator and reference model become those after it."""
    for i in range(2):
        z, o = s.axis[i], k.axis[i]
        z.delta, z.rate, z.y, z.yrate = o.next_delta, o.next_rate, o.next_y, o.next_yrate
        if m.formed:
            memory.copied4(z.z, o.z)


# ---- the continuous law --------------------------------------------------------------------------


def put_mobility(m, k):
    """Mobility of the law: of the shaped inertia, else of the arm."""
    k.Sxx, k.Sxy, k.Syy = k.Wxx, k.Wxy, k.Wyy
    if m.shaping:
        k.Sxx, k.Sxy, k.Syy = m.x.servo[3], 0.0, m.y.servo[3]


def servo_law(m, s, k):
    """The law of a kick: n u = a + S (f - d u), by compensator and servo."""
    output(m, s, k)
    put_mobility(m, k)
    for i in range(2):
        z, o, c = s.axis[i], k.axis[i], m.axis[i].servo
        n = 1.0 / k.H + c[1] * k.R
        take = 1.0 / n
        o.ref = (1.0 / k.H - c[1] * k.L) / n * z.yrate + take * c[2] * (c[0] * o.delta - z.y)
        o.n = 1.0 / k.H + c[4] * k.R
        keep = 1.0 / k.H - c[4] * k.L
        o.a = o.n * o.ref + keep * (o.v - z.yrate) + c[5] * (z.y - o.p) + o.c
        o.rest = o.a - keep * o.v
        if m.formed:
            o.ref_feed = take * c[2] * c[0] * o.feed
    if m.formed:
        x, y, c, e = k.x, k.y, m.x.servo, m.y.servo
        tx = 1.0 / (1.0 / k.H + c[1] * k.R) * c[2] * c[0]
        ty = 1.0 / (1.0 / k.H + e[1] * k.R) * e[2] * e[0]
        k.Sxx, k.Syy = k.Sxx + x.n * tx * x.feed, k.Syy + y.n * ty * y.feed


def torque_law(m, k, t1, t2):
    """The same under given torques."""
    x, y = k.x, k.y
    x.n = y.n = 1.0 / k.H
    x.rest, y.rest = arm.pushed(m, k.u, t1, t2)
    x.a, y.a = x.n * x.v + x.rest, y.n * y.v + y.rest
    k.Sxx, k.Sxy, k.Syy = k.Wxx, k.Wxy, k.Wyy


def solve(k):
    """n u = a + S (f - d u): the velocity u after a kick, (x, y) [m/s]."""
    x, y, xx, xy, yy, z = k.x, k.y, k.Sxx, k.Sxy, k.Syy, k.dxy
    gx, gy = x.a + xx * x.f + xy * y.f, y.a + xy * x.f + yy * y.f
    a, b = x.n + xx * x.d + xy * z, xx * z + xy * y.d
    c, e = xy * x.d + yy * z, y.n + xy * z + yy * y.d
    r = numbers.ratio(c, a)
    uy = numbers.ratio(gy - r * gx, e - r * b)
    return numbers.ratio(gx - b * uy, a), uy


# ---- at a sample or an instant -------------------------------------------------------------------


def acceleration(m, i, delta, y, yrate, p, v, c):
    """Acceleration of an axis by the servo, and y'', both without forces [m/s^2]."""
    return controller.feedback_law(m.axis[i].servo, delta, y, yrate, p, v, c)
