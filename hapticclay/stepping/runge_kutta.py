"""The accurate method: the classic Runge-Kutta, fourth order, with the controller among its states.

The engine gives the acceleration of the arm at each stage; the states are integrated here. `march`
is the loop as a differential equation, written out flat because CPython pays for each call; the
laws it spells out are those of `model.arm` and `model.controller`.
"""

from __future__ import annotations

import math
import struct
from math import cos, sin
from typing import NamedTuple

import numpy as np

from ..errors import ParameterError
from ..model import arm, clay, compensator, controller, regions
from ..model.constants import B_MAX
from ..model.operator import NO_HAND
from ..model.scenario import Scenario
from . import energy, loop, modes, path
from .modes import FREE, RESTS, SLIDING, STABLE_STEP, SUBSTEPS, TURNED_IN
from .path import INF, OPEN, ROW, TOUCH, put5, put6, put8, put10, put17
from .run import Run

REFERENCE_SPEED = 0.1  # [m/s] of a usual cut: at which the consistency counts as a damper
CREEP_MOST = 1e-5  # [m/s] a slower creep may count as rest
POWERS = 5  # of energy.kick_work
GROWTH_BLOCK = 64  # samples for which the steps of clay that grows are chosen at once
COSINES = 2**22  # cosines that are tabulated at once where a multisine drives the run
ROW_BYTES = 8 * ROW
# the cheapest way for CPython to write floats: (array, offset [bytes], floats)
put_sample = struct.Struct(f"{ROW}d").pack_into

RUNGE_KUTTA_STATE = [  # beside path.STATE
    ("substeps", "i8"),  # engine steps a sample
    ("part", "i8"),  # which of them comes next
    ("share", "f8"),  # length of all but the last of them [s]
    ("break", "f8"),  # next time at which a signal jumps, and a step has to end [s]
    # compensator output and rate, reference model y = G delta and its rate: deltax, deltay [m],
    # deltax', deltay' [m/s], yx, yy [m], yx', yy' [m/s]; the command is not in delta. Where the
    # compensator is `formed`, delta is the start alone, and does not move.
    ("control", "f8", 8),
    ("form_states", "f8", 2 * compensator.ORDER),  # of it, x and y
    ("form_point", "f8", 2 * compensator.ORDER),  # at the stage
    ("form_sums", "f8", 2 * compensator.ORDER),  # of their rates over the stages
    ("form_next", "f8", 2 * compensator.ORDER),  # at the end of the step last worked out
    ("form_kick", "f8", 2 * compensator.KICK),  # compensator.form_kick of no length
    ("form_work", "f8", compensator.WORK),
    ("done", "f8", POWERS),  # works up to now, see energy.kick_work
    # of the step last worked out:
    ("next", "f8", 17),  # q, q', control and works at its end
    ("sample", "f8", 10),  # p [m], v [m/s], fh [N], tau [N.m], delta [m] at its start
    *modes.MODES_STATE,
]


