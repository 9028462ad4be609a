"""One step of the closed loop: measure -> clay -> operator -> compensator -> servo -> engine.

The loop is stepped as a leapfrog: angles at the samples t(k), rates halfway between them, so that a
plain step of the engine (rates first, then angles with the new rates) is of second order. A kick
carries the rates across sample k; it lasts from the middle of the step before the sample to the
middle of the step after it. Either step may be short, to end on a border of the clay. Derivation
and error terms: docs/equations.md, section 4.
"""

# pyright: reportPossiblyUnboundVariable=false
# Names for stiff clay alone are bound and read under the same `if stiff`, for speed.
from __future__ import annotations

from ..model import arm, clay, controller, operator
from ..model.constants import C_POLE, G, S
from ..model.operator import NO_HAND
from ..model.scenario import Scenario

SXX, SYY = S[0].gain, S[1].gain  # inverse inertia that shaping imposes [1/kg]


def initial_state(p: tuple[float, float], v: tuple[float, float]) -> tuple[float, ...]:
    """State of a loop whose handle has moved with a constant velocity for long; see `step_loop`.

    The compensator leads by the lag of G at constant speed.

    Args:
        p: handle position, (x, y) [m].
        v: handle velocity, (x, y) [m/s].

    Returns:
        12 numbers.
    """
    ahead = (p[i] + G[i].damping / G[i].stiffness * v[i] for i in (0, 1))
    return (*ahead, *v, *p, *v, 0.0, 0.0, 0.0, 0.0)


def loop_coefficients(scenario: Scenario, before: float, after: float) -> tuple[float, ...]:
    """Numbers that `step_loop` takes from the scenario and from the steps around its sample.

    Args:
        scenario: the scenario, or its fields in numbers.
        before: length of the step before the sample [s]; 0 at the start.
        after: length of the step after the sample [s]; 0 at the end.

    Returns:
        28 numbers.
    """
    H = 0.5 * (before + after)
    L, R = before / (before + after), after / (before + after)
    keepx, takex, nx, mx, kpx = controller.servo_coefficients(G[0], S[0], H, L, R)
    keepy, takey, ny, my, kpy = controller.servo_coefficients(G[1], S[1], H, L, R)
    keep, take = controller.compensator_coefficients(C_POLE, H, L, R)
    step = (
        H if before > 0.0 and after > 0.0 else max(before, after)
    )  # at start and end the kick is half of one
    spring, mass, behind, ahead = operator.operator_coefficients(scenario.operator, H, L, R, step)
    limit1, limit2 = scenario.torque_limit
    held = 1.0 if scenario.operator is not None else 0.0
    shaped = 1.0 if scenario.shaping else 0.0
    return (
        H, after, 0.5 * before, keepx, takex, nx, mx, kpx, keepy, takey, ny, my, kpy,
        keep, take * scenario.gain[0], take * scenario.gain[1],
        scenario.origin[0], -scenario.origin[1],
        limit1, limit2, limit1 * limit1, limit2 * limit2, spring, mass, behind, ahead, held, shaped,
    )  # fmt: skip


def step_inputs(b0, b1, uh, before, after, hand):
    """Numbers that `step_loop` takes from clay and operator around its sample.

    Args:
        b0: clay before the sample, (x, y) [N.s/m].
        b1: clay after the sample, (x, y) [N.s/m].
        uh: muscle force, (x, y) [N].
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].
        hand: the operator's arm; zeros for none.

    Returns:
        12 numbers.
    """
    span = before + after
    L = before / span
    W = arm.TRACE_W / (1.0 + hand.mass * arm.TRACE_W)
    bx0, bx1, by0, by1, stiff, sharex, sharey, softx, softy = clay.split_damping(
        b0, b1, 0.5 * span, L, after / span, W, hand.damper
    )
    uhx, uhy = uh
    return bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey, softx, softy


