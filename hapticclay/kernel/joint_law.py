"""The law of a host that drives the joints of an arm: proportional, derivative, and what it feeds.

It also renders clay: its force at the handle, by J'.
"""

import math

from ..formulas import arm as arm_law
from ..formulas import hardware as law
from . import arm, hardware, joints, laws

EXACT, DIFFERENCE, FILTER = range(3)  # how a rate is had


def respond(m, s, k):
    """Torques for a sample, whose measured angles and rates are in the state."""
    measure_rates(m, s)
    q, w, tau = s.angles, s.rates, k.tau
    for i in range(m.joints):
        Fc, slope, Fv = m.fed_friction[3 * i], m.fed_friction[3 * i + 1], m.fed_friction[3 * i + 2]
        tau[i] = m.gains[i] * (m.reference[i] - q[i]) - m.rate_gains[i] * w[i]
        tau[i] += Fc * math.tanh(slope * w[i]) + Fv * w[i]
    if m.feeds_gravity or (m.renders and m.general):
        see_pose(m, s)
    if m.feeds_gravity:
        feed_gravity(m, k)
    if m.renders:
        render(m, s, k)
    hardware.drive(m, s, tau)


def measure_rates(m, s):
    """Rates as the law has them, into the state."""
    q, w = s.angles, s.rates
    for i in range(m.joints):
        if m.rate != EXACT:
            now, step = s.now, q[i] - s.now.past[i]
            if m.rate == DIFFERENCE:
                w[i] = step / m.Ts
            else:
                w[i] = (now.w[i] + m.rate_cutoff * step) / (1.0 + m.rate_cutoff * m.Ts)
        s.next.w[i], s.next.past[i] = w[i], q[i]  # the filter's own rate
        w[i] = law.quantize(w[i], m.rate_bits, m.rate_range)


def see_pose(m, s):
    """The arm at the measured angles: place, Jacobian of the handle, torques that hold the arm."""
    e, n = m.engine, m.joints
    if m.computed:
        for i in range(n):
            e.pose[i] = s.angles[i]
        e.pose[2 * n] += 1.0
        e.at_scratch(e.pose)
        return
    for i in range(n):
        e.scratch_q[m.dof[i]] = s.angles[i]
    e.kinematics(e.model, e.scratch)
    e.com_pos(e.model, e.scratch)
    e.jacobian(e.model, e.scratch, e.J, e.none, e.site)
    joints.gather(m, e.J, e.scratch_J)
    if m.feeds_gravity:
        e.com_vel(e.model, e.scratch)
        e.bias(e.model, e.scratch, 0, e.scratch_forces)
        for i in range(n):
            e.scratch_bias[i] = e.scratch_forces[m.dof[i]]


def hold_weight(m, s):
    """Lets the motors hold arm and hand against gravity from the start on."""
    for i in range(m.joints):
        s.angles[i], s.k.tau[i] = hardware.encoded(m, i, s.q[i]), 0.0
    see_pose(m, s)
    feed_gravity(m, s.k)
    for i in range(m.joints):
        s.now.tau[i] = hardware.given(m, i, s.k.tau[i])


def feed_gravity(m, k):
    """Adds the torques that hold arm and hand against gravity."""
    e, n = m.engine, m.joints
    for i in range(n):
        k.tau[i] += e.scratch_bias[i]
        for j in range(m.axes):
            k.tau[i] -= e.scratch_J[j * n + i] * m.weight[j]


def render(m, s, k):
    """Adds the force of the clay at the handle as measured."""
    e, after, n = m.engine, s.next, m.joints
    if m.general:
        joints.place(m, k, e.scratch_handle)
        joints.handle_velocity(m, k, e.scratch_J, s.rates)
    else:
        arm.handle_at(m, k, s.angles[0], s.angles[1], s.rates[0], s.rates[0] + s.rates[1])
    fx, fy = laws.force_for_controller(m, s, k)
    if m.general:
        for i in range(n):
            k.tau[i] -= e.scratch_J[i] * fx + e.scratch_J[n + i] * fy
    else:
        a1, a2 = arm_law.joint_torques(fx, fy, k.u)
        k.tau[0], k.tau[1] = k.tau[0] - a1, k.tau[1] - a2
    after.x.force, after.y.force = fx, fy
