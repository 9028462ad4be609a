"""Energy that is stored in arm and hand."""

from . import arm, methods


def kinetic(m, s):
    """Energy of the arm after the last kick [J]."""
    r2 = s.w1 + s.w2
    return 0.5 * (m.links[2] * s.w1 * s.w1 + m.links[3] * r2 * r2)


def of_hand(m, s):
    """Energy of mass and spring of the operator's arm after the last kick [J]."""
    h = 0.0 if m.method == methods.ACCURATE else s.before
    k, a, b = s.e, m.x, m.y
    arm.handle_at(m, k, s.q1 - h * s.w1, s.q2 - h * s.w2, s.w1, s.w1 + s.w2)  # where that was
    x, y = k.x, k.y
    moving = a.mass * x.v * x.v + b.mass * y.v * y.v
    return 0.5 * (moving + a.spring * x.p * x.p + b.spring * y.p * y.p)
