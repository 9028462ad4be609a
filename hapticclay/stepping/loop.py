"""What a kick of the loop is made of, by any method that steps as a leapfrog.

The loop is stepped as a leapfrog: angles at the samples t(k), rates halfway between them, so that a
plain step of the engine (rates first, then angles with the new rates) is of second order. A kick
carries the rates across sample k; it lasts from the middle of the step before the sample to the
middle of the step after it. Either step may be short, to end on a border of the clay. Derivation
and error terms: docs/equations.md, section 4.
"""

from __future__ import annotations

from ..model import clay, controller, operator
from ..model.controller import Servo


def initial_state(
    p: tuple[float, float], v: tuple[float, float], servo: tuple[Servo, Servo]
) -> tuple[float, ...]:
    """State of a loop whose handle has moved evenly for long, as of `leapfrog.kicks`.

    The compensator leads by the lag of G at constant speed.

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
