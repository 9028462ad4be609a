"""The arm in closed form: place, Jacobian and mobility; torques and rates by them; its mover."""

import math

from ..formulas import arm as law
from . import dynamics, joints


def place(m, q1, q2):
    """Position of the handle, (x, y) [m]."""
    links, a = m.links, q1 + q2
    x, y = links[0] * math.cos(q1), links[0] * math.sin(q1)
    return x + links[1] * math.cos(a) - m.ox, y + links[1] * math.sin(a) - m.oy


def here(m, s):
    """Position of the handle, (x, y) [m]."""
    if m.general:
        joints.handle_at(m, s, s.e)
        return s.e.x.p, s.e.y.p
    return place(m, s.q[0], s.q[1])


def put_handle(m, s, k):
    """The handle where the arm is, at the rates of its joints."""
    if m.general:
        joints.handle_at(m, s, k)
    else:
        handle_at(m, k, s.q[0], s.q[1], s.w[0], s.w[0] + s.w[1])


def handle_at(m, k, q1, q2, r1, r2):
    """The handle at a sample, with rates r1 and r2 of the links before the kick."""
    u, x, y = k.u, k.x, k.y
    u[0], u[1], u[2], u[3] = law.jacobian(q1, q2, m.links)
    x.p, y.p = u[1] + u[3] - m.ox, -m.oy - u[0] - u[2]
    k.Wxx, k.Wxy, k.Wyy = law.mobility(u, m.links)
    x.v, y.v = law.handle_velocity(r1, r2, u)


def turning(k, r1, r2):
    """Centripetal acceleration of the handle, for rates of the links."""
    k.x.c, k.y.c = law.centripetal(r1, r2, k.u)


def at_rates(k, w1, w2):
    """The handle at other joint rates."""
    k.x.v, k.y.v = law.handle_velocity(w1, w1 + w2, k.u)
    turning(k, w1, w1 + w2)


def link_torques(m, k):
    """Motor torques that give the link accelerations together with the net force."""
    u, links, x, y = k.u, m.links, k.x.net, k.y.net
    t2 = links[3] * k.g[1] - u[2] * x - u[3] * y
    k.tau[0], k.tau[1] = links[2] * k.g[0] - u[0] * x - u[1] * y + t2, t2


def pushed(m, u, t1, t2):
    """Acceleration of the handle under torques, (x, y) [m/s^2]."""
    links = m.links
    return law.handle_velocity((t1 - t2) / links[2], t2 / links[3], u)


def clipped(tau, limit):
    """A torque within its limit."""
    return min(max(tau, -limit), limit)


# ---- its mover -----------------------------------------------------------------------------------


def step_engine(m, s, k, h, even):
    """Steps the engine to the rates of a kick; `even`: the step is as long as the one before."""
    x, y, links, e = k.x, k.y, m.links, m.engine
    if even:  # beside its dampers the engine gets all of the force
        push1, push2 = law.joint_torques(x.net + x.damped, y.net + y.damped, k.u)
        b0, b1 = x.b1, y.b1
    else:
        a1, a2 = (k.w[0] - s.w[0]) / h, (k.w[0] + k.w[1] - s.w[0] - s.w[1]) / h
        push1, push2 = links[2] * a1 + links[3] * a2 - k.tau[0], links[3] * a2 - k.tau[1]
        b0 = b1 = 0.0
    ctrl, applied, timestep, q, w = e.ctrl, e.applied, e.timestep, e.q, e.w
    ctrl[0], ctrl[1] = k.tau[0], k.tau[1]
    if m.clay:
        ctrl[2], ctrl[3] = b0, b1
    applied[0], applied[1], timestep[0] = push1, push2, h
    w[0], w[1] = s.w[0], s.w[1]  # after a hit: the velocity after half a kick
    dynamics.step(e)
    s.q[0], s.q[1], s.w[0], s.w[1] = q[0], q[1], w[0], w[1]


def put(m, s):
    """Puts the arm where it is in a state, for the engine's next step."""
    e, s.sensed = m.engine, 0
    if m.general:
        return
    q, w, ranges, timestep = e.q, e.w, e.ranges, e.timestep
    q[0], q[1], w[0], w[1], timestep[0] = s.q[0], s.q[1], s.w[0], s.w[1], m.dt
    ranges[0], ranges[1], ranges[2], ranges[3] = -m.limit[0], m.limit[0], -m.limit[1], m.limit[1]


def accelerations(m, z, now):
    """Joint accelerations at a point of a step, by the engine's inertia and bias [rad/s^2]."""
    e = m.engine
    q, w, M, bias = e.q, e.w, e.M, e.forces
    q[0], q[1], w[0], w[1] = z.q1, z.q2, z.w1, z.w2
    dynamics.put_inertia(e)
    e.com_vel(e.model, e.data)
    e.bias(e.model, e.data, 0, e.forces)
    n1, n2 = now.tau1 + now.push1 - bias[0], now.tau2 + now.push2 - bias[1]
    share = M[1] / M[2]
    a1 = (n1 - share * n2) / (M[0] - share * M[1])
    return a1, n2 / M[2] - share * a1
