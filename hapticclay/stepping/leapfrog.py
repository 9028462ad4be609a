"""The default method: a leapfrog of one engine step a sample, second order.

`kicks` is the loop, written out flat because CPython pays for each call; the laws it spells out are
those of `model.arm` and `model.controller` (tests/stepping/test_leapfrog.py compares them).
"""

from __future__ import annotations

import struct
from math import cos, sin
from typing import Any, NamedTuple

import numpy as np

from ..model import arm, clay, compensator, controller, regions
from . import energy, loop, path
from .path import INF, TOUCH, put6, put12, put33

FIRST_OF_HIT = 0.02  # first step of a hit that saturates the motors, in decay times of the speed
HIT_GROWTH = 1.01  # of each step of it over the one before
# floats of a raw row: q, p, v before and after, f, tau, delta, joint rates before and after, clay
# force beside its dampers, two axes each; Jacobian. Of a row of what varies: loop.step_inputs,
# the clay, and the change of the command to the next sample.
RAW, VARIED = 24, 16
RAW_BYTES, VARIED_BYTES = 8 * RAW, 8 * VARIED
VARIED_BLOCK = 256  # whole steps worked out ahead of a border that may end them
# the cheapest way for CPython to write floats: (array, offset [bytes], floats)
put_raw, put_varied = struct.Struct(f"{RAW}d").pack_into, struct.Struct(f"{VARIED}d").pack_into

LEAPFROG_STATE = [  # beside path.STATE
    # (deltax, deltay [m], deltax', deltay' [m/s], yx, yy [m], yx', yy' [m/s], g1, g2 [rad/s^2],
    # owedx, owedy [N.s]): compensator output and rate, reference model y = G delta and its rate,
    # link accelerations, impulse owed by stiff clay; positions at the sample, rates before it.
    # delta counts by the static gain of G; where the compensator is `formed`, it holds start and
    # the command alone.
    ("loop", "f8", 12),
    ("form_states", "f8", 2 * compensator.ORDER),  # of it, x and y, before the sample
    ("form_next", "f8", 2 * compensator.ORDER),  # and after the kick last worked out
    ("form_kept", "f8", 2 * compensator.ORDER),
    ("form_kick", "f8", 2 * compensator.KICK),  # compensator.form_kick of each axis
    ("form_work", "f8", compensator.WORK),
    ("leapt", "i8"),  # whole steps of `leap_block` before this block
    ("form_of", "f8", 2),  # lengths of the steps that these are for [s]
    # of the kick last worked out, beside its raw row, the first of Engine.raw:
    ("coefficients", "f8", 33),  # loop.loop_coefficients
    ("inputs", "f8", 12),  # loop.step_inputs
    ("next", "f8", 12),  # state for the next sample
    ("command", "f8", 6),  # motors [N.m], implicit clay x, y [N.s/m], further torques [N.m]
]


