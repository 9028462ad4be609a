"""How clay that yields holds or resists the handle within a step of the accurate method.

In a step each axis of the clay keeps its mode: it slides with a fixed sign of its velocity, or it
rests, and the clay's force is whatever keeps it there. Clay that resists along the motion lets the
handle slide or rest as a whole. `runge_kutta` ends a step where a mode ends.

Beside rest the law has no derivative: the direction of the force turns, or K v^n grows steep. Steps
there are shares of the speed (GRADE), so that a stop takes some hundred of them, however steep.
"""

from __future__ import annotations

import math

from ..model import arm, controller, flow
from .loop import turned_matrix
from .path import INF, arm_of

STABLE_STEP = 0.5  # fastest rate times step up to which an explicit step is trusted
SUBSTEPS = 1000  # most of them for one sample
GRADE = 0.1  # of the speed: its most change in a step where the law has no derivative at rest
TURN = 0.25  # rate at which the clay turns the velocity, times step
REST = 1e-9  # of dt: time that an axis would still take to come to rest, and rests; shortest step
# of dt: shortest step against the force that turns a slow handle into its direction; a slower one
# has this direction
TURNING = 1.0 / 200.0
CALM = 0.2  # of the acceleration that turns it: that of a slow handle along its direction, at most
ALIGNED = 1e-5  # the same, across it; nearly the angle [rad] from there to this direction
RESTS, FREE = 1, 2  # ends of a mode, see state event
REST_MODE, SLIDING, TURNED_IN = 0, 1, 2  # modes of clay along the motion; by axis: signs, 0 rest

MODES_STATE = [
    ("mode", "i8", 2),  # of each axis of the clay; of clay along the motion, the first
    ("way", "f8", 2),  # along which a handle slides that is slow or begins
    ("event", "i8", 2),  # what ends the step worked out: 0, RESTS, FREE, or -FREE towards -
    ("ended", "i8", 2),  # what ended the step before
    ("lightness", "f8"),  # largest acceleration per unit of force, by way of C too [1/kg]
    ("resisted", "f8", 2),  # force of the clay at the start of the step last worked out [N]
    ("kept", "f8", 21),  # see runge_kutta.feel_end
]
# state felt: acceleration without the force of yielding (x, y) [m/s^2]; acceleration that each unit
# of it takes (xx, xy, yx, yy) [1/kg]; velocity (x, y) [m/s]; this force (x, y) [N]; 0.0, 0.0; along
# the axes of the clay where each yields by itself


def along_clay(s, x, y):
    """Components of a vector along the axes in which the clay yields.

    Args:
        s: state of the run.
        x: along x.
        y: along y.
    """
    if s["turned_clay"] and s["yields"] == 1:
        return controller.along_axes(s["grain"][0], s["grain"][1], x, y)
    return x, y


def along_world(s, x, y):
    """The inverse of `along_clay`.

    Args:
        s: state of the run.
        x: along the first axis of the clay.
        y: along its second one.
    """
    if s["turned_clay"] and s["yields"] == 1:
        return controller.along_axes(s["grain"][0], -s["grain"][1], x, y)
    return x, y


def clay_velocity(s, q1, q2, w1, w2):
    """Velocity of the handle along the axes of the clay, (x, y) [m/s].

    Args:
        s: state of the run.
        q1: angle of joint 1 [rad].
        q2: angle of joint 2 [rad].
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].
    """
    vx, vy = arm.handle_velocity(w1, w1 + w2, arm.jacobian(q1, q2, arm_of(s)))
    return along_clay(s, vx, vy)


def clay_place(s, q1, q2):
    """Place of the handle along the axes of the clay, (x, y) [m].

    Args:
        s: state of the run.
        q1: angle of joint 1 [rad].
        q2: angle of joint 2 [rad].
    """
    x, y = arm.handle_position(q1, q2, arm_of(s))
    return along_clay(s, x - s["origin"][0], y - s["origin"][1])