def march(s, e, span, n):  # noqa: PLR0912, PLR0915  # flat for CPython
    """Works out one step, or steps from sample to sample within one region.

    Args:
        s: state of the run; gets the step worked out, or is advanced.
        e: its arrays; rows are filled.
        span: length of the one step [s]; 0 works out its start alone.
        n: largest number of samples to pass; 0 for the one step.

    Returns:
        Number of rows filled.
    """
    Q1, Q2 = s["q"]
    W1, W2 = s["w"]
    DX, DY, EX, EY, YX, YY, VX, VY = s["control"]
    muscle, motors, melted, damped, through = s["done"]
    gainx, gainy = s["gain"]
    massx, damperx, springx = s["handx"]
    massy, dampery, springy = s["handy"]
    L1, L2, I1, I2, trace = s["arm"]
    ratiox, DGX, KGX, SXX, DSX, KSX = s["servox"]
    ratioy, DGY, KGY, SYY, DSY, KSY = s["servoy"]
    polex, poley = s["lag"]
    formed, heavy = s["formed"], massx > 0.0 or massy > 0.0
    feedx, feedy, form, kick, start = 0.0, 0.0, s["form_point"], s["form_kick"], s["form_states"]
    if formed:  # delta that the net force adds at once
        feedx = gainx * kick[compensator.FEED]
        feedy = gainy * kick[compensator.KICK + compensator.FEED]
    limit1, limit2 = s["torque_limit"]
    ox, oy = s["origin"]
    square1, square2, noy = limit1 * limit1, limit2 * limit2, -oy
    held, shaped, dampers = s["held"], s["shaping"], s["dampers"]
    turned, grain, smooth, table = s["turned_clay"], s["grain"], s["smooth"], e.table
    q, w, ctrl, push, acceleration = e.q, e.w, e.ctrl, e.push, e.acceleration
    forward, model, data, coming, rows = e.forward, e.model, e.data, e.ahead, e.rows
    low, high = s["low"], s["high"]
    lowx, lowy, highx, highy = low[0] - TOUCH, low[1] - TOUCH, high[0] + TOUCH, high[1] + TOUCH
    base, rate = (s["base"][0], s["base"][1]), (s["rate"][0], s["rate"][1])
    grows, commanded = rate[0] > 0.0 or rate[1] > 0.0, len(e.command) > 0
    tabled = n > 0 and s["first"] >= 0
    t, i, part, parts, dt = s["t"], s["i"], s["part"], s["substeps"], s["dt"]
    at, steps, h, share = s["filled"], s["steps"], span, dt / parts
    end = at + n
    j = 2 * parts * (i - s["first"])
    last = (W1, W2, muscle, motors, melted, damped, through)  # at the last row
    shiftx, shifty, uhx, uhy = 0.0, 0.0, 0.0, 0.0
    bx, by = base
    if n > 0:
        uhx, uhy = path.mean_force(s, e, t, 0.0)
    yields, felt, still, holds = s["yields"], s["felt"], False, False
    rx, ry, fex0, fey0, restx, resty = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if yields:
        still = s["mode"][0] == 0 and s["mode"][1] == 0
        holds = s["mode"][0] == 0 or s["mode"][1] == 0
    if dampers:
        ctrl[2], ctrl[3] = bx, by
    while True:
        if n > 0:
            h = share if part < parts - 1 else (i + 1) * dt - t
        # the point of the stage, from the start of the step on, and sums of what changes there
        q1, q2, w1, w2, deltax, deltay, ex, ey = Q1, Q2, W1, W2, DX, DY, EX, EY
        yx, yy, ydx, ydy = YX, YY, VX, VY
        f1, f2, f3, f4, f5, f6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0  # over stages 0, 1, 2
        g1, g2, g3, g4, g5, g6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0  # over stages 1, 2, 3
        p1, p2, p3, p4, p5 = 0.0, 0.0, 0.0, 0.0, 0.0  # over all, the inner ones twice
        px0, py0, vx0, vy0, hx0, hy0 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        t10, t20, dx0, dy0, bx0, by0 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if formed:
            for r in range(2 * compensator.ORDER):
                form[r] = start[r]
                s["form_sums"][r] = 0.0
        for stage in range(4):
            # what changes with time
            if stage != 2:
                now = t if stage == 0 else t + h if stage == 3 else t + 0.5 * h
                if tabled:
                    uhx, uhy = coming[j, 0], coming[j, 1]
                    shiftx, shifty = coming[j, 2], coming[j, 3]
                    j += 1
                elif n == 0:  # a signal that jumps counts as it is within the step
                    near = now - path.NEAR * dt if stage == 3 else now
                    near = max(near, t + path.NEAR * dt)
                    uhx, uhy = path.force_at(s, e, now, near)
                    if commanded:
                        shiftx, shifty = path.command_at(e, now, near)
                if grows:
                    bx, by = clay.damping_at(base, rate, now)
                    ctrl[2], ctrl[3] = bx, by

            # kinematics of the handle
            a2 = q1 + q2
            u1x, u1y = -L1 * sin(q1), L1 * cos(q1)
            u2x, u2y = -L2 * sin(a2), L2 * cos(a2)
            px = u1y + u2y - ox
            py = noy - u1x - u2x
            if smooth:
                bx, by = regions.smooth_clay(table, smooth, px, py, bx, by)
                ctrl[2], ctrl[3] = bx, by
            r2 = w1 + w2
            vx = u1x * w1 + u2x * r2
            vy = u1y * w1 + u2y * r2
            if holds:
                vx, vy = modes.without_rest(s, vx, vy)
            s1 = w1 * w1
            s2 = r2 * r2
            cx = u1y * s1 + u2y * s2
            cy = -u1x * s1 - u2x * s2
            if shaped:
                sxx, sxy, syy = SXX, 0.0, SYY
            else:
                m1 = u1x / I1
                m2 = u2x / I2
                sxx = u1x * m1 + u2x * m2
                sxy = u1y * m1 + u2y * m2
                syy = trace - sxx

            # clay, and the operator's arm but for the acceleration of its mass
            if turned:
                fex, fey = clay.turned_force(grain[0], grain[1], bx, by, vx, vy)
            else:
                fex, fey = bx * vx, by * vy
            hx, hy = uhx, uhy
            if held:
                hx -= springx * px - massx * cx + damperx * vx
                hy -= springy * py - massy * cy + dampery * vy
            fx = hx - fex
            fy = hy - fey

            # servo
            shownx = deltax + shiftx
            showny = deltay + shifty
            if formed:
                shownx += compensator.form_output(kick, form, 0)
                showny += compensator.form_output(kick, form, 1)
                sxx += KGX * ratiox * feedx
                syy += KGY * ratioy * feedy
            yddx = KGX * (ratiox * shownx - yx) - DGX * ydx
            yddy = KGY * (ratioy * showny - yy) - DGY * ydy
            ax = yddx - DSX * (vx - ydx) + KSX * (yx - px) + cx
            ay = yddy - DSY * (vy - ydy) + KSY * (yy - py) + cy
            gx = ax + sxx * fx + sxy * fy
            gy = ay + sxy * fx + syy * fy
            ffx, ffy = fx, fy
            if heavy:
                m1 = 1.0 + sxx * massx
                m2 = sxy * massy
                r = sxy * massx / m1
                gy = (gy - r * gx) / (1.0 + syy * massy - r * m2)
                gx = (gx - m2 * gy) / m1
                ffx -= massx * gx
                ffy -= massy * gy
            if yields:
                rx, ry, gx, gy = modes.yield_at_stage(
                    s, (sxx, sxy, syy), (massx, massy), (vx, vy), (gx - cx, gy - cy)
                )
                gx, gy = gx + cx, gy + cy
                ffx, ffy = fx - rx - massx * gx, fy - ry - massy * gy
            det = u1x * u2y - u2x * u1y
            t2 = I2 * ((gy * u1x - gx * u1y) / det) - u2x * ffx - u2y * ffy
            t1 = I1 * ((gx * u2y - gy * u2x) / det) - u1x * ffx - u1y * ffy + t2
            if t1 * t1 > square1 or t2 * t2 > square2:
                if holds and (shaped or formed):
                    t1, t2 = modes.torques_that_hold(
                        s, (u1x, u1y, u2x, u2y), (sxx, sxy, syy), (ax, ay), (fx, fy),
                        (massx, massy), (vx, vy), (cx, cy),
                    )  # fmt: skip
                # a kick of one second from rest, in which the velocity after it is the acceleration
                gx, gy, _, _, ffx, ffy, t1, t2 = controller.kick_at_limit(
                    1.0, (0.0, 0.0), (u1x, u1y, u2x, u2y), (L1, L2, I1, I2, trace), (fx, fy),
                    (massx, massy), (t1, t2), (limit1, limit2),
                )  # fmt: skip
                if yields:
                    rx, ry, gx, gy = modes.yield_at_stage(
                        s, arm.mobility((u1x, u1y, u2x, u2y), (L1, L2, I1, I2, trace)),
                        (massx, massy), (vx, vy), (gx - cx, gy - cy),
                    )  # fmt: skip
                    gx, gy = gx + cx, gy + cy
                    ffx, ffy = fx - rx - massx * gx, fy - ry - massy * gy
            if formed:
                shownx += feedx * ffx
                showny += feedy * ffy
                yddx += KGX * ratiox * feedx * ffx
                yddy += KGY * ratioy * feedy * ffy
            hx = ffx + fex
            hy = ffy + fey
            if stage == 0:
                px0, py0, vx0, vy0, hx0, hy0 = px, py, vx, vy, hx, hy
                t10, t20, dx0, dy0, bx0, by0 = t1, t2, shownx, showny, bx, by
                if yields:
                    hx0, hy0, fex0, fey0 = hx + rx, hy + ry, fex + rx, fey + ry
                    restx, resty = felt[8], felt[9]
                if h == 0.0:
                    break

            # the arm
            q[0], q[1] = q1, q2
            w[0], w[1] = w1, w2
            ctrl[0], ctrl[1] = t1, t2
            m2 = u2x * hx + u2y * hy
            push[0], push[1] = u1x * hx + u1y * hy + m2, m2
            forward(model, data)
            a1, a2 = acceleration[0], acceleration[1]
            if yields:
                fex += rx
                fey += ry
                if still:  # but for the engine's rounding
                    a1, a2 = 0.0, 0.0

            # derivative of all states, and the point of the next stage
            if formed:
                a3, a4 = 0.0, 0.0
                m1 = 1.0 if stage == 0 or stage == 3 else 2.0
                m2 = h if stage == 2 else 0.5 * h
                compensator.form_stage(s, 0, gainx * ffx, m1, m2)
                compensator.form_stage(s, 1, gainy * ffy, m1, m2)
            else:
                a3 = gainx * ffx - polex * ex
                a4 = gainy * ffy - poley * ey
            power = uhx * vx + uhy * vy
            drive = t1 * w1 + t2 * w2
            if stage == 0 or stage == 3:
                m1 = 1.0
            else:
                m1 = 2.0
            p1 += m1 * power
            p2 += m1 * drive
            p3 += m1 * (fex * vx + fey * vy)
            if held:
                p4 += m1 * energy.both_axes(damperx, dampery, vx * vx, vy * vy)
            p5 += m1 * (abs(power) + abs(drive))
            if stage > 0:
                g1 += a1
                g2 += a2
                g3 += a3
                g4 += a4
                g5 += yddx
                g6 += yddy
            if stage < 3:
                f1 += a1
                f2 += a2
                f3 += a3
                f4 += a4
                f5 += yddx
                f6 += yddy
                k = h if stage == 2 else 0.5 * h
                q1 = Q1 + k * w1
                q2 = Q2 + k * w2
                w1 = W1 + k * a1
                w2 = W2 + k * a2
                if not abs(w1) + abs(w2) < INF:
                    break
                deltax = DX + k * ex
                deltay = DY + k * ey
                ex = EX + k * a3
                ey = EY + k * a4
                yx = YX + k * ydx
                yy = YY + k * ydy
                ydx = VX + k * yddx
                ydy = VY + k * yddy

        k = h / 6.0
        q1 = Q1 + h * (W1 + k * f1)
        q2 = Q2 + h * (W2 + k * f2)
        w1 = W1 + k * (f1 + g1)
        w2 = W2 + k * (f2 + g2)
        if holds and not still:
            q1, q2, w1, w2 = modes.back_to_rest(s, q1, q2, w1, w2)
        if n > 0:  # a step that would leave the region is left to path.careful
            if not abs(w1) + abs(w2) < INF:
                break
            x, y = arm.handle_position(q1, q2, (L1, L2, I1, I2, trace))
            if not (lowx <= x - ox <= highx and lowy <= y + noy <= highy):
                break
            if yields:
                x, y = arm.handle_velocity(
                    w1, w1 + w2, arm.jacobian(q1, q2, (L1, L2, I1, I2, trace))
                )
                if not modes.goes_on(s, h, x, y, restx, resty):
                    break
                if part == 0:
                    e.rendered[at, 0], e.rendered[at, 1] = fex0, fey0
            if part == 0:
                put_sample(
                    rows, at * ROW_BYTES, Q1, Q2, px0, py0, vx0, vy0, hx0, hy0, t10, t20, dx0, dy0,
                    bx0, by0, W1, W2,
                )  # fmt: skip
                last = (W1, W2, muscle, motors, melted, damped, through)
                at += 1
        Q1, Q2, W1, W2 = q1, q2, w1, w2
        DX += h * (EX + k * f3)
        DY += h * (EY + k * f4)
        EX += k * (f3 + g3)
        EY += k * (f4 + g4)
        YX += h * (VX + k * f5)
        YY += h * (VY + k * f6)
        VX += k * (f5 + g5)
        VY += k * (f6 + g6)
        if formed:
            form_end = start if n > 0 else s["form_next"]
            for r in range(2 * compensator.ORDER):
                form_end[r] = start[r] + k * s["form_sums"][r]
        muscle += k * p1
        motors += k * p2
        melted += k * p3
        damped += k * p4
        through += k * p5
        if n == 0:
            put17(
                s["next"], 0, Q1, Q2, W1, W2, DX, DY, EX, EY, YX, YY, VX, VY,
                muscle, motors, melted, damped, through,
            )  # fmt: skip
            put10(s["sample"], 0, px0, py0, vx0, vy0, hx0, hy0, t10, t20, dx0, dy0)
            s["resisted"][0], s["resisted"][1] = fex0, fey0
            return 0
        steps += 1
        part += 1
        t += h
        if tabled:
            j -= 1
        if part == parts:
            part = 0
            i += 1
            t = i * dt
            if at == end:
                break
    made = at - s["filled"]
    if made:
        r = at - 1
        put6(
            s["final"], 0, rows[r, 2], rows[r, 3], rows[r, 4], rows[r, 5], last[0], last[1]
        )  # fmt: skip
        put5(s["work"], 0, last[2], last[3], last[4], last[5], last[6])
        take(s, e, Q1, Q2, W1, W2)
        put8(s["control"], 0, DX, DY, EX, EY, YX, YY, VX, VY)
        put5(s["done"], 0, muscle, motors, melted, damped, through)
        s["t"], s["i"], s["part"], s["share"], s["filled"] = t, i, part, share, at
        s["before"], s["steps"] = dt, steps
    return made