def owed_impulse(step, H, spring, sharex, sharey, hx, hy):
    """Force of stiff clay in this kick that the next kick returns.

    Args:
        step: length of the step after the sample [s].
        H: length of the kick [s].
        spring: of the operator's arm [N/m].
        sharex: from clay.split_damping [s].
        sharey: from clay.split_damping [s].
        hx: clay.slow_force at the sample, x [N].
        hy: clay.slow_force at the sample, y [N].

    Returns:
        (x, y [N]; reduction per unit of the velocity after the kick, x, y [N.s/m]).
    """
    return sharex * hx, sharey * hy, 0.5 * step * spring * sharex, 0.5 * step * spring * sharey


def measure_handle(q1, q2, w1, w2, d1, d2, ox, noy):
    """Kinematics of the handle.

    Args:
        q1: angle of link 1 [rad].
        q2: angle of link 2 against link 1 [rad].
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].
        d1: change of the rate of link 1 since, for the centripetal acceleration alone [rad/s].
        d2: change of the absolute rate of link 2 since, likewise [rad/s].
        ox: origin of p, x [m].
        noy: origin of p, -y [m].

    Returns:
        (u, p, r2, v, c): arm.jacobian and position [m], absolute rate of link 2 [rad/s], velocity
        [m/s], centripetal acceleration c = -J' q' [m/s^2].
    """
    u1x, u1y, u2x, u2y = arm.jacobian(q1, q2)
    px = u1y + u2y - ox
    py = noy - u1x - u2x
    r2 = w1 + w2
    vx, vy = arm.handle_velocity(w1, r2, (u1x, u1y, u2x, u2y))
    cx, cy = arm.centripetal(w1 + d1, r2 + d2, (u1x, u1y, u2x, u2y))
    return (u1x, u1y, u2x, u2y), (px, py), r2, (vx, vy), (cx, cy)


