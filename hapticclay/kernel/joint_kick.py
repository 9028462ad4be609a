"""A kick of an arm on the engine's terms, under torques that the motors hold."""

from . import joint_friction, joints, kick, springs


def move_under(m, s, k):
    """Motion in a kick under torques of the motors."""
    kick.load(m, s, k)
    for i in range(m.axes):
        k.axis[i].f += m.weight[i]
    put_momentum(m, s, k)
    joints.factor_inertia(m, k.H * k.R)
    if m.acts or is_touched(m, k):
        joints.put_mobility(m, k)
        drive(m, s, k)
    else:
        drive_alone(m, k)


def put_momentum(m, s, k):
    """Momentum after a kick without friction, and without force at the handle, by joints."""
    e, n = m.engine, m.joints
    for i in range(n):
        x = k.H * (
            k.tau[i]
            - e.joint_bias[i]
            + m.pull[i]
            - m.spring[i] * s.q[i]
            + joints.drag(m, i)
            - k.L * joints.damping(m, k.o, i)
        )
        for j in range(n):
            x += e.joint_M[i * n + j] * k.o[j]
        e.moment[i] = x


def is_touched(m, k):
    """Whether the handle has a load that is not that of clay."""
    load = 0.0
    for i in range(m.axes):
        load += abs(k.axis[i].f) + k.axis[i].d
    return load > 0.0


def drive_alone(m, k):
    """Motion where nothing acts on the handle."""
    for i in range(m.axes):
        o = k.axis[i]
        o.net = o.fe = 0.0
    put_free_rates(m, k)
    joints.put_rates_after(m, k)
    for i in range(m.axes):
        k.axis[i].u = joints.along(m, m.engine.joint_J, i, k.w, 0)


def put_free_rates(m, k):
    """Joint rates after a kick with its friction, without force at the handle."""
    e, n = m.engine, m.joints
    if m.friction:
        joint_friction.find(m, k)
    for i in range(n):
        e.free[i] = e.moment[i] + k.H * k.slip[i]
    joints.solve(e.lower, 0, e.free, 0, n)


def drive(m, s, k):
    """Motion where something acts on the handle: by the law of the plane."""
    e = m.engine
    fx, fy = k.x.f, k.y.f
    if m.acts and m.springs:  # the friction of the joints bears their force, too
        springs.load(s, k)
    put_free_rates(m, k)
    k.x.f, k.y.f = fx, fy
    rate = 1.0 / k.H
    for i in range(m.axes):
        o, x = k.axis[i], joints.along(m, e.joint_J, i, e.free, 0)
        o.n, o.a, o.rest = rate, rate * x, rate * (x - o.v)
    k.Sxx, k.Sxy, k.Syy = k.Wxx, k.Wxy, k.Wyy
    if m.axes > 2:
        joints.eliminate(k, k.z.d)
    kick.move(m, s, k)