def kicks(s, e, n):  # noqa: PLR0912, PLR0915  # flat for CPython
    """Works out one kick, or carries the loop across samples by whole steps within one region.

    A kick is the velocity step from the middle of the step before a sample to the middle of the
    step after it.

    Args:
        s: state of the run, with what `prepare` left there; gets the kick worked out.
        e: its arrays.
        n: largest number of steps to make; 0 makes none.

    Returns:
        Number of steps made.
    """
    (
        H, step, half, keepx, takex, nx, mx, kpx, keepy, takey, ny, my, kpy, lagx, lagy,
        gainx, gainy, ox, noy, limit1, limit2, square1, square2, springx, springy, massx, massy,
        dampx0, dampy0, dampx1, dampy1, held, shaped,
    ) = s["coefficients"]  # fmt: skip
    bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey, _, _ = s["inputs"]
    deltax, deltay, ex, ey, yx, yy, ydx, ydy, g1, g2, owedx, owedy = s["loop"]
    q1, q2 = s["q"]
    w1, w2 = s["w"]
    L1, L2, I1, I2, trace = s["arm"]
    ratiox, _, _, SXX, _, _ = s["servox"]
    ratioy, _, _, SYY, _, _ = s["servoy"]
    formed, turned, grain = s["formed"], s["turned_clay"], s["grain"]
    smooth, table, grooved = s["smooth"] if n > 0 else 0, e.table, s["grooved"] if n > 0 else 0
    q, w, ctrl, push, mj_step, model, data = e.q, e.w, e.ctrl, e.push, e.step, e.model, e.data
    low, high = s["low"], s["high"]
    lowx, lowy, highx, highy = low[0], low[1], high[0], high[1]
    varies = n > 0 and s["first"] >= 0
    varied = e.varied
    reach = 0.5 * step * step
    softx, softy, restx, resty, hx, hy, fex, fey = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if n > 0 and s["dampers"]:
        ctrl[2], ctrl[3] = bx1, by1
    made = 0
    p1, p2, dz, rx, ry = 0.0, 0.0, 0.0, 0.0, 0.0
    beyond, yields, still, felt = s["beyond"], s["yields"], False, s["felt"]
    pullx, pully = 0.0, 0.0  # of springs
    odd = stiff > 0.0 or turned > 0 or beyond > 0
    feedx, feedy, throughx, throughy, startx, starty = 0.0, 0.0, 0.0, 0.0, deltax, deltay
    form, kick, gainsx, gainsy = s["form_next"], s["form_kick"], s["gain"][0], s["gain"][1]
    if formed:
        ex, ey = 0.0, 0.0
        for j in range(2 * compensator.ORDER):
            form[j] = s["form_states"][j]
        # delta that the force of this kick adds, and acceleration by way of it
        feedx = ratiox * gainsx * kick[compensator.FEED]
        feedy = ratioy * gainsy * kick[compensator.KICK + compensator.FEED]
        throughx, throughy = nx * takex * feedx, ny * takey * feedy
    while True:
        # what changes from step to step
        if varies:
            bx0, bx1, by0, by1 = (
                varied[made, 0], varied[made, 1], varied[made, 2], varied[made, 3]
            )  # fmt: skip
            uhx, uhy, stiff = varied[made, 5], varied[made, 6], varied[made, 7]
            sharex, sharey = varied[made, 8], varied[made, 9]
            odd = stiff > 0.0 or turned > 0 or beyond > 0
            if s["dampers"]:
                ctrl[2], ctrl[3] = bx1, by1

        # kinematics of the handle
        a2 = q1 + q2
        u1x, u1y = -L1 * sin(q1), L1 * cos(q1)
        u2x, u2y = -L2 * sin(a2), L2 * cos(a2)
        px = u1y + u2y - ox
        py = noy - u1x - u2x
        if smooth:  # and never stiff, see Scenario
            x, y = regions.smooth_clay(table, smooth, px, py, 0.0, 0.0)
            if smooth != 2:
                bx0 = bx1 = 0.5 * x
                varied[made, 0], varied[made, 1], varied[made, 12] = bx0, bx1, x
            if smooth != 1:
                by0 = by1 = 0.5 * y
                varied[made, 2], varied[made, 3], varied[made, 13] = by0, by1, y
            ctrl[2], ctrl[3] = bx1, by1
        r2 = w1 + w2
        vx = u1x * w1 + u2x * r2
        vy = u1y * w1 + u2y * r2
        if grooved:
            path.cut_clay(s, e, px, py, vx, vy)
            if grooved == 2:  # and never stiff, see Scenario
                x, y = s["base"]
                bx0 = bx1 = 0.5 * x
                by0 = by1 = 0.5 * y
                varied[made, 0], varied[made, 1], varied[made, 12] = bx0, bx1, x
                varied[made, 2], varied[made, 3], varied[made, 13] = by0, by1, y
                ctrl[2], ctrl[3] = bx1, by1
        s1 = w1 + half * g1
        s2 = r2 + half * g2
        s1 = s1 * s1
        s2 = s2 * s2
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

        # clay and operator: net force f = (fx - dx ux, fy - dy uy)
        fx = uhx - bx0 * vx
        fy = uhy - by0 * vy
        dx, dy = bx1, by1
        if odd:
            if turned:  # and never stiff, see Scenario
                x, y = clay.turned_force(grain[0], grain[1], bx0, by0, vx, vy)
                fx, fy = uhx - x, uhy - y
                dx, dy, dz = clay.turned_damping(grain[0], grain[1], bx1, by1)
            elif stiff:  # after the sample the handle stands still where the clay is stiff
                cx, cy = arm.centripetal_about_sample(
                    L, cx, cy, 0.0 if sharex else vx, 0.0 if sharey else vy, (u1x, u1y, u2x, u2y)
                )
            if w1 == 0.0 and w2 == 0.0 and yields:  # at rest, whatever stopped it
                cx, cy = 0.0, 0.0
            if beyond:
                pullx, pully = loop.spring_force(s, L)
                fx -= pullx
                fy -= pully
        if held:
            fx -= springx * px - massx * cx + dampx0 * vx
            fy -= springy * py - massy * cy + dampy0 * vy
            dx += dampx1
            dy += dampy1

        # servo: one kick of the reference model, then of the handle
        if formed:
            deltax = startx + ratiox * compensator.form_output(kick, form, 0)
            deltay = starty + ratioy * compensator.form_output(kick, form, 1)
            sxx += throughx
            syy += throughy
        vrx = keepx * ydx + takex * (deltax - yx)
        vry = keepy * ydy + takey * (deltay - yy)
        ax = nx * vrx + mx * (vx - ydx) + kpx * (yx - px) + cx
        ay = ny * vry + my * (vy - ydy) + kpy * (yy - py) + cy
        newx, newy = owedx, owedy
        if odd and beyond:
            restx, resty = 0.0, 0.0
        if stiff:
            restx, resty = owedx / H, owedy / H
            fex, fey = (bx0 + bx1) * vx, (by0 + by1) * vy
            hx, hy = uhx - springx * px - pullx, uhy - springy * py - pully
            gx = ax - mx * vx + sxx * hx + sxy * hy
            gy = ay - my * vy + sxy * hx + syy * hy
            gx, gy = clay.slow_force(gx, gy, sxx, sxy, syy, sharex, sharey, fex, fey)
            if yields:
                gx, gy = loop.creeping_force(s, L, (gx, gy), (bx0 + bx1, by0 + by1), (vx, vy))
            newx, newy, softx, softy = loop.owed_impulse(
                step, springx, springy, sharex, sharey, gx, gy
            )
            fx += newx - restx
            fy += newy - resty
            dx += softx
            dy += softy
        gx = ax + sxx * fx + sxy * fy
        gy = ay + sxy * fx + syy * fy
        if dx or dy:
            m1 = nx + sxx * dx
            m2 = sxy * dy
            r = sxy * dx / m1
            uy = (gy - r * gx) / (ny + syy * dy - r * m2)
            ux = (gx - m2 * uy) / m1
        else:
            ux = gx / nx
            uy = gy / ny
        ffx = fx - dx * ux
        ffy = fy - dy * uy
        if dz:
            ux, uy = controller.solve_turned((nx, ny), (gx, gy), (sxx, sxy, syy), (dx, dy, dz))
            ffx = fx - dx * ux - dz * uy
            ffy = fy - dy * uy - dz * ux
        if odd and yields:
            ux, uy, rx, ry = loop.yield_in_kick(
                s,
                H,
                L,
                (nx, ny),
                (sxx, sxy, syy),
                (dx, dy, dz),
                (vx, vy),
                (ux, uy),
                (cx, cy),
                (px, py),
            )
            ffx = fx - rx - dx * ux - dz * uy
            ffy = fy - ry - dy * uy - dz * ux
        gx = ux - vx
        gy = uy - vy
        det = H * (u1x * u2y - u2x * u1y)
        h1 = (gx * u2y - gy * u2x) / det
        h2 = (gy * u1x - gx * u1y) / det
        t2 = I2 * h2 - u2x * ffx - u2y * ffy
        t1 = I1 * h1 - u1x * ffx - u1y * ffy + t2
        cut = t1 * t1 > square1 or t2 * t2 > square2
        if cut:
            if dz:
                ux, uy, h1, h2, ffx, ffy, t1, t2 = controller.turned_kick_at_limit(
                    H, (vx, vy), (u1x, u1y, u2x, u2y), (L1, L2, I1, I2, trace), (fx, fy),
                    (dx, dy, dz), (t1, t2), (limit1, limit2),
                )  # fmt: skip
            else:
                ux, uy, h1, h2, ffx, ffy, t1, t2 = controller.kick_at_limit(
                    H, (vx, vy), (u1x, u1y, u2x, u2y), (L1, L2, I1, I2, trace), (fx, fy), (dx, dy),
                    (t1, t2), (limit1, limit2),
                )  # fmt: skip
        if odd:
            if stiff:
                # motors at their limits hold less against the clay
                if t1 * t1 >= square1 or t2 * t2 >= square2:
                    cut = True
                    gx, gy = arm.handle_acceleration(
                        (t1 - t2) / I1,
                        t2 / I2,
                        hx,
                        hy,
                        (u1x, u1y, u2x, u2y),
                        (L1, L2, I1, I2, trace),
                    )
                    sxx, sxy, syy = arm.mobility((u1x, u1y, u2x, u2y), (L1, L2, I1, I2, trace))
                    gx, gy = clay.slow_force(gx, gy, sxx, sxy, syy, sharex, sharey, fex, fey)
                    if yields:
                        gx, gy = loop.creeping_force(
                            s, L, (gx, gy), (bx0 + bx1, by0 + by1), (vx, vy)
                        )
                    fx -= newx
                    fy -= newy
                    newx, newy, _, _ = loop.owed_impulse(
                        step, springx, springy, sharex, sharey, gx, gy
                    )
                    fx += newx
                    fy += newy
                    ux, uy = controller.velocity_under_torque(
                        H, (vx, vy), (u1x, u1y, u2x, u2y), (L1, L2, I1, I2, trace), (t1, t2),
                        (fx, fy), (dx, dy),
                    )  # fmt: skip
                    ffx = fx - dx * ux
                    ffy = fy - dy * uy
                    h1, h2 = arm.joint_velocity(ux - vx, uy - vy, (u1x, u1y, u2x, u2y), H)
            if yields and cut:
                ux, uy, rx, ry = loop.yield_in_kick(
                    s, H, L, (1.0 / H, 1.0 / H),
                    arm.mobility((u1x, u1y, u2x, u2y), (L1, L2, I1, I2, trace)), (dx, dy, dz),
                    (vx, vy), (ux, uy), (cx, cy), (px, py),
                )  # fmt: skip
                ffx = fx - rx - dx * ux - dz * uy
                ffy = fy - ry - dy * uy - dz * ux
                h1, h2 = arm.joint_velocity(ux - vx, uy - vy, (u1x, u1y, u2x, u2y), H)
            if stiff:
                newx -= softx * ux
                newy -= softy * uy
                restx -= newx
                resty -= newy
                fx -= softx * ux
                fy -= softy * uy
                newx *= H
                newy *= H
            elif turned:
                restx, resty = loop.turned_rest(grain, (bx0, bx1, by0, by1), vx, vy, ux, uy)

        n1 = w1 + H * h1
        n2 = w2 + H * (h2 - h1)
        if beyond:
            if yields:
                still = felt[8] > 0.0
                if still:
                    n1, n2 = 0.0, 0.0
            else:
                felt[2], felt[3] = vx + L * (ux - vx), vy + L * (uy - vy)
                felt[4], felt[5] = 0.0, 0.0
            fx -= rx
            fy -= ry
            felt[0], felt[1], felt[12], felt[13] = rx, ry, pullx, pully
            restx += rx + pullx
            resty += ry + pully
        if n:  # a step that would leave the region is left to path.careful
            r2 = n1 + n2
            slack = reach * (L1 * n1 * n1 + L2 * r2 * r2) + TOUCH  # where the velocity points
            x = px + step * ux
            y = py + step * uy
            if not (lowx + slack <= x <= highx - slack and lowy + slack <= y <= highy - slack):
                if not abs(n1) + abs(n2) < INF:
                    break
                x, y = arm.handle_position(q1 + step * n1, q2 + step * n2, (L1, L2, I1, I2, trace))
                x, y = x - ox, y + noy
                if not (lowx - TOUCH <= x <= highx + TOUCH and lowy - TOUCH <= y <= highy + TOUCH):
                    break

        # to the engine goes what it does not treat implicitly: the hand, and the clay's first part
        if held:
            fx -= dampx1 * ux
            fy -= dampy1 * uy
        p2 = u2x * fx + u2y * fy
        p1 = u1x * fx + u1y * fy + p2

        # compensator, driven by the force that acts in this kick
        if formed:
            deltax += feedx * ffx
            deltay += feedy * ffy
            vrx += takex * feedx * ffx
            vry += takey * feedy * ffy
            compensator.form_advance(kick, form, 0, gainsx * ffx)
            compensator.form_advance(kick, form, 1, gainsy * ffy)
        else:
            ex = lagx * ex + gainx * ffx
            ey = lagy * ey + gainy * ffy
        put_raw(
            e.raw, made * RAW_BYTES, q1, q2, px, py, vx, vy, ux, uy, ffx, ffy, t1, t2,
            deltax, deltay, w1, w2, n1, n2, restx, resty, u1x, u1y, u2x, u2y,
        )  # fmt: skip
        deltax += step * ex
        deltay += step * ey
        yx += step * vrx
        yy += step * vry
        ydx, ydy, g1, g2, owedx, owedy = vrx, vry, h1, h2, newx, newy
        if n == 0:
            break
        ctrl[0], ctrl[1] = t1, t2
        push[0], push[1] = p1, p2
        if varies:
            deltax += varied[made, 14]
            deltay += varied[made, 15]
            startx += varied[made, 14]
            starty += varied[made, 15]
        mj_step(model, data)
        if beyond:
            for j in range(path.FELT):
                e.felt[made, j] = felt[j]
            if yields:
                t = (s["i"] + s["leapt"] + made) * step
                path.note_stop(s, e, t, int(felt[6]), int(felt[7]))
                if still:
                    w[0], w[1] = 0.0, 0.0
        made += 1
        if made == n:
            break
        q1, q2, w1, w2 = q[0], q[1], w[0], w[1]
    if formed:
        deltax, deltay = startx, starty
    put12(s["next"], 0, deltax, deltay, ex, ey, yx, yy, ydx, ydy, g1, g2, owedx, owedy)
    put6(s["command"], 0, t1, t2, bx1, by1, p1, p2)
    return made


