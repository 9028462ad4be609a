"""What drives the handle in a kick: the law of compensator and servo, or given torques."""

from __future__ import annotations

from ..model import arm, compensator, controller
from .state import Axis, Law, Load, Loop

# ---- the compensator -----------------------------------------------------------------------------


def decay(rate, step):
    """Coefficients (keep, take) of one kick of x' = -rate x + drive: x+ = keep x- + take drive.

    Trapezoidal in the rate and exact in total impulse, for any length and any split.
    """
    n = 1.0 / step.H + rate * step.R
    return (1.0 / step.H - rate * step.L) / n, 1.0 / n


def ready_form(form, step):
    """Works out compensator.form_kick for the steps around a sample, unless it is ready."""
    k, n = form.kick, 2 * compensator.KICK
    if k[n] != step.before or k[n + 1] != step.after:
        for i in range(2):
            compensator.form_kick(
                form.numbers, form.order, i, step.before, step.after, form.work, k
            )
        k[n], k[n + 1] = step.before, step.after


def shown(form, step, loop):
    """Output at the sample without the force of the kick [m], and what each unit adds [m/N]."""
    if form is None:
        return (loop.x.delta, loop.y.delta), (0.0, 0.0)
    ready_form(form, step)
    (x, feedx), (y, feedy) = shown_axis(form, 0, loop.form[0]), shown_axis(form, 1, loop.form[1])
    return (loop.x.delta + x, loop.y.delta + y), (feedx, feedy)


def shown_axis(form, i, z):
    k, o = form.kick, compensator.KICK * i
    out = k[o] * z[0] + k[o + 1] * z[1] + k[o + 2] * z[2] + k[o + 3] * z[3]
    return out, form.gain[i] * k[o + compensator.FEED]


def advanced(lag, form, step, loop, rates, f):
    """The loop behind the step after the kick: rates of the references, net force."""
    if form is None:
        x, y = loop.x, loop.y
        return Loop(
            lagged(lag[0], step, x, rates[0], f[0]),
            lagged(lag[1], step, y, rates[1], f[1]),
            loop.form,
        )
    x, y, h = loop.x, loop.y, step.after
    states = state_after(form, 0, loop.form[0], f[0]), state_after(form, 1, loop.form[1], f[1])
    x = Axis(x.delta, 0.0, x.y + h * rates[0], rates[0])
    return Loop(x, Axis(y.delta, 0.0, y.y + h * rates[1], rates[1]), states)


def lagged(lag, step, z, yrate, f):
    """One axis behind the step after the kick, with the compensator as printed."""
    keep, take = decay(lag.pole, step)
    rate = keep * z.rate + take * lag.K * f
    return Axis(z.delta + step.after * rate, rate, z.y + step.after * yrate, yrate)


def state_after(form, i, z, f):
    k, o, g = form.kick, compensator.KICK * i + 5, compensator.KICK * i + 21
    a, b, c, d = z
    f = form.gain[i] * f
    return (
        k[o] * a + k[o + 1] * b + k[o + 2] * c + k[o + 3] * d + k[g] * f,
        k[o + 4] * a + k[o + 5] * b + k[o + 6] * c + k[o + 7] * d + k[g + 1] * f,
        k[o + 8] * a + k[o + 9] * b + k[o + 10] * c + k[o + 11] * d + k[g + 2] * f,
        k[o + 12] * a + k[o + 13] * b + k[o + 14] * c + k[o + 15] * d + k[g + 3] * f,
    )


def output_now(form, z):
    """Output at an instant without the net force [m], and what each unit adds [m/N]."""
    if form is None:
        return (z.x.delta, z.y.delta), (0.0, 0.0)
    (x, feedx), (y, feedy) = axis_now(form, 0, z.form[0]), axis_now(form, 1, z.form[1])
    return (z.x.delta + x, z.y.delta + y), (feedx, feedy)


def axis_now(form, i, z):
    c, o = form.numbers, compensator.FORM * i + 20
    out = c[o] * z[0] + c[o + 1] * z[1] + c[o + 2] * z[2] + c[o + 3] * z[3]
    return out, form.gain[i] * c[o + 4]


def rates_now(form, lag, z, f):
    """delta'' of x and y [m/s^2], and the rates of compensators of another shape."""
    if form is None:
        return (rate_of_lag(lag[0], z.x, f[0]), rate_of_lag(lag[1], z.y, f[1])), None
    return (0.0, 0.0), (form_rates(form, 0, z.form[0], f[0]), form_rates(form, 1, z.form[1], f[1]))


def rate_of_lag(lag, z, f):
    return lag.K * f - lag.pole * z.rate


def form_rates(form, i, z, f):
    a, o, f = form.numbers, compensator.FORM * i, form.gain[i] * f
    p, q, r, s = z
    return (
        a[o] * p + a[o + 1] * q + a[o + 2] * r + a[o + 3] * s + a[o + 16] * f,
        a[o + 4] * p + a[o + 5] * q + a[o + 6] * r + a[o + 7] * s + a[o + 17] * f,
        a[o + 8] * p + a[o + 9] * q + a[o + 10] * r + a[o + 11] * s + a[o + 18] * f,
        a[o + 12] * p + a[o + 13] * q + a[o + 14] * r + a[o + 15] * s + a[o + 19] * f,
    )


