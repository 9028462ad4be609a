"""How yielding clay holds or resists the handle within a step of the accurate method."""

import math

from ..formulas import arm as arm_law
from ..formulas import controller, flow, numbers
from . import arm, servo, viscous

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


# ---- the law -------------------------------------------------------------------------------------


def is_active(s, i):
    """Whether the clay of an axis yields."""
    return s.mode[i].Fy > 0.0 or s.mode[i].Kn > 0.0


def strength(s, i, speed):
    """Force of an axis that slides, Fy + K v^n [N]; odd in its second part."""
    a = s.mode[i]
    if a.Kn <= 0.0 or speed == 0.0:
        return a.Fy
    return a.Fy + math.copysign(flow.moving_force(0.0, a.Kn, a.n, abs(speed)), speed)


def steepness(s, i, speed):
    """How fast that force grows with the speed, n K v^(n - 1) [N.s/m]."""
    a = s.mode[i]
    return a.Kn * a.n * numbers.power(speed, a.n - 1.0) if a.Kn > 0.0 and speed > 0.0 else 0.0


def is_rough(s, i):
    """Whether the force of an axis has no Taylor series at rest."""
    a = s.mode[i]
    return a.Kn > 0.0 and a.n != math.floor(a.n)


def creep_speed(mobility, dt, K, n):
    """Speed below which clay of n < 1 is too stiff for SUBSTEPS a sample [m/s]; else 0."""
    if K <= 0.0 or n >= 1.0:
        return 0.0
    return (dt * mobility * K * n / (SUBSTEPS * STABLE_STEP)) ** (1.0 / (1.0 - n))


def slowest(m, s, i):
    """As `creep_speed`, of an axis."""
    return creep_speed(m.lightness, m.dt, s.mode[i].Kn, s.mode[i].n)


def holding_force(m, s, i):
    """The most force that holds an axis [N]: Fy, and that of a creep too slow to be followed."""
    return strength(s, i, slowest(m, s, i))


# ---- the state -----------------------------------------------------------------------------------


def put(s, x, y):
    """Puts the modes of both axes."""
    s.mode[0].mode, s.mode[1].mode = x, y


def put_way(s, mode, wayx, wayy):
    """Puts the mode along the motion, and its direction."""
    put(s, mode, mode)
    s.mode[0].way, s.mode[1].way = wayx, wayy


def rests_somewhere(s):
    """Whether an axis rests."""
    return s.mode[0].mode == 0.0 or s.mode[1].mode == 0.0


def rests(s):
    """Whether both axes rest."""
    return s.mode[0].mode == 0.0 and s.mode[1].mode == 0.0


def is_stopped(s, i):
    """Whether an axis rests in clay that can bring it to rest, 1.0 or 0.0."""
    a = s.mode[i]
    return 1.0 if a.mode == 0.0 and (a.Fy > 0.0 or (a.Kn > 0.0 and a.n < 1.0)) else 0.0


# ---- along the axes along which the clay yields --------------------------------------------------


def velocity(m, s, q1, q2, w1, w2):
    """Velocity of the handle along these axes [m/s]."""
    arm.handle_at(m, s.e, q1, q2, w1, w1 + w2)
    return viscous.along(m, s.e.x.v, s.e.y.v)


def joint_rates(m, s, q1, q2, vx, vy):
    """Joint rates that move the handle at a velocity along these axes [rad/s]."""
    u = s.e.u
    u[0], u[1], u[2], u[3] = arm_law.jacobian(q1, q2, m.links)
    x, y = viscous.across(m, vx, vy)
    r1, r2 = arm_law.joint_velocity(x, y, u, 1.0)
    return r1, r2 - r1


def place_of(m, q1, q2):
    """Place of the handle along these axes [m]."""
    x, y = arm.place(m, q1, q2)
    return viscous.along(m, x, y)


# ---- at an instant -------------------------------------------------------------------------------


def stop(m, s, k):
    """Takes the velocity along an axis that rests from the handle."""
    x, y = viscous.along(m, k.x.v, k.y.v)
    x, y = 0.0 if s.mode[0].mode == 0.0 else x, 0.0 if s.mode[1].mode == 0.0 else y
    k.x.v, k.y.v = viscous.across(m, x, y)


def plain_response(k, out):
    """Response of the handle to its load where nothing yields."""
    out.x.acc, out.y.acc = servo.solve(k)
    out.x.r = out.y.r = 0.0
    net(k, out)