def prepare(s, e, before, after):
    """Readies a kick for `kicks`.

    Args:
        s: state of the run.
        e: its arrays.
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].
    """
    put33(s["coefficients"], 0, *loop.loop_coefficients(s, before, after))
    if s["formed"]:
        prepare_form(s, before, after)
    put12(s["inputs"], 0, *inputs(s, e, before, after))


def prepare_form(s, before, after):
    """Readies the compensator for a kick, unless it is ready.

    Args:
        s: state of the run.
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].
    """
    ready = s["form_of"]
    if ready[0] != before or ready[1] != after:
        for i in range(2):
            compensator.form_kick(
                s["form"], s["formed"], i, before, after, s["form_work"], s["form_kick"]
            )
        ready[0], ready[1] = before, after


def propose(s, e, before, after):
    """Works out the kick between steps of these lengths.

    Args:
        s: state of the run.
        e: its arrays.
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].
    """
    prepare(s, e, before, after)
    kicks(s, e, 0)


def inputs(s, e, before, after):
    """loop.step_inputs of the kick now.

    Args:
        s: state of the run.
        e: its arrays.
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].

    Returns:
        12 numbers.
    """
    t = s["t"]
    b0, b1 = path.damping_before(s, t - 0.25 * before), path.damping_now(s, t + 0.25 * after)
    uh = path.mean_force(s, e, t + 0.25 * (after - before), 0.25 * (before + after))
    return loop.step_inputs(s, b0, b1, uh, before, after)