def march_block(s, e, n):
    """Steps from sample to sample within one region.

    Args:
        s: state of the run.
        e: its arrays.
        n: largest number of samples to pass.

    Returns:
        Number of rows filled.
    """
    return march(s, e, 0.0, n)


def take(s, e, q1, q2, w1, w2):
    """Puts the arm where it now is.

    Args:
        s: state of the run.
        e: its arrays.
        q1: angle of joint 1 [rad].
        q2: angle of joint 2 [rad].
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].
    """
    s["q"][0], s["q"][1], s["w"][0], s["w"][1] = q1, q2, w1, w2
    e.q[0], e.q[1], e.w[0], e.w[1] = q1, q2, w1, w2
    if s["smooth"]:
        path.feel_place(s, e.table)


def stages_ahead(run: Run, i: int, n: int, parts: int) -> np.ndarray:
    """What changes with time at the stages of the next whole steps: muscle force and command.

    Args:
        run: the run.
        i: index of the first sample.
        n: number of samples, of which the last only ends a step.
        parts: engine steps a sample.

    Returns:
        Two rows an engine step, for its start and its middle, and one for the end of the last,
        shape (2 (n - 1) parts + 1, 4): muscle force (x, y) [N], change of the command since t = 0
        (x, y) [m].
    """
    dt = run.scenario.dt
    t, end = (i + np.arange(n)) * dt, (i + 1 + np.arange(n)) * dt
    times = np.empty((n, 2 * parts))
    for j in range(parts):
        h = dt / parts if j < parts - 1 else end - t
        times[:, 2 * j], times[:, 2 * j + 1] = t, t + 0.5 * h
        t = t + h
    times = times.ravel()[: 2 * (n - 1) * parts + 1]
    out = np.empty((len(times), 4))
    out[:, 0:2] = run.uh(times, 0.0)
    out[:, 2:4] = run.command.since_start(times) if run.command else 0.0
    return out


