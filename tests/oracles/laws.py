"""Kicks put together from the laws of the model, beside the loops that spell them out."""

import math

from hapticclay.model import arm, controller


def servo_kick(H, v, u, links, n, a, W, f, d, limit=(math.inf, math.inf)):  # noqa: PLR0913  # of the law
    """The kick that the servo asks for, within the torque limits; all as in controller.

    Returns (ux, uy, g1, g2, ffx, ffy, t1, t2) as controller.kick_at_limit does.
    """
    ux, uy = controller.solve_velocity(n, a, W, f, d)
    ff = f[0] - d[0] * ux, f[1] - d[1] * uy
    g1, g2 = arm.joint_velocity(ux - v[0], uy - v[1], u, H)
    p1, p2 = arm.joint_torques(*ff, u)
    I1, I2 = links[2:4]
    t2 = I2 * g2 - p2
    t1 = I1 * g1 + I2 * g2 - p1
    if abs(t1) > limit[0] or abs(t2) > limit[1]:
        return controller.kick_at_limit(H, v, u, links, f, d, (t1, t2), limit)
    return ux, uy, g1, g2, *ff, t1, t2