def vary(s, e, n):
    """Works out what varies in the next whole steps.

    Args:
        s: state of the run, with what `prepare` left there.
        e: its arrays.
        n: number of steps.
    """
    k, coming, dt = s["inputs"], e.ahead, s["dt"]
    base, rate = (s["base"][0], s["base"][1]), (s["rate"][0], s["rate"][1])
    bx0, bx1, by0, by1, L, _, _, stiff, sharex, sharey, meltx, melty = k
    ratiox, ratioy = s["servox"][0], s["servoy"][0]
    for j in range(n):
        i = s["i"] - s["first"] + j
        t, uhx, uhy = coming[i, 4], coming[i, 0], coming[i, 1]
        if rate[0] > 0.0 or rate[1] > 0.0:
            b0 = clay.damping_at(base, rate, t - 0.25 * dt)
            b1 = clay.damping_at(base, rate, t + 0.25 * dt)
            bx0, bx1, by0, by1, L, _, _, stiff, sharex, sharey, meltx, melty = loop.step_inputs(
                s, b0, b1, (uhx, uhy), dt, dt
            )
        x, y = clay.damping_at(base, rate, t)
        put_varied(
            e.varied, j * VARIED_BYTES, bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey,
            meltx, melty, x, y, ratiox * coming[i, 2], ratioy * coming[i, 3],
        )  # fmt: skip