def joint_rates(s, q1, q2, vx, vy):
    """Joint rates that move the handle along the axes of the clay, (1, 2) [rad/s].

    Args:
        s: state of the run.
        q1: angle of joint 1 [rad].
        q2: angle of joint 2 [rad].
        vx: velocity along the first axis [m/s].
        vy: the same along the second one.
    """
    vx, vy = along_world(s, vx, vy)
    r1, r2 = arm.joint_velocity(vx, vy, arm.jacobian(q1, q2, arm_of(s)), 1.0)
    return r1, r2 - r1


def without_rest(s, vx, vy):
    """A velocity without its component along an axis that rests, (x, y) [m/s].

    Args:
        s: state of the run.
        vx: velocity, x [m/s].
        vy: the same, y [m/s].
    """
    vx, vy = along_clay(s, vx, vy)
    return along_world(s, 0.0 if s["mode"][0] == 0 else vx, 0.0 if s["mode"][1] == 0 else vy)


def back_to_rest(s, q1, q2, w1, w2):
    """Takes an axis that rests back to where it does: one step of Newton's, of the step's error.

    Args:
        s: state of the run.
        q1: angle of joint 1 [rad].
        q2: angle of joint 2 [rad].
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].

    Returns:
        (q1, q2, w1, w2).
    """
    mode, anchor = s["mode"], s["anchor"]
    x, y = clay_place(s, q1, q2)
    x = anchor[0] - x if mode[0] == 0 else 0.0
    y = anchor[1] - y if mode[1] == 0 else 0.0
    vx, vy = clay_velocity(s, q1, q2, w1, w2)
    a1, a2 = joint_rates(s, q1, q2, x, y)
    q1 += a1
    q2 += a2
    w1, w2 = joint_rates(
        s, q1, q2, 0.0 if mode[0] == 0 else vx, 0.0 if mode[1] == 0 else vy
    )  # fmt: skip
    return q1, q2, w1, w2


def strength(s, i, m):
    """Force of yielding of an axis that slides, Fy + K m^n [N]; odd in its second part.

    Args:
        s: state of the run.
        i: the axis, 0 or 1.
        m: its speed [m/s].
    """
    Fy, K, n = s["flow"][3 * i], s["flow"][3 * i + 1], s["flow"][3 * i + 2]
    if K <= 0.0 or m == 0.0:
        return Fy
    return Fy + K * m**n if m > 0.0 else Fy - K * (-m) ** n


def steepness(s, i, m):
    """How fast that force grows with the speed, n K m^(n - 1) [N.s/m].

    Args:
        s: state of the run.
        i: the axis, 0 or 1.
        m: its speed [m/s].
    """
    K, n = s["flow"][3 * i + 1], s["flow"][3 * i + 2]
    return K * n * m ** (n - 1.0) if K > 0.0 and m > 0.0 else 0.0


def is_rough(s, i):
    """Whether the force of an axis has no Taylor series at rest.

    Args:
        s: state of the run.
        i: the axis, 0 or 1.
    """
    K, n = s["flow"][3 * i + 1], s["flow"][3 * i + 2]
    return K > 0.0 and n != round(n)


def is_active(s, i):
    """Whether the clay of an axis yields.

    Args:
        s: state of the run.
        i: the axis, 0 or 1.
    """
    return s["flow"][3 * i] > 0.0 or s["flow"][3 * i + 1] > 0.0


def creep_speed(lightness, dt, K, n):
    """Speed below which clay of n < 1 is too stiff for SUBSTEPS a sample [m/s]; else 0.

    Args:
        lightness: acceleration per unit of force [1/kg].
        dt: length of a sample [s].
        K: consistency [N/(m/s)^n].
        n: flow index.
    """
    if K <= 0.0 or n >= 1.0:
        return 0.0
    return (dt * lightness * K * n / (SUBSTEPS * STABLE_STEP)) ** (1.0 / (1.0 - n))


def slowest(s, i):
    """As `creep_speed`, of an axis in the present region.

    Args:
        s: state of the run.
        i: the axis, 0 or 1.
    """
    return creep_speed(s["lightness"], s["dt"], s["flow"][3 * i + 1], s["flow"][3 * i + 2])


