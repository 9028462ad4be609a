"""Damping of clay in time steps: split over a kick, on rotated axes, growing with time."""

from . import constants, numbers


def halved_damping(b0, b1, L, R):
    """Damping in a kick of clay soft enough not to overshoot: half of each step's damping.

    On the velocity before the kick, and on that after it, (x, y) each [N.s/m].
    """
    return (L * b0[0], L * b0[1]), (R * b1[0], R * b1[1])


def split_damping(b0, b1, H, L, R, W, damperx, dampery):
    """Splits the damping of the clay in one kick between the velocities before and after it.

    A step gives half of its damping to the kick before it and half to the kick after it:
    Crank-Nicolson, second order. If the half that acts on the velocity before the kick would
    overshoot, b h W > 2, it is reduced to the value that just stops the handle. The kick before the
    step takes the rest. The two parts sum to b h, so the impulse of a step is exactly b times its
    distance. `slow_force` corrects the effect of the uneven split on slow motion.

    b0, b1: damping before and after the sample, (x, y) [N.s/m]; H: length of the kick [s]; L, R:
    its shares before and after the sample; W: largest acceleration per unit of force over all
    directions [1/kg]; damperx, dampery: of the operator's arm [N.s/m].

    (x0, x1, y0, y1, stiff, sharex, sharey, softx, softy): fe = x0 v- + x1 v+ on x, y0 and y1 on y
    [N.s/m]; in stiff clay, fe is less by share times `slow_force`, which the next kick returns.
    stiff: 1.0 if any part is reduced, else 0.0. soft: 1/b [m/(N.s)] where both steps are stiff.
    """
    most = 1.0 / (H * W)
    before, after = halved_damping(b0, b1, L, R)
    x0, y0 = before
    x1, y1 = after
    stiff, sharex, sharey, softx, softy = 0.0, 0.0, 0.0, 0.0, 0.0
    if x0 > most or y0 > most or x1 > most or y1 > most:
        stiff = 1.0
        if x1 > most:
            sharex = (x1 - most) / (b1[0] + damperx)
            softx = 1.0 / b1[0] if x0 > most else 0.0
            x1 += x1 - most
        if y1 > most:
            sharey = (y1 - most) / (b1[1] + dampery)
            softy = 1.0 / b1[1] if y0 > most else 0.0
            y1 += y1 - most
        x0, y0 = min(x0, most), min(y0, most)
    return x0, x1, y0, y1, stiff, sharex, sharey, softx, softy


def slow_force(g, W, share, f):
    """Force of stiff clay on a handle in slow motion, when only the clay supports it, (x, y) [N].

    g: acceleration of the handle without clay [m/s^2]; W: (xx, xy, yy) [1/kg]; share: from
    `split_damping`, nonzero where the clay is stiff; f: force where it is not [N].
    """
    gx, gy = g
    xx, xy, yy = W
    if share[0] and share[1]:
        det = xx * yy - xy * xy
        x = numbers.ratio(yy * gx - xy * gy, det)
        y = numbers.ratio(xx * gy - xy * gx, det)
    else:
        x = numbers.ratio(gx - xy * f[1], xx)
        y = numbers.ratio(gy - xy * f[0], yy)
    return x, y


def rotated_force(c, s, bx, by, vx, vy):
    """Force of clay with rotated axes, fe = R diag(bx, by) R' v, (x, y) [N]."""
    first, second = bx * (c * vx + s * vy), by * (c * vy - s * vx)
    return c * first - s * second, s * first + c * second


def rotated_damping(c, s, bx, by):
    """The damping tensor of clay with rotated axes, R diag(bx, by) R': (xx, yy, xy) [N.s/m]."""
    return c * c * bx + s * s * by, s * s * bx + c * c * by, c * s * (bx - by)


def damping_at(base, rate, t):
    """Damping at a time t [s], b = base + rate t, at most B_MAX, (x, y) [N.s/m]."""
    x, y = base
    if rate[0] or rate[1]:
        x, y = min(x + rate[0] * t, constants.B_MAX), min(y + rate[1] * t, constants.B_MAX)
    return x, y