def leap_block(s, e, n):
    """Makes whole steps within one region of the clay and takes them into the record.

    Args:
        s: state of the run, with what `prepare` and `vary` left there.
        e: its arrays.
        n: largest number of steps.

    Returns:
        Number of steps made.
    """
    total = 0
    while total < n:  # in blocks that stay in the cache
        most = min(n - total, len(e.raw))
        s["leapt"] = total
        made = kicks(s, e, most)
        if made:
            accept(s)
            for j in range(2):
                s["q"][j], s["w"][j] = e.q[j], e.w[j]
            if s["smooth"]:
                path.feel_place(s, e.table)
            if s["grooved"]:
                path.cut_place(s, e)
            tabulate(s, e, made)
            s["filled"] += made
            total += made
        if made < most:
            break
    return total


def tabulate(s, e, n):
    """Takes a block of whole steps into the record and the ledger.

    Args:
        s: state of the run.
        e: its arrays.
        n: number of steps.
    """
    at, work, varies = s["filled"], s["work"], s["first"] >= 0
    raw, out = np.asarray(e.raw)[:n].T.copy(), np.asarray(e.rows)[at : at + n].T
    k: Any = np.asarray(e.varied)[:n].T.copy() if varies else block_inputs(s)
    before: Any = raw[4:6]
    after: Any = raw[6:8]
    rest: Any = raw[18:20]
    out[0:4] = raw[0:4]
    for i in (0, 1):
        out[4 + i] = before[i] + k[4] * (after[i] - before[i])
        if np.any(k[10 + i]):  # see loop.velocity_at_sample
            v = k[10 + i] * (k[2 * i] * before[i] + k[2 * i + 1] * after[i] + rest[i])
            out[4 + i] = np.where(k[10 + i] > 0.0, v, out[4 + i])
        out[6 + i] = k[5 + i]
        if s["held"]:
            out[6 + i] = raw[8 + i] + k[2 * i] * before[i] + k[2 * i + 1] * after[i] + rest[i]
        out[12 + i] = k[12 + i]
    if s["beyond"]:
        tabulate_felt(s, e, n, k, raw)
    out[8:10] = raw[10:12]
    out[10], out[11] = raw[12] / s["servox"][0], raw[13] / s["servoy"][0]
    r1, r2 = arm.joint_velocity(out[4], out[5], raw[20:24], 1.0)
    out[14], out[15] = r1, r2 - r1
    done = energy.kick_work(
        s["dt"], k, rest[0], rest[1], before[0], before[1], after[0], after[1], raw[10], raw[11],
        0.5 * (raw[14] + raw[16]), 0.5 * (raw[15] + raw[17]), s["handx"][1], s["handy"][1],
    )  # fmt: skip
    for j, x in enumerate(done):  # one after the other, as in the loop below
        work[j] = float(np.cumsum(np.append(work[j], x))[-1])
    put6(s["final"], 0, *raw[[2, 3, 6, 7, 16, 17], n - 1].tolist())