def step_loop(c, k, q1, q2, w1, w2, state):
    """Carries the loop across one sample.

    Args:
        c: from `loop_coefficients`.
        k: from `step_inputs`.
        q1: angle of joint 1 at the sample [rad].
        q2: angle of joint 2 at the sample [rad].
        w1: rate of joint 1 half a step before the sample [rad/s].
        w2: rate of joint 2 half a step before the sample [rad/s].
        state: (deltax, deltay [m], deltax', deltay' [m/s], yx, yy [m], yx', yy' [m/s], g1, g2
            [rad/s^2], owedx, owedy [N.s]): compensator output and rate, reference model y = G delta
            and its rate, link accelerations, impulse owed by stiff clay; positions at the sample,
            rates half a step before it.

    Returns:
        (state, command, sample, after):
        state: for the next sample.
        command: (tau1, tau2 of the motors [N.m], implicit clay bx, by [N.s/m], further torques 1, 2
            [N.m]).
        sample: (position x, y [m], velocity half a step before [m/s], net hand force f of the kick
            [N], delta [m], clay force beside its dampers [N]), x and y each.
        after: (ux, uy [m/s], joint rates 1, 2 [rad/s]) half a step after the sample.
    """
    (
        H, step, half, keepx, takex, nx, mx, kpx, keepy, takey, ny, my, kpy, keep, gainx, gainy,
        ox, noy, limit1, limit2, square1, square2, spring, mass, before, behind, held, shaped,
    ) = c  # fmt: skip
    bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey, _, _ = k
    deltax, deltay, ex, ey, yx, yy, ydx, ydy, g1, g2, owedx, owedy = state

    (u1x, u1y, u2x, u2y), (px, py), r2, (vx, vy), (cx, cy) = measure_handle(
        q1, q2, w1, w2, half * g1, half * g2, ox, noy
    )
    if stiff:  # after the sample the handle stands still on the axes on which the clay is stiff
        cx, cy = arm.centripetal_about_sample(
            L, cx, cy, 0.0 if sharex else vx, 0.0 if sharey else vy, (u1x, u1y, u2x, u2y)
        )
    if shaped:
        sxx, sxy, syy = SXX, 0.0, SYY
    else:
        sxx, sxy, syy = arm.mobility((u1x, u1y, u2x, u2y))

    # clay and operator: net force f = (fx - dx ux, fy - dy uy)
    fx = uhx - bx0 * vx
    fy = uhy - by0 * vy
    dx, dy = bx1, by1
    if held:
        fx -= operator.operator_force(spring, mass, before, px, cx, vx)
        fy -= operator.operator_force(spring, mass, before, py, cy, vy)
        dx += behind
        dy += behind

    # servo: one kick of the reference model, then of the handle
    vrx = keepx * ydx + takex * (deltax - yx)
    vry = keepy * ydy + takey * (deltay - yy)
    ax = controller.servo_acceleration(nx, mx, kpx, vrx, ydx, vx, yx, px, cx)
    ay = controller.servo_acceleration(ny, my, kpy, vry, ydy, vy, yy, py, cy)
    restx, resty = 0.0, 0.0
    if stiff:
        restx, resty = owedx / H, owedy / H
        fex, fey = (bx0 + bx1) * vx, (by0 + by1) * vy
        hx, hy = uhx - spring * px, uhy - spring * py
        gx = ax - mx * vx + sxx * hx + sxy * hy
        gy = ay - my * vy + sxy * hx + syy * hy
        gx, gy = clay.slow_force(gx, gy, sxx, sxy, syy, sharex, sharey, fex, fey)
        owedx, owedy, softx, softy = owed_impulse(step, H, spring, sharex, sharey, gx, gy)
        fx += owedx - restx
        fy += owedy - resty
        dx += softx
        dy += softy
    ux, uy, g1, g2, ffx, ffy, t1, t2 = controller.saturated_step(
        H, (vx, vy), (u1x, u1y, u2x, u2y), (nx, ny), (ax, ay), (sxx, sxy, syy), (fx, fy), (dx, dy),
        (limit1, limit2, square1, square2),
    )  # fmt: skip
    if stiff:
        # motors at their limits hold less against the clay
        if t1 * t1 >= square1 or t2 * t2 >= square2:
            gx, gy = arm.handle_acceleration(
                (t1 - t2) / arm.I1, t2 / arm.I2, hx, hy, (u1x, u1y, u2x, u2y)
            )
            sxx, sxy, syy = arm.mobility((u1x, u1y, u2x, u2y))
            gx, gy = clay.slow_force(gx, gy, sxx, sxy, syy, sharex, sharey, fex, fey)
            fx -= owedx
            fy -= owedy
            owedx, owedy, _, _ = owed_impulse(step, H, spring, sharex, sharey, gx, gy)
            fx += owedx
            fy += owedy
            ux, uy = controller.velocity_under_torque(
                H, (vx, vy), (u1x, u1y, u2x, u2y), (t1, t2), (fx, fy), (dx, dy)
            )
            ffx = fx - dx * ux
            ffy = fy - dy * uy
            g1, g2 = arm.joint_velocity(ux - vx, uy - vy, (u1x, u1y, u2x, u2y), H)
        owedx -= softx * ux
        owedy -= softy * uy
        restx -= owedx
        resty -= owedy
        fx -= softx * ux
        fy -= softy * uy
        owedx *= H
        owedy *= H

    # compensator, driven by the force that acts in this kick
    ex = keep * ex + gainx * ffx
    ey = keep * ey + gainy * ffy

    # to the engine goes what it does not treat implicitly: the hand, and the clay's first part
    if held:
        fx -= behind * ux
        fy -= behind * uy
    p1, p2 = arm.joint_torques(fx, fy, (u1x, u1y, u2x, u2y))
    return (
        (
            deltax + step * ex, deltay + step * ey, ex, ey,
            yx + step * vrx, yy + step * vry, vrx, vry, g1, g2, owedx, owedy,
        ),
        (t1, t2, bx1, by1, p1, p2),
        (px, py, vx, vy, ffx, ffy, deltax, deltay, restx, resty),
        (ux, uy, w1 + H * g1, w2 + H * (g2 - g1)),
    )  # fmt: skip


def ode_parameters(scenario: Scenario) -> tuple[float, ...]:
    """Numbers that `vector_field` takes from the scenario.

    Args:
        scenario: the scenario.

    Returns:
        12 numbers.
    """
    th = scenario.operator or NO_HAND
    return (
        *scenario.gain, scenario.origin[0], -scenario.origin[1],
        *scenario.torque_limit, *(limit * limit for limit in scenario.torque_limit),
        th.spring, th.mass, th.damper, 1.0 if scenario.shaping else 0.0,
    )  # fmt: skip


