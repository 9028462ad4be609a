"""How yielding clay holds or resists the handle within a step of the accurate method.

Within a step each axis of the clay keeps its mode. It slides with a fixed sign of its velocity, or
it rests under the force that keeps it there. Clay that resists along the motion lets the handle
slide or rest as a whole. Where a mode ends, a step ends (`ends`).

Near rest the law has no derivative: the direction of the force turns, or K v^n becomes steep. Steps
there are shares of the speed (GRADE), so that a stop takes some hundred steps, however steep.
"""

from __future__ import annotations

import math

from ..model import arm, controller, flow
from . import viscous
from .kick import place
from .parts import INF
from .servo import net, solve
from .state import Grip, Handle, Modes, Point, Response
from .yielding import rotated_matrix

STABLE_STEP = 0.5  # fastest rate times step up to which an explicit step is trusted
SUBSTEPS = 1000  # most substeps of one sample
GRADE = 0.1  # of the speed: its most change in a step where the law has no derivative at rest
TURN = 0.25  # rate at which the clay turns the velocity, times step
REST = 1e-9  # of dt: time that an axis would still take to come to rest, and rests; shortest step
# of dt: shortest step against the force that turns a slow handle into its direction; a slower one
# has this direction
TURNING = 1.0 / 200.0
CALM = 0.2  # of the acceleration that turns it: that of a slow handle along its direction, at most
ALIGNED = 1e-5  # the same, across it; nearly the angle [rad] from there to this direction
RESTS, FREE = 1.0, 2.0  # ends of a mode; -FREE towards -
REST_MODE, SLIDING, TURNED_IN = 0.0, 1.0, 2.0  # modes of clay along the motion
NONE = (0.0, 0.0)


# ---- the law -------------------------------------------------------------------------------------


def is_active(law, i):
    """Whether the clay of an axis yields."""
    return law[3 * i] > 0.0 or law[3 * i + 1] > 0.0


def strength(law, i, m):
    """Force of an axis that slides at m, Fy + K m^n [N]; odd in its second part."""
    Fy, K, n = law[3 * i], law[3 * i + 1], law[3 * i + 2]
    if K <= 0.0 or m == 0.0:
        return Fy
    return Fy + math.copysign(flow.moving_force(0.0, K, n, abs(m)), m)


def steepness(law, i, m):
    """How fast that force grows with the speed, n K m^(n - 1) [N.s/m]."""
    K, n = law[3 * i + 1], law[3 * i + 2]
    return K * n * m ** (n - 1.0) if K > 0.0 and m > 0.0 else 0.0


def is_rough(law, i):
    """Whether the force of an axis has no Taylor series at rest."""
    n = law[3 * i + 2]
    return law[3 * i + 1] > 0.0 and n != math.floor(n)


def creep_speed(mobility, dt, K, n):
    """Speed below which clay of n < 1 is too stiff for SUBSTEPS a sample [m/s]; else 0."""
    if K <= 0.0 or n >= 1.0:
        return 0.0
    return (dt * mobility * K * n / (SUBSTEPS * STABLE_STEP)) ** (1.0 / (1.0 - n))


def slowest(modal, law, i):
    """As `creep_speed`, of an axis."""
    return creep_speed(modal.mobility, modal.dt, law[3 * i + 1], law[3 * i + 2])


def holding_force(modal, law, i):
    """The most force that holds an axis [N]: Fy, and that of a creep too slow to be followed."""
    return strength(law, i, slowest(modal, law, i))


# ---- the state -----------------------------------------------------------------------------------


def with_mode(m, x, y):
    return Modes(m.law, (x, y), m.way, m.anchor, m.ended, m.ends, m.stuck, m.fine)


def with_way(m, x, way):
    return Modes(m.law, (x, x), way, m.anchor, m.ended, m.ends, m.stuck, m.fine)


# ---- at an instant -------------------------------------------------------------------------------


def has_mode(modes, rests):
    """Whether an axis, or each axis, rests.

    Args:
        rests: 2 tests for each axis, another number for any axis.
    """
    if modes is None:
        return False
    x, y = modes.mode
    return (x == 0.0 and y == 0.0) if rests == 2 else (x == 0.0 or y == 0.0)


def without_rest(modes, modal, at):
    """The handle with zero velocity along an axis that rests."""
    if modes is None:
        return at
    (sx, sy), (x, y) = modes.mode, viscous.along(modal.grain, at.v[0], at.v[1])
    v = viscous.across(modal.grain, 0.0 if sx == 0.0 else x, 0.0 if sy == 0.0 else y)
    return Handle(at.u, at.p, at.W, v, at.c)