def next_break(s, e):
    """The next time at which a signal jumps, inf for none [s].

    Args:
        s: state of the run.
        e: its arrays.
    """
    t, breaks = s["t"] + path.NEAR * s["dt"], e.breaks
    low, high = 0, len(breaks)
    while low < high:
        middle = (low + high) // 2
        if breaks[middle] > t:
            high = middle
        else:
            low = middle + 1
    return breaks[low] if low < len(breaks) else INF


def feel(s, e):
    """Works out what the clay does now, in the modes chosen, into state felt.

    Args:
        s: state of the run.
        e: its arrays.
    """
    march(s, e, 0.0, 0)


def choose_modes(s, e):
    """Chooses the modes in which clay that yields acts from now on, and the longest step in them.

    Args:
        s: state of the run, which is put to rest where it nearly is.
        e: its arrays.
    """
    s["fine"] = INF
    if s["yields"] == 2:
        choose_way(s, e)
    else:
        choose_signs(s, e)
    s["fine"] = modes.longest_step(s)
    path.note_stop(s, e, s["t"], is_stopped(s, 0), is_stopped(s, 1))


def is_stopped(s, i):
    """Whether an axis rests in clay that can bring it to rest, 1 or 0.

    Args:
        s: state of the run.
        i: the axis, 0 or 1.
    """
    thins = s["flow"][3 * i + 1] > 0.0 and s["flow"][3 * i + 2] < 1.0
    return 1 if s["mode"][i] == 0 and (s["flow"][3 * i] > 0.0 or thins) else 0


