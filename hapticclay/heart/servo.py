"""What drives the handle in a kick: the continuous law of compensator and servo, or given torques."""

from __future__ import annotations

from ..model import arm, compensator, controller
from .state import Axis, Law, Load

# ---- the compensator ---------------------------------------------------------------------------


class Shown:
    """Place of numbers in the tuple of `shown`."""

    DELTA, FEED = 0, 1


def ready_form(form, step):
    """Works out compensator.form_kick for the steps around a sample, unless it is ready."""
    if form is None:
        return
    k, n = form.kick, 2 * compensator.KICK
    if k[n] != step.before or k[n + 1] != step.after:
        for i in range(2):
            compensator.form_kick(
                form.numbers, form.order, i, step.before, step.after, form.work, k
            )
        k[n], k[n + 1] = step.before, step.after


def shown(form, i, z, states):
    """Output at the sample without the force of the kick [m], and what each unit adds [m/N]."""
    if form is None:
        return z.delta, 0.0
    k, o = form.kick, compensator.KICK * i
    a, b, c, d = states[i]
    out = k[o] * a + k[o + 1] * b + k[o + 2] * c + k[o + 3] * d
    return z.delta + out, form.gain[i] * k[o + compensator.FEED]


def advanced(lag, form, i, servo, step, z, yrate, f):
    """Compensator output, rate and reference of one axis behind the step after the kick."""
    y = z.y + step.after * yrate
    if form is not None:
        return Axis(z.delta, 0.0, y, yrate)
    keep, take = controller.compensator_coefficients(lag[i].pole, step.H, step.L, step.R)
    rate = keep * z.rate + take * lag[i].K * f
    return Axis(z.delta + step.after * rate, rate, y, yrate)


def states_after(form, states, f):
    """States of compensators of another shape after the kick."""
    if form is None:
        return states
    return state_after(form, 0, states[0], f[0]), state_after(form, 1, states[1], f[1])


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


# ---- the continuous law --------------------------------------------------------------------------


def servo_mobility(shaping, servo, W):
    """Acceleration per unit of net force that the servo makes, (xx, xy, yy) [1/kg]."""
    if shaping is None:
        return W
    return servo[0].S, 0.0, servo[1].S


def servo_axis(servo, step, z, delta, feed, v, p, c):
    """One axis of the law.

    Returns:
        Weight n [1/s], acceleration without forces, the same of a handle at rest [m/s^2]; rate of
        the reference without the force of the kick [m/s], what each unit of it adds to that and to
        the acceleration.
    """
    keep, take, after, before, spring = controller.servo_coefficients(
        servo, step.H, step.L, step.R
    )
    yrate = keep * z.yrate + take * (servo.ratio * delta - z.y)
    a = controller.servo_acceleration(after, before, spring, yrate, z.yrate, v, z.y, p, c)
    push = take * servo.ratio * feed
    return after, a, a - before * v, yrate, push, after * push


def with_feed(form, W, x, y):
    """The mobility with what the force of the kick adds by way of the compensator."""
    if form is None:
        return W
    return W[0] + x, W[1], W[2] + y


def servo_law(parts, step, pose, v, c, x, y):
    """The continuous law of a kick, from what `servo_axis` returns."""
    W = servo_mobility(parts.shaping, parts.servo, pose.W)
    return Law((x[0], y[0]), (x[1], y[1]), (x[2], y[2]), with_feed(parts.form, W, x[5], y[5]))


def torque_law(links, step, pose, v, tau):
    """The law of a kick under given torques."""
    n = 1.0 / step.H
    ax, ay = arm.handle_velocity((tau[0] - tau[1]) / links[2], tau[1] / links[3], pose.u)
    return Law((n, n), (n * v[0] + ax, n * v[1] + ay), (ax, ay), pose.W)


def solve(law, load):
    """n u = a + W (f - D u): the velocity u after a kick (x, y) [m/s]."""
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
    """The load with a force (x, y) and damping (x, y)."""
    a, b = load.f, load.d
    return Load((a[0] + f[0], a[1] + f[1]), (b[0] + d[0], b[1] + d[1], b[2]))