def tabulate_felt(s, e, n, k, raw):
    """As `write_felt`, of a block.

    Args:
        s: state of the run.
        e: its arrays.
        n: number of steps.
        k: loop.step_inputs of them and clay, a row each.
        raw: their raw rows as columns.
    """
    at, felt = s["filled"], np.asarray(e.felt)[:n].T
    out, fe = np.asarray(e.rows)[at : at + n].T, np.asarray(e.rendered)[at : at + n].T
    v = [felt[2], felt[3]]
    for i in (0, 1):
        rest = raw[18 + i] - felt[i] - felt[12 + i]
        slow = k[10 + i] * (k[2 * i] * raw[4 + i] + k[2 * i + 1] * raw[6 + i] + rest)
        v[i] = np.where((k[10 + i] > 0.0) & (v[i] != 0.0), slow, v[i])
    if s["yields"] and not s["turned_clay"]:
        x, y = v[0] * felt[4], v[1] * felt[5]
        if s["yields"] == 2:
            x = y = x + y
        v[0], v[1] = np.where(x < 0.0, 0.0, v[0]), np.where(y < 0.0, 0.0, v[1])
    out[4], out[5] = v
    fex, fey = path.viscous_parts(s, out[12], out[13], out[4], out[5])
    fe[0], fe[1] = fex + felt[4] + felt[12], fey + felt[5] + felt[13]
    if s["grooved"]:
        fe[2] = felt[9]


def tabulate_each(s, e, n):
    """As `tabulate`, row by row, for compiled runs.

    Args:
        s: state of the run.
        e: its arrays.
        n: number of steps.
    """
    x = block_inputs(s)
    for j in range(n):
        if s["first"] >= 0:
            y = e.varied
            x = (
                y[j, 0], y[j, 1], y[j, 2], y[j, 3], y[j, 4], y[j, 5], y[j, 6],
                y[j, 7], y[j, 8], y[j, 9], y[j, 10], y[j, 11], y[j, 12], y[j, 13],
            )  # fmt: skip
        write_row(s, e, j, s["filled"] + j, x)
        add_work(s, e, j, s["dt"], x)


def block_inputs(s):
    """loop.step_inputs and clay of whole steps, where nothing varies.

    Args:
        s: state of the run.

    Returns:
        14 numbers.
    """
    k, base = s["inputs"], s["base"]
    return (
        k[0], k[1], k[2], k[3], k[4], k[5], k[6], k[7], k[8], k[9], k[10], k[11], base[0], base[1]
    )  # fmt: skip


def write_row(s, e, j, i, x):
    """Writes the row of a sample.

    Args:
        s: state of the run.
        e: its arrays.
        j: raw row of the kick.
        i: row of the record.
        x: loop.step_inputs of the kick, and the clay at the sample [N.s/m].
    """
    raw, rows = e.raw, e.rows
    vx, vy, ux, uy = raw[j, 4], raw[j, 5], raw[j, 6], raw[j, 7]
    restx, resty = raw[j, 18], raw[j, 19]
    for n in range(4):
        rows[i, n] = raw[j, n]
    rows[i, 8], rows[i, 9] = raw[j, 10], raw[j, 11]
    rows[i, 10], rows[i, 11] = raw[j, 12] / s["servox"][0], raw[j, 13] / s["servoy"][0]
    rows[i, 4] = loop.velocity_at_sample(x, 0, vx, ux, restx)
    rows[i, 5] = loop.velocity_at_sample(x, 1, vy, uy, resty)
    if s["held"]:
        rows[i, 6] = raw[j, 8] + x[0] * vx + x[1] * ux + restx
        rows[i, 7] = raw[j, 9] + x[2] * vy + x[3] * uy + resty
    else:
        rows[i, 6], rows[i, 7] = x[5], x[6]
    rows[i, 12], rows[i, 13] = x[12], x[13]
    if s["beyond"]:
        write_felt(s, e, j, i, x)
    write_rates(e, j, i)


def write_felt(s, e, j, i, x):
    """Writes velocity and force of clay that yields of a row.

    Args:
        s: state of the run.
        e: its arrays.
        j: raw row of the kick.
        i: row of the record.
        x: as in `write_row`.
    """
    raw, felt, rows = e.raw, e.felt, e.rows
    for n in range(2):
        v = felt[j, 2 + n]
        if x[10 + n] > 0.0 and v != 0.0:
            rest = raw[j, 18 + n] - felt[j, n] - felt[j, 12 + n]
            v = loop.velocity_at_sample(x, n, raw[j, 4 + n], raw[j, 6 + n], rest)
        rows[i, 4 + n] = v
    if s["yields"] and not s["turned_clay"]:  # which is never stiff, see Scenario
        rows[i, 4], rows[i, 5] = loop.not_against(s, rows[i, 4], rows[i, 5], felt[j, 4], felt[j, 5])
    fex, fey = path.viscous_parts(s, x[12], x[13], rows[i, 4], rows[i, 5])
    e.rendered[i, 0] = fex + felt[j, 4] + felt[j, 12]
    e.rendered[i, 1] = fey + felt[j, 5] + felt[j, 13]
    if s["grooved"]:
        e.rendered[i, 2] = felt[j, 9]