def vector_field(c, bx, by, uhx, uhy, q1, q2, w1, w2, state):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """The same loop as a differential equation, at one instant.

    Args:
        c: from `ode_parameters`.
        bx: clay, x [N.s/m].
        by: clay, y [N.s/m].
        uhx: muscle force, x [N].
        uhy: muscle force, y [N].
        q1: angle of joint 1 [rad].
        q2: angle of joint 2 [rad].
        w1: rate of joint 1 [rad/s].
        w2: rate of joint 2 [rad/s].
        state: (deltax, deltay, deltax', deltay', yx, yy, yx', yy') as in `step_loop`, at this
            instant.

    Returns:
        (command, rates, sample):
        command: (tau1, tau2, torques of the hand 1, 2) [N.m].
        rates: derivative of state, and power of muscle, motors, clay, damper of the hand,
            throughput [W].
        sample: (position x, y [m], velocity x, y [m/s], fh x, y [N]).
    """
    (
        gainx, gainy, ox, noy, limit1, limit2, square1, square2, spring, mass, damper, shaped,
    ) = c  # fmt: skip
    deltax, deltay, ex, ey, yx, yy, ydx, ydy = state
    (u1x, u1y, u2x, u2y), (px, py), _, (vx, vy), (cx, cy) = measure_handle(
        q1, q2, w1, w2, 0.0, 0.0, ox, noy
    )
    if shaped:
        sxx, sxy, syy = SXX, 0.0, SYY
    else:
        sxx, sxy, syy = arm.mobility((u1x, u1y, u2x, u2y))
    hx, hy = uhx, uhy
    hx -= operator.operator_force(spring, mass, damper, px, cx, vx)
    hy -= operator.operator_force(spring, mass, damper, py, cy, vy)
    fex, fey = clay.viscous_force(bx, by, vx, vy)
    ax, y2x = controller.feedback_law(G[0], S[0], deltax, yx, ydx, px, vx, cx)
    ay, y2y = controller.feedback_law(G[1], S[1], deltay, yy, ydy, py, vy, cy)
    _, _, _, _, ffx, ffy, t1, t2 = controller.saturated_step(
        1.0, (0.0, 0.0), (u1x, u1y, u2x, u2y), (1.0, 1.0), (ax, ay), (sxx, sxy, syy),
        (hx - fex, hy - fey), (mass, mass), (limit1, limit2, square1, square2),
    )  # fmt: skip
    hx = ffx + fex
    hy = ffy + fey
    p1, p2 = arm.joint_torques(hx, hy, (u1x, u1y, u2x, u2y))
    muscle = uhx * vx + uhy * vy
    motors = t1 * w1 + t2 * w2
    clay_power = fex * vx + fey * vy
    hand = damper * (vx * vx + vy * vy)
    return (
        (t1, t2, p1, p2),
        (
            ex, ey, gainx * ffx - C_POLE * ex, gainy * ffy - C_POLE * ey, ydx, ydy, y2x, y2y,
            muscle, motors, clay_power, hand, abs(muscle) + abs(motors),
        ),
        (px, py, vx, vy, hx, hy),
    )  # fmt: skip


def plant_coefficients(scenario: Scenario, before: float, after: float) -> tuple[float, ...]:
    """Numbers that `step_plant` takes from the scenario and from the steps around its kick.

    Args:
        scenario: the scenario.
        before: length of the step before the kick's sample [s].
        after: length of the step after it [s].

    Returns:
        8 numbers.
    """
    H, span = 0.5 * (before + after), before + after
    return (
        H, after, scenario.origin[0], -scenario.origin[1],
        *operator.operator_coefficients(
            scenario.operator, H, before / span, after / span, max(before, after)
        ),
    )  # fmt: skip