def net(k, out):
    """Net force of a response."""
    x, y, a, b = k.x, k.y, out.x, out.y
    x.net = x.f - a.r - x.d * a.acc - k.dxy * b.acc
    y.net = y.f - b.r - y.d * b.acc - k.dxy * a.acc


def respond(m, s, k, out):
    """Response of the handle to its load in any clay, in the modes of the step."""
    if not m.modal:
        plain_response(k, out)
        return
    x, y, grip, B = k.x, k.y, out.grip, out.grip.B
    gx, gy = servo.solve(k)
    B[0], B[1], B[2], B[3] = viscous.rotated_matrix(
        m,
        controller.velocity_per_force((x.n, y.n), (k.Sxx, k.Sxy, k.Syy), (x.d, y.d, k.dxy)),
    )
    grip.x.v, grip.y.v = viscous.along(m, x.v, y.v)
    grip.x.a, grip.y.a = viscous.along(m, gx - x.c, gy - y.c)
    if rests(s):
        grip.x.f, grip.y.f = holding(grip)
        leftx = lefty = 0.0
    elif m.modal == 2:
        leftx, lefty = resist_along(s, grip)
    else:
        leftx, lefty = resist_axes(s, grip)
    out.x.r, out.y.r = viscous.across(m, grip.x.f, grip.y.f)
    leftx, lefty = viscous.across(m, leftx, lefty)
    out.x.acc, out.y.acc = leftx + x.c, lefty + y.c
    net(k, out)


def holding(grip):
    """The force that cancels the acceleration, (x, y) [N]."""
    B, x, y = grip.B, grip.x.a, grip.y.a
    det = B[0] * B[3] - B[1] * B[2]
    return numbers.ratio(B[3] * x - B[1] * y, det), numbers.ratio(B[0] * y - B[2] * x, det)


def remaining_acceleration(ax, ay, B, fx, fy):
    """The acceleration that remains under a force, (x, y) [m/s^2]."""
    return ax - B[0] * fx - B[1] * fy, ay - B[2] * fx - B[3] * fy


def resist_axes(s, grip):
    """Force of clay in which the axes slide, into the grip; the remaining acceleration [m/s^2]."""
    x, y, B, sx, sy = grip.x, grip.y, grip.B, s.mode[0].mode, s.mode[1].mode
    x.f, y.f = sx * strength(s, 0, sx * x.v), sy * strength(s, 1, sy * y.v)
    if sx == 0.0:
        x.f = numbers.ratio(x.a - B[1] * y.f, B[0])
    elif sy == 0.0:
        y.f = numbers.ratio(y.a - B[2] * x.f, B[3])
    ax, ay = remaining_acceleration(x.a, y.a, B, x.f, y.f)
    return 0.0 if sx == 0.0 else ax, 0.0 if sy == 0.0 else ay


def resist_along(s, grip):
    """The same of clay that resists along the motion."""
    x, y, B, slides = grip.x, grip.y, grip.B, s.mode[0].mode == SLIDING
    ex, ey = s.mode[0].way, s.mode[1].way
    speed = x.v * ex + y.v * ey
    if slides:
        speed, ex, ey = way_of(s, x.v, y.v)
    f = strength(s, 0, speed)
    x.f, y.f = f * ex, f * ey
    gx, gy = remaining_acceleration(x.a, y.a, B, x.f, y.f)
    if slides:
        return gx, gy
    off = numbers.ratio(
        ex * gy - ey * gx, turning(B, ex, ey)
    )  # a transverse force keeps it on its path
    ax, ay = remaining_acceleration(gx, gy, B, -off * ey, off * ex)
    size = ax * ex + ay * ey
    x.f, y.f = x.f - off * ey, y.f + off * ex
    return size * ex, size * ey


def way_of(s, vx, vy):
    """Speed along the motion [m/s], and its direction; at rest, the way of the modes."""
    speed = math.sqrt(vx * vx + vy * vy)
    if speed > 0.0:
        return speed, vx / speed, vy / speed
    return speed, s.mode[0].way, s.mode[1].way


def turning(B, ex, ey):
    """Acceleration across a direction per unit of force across it [1/kg]."""
    return ey * ey * B[0] - ex * ey * (B[1] + B[2]) + ex * ex * B[3]


