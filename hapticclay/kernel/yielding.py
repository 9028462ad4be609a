"""Clay that yields in a kick: how it resists, and whether it holds the handle."""

import math

from ..formulas import controller, numbers, regions
from ..formulas import flow as law
from . import groove, viscous

LINE = 1e-12  # share of its determinant that the mobility of a handle in a plane has at least
TRACE = 1e-9  # share of its mobility that a handle on a line gets across it


def law_now(m, s, k, i, speed):
    """Fy, K, n of an axis; half a step of other clay before it counts as steady force."""
    z = s.axis[i]
    if is_same(s):
        return z.Fy, z.Kn, z.n
    R = 1.0 - k.L
    old = law.moving_force(z.old_Fy, z.old_Kn, z.old_n, speed)
    return k.L * old + R * z.Fy, R * z.Kn, z.n


def is_same(s):
    """Whether the clay before the sample yields by the same law."""
    for i in range(2):
        z = s.axis[i]
        if z.Fy != z.old_Fy or z.Kn != z.old_Kn or z.n != z.old_n:
            return False
    return True


def laws_now(m, s, k, vx, vy):
    """Fy, K, n of x and of y in a kick, at a velocity along the axes of the clay."""
    x, y = abs(vx), abs(vy)
    if m.flow == 2:
        x = y = math.sqrt(vx * vx + vy * vy)
    a, b, c = law_now(m, s, k, 0, x)
    d, e, f = law_now(m, s, k, 1, y)
    return a, b, c, d, e, f


def laws_in_kick(m, s, k, B, vx, vy, ux, uy):
    """The same of clay that stays cut too: along the motion, or along the push at rest."""
    if not m.groove:
        return laws_now(m, s, k, vx, vy)
    x, y = vx, vy
    if (k.x.stuck0 > 0.0 and k.y.stuck0 > 0.0) or (x == 0.0 and y == 0.0):
        x, y = B[3] * ux - B[1] * uy, B[0] * uy - B[2] * ux
    return groove.laws_along(m, x, y)


def laws_of_motion(m, s, vx, vy):
    """Fy, K, n of x and of y now, for a handle that moves."""
    if m.groove:
        return groove.laws_along(m, vx, vy)
    x, y = s.x, s.y
    return x.Fy, x.Kn, x.n, y.Fy, y.Kn, y.n


def resist_by(m, B, v, end, fyk, L):
    """Mean force, velocity after, velocity and force at the sample, stops; a pair each."""
    if m.flow == 2:
        return law.resist_along(B, v, end, fyk, L)
    return law.resist_axes(B, v, end, fyk, L)


def of_plane(B):
    """A velocity per force; of a handle that moves on a line alone with a trace of one across it.

    Nothing pushes across, where it so stays at rest.
    """
    size = B[0] + B[3]
    if B[0] * B[3] - B[1] * B[2] > LINE * size * size:
        return B
    return B[0] + TRACE * B[3], (1.0 - TRACE) * B[1], (1.0 - TRACE) * B[2], B[3] + TRACE * B[0]


def flows_freely(m, s):
    """Whether the clay around a kick does not yield."""
    if m.groove:
        return False
    x, y = s.x, s.y
    return x.Fy + x.Kn + y.Fy + y.Kn + x.old_Fy + x.old_Kn + y.old_Fy + y.old_Kn == 0.0


def resist(m, s, k):
    """The velocity after the kick, and what the clay did."""
    x, y = k.x, k.y
    if flows_freely(m, s):
        flow_on(k)
        return
    # a straight step in the joints bends the path of the handle: its mean velocities are these
    lead, on = k.H * k.L, k.H * (1.0 - k.L)
    ax, ay = viscous.along(m, x.v + lead * x.c, y.v + lead * y.c)
    ux, uy = x.u - on * x.c, y.u - on * y.c
    B = controller.velocity_per_force((x.n, y.n), (k.Sxx, k.Sxy, k.Syy), (x.d, y.d, k.dxy))
    B = of_plane(B)
    ax, ay = 0.0 if x.stuck0 > 0.0 else ax, 0.0 if y.stuck0 > 0.0 else ay
    fyk = laws_in_kick(m, s, k, B, ax, ay, ux, uy)
    B = viscous.rotated_matrix(m, B)
    ex, ey = viscous.along(m, ux, uy)
    px, py = viscous.along(m, x.p, y.p)
    backx, backy = return_velocity(x, px, on), return_velocity(y, py, on)
    rx, ry, wx, wy, sx, sy, fx, fy, stopx, stopy = resist_by(
        m, B, (ax, ay), (ex - backx, ey - backy), fyk, k.L
    )
    k.still = 1.0 if wx == 0.0 and wy == 0.0 else 0.0
    if k.still > 0.0:  # the force that does it
        qx, qy = viscous.along(m, x.u, y.u)
        det = B[0] * B[3] - B[1] * B[2]
        rx, ry = (
            numbers.ratio(B[3] * qx - B[1] * qy, det),
            numbers.ratio(B[0] * qy - B[2] * qx, det),
        )
        x.u = y.u = 0.0
    else:
        ux, uy = viscous.across(m, wx + backx, wy + backy)
        x.u, y.u = ux + on * x.c, uy + on * y.c
    x.mean, y.mean = viscous.across(m, rx, ry)
    x.sv, y.sv = viscous.across(m, sx, sy)
    x.sf, y.sf = viscous.across(m, fx, fy)
    settle(k, x, px, wx, fyk[0], stopx)
    settle(k, y, py, wy, fyk[3], stopy)