def stand(s, e, vx, vy):
    """Gives the handle a velocity along the axes of the clay, 0.0 where it comes to rest.

    Args:
        s: state of the run.
        e: its arrays.
        vx: along the first axis [m/s].
        vy: along the second one [m/s].
    """
    q1, q2 = s["q"]
    w1, w2 = 0.0, 0.0
    if vx != 0.0 or vy != 0.0:
        w1, w2 = modes.joint_rates(s, q1, q2, vx, vy)
    take(s, e, q1, q2, w1, w2)


def choose_signs(s, e):
    """As `choose_modes`, of clay whose axes yield each by itself.

    Args:
        s: state of the run.
        e: its arrays.
    """
    mode, ended = s["mode"], s["ended"]
    q1, q2 = s["q"]
    vx, vy = modes.clay_velocity(s, q1, q2, s["w"][0], s["w"][1])
    restx, resty = False, False
    for i in range(2):
        v = vy if i else vx
        rests = False
        if not modes.is_active(s, i):
            mode[i] = 1
        elif ended[i] == FREE or ended[i] == -FREE:
            rests = True
        elif mode[i] == 0 or ended[i] == RESTS or v == 0.0:
            rests = True
        else:
            mode[i] = 1 if v > 0.0 else -1
        if i:
            resty = rests
        else:
            restx = rests
    before = (mode[0], mode[1])
    feel(s, e)
    if not restx and modes.is_active(s, 0):
        restx = modes.is_nearly_at_rest(s, 0)
    if not resty and modes.is_active(s, 1):
        resty = modes.is_nearly_at_rest(s, 1)
    if not (restx or resty):
        return
    x, y = modes.clay_place(s, q1, q2)
    if restx and before[0] != 0:
        s["anchor"][0] = x
    if resty and before[1] != 0:
        s["anchor"][1] = y
    if (restx and vx != 0.0) or (resty and vy != 0.0):
        stand(s, e, 0.0 if restx else vx, 0.0 if resty else vy)
    least, bestx, besty = INF, 0, 0
    for j in range(3 if restx else 1):
        for k in range(3 if resty else 1):
            if least <= 0.0:
                continue
            mode[0] = tried_mode(j, restx, ended[0], before[0])
            mode[1] = tried_mode(k, resty, ended[1], before[1])
            feel(s, e)
            wrong = max(
                modes.misfit(s, 0, restx and abs(ended[0]) != FREE),
                modes.misfit(s, 1, resty and abs(ended[1]) != FREE),
            )
            if wrong < least:
                least, bestx, besty = wrong, mode[0], mode[1]
    mode[0], mode[1] = bestx, besty
    feel(s, e)


def tried_mode(k, rests, ended, now):
    """A mode to be tried: the present one unless the axis rests; the first is rest.

    Args:
        k: number of the trial.
        rests: whether the axis rests.
        ended: see state ended.
        now: its mode.
    """
    if not rests:
        return now
    if ended == FREE:
        return 1
    if ended == -FREE:
        return -1
    return 0 if k == 0 else 1 if k == 1 else -1


