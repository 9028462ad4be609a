"""What a kick of the loop is made of, by any method that steps as a leapfrog.

The loop is stepped as a leapfrog: angles at the samples t(k), rates halfway between them, so that a
plain step of the engine (rates first, then angles with the new rates) is of second order. A kick
carries the rates across sample k; it lasts from the middle of the step before the sample to the
middle of the step after it. Either step may be short, to end on a border of the clay. Derivation
and error terms: docs/equations.md, section 4.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ..model import clay, controller, flow, groove, operator
from ..model.controller import Servo

NO_FLOW = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0)  # Fy, K, n of x and of y where nothing yields


def initial_state(
    p: Sequence[Any], v: Sequence[Any], servo: tuple[Servo, Servo]
) -> tuple[Any, ...]:
    """State of a loop whose handle has moved evenly for long, as of `leapfrog.kicks`.

    The compensator leads by the lag of G at constant speed. Floats, or arrays over runs.

    Args:
        p: handle position, (x, y) [m].
        v: handle velocity, (x, y) [m/s].
        servo: of each axis.

    Returns:
        12 numbers.
    """
    G = servo[0].G, servo[1].G
    ahead = (
        (p[i] + G[i].damping / G[i].stiffness * v[i]) / (G[i].gain / G[i].stiffness) for i in (0, 1)
    )
    rates = (v[i] / (G[i].gain / G[i].stiffness) for i in (0, 1))
    return (*ahead, *rates, *p, *v, 0.0, 0.0, 0.0, 0.0)


def loop_coefficients(s, before, after):
    """Numbers that a kick takes from the scenario and from the steps around its sample.

    Args:
        s: state of the run, for the scenario's numbers.
        before: length of the step before the sample [s]; 0 at the start.
        after: length of the step after the sample [s]; 0 at the end.

    Returns:
        36 numbers.
    """
    H = 0.5 * (before + after)
    L, R = before / (before + after), after / (before + after)
    keepx, takex, nx, mx, kpx = controller.servo_coefficients(s["servox"], H, L, R)
    keepy, takey, ny, my, kpy = controller.servo_coefficients(s["servoy"], H, L, R)
    lagx, gainx = controller.compensator_coefficients(s["lag"][0], H, L, R)
    lagy, gainy = controller.compensator_coefficients(s["lag"][1], H, L, R)
    # at start and end the kick is half of one
    step = H if before > 0.0 and after > 0.0 else max(before, after)
    springx, massx, dampx0, dampx1 = operator.operator_coefficients(s["handx"], H, L, R, step)
    springy, massy, dampy0, dampy1 = operator.operator_coefficients(s["handy"], H, L, R, step)
    gain, origin, limit = s["gain"], s["origin"], s["torque_limit"]
    return (
        H, after, 0.5 * before, keepx, takex, nx, mx, kpx, keepy, takey, ny, my, kpy,
        lagx, lagy, gainx * gain[0] * s["servox"][0], gainy * gain[1] * s["servoy"][0],
        origin[0], -origin[1],
        limit[0], limit[1], limit[0] * limit[0], limit[1] * limit[1],
        springx, springy, massx, massy, dampx0, dampy0, dampx1, dampy1,
        float(s["held"]), float(s["shaping"]),
    )  # fmt: skip


def step_inputs(s, b0, b1, uh, before, after):
    """Numbers that a kick takes from clay and operator around its sample.

    Args:
        s: state of the run, for the scenario's numbers.
        b0: clay before the sample, (x, y) [N.s/m].
        b1: clay after the sample, (x, y) [N.s/m].
        uh: muscle force, (x, y) [N].
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].

    Returns:
        12 numbers.
    """
    span = before + after
    L = before / span
    bx0, bx1, by0, by1, stiff, sharex, sharey, softx, softy = clay.split_damping(
        b0, b1, 0.5 * span, L, after / span, s["mobility"], s["handx"][1], s["handy"][1]
    )
    uhx, uhy = uh
    return bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey, softx, softy


def owed_impulse(step, springx, springy, sharex, sharey, hx, hy):
    """Force of stiff clay in this kick that the next kick returns.

    Args:
        step: length of the step after the sample [s].
        springx: of the operator's arm, x [N/m].
        springy: the same, y [N/m].
        sharex: from clay.split_damping [s].
        sharey: from clay.split_damping [s].
        hx: clay.slow_force at the sample, x [N].
        hy: clay.slow_force at the sample, y [N].

    Returns:
        (x, y [N]; reduction per unit of the velocity after the kick, x, y [N.s/m]).
    """
    return sharex * hx, sharey * hy, 0.5 * step * springx * sharex, 0.5 * step * springy * sharey


def yield_in_kick(s, H, L, n, W, d, v, u, c, p):  # noqa: PLR0913  # plain numbers, for speed
    """What clay that yields does in a kick; writes state felt.

    felt holds: mean force (x, y) [N]; velocity and force at the sample (x, y) each, of the motion
    in the kick; whether x and y rest at its end, 1.0 or 0.0; both rest, 1.0 or 0.0; volume removed
    [m^3]; times after the sample at which x and y came to rest [s]; force of springs, which is not
    written here.

    Args:
        s: state of the run.
        H: length of the kick [s].
        L: share of the kick before the sample.
        n: weight of u in the law that gives it, (x, y) [1/s].
        W: acceleration per unit of force, (xx, xy, yy) [1/kg].
        d: resisting force per unit of u, (xx, yy, xy) [N.s/m].
        v: handle velocity before the kick, (x, y) [m/s].
        u: handle velocity after the kick without this force, (x, y) [m/s].
        c: centripetal acceleration, (x, y) [m/s^2].
        p: handle position, (x, y) [m].

    Returns:
        (ux, uy, rx, ry): velocity after the kick [m/s] and mean force [N].
    """
    stuck, felt, grain, turned = s["stuck"], s["felt"], s["grain"], s["turned_clay"]
    place, anchor = p, s["anchor"]
    # a straight step in the joints bends the path of the handle: its mean velocities are these
    back, on = H * L, H * (1.0 - L)
    ax, ay = v[0] + back * c[0], v[1] + back * c[1]
    ex, ey = u[0] - on * c[0], u[1] - on * c[1]
    B = controller.velocity_per_force(n, W, d)
    law = groove_in_kick(s, B, (ax, ay), (ex, ey)) if s["grooved"] else NO_FLOW
    if turned:
        B = turned_matrix(grain[0], grain[1], B)
        ax, ay = controller.along_axes(grain[0], grain[1], ax, ay)
        ex, ey = controller.along_axes(grain[0], grain[1], ex, ey)
        place = controller.along_axes(grain[0], grain[1], p[0], p[1])
    ax, ay = 0.0 if stuck[0] else ax, 0.0 if stuck[1] else ay
    # an axis that rests beside one that slides stays where it came to rest: no step leads away
    backx, backy = 0.0, 0.0
    if on > 0.0 and stuck[0] and anchor[0] == anchor[0]:
        backx = 0.5 * (anchor[0] - place[0]) / on
    if on > 0.0 and stuck[1] and anchor[1] == anchor[1]:
        backy = 0.5 * (anchor[1] - place[1]) / on
    end = ex - backx, ey - backy
    if not s["grooved"]:
        law = law_in_kick(s, L, ax, ay)
    if s["yields"] == 2:
        rx, ry, ux, uy, sx, sy, fx, fy, x, y = flow.resist_along(B, (ax, ay), end, law, L)
    else:
        rx, ry, ux, uy, sx, sy, fx, fy, x, y = flow.resist_axes(B, (ax, ay), end, law, L)
    felt[10], felt[11] = H * (x - L) if x >= 0.0 else 0.0, H * (y - L) if y >= 0.0 else 0.0
    still = ux == 0.0 and uy == 0.0
    felt[6] = 1.0 if ux == 0.0 and law[0] > 0.0 else 0.0
    felt[7] = 1.0 if uy == 0.0 and law[3] > 0.0 else 0.0
    felt[8], felt[9] = 1.0 if still else 0.0, s["removed"][0] + s["removed"][1]
    for i in range(2):
        if still or not stuck[i] or felt[6 + i] == 0.0:
            anchor[i] = math.nan
        elif anchor[i] != anchor[i]:
            anchor[i] = place[i]
    if still:  # the force that does it
        x, y, det = u[0], u[1], B[0] * B[3] - B[1] * B[2]
        if turned:
            x, y = controller.along_axes(grain[0], grain[1], x, y)
        rx, ry = (B[3] * x - B[1] * y) / det, (B[0] * y - B[2] * x) / det
    else:
        ux, uy = ux + backx, uy + backy
    if turned:
        rx, ry = controller.along_axes(grain[0], -grain[1], rx, ry)
        ux, uy = controller.along_axes(grain[0], -grain[1], ux, uy)
        sx, sy = controller.along_axes(grain[0], -grain[1], sx, sy)
        fx, fy = controller.along_axes(grain[0], -grain[1], fx, fy)
    if not still:
        ux, uy = ux + on * c[0], uy + on * c[1]
    felt[0], felt[1], felt[2], felt[3], felt[4], felt[5] = rx, ry, sx, sy, fx, fy
    return ux, uy, rx, ry


def spring_force(s, L):
    """Force of the clay's springs in a kick, (x, y) [N].

    Args:
        s: state of the run.
        L: share of the kick before the sample.
    """
    sprung = s["sprung"]
    return (
        L * sprung[2] + (1.0 - L) * sprung[0],
        L * sprung[3] + (1.0 - L) * sprung[1],
    )


def is_one_flow(s):
    """Whether clay yields alike before and after the sample.

    Args:
        s: state of the run.
    """
    for j in range(6):
        if s["flow"][j] != s["flow_old"][j]:
            return False
    return True


def law_in_kick(s, L, vx, vy):
    """Fy, K, n of x and y in a kick. Half a step of other clay before it counts as steady force.

    Args:
        s: state of the run.
        L: share of the kick before the sample.
        vx: mean velocity of the step before, x [m/s].
        vy: the same, y [m/s].

    Returns:
        6 numbers.
    """
    a, b = s["flow"], s["flow_old"]
    if is_one_flow(s):
        return a[0], a[1], a[2], a[3], a[4], a[5]
    R = 1.0 - L
    x, y = abs(vx), abs(vy)
    if s["yields"] == 2:
        x = y = math.sqrt(vx * vx + vy * vy)
    x, y = flow.moving_force(b[0], b[1], b[2], x), flow.moving_force(b[3], b[4], b[5], y)
    return L * x + R * a[0], R * a[1], a[2], L * y + R * a[3], R * a[4], a[5]


def groove_in_kick(s, B, v, u):
    """As `law_in_kick`, of clay that stays cut: what the tool meets on its way.

    Args:
        s: state of the run.
        B: velocity lost in the kick per unit of force, (xx, xy, yx, yy) [m/(N.s)].
        v: velocity at the begin, (x, y) [m/s].
        u: velocity at the end without this force, (x, y) [m/s].

    Returns:
        6 numbers.
    """
    x, y = v
    if s["stuck"][0] and s["stuck"][1] or (x == 0.0 and y == 0.0):  # where it is pushed
        xx, xy, yx, yy = B
        x, y = yy * u[0] - xy * u[1], xx * u[1] - yx * u[0]
    return groove_law(s, x, y)


def groove_law(s, x, y):
    """Fy, K, n of x and y of clay that stays cut, in a direction.

    Args:
        s: state of the run.
        x: direction, x, of any length.
        y: the same, y.

    Returns:
        6 numbers.
    """
    Fy, _ = groove.resistance(s["rim"], x, y)
    return Fy, 0.0, 1.0, Fy, 0.0, 1.0


def not_against(s, vx, vy, fx, fy):
    """Velocity at a sample, 0.0 where it is against the yield force: the clay holds the handle.

    In stiff clay the velocity is what its damping feels, and may be.

    Args:
        s: state of the run.
        vx: velocity, x [m/s].
        vy: the same, y [m/s].
        fx: force of yielding, x [N].
        fy: the same, y [N].

    Returns:
        (x, y) [m/s].
    """
    px, py = vx * fx, vy * fy
    if s["yields"] == 2:
        px = py = px + py
    return 0.0 if px < 0.0 else vx, 0.0 if py < 0.0 else vy


def creeping_force(s, L, g, b, v):
    """The part of a slow force on stiff clay that its damping bears: what yielding leaves of it.

    Args:
        s: state of the run.
        L: share of the kick before the sample.
        g: from clay.slow_force, (x, y) [N].
        b: damping in the kick, (x, y) [N.s/m].
        v: handle velocity before the kick, (x, y) [m/s].

    Returns:
        (x, y) [N].
    """
    Fyx, Kx, nx, Fyy, Ky, ny = law_in_kick(s, L, v[0], v[1])
    bx, by = b
    gx, gy = abs(g[0]), abs(g[1])
    if s["yields"] == 2:
        gx = gy = math.sqrt(gx * gx + gy * gy)
        bx = by = 0.5 * (bx + by)
    x, y = 0.0, 0.0
    if gx > Fyx and bx > 0.0:  # of what exceeds Fy, b v where b v + K v^n is all of it
        x = g[0] / gx * bx * flow.thinned((gx - Fyx) / bx, Kx / bx, nx)
    if gy > Fyy and by > 0.0:
        y = g[1] / gy * by * flow.thinned((gy - Fyy) / by, Ky / by, ny)
    return x, y


def turned_matrix(c, s, B):
    """A matrix along axes that are turned, R' B R.

    Args:
        c: cosine of the angle by which they are turned.
        s: sine of that angle.
        B: (xx, xy, yx, yy).

    Returns:
        The same four along those axes.
    """
    xx, yx = controller.along_axes(c, s, B[0], B[2])
    xy, yy = controller.along_axes(c, s, B[1], B[3])
    first, second = controller.along_axes(c, s, xx, xy), controller.along_axes(c, s, yx, yy)
    return first[0], first[1], second[0], second[1]


def turned_rest(grain, k, v0x, v0y, v1x, v1y):  # noqa: PLR0913  # plain numbers, for speed
    """What the force of turned clay in a kick is beside that of dampers along x and y.

    Args:
        grain: cosine and sine of the angle by which it is turned.
        k: the first numbers of `step_inputs`, of its own axes.
        v0x: handle velocity before the kick, x [m/s].
        v0y: the same, y [m/s].
        v1x: handle velocity after the kick, x [m/s].
        v1y: the same, y [m/s].

    Returns:
        (x, y) [N].
    """
    fex, fey = clay.turned_force(grain[0], grain[1], k[0], k[2], v0x, v0y)
    x, y = clay.turned_force(grain[0], grain[1], k[1], k[3], v1x, v1y)
    return fex + x - (k[0] * v0x + k[1] * v1x), fey + y - (k[2] * v0y + k[3] * v1y)


def velocity_at_sample(k, i, before, after, rest):
    """Velocity of one coordinate at a sample.

    Args:
        k: from `step_inputs`.
        i: coordinate, 0 for x, 1 for y.
        before: velocity before the sample [m/s].
        after: velocity after the sample [m/s].
        rest: clay force beside its dampers [N].

    Returns:
        The velocity [m/s].
    """
    if k[
        10 + i
    ]:  # what the clay feels: stiff clay leaves nothing else of the velocities around the sample
        v = k[10 + i] * (k[2 * i] * before + k[2 * i + 1] * after + rest)
    else:
        v = before + k[4] * (after - before)
    return v


def whole_kick(s, w1, w2, n1, n2, t1, t2, step):
    """Command that gives the engine the rates after a kick in one step of another length.

    Args:
        s: state of the run, for the scenario's numbers.
        w1: rate of joint 1 before [rad/s].
        w2: rate of joint 2 before [rad/s].
        n1: rate of joint 1 after [rad/s].
        n2: rate of joint 2 after [rad/s].
        t1: torque of the shoulder motor [N.m].
        t2: torque of the elbow motor [N.m].
        step: length of the step [s].

    Returns:
        The command, as `leapfrog.kicks` leaves it, without implicit clay.
    """
    I1, I2 = s["arm"][2], s["arm"][3]
    a1, a2 = (n1 - w1) / step, (n1 + n2 - w1 - w2) / step
    return t1, t2, 0.0, 0.0, I1 * a1 + I2 * a2 - t1, I2 * a2 - t2