def plain_answer(law, load):
    """Response of the handle to a load, by a law at an instant, where nothing yields."""
    g = solve(law, load)
    return Response(g, net(load, g, NONE), NONE, None)


def answer(modal, modes, law, load, at):
    """The same in any clay, in the modes of the step."""
    if modal is None:
        return plain_answer(law, load)
    grain, c, g = modal.grain, at.c, solve(law, load)
    B = rotated_matrix(grain, controller.velocity_per_force(law.n, law.W, load.d))
    v = viscous.along(grain, at.v[0], at.v[1])
    a = viscous.along(grain, g[0] - c[0], g[1] - c[1])
    if modes.mode[0] == 0.0 and modes.mode[1] == 0.0:
        f, left = holding(B, a), NONE
    else:
        f, left = resisting(modal.along, modes, B, v, a)
    r, left = viscous.across(grain, f[0], f[1]), viscous.across(grain, left[0], left[1])
    g = left[0] + c[0], left[1] + c[1]
    return Response(g, net(load, g, r), r, Grip(a, B, v, f))


def holding(B, a):
    """The force that cancels an acceleration, (x, y) [N]."""
    xx, xy, yx, yy = B
    det = xx * yy - xy * yx
    return (yy * a[0] - xy * a[1]) / det, (xx * a[1] - yx * a[0]) / det


def left_of(a, B, f):
    """The acceleration that remains under a force, (x, y) [m/s^2]."""
    return a[0] - B[0] * f[0] - B[1] * f[1], a[1] - B[2] * f[0] - B[3] * f[1]


def resisting(along, modes, B, v, a):
    """Force of clay in which the handle slides [N], and the remaining acceleration [m/s^2]."""
    if along is None:
        return resisting_axes(modes, B, v, a)
    return resisting_along(modes, B, v, a)


def resisting_axes(modes, B, v, a):
    (sx, sy), law = modes.mode, modes.law
    fx, fy = sx * strength(law, 0, sx * v[0]), sy * strength(law, 1, sy * v[1])
    if sx == 0.0:
        fx = (a[0] - B[1] * fy) / B[0]
    elif sy == 0.0:
        fy = (a[1] - B[2] * fx) / B[3]
    x, y = left_of(a, B, (fx, fy))
    return (fx, fy), (0.0 if sx == 0.0 else x, 0.0 if sy == 0.0 else y)


def resisting_along(modes, B, v, a):
    law, slides = modes.law, modes.mode[0] == SLIDING
    m, (ex, ey) = v[0] * modes.way[0] + v[1] * modes.way[1], modes.way
    if slides:
        m, (ex, ey) = way_of(modes, v)
    f = strength(law, 0, m)
    f = f * ex, f * ey
    g = left_of(a, B, f)
    if slides:
        return f, g
    side = (ex * g[1] - ey * g[0]) / across(B, (ex, ey))  # a transverse force keeps it on its path
    x, y = left_of(g, B, (-side * ey, side * ex))
    size = x * ex + y * ey
    return (f[0] - side * ey, f[1] + side * ex), (size * ex, size * ey)


def way_of(modes, v):
    """Speed along the motion [m/s], and its direction; at rest, the way of the modes."""
    m = math.sqrt(v[0] * v[0] + v[1] * v[1])
    if m > 0.0:
        return m, (v[0] / m, v[1] / m)
    return m, modes.way


def across(B, e):
    """Acceleration across a direction per unit of force across it [1/kg]."""
    ex, ey = e
    return ey * ey * B[0] - ex * ey * (B[1] + B[2]) + ex * ex * B[3]


def acceleration(x):
    """Acceleration of the handle that the clay sees, along the axes of the clay [m/s^2]."""
    return left_of(x.a, x.B, x.f)


# ---- along the axes of the clay ------------------------------------------------------------------


def velocity(modal, part, q, w):
    """Velocity of the handle [m/s]."""
    v = arm.handle_velocity(w[0], w[0] + w[1], arm.jacobian(q[0], q[1], part.links))
    return viscous.along(modal.grain, v[0], v[1])


def joint_rates(modal, part, q, v):
    """Joint rates that move the handle at a velocity [rad/s]."""
    x, y = viscous.across(modal.grain, v[0], v[1])
    r1, r2 = arm.joint_velocity(x, y, arm.jacobian(q[0], q[1], part.links), 1.0)
    return r1, r2 - r1


