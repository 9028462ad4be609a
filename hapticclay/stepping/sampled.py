"""The sampled run, as on hardware: measured, computed and held every Ts; the arm moves in between.

The controller is exact between samples. At an event, a sample or a change of the torques, the kick
falls into two: one under the old torques, which brings the velocity to the sample, where it is
measured, and one under the new torques. Steps end on events, as they do on borders. Hardware adds
jitter, lost samples, encoders, converters, filters, delay, friction, a passivity controller and a
virtual coupling to the same loop.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..model import arm, clay, compensator, controller, flow, hardware, operator, regions
from ..model import spring as springs
from ..model.compensator import Compensator
from ..model.controller import Servo
from ..model.sampled_controller import DESK, TORQUE, Controller, LawCaller
from . import energy, loop, path
from .path import INF, NAN, TOUCH, put4, put6, put8, put10, put14, put22
from .run import CHUNK, Run

SLACK = 1e-9  # of dt: events so close are one
HOLD = 10  # numbers that the motors hold, see SAMPLED_STATE
FORM_MEMORY = 48  # rows (z, y, y', start, f) of z, y and y' at the next sample, of one axis
REACTION = 1e-9  # [s] so long after a sample a force is that at it
FRICTION_ROUNDS = 80  # to find the torque of a joint that friction holds in clay that yields
FRICTION_CLOSE = 1e-15  # agreement of it, over its limit, and of the rate over that without it
FRICTION_NUDGE = 1e-9  # of the limit, beyond the torque that brings a joint to rest
AHEAD = 10  # muscle force of a kick before, after and around a sample, at it; change of the command

SAMPLED_STATE = [  # beside path.STATE
    # the controller and its hardware
    ("ratio", "i8"),  # steps in a control sample
    ("Ts", "f8"),
    ("physical", "i8"),  # whether the clay is there all the time; else the motors render it
    ("sticks", "i8"),  # whether it is, and yields
    ("memory", "f8", 40),  # rows (A, B) of controller.held_compensator, x and y
    (
        "form_memory",
        "f8",
        2 * FORM_MEMORY,
    ),  # where the compensator is `formed`, see `formed_memory`
    ("own", "i8"),  # whether the controller is the user's own
    ("asked", "i8"),  # index of the sample for which it was last asked
    ("wired", "i8"),  # whether there is hardware
    ("uneven", "i8"),  # whether events may lie between the steps
    ("random", "i8"),  # whether Engine.chance matters
    ("encoder", "i8"),  # as in hardware.Interface, 0 for none
    ("difference", "i8"),
    ("window", "i8"),
    ("cutoff", "f8"),
    ("filters", "i8"),
    ("force_filter", "f8", 6),  # hardware.butterworth
    ("adc_bits", "i8"),
    ("adc_range", "f8"),
    ("dac_bits", "i8"),
    ("dac_range", "f8", 2),
    ("delay", "f8"),
    ("whole_delay", "i8"),  # samples, and what remains
    ("part_delay", "f8"),
    ("rubs", "i8"),
    ("friction", "f8", 2),
    ("guarded", "i8"),
    ("coupled", "i8"),
    ("coupling", "f8", 2),
    # now
    ("loop", "f8", 8),  # delta, delta', y, y' of x, then of y
    ("form_states", "f8", 2 * compensator.ORDER),  # of such a compensator, x and y
    ("form_start", "f8", 2),  # delta of start and command, to which it adds [m]
    # what the motors hold: their torques [N.m], force of the clay as rendered, of it that of the
    # passivity controller, that of the coupling [N], velocity of its tool [m/s]; two each
    ("hold", "f8", HOLD),
    ("owed", "f8", 2),  # impulse owed by stiff clay [N.s]
    ("pose", "f8", 10),  # arm.jacobian, position [m], arm.mobility, determinant, see `measure_pose`
    # rates behind their filter [rad/s], states of the filters of the force x and y [N], net force
    # last given to the compensator [N], energy that the clay has taken [J], position then [m], that
    # of the tool of the coupling [m]; two each
    ("wires", "f8", 14),
    ("k", "i8"),  # index of the next control sample
    ("when", "f8"),  # its time [s]
    ("then", "f8"),  # of the one after it
    ("due", "f8"),  # when the next torques in the queue come [s], inf for none
    ("due_next", "f8"),  # and those after them
    ("queue_at", "i8"),  # their place in it
    ("queued", "i8"),  # their number
    ("oldest", "i8"),  # row of the past samples, see Engine.ring
    ("newest", "i8"),  # of the past forces
    ("first_chance", "i8"),  # sample of the first row of Engine.chance
    ("lost", "i8"),  # whether the next sample is
    ("noise", "f8", 2),  # on its force [N]
    ("grid", "f8"),  # time of the next whole step [s]
    # what `respond` works out, for `commit`
    ("event", "i8"),  # whether there is any
    ("acts", "i8"),  # whether it is a sample
    ("shown", "i8"),  # whether that is not lost
    ("uh", "f8", 2),  # muscle force now [N]
    ("shift", "f8", 2),  # change of the command over a sample [m]
    ("loop_next", "f8", 8),
    ("form_next", "f8", 2 * compensator.ORDER),
    ("hold_next", "f8", HOLD),
    ("wires_next", "f8", 14),
    ("entry", "f8", 1 + HOLD),  # of the queue: time [s], what to hold
    ("enters", "i8"),  # whether that is to come later
    ("leaves", "i8"),  # entries that leave the queue
    ("turned", "f8", 2),  # joint angles as measured [rad]
    ("start", "f8", 4),  # joint rates [rad/s] and impulse owed [N.s] behind the kick to the sample
    ("early_force", "f8", 2),  # hand force of that kick [N]
    ("early_work", "f8", path.SUMS),  # and its works [J]
    # in physical clay that yields: states felt, stuck and anchor behind that kick; the force beside
    # b v at the sample [N]; anchor before the step, and before the kick to be worked out [m]
    ("early_felt", "f8", path.FELT),
    ("stuck_next", "i8", 2),
    ("anchor_next", "f8", 2),
    ("yield_force", "f8", 2),
    ("anchored", "f8", 2),
    ("anchor_from", "f8", 2),
    # kicks: `ready_kick` writes numbers of the one before a sample, after it, and around it
    ("early", "f8", 22),
    ("late", "f8", 22),
    ("whole", "f8", 22),
    # the kick last worked out
    ("sample", "f8", 10),  # p [m], v before [m/s], net force [N], delta [m], clay's rest [N]
    ("end", "f8", 4),  # velocity [m/s] and joint rates [rad/s] after it
    ("left", "f8", 2),  # impulse owed [N.s]
    ("slip", "f8", 2),  # torques of the friction [N.m]
]


def ready_kick(s, x, before, after, uh):
    """Readies the numbers of a kick: loop.step_inputs and coefficients.

    Args:
        s: state of the run.
        x: gets them, shape (22,).
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].
        uh: muscle force, (x, y) [N].
    """
    span = before + after
    H = 0.5 * span
    L, R, step = before / span, after / span, max(before, after)
    springx, massx, dampx0, dampx1 = operator.operator_coefficients(s["handx"], H, L, R, step)
    springy, massy, dampy0, dampy1 = operator.operator_coefficients(s["handy"], H, L, R, step)
    bx0, bx1, by0, by1, L, uhx, uhy = 0.0, 0.0, 0.0, 0.0, before / span, uh[0], uh[1]
    stiff, sharex, sharey, softx, softy = 0.0, 0.0, 0.0, 0.0, 0.0
    if s["physical"]:
        t = s["t"]
        bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey, softx, softy = loop.step_inputs(
            s, path.damping_before(s, t - 0.25 * before), path.damping_now(s, t + 0.25 * after),
            (uhx, uhy), before, after,
        )  # fmt: skip
    put22(
        x, 0, bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey, softx, softy,
        H, after, springx, springy, massx, massy, dampx0, dampy0, dampx1, dampy1,
    )  # fmt: skip


def ready_kick_now(s, muscle, x, before, after):
    """As `ready_kick`, under the muscle force of the kick now.

    Args:
        s: state of the run.
        muscle: see Engine.
        x: gets the numbers, shape (22,).
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].
    """
    t = s["t"] + 0.25 * (after - before)
    ready_kick(s, x, before, after, path.muscle_force(s, muscle, t, 0.25 * (before + after)))


def measure_pose(s):
    """Takes Jacobian, position, mobility and determinant at the present joint angles.

    Args:
        s: state of the run.
    """
    q1, q2 = s["q"]
    ox, oy = s["origin"]
    links = s["arm"]
    u1x, u1y, u2x, u2y = arm.jacobian(q1, q2, links)
    wxx, wxy, wyy = arm.mobility((u1x, u1y, u2x, u2y), links)
    put10(
        s["pose"], 0, u1x, u1y, u2x, u2y, u1y + u2y - ox, -oy - u1x - u2x, wxx, wxy, wyy,
        u1x * u2y - u2x * u1y,
    )  # fmt: skip


def kick(s, x, t1, t2, w1, w2, owedx, owedy):  # noqa: PLR0913  # flat for CPython
    """Works out one kick of the arm and the operator alone, under given torques on the joints.

    Args:
        s: state of the run; gets sample, end and left.
        x: from `ready_kick`.
        t1: torque on the shoulder [N.m].
        t2: torque on the elbow [N.m].
        w1: rate of joint 1 before the kick [rad/s].
        w2: rate of joint 2 before the kick [rad/s].
        owedx: impulse that stiff clay owes from the step before, x [N.s].
        owedy: the same, y [N.s].
    """
    (
        bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey, _, _,
        H, step, springx, springy, massx, massy, dampx0, dampy0, dampx1, dampy1,
    ) = x  # fmt: skip
    u1x, u1y, u2x, u2y, px, py, sxx, sxy, syy, det = s["pose"]
    r2 = w1 + w2
    vx = u1x * w1 + u2x * r2
    vy = u1y * w1 + u2y * r2
    turned, dx, dy, dz = s["turned_clay"], bx1 + dampx1, by1 + dampy1, 0.0
    if turned:  # and never stiff, see Scenario
        cos, sin = s["grain"]
        x, y = clay.turned_force(cos, sin, bx0, by0, vx, vy)
        fx, fy = uhx - x, uhy - y
        dx, dy, dz = clay.turned_damping(cos, sin, bx1, by1)
        dx, dy = dx + dampx1, dy + dampy1
    else:
        fx = uhx - bx0 * vx
        fy = uhy - by0 * vy
    held, sticks, cx, cy = s["held"], s["sticks"], 0.0, 0.0
    if held or sticks:
        s1 = w1 * w1
        s2 = r2 * r2
        cx = u1y * s1 + u2y * s2
        cy = -u1x * s1 - u2x * s2
        if stiff:  # after the sample the handle stands still where the clay is stiff
            cx, cy = arm.centripetal_about_sample(
                L, cx, cy, 0.0 if sharex else vx, 0.0 if sharey else vy, (u1x, u1y, u2x, u2y)
            )
    if held:
        fx -= springx * px - massx * cx + dampx0 * vx
        fy -= springy * py - massy * cy + dampy0 * vy
    pullx, pully = 0.0, 0.0
    if s["springs"] == 1:
        pullx, pully = loop.spring_force(s, L)
        fx -= pullx
        fy -= pully
    links = s["arm"]
    a1, a2 = (t1 - t2) / links[2], t2 / links[3]
    restx, resty, softx, softy = 0.0, 0.0, 0.0, 0.0
    if stiff:
        restx, resty = owedx / H, owedy / H
        hx, hy = uhx - springx * px - pullx, uhy - springy * py - pully
        hx, hy = arm.handle_acceleration(a1, a2, hx, hy, (u1x, u1y, u2x, u2y), links)
        hx, hy = clay.slow_force(
            hx, hy, sxx, sxy, syy, sharex, sharey, (bx0 + bx1) * vx, (by0 + by1) * vy
        )
        if sticks:
            hx, hy = loop.creeping_force(s, L, (hx, hy), (bx0 + bx1, by0 + by1), (vx, vy))
        owedx, owedy, softx, softy = loop.owed_impulse(
            step, springx, springy, sharex, sharey, hx, hy
        )
        fx += owedx - restx
        fy += owedy - resty
        dx += softx
        dy += softy
    # see controller.velocity_under_torque
    n = 1.0 / H
    gx = n * vx + (u1x * a1 + u2x * a2) + sxx * fx + sxy * fy
    gy = n * vy + (u1y * a1 + u2y * a2) + sxy * fx + syy * fy
    if dz:
        ux, uy = controller.solve_turned((n, n), (gx, gy), (sxx, sxy, syy), (dx, dy, dz))
    elif dx or dy:
        m1 = n + sxx * dx
        m2 = sxy * dy
        r = sxy * dx / m1
        uy = (gy - r * gx) / (n + syy * dy - r * m2)
        ux = (gx - m2 * uy) / m1
    else:
        ux = gx / n
        uy = gy / n
    rx, ry = 0.0, 0.0
    if sticks:
        s["anchor"][0], s["anchor"][1] = s["anchor_from"][0], s["anchor_from"][1]
        ux, uy, rx, ry = loop.yield_in_kick(
            s, H, L, (n, n), (sxx, sxy, syy), (dx, dy, dz), (vx, vy), (ux, uy), (cx, cy), (px, py)
        )
    if stiff:
        owedx -= softx * ux
        owedy -= softy * uy
        restx -= owedx
        resty -= owedy
    gx = (ux - vx) / H
    gy = (uy - vy) / H
    g1 = (gx * u2y - gy * u2x) / det
    g2 = (gy * u1x - gx * u1y) / det
    shown, left = s["loop"], s["left"]
    fx -= dx * ux
    fy -= dy * uy
    if turned:
        fx -= dz * uy
        fy -= dz * ux
        restx, resty = loop.turned_rest(s["grain"], (bx0, bx1, by0, by1), vx, vy, ux, uy)
    n1, n2 = w1 + H * g1, w2 + H * (g2 - g1)
    if sticks:
        fx, fy = fx - rx, fy - ry
        if s["felt"][8] > 0.0:
            n1, n2 = 0.0, 0.0
    if s["beyond"]:
        s["felt"][12], s["felt"][13] = pullx, pully
        restx, resty = restx + (rx + pullx), resty + (ry + pully)
    put10(s["sample"], 0, px, py, vx, vy, fx, fy, shown[0], shown[4], restx, resty)
    put4(s["end"], 0, ux, uy, n1, n2)
    left[0], left[1] = H * owedx, H * owedy


def push(s, x, hold, w1, w2, owedx, owedy):
    """Works out one kick under held torques and friction.

    Args:
        s: state of the run; gets sample, end, left and slip.
        x: from `ready_kick`.
        hold: what the motors hold, see SAMPLED_STATE.
        w1: rate of joint 1 before the kick [rad/s].
        w2: rate of joint 2 before the kick [rad/s].
        owedx: impulse that stiff clay owes from the step before, x [N.s].
        owedy: the same, y [N.s].
    """
    t1, t2 = hold[0], hold[1]
    if s["rubs"] and s["sticks"]:
        friction_torque(shoulder_rate, s["friction"][0], s, x, (t1, t2), (w1, w2), (owedx, owedy))
        return
    n1, n2, f1, f2 = 0.0, 0.0, 0.0, 0.0
    end = s["end"]
    # with friction: the kick without it, and under one N.m more on either joint
    for trial in range(4 if s["rubs"] else 1):
        if trial == 0:
            kick(s, x, t1, t2, w1, w2, owedx, owedy)
            n1, n2 = end[2], end[3]
        elif trial == 1:
            kick(s, x, t1 + 1.0, t2, w1, w2, owedx, owedy)
            f1, f2 = end[2], end[3]
        elif trial == 2:
            kick(s, x, t1, t2 + 1.0, w1, w2, owedx, owedy)
            a12 = 0.5 * (f2 - n2 + end[2] - n1)  # equal but for rounding
            limit = s["friction"]
            f1, f2 = hardware.coulomb_friction(
                (n1, n2), f1 - n1, a12, end[3] - n2, (limit[0], limit[1])
            )
        else:
            kick(s, x, t1 + f1, t2 + f2, w1, w2, owedx, owedy)
            s["slip"][0], s["slip"][1] = f1, f2


def friction_torque(rate, limit, *args):
    """Coulomb friction of one joint in a kick that is not linear in the torques.

    The rate after a kick grows with the torque. The joint rests under a torque within the limit, or
    slides against the limit.

    Args:
        rate: of the joint after the kick [rad/s], function of (torque of its friction [N.m],
            *args), which leaves the kick worked out.
        limit: of the torque [N.m].
        args: further arguments of rate, which was last called for the torque.

    Returns:
        The torque [N.m].
    """
    at = rate(0.0, *args)
    if at == 0.0 or limit == 0.0:
        return 0.0
    most = -math.copysign(limit, at)
    end = rate(most, *args)
    if end == 0.0 or (end > 0.0) == (at > 0.0):
        return most
    # false position, Illinois; clay helps to hold the joint over a range of torques, within which
    # its rate is 0.0
    a, fa, b, fb, f = 0.0, at, most, end, most
    for _ in range(FRICTION_ROUNDS):
        f = b - fb * (b - a) / (fb - fa)
        new = rate(f, *args)
        if new == 0.0:
            return f
        if (new > 0.0) != (fb > 0.0):
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = f, new
        if abs(new) <= FRICTION_CLOSE * abs(at) or abs(b - a) <= FRICTION_CLOSE * limit:
            break
    if rate(f + FRICTION_NUDGE * most, *args) == 0.0:  # such a range begins here
        return f + FRICTION_NUDGE * most
    rate(f, *args)
    return f


def shoulder_rate(f1, s, x, t, w, owed):
    """Rate of joint 1 after a kick, with friction in joint 2; as `elbow_rate`.

    Args:
        f1: torque of the friction in joint 1 [N.m].
        s: state of the run.
        x: from `ready_kick`.
        t: torques of the motors, (shoulder, elbow) [N.m].
        w: rates before the kick [rad/s].
        owed: impulse that stiff clay owes from the step before, (x, y) [N.s].

    Returns:
        The rate [rad/s].
    """
    f2 = friction_torque(elbow_rate, s["friction"][1], s, x, (t[0] + f1, t[1]), w, owed)
    s["slip"][0], s["slip"][1] = f1, f2
    return s["end"][2]


def elbow_rate(f2, s, x, t, w, owed):
    """Rate of joint 2 after a kick, which is worked out.

    Args:
        f2: torque of the friction in joint 2 [N.m].
        s: state of the run.
        x: from `ready_kick`.
        t: other torques, (shoulder, elbow) [N.m].
        w: rates before the kick [rad/s].
        owed: impulse that stiff clay owes from the step before, (x, y) [N.s].

    Returns:
        The rate [rad/s].
    """
    kick(s, x, t[0], t[1] + f2, w[0], w[1], owed[0], owed[1])
    return s["end"][3]


def sample_velocity(s, x):
    """Handle velocity at the sample of the kick last worked out.

    Args:
        s: state of the run.
        x: from `ready_kick`, of that kick.

    Returns:
        (vx, vy) [m/s], 0.0 where clay holds the handle.
    """
    _, _, vx, vy, _, _, _, _, restx, resty = s["sample"]
    ux, uy, _, _ = s["end"]
    felt, sticks = s["felt"], s["sticks"]
    if sticks:
        restx, resty = restx - felt[0], resty - felt[1]
    if s["springs"] == 1:
        restx, resty = restx - felt[12], resty - felt[13]
    slowx = loop.velocity_at_sample(x, 0, vx, ux, restx)
    slowy = loop.velocity_at_sample(x, 1, vy, uy, resty)
    if not sticks:
        return slowx, slowy
    vx, vy = felt[2], felt[3]
    if s["turned_clay"]:  # which is never stiff, see Scenario
        return vx, vy
    if x[10] > 0.0 and vx != 0.0:
        vx = slowx
    if x[11] > 0.0 and vy != 0.0:
        vy = slowy
    return loop.not_against(s, vx, vy, felt[4], felt[5])


def add_works(s, x, hold, w1, w2, work):
    """Adds the works of the kick worked out.

    Args:
        s: state of the run.
        x: from `ready_kick`.
        hold: what the motors hold, see SAMPLED_STATE.
        w1: rate of joint 1 before the kick [rad/s].
        w2: rate of joint 2 before the kick [rad/s].
        work: sums to add to [J], see path.STATE.
    """
    _, _, vx, vy, _, _, _, _, restx, resty = s["sample"]
    ux, uy, n1, n2 = s["end"]
    H = x[12]
    w1, w2 = 0.5 * (w1 + n1), 0.5 * (w2 + n2)
    muscle, motors, taken, hand, through = energy.kick_work(
        H, x, restx, resty, vx, vy, ux, uy, hold[0], hold[1], w1, w2,
        s["handx"][1], s["handy"][1],
    )  # fmt: skip
    work[0] += muscle
    work[1] += motors
    work[2] += taken
    work[3] += hand
    work[4] += through
    if s["wired"]:
        slip = s["slip"]
        vx, vy = 0.5 * (vx + ux), 0.5 * (vy + uy)
        work[5] += -H * (slip[0] * w1 + slip[1] * w2)
        work[6] += H * (hold[4] * vx + hold[5] * vy)
        work[7] += H * (hold[6] * (vx - hold[8]) + hold[7] * (vy - hold[9]))


def look_for_event(s):
    """Finds whether now is an event, and whether it is a sample.

    Args:
        s: state of the run.
    """
    now = s["t"] + SLACK * s["dt"]
    s["acts"] = 1 if s["when"] <= now else 0
    s["event"] = 1 if s["acts"] or s["due"] <= now else 0


def respond(s, e):
    """The controller acts at an event: works out what `commit` will take.

    Args:
        s: state of the run; early, whole, uh and shift hold what belongs to now.
        e: its arrays.
    """
    w1, w2 = s["w"]
    owedx, owedy = s["owed"]
    for j in range(2 if s["sticks"] else 0):
        s["anchor_from"][j] = s["anchor_next"][j] = s["anchored"][j]
        s["stuck_next"][j] = s["stuck"][j]
    if s["before"] > 0.0:
        x, hold, work = s["early"], s["hold"], s["early_work"]
        push(s, x, hold, w1, w2, owedx, owedy)
        for j in range(path.SUMS):
            work[j] = 0.0
        add_works(s, x, hold, w1, w2, work)
        ux, uy, n1, n2 = s["end"]
        _, _, vx, vy, fx, fy, _, _, restx, resty = s["sample"]
        s["early_force"][0] = fx + x[0] * vx + x[1] * ux + restx
        s["early_force"][1] = fy + x[2] * vy + x[3] * uy + resty
        put4(s["start"], 0, n1, n2, s["left"][0], s["left"][1])
        t1, t2 = hold[0] + s["slip"][0], hold[1] + s["slip"][1]
        if s["sticks"]:
            for j in range(path.FELT):
                s["early_felt"][j] = s["felt"][j]
            for j in range(2):
                s["stuck_next"][j] = int(s["felt"][6 + j])
                s["anchor_next"][j] = s["anchor"][j]
        x = s["whole"]
        if x[10] or x[11]:  # half a kick holds too little of stiff clay
            n1, n2 = soft_rates(s, x, (ux, uy, n1, n2))
        if s["sticks"]:
            find_yield_force(s, n1, n2, t1, t2)
        fx, fy = felt_force(s, n1, n2, t1, t2)
        w1, w2 = n1, n2
    else:
        put4(s["start"], 0, w1, w2, owedx, owedy)
        if s["sticks"]:
            find_yield_force(s, w1, w2, 0.0, 0.0)
        fx, fy = first_force(s)
    s["shown"] = 0
    if s["acts"]:
        sample(s, e, w1, w2, fx, fy)
    if s["delay"] > 0.0:
        take_due(s, e.ring)


def soft_rates(s, x, half):
    """Joint rates in stiff clay now: those of a whole kick, with the step before it repeated.

    Args:
        s: state of the run.
        x: from `ready_kick`, of the whole kick.
        half: velocity [m/s] and joint rates [rad/s] after half of it.

    Returns:
        Rates of both joints [rad/s].
    """
    ux, uy, n1, n2 = half
    push(s, x, s["hold"], s["w"][0], s["w"][1], s["owed"][0], s["owed"][1])
    vx, vy = sample_velocity(s, x)
    vx, vy = vx if x[10] > 0.0 else ux, vy if x[11] > 0.0 else uy
    if vx != ux or vy != uy:
        u1x, u1y, u2x, u2y, _, _, _, _, _, _ = s["pose"]
        r1, r2 = arm.joint_velocity(vx, vy, (u1x, u1y, u2x, u2y), 1.0)
        n1, n2 = r1, r2 - r1
    return n1, n2


def handle_motion(pose, w1, w2):
    """Velocity and centripetal acceleration of the handle.

    Args:
        pose: begins with arm.jacobian.
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].

    Returns:
        (vx, vy [m/s], cx, cy [m/s^2]).
    """
    u1x, u1y, u2x, u2y = pose[0], pose[1], pose[2], pose[3]
    r2 = w1 + w2
    s1 = w1 * w1
    s2 = r2 * r2
    return (
        u1x * w1 + u2x * r2, u1y * w1 + u2y * r2, u1y * s1 + u2y * s2, -u1x * s1 - u2x * s2
    )  # fmt: skip


def first_force(s):
    """The operator's force on the sensor of a handle that does not accelerate.

    Args:
        s: state of the run.

    Returns:
        (x, y) [N].
    """
    uhx, uhy = s["uh"]
    if not s["held"]:
        return uhx, uhy
    pose, x, y = s["pose"], s["handx"], s["handy"]
    vx, vy, _, _ = handle_motion(pose, s["w"][0], s["w"][1])
    return uhx - x[2] * pose[4] - x[1] * vx, uhy - y[2] * pose[5] - y[1] * vy


def felt_force(s, w1, w2, t1, t2):
    """The operator's force on the sensor at the sample, before the torques change.

    Args:
        s: state of the run.
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].
        t1: torque on the shoulder [N.m].
        t2: torque on the elbow [N.m].

    Returns:
        (x, y) [N].
    """
    uhx, uhy = s["uh"]
    if not s["held"]:
        return uhx, uhy
    u1x, u1y, u2x, u2y, px, py, _, _, _, _ = s["pose"]
    massx, damperx, springx = s["handx"]
    massy, dampery, springy = s["handy"]
    vx, vy, cx, cy = handle_motion(s["pose"], w1, w2)
    restx = uhx - operator.operator_force(springx, massx, damperx, px, cx, vx)
    resty = uhy - operator.operator_force(springy, massy, dampery, py, cy, vy)
    fx, fy = restx, resty
    if s["physical"]:
        bx, by = path.damping_before(s, s["t"])
        if s["turned_clay"]:
            fex, fey = clay.turned_force(s["grain"][0], s["grain"][1], bx, by, vx, vy)
        else:
            fex, fey = bx * vx, by * vy
        if s["sticks"]:
            fex, fey = fex + s["yield_force"][0], fey + s["yield_force"][1]
        if s["springs"]:  # of the clay before the sample
            fex, fey = fex + s["sprung"][2], fey + s["sprung"][3]
        fx, fy = restx - fex, resty - fey
    # a kick of one second from rest, in which the velocity after it is the acceleration
    ax, ay = controller.velocity_under_torque(
        1.0, (0.0, 0.0), (u1x, u1y, u2x, u2y), s["arm"], (t1, t2), (fx, fy), (massx, massy)
    )
    return restx - massx * ax, resty - massy * ay


def find_yield_force(s, w1, w2, t1, t2):
    """Force of physical clay beside b v at the sample, before the torques change; to yield_force.

    Where clay holds the handle it is what keeps it from accelerating.

    Args:
        s: state of the run; stuck_next tells what rests.
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].
        t1: torque on the shoulder [N.m].
        t2: torque on the elbow [N.m].
    """
    u1x, u1y, u2x, u2y, px, py, wxx, wxy, wyy, _ = s["pose"]
    massx, damperx, springx = s["handx"]
    massy, dampery, springy = s["handy"]
    vx, vy, cx, cy = handle_motion(s["pose"], w1, w2)
    bx, by = path.damping_before(s, s["t"])
    fex, fey = path.viscous_parts(s, bx, by, vx, vy)
    if s["springs"]:
        fex, fey = fex + s["sprung"][2], fey + s["sprung"][3]
    fx = s["uh"][0] - operator.operator_force(springx, massx, damperx, px, cx, vx) - fex
    fy = s["uh"][1] - operator.operator_force(springy, massy, dampery, py, cy, vy) - fey
    # a kick of one second from rest, in which the velocity after it is the acceleration
    ax, ay = controller.velocity_under_torque(
        1.0, (0.0, 0.0), (u1x, u1y, u2x, u2y), s["arm"], (t1, t2), (fx, fy), (massx, massy)
    )
    xx, xy, yx, yy = controller.velocity_per_force((1.0, 1.0), (wxx, wxy, wyy), (massx, massy, 0.0))
    h, c, g = REACTION, s["grain"][0], s["grain"][1]
    B, ax, ay = (h * xx, h * xy, h * yx, h * yy), ax - cx, ay - cy
    law = loop.NO_FLOW
    if s["grooved"]:
        rests = s["stuck_next"][0] and s["stuck_next"][1]
        law = loop.groove_in_kick(s, B, (0.0, 0.0) if rests else (vx, vy), (ax, ay))
    if s["turned_clay"]:
        B = loop.turned_matrix(c, g, B)
        vx, vy = controller.along_axes(c, g, vx, vy)
        ax, ay = controller.along_axes(c, g, ax, ay)
    vx, vy = 0.0 if s["stuck_next"][0] else vx, 0.0 if s["stuck_next"][1] else vy
    end = vx + h * ax, vy + h * ay
    if not s["grooved"]:
        law = loop.law_in_kick(s, 1.0, vx, vy)
    if s["yields"] == 2:
        _, _, _, _, _, _, fx, fy, _, _ = flow.resist_along(B, (vx, vy), end, law, 0.0)
    else:
        _, _, _, _, _, _, fx, fy, _, _ = flow.resist_axes(B, (vx, vy), end, law, 0.0)
    if s["turned_clay"]:
        fx, fy = controller.along_axes(c, -g, fx, fy)
    s["yield_force"][0], s["yield_force"][1] = fx, fy


def force_in_motion(s, vx, vy):
    """Force of clay that yields, beside b v, on a handle in motion; none at rest.

    Args:
        s: state of the run.
        vx: handle velocity, x [m/s].
        vy: the same, y [m/s].

    Returns:
        (x, y) [N].
    """
    c, g, turned = s["grain"][0], s["grain"][1], s["turned_clay"]
    Fyx, Kx, nx, Fyy, Ky, ny = s["flow"]
    if s["grooved"]:
        Fyx, Kx, nx, Fyy, Ky, ny = loop.groove_law(s, vx, vy)
    if turned:
        vx, vy = controller.along_axes(c, g, vx, vy)
    fx, fy = flow.motion_force((Fyx, Kx, nx, Fyy, Ky, ny), s["yields"] == 2, vx, vy)
    if turned:
        fx, fy = controller.along_axes(c, -g, fx, fy)
    return fx, fy


def sample(s, e, w1, w2, fx, fy):
    """One sample: what is measured, what the motors are to hold, the compensator at the next.

    Args:
        s: state of the run.
        e: its arrays.
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].
        fx: the operator's force on the sensor, x [N].
        fy: the same, y [N].
    """
    pose, hold = s["pose"], s["hold_next"]
    shown = True
    if s["wired"]:
        a, b, c, d, k, m, n, o, p, q, r, t, u, v = s["wires"]
        put14(s["wires_next"], 0, a, b, c, d, k, m, n, o, p, q, r, t, u, v)
        fx, fy = sensed_force(s, fx, fy)
        shown = s["lost"] == 0
        if shown:
            w1, w2 = measured_rates(s, e.ring, w1, w2)
    if shown and s["own"]:
        ask_law(s, e, w1, w2, fx, fy)
    elif shown:
        u1x, u1y, u2x, u2y, px, py, wxx, wxy, wyy, _ = pose
        if s["encoder"]:
            ox, oy = s["origin"]
            links = s["arm"]
            u1x, u1y, u2x, u2y = arm.jacobian(s["turned"][0], s["turned"][1], links)
            px, py = u1y + u2y - ox, -oy - u1x - u2x
            wxx, wxy, wyy = arm.mobility((u1x, u1y, u2x, u2y), links)
        det = u1x * u2y - u2x * u1y
        vx, vy, cx, cy = handle_motion((u1x, u1y, u2x, u2y), w1, w2)
        bx, by = path.damping_now(s, s["t"])
        if s["turned_clay"]:
            fex, fey = clay.turned_force(s["grain"][0], s["grain"][1], bx, by, vx, vy)
        else:
            fex, fey = bx * vx, by * vy
        if s["sticks"]:
            fex, fey = fex + s["yield_force"][0], fey + s["yield_force"][1]
        elif s["yields"]:
            rx, ry = force_in_motion(s, vx, vy)
            fex, fey = fex + rx, fey + ry
        if s["springs"] == 2 and s["encoder"]:
            fex, fey = fex + measured_pull(s, 0, px), fey + measured_pull(s, 1, py)
        elif s["springs"]:
            fex, fey = fex + s["sprung"][0], fey + s["sprung"][1]
        put10(hold, 0, 0.0, 0.0, fex, fey, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        if s["coupled"] or s["guarded"]:
            render(s, e.ring, (px, py), (vx, vy), (bx, by), (wxx, wyy))
            fex, fey = hold[2], hold[3]
        fx, fy = fx - fex, fy - fey
        # the servo's law, see controller.feedback_law and controller.solve_velocity
        if s["formed"]:
            show_form(s, fx, fy)
        deltax, _, yx, ydx, deltay, _, yy, ydy = s["loop"]
        ax, _ = controller.feedback_law(s["servox"], deltax, yx, ydx, px, vx, cx)
        ay, _ = controller.feedback_law(s["servoy"], deltay, yy, ydy, py, vy, cy)
        if s["shaping"]:
            wxx, wxy, wyy = s["servox"][3], 0.0, s["servoy"][3]
        ux = ax + wxx * fx + wxy * fy
        uy = ay + wxy * fx + wyy * fy
        t2 = s["arm"][3] * ((uy * u1x - ux * u1y) / det) - u2x * fx - u2y * fy
        t1 = s["arm"][2] * ((ux * u2y - uy * u2x) / det) - u1x * fx - u1y * fy + t2
        if not s["physical"]:
            p1, p2 = arm.joint_torques(fex, fey, (u1x, u1y, u2x, u2y))
            t1, t2 = t1 - p1, t2 - p2
        hold[0], hold[1] = driven_torques(s, t1, t2)
        if s["wired"]:
            s["wires_next"][6], s["wires_next"][7] = fx, fy
        s["shown"] = 1
    else:
        fx, fy = s["wires"][6], s["wires"][7]
        for j in range(HOLD):
            hold[j] = s["hold"][j]
    if s["own"]:
        pass
    elif s["formed"]:
        next_form(s, 0, fx)
        next_form(s, 1, fy)
    else:
        next_memory(s, fx, fy)


def measured_pull(s, i, p):
    """Force of the springs that the motors render, at a place as an encoder reads it.

    What gave way and what relaxed since goes by the true place.

    Args:
        s: state of the run.
        i: axis.
        p: the place [m].

    Returns:
        The force [N].
    """
    spring, stretch, n = s["spring"], s["stretch"], i * regions.SPRING
    k, limit, k1, way = spring[n], spring[n + 1], spring[n + 2], spring[n + 5]
    _, f, _, _ = springs.spring_step(k, limit, way, stretch[2 * i], p)
    # the second spring is as long as when the handle was last seen, and what was misread
    rest = s["sprung_at"][i] - stretch[2 * i + 1]
    _, f1, _, _ = springs.spring_step(k1, INF, way, rest, p)
    return f + f1


def driven_torques(s, t1, t2):
    """Torques of the motors, within their limits and behind the converter.

    Args:
        s: state of the run.
        t1: torque asked of the shoulder [N.m].
        t2: torque asked of the elbow [N.m].

    Returns:
        (shoulder, elbow) [N.m].
    """
    limit1, limit2 = s["torque_limit"]
    t1 = min(max(t1, -limit1), limit1)
    t2 = min(max(t2, -limit2), limit2)
    if s["dac_bits"]:
        t1 = hardware.quantize(t1, s["dac_bits"], s["dac_range"][0])
        t2 = hardware.quantize(t2, s["dac_bits"], s["dac_range"][1])
    return t1, t2


def ask_law(s, e, w1, w2, fx, fy):
    """Lets a controller of the user's own say what the motors are to hold.

    Args:
        s: state of the run.
        e: its arrays.
        w1: rate of joint 1 as measured [rad/s].
        w2: rate of joint 2 as measured [rad/s].
        fx: hand force as measured, x [N].
        fy: the same, y [N].
    """
    desk, hold, q = e.desk, s["hold_next"], s["q"]
    if s["encoder"]:
        q = s["turned"]
    if s["asked"] != s["k"]:  # once more for the same sample the state is what it was
        n = s["own"] - 1
        for j in range(n):
            desk[DESK + j] = desk[DESK + n + j]
        s["asked"] = s["k"]
    desk[0], desk[1], desk[2], desk[3], desk[4] = s["t"], q[0], q[1], w1, w2
    desk[5], desk[6] = fx, fy
    desk[TORQUE] = desk[TORQUE + 1] = NAN  # what a call that fails leaves behind
    e.law(e.law_data)
    t1, t2 = desk[TORQUE], desk[TORQUE + 1]
    put10(hold, 0, t1, t2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if abs(t1) + abs(t2) < INF:
        hold[0], hold[1] = driven_torques(s, t1, t2)
    else:  # limits would hide it, and a delay put it off
        s["code"] = path.NOT_FINITE
    s["shown"] = 1


def show_form(s, fx, fy):
    """Puts delta at the sample into the loop, where the compensator is formed.

    Args:
        s: state of the run.
        fx: net force, x [N].
        fy: net force, y [N].
    """
    form, z, start = s["form"], s["form_states"], s["form_start"]
    for i in range(2):
        o, j = compensator.FORM * i + 20, compensator.ORDER * i
        shown = start[i] + s["gain"][i] * form[o + 4] * (fy if i else fx)
        for r in range(compensator.ORDER):
            shown += form[o + r] * z[j + r]
        s["loop"][4 * i] = shown


def next_form(s, i, f):
    """States of a formed compensator and of the reference model at the next sample, one axis.

    Args:
        s: state of the run.
        i: axis, 0 for x, 1 for y.
        f: net force [N].
    """
    m, z, order = s["form_memory"], s["form_states"], compensator.ORDER
    x, out, j, o = s["loop"], s["loop_next"], order * i, FORM_MEMORY * i
    form, place = s["form"], compensator.FORM * i + 20
    shown = s["form_start"][i] + s["shift"][i] + s["gain"][i] * form[place + 4] * f
    for r in range(order + 2):
        new = m[o + 4] * x[4 * i + 2] + m[o + 5] * x[4 * i + 3]
        new += m[o + 6] * s["form_start"][i] + m[o + 7] * f
        for c in range(order):
            new += m[o + c] * z[j + c]
        if r < order:
            s["form_next"][j + r] = new
            shown += form[place + r] * new
        else:
            out[4 * i + 2 + r - order] = new
        o += 8
    out[4 * i] = shown


def next_memory(s, fx, fy):
    """States of compensator and reference model at the next sample.

    Args:
        s: state of the run.
        fx: net force, x [N].
        fy: net force, y [N].
    """
    (
        a00, a01, a02, a03, b0, a10, a11, a12, a13, b1,
        a20, a21, a22, a23, b2, a30, a31, a32, a33, b3,
        c00, c01, c02, c03, d0, c10, c11, c12, c13, d1,
        c20, c21, c22, c23, d2, c30, c31, c32, c33, d3,
    ) = s["memory"]  # fmt: skip
    x0, x1, x2, x3, y0, y1, y2, y3 = s["loop"]
    shift = s["shift"]
    put8(
        s["loop_next"], 0,
        a00 * x0 + a01 * x1 + a02 * x2 + a03 * x3 + b0 * fx + shift[0],
        a10 * x0 + a11 * x1 + a12 * x2 + a13 * x3 + b1 * fx,
        a20 * x0 + a21 * x1 + a22 * x2 + a23 * x3 + b2 * fx,
        a30 * x0 + a31 * x1 + a32 * x2 + a33 * x3 + b3 * fx,
        c00 * y0 + c01 * y1 + c02 * y2 + c03 * y3 + d0 * fy + shift[1],
        c10 * y0 + c11 * y1 + c12 * y2 + c13 * y3 + d1 * fy,
        c20 * y0 + c21 * y1 + c22 * y2 + c23 * y3 + d2 * fy,
        c30 * y0 + c31 * y1 + c32 * y2 + c33 * y3 + d3 * fy,
    )  # fmt: skip


def sensed_force(s, fx, fy):
    """The hand force behind noise, filter and converter; the filters' states go to wires_next.

    Args:
        s: state of the run.
        fx: force on the sensor, x [N].
        fy: the same, y [N].

    Returns:
        (x, y) [N].
    """
    fx, fy = fx + s["noise"][0], fy + s["noise"][1]
    f, wires = s["force_filter"], s["wires_next"]
    if s["filters"]:
        shownx, showny = wires[2], wires[4]
        wires[2], wires[3] = hardware.filter_step(f, wires[2], wires[3], fx)
        wires[4], wires[5] = hardware.filter_step(f, wires[4], wires[5], fy)
        fx, fy = shownx, showny
    bits, span = s["adc_bits"], s["adc_range"]
    return hardware.quantize(fx, bits, span), hardware.quantize(fy, bits, span)


def measured_rates(s, ring, w1, w2):
    """Joint rates as they are measured; the angles go to turned, the filtered rates to wires_next.

    Args:
        s: state of the run.
        ring: see Engine.
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].

    Returns:
        Rates of both joints [rad/s].
    """
    turned, wires = s["turned"], s["wires_next"]
    turned[0] = hardware.encode(s["q"][0], s["encoder"])
    turned[1] = hardware.encode(s["q"][1], s["encoder"])
    if not s["difference"]:
        return w1, w2
    old, k, Ts, cutoff = s["oldest"], float(s["k"]), s["Ts"], s["cutoff"]
    w1, w2 = hardware.velocity_difference(
        ring[old, 0], (ring[old, 1], ring[old, 2]), k, (turned[0], turned[1]), Ts
    )
    if cutoff > 0.0:
        span = (k - ring[(old - 1) % s["window"], 0]) * Ts
        w1 = hardware.low_pass(wires[0], w1, cutoff, span)
        w2 = hardware.low_pass(wires[1], w2, cutoff, span)
    wires[0], wires[1] = w1, w2
    return w1, w2


def render(s, ring, p, v, b, W):
    """Force of the clay on the handle, by coupling and passivity controller, into hold_next.

    Args:
        s: state of the run.
        ring: see Engine.
        p: handle position, (x, y) [m].
        v: handle velocity, (x, y) [m/s].
        b: clay, (x, y) [N.s/m].
        W: mobility of the handle, (xx, yy) [1/kg].
    """
    hold, wires, Ts = s["hold_next"], s["wires_next"], s["Ts"]
    spring, damper = s["coupling"]
    delay, share = s["whole_delay"], s["part_delay"]
    window, n = s["window"], delay + 2
    since, before = window + (s["newest"] - delay) % n, window + (s["newest"] - delay - 1) % n
    yields = s["yields"] > 0
    if s["coupled"] and yields:
        Fyx, Kx, nx, Fyy, Ky, ny = s["flow"]
        ux, uy, fx, fy = hardware.tool_that_yields(
            (wires[12], wires[13]), p, v, b, (Fyx, Kx, nx, Fyy, Ky, ny), s["yields"] == 2,
            spring, damper, Ts,
        )  # fmt: skip
        wires[12], wires[13] = wires[12] + Ts * ux, wires[13] + Ts * uy
        hold[2], hold[3], hold[6], hold[7], hold[8], hold[9] = fx, fy, fx, fy, ux, uy
    for i in range(2):
        if s["coupled"] and not yields:
            wires[12 + i], u = hardware.virtual_coupling(
                wires[12 + i], p[i], v[i], b[i], spring, damper, Ts
            )
            hold[2 + i] = hold[6 + i] = b[i] * u
            hold[8 + i] = u
        if s["guarded"]:
            # since the last sample the motors have held one force, then another
            mean = (1.0 - share) * ring[since, i] + share * ring[before, i]
            wires[8 + i] += mean * (p[i] - wires[10 + i])
            wires[10 + i] = p[i]
            f = hold[2 + i]
            hold[2 + i] = hardware.passivity_controller(wires[8 + i], f, v[i], Ts, W[i])
            hold[4 + i] = hold[2 + i] - f


def queue_row(s, n):
    """Row of the ring that holds an entry of the queue.

    Args:
        s: state of the run.
        n: which of those queued, 0 for the next.
    """
    delay = s["whole_delay"]
    return s["window"] + delay + 2 + (s["queue_at"] + n) % (delay + 4)


def take_due(s, ring):
    """Puts new torques into the queue and takes those that are due.

    Args:
        s: state of the run.
        ring: see Engine.
    """
    now, hold, entry, n = s["t"] + SLACK * s["dt"], s["hold_next"], s["entry"], 0
    s["enters"] = s["shown"]
    if s["shown"]:
        entry[0] = s["when"] + s["delay"]
        for j in range(HOLD):
            entry[1 + j] = hold[j]
    while n < s["queued"] and ring[queue_row(s, n), 0] <= now:
        n += 1
    if n == s["queued"] and s["enters"] and entry[0] <= now:
        s["enters"] = 0
    elif n > 0:
        row = queue_row(s, n - 1)
        for j in range(HOLD):
            hold[j] = ring[row, 1 + j]
    else:
        for j in range(HOLD):
            hold[j] = s["hold"][j]
    s["leaves"] = n


def take_event(s, chance, ring):
    """Takes what `respond` has worked out.

    Args:
        s: state of the run.
        chance: see Engine.
        ring: see Engine.
    """
    a, b, c, d, f, g, h, i, j, k = s["hold_next"]
    put10(s["hold"], 0, a, b, c, d, f, g, h, i, j, k)
    if s["acts"]:
        a, b, c, d, f, g, h, i = s["loop_next"]
        put8(s["loop"], 0, a, b, c, d, f, g, h, i)
        if s["formed"]:
            for n in range(2 * compensator.ORDER):
                s["form_states"][n] = s["form_next"][n]
            s["form_start"][0] += s["shift"][0]
            s["form_start"][1] += s["shift"][1]
        if s["wired"]:
            take_wires(s, ring)
        s["k"] += 1
        look_ahead(s, chance)
    if s["delay"] > 0.0:
        take_queue(s, ring)
    s["event"] = 0


def take_wires(s, ring):
    """Takes what the hardware remembers.

    Args:
        s: state of the run.
        ring: see Engine.
    """
    a, b, c, d, k, m, n, o, p, q, r, t, u, v = s["wires_next"]
    put14(s["wires"], 0, a, b, c, d, k, m, n, o, p, q, r, t, u, v)
    if s["shown"] and s["difference"]:
        old = s["oldest"]
        ring[old, 0] = float(s["k"])
        ring[old, 1], ring[old, 2] = s["turned"][0], s["turned"][1]
        s["oldest"] = (old + 1) % s["window"]
    if s["shown"] and s["guarded"]:
        s["newest"] = (s["newest"] + 1) % (s["whole_delay"] + 2)
        row = s["window"] + s["newest"]
        if s["delay"] > 0.0:  # what is asked for is not what the motors hold
            ring[row, 0], ring[row, 1] = s["entry"][3], s["entry"][4]
        else:
            ring[row, 0], ring[row, 1] = s["hold"][2], s["hold"][3]


def take_queue(s, ring):
    """Moves the queue on.

    Args:
        s: state of the run.
        ring: see Engine.
    """
    s["queue_at"], s["queued"] = s["queue_at"] + s["leaves"], s["queued"] - s["leaves"]
    if s["enters"]:
        row = queue_row(s, s["queued"])
        for j in range(1 + HOLD):
            ring[row, j] = s["entry"][j]
        s["queued"] += 1
    s["due"] = ring[queue_row(s, 0), 0] if s["queued"] > 0 else INF
    s["due_next"] = ring[queue_row(s, 1), 0] if s["queued"] > 1 else INF


def look_ahead(s, chance):
    """Takes the times of the next two samples, and what happens to the first.

    Args:
        s: state of the run.
        chance: see Engine.
    """
    k, ratio, dt = s["k"], s["ratio"], s["dt"]
    s["when"], s["then"] = k * ratio * dt, (k + 1) * ratio * dt
    if s["random"]:
        row = k - s["first_chance"]
        s["when"] += chance[row, 0]
        s["then"] += chance[row + 1, 0]
        s["lost"] = 1 if chance[row, 1] > 0.0 else 0
        s["noise"][0], s["noise"][1] = chance[row, 2], chance[row, 3]


def work_out(s, x, event):
    """Works out the kick that leads on from now.

    Args:
        s: state of the run.
        x: from `ready_kick`.
        event: whether it follows an event.
    """
    if event:
        w1, w2, owedx, owedy = s["start"]
        if s["sticks"]:
            stuck, after = s["stuck"], s["stuck_next"]
            stuckx, stucky = stuck[0], stuck[1]
            stuck[0], stuck[1] = after[0], after[1]
            s["anchor_from"][0], s["anchor_from"][1] = s["anchor_next"][0], s["anchor_next"][1]
            push(s, x, s["hold_next"], w1, w2, owedx, owedy)
            stuck[0], stuck[1] = stuckx, stucky
            return
        push(s, x, s["hold_next"], w1, w2, owedx, owedy)
    else:
        if s["sticks"]:
            s["anchor_from"][0], s["anchor_from"][1] = s["anchored"][0], s["anchored"][1]
        push(s, x, s["hold"], s["w"][0], s["w"][1], s["owed"][0], s["owed"][1])


def place_after(s, h):
    """Handle position after the kick worked out.

    Args:
        s: state of the run.
        h: time since [s].

    Returns:
        (x, y) [m].
    """
    q, end, origin = s["q"], s["end"], s["origin"]
    x, y = arm.handle_position(q[0] + h * end[2], q[1] + h * end[3], s["arm"])
    return x - origin[0], y - origin[1]


def enter(s, rows, rendered, x, after, shows):
    """Takes the kick worked out, and that to the event, into the ledger and the record.

    Args:
        s: state of the run.
        rows: see Engine.
        rendered: see Engine.
        x: from `ready_kick`.
        after: length of the step after the sample [s].
        shows: whether it has a row of the record.
    """
    before, end = s["before"], s["end"]
    event = s["event"] > 0 and after > 0.0
    early = event and before > 0.0
    hold, w1, w2 = s["hold"], s["w"][0], s["w"][1]
    if event:
        hold, w1, w2 = s["hold_next"], s["start"][0], s["start"][1]
    if early:
        for j in range(path.SUMS):
            s["work"][j] += s["early_work"][j]
    add_works(s, x, hold, w1, w2, s["work"])
    put6(s["final"], 0, s["sample"][0], s["sample"][1], end[0], end[1], end[2], end[3])
    if not shows:
        return
    i = s["filled"]
    px, py, vx, vy, fx, fy, deltax, deltay, restx, resty = s["sample"]
    ux, uy, _, _ = end
    rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3] = s["q"][0], s["q"][1], px, py
    rows[i, 4], rows[i, 5] = sample_velocity(s, x)
    rows[i, 6], rows[i, 7] = x[5], x[6]
    if s["held"]:
        rows[i, 6] = fx + x[0] * vx + x[1] * ux + restx
        rows[i, 7] = fy + x[2] * vy + x[3] * uy + resty
    rows[i, 8], rows[i, 9], rows[i, 10], rows[i, 11] = hold[0], hold[1], deltax, deltay
    bx, by = path.damping_now(s, s["t"]) if after > 0.0 else path.damping_before(s, s["t"])
    rows[i, 12], rows[i, 13] = bx, by
    enter_rates(s, rows, i)
    if early:
        # the means of both kicks, half of each step, interpolated at the sample
        share, f = after / (before + after), s["early_force"]
        rows[i, 6] += share * (f[0] - rows[i, 6])
        rows[i, 7] += share * (f[1] - rows[i, 7])
    if len(rendered):
        share = after / (before + after) if early else 0.0
        enter_force(s, rows, rendered, i, (hold[2], hold[3]), share)
    s["filled"] = i + 1


def enter_force(s, rows, rendered, i, held, share):
    """Enters the force of the clay where b v does not tell it.

    Args:
        s: state of the run.
        rows: see Engine; row i has velocity and damping.
        rendered: see Engine.
        i: the row.
        held: force that the motors hold, (x, y) [N].
        share: of the kick to the sample in the force at it.
    """
    fx, fy = held
    if s["physical"] or (s["own"] and not s["wired"]):
        vx, vy = rows[i, 4], rows[i, 5]
        fx, fy = path.viscous_parts(s, rows[i, 12], rows[i, 13], vx, vy)
        felt, old = s["felt"], s["early_felt"]
        rx, ry = felt[4], felt[5]
        if not s["sticks"]:
            rx, ry = force_in_motion(s, vx, vy) if s["yields"] else (0.0, 0.0)
        elif share > 0.0:
            rx, ry = rx + share * (old[4] - rx), ry + share * (old[5] - ry)
        fx, fy = fx + rx, fy + ry
        if s["springs"]:
            fx, fy = fx + s["sprung"][0], fy + s["sprung"][1]
    rendered[i, 0], rendered[i, 1] = fx, fy
    if s["grooved"]:
        rendered[i, 2] = s["removed"][0] + s["removed"][1]


def enter_rates(s, rows, i):
    """Enters the joint rates of a row, from its velocity.

    Args:
        s: state of the run.
        rows: see Engine.
        i: the row.
    """
    u1x, u1y, u2x, u2y, _, _, _, _, _, _ = s["pose"]
    r1, r2 = arm.joint_velocity(rows[i, 4], rows[i, 5], (u1x, u1y, u2x, u2y), 1.0)
    rows[i, 14], rows[i, 15] = r1, r2 - r1


def command(s, ctrl, push, after):
    """Gives the engine a step with the kick worked out, and that to the event.

    Args:
        s: state of the run.
        ctrl: see Engine.
        push: see Engine.
        after: length of the step [s].
    """
    hold, w, end, left = s["hold"], s["w"], s["end"], s["left"]
    s["owed"][0], s["owed"][1] = left[0], left[1]
    t1, t2, bx, by, p1, p2 = loop.whole_kick(s, w[0], w[1], end[2], end[3], hold[0], hold[1], after)
    ctrl[0], ctrl[1] = t1, t2
    if s["dampers"]:
        ctrl[2], ctrl[3] = bx, by
    push[0], push[1] = p1, p2


def note_stops(s, e):
    """Notes where clay stops the handle or lets it go in the kick worked out, and that to an event.

    Args:
        s: state of the run.
        e: its arrays.
    """
    felt, early, t = s["felt"], s["early_felt"], s["t"]
    if s["event"] and s["before"] > 0.0:
        for j in range(path.FELT):
            felt[j], early[j] = early[j], felt[j]
        path.note_stop(s, e, t, int(felt[6]), int(felt[7]))
        for j in range(path.FELT):
            felt[j], early[j] = early[j], felt[j]
    path.note_stop(s, e, t, int(felt[6]), int(felt[7]))
    s["anchored"][0], s["anchored"][1] = s["anchor"][0], s["anchor"][1]


def observe(s, q, w, table, after):
    """Reads the engine after a step.

    Args:
        s: state of the run.
        q: see Engine.
        w: see Engine.
        table: see Engine.
        after: length of the step [s].
    """
    s["steps"] += 1
    if s["sticks"] and s["stuck"][0] and s["stuck"][1]:
        w[0], w[1] = 0.0, 0.0  # the engine's rounding would creep
    for j in range(2):
        s["q"][j], s["w"][j] = q[j], w[j]
    measure_pose(s)
    if s["springs"]:
        path.feel_spring(s, table, after)
    if s["smooth"]:
        path.feel_place(s, table)


def ready_kicks(s, ahead, row, grows):
    """Readies the kicks of a whole step between whole steps.

    Args:
        s: state of the run.
        ahead: see Engine.
        row: of it; -1 where nothing is driven.
        grows: whether the clay changes, so that all numbers do.
    """
    dt, now, shift, force = s["dt"], s["uh"], s["shift"], s["force"]
    early, late, whole = (force[0], force[1]), (force[0], force[1]), (force[0], force[1])
    now[0], now[1], shift[0], shift[1] = force[0], force[1], 0.0, 0.0
    if row >= 0:
        a = ahead
        early, late, whole = (a[row, 0], a[row, 1]), (a[row, 2], a[row, 3]), (a[row, 4], a[row, 5])
        now[0], now[1], shift[0], shift[1] = a[row, 6], a[row, 7], a[row, 8], a[row, 9]
    if row < 0 or grows:
        ready_kick(s, s["early"], dt, 0.0, early)
        ready_kick(s, s["late"], 0.0, dt, late)
        ready_kick(s, s["whole"], dt, dt, whole)
    else:
        s["early"][5], s["early"][6] = early
        s["late"][5], s["late"][6] = late
        s["whole"][5], s["whole"][6] = whole


@functools.lru_cache(maxsize=256)
def formed_memory(servo: Servo, shape: Compensator, K: float, T: float) -> np.ndarray:
    """Rows of `next_form` of one axis: exact, by a matrix exponential, under a held force.

    Args:
        servo: of the axis.
        shape: of C.
        K: gain of the compensator.
        T: length of the sample [s].

    Returns:
        Shape (6, 8): z filled up to the highest order, y and y', over (z, y, y', start, f).
    """
    n, most = shape.order, compensator.ORDER
    A, B = controller.controller_matrices(servo, shape, K)
    m = np.zeros((n + 4, n + 4))
    m[: n + 2, : n + 2], m[: n + 2, n + 3] = A, B
    m[n + 1, n + 2] = servo.G.gain  # the start adds to delta
    e = controller.matrix_exponential(T * m)
    used = [*range(n), *range(most, most + 2)]
    out = np.zeros((most + 2, most + 4))
    out[np.ix_(used, [*used, most + 2, most + 3])] = e[: n + 2]
    out.flags.writeable = False
    return out


@functools.lru_cache(maxsize=256)
def held_memory(servo: Servo, shape: Compensator, K: float, T: float) -> np.ndarray:
    """State `memory` of one axis.

    Args:
        servo: of the axis.
        shape: of C.
        K: gain of the compensator.
        T: length of the sample [s].

    Returns:
        Rows (A, B) of controller.held_compensator, shape (20,).
    """
    out = np.column_stack(controller.held_compensator(servo, shape, K, T)).ravel()
    out.flags.writeable = False
    return out


def delay_in_samples(delay: float, Ts: float) -> tuple[int, float]:
    """A delay as whole samples, and what remains of one.

    Args:
        delay: the delay [s].
        Ts: control sample [s].
    """
    delay /= Ts
    whole = math.floor(delay + SLACK)
    return whole, max(delay - whole, 0.0)


def ring_rows(window: int, whole_delay: int) -> int:
    """Rows of Engine.ring.

    Args:
        window: as in hardware.Interface.
        whole_delay: from `delay_in_samples`.
    """
    return window + (whole_delay + 2) + (whole_delay + 4)


class Sampled(NamedTuple):
    """The method; `path.Method` says what each part does.

    Attributes:
        order: of its error in the step.
    """

    order: int = 2

    def begin(self, s, e, x, y):
        """Readies a run whose handle has been put to its start.

        Args:
            s: state of the run.
            e: its arrays.
            x: position of the handle, x [m].
            y: the same, y [m].
        """
        measure_pose(s)
        s["due"], s["due_next"] = INF, INF
        if s["wired"]:
            wires, q, w, Ts, window = s["wires"], s["q"], s["w"], s["Ts"], s["window"]
            wires[0], wires[1], wires[10], wires[11], wires[12], wires[13] = w[0], w[1], x, y, x, y
            for n in range(window):  # before the start the joints have turned so for long
                j = n - window
                e.ring[n, 0] = float(j)
                e.ring[n, 1] = hardware.encode(q[0] + j * Ts * w[0], s["encoder"])
                e.ring[n, 2] = hardware.encode(q[1] + j * Ts * w[1], s["encoder"])
        look_ahead(s, e.chance)

    def glide(self, s, e, room):
        i, dt, rate = s["i"], s["dt"], s["rate"]
        n, row = min(s["last"] - i, room - s["filled"]), -1
        # clay is cut step by step: a call of it in here would slow every other run
        if n < 1 or s["grooved"] or not path.may_glide(s):
            return 0
        if s["first"] >= 0:
            row = i - s["first"]
            n = min(n, len(e.ahead) - row)
        ready_kicks(s, e.ahead, -1, True)
        grows = s["physical"] > 0 and (s["smooth"] > 0 or rate[0] > 0.0 or rate[1] > 0.0)
        varies = row >= 0 or grows
        lowx, lowy, highx, highy = s["low"][0], s["low"][1], s["high"][0], s["high"][1]
        for made in range(n):
            if s["code"] != path.OPEN or (s["uneven"] and self.stop(s)[1] < dt):
                return made
            if varies:
                ready_kicks(s, e.ahead, row + made if row >= 0 else -1, grows)
            look_for_event(s)
            if s["event"]:
                respond(s, e)
            x = s["late"] if s["event"] else s["whole"]
            work_out(s, x, s["event"] > 0)
            px, py = place_after(s, dt)
            # a step that would leave the region, or end nowhere, is left to path.careful
            if not (lowx - TOUCH <= px <= highx + TOUCH and lowy - TOUCH <= py <= highy + TOUCH):
                return made
            enter(s, e.rows, e.rendered, x, dt, True)
            if s["sticks"]:
                note_stops(s, e)
            if s["event"]:
                take_event(s, e.chance, e.ring)
            command(s, e.ctrl, e.push, dt)
            e.step(e.model, e.data)
            observe(s, e.q, e.w, e.table, dt)
            s["i"] = i + made + 1
            s["t"] = s["i"] * dt
        return n

    def stop(self, s):
        t, dt, delay = s["t"], s["dt"], s["delay"]
        target, after, on_grid = path.next_sample(t, s["i"], s["last"], dt, s["t_max"])
        s["grid"] = target
        if s["uneven"] and after > 0.0:
            near = SLACK * dt
            stop = INF
            for event in (s["when"], s["then"], s["when"] + delay, s["due"], s["due_next"]):
                if t + near < event < stop:
                    stop = event
            if stop < target - near:
                return stop, stop - t, on_grid
        return target, after, on_grid

    def arrive(self, s, target):
        if target == s["grid"]:
            s["i"] += 1
        s["t"] = target

    def act(self, s, e):
        look_for_event(s)
        if s["event"]:
            t, before = s["t"], s["before"]
            s["uh"][0], s["uh"][1] = path.muscle_force(s, e.muscle, t, 0.0)
            if len(e.command):
                s["shift"][0], s["shift"][1] = path.command_change(e, t, t + s["Ts"], 0.0)
            if before > 0.0:
                ready_kick_now(s, e.muscle, s["early"], before, 0.0)
                ready_kick_now(s, e.muscle, s["whole"], before, before)
            respond(s, e)

    def strike(self, s, e, after):
        return after  # torques that are held do not follow a hit

    def propose(self, s, e, after):
        event = s["event"] > 0 and after > 0.0
        ready_kick_now(s, e.muscle, s["late"], 0.0 if event else s["before"], after)
        work_out(s, s["late"], event)

    def meet(self, s, e, after, lands):
        return after

    def finite(self, s, e):
        return abs(s["end"][2]) + abs(s["end"][3]) < INF

    def place(self, s, e, h):
        return place_after(s, h)

    def keep(self, s, e, after, shows):
        enter(s, e.rows, e.rendered, s["late"], after, shows)
        if shows and after == 0.0:
            i = s["filled"] - 1
            fx, fy = s["felt"][4], s["felt"][5]
            e.rows[i, 4] = self.speed(s, e, 0)
            e.rows[i, 5] = self.speed(s, e, 1)
            enter_rates(s, e.rows, i)
            if s["sticks"]:
                s["felt"][4], s["felt"][5] = fx, fy
                enter_force(s, e.rows, e.rendered, i, (0.0, 0.0), 0.0)

    def commit(self, s, e, after):
        if s["sticks"]:
            note_stops(s, e)
        if s["event"]:
            take_event(s, e.chance, e.ring)
        command(s, e.ctrl, e.push, after)
        e.timestep[0] = after
        e.step(e.model, e.data)
        e.timestep[0] = s["dt"]
        observe(s, e.q, e.w, e.table, after)

    def speed(self, s, e, i):
        # half a kick has led to the border; in stiff clay that half holds too little of the clay,
        # and the velocity is that of a whole kick, with the step before it repeated
        before = s["before"]
        if before == 0.0:
            return 0.0
        x, end = s["whole"], s["end"]
        ready_kick_now(s, e.muscle, x, before, before)
        felt = x[10 + i] > 0.0
        if not felt:
            ready_kick_now(s, e.muscle, x, before, 0.0)
        work_out(s, x, False)
        if felt:
            vx, vy = sample_velocity(s, x)
            return vy if i else vx
        return end[i]


class SampledRun(Run):
    """A run by `Sampled`."""

    fields, method = SAMPLED_STATE, Sampled()

    def _start(self) -> None:
        super()._start()
        s, now = self.scenario, self.s
        now["ratio"] = round((s.Ts or s.dt) / s.dt)
        now["Ts"] = now["ratio"] * float(s.dt)
        now["physical"] = int(s.render == "implicit")
        now["sticks"] = int(now["physical"] and now["yields"])
        if now["sticks"]:  # more kicks than rows: at samples, and at changes of the torques
            self.stop_rows = np.zeros((16 * CHUNK, 3))
            self._arrays(stops=self.stop_rows)
        self.law: LawCaller | None = None
        parts = list(zip(s.servo, s.compensators, s.gain, strict=True))
        first = self.first_loop(s.start, s.velocity, s.servo)
        self._put(loop=first)
        if now["formed"]:
            rows = [formed_memory(*axis, now["Ts"]) for axis in parts]
            self._put(form_memory=np.ravel(rows), form_start=first[0:5:4])
            self._put(form_states=self.moving_states())
        else:
            self._put(memory=np.ravel([held_memory(*axis, now["Ts"]) for axis in parts]))
        if s.controller is not None:
            self.take_over(s.controller)
        self.ring = np.zeros((0, 1 + HOLD))
        if s.interface:
            self._wire(s.interface)
        self.method.begin(now, self.e, *s.start)

    @staticmethod
    def first_loop(p: Sequence[Any], v: Sequence[Any], servo: tuple[Servo, Servo]) -> list[Any]:
        """State `loop` at the start. Floats, or arrays over runs.

        Args:
            p: handle position, (x, y) [m].
            v: handle velocity, (x, y) [m/s].
            servo: of each axis.
        """
        x = loop.initial_state(p, v, servo)
        return [*x[0:8:2], *x[1:8:2]]

    def take_over(self, controller: Controller) -> None:
        """Lets a controller of the user's own act, from the start of the run on.

        Args:
            controller: that one.
        """
        state, now = controller.state, self.s
        self.desk: Any = np.array([0.0] * DESK + [*state, *state, *controller.params])
        self.law = LawCaller(controller, self.desk)
        now["own"], now["asked"] = 1 + len(state), -1
        self._put(loop=[0.0] * 8)
        self.e = self.e._replace(law=self.law, desk=memoryview(self.desk))
        if self.native and self.kernel.law:
            law, data = self.kernel.law(self.law, self.desk)
            self.native = self.native._replace(law=law, law_data=data, desk=self.desk)

    def _wire(self, parts: hardware.Interface) -> None:
        """Sets up the hardware."""
        s, now, Ts = self.scenario, self.s, self.s["Ts"]
        cutoff = parts.force_filter
        now["wired"] = 1
        now["uneven"] = int(parts.jitter > 0.0 or parts.delay > 0.0)
        now["random"] = int(parts.jitter > 0.0 or parts.lost > 0.0 or parts.force_noise > 0.0)
        now["encoder"], now["window"] = parts.encoder or 0, parts.window
        now["difference"] = int(parts.velocity == "difference")
        now["cutoff"] = float(parts.velocity_filter or 0.0)
        now["adc_bits"], now["dac_bits"] = parts.adc_bits or 0, parts.dac_bits or 0
        now["adc_range"], now["delay"] = float(parts.adc_range), float(parts.delay)
        now["whole_delay"], now["part_delay"] = delay_in_samples(parts.delay, Ts)
        now["rubs"], now["guarded"] = int(any(parts.friction)), int(parts.passivity)
        now["coupled"] = int(parts.coupling is not None)
        if parts.coupling:
            self._put(coupling=(parts.coupling.spring, parts.coupling.damper))
        if cutoff is not None:
            now["filters"] = 1
            self._put(force_filter=hardware.butterworth(cutoff, parts.filter_order, Ts))
        self._put(friction=parts.friction, dac_range=parts.dac_range or s.torque_limit)
        self.ring = np.zeros((ring_rows(parts.window, now["whole_delay"]), 1 + HOLD))
        self._arrays(ring=self.ring)
        if s.render == "held":
            self.render()
        if now["random"]:
            self.noise = hardware.SampleNoise(parts)
            self._arrays(chance=self.noise.table(0, 2))

    def _make(self, room: int) -> None:
        now = self.s
        rows = max(room - self.filled, 0) + 1
        if now["random"]:  # no more samples begin in a call than rows, and a look ahead
            now["first_chance"] = now["k"]
            self._arrays(chance=self.noise.table(now["k"], rows // now["ratio"] + 8))
        if self.muscle or self.command:
            now["first"] = self.i
            n = min(rows, max(self.last - self.i, 0) + 1)
            self._prepare_drives(n, now["ratio"])
            self._arrays(ahead=self._ahead(n))
        super()._make(room)
        if self.law:
            self.law.check()
            if not self.law.finite():
                self.beyond = "the torques of the controller are not finite"

    def _ahead(self, n: int) -> np.ndarray:
        """What drives the next n whole steps, see AHEAD; shape (n, AHEAD)."""
        dt, i = self.scenario.dt, self.i
        t = (i + np.arange(n)) * dt
        out = np.empty((n, AHEAD))
        out[:, 0:2] = self.uh(t - 0.25 * dt, 0.25 * dt)
        out[:, 2:4] = self.uh(t + 0.25 * dt, 0.25 * dt)
        out[:, 4:6] = 0.5 * (out[:, 0:2] + out[:, 2:4])
        out[:, 6:8] = self.uh(t, 0.0)
        out[:, 8:10] = self.shift(t, t + self.s["Ts"])
        return out

    def _save(self) -> Any:
        if self.s["random"]:
            self.noise.forget(self.s["k"])
        return super()._save(), self.ring.copy(), self.desk.copy() if self.law else None

    def _restore(self, saved: Any) -> None:
        super()._restore(saved[0])
        self.ring[:] = saved[1]
        if self.law:
            self.desk[:] = saved[2]

    def balance(self) -> dict[str, float]:
        """As Run.balance, with what the hardware takes."""
        out, parts = super().balance(), self.scenario.interface
        if parts:
            used = any(parts.friction), parts.passivity, parts.coupling is not None
            work = [float(x) for x in self.s["work"]][-len(energy.HARDWARE_WORK) :]
            names = zip(energy.HARDWARE_WORK, work, used, strict=True)
            out |= {name: x for name, x, on in names if on}
            out["residual"] -= out.get("friction", 0.0)
        return out