def acceleration(grip):
    """Acceleration of the handle that the clay sees, along its axes [m/s^2]."""
    return remaining_acceleration(grip.x.a, grip.y.a, grip.B, grip.x.f, grip.y.f)


def back_to_rest(m, s, z):
    """Moves a resting axis of a point back to its place: one step of Newton's method."""
    sx, sy = s.mode[0].mode, s.mode[1].mode
    if (sx == 0.0) == (sy == 0.0):
        return
    x, y = place_of(m, z.q1, z.q2)
    vx, vy = velocity(m, s, z.q1, z.q2, z.w1, z.w2)
    leadx = s.mode[0].anchor - x if sx == 0.0 else 0.0
    leady = s.mode[1].anchor - y if sy == 0.0 else 0.0
    a1, a2 = joint_rates(m, s, z.q1, z.q2, leadx, leady)
    z.q1, z.q2 = z.q1 + a1, z.q2 + a2
    vx, vy = 0.0 if sx == 0.0 else vx, 0.0 if sy == 0.0 else vy
    z.w1, z.w2 = joint_rates(m, s, z.q1, z.q2, vx, vy)


# ---- bounds of a step ----------------------------------------------------------------------------


def shortest_step(m, s):
    """The shortest step that yielding clay requests [s]."""
    return max(REST * m.dt, 4e-16 * s.t)  # some roundings of the time


def share_of_speed(share, speed, rate):
    """share times speed over rate; infinite for a rate of 0."""
    return share * speed / rate if rate > 0.0 else math.inf


def longest_step(m, s, grip, vx, vy):
    """The longest step that yielding clay allows, by its grip, at a velocity [s]."""
    if m.modal == 2:
        return longest_along(s, grip, vx, vy)
    return min(longest_of_axis(s, grip, vx, 0), longest_of_axis(s, grip, vy, 1))


def longest_of_axis(s, grip, v, i):
    """The same of one axis."""
    speed = abs(v)
    if s.mode[i].mode == 0.0 or not is_active(s, i):
        return math.inf
    most = share_of_speed(STABLE_STEP, 1.0, steepness(s, i, speed) * grip.B[3 * i])
    if is_rough(s, i):
        ax, ay = acceleration(grip)
        most = min(most, share_of_speed(GRADE, speed, abs(ay if i else ax)))
    return most


def longest_along(s, grip, vx, vy):
    """The same along the motion."""
    if s.mode[0].mode == REST_MODE or not is_active(s, 0):
        return math.inf
    speed, ex, ey = way_of(s, vx, vy)
    B, slides = grip.B, s.mode[0].mode == SLIDING
    most = share_of_speed(STABLE_STEP, 1.0, steepness(s, 0, speed) * max(B[0], B[3]))
    if slides:
        rate = strength(s, 0, speed) * turning(B, ex, ey)
        most = min(most, share_of_speed(TURN, speed, rate))
    if slides or is_rough(s, 0):
        ax, ay = acceleration(grip)
        most = min(most, share_of_speed(GRADE, speed, math.sqrt(ax * ax + ay * ay)))
    return most


def goes_on(m, s, h, vx, vy):
    """Whether the step tried keeps its modes, and the next may be as long: a cheap test."""
    begin, last = s.a.shown.grip, s.a.last
    if m.modal == 2:
        stays = stays_along(m, s, begin, last)
    else:
        stays = axis_stays(m, s, vx, begin.x.f, last.x.f, 0)
        stays = stays and axis_stays(m, s, vy, begin.y.f, last.y.f, 1)
    return stays and longest_step(m, s, last, vx, vy) >= h


def stays_along(m, s, begin, last):
    """Whether no mode along the motion ends."""
    if s.mode[0].mode != REST_MODE:
        return True
    # the last stage is not quite the end: by half of the change more
    x, y = 1.5 * last.x.f - 0.5 * begin.x.f, 1.5 * last.y.f - 0.5 * begin.y.f
    most = holding_force(m, s, 0)
    return x * x + y * y <= most * most


def axis_stays(m, s, v, begin, f, i):
    """Whether the mode of an axis does not end."""
    mode = s.mode[i].mode
    if not is_active(s, i):
        return True
    if mode == 0.0:
        return abs(f) + 0.5 * abs(f - begin) <= holding_force(m, s, i)
    return mode * v > 0.0