def holding_force(s, i):
    """The most force that holds an axis [N]: Fy, and that of a creep too slow to be followed.

    Args:
        s: state of the run.
        i: the axis, 0 or 1.
    """
    return strength(s, i, slowest(s, i))


def yield_at_stage(s, W, mass, v, a):
    """Force of clay that yields at a stage, in the modes of the step; writes state felt.

    Args:
        s: state of the run.
        W: acceleration per unit of force, (xx, xy, yy) [1/kg].
        mass: of the hand, (x, y) [kg].
        v: velocity of the handle, (x, y) [m/s].
        a: its acceleration without this force, (x, y) [m/s^2].

    Returns:
        (rx, ry, ax, ay): the force [N], and the acceleration with it [m/s^2].
    """
    felt, mode, way = s["felt"], s["mode"], s["way"]
    B = controller.velocity_per_force((1.0, 1.0), W, (mass[0], mass[1], 0.0))
    (vx, vy), (ax, ay) = v, a
    if s["turned_clay"] and s["yields"] == 1:
        c, d = s["grain"][0], s["grain"][1]
        B = turned_matrix(c, d, B)
        vx, vy = controller.along_axes(c, d, vx, vy)
        ax, ay = controller.along_axes(c, d, ax, ay)
    xx, xy, yx, yy = B
    felt[0], felt[1], felt[6], felt[7] = ax, ay, vx, vy
    felt[2], felt[3], felt[4], felt[5] = xx, xy, yx, yy
    sx, sy = mode[0], mode[1]
    fx, fy, gx, gy = 0.0, 0.0, 0.0, 0.0
    if sx == 0 and sy == 0:
        det = xx * yy - xy * yx
        fx, fy = (yy * ax - xy * ay) / det, (xx * ay - yx * ax) / det
    elif s["yields"] == 2:
        ex, ey = way[0], way[1]
        if sx == SLIDING:
            m = math.sqrt(vx * vx + vy * vy)
            if m > 0.0:
                ex, ey = vx / m, vy / m
            f = strength(s, 0, m)
            fx, fy = f * ex, f * ey
            gx, gy = ax - xx * fx - xy * fy, ay - yx * fx - yy * fy
        else:  # a force across keeps it on its way
            f = strength(s, 0, vx * ex + vy * ey)
            fx, fy = f * ex, f * ey
            gx, gy = ax - xx * fx - xy * fy, ay - yx * fx - yy * fy
            f = (ex * gy - ey * gx) / across(s, ex, ey)
            fx, fy = fx - f * ey, fy + f * ex
            gx, gy = gx - f * (xy * ex - xx * ey), gy - f * (yy * ex - yx * ey)
            f = gx * ex + gy * ey
            gx, gy = f * ex, f * ey
    else:
        if sx != 0:
            fx = sx * strength(s, 0, sx * vx)
        if sy != 0:
            fy = sy * strength(s, 1, sy * vy)
        if sx == 0:
            fx = (ax - xy * fy) / xx
        elif sy == 0:
            fy = (ay - yx * fx) / yy
        gx = 0.0 if sx == 0 else ax - xx * fx - xy * fy
        gy = 0.0 if sy == 0 else ay - yx * fx - yy * fy
    felt[8], felt[9], felt[10], felt[11] = fx, fy, 0.0, 0.0
    fx, fy = along_world(s, fx, fy)
    gx, gy = along_world(s, gx, gy)
    return fx, fy, gx, gy