def step_plant(c, k, q1, q2, w1, w2, t1, t2, owedx, owedy):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """One kick of the arm and the operator alone, under given motor torques.

    Args:
        c: from `plant_coefficients`.
        k: from `step_inputs`.
        q1: angle of joint 1 [rad].
        q2: angle of joint 2 [rad].
        w1: rate of joint 1 before the kick [rad/s].
        w2: rate of joint 2 before the kick [rad/s].
        t1: torque of the shoulder motor [N.m].
        t2: torque of the elbow motor [N.m].
        owedx: impulse that stiff clay owes from the step before, x [N.s].
        owedy: the same, y [N.s].

    Returns:
        (sample, after, owed):
        sample: (position x, y [m], velocity before x, y [m/s], net hand force x, y [N], clay force
            beside its dampers x, y [N]).
        after: (ux, uy [m/s], joint rates 1, 2 [rad/s]) after the kick.
        owed: impulse that the clay owes after the kick, x, y [N.s].
    """
    H, step, ox, noy, spring, mass, before, behind = c
    bx0, bx1, by0, by1, L, uhx, uhy, stiff, sharex, sharey, _, _ = k
    (u1x, u1y, u2x, u2y), (px, py), _, (vx, vy), (cx, cy) = measure_handle(
        q1, q2, w1, w2, 0.0, 0.0, ox, noy
    )
    if stiff:  # after the sample the handle stands still on the axes on which the clay is stiff
        cx, cy = arm.centripetal_about_sample(
            L, cx, cy, 0.0 if sharex else vx, 0.0 if sharey else vy, (u1x, u1y, u2x, u2y)
        )
    fx = uhx - bx0 * vx - operator.operator_force(spring, mass, before, px, cx, vx)
    fy = uhy - by0 * vy - operator.operator_force(spring, mass, before, py, cy, vy)
    dx, dy = bx1 + behind, by1 + behind
    restx, resty = 0.0, 0.0
    if stiff:
        restx, resty = owedx / H, owedy / H
        a1, a2 = (t1 - t2) / arm.I1, t2 / arm.I2
        hx, hy = uhx - spring * px, uhy - spring * py
        hx, hy = arm.handle_acceleration(a1, a2, hx, hy, (u1x, u1y, u2x, u2y))
        sxx, sxy, syy = arm.mobility((u1x, u1y, u2x, u2y))
        hx, hy = clay.slow_force(
            hx, hy, sxx, sxy, syy, sharex, sharey, (bx0 + bx1) * vx, (by0 + by1) * vy
        )
        owedx, owedy, softx, softy = owed_impulse(step, H, spring, sharex, sharey, hx, hy)
        fx += owedx - restx
        fy += owedy - resty
        dx += softx
        dy += softy
    ux, uy = controller.velocity_under_torque(
        H, (vx, vy), (u1x, u1y, u2x, u2y), (t1, t2), (fx, fy), (dx, dy)
    )
    if stiff:
        owedx -= softx * ux
        owedy -= softy * uy
        restx -= owedx
        resty -= owedy
    g1, g2 = arm.joint_velocity((ux - vx) / H, (uy - vy) / H, (u1x, u1y, u2x, u2y), 1.0)
    return (
        (px, py, vx, vy, fx - dx * ux, fy - dy * uy, restx, resty),
        (ux, uy, w1 + H * g1, w2 + H * (g2 - g1)),
        (H * owedx, H * owedy),
    )


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


def whole_kick(w1, w2, n1, n2, t1, t2, step):
    """Command that gives the engine the rates after a kick in one step of another length.

    Args:
        w1: rate of joint 1 before [rad/s].
        w2: rate of joint 2 before [rad/s].
        n1: rate of joint 1 after [rad/s].
        n2: rate of joint 2 after [rad/s].
        t1: torque of the shoulder motor [N.m].
        t2: torque of the elbow motor [N.m].
        step: length of the step [s].

    Returns:
        The command, as `step_loop` returns it, without implicit clay.
    """
    a1, a2 = (n1 - w1) / step, (n1 + n2 - w1 - w2) / step
    return t1, t2, 0.0, 0.0, arm.I1 * a1 + arm.I2 * a2 - t1, arm.I2 * a2 - t2