def write_rates(e, j, i):
    """Writes the joint rates of a row, from its velocity.

    Args:
        e: arrays of the run.
        j: raw row of the kick.
        i: row of the record.
    """
    raw, rows = e.raw, e.rows
    u = (raw[j, 20], raw[j, 21], raw[j, 22], raw[j, 23])
    r1, r2 = arm.joint_velocity(rows[i, 4], rows[i, 5], u, 1.0)
    rows[i, 14], rows[i, 15] = r1, r2 - r1


def add_work(s, e, j, H, x):
    """Adds the work of a kick to the ledger.

    Args:
        s: state of the run.
        e: its arrays.
        j: raw row of the kick.
        H: length of the kick [s].
        x: loop.step_inputs of the kick.
    """
    raw, work = e.raw, s["work"]
    done = energy.kick_work(
        H, x, raw[j, 18], raw[j, 19], raw[j, 4], raw[j, 5], raw[j, 6], raw[j, 7],
        raw[j, 10], raw[j, 11], 0.5 * (raw[j, 14] + raw[j, 16]),
        0.5 * (raw[j, 15] + raw[j, 17]), s["handx"][1], s["handy"][1],
    )  # fmt: skip
    for n in range(5):
        work[n] += done[n]
    put6(s["final"], 0, raw[j, 2], raw[j, 3], raw[j, 6], raw[j, 7], raw[j, 16], raw[j, 17])


def limited(s):
    """Whether a motor is at its limit in the kick worked out.

    Args:
        s: state of the run.
    """
    tau, limit = s["command"], s["torque_limit"]
    return abs(tau[0]) >= limit[0] or abs(tau[1]) >= limit[1]


def accept(s):
    """Takes the state after the kick worked out.

    Args:
        s: state of the run.
    """
    for j in range(12):
        s["loop"][j] = s["next"][j]
    if s["formed"]:
        for j in range(2 * compensator.ORDER):
            s["form_states"][j] = s["form_next"][j]


def step_engine(s, e, command, after):
    """Gives the engine a command, steps it, and reads it.

    Args:
        s: state of the run.
        e: its arrays.
        command: (tau1, tau2, implicit clay bx, by [N.s/m], further torques 1, 2 [N.m]).
        after: length of the step [s].
    """
    e.ctrl[0], e.ctrl[1] = command[0], command[1]
    if s["dampers"]:
        e.ctrl[2], e.ctrl[3] = command[2], command[3]
    e.push[0], e.push[1] = command[4], command[5]
    e.timestep[0] = after
    e.step(e.model, e.data)
    e.timestep[0] = s["dt"]
    s["steps"] += 1
    if s["yields"] and s["stuck"][0] and s["stuck"][1]:
        e.w[0], e.w[1] = 0.0, 0.0  # the engine's rounding would creep
    for j in range(2):
        s["q"][j], s["w"][j] = e.q[j], e.w[j]
    if s["springs"]:
        path.feel_spring(s, e.table, after)
    if s["smooth"]:
        path.feel_place(s, e.table)


def steps_ahead(run, i, n):
    """What changes from step to step: muscle force, command and time, over the next whole steps.

    Args:
        run: the run.
        i: index of the first sample.
        n: number of samples.

    Returns:
        Shape (n, 5): mean muscle force around the sample (x, y) [N], change of the command to the
        next sample (x, y) [m], time of the sample [s].
    """
    dt = run.scenario.dt
    t = (i + np.arange(n + 1)) * dt
    out = np.zeros((n, 5))
    out[:, 0:2] = run.uh(t[:n], 0.5 * dt)
    if run.command:
        out[:, 2:4] = np.diff(run.command.around(t, 0.5 * dt), axis=0)
    out[:, 4] = t[:n]
    return out