# ---- the continuous law --------------------------------------------------------------------------


def axis_law(servo, step, z, delta, v, p, c):
    """One axis of the servo's law.

    Returns:
        Weight n of the velocity after the kick [1/s]; acceleration without forces, and the part of
        it that is the velocity's before [m/s^2]; rate of the reference [m/s], what each metre of
        delta adds to it [1/s].
    """
    keep, take = decay(servo.damping, step)
    yrate = keep * z.yrate + take * servo.stiffness * (servo.ratio * delta - z.y)
    n, m = 1.0 / step.H + servo.Sdamping * step.R, 1.0 / step.H - servo.Sdamping * step.L
    a = n * yrate + m * (v - z.yrate) + servo.Sstiffness * (z.y - p) + c
    return n, a, m * v, yrate, take * servo.stiffness * servo.ratio


def servo_law(parts, step, at, loop):
    """The law of a kick.

    Returns:
        The law; output of the compensator at the sample without the force of the kick [m]; what
        each unit of force adds to it [m/N]; rates of the reference models without it [m/s]; what
        each unit adds to them [m/(N.s)].
    """
    delta, feed = shown(parts.form, step, loop)
    (sx, sy), v, p, c = parts.servo, at.v, at.p, at.c
    nx, ax, mx, rx, tx = axis_law(sx, step, loop.x, delta[0], v[0], p[0], c[0])
    ny, ay, my, ry, ty = axis_law(sy, step, loop.y, delta[1], v[1], p[1], c[1])
    W = servo_mobility(parts.shaping, parts.servo, at.W)
    W = with_feed(parts.form, W, nx * tx * feed[0], ny * ty * feed[1])
    law = Law((nx, ny), (ax, ay), (ax - mx, ay - my), W)
    return law, delta, feed, (rx, ry), (tx * feed[0], ty * feed[1])


def law_now(parts, at, z):
    """The law at an instant, where u is the acceleration; the rest as of `servo_law`, with the
    accelerations of the reference models.
    """
    delta, feed = output_now(parts.form, z)
    (sx, sy), v, p, c, x, y = parts.servo, at.v, at.p, at.c, z.x, z.y
    ax, yx = controller.feedback_law(sx, delta[0], x.y, x.yrate, p[0], v[0], c[0])
    ay, yy = controller.feedback_law(sy, delta[1], y.y, y.yrate, p[1], v[1], c[1])
    pushx, pushy = sx.stiffness * sx.ratio * feed[0], sy.stiffness * sy.ratio * feed[1]
    W = servo_mobility(parts.shaping, parts.servo, at.W)
    W = with_feed(parts.form, W, pushx, pushy)
    return Law((1.0, 1.0), (ax, ay), (ax, ay), W), delta, feed, (yx, yy), (pushx, pushy)


def servo_mobility(shaping, servo, W):
    """Acceleration per unit of net force that the servo makes, (xx, xy, yy) [1/kg]."""
    if shaping is None:
        return W
    return servo[0].S, 0.0, servo[1].S


def with_feed(form, W, x, y):
    """The mobility with the direct feedthrough of the compensator."""
    if form is None:
        return W
    return W[0] + x, W[1], W[2] + y


def torque_law(links, step, at, tau):
    """The law of a kick under given torques."""
    n, v = 1.0 / step.H, at.v
    ax, ay = arm.handle_velocity((tau[0] - tau[1]) / links[2], tau[1] / links[3], at.u)
    return Law((n, n), (n * v[0] + ax, n * v[1] + ay), (ax, ay), at.W)


def solve(law, load):
    """n u = a + W (f - d u): the velocity u after a kick (x, y) [m/s]."""
    (nx, ny), (ax, ay), (xx, xy, yy), (fx, fy) = law.n, law.a, law.W, load.f
    dx, dy, dz = load.d
    gx, gy = ax + xx * fx + xy * fy, ay + xy * fx + yy * fy
    a, b = nx + xx * dx + xy * dz, xx * dz + xy * dy
    c, e = xy * dx + yy * dz, ny + xy * dz + yy * dy
    r = c / a
    uy = (gy - r * gx) / (e - r * b)
    return (gx - b * uy) / a, uy


def net(load, u, r):
    """Net force of a kick, (x, y) [N]."""
    f, d = load.f, load.d
    return f[0] - r[0] - d[0] * u[0] - d[2] * u[1], f[1] - r[1] - d[1] * u[1] - d[2] * u[0]


def added(load, f, d):
    """The load with a force (x, y) and damping (xx, yy, xy)."""
    a, b = load.f, load.d
    return Load((a[0] + f[0], a[1] + f[1]), (b[0] + d[0], b[1] + d[1], b[2] + d[2]))


def taken(before, after, u):
    """Force that a load gains from one to another, against the motion, (x, y) [N]."""
    a, b = net(before, u, (0.0, 0.0)), net(after, u, (0.0, 0.0))
    return a[0] - b[0], a[1] - b[1]