def choose_way(s, e):
    """As `choose_modes`, of clay that resists along the motion.

    Args:
        s: state of the run.
        e: its arrays.
    """
    mode, way, ended = s["mode"], s["way"], s["ended"][0]
    if not modes.is_active(s, 0):
        mode[0] = mode[1] = SLIDING
        feel(s, e)
        return
    vx, vy = modes.clay_velocity(s, s["q"][0], s["q"][1], s["w"][0], s["w"][1])
    rests = mode[0] == 0 or ended != 0 or (vx == 0.0 and vy == 0.0)
    if not rests:
        mode[0] = mode[1] = SLIDING
        feel(s, e)
        rests = modes.is_nearly_at_rest(s, 0)
    if rests:
        if vx != 0.0 or vy != 0.0:
            stand(s, e, 0.0, 0.0)
            vx, vy = 0.0, 0.0
        mode[0] = mode[1] = 0
        feel(s, e)
        if ended != FREE and modes.gap_of_mode(s, 0) >= 0.0:
            return
        modes.set_out(s)
        mode[0] = mode[1] = SLIDING
        feel(s, e)
    m = math.sqrt(vx * vx + vy * vy)
    if m > 0.0:
        way[0], way[1] = vx / m, vy / m
    if modes.is_turned_in(s, way[0], way[1]):
        modes.turn_in(s, m, way[0], way[1])
        mode[0] = mode[1] = TURNED_IN
        if m > 0.0:
            stand(s, e, m * way[0], m * way[1])
        feel(s, e)


def feel_end(s, e, h):
    """Makes the run feel the clay at the end of the step worked out, without effect on it else.

    Args:
        s: state of the run.
        e: its arrays.
        h: length of the step [s].
    """
    q, w, control, form = s["q"], s["w"], s["control"], s["form_states"]
    kept, after, t = s["kept"], s["next"], s["t"]
    for j in range(2):
        kept[j], kept[2 + j] = q[j], w[j]
        q[j], w[j] = after[j], after[2 + j]
    for j in range(8):
        kept[4 + j], kept[12 + j] = control[j], form[j]
        control[j], form[j] = after[4 + j], s["form_next"][j]
    s["t"] = t + h
    feel(s, e)
    s["t"] = t
    for j in range(2):
        q[j], w[j] = kept[j], kept[2 + j]
    for j in range(8):
        control[j], form[j] = kept[4 + j], kept[12 + j]


def gap_at_end(h, m, s, e, i):
    """As modes.gap_of_mode, of a step.

    Args:
        h: length of the step [s].
        m: the method.
        s: state of the run.
        e: its arrays.
        i: the axis; 0 for clay along the motion.
    """
    m.propose(s, e, h)
    feel_end(s, e, h)
    return modes.gap_of_mode(s, i)


def strays(s, e, h):
    """Whether a step along the motion turns back, or leaves the speeds of its mode.

    Args:
        s: state of the run.
        e: its arrays.
        h: length of the step [s].
    """
    x, way = s["next"], s["way"]
    vx, vy = modes.clay_velocity(s, x[0], x[1], x[2], x[3])
    along = vx * way[0] + vy * way[1]
    if s["mode"][0] == SLIDING:
        return along < 0.0
    if s["mode"][0] != TURNED_IN:
        return False
    turns = modes.strength(s, 0, along) * modes.across(s, way[0], way[1])
    return modes.TURN * along > 2.0 * modes.TURNING * s["dt"] * turns


def next_end(m, s, e, after):
    """Shortens a step to where clay that yields first ends a mode; notes that in state event.

    Args:
        m: the method.
        s: state of the run, with the step worked out.
        e: its arrays.
        after: its length [s].

    Returns:
        Length of the step, which is worked out [s].
    """
    event, mode, along = s["event"], s["mode"], s["yields"] == 2
    shortest, moved = modes.shortest_step(s), False
    follows = along and modes.is_active(s, 0)  # elsewhere the handle has no way to keep to
    while follows and after > shortest and strays(s, e, after):
        after = max(0.5 * after, shortest)
        m.propose(s, e, after)
    span, axis, x = after, -1, s["next"]
    vx, vy = modes.clay_velocity(s, x[0], x[1], x[2], x[3])
    for i in range(1 if along else 2):
        if not modes.is_active(s, i) or (along and mode[i] == SLIDING):
            continue
        if mode[i] != 0 and not along and mode[i] * (vy if i else vx) >= 0.0:
            continue
        moved = True
        gap = gap_at_end(after, m, s, e, i)
        if gap < 0.0:
            h = path.find_root(gap_at_end, after, gap, m, s, e, i)
            if axis < 0 or h < span:
                span, axis = h, i
    if axis >= 0:
        span = min(max(span, shortest), after)
        event[axis] = RESTS
        if mode[axis] == 0:
            m.propose(s, e, span)
            feel_end(s, e, span)
            event[axis] = FREE if along or s["felt"][8 + axis] > 0.0 else -FREE
    if moved:
        m.propose(s, e, span)
    return span