class Leapfrog(NamedTuple):
    """The method; `path.Method` says what each part does.

    Attributes:
        order: of its error in the step.
    """

    order: int = 2

    def begin(self, s, e, x, y):
        """Readies a run whose handle has been put to its start: nothing is left to do.

        Args:
            s: state of the run.
            e: its arrays.
            x: position of the handle, x [m].
            y: the same, y [m].
        """

    def glide(self, s, e, room):
        i, dt = s["i"], s["dt"]
        n = min(s["last"] - i, room - s["filled"])
        if n < 1 or not path.may_glide(s) or s["fine"] < INF:
            return 0
        if s["first"] >= 0:
            n = min(n, s["first"] + len(e.ahead) - i, VARIED_BLOCK)
        prepare(s, e, dt, dt)
        if s["first"] >= 0:
            self.vary(s, e, n)
        made = self.block(s, e, n)
        if made:
            s["steps"] += made
            s["i"] = i + made
            s["t"] = s["i"] * dt
        return made

    def block(self, s, e, n):
        """As leap_block.

        Args:
            s: state of the run.
            e: its arrays.
            n: largest number of steps.
        """
        return leap_block(s, e, n)

    def vary(self, s, e, n):
        """As the function.

        Args:
            s: state of the run.
            e: its arrays.
            n: number of steps.
        """
        vary(s, e, n)

    def stop(self, s):
        return path.next_sample(s["t"], s["i"], s["last"], s["dt"], s["t_max"])

    def arrive(self, s, target):
        s["i"] += 1
        s["t"] = target

    def act(self, s, e):
        pass

    def strike(self, s, e, after):
        # a hit that drives motors into their limits is no mean over a long step: its first step is
        # short, and the step that led here ends with its half of the kick
        s["fine"] = INF
        x, y = path.damping_now(s, s["t"])
        b = max(x, y)
        first = FIRST_OF_HIT / (b * s["arm"][4]) if b > 0.0 else INF
        if first >= after:
            return after
        before, w1, w2, x = s["before"], s["w"][0], s["w"][1], s["loop"]
        saved = (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11])
        for j in range(2 * compensator.ORDER):
            s["form_kept"][j] = s["form_states"][j]
        for trial in range(2):
            if before > 0.0:
                propose(s, e, before, 0.0)
                if trial:
                    add_work(s, e, 0, 0.5 * before, s["inputs"])
                accept(s)
                s["w"][0], s["w"][1] = e.raw[0, 16], e.raw[0, 17]
            if trial == 0:
                propose(s, e, 0.0, first)
                put12(s["loop"], 0, *saved)
                for j in range(2 * compensator.ORDER):
                    s["form_states"][j] = s["form_kept"][j]
                s["w"][0], s["w"][1] = w1, w2
                if not limited(s):
                    return after
        s["fine"], s["before"] = first, 0.0
        e.w[0], e.w[1] = s["w"][0], s["w"][1]
        return first

    def propose(self, s, e, after):
        propose(s, e, s["before"], after)

    def meet(self, s, e, after, lands):
        return after

    def finite(self, s, e):
        return abs(e.raw[0, 16]) + abs(e.raw[0, 17]) < INF

    def place(self, s, e, h):
        q, origin = s["q"], s["origin"]
        x, y = arm.handle_position(q[0] + h * e.raw[0, 16], q[1] + h * e.raw[0, 17], path.arm_of(s))
        return x - origin[0], y - origin[1]

    def keep(self, s, e, after, shows):
        x = s["inputs"]
        if s["beyond"]:
            for j in range(path.FELT):
                e.felt[0, j] = s["felt"][j]
        add_work(s, e, 0, 0.5 * (s["before"] + after), x)
        if not shows:
            return
        i, t = s["filled"], s["t"]
        b = path.damping_now(s, t) if after > 0.0 else path.damping_before(s, t)
        k = (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11], b[0], b[1])
        write_row(s, e, 0, i, k)
        if after == 0.0 and x[7] > 0.0:
            e.rows[i, 4] = self.speed(s, e, 0)
            e.rows[i, 5] = self.speed(s, e, 1)
            if s["beyond"]:
                f = s["felt"]
                fx, fy = path.viscous_parts(s, b[0], b[1], e.rows[i, 4], e.rows[i, 5])
                e.rendered[i, 0], e.rendered[i, 1] = fx + f[4] + f[12], fy + f[5] + f[13]
            write_rates(e, 0, i)
        s["filled"] = i + 1

    def commit(self, s, e, after):
        c, w, dt = s["command"], s["w"], s["dt"]
        command = (c[0], c[1], c[2], c[3], c[4], c[5])
        if not (s["before"] == dt and after == dt):
            n1, n2 = e.raw[0, 16], e.raw[0, 17]
            command = loop.whole_kick(s, w[0], w[1], n1, n2, c[0], c[1], after)
        accept(s)
        if s["yields"]:
            path.note_stop(s, e, s["t"], int(s["felt"][6]), int(s["felt"][7]))
        step_engine(s, e, command, after)
        if len(e.command):
            x, y = path.command_change(e, s["t"], s["t"] + after, 0.5 * dt)
            s["loop"][0] += s["servox"][0] * x
            s["loop"][1] += s["servoy"][0] * y
        if s["fine"] < INF:
            s["fine"] = s["fine"] * HIT_GROWTH if limited(s) else INF

    def speed(self, s, e, i):
        # half a kick has led to the border; in stiff clay that half holds too little of the clay,
        # and the velocity is that of a whole kick, with the step before it repeated
        before = s["before"]
        if before == 0.0:
            return 0.0
        k = inputs(s, e, before, before)
        felt = k[10 + i] > 0.0
        propose(s, e, before, before if felt else 0.0)
        raw = e.raw
        if felt:
            rest = raw[0, 18 + i]
            if s["beyond"]:
                rest = rest - s["felt"][i] - s["felt"][12 + i]
                if s["yields"] and s["felt"][2 + i] == 0.0:
                    return 0.0
            return loop.velocity_at_sample(k, i, raw[0, 4 + i], raw[0, 6 + i], rest)
        return raw[0, 6 + i]
