"""The operator's arm, fh = uh - Th p."""


def load(m, k):
    """Adds it to the load of a kick."""
    if m.spring_uses_longer_step or not (k.before > 0.0 and k.after > 0.0):
        h = max(k.before, k.after)  # at the start and the end the kick is half of one
    else:
        h = k.H
    for i in range(m.axes):
        a, o = m.axis[i], k.axis[i]
        mass = a.mass + 0.25 * a.spring * h * h
        o.f -= a.spring * o.p - mass * o.c + (a.damper * k.L - mass / k.H) * o.v
        o.d += a.damper * k.R + mass / k.H


def resistance(m, p, v, c, i):
    """Resisting force of an axis at an instant, without its acceleration along the way [N]."""
    a = m.axis[i]
    return a.spring * p - a.mass * c + a.damper * v


def damping_force(m, k, i):
    """Force of the damper of an axis in a kick, as `load` counts it [N]."""
    o = k.axis[i]
    return m.axis[i].damper * (k.L * o.v + k.R * o.u)


def force(m, k, i):
    """Mean force of the operator in a kick [N]."""
    o = k.axis[i]
    return o.net + o.fe if m.hand else o.uh