def gap(m, s, grip, i):
    """Margin until a mode ends, negative beyond; i: the axis, 0 along the motion."""
    if m.modal == 2:
        if s.mode[0].mode == REST_MODE:
            f = math.sqrt(grip.x.f * grip.x.f + grip.y.f * grip.y.f)
            return gap_of_hold(holding_force(m, s, 0), f)
        return s.mode[0].way * grip.x.v + s.mode[1].way * grip.y.v
    if s.mode[i].mode == 0.0:
        return gap_of_hold(holding_force(m, s, i), abs(grip.axis[i].f))
    return s.mode[i].mode * grip.axis[i].v


def gap_of_hold(most, f):
    """Margin of the force that holds, as `gap`."""
    return (most - f) / (1.0 + most)


# ---- what a mode demands -------------------------------------------------------------------------


def violation(m, s, grip, i):
    """How far an axis without velocity violates its mode, 0 or less where it does not."""
    mode = s.mode[i].mode
    if mode == 0.0:
        f = holding_force(m, s, i)
        return (abs(grip.axis[i].f) - f) / (1e-12 + f)
    ax, ay = acceleration(grip)
    a = ay if i else ax
    return -mode * a / (abs(a) + abs(grip.axis[i].a) + 1e-12)


def is_nearly_at_rest(m, s, grip, i):
    """Whether an axis that slides, or a handle in clay along the motion, counts as at rest."""
    ax, ay = acceleration(grip)
    if m.modal == 2:
        vx, vy = grip.x.v, grip.y.v
        hx, hy = holding(grip)
        speed, size = math.sqrt(vx * vx + vy * vy), math.sqrt(ax * ax + ay * ay)
        return nearly_rests(m, s, 0, speed, vx * ax + vy * ay, size, math.sqrt(hx * hx + hy * hy))
    j = 1 - i
    o, a = grip.axis[i], ay if i else ax
    # without it, the other axis as it is
    need = numbers.ratio(abs(o.a - grip.B[2 * i + j] * grip.axis[j].f), grip.B[3 * i])
    return nearly_rests(m, s, i, abs(o.v), o.v * a, abs(a), need)


def nearly_rests(m, s, i, speed, forward, size, need):
    """The same for a speed.

    forward: power of the acceleration; size: of the acceleration; need: force that would hold.
    """
    if speed == 0.0 or (forward < 0.0 and speed <= 2.0 * REST * m.dt * size):
        return True
    if speed >= slowest(m, s, i) or forward > 0.0:
        return False
    # no stop, but nearly a steady creep that is too slow to be followed
    return strength(s, i, 0.5 * speed) < need and need <= holding_force(m, s, i)


def direction_of_onset(s, grip):
    """Direction in which a handle at rest begins to slide in clay along the motion."""
    B = grip.B[0], grip.B[1], grip.B[2], grip.B[3]
    ex, ey = flow.slowed(B, grip.x.a, grip.y.a, 1.0, s.mode[0].Fy, 0.0, 1.0)
    if ex == 0.0 and ey == 0.0:
        ex, ey = grip.x.f, grip.y.f
    size = math.sqrt(ex * ex + ey * ey)
    if size > 0.0:
        return ex / size, ey / size
    return s.mode[0].way, s.mode[1].way


def is_turned_in(m, s, grip, ex, ey):
    """Whether a handle is so slow that the clay has turned it into the direction of its push."""
    speed = grip.x.v * ex + grip.y.v * ey
    ax, ay = acceleration(grip)
    turns = strength(s, 0, speed) * turning(grip.B, ex, ey)
    if abs(ex * ax + ey * ay) > CALM * turns or abs(ex * ay - ey * ax) > ALIGNED * turns:
        return False
    return TURN * speed < TURNING * m.dt * turns


def turned_in(s, grip, speed, ex, ey):
    """That direction: the one across which no force is left."""
    f = strength(s, 0, speed)
    for _ in range(8):  # Newton's method on the angle
        gx, gy = remaining_acceleration(grip.x.a, grip.y.a, grip.B, f * ex, f * ey)
        slope = ex * gx + ey * gy + f * turning(grip.B, ex, ey)
        turn = (ex * gy - ey * gx) / slope if slope > 0.0 else 0.0
        turn = max(-0.5, min(turn, 0.5))
        ex, ey = ex - turn * ey, ey + turn * ex
        size = math.sqrt(ex * ex + ey * ey)
        ex, ey = numbers.ratio(ex, size), numbers.ratio(ey, size)
        if abs(turn) < 1e-15:
            break
    return ex, ey
