"""What a kick of the loop is made of, by any method that steps as a leapfrog.

The loop is stepped as a leapfrog: angles at the samples t(k), rates halfway between them, so that a
plain step of the engine (rates first, then angles with the new rates) is of second order. A kick
carries the rates across sample k; it lasts from the middle of the step before the sample to the
middle of the step after it. Either step may be short, to end on a border of the clay. Derivation
and error terms: docs/equations.md, section 4.
"""

from __future__ import annotations

from ..model import arm, clay, controller, operator
from ..model.constants import C_POLE, G, S

SXX, SYY = S[0].gain, S[1].gain  # inverse inertia that shaping imposes [1/kg]


def initial_state(p: tuple[float, float], v: tuple[float, float]) -> tuple[float, ...]:
    """State of a loop whose handle has moved evenly for long, as of `leapfrog.kicks`.

    The compensator leads by the lag of G at constant speed.

    Args:
        p: handle position, (x, y) [m].
        v: handle velocity, (x, y) [m/s].

    Returns:
        12 numbers.
    """
    ahead = (p[i] + G[i].damping / G[i].stiffness * v[i] for i in (0, 1))
    return (*ahead, *v, *p, *v, 0.0, 0.0, 0.0, 0.0)


def loop_coefficients(s, before, after):
    """Numbers that a kick takes from the scenario and from the steps around its sample.

    Args:
        s: state of the run, for the scenario's numbers.
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
    # at start and end the kick is half of one
    step = H if before > 0.0 and after > 0.0 else max(before, after)
    spring, mass, damp0, damp1 = operator.operator_coefficients(s["hand"], H, L, R, step)
    gain, origin, limit = s["gain"], s["origin"], s["torque_limit"]
    return (
        H, after, 0.5 * before, keepx, takex, nx, mx, kpx, keepy, takey, ny, my, kpy,
        keep, take * gain[0], take * gain[1], origin[0], -origin[1],
        limit[0], limit[1], limit[0] * limit[0], limit[1] * limit[1],
        spring, mass, damp0, damp1, float(s["held"]), float(s["shaping"]),
    )  # fmt: skip


def step_inputs(b0, b1, uh, before, after, hand):
    """Numbers that a kick takes from clay and operator around its sample.

    Args:
        b0: clay before the sample, (x, y) [N.s/m].
        b1: clay after the sample, (x, y) [N.s/m].
        uh: muscle force, (x, y) [N].
        before: length of the step before the sample [s].
        after: length of the step after the sample [s].
        hand: mass [kg], damper [N.s/m] and spring [N/m] of the operator's arm; zeros for none.

    Returns:
        12 numbers.
    """
    span = before + after
    L = before / span
    W = arm.TRACE_W / (1.0 + hand[0] * arm.TRACE_W)
    bx0, bx1, by0, by1, stiff, sharex, sharey, softx, softy = clay.split_damping(
        b0, b1, 0.5 * span, L, after / span, W, hand[1]
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
        The command, as `leapfrog.kicks` leaves it, without implicit clay.
    """
    a1, a2 = (n1 - w1) / step, (n1 + n2 - w1 - w2) / step
    return t1, t2, 0.0, 0.0, arm.I1 * a1 + arm.I2 * a2 - t1, arm.I2 * a2 - t2