def place_of(modal, part, q):
    """Place of the handle [m]."""
    p = place(part, q)
    return viscous.along(modal.grain, p[0], p[1])


def stopped(modes, i):
    """Whether an axis rests in clay that can bring it to rest, 1.0 or 0.0."""
    Fy, K, n = modes.law[3 * i], modes.law[3 * i + 1], modes.law[3 * i + 2]
    return 1.0 if modes.mode[i] == 0.0 and (Fy > 0.0 or (K > 0.0 and n < 1.0)) else 0.0


def back_to_rest(modes, modal, part, z):
    """A point with a resting axis moved back to its place: one step of Newton's method."""
    if modes is None:
        return z
    (sx, sy), anchor, q = modes.mode, modes.anchor, z.q
    if (sx == 0.0) == (sy == 0.0):
        return z
    (x, y), v = place_of(modal, part, q), velocity(modal, part, q, z.w)
    lead = anchor[0] - x if sx == 0.0 else 0.0, anchor[1] - y if sy == 0.0 else 0.0
    a = joint_rates(modal, part, q, lead)
    q = q[0] + a[0], q[1] + a[1]
    w = joint_rates(modal, part, q, (0.0 if sx == 0.0 else v[0], 0.0 if sy == 0.0 else v[1]))
    return Point(q, w, z.x, z.y, z.form)


# ---- bounds of a step ----------------------------------------------------------------------------


def shortest_step(dt, t):
    """The shortest step that yielding clay requests [s]."""
    return max(REST * dt, 4e-16 * t)  # some roundings of the time


def share_of_speed(share, m, rate):
    """share m / rate; INF for a rate of 0."""
    return share * m / rate if rate > 0.0 else INF


def longest_step(along, modes, x, v):
    """The longest step that yielding clay allows, by its grip, at a velocity v [s]."""
    if along is None:
        return min(longest_of_axis(modes, x, v, 0), longest_of_axis(modes, x, v, 1))
    return longest_along(modes, x, v)


def longest_of_axis(modes, x, v, i):
    law, m = modes.law, abs(v[i])
    if modes.mode[i] == 0.0 or not is_active(law, i):
        return INF
    most = share_of_speed(STABLE_STEP, 1.0, steepness(law, i, m) * x.B[3 * i])
    if is_rough(law, i):
        most = min(most, share_of_speed(GRADE, m, abs(acceleration(x)[i])))
    return most


def longest_along(modes, x, v):
    law = modes.law
    if modes.mode[0] == REST_MODE or not is_active(law, 0):
        return INF
    (m, e), B, slides = way_of(modes, v), x.B, modes.mode[0] == SLIDING
    most = share_of_speed(STABLE_STEP, 1.0, steepness(law, 0, m) * max(B[0], B[3]))
    if slides:
        most = min(most, share_of_speed(TURN, m, strength(law, 0, m) * across(B, e)))
    if slides or is_rough(law, 0):
        ax, ay = acceleration(x)
        most = min(most, share_of_speed(GRADE, m, math.sqrt(ax * ax + ay * ay)))
    return most


def goes_on(modal, modes, h, v, begin, x):
    """Whether a step keeps its modes to its end, and the next may be as long: a cheap test.

    Args:
        modal: the part.
        modes: of the step.
        h: its length [s].
        v: velocity at its end [m/s].
        begin: force of yielding at its start [N].
        x: what the clay does at its last stage.
    """
    return stays(modal.along, modal, modes, v, begin, x.f) and (
        longest_step(modal.along, modes, x, v) >= h
    )


def stays(along, modal, modes, v, begin, f):
    """Whether no mode ends; begin, f: force at the start and at the last stage [N]."""
    if along is None:
        return axis_stays(modal, modes, v, begin, f, 0) and axis_stays(modal, modes, v, begin, f, 1)
    if modes.mode[0] != REST_MODE:
        return True
    # the last stage is not quite the end: by half of the change more
    x, y = 1.5 * f[0] - 0.5 * begin[0], 1.5 * f[1] - 0.5 * begin[1]
    most = holding_force(modal, modes.law, 0)
    return x * x + y * y <= most * most


def axis_stays(modal, modes, v, begin, f, i):
    s, f = modes.mode[i], f[i]
    if not is_active(modes.law, i):
        return True
    if s == 0.0:
        return abs(f) + 0.5 * abs(f - begin[i]) <= holding_force(modal, modes.law, i)
    return s * v[i] > 0.0