class RungeKutta(NamedTuple):
    """The method; `path.Method` says what each part does.

    Attributes:
        order: of its error in the step.
    """

    order: int = 4

    def begin(self, s, e, x, y):
        """Readies a run whose handle has been put to its start: nothing is left to do.

        Args:
            s: state of the run.
            e: its arrays.
            x: position of the handle, x [m].
            y: the same, y [m].
        """

    def glide(self, s, e, room):
        i, parts = s["i"], s["substeps"]
        n = min(s["last"] - i, room - s["filled"])
        if s["first"] >= 0:
            n = min(n, s["first"] + (len(e.ahead) - 1) // (2 * parts) - i)
            s["break"] = next_break(s, e)
            if s["break"] < (i + n + 1) * s["dt"]:  # whole steps that end before it
                n = math.ceil(s["break"] / s["dt"] - path.NEAR) - 1 - i
        if n < 1 or s["part"] > 0 or s["t"] != i * s["dt"] or s["closing"] != OPEN:
            return 0
        if s["yields"]:
            choose_modes(s, e)
            if s["fine"] < s["dt"] / parts or (s["yields"] == 2 and s["mode"][0] == TURNED_IN):
                return 0
        made = self.block(s, e, n)
        if made and s["yields"]:
            s["ended"][0] = s["ended"][1] = 0
        return made

    def block(self, s, e, n):
        """As march_block.

        Args:
            s: state of the run.
            e: its arrays.
            n: largest number of samples.
        """
        return march_block(s, e, n)

    def stop(self, s):
        t, dt = s["t"], s["dt"]
        target, after, on_grid = path.next_sample(t, s["i"], s["last"], dt, s["t_max"])
        if after > 0.0:
            goal = target
            if t + path.NEAR * dt < s["break"] < target - path.NEAR * dt:
                goal = s["break"]
                after = goal - t
            if s["part"] == 0:
                s["share"] = after / s["substeps"]
            after = s["share"] if s["part"] < s["substeps"] - 1 else goal - t
            if s["yields"]:  # steps end anywhere
                parts = math.ceil((goal - t) / s["dt"] * s["substeps"] - path.NEAR)
                after = (goal - t) / parts if parts > 1 else goal - t
        return target, after, on_grid

    def arrive(self, s, target):
        s["i"] += 1
        s["t"] = target
        s["part"] = 0

    def act(self, s, e):
        if s["yields"]:
            choose_modes(s, e)

    def meet(self, s, e, after, lands):
        s["event"][0] = s["event"][1] = 0
        return after if lands else next_end(self, s, e, after)

    def strike(self, s, e, after):
        return after

    def propose(self, s, e, after):
        if after > 0.0:
            s["steps"] += 1
        march(s, e, after, 0)

    def finite(self, s, e):
        return abs(s["next"][2]) + abs(s["next"][3]) < INF

    def place(self, s, e, h):
        q, origin = s["q"], s["origin"]
        q1, q2 = q[0], q[1]
        if h > 0.0:
            q1, q2 = s["next"][0], s["next"][1]
        x, y = arm.handle_position(q1, q2, path.arm_of(s))
        return x - origin[0], y - origin[1]

    def keep(self, s, e, after, shows):
        if not shows:
            return
        px, py, vx, vy, fx, fy, t1, t2, deltax, deltay = s["sample"]
        (bx, by), i = path.damping_now(s, s["t"]), s["filled"]
        put_sample(
            e.rows, i * ROW_BYTES, s["q"][0], s["q"][1], px, py, vx, vy, fx, fy, t1, t2, deltax,
            deltay, bx, by, s["w"][0], s["w"][1],
        )  # fmt: skip
        if s["yields"]:
            e.rendered[i, 0], e.rendered[i, 1] = s["resisted"][0], s["resisted"][1]
        put6(s["final"], 0, px, py, vx, vy, s["w"][0], s["w"][1])
        for j in range(POWERS):
            s["work"][j] = s["done"][j]
        s["filled"] = i + 1

    def commit(self, s, e, after):
        x = s["next"]
        take(s, e, x[0], x[1], x[2], x[3])
        for j in range(8):
            s["control"][j] = x[4 + j]
            s["form_states"][j] = s["form_next"][j]
        for j in range(POWERS):
            s["done"][j] = x[12 + j]
        s["part"] = (s["part"] + 1) % s["substeps"]
        for j in range(2):
            s["ended"][j] = s["event"][j]

    def speed(self, s, e, i):
        u = arm.jacobian(s["q"][0], s["q"][1], path.arm_of(s))
        vx, vy = arm.handle_velocity(s["w"][0], s["w"][0] + s["w"][1], u)
        return vy if i else vx


def fastest_rate(scenario: Scenario, grown: float = 0.0) -> float:
    """Fastest rate of a scene, by which the explicit method divides its steps [1/s].

    It is that of clay and hand against the handle; or of a servo or a pole of a compensator that
    the longest step does not hold.

    Args:
        scenario: the scene.
        grown: time for which clay that grows has grown [s].
    """
    hands = [th or NO_HAND for th in scenario.operators]
    damper, spring = max(th.damper for th in hands), max(th.spring for th in hands)
    b, W = steepest_clay(scenario, grown), largest_lightness(scenario)
    return max((b + damper) * W + math.sqrt(spring * W), 0.5 * own_rate(scenario))


def steepest_clay(scenario: Scenario, grown: float) -> float:
    """Largest damping of the clay, with that of its consistency at REFERENCE_SPEED [N.s/m].

    Args:
        scenario: the scene.
        grown: as in `fastest_rate` [s].
    """
    most, clay = 0.0, scenario.clay
    for law in clay.laws if clay else ():
        b = np.minimum(law.damping + grown * law.rates, B_MAX)
        if clay and clay.yields:
            _, K, n = law.flows
            b = b + n * K * REFERENCE_SPEED ** (n - 1.0)
        most = max(most, float(b.max()))
    return most


def largest_lightness(scenario: Scenario) -> float:
    """Largest acceleration of the handle per unit of force [1/kg].

    Args:
        scenario: the scene.
    """
    W, through = scenario.arm.links[4], 0.0
    for servo, shape, K in zip(scenario.servo, scenario.compensators, scenario.gain, strict=True):
        if scenario.shaping:
            W = max(W, servo.S.gain)
        if len(shape.num) == len(shape.den):  # C passes a force on at once
            through = max(through, K * servo.G.gain * abs(shape.num[0]))
    return W + through


def creep_limit(scenario: Scenario) -> float:
    """Speed below which clay of n < 1 counts as at rest, as its steps would be too many [m/s].

    Args:
        scenario: the scene.
    """
    W, most = largest_lightness(scenario), 0.0
    for law in scenario.clay.laws if scenario.clay else ():
        _, K, n = (x.ravel().tolist() for x in law.flows)
        most = max(modes.creep_speed(W, scenario.dt, *x) for x in zip(K, n, strict=True))
    return most


def own_rate(scenario: Scenario) -> float:
    """Fastest rate of compensator and servo [1/s].

    Args:
        scenario: the scene.
    """
    blocks = [(1.0, x.damping, x.stiffness) for servo in scenario.servo for x in (servo.G, servo.S)]
    poles = [np.roots(x) for x in (*blocks, *(c.den for c in scenario.compensators))]
    return float(np.abs(np.concatenate(poles)).max())


def parts_of_sample(scenario: Scenario, i: int) -> int:
    """Engine steps a sample, the same for all samples of a block.

    Args:
        scenario: the scene.
        i: one of the samples.
    """
    grown = 0.0
    if scenario.clay and scenario.clay.grows:  # at the end of the block: no clay has grown longer
        grown = min((i // GROWTH_BLOCK + 1) * GROWTH_BLOCK * scenario.dt, scenario.t_max)
    return max(1, math.ceil(scenario.dt * fastest_rate(scenario, grown) / STABLE_STEP))


def check_explicit(scenario: Scenario) -> None:
    """Refuses a scene that is too stiff for explicit steps at its start.

    Args:
        scenario: the scene.

    Raises:
        ParameterError: it is.
    """
    parts, bound = parts_of_sample(scenario, 0), ""
    if parts > SUBSTEPS:
        bound = f"would take {parts:.4g} steps a sample in so stiff a scene"
    elif scenario.clay and scenario.clay.yields and (creep := creep_limit(scenario)) > CREEP_MOST:
        bound = f"would take a creep of {creep:.2g} m/s in this clay for rest"
    if bound:
        bound = f"explicit: {bound}; choose 'fast'"
        raise ParameterError("integrator", scenario.integrator, bound)


class RungeKuttaRun(Run):
    """A run by `RungeKutta`.

    Raises:
        ParameterError: the scene is so stiff that a sample would take more than 1000 steps.
    """

    fields, method = RUNGE_KUTTA_STATE, RungeKutta()

    def _start(self) -> None:
        super()._start()
        s, now = self.scenario, self.s
        check_explicit(s)
        parts = parts_of_sample(s, 0)
        if now["yields"]:
            now["lightness"] = largest_lightness(s)
            self._put(mode=(1, 1))
        now["substeps"], now["break"] = parts, math.inf
        control = loop.initial_state(s.start, s.velocity, s.servo)[:8]
        if now["formed"]:
            control = (*control[:2], 0.0, 0.0, *control[4:])
            self._put(form_states=self.moving_states())
            for i in (0, 1):
                compensator.form_kick(
                    now["form"], now["formed"], i, 0.0, 0.0, now["form_work"], now["form_kick"]
                )
        self._put(control=control)

    def _make(self, room: int) -> None:
        if not self.varies:
            super()._make(room)
            return
        now = self.s
        if self.scenario.clay and self.scenario.clay.grows:
            if now["part"] == 0:
                now["substeps"] = parts_of_sample(self.scenario, self.i)
            if now["substeps"] > SUBSTEPS:
                self.give_up(SUBSTEPS)
                return
            room = min(room, now["filled"] + GROWTH_BLOCK - self.i % GROWTH_BLOCK)
        parts = now["substeps"]
        cosines = max((d.cosines for d in self.drives.values()), default=0)
        most = max(1, COSINES // (2 * parts * max(1, cosines)))
        n = max(0, min(room - now["filled"], self.last - self.i, most))
        now["first"] = self.i
        span = self._prepare_drives(n + 1)
        if self.drives:
            breaks = np.concatenate([d.breaks(*span) for d in self.drives.values()])
            self._arrays(breaks=np.unique(breaks))
        self._arrays(ahead=stages_ahead(self, self.i, n + 1, parts))
        super()._make(min(room, now["filled"] + max(n, 1)))