def torques_that_hold(s, u, S, a, f, mass, v, c):
    """Torques of motors at their limits while clay holds an axis.

    The servo answers the force of the clay, and that depends on the torques. Of the nine cases,
    each motor free or at either limit, one agrees with itself.

    Args:
        s: state of the run.
        u: from arm.jacobian [m].
        S: acceleration per unit of force that the servo makes, (xx, xy, yy) [1/kg].
        a: acceleration that the servo wants without forces, (x, y) [m/s^2].
        f: force on the handle without that of yielding and of the hand's mass, (x, y) [N].
        mass: of the hand, (x, y) [kg].
        v: velocity of the handle, (x, y) [m/s].
        c: centripetal acceleration, (x, y) [m/s^2].

    Returns:
        (shoulder, elbow) [N.m].
    """
    at = u, S, a, f, mass, v, c
    limit1, limit2 = s["torque_limit"]
    b1, b2 = wanted_torques(s, 0.0, 0.0, at)
    xx, yx = wanted_torques(s, 1.0, 0.0, at)
    xy, yy = wanted_torques(s, 0.0, 1.0, at)
    xx, yx, xy, yy = xx - b1, yx - b2, xy - b1, yy - b2
    best1, best2, least = 0.0, 0.0, INF
    for case in range(9):
        side1, side2 = SIDES[case // 3], SIDES[case % 3]
        t1, t2 = side1 * limit1, side2 * limit2
        if side1 == 0.0 and side2 == 0.0:
            det = (1.0 - xx) * (1.0 - yy) - xy * yx
            t1, t2 = ((1.0 - yy) * b1 + xy * b2) / det, ((1.0 - xx) * b2 + yx * b1) / det
        elif side1 == 0.0:
            t1 = (b1 + xy * t2) / (1.0 - xx)
        elif side2 == 0.0:
            t2 = (b2 + yx * t1) / (1.0 - yy)
        w1, w2 = b1 + xx * t1 + xy * t2, b2 + yx * t1 + yy * t2
        # how far a free motor is beyond its limit, or one at its limit is asked for less
        wrong1 = limit1 - side1 * w1 if side1 != 0.0 else abs(t1) - limit1
        wrong2 = limit2 - side2 * w2 if side2 != 0.0 else abs(t2) - limit2
        wrong = max(wrong1 / limit1, wrong2 / limit2)
        if wrong < least:
            best1, best2, least = t1, t2, wrong
    return best1, best2


SIDES = (0.0, 1.0, -1.0)


def wanted_torques(s, t1, t2, at):
    """Torques that the servo asks for where clay holds an axis under other torques.

    Args:
        s: state of the run.
        t1: torque of the shoulder [N.m].
        t2: torque of the elbow [N.m].
        at: the other arguments of `torques_that_hold`.

    Returns:
        (shoulder, elbow) [N.m].
    """
    u, S, a, f, mass, v, c = at
    links = arm_of(s)
    # kicks of one second from rest, in which the velocity after it is the acceleration
    gx, gy = controller.velocity_under_torque(1.0, (0.0, 0.0), u, links, (t1, t2), f, mass)
    W = arm.mobility(u, links)
    rx, ry, _, _ = yield_at_stage(s, W, mass, v, (gx - c[0], gy - c[1]))
    x, y = f[0] - rx, f[1] - ry
    gx, gy = controller.solve_velocity((1.0, 1.0), a, S, (x, y), mass)
    x, y = x - mass[0] * gx, y - mass[1] * gy
    a1, a2 = arm.joint_velocity(gx, gy, u, 1.0)
    p1, p2 = arm.joint_torques(x, y, u)
    return links[2] * a1 + links[3] * a2 - p1, links[3] * a2 - p2


def across(s, ex, ey):
    """Acceleration across a direction per unit of force across it, as felt [1/kg].

    Args:
        s: state of the run.
        ex: the direction, x.
        ey: the same, y.
    """
    felt = s["felt"]
    return ey * ey * felt[2] - ex * ey * (felt[3] + felt[4]) + ex * ex * felt[5]


def felt_acceleration(s, i):
    """Acceleration of an axis of the clay, as felt [m/s^2].

    Args:
        s: state of the run.
        i: the axis, 0 or 1.
    """
    felt = s["felt"]
    return felt[i] - felt[2 + 2 * i] * felt[8] - felt[3 + 2 * i] * felt[9]


def shortest_step(s):
    """The shortest step that clay that yields asks for [s].

    Args:
        s: state of the run.
    """
    return max(REST * s["dt"], 4e-16 * s["t"])  # some roundings of the time


def longest_step(s):
    """The longest step that clay that yields allows, from what is felt [s].

    Args:
        s: state of the run.
    """
    felt, mode, most = s["felt"], s["mode"], INF
    if s["yields"] == 2:
        if mode[0] == 0 or not is_active(s, 0):
            return INF
        vx, vy = felt[6], felt[7]
        m = math.sqrt(vx * vx + vy * vy)
        ex, ey = s["way"][0], s["way"][1]
        if m > 0.0:
            ex, ey = vx / m, vy / m
        light = max(felt[2], felt[5])
        most = share_of_speed(STABLE_STEP, 1.0, steepness(s, 0, m) * light)
        if mode[0] == SLIDING:
            most = min(most, share_of_speed(TURN, m, strength(s, 0, m) * across(s, ex, ey)))
        if mode[0] == SLIDING or is_rough(s, 0):
            ax, ay = felt_acceleration(s, 0), felt_acceleration(s, 1)
            most = min(most, share_of_speed(GRADE, m, math.sqrt(ax * ax + ay * ay)))
    else:
        for i in range(2):
            m = abs(felt[6 + i])
            if mode[i] != 0 and is_active(s, i):
                rate = steepness(s, i, m) * felt[2 + 3 * i]
                most = min(most, share_of_speed(STABLE_STEP, 1.0, rate))
                if is_rough(s, i):
                    most = min(most, share_of_speed(GRADE, m, abs(felt_acceleration(s, i))))
    return max(most, shortest_step(s))


def share_of_speed(share, m, rate):
    """share m / rate; INF for a rate of 0.

    Args:
        share: the share.
        m: a speed [m/s], or 1.
        rate: how fast it changes [m/s^2], or 1/s.
    """
    return share * m / rate if rate > 0.0 else INF


def goes_on(s, h, vx, vy, restx, resty):
    """Whether a step keeps its modes to its end, and the next one may be as long: a cheap look.

    Args:
        s: state of the run; felt is of the last stage.
        h: length of the step [s].
        vx: velocity of the handle at its end, x [m/s].
        vy: the same, y [m/s].
        restx: force of yielding at its start, along the first axis of the clay [N].
        resty: the same along the second one.
    """
    felt, mode = s["felt"], s["mode"]
    vx, vy = along_clay(s, vx, vy)
    if s["yields"] == 2:
        if mode[0] == 0:  # the last stage is not quite the end: by half of the change more
            x, y = 1.5 * felt[8] - 0.5 * restx, 1.5 * felt[9] - 0.5 * resty
            f = holding_force(s, 0)
            return x * x + y * y <= f * f
    else:
        for i in range(2):
            if not is_active(s, i):
                continue
            if mode[i] == 0:
                f = felt[8 + i]
                if abs(f) + 0.5 * abs(f - (resty if i else restx)) > holding_force(s, i):
                    return False
            elif mode[i] * (vy if i else vx) <= 0.0:
                return False
    felt[6], felt[7] = vx, vy
    return longest_step(s) >= h


def gap_of_mode(s, i):
    """What is left at the end of a step until a mode ends, negative beyond; from what is felt.

    Args:
        s: state of the run; felt is of the end of the step.
        i: the axis; 0 for clay along the motion.
    """
    felt, mode, f = s["felt"], s["mode"][i], holding_force(s, i)
    if s["yields"] == 2:
        if mode == 0:
            return (f - math.sqrt(felt[8] * felt[8] + felt[9] * felt[9])) / (1.0 + f)
        return s["way"][0] * felt[6] + s["way"][1] * felt[7]
    if mode == 0:
        return (f - abs(felt[8 + i])) / (1.0 + f)
    return mode * felt[6 + i]


def misfit(s, i, rests):
    """How far an axis is from what its mode demands, 0 or less where it is not.

    Args:
        s: state of the run, with what is felt in this mode.
        i: the axis.
        rests: whether it is without velocity, so that its mode is open.
    """
    if not rests:
        return 0.0
    mode, f = s["mode"][i], holding_force(s, i)
    if mode == 0:
        return (abs(s["felt"][8 + i]) - f) / (1e-12 + f)
    a = felt_acceleration(s, i)
    return -mode * a / (abs(a) + abs(s["felt"][i]) + 1e-12)


def is_nearly_at_rest(s, i):
    """Whether an axis that slides counts as at rest.

    Args:
        s: state of the run, with what is felt in this mode.
        i: the axis; 0 for clay along the motion.
    """
    felt = s["felt"]
    a, b = felt_acceleration(s, 0), felt_acceleration(s, 1)
    m, against = abs(felt[6 + i]), felt[6 + i] * (b if i else a)
    size = abs(b if i else a)
    if s["yields"] == 2:
        m, against = math.sqrt(felt[6] ** 2 + felt[7] ** 2), felt[6] * a + felt[7] * b
        size = math.sqrt(a * a + b * b)
    if m == 0.0 or (against < 0.0 and m <= 2.0 * REST * s["dt"] * size):
        return True
    if m >= slowest(s, i) or against > 0.0:
        return False
    # no stop, but nearly a steady creep that is too slow to be followed
    if s["yields"] == 2:
        xx, xy, yx, yy = felt[2], felt[3], felt[4], felt[5]
        det = xx * yy - xy * yx
        x, y = (yy * felt[0] - xy * felt[1]) / det, (xx * felt[1] - yx * felt[0]) / det
        need = math.sqrt(x * x + y * y)
    else:
        j = 1 - i
        need = abs(felt[i] - felt[2 + 2 * i + j] * felt[8 + j]) / felt[2 + 3 * i]
    return strength(s, i, 0.5 * m) < need <= holding_force(s, i)


def set_out(s):
    """Direction in which a handle begins to slide in clay along the motion, into state way.

    Args:
        s: state of the run, with what is felt at rest.
    """
    felt, way = s["felt"], s["way"]
    B = felt[2], felt[3], felt[4], felt[5]
    x, y = flow.slowed(B, felt[0], felt[1], 1.0, s["flow"][0], 0.0, 1.0)
    if x == 0.0 and y == 0.0:
        x, y = felt[8], felt[9]
    m = math.sqrt(x * x + y * y)
    if m > 0.0:
        way[0], way[1] = x / m, y / m


def is_turned_in(s, ex, ey):
    """Whether a handle is so slow that the clay has turned it into the direction of its push.

    Args:
        s: state of the run, with what is felt as it slides.
        ex: direction of its velocity, x.
        ey: the same, y.
    """
    felt = s["felt"]
    m = felt[6] * ex + felt[7] * ey
    turns = strength(s, 0, m) * across(s, ex, ey)
    ax, ay = felt_acceleration(s, 0), felt_acceleration(s, 1)
    if abs(ex * ax + ey * ay) > CALM * turns or abs(ex * ay - ey * ax) > ALIGNED * turns:
        return False
    return TURN * m < TURNING * s["dt"] * turns


def turn_in(s, m, ex, ey):
    """That direction, into state way: the one across which no force is left.

    Args:
        s: state of the run, with what is felt.
        m: speed [m/s].
        ex: direction to begin with, x.
        ey: the same, y.
    """
    felt, way, f = s["felt"], s["way"], strength(s, 0, m)
    xx, xy, yx, yy = felt[2], felt[3], felt[4], felt[5]
    for _ in range(8):  # Newton's method on the angle
        gx, gy = felt[0] - f * (xx * ex + xy * ey), felt[1] - f * (yx * ex + yy * ey)
        slope = ex * gx + ey * gy + f * across(s, ex, ey)
        turn = (ex * gy - ey * gx) / slope if slope > 0.0 else 0.0
        turn = max(-0.5, min(turn, 0.5))
        ex, ey = ex - turn * ey, ey + turn * ex
        size = math.sqrt(ex * ex + ey * ey)
        ex, ey = ex / size, ey / size
        if abs(turn) < 1e-15:
            break
    way[0], way[1] = ex, ey
