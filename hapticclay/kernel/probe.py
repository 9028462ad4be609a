"""Numbers of some formulas, by which compiled code is compared with CPython before it is used."""

from ..formulas import arm, damping, flow, numbers, spring

SIZE = 27


def fill(links, out):
    """Computes SIZE numbers, in which a rounding of its own or another order shows."""
    out[0], out[1], out[2], out[3] = arm.jacobian(0.3, 1.1, links)
    out[4], out[5], out[6] = arm.mobility(out, links)
    out[7], out[8] = arm.inverse_kinematics(0.31, 0.17, links)
    out[9], out[10], out[11], out[12], out[13], out[14], out[15], out[16], out[17] = (
        damping.split_damping((90.0, 1e5), (30.0, 10.0), 2.5e-4, 0.3, 0.7, 1.7, 0.1, 0.3)
    )
    out[18], out[19] = flow.motion_force((0.5, 0.25, 0.4, 1.0, 0.4, 0.7), True, 0.013, -0.007)
    out[20], out[21], out[22], out[23] = spring.relaxing_step(2e3, 0.1, 1.0, 1e-4, 3e-6, 2.5e-4)
    out[24], out[25], out[26] = numbers.nearest(-0.4), numbers.nearest(2.5), numbers.nearest(1e300)
