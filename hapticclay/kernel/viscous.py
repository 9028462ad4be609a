"""Viscous clay: constant, growing, with rotated axes, smooth, stiff."""

from ..formulas import arm as arm_law
from ..formulas import controller, regions
from ..formulas import damping as law


def damp(m, s, k):
    """Damping of the clay in a kick, and how stiff clay splits it."""
    x, y, zx, zy = k.x, k.y, s.x, s.y
    b0, b1 = (zx.old, zy.old), (zx.b, zy.b)
    if m.grows:
        b0 = law.damping_at(b0, (zx.old_rate, zy.old_rate), s.t - 0.25 * k.before)
        b1 = law.damping_at(b1, (zx.b_rate, zy.b_rate), s.t + 0.25 * k.after)
    if m.stiff:
        x.b0, x.b1, y.b0, y.b1, k.splits, x.share, y.share, x.soft, y.soft = law.split_damping(
            b0, b1, k.H, k.L, k.R, m.mobility, m.x.damper, m.y.damper
        )
    else:
        x.b0, y.b0, x.b1, y.b1 = k.L * b0[0], k.L * b0[1], k.R * b1[0], k.R * b1[1]


def load(m, k):
    """Load of a kick by the muscle and the damping."""
    x, y = k.x, k.y
    if m.rotated:
        c, s = m.cosine, m.sine
        x.clay, y.clay = law.rotated_force(c, s, x.b0, y.b0, x.v, y.v)
        x.clay_d, y.clay_d, k.clay_dxy = law.rotated_damping(c, s, x.b1, y.b1)
    else:
        x.clay, y.clay = x.b0 * x.v, y.b0 * y.v
        x.clay_d, y.clay_d = x.b1, y.b1
    x.f, x.d, y.f, y.d = x.uh - x.clay, x.clay_d, y.uh - y.clay, y.clay_d
    k.dxy = k.clay_dxy


# ---- at an instant -------------------------------------------------------------------------------


def damping(m, s, i, before):
    """Damping of an axis at a sample, of the present clay or of that before it [N.s/m]."""
    z = s.axis[i]
    b = z.old if before else z.b
    if m.grows:
        b, _ = law.damping_at((b, 0.0), (z.old_rate if before else z.b_rate, 0.0), s.t)
    return b


def damping_at_place(m, s, t, px, py):
    """Damping at a time and a place of its region, (x, y) [N.s/m]."""
    b = s.x.b, s.y.b
    if m.grows:
        b = law.damping_at(b, (s.x.b_rate, s.y.b_rate), t)
    if m.smooth:
        b = regions.smooth_clay(m.table, m.smooth, px, py, b[0], b[1])
    return b


def force(m, bx, by, vx, vy):
    """Force of damping along the axes of the clay, (x, y) [N]."""
    if m.rotated:
        return law.rotated_force(m.cosine, m.sine, bx, by, vx, vy)
    return bx * vx, by * vy


# ---- after a step --------------------------------------------------------------------------------


def age(s):
    """Makes the present clay that before the next sample."""
    for i in range(2):
        z = s.axis[i]
        z.old, z.old_rate = z.b, z.b_rate


def smoothed(m, s, px, py):
    """Puts the damping of smooth clay at the handle into the state."""
    zx, zy = s.x, s.y
    zx.b, zy.b = regions.smooth_clay(m.table, m.smooth, px, py, zx.b, zy.b)
    if m.smooth != 2:
        zx.old, zx.old_rate = zx.b, 0.0
    if m.smooth != 1:
        zy.old, zy.old_rate = zy.b, 0.0


# ---- along the axes along which the clay yields --------------------------------------------------


def along(m, x, y):
    """Components along the axes along which the clay yields."""
    if m.yields_rotated:
        return controller.along_axes(m.cosine, m.sine, x, y)
    return x, y


def across(m, x, y):
    """The inverse of `along`."""
    if m.yields_rotated:
        return controller.along_axes(m.cosine, -m.sine, x, y)
    return x, y


def rotated_matrix(m, B):
    """A matrix along these axes, R' B R."""
    if not m.yields_rotated:
        return B
    xx, yx = along(m, B[0], B[2])
    xy, yy = along(m, B[1], B[3])
    first, second = along(m, xx, xy), along(m, yx, yy)
    return first[0], first[1], second[0], second[1]


# ---- so stiff that a step overshoots -------------------------------------------------------------


def rest_after_sample(k):
    """Straightens the path of a handle that comes to rest at the sample in stiff clay."""
    x, y = k.x, k.y
    vx, vy = 0.0 if x.share > 0.0 else x.v, 0.0 if y.share > 0.0 else y.v
    x.c, y.c = arm_law.centripetal_about_sample(k.L, x.c, y.c, vx, vy, k.u)


def slow_force(m, k):
    """Force of stiff clay in slow motion, (x, y) [N]."""
    x, y = k.x, k.y
    hx, hy = x.uh - m.x.spring * x.p - x.pull, y.uh - m.y.spring * y.p - y.pull
    gx, gy = x.rest + k.Sxx * hx + k.Sxy * hy, y.rest + k.Sxy * hx + k.Syy * hy
    f = (x.b0 + x.b1) * x.v, (y.b0 + y.b1) * y.v
    return law.slow_force((gx, gy), (k.Sxx, k.Sxy, k.Syy), (x.share, y.share), f)


def velocity_over(o, slow):
    """Velocity at the sample [m/s]; in stiff clay its mean force over its damping."""
    if o.soft > 0.0:
        return o.soft * (o.b0 * o.v + o.b1 * o.u + o.back)
    return slow