def gap(along, modal, modes, x, i):
    """Margin until a mode ends, negative beyond; i: the axis, 0 along the motion."""
    if along is None:
        v, f = modes.mode[i] * x.v[i], abs(x.f[i])
        return gap_of_hold(holding_force(modal, modes.law, i), f) if modes.mode[i] == 0.0 else v
    if modes.mode[0] == REST_MODE:
        f = math.sqrt(x.f[0] * x.f[0] + x.f[1] * x.f[1])
        return gap_of_hold(holding_force(modal, modes.law, 0), f)
    return modes.way[0] * x.v[0] + modes.way[1] * x.v[1]


def gap_of_hold(most, f):
    """Margin of the force that holds, as `gap`.

    Args:
        most: the largest force that the clay bears [N].
    """
    return (most - f) / (1.0 + most)


# ---- what a mode demands -------------------------------------------------------------------------


def misfit(modal, modes, x, i):
    """How far an axis without velocity violates its mode, 0 or less where it does not."""
    s, law = modes.mode[i], modes.law
    if s == 0.0:
        f = holding_force(modal, law, i)
        return (abs(x.f[i]) - f) / (1e-12 + f)
    a = acceleration(x)[i]
    return -s * a / (abs(a) + abs(x.a[i]) + 1e-12)


def is_nearly_at_rest(along, modal, law, x, i):
    """Whether an axis that slides, or a handle in clay along the motion, counts as at rest."""
    if along is None:
        v, a, j = x.v[i], acceleration(x)[i], 1 - i
        # without it, the other axis as it is
        need = abs(x.a[i] - x.B[2 * i + j] * x.f[j]) / x.B[3 * i]
        return nearly_rests(modal, law, i, abs(v), v * a, abs(a), need)
    (vx, vy), (ax, ay), (hx, hy) = x.v, acceleration(x), holding(x.B, x.a)
    m, size = math.sqrt(vx * vx + vy * vy), math.sqrt(ax * ax + ay * ay)
    need = math.sqrt(hx * hx + hy * hy)
    return nearly_rests(modal, law, 0, m, vx * ax + vy * ay, size, need)


def nearly_rests(modal, law, i, m, forward, size, need):
    """The same for a speed.

    Args:
        modal: the part.
        law: Fy, K, n of x, then of y.
        i: the axis.
        m: its speed [m/s].
        forward: its velocity times its acceleration [m^2/s^3].
        size: of its acceleration [m/s^2].
        need: the force that would hold it [N].
    """
    if m == 0.0 or (forward < 0.0 and m <= 2.0 * REST * modal.dt * size):
        return True
    if m >= slowest(modal, law, i) or forward > 0.0:
        return False
    # no stop, but nearly a steady creep that is too slow to be followed
    return strength(law, i, 0.5 * m) < need <= holding_force(modal, law, i)


def set_out(modes, x):
    """Direction in which a handle at rest begins to slide in clay along the motion."""
    e = flow.slowed(x.B, x.a[0], x.a[1], 1.0, modes.law[0], 0.0, 1.0)
    ex, ey = x.f if e[0] == 0.0 and e[1] == 0.0 else e
    m = math.sqrt(ex * ex + ey * ey)
    if m > 0.0:
        return ex / m, ey / m
    return modes.way


def is_turned_in(dt, law, x, e):
    """Whether a handle is so slow that the clay has turned it into the direction of its push."""
    ex, ey = e
    m, (ax, ay) = x.v[0] * ex + x.v[1] * ey, acceleration(x)
    turns = strength(law, 0, m) * across(x.B, e)
    if abs(ex * ax + ey * ay) > CALM * turns or abs(ex * ay - ey * ax) > ALIGNED * turns:
        return False
    return TURN * m < TURNING * dt * turns


def turned_in(law, x, m, e):
    """That direction, at speed m: the one across which no force is left."""
    f, (ex, ey) = strength(law, 0, m), e
    for _ in range(8):  # Newton's method on the angle
        gx, gy = left_of(x.a, x.B, (f * ex, f * ey))
        slope = ex * gx + ey * gy + f * across(x.B, (ex, ey))
        turn = (ex * gy - ey * gx) / slope if slope > 0.0 else 0.0
        turn = max(-0.5, min(turn, 0.5))
        ex, ey = ex - turn * ey, ey + turn * ex
        size = math.sqrt(ex * ex + ey * ey)
        ex, ey = ex / size, ey / size
        if abs(turn) < 1e-15:
            break
    return ex, ey
