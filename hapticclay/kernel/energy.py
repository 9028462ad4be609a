"""Energy that is stored in arm and hand."""

from . import arm, methods


def kinetic(m, s):
    """Energy of the arm after the last kick [J]."""
    r2 = s.w[0] + s.w[1]
    return 0.5 * (m.links[2] * s.w[0] * s.w[0] + m.links[3] * r2 * r2)


def of_hand(m, s):
    """Energy of mass and spring of the operator's arm after the last kick [J]."""
    h = 0.0 if m.method == methods.ACCURATE else s.before
    k, a, b = s.e, m.x, m.y
    arm.handle_at(
        m, k, s.q[0] - h * s.w[0], s.q[1] - h * s.w[1], s.w[0], s.w[0] + s.w[1]
    )  # where that was
    x, y = k.x, k.y
    moving = a.mass * x.v * x.v + b.mass * y.v * y.v
    return 0.5 * (moving + a.spring * x.p * x.p + b.spring * y.p * y.p)
