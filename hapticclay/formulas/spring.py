"""Springs of the clay: one that yields, one that relaxes."""

import math


def spring_step(k, limit, way, rest, p):
    """Advances a spring that gives way after a motion of the handle to p [m].

    k: stiffness [N/m]; limit: force at which it gives way [N]; way: direction of the push on a
    surface, 1.0 or -1.0, or 0.0 if it is no surface; rest: rest position before [m]. Rest position,
    force [N], energy stored, energy lost since [J].
    """
    if k <= 0.0:
        return rest, 0.0, 0.0, 0.0
    e, most, lost = p - rest, limit / k, 0.0
    if e > most and way >= 0.0:
        lost = limit * (e - most)
        rest, e = p - most, most
    elif e < -most and way <= 0.0:
        lost = limit * (-most - e)
        rest, e = p + most, -most
    if way * e < 0.0:
        e = 0.0
    return rest, k * e, 0.5 * k * e * e, lost


def relaxing_step(k, tau, way, z, dp, h):
    """Advances a spring in series with a damper (Maxwell) over a uniform motion dp [m]: exact.

    tau: relaxation time [s]; way: as in `spring_step`; z: elongation before [m]; h: duration [s].
    Elongation, force [N], energy stored, energy lost since [J].
    """
    if k <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    lost, new = 0.0, z
    if h > 0.0:
        x = h / tau
        new = z * math.exp(-x) - dp * math.expm1(-x) / x
        # work less what is stored: the time integral of z is tau (dp - change of z)
        lost = k * (dp / x * (dp - (new - z)) - 0.5 * (new * new - z * z))
        if way * new < 0.0:  # the handle has left it
            lost, new = 0.5 * k * abs(z) * max(0.0, abs(z) - abs(dp)), 0.0
    return new, k * new, 0.5 * k * new * new, max(lost, 0.0)
