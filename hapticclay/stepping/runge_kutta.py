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
from ..model.operator import NO_HAND
from ..model.scenario import Scenario
from . import energy, loop, path
from .path import INF, OPEN, ROW, TOUCH, put5, put6, put8, put10, put17
from .run import Run

STABLE_STEP = 0.5  # fastest rate times step up to which an explicit step is trusted
SUBSTEPS = 1000  # most of them for one sample
POWERS = 5  # of energy.kick_work
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
                    near = now
                    if stage == 0:
                        near = t + path.NEAR * dt
                    elif stage == 3:
                        near = max(t + 0.5 * h, now - path.NEAR * dt)
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
            det = u1x * u2y - u2x * u1y
            t2 = I2 * ((gy * u1x - gx * u1y) / det) - u2x * ffx - u2y * ffy
            t1 = I1 * ((gx * u2y - gy * u2x) / det) - u1x * ffx - u1y * ffy + t2
            if t1 * t1 > square1 or t2 * t2 > square2:
                # a kick of one second from rest, in which the velocity after it is the acceleration
                _, _, _, _, ffx, ffy, t1, t2 = controller.kick_at_limit(
                    1.0, (0.0, 0.0), (u1x, u1y, u2x, u2y), (L1, L2, I1, I2, trace), (fx, fy),
                    (massx, massy), (t1, t2), (limit1, limit2),
                )  # fmt: skip
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
        if n > 0:  # a step that would leave the region is left to path.careful
            if not abs(w1) + abs(w2) < INF:
                break
            x, y = arm.handle_position(q1, q2, (L1, L2, I1, I2, trace))
            if not (lowx <= x - ox <= highx and lowy <= y + noy <= highy):
                break
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


class RungeKutta(NamedTuple):
    """The method; `path.Method` says what each part does.

    Attributes:
        order: of its error in the step.
    """

    order: int = 4

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
        return self.block(s, e, n)

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
        return target, after, on_grid

    def arrive(self, s, target):
        s["i"] += 1
        s["t"] = target
        s["part"] = 0

    def act(self, s, e):
        pass

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

    def speed(self, s, e, i):
        u = arm.jacobian(s["q"][0], s["q"][1], path.arm_of(s))
        vx, vy = arm.handle_velocity(s["w"][0], s["w"][0] + s["w"][1], u)
        return vy if i else vx


def fastest_rate(scenario: Scenario) -> float:
    """Fastest rate of a scene, by which the explicit method divides its steps [1/s].

    It is that of clay and hand against the handle; or of a servo or a pole of a compensator that
    the longest step does not hold.

    Args:
        scenario: the scene.
    """
    clay, hands = scenario.clay, [th or NO_HAND for th in scenario.operators]
    b = clay.largest if clay else 0.0
    damper, spring = max(th.damper for th in hands), max(th.spring for th in hands)
    W, through = scenario.arm.links[4], 0.0
    for servo, shape, K in zip(scenario.servo, scenario.compensators, scenario.gain, strict=True):
        if scenario.shaping:
            W = max(W, servo.S.gain)
        if len(shape.num) == len(shape.den):  # C passes a force on at once
            through = max(through, K * servo.G.gain * abs(shape.num[0]))
    W += through
    return max((b + damper) * W + math.sqrt(spring * W), 0.5 * own_rate(scenario))


def own_rate(scenario: Scenario) -> float:
    """Fastest rate of compensator and servo [1/s].

    Args:
        scenario: the scene.
    """
    blocks = [(1.0, x.damping, x.stiffness) for servo in scenario.servo for x in (servo.G, servo.S)]
    poles = [np.roots(x) for x in (*blocks, *(c.den for c in scenario.compensators))]
    return float(np.abs(np.concatenate(poles)).max())


class RungeKuttaRun(Run):
    """A run by `RungeKutta`.

    Raises:
        ParameterError: the scene is so stiff that a sample would take more than 1000 steps.
    """

    fields, method = RUNGE_KUTTA_STATE, RungeKutta()

    def _start(self) -> None:
        super()._start()
        s, now = self.scenario, self.s
        parts = max(1, math.ceil(s.dt * fastest_rate(s) / STABLE_STEP))
        if parts > SUBSTEPS:
            bound = f"explicit: would take {parts:.4g} steps a sample in so stiff a scene"
            raise ParameterError("integrator", s.integrator, bound + "; choose 'fast'")
        now["substeps"], now["landings_most"], now["break"] = parts, 2**62, math.inf
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
        now, parts = self.s, self.s["substeps"]
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