def flow_on(k):
    """The kick where nothing yields."""
    for i in range(2):
        o = k.axis[i]
        o.mean, o.sf, o.stuck, o.stop = 0.0, 0.0, 0.0, 0.0
        o.sv, o.anchor = o.v + k.L * (o.u - o.v), math.nan
    k.still = 0.0


def return_velocity(o, place, on):
    """Velocity that returns an axis at rest beside one that slides to its place [m/s]."""
    if on > 0.0 and o.stuck0 > 0.0 and o.anchor0 == o.anchor0:
        return 0.5 * (o.anchor0 - place) / on
    return 0.0


def settle(k, o, place, w, Fy, stop):
    """Whether, where and when an axis rests after the kick."""
    o.stuck = 1.0 if w == 0.0 and Fy > 0.0 else 0.0
    if k.still > 0.0 or o.stuck0 == 0.0 or o.stuck == 0.0:
        o.anchor = math.nan
    elif o.anchor0 != o.anchor0:
        o.anchor = place
    else:
        o.anchor = o.anchor0
    o.stop = k.H * (stop - k.L) if stop >= 0.0 else 0.0


def creeping(m, s, k, gx, gy):
    """The part of a slow force on stiff clay that its damping bears: what yielding leaves of it."""
    if m.groove:
        return gx, gy
    x, y = k.x, k.y
    a, b, c, d, e, f = laws_now(m, s, k, x.v, y.v)
    bx, by, lx, ly = x.b0 + x.b1, y.b0 + y.b1, abs(gx), abs(gy)
    if m.flow == 2:
        lx = ly = math.sqrt(gx * gx + gy * gy)
        bx = by = 0.5 * (bx + by)
    return creep(lx, bx, a, b, c, gx), creep(ly, by, d, e, f, gy)


def creep(size, b, Fy, K, n, g):
    """The same of one axis, where the force has a size of its own."""
    if size > Fy and b > 0.0:  # of what exceeds Fy, b v where b v + K v^n is all of it
        return g / size * b * law.thinned((size - Fy) / b, K / b, n)
    return 0.0


def velocity(m, k, i):
    """Velocity of an axis at the sample [m/s]: none against the force that holds the handle."""
    v = sample_velocity(m, k, i)
    if m.rotated:
        return v
    work = v * k.axis[i].sf
    if m.flow == 2:
        work = sample_velocity(m, k, 0) * k.x.sf + sample_velocity(m, k, 1) * k.y.sf
    return 0.0 if work < 0.0 else v


def sample_velocity(m, k, i):
    """The same, whatever the force."""
    o = k.axis[i]
    if m.stiff and o.soft > 0.0 and o.sv != 0.0:
        return viscous.velocity_over(o, 0.0)
    return o.sv


def enter(m, s):
    """The law of a region."""
    for i in range(2):
        z = s.axis[i]
        z.Fy, z.Kn, z.n = regions.enter_flow(m.table, i, s.x.index, s.y.index)


def age(s):
    """Makes the present clay that before the next sample."""
    for i in range(2):
        z = s.axis[i]
        z.old_Fy, z.old_Kn, z.old_n = z.Fy, z.Kn, z.n


def note(m, s, k):
    """Notes where the clay stops or releases the handle in a kick."""
    for i in range(1 if m.flow == 2 else 2):
        o = k.axis[i]
        if o.stuck != o.stuck0:
            note_stop(m, s, 2.0 if m.flow == 2 else 1.0 * i, o.stuck, o.stop)


def note_stop(m, s, axis, starts, after):
    """Notes a stop that starts some time after now, or ends now."""
    stops, n = m.stops, 3 * s.stopped
    stops[n], stops[n + 1] = axis, starts
    stops[n + 2] = s.t + after if starts > 0.0 else s.t
    s.stopped += 1
