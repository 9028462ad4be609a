"""The law of a host that drives the joints of an arm: proportional, derivative, and what it feeds.

It also renders clay: its force at the handle, by J'.
"""

import math

from ..formulas import hardware as law
from . import hardware, joints, laws

EXACT, DIFFERENCE, FILTER = range(3)  # how a rate is had


def respond(m, s, k):
    """Torques for a sample, whose measured angles and rates are in the state."""
    measure_rates(m, s)
    q, w, tau = s.angles, s.rates, k.tau
    for i in range(m.joints):
        Fc, slope, Fv = m.fed_friction[3 * i], m.fed_friction[3 * i + 1], m.fed_friction[3 * i + 2]
        tau[i] = m.gains[i] * (m.reference[i] - q[i]) - m.rate_gains[i] * w[i]
        tau[i] += Fc * math.tanh(slope * w[i]) + Fv * w[i]
    if m.feeds_gravity or m.renders:
        see_pose(m, s, m.feeds_gravity)
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


def see_pose(m, s, weighs):
    """Puts the engine's other data to the measured angles, with the bias of an arm at rest."""
    e = m.engine
    for i in range(m.joints):
        e.scratch_q[m.dof[i]] = s.angles[i]
    e.kinematics(e.model, e.scratch)
    e.com_pos(e.model, e.scratch)
    e.jacobian(e.model, e.scratch, e.scratch_J, e.none, e.site)
    if weighs:
        e.com_vel(e.model, e.scratch)
        e.bias(e.model, e.scratch, 0, e.scratch_forces)


def feed_gravity(m, k):
    """Adds the torques that hold arm and hand against gravity."""
    e = m.engine
    for i in range(m.joints):
        d = m.dof[i]
        k.tau[i] += e.scratch_forces[d]
        for j in range(m.axes):
            k.tau[i] -= e.scratch_J[m.row[j] * e.freedoms + d] * m.weight[j]


def render(m, s, k):
    """Adds the force of the clay at the handle as measured."""
    e, after = m.engine, s.next
    joints.place(m, k, e.scratch_handle)
    for i in range(2):
        o, at = k.axis[i], m.row[i] * e.freedoms
        o.v = 0.0
        for j in range(m.joints):
            o.v += e.scratch_J[at + m.dof[j]] * s.rates[j]
    fx, fy = laws.force_for_controller(m, s, k)
    for i in range(m.joints):
        d = m.dof[i]
        k.tau[i] -= e.scratch_J[m.row[0] * e.freedoms + d] * fx
        k.tau[i] -= e.scratch_J[m.row[1] * e.freedoms + d] * fy
    after.x.force, after.y.force = fx, fy
