"""An arm of any joints on the engine's terms: its inertia and bias, and how a kick moves it.

The handle moves along the two axes of the clay's plane, here x and y, and perhaps along a third, z.
Only hand and muscle act along z, which is eliminated: in the plane all laws of the clay see an arm
of another mobility (docs/equations.md).
"""

from ..formulas import numbers
from . import dynamics, hand


def sense(m, s):
    """Puts the engine to the joints' place: inertia of the joints, and Jacobian of the handle."""
    if s.sensed:
        return
    s.sensed, e, n = 1, m.engine, m.joints
    e.factored = -1.0
    if m.computed:
        for i in range(n):
            e.pose[i] = s.q[i]
        e.pose[2 * n] += 1.0  # calls, which Python counts as well: Ctrl-C may drop one
        e.at_pose(e.pose)
        return
    for i in range(n):
        e.q[m.dof[i]] = s.q[i]
    dynamics.put_inertia(e)
    e.factor(e.model, e.data)
    e.full(e.model, e.data, e.M)
    e.jacobian(e.model, e.data, e.J, e.none, e.site)
    for i in range(n):
        at = m.dof[i] * e.freedoms
        for j in range(n):
            e.joint_M[i * n + j] = e.M[at + m.dof[j]]
    gather(m, e.J, e.joint_J)


def gather(m, J, A):
    """A Jacobian of the handle by its axes and the joints, from the engine's."""
    for i in range(m.axes):
        for j in range(m.joints):
            A[i * m.joints + j] = J[m.row[i] * m.engine.freedoms + m.dof[j]]


def turn(m, k, rates, g, h):
    """Centripetal acceleration of the handle at rates, and bias torques at those some time h later.

    As in the closed form of sampled control, a hand with a mass is so first-order in the step.
    """
    e, n = m.engine, m.joints
    if m.computed:
        for i in range(n):
            e.pose[n + i] = rates[i] + h * g[i]
        e.pose[2 * n] += 1.0
        e.at_rates(e.pose)
        e.factored = -1.0  # its dampers may depend on the rates
        for i in range(m.axes):
            k.axis[i].c = e.joint_c[i]
        return
    for i in range(m.axes):
        k.axis[i].c = 0.0
    if m.x.mass > 0.0 or m.y.mass > 0.0:
        for i in range(n):
            e.w[m.dof[i]] = rates[i]
        e.com_vel(e.model, e.data)
        put_centripetal(m, k)
    for i in range(n):
        e.w[m.dof[i]] = rates[i] + h * g[i]
    e.com_vel(e.model, e.data)
    e.bias(e.model, e.data, 0, e.forces)
    for i in range(n):
        e.joint_bias[i] = e.forces[m.dof[i]]


def put_centripetal(m, k):
    """Centripetal acceleration of the handle at the engine's rates."""
    e = m.engine
    e.jacobian_rate(e.model, e.data, e.Jdot, e.none, e.handle, e.body)
    for i in range(m.axes):
        o, at = k.axis[i], m.row[i] * e.freedoms
        for j in range(m.joints):
            o.c -= e.Jdot[at + m.dof[j]] * e.w[m.dof[j]]


def place(m, k, of):
    """Position of the handle."""
    for i in range(m.axes):
        k.axis[i].p = of[m.row[i]] - m.at[i]


def handle_velocity(m, k, J, rates):
    """Velocity of the handle at joint rates, by its Jacobian."""
    for i in range(m.axes):
        k.axis[i].v = along(m, J, i, rates, 0)


def along(m, J, i, x, at):
    """Row i of a Jacobian times rates or accelerations of the joints: x from `at` on."""
    out = 0.0
    for j in range(m.joints):
        out += J[i * m.joints + j] * x[at + j]
    return out


def handle_at(m, s, k):
    """The handle after a step."""
    sense(m, s)
    place(m, k, m.engine.handle)
    handle_velocity(m, k, m.engine.joint_J, s.w)


def place_after(m, s, after):
    """Position of the handle after the step tried, (x, y) [m]."""
    if not m.places:
        return s.k.x.p, s.k.y.p
    e = m.engine
    if m.computed:
        for i in range(m.joints):
            e.pose[i] = s.q[i] + after * s.k.w[i]
        e.pose[2 * m.joints] += 1.0
        e.at_scratch(e.pose)
    else:
        for i in range(m.joints):
            e.scratch_q[m.dof[i]] = s.q[i] + after * s.k.w[i]
        e.kinematics(e.model, e.scratch)
    return e.scratch_handle[m.row[0]] - m.at[0], e.scratch_handle[m.row[1]] - m.at[1]


# ---- before a kick -------------------------------------------------------------------------------


def before_kick(m, s, k):
    """The arm before a kick across a sample; its bias is that in the middle of the kick."""
    for i in range(m.joints):
        k.o[i] = s.w[i]
    handle_at(m, s, k)
    turn(m, k, s.w, s.g, 0.5 * k.H)


def from_event(m, s, k):
    """As `before_kick`, at an event: the change of the torques gives the acceleration after it."""
    e, change = m.engine, 0.0
    for i in range(m.joints):
        e.free[i] = s.next.tau[i] - s.e.tau[i]
        change += abs(e.free[i])
    if change > 0.0:
        factor_inertia(m, 0.0)
        solve(e.lower, 0, e.free, 0, m.joints)
    for i in range(m.joints):
        e.free[i] += s.e.g[i]
    turn(m, k, k.o, e.free, 0.5 * k.H)
    for i in range(m.axes):
        o, z = k.axis[i], s.e.axis[i]
        o.p, o.v, o.owed0, o.stuck0, o.anchor0 = z.p, z.v, z.owed, z.stuck, z.anchor


def at_event(m, k):
    """The handle after the kick to an event."""
    handle_velocity(m, k, m.engine.joint_J, k.w)


# ---- a kick --------------------------------------------------------------------------------------


def damping(m, w, i):
    """Torque of the dampers on a joint, at rates of all [N.m]."""
    e, x = m.engine, m.damper[i] * w[i]
    if m.computed:
        for j in range(m.joints):
            x += e.joint_D[i * m.joints + j] * w[j]
    return x


def drag(m, i):
    """Torque of a fluid on a joint, beside what the dampers have of it [N.m]."""
    return m.engine.joint_F[i] if m.computed else 0.0


def factor_inertia(m, h):
    """Cholesky factor of the inertia, with the damping of the joints over a time h."""
    e, n = m.engine, m.joints
    if e.factored == h:
        return
    e.factored = h
    for i in range(n):
        for j in range(i + 1):
            e.lower[i * n + j] = e.joint_M[i * n + j]
            if m.computed:
                e.lower[i * n + j] += h * e.joint_D[i * n + j]
        e.lower[i * n + i] += h * m.damper[i]
    factor(e.lower, 0, n)


def factor(A, at, n):
    """Replaces the lower half of a matrix by its Cholesky factor, with reciprocal diagonal."""
    for i in range(n):
        for j in range(i + 1):
            p, q = at + i * n, at + j * n
            x = A[p + j]
            for r in range(j):
                x -= A[p + r] * A[q + r]
            A[p + j] = numbers.ratio(1.0, numbers.root(x)) if i == j else x * A[q + j]


def solve(L, of, x, at, n):
    """Solves L L' y = x in place: L from index `of` on, as `factor` left it, x from `at` on."""
    for i in range(n):
        for j in range(i):
            x[at + i] -= L[of + i * n + j] * x[at + j]
        x[at + i] *= L[of + i * n + i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            x[at + i] -= L[of + j * n + i] * x[at + j]
        x[at + i] *= L[of + i * n + i]


def put_mobility(m, k):
    """Mobility of the handle, by the factor of the inertia."""
    e, n = m.engine, m.joints
    for i in range(m.axes):
        for j in range(n):
            e.Y[i * n + j] = e.joint_J[i * n + j]
        solve(e.lower, 0, e.Y, i * n, n)
    k.Wxx, k.Wxy, k.Wyy = mobility(m, 0, 0), mobility(m, 0, 1), mobility(m, 1, 1)
    if m.axes > 2:
        k.Wxz, k.Wyz, k.Wzz = mobility(m, 0, 2), mobility(m, 1, 2), mobility(m, 2, 2)


def mobility(m, i, j):
    """Acceleration of the handle along one axis per force along another [1/kg]."""
    e = m.engine
    return along(m, e.joint_J, i, e.Y, j * m.joints)


def eliminate(k, d):
    """Eliminates z, where the law is n u = a + W (f - d u), from the law of the plane."""
    x, y, z = k.x, k.y, k.z
    per = numbers.ratio(d, z.n + k.Wzz * d)
    force = z.f - per * (z.a + k.Wzz * z.f)
    x.a, y.a = x.a + k.Wxz * force, y.a + k.Wyz * force
    x.rest, y.rest = x.rest + k.Wxz * force, y.rest + k.Wyz * force
    k.Sxx, k.Sxy = k.Sxx - k.Wxz * per * k.Wxz, k.Sxy - k.Wxz * per * k.Wyz
    k.Syy -= k.Wyz * per * k.Wyz


def answer(m, k):
    """Joint rates after a kick, by the force on the handle."""
    e, n = m.engine, m.joints
    if m.axes > 2:
        z = k.z
        total = z.a + k.Wxz * k.x.net + k.Wyz * k.y.net + k.Wzz * z.f
        z.u = numbers.ratio(total, z.n + k.Wzz * z.d)
        z.net, z.fe = z.f - z.d * z.u, 0.0
    for j in range(n):
        x = 0.0
        for i in range(m.axes):
            x += e.Y[i * n + j] * k.axis[i].net
        e.free[j] += k.H * x
    put_rates_after(m, k)


def put_rates_after(m, k):
    """Joint rates and accelerations of a kick; a joint that friction holds rests."""
    e = m.engine
    for j in range(m.joints):
        k.w[j] = e.free[j]
        if m.friction and m.slip[j] > 0.0 and e.pivots[j] == 0:
            k.w[j] = 0.0
        k.g[j] = (k.w[j] - k.o[j]) / k.H


# ---- at a sample ---------------------------------------------------------------------------------


def sensed_handle(m, s, k):
    """The handle at a sample, into k."""
    for i in range(m.axes):
        o, z = k.axis[i], s.e.axis[i]
        o.p, o.v = z.p, z.v


def prepare_sensor(m, s, k):
    """The arm at a sample, before it accelerates: its mobility, and `rest` without any force."""
    e, n = m.engine, m.joints
    turn(m, k, s.e.w, s.e.w, 0.0)
    for i in range(n):
        torque = s.e.tau[i] + s.e.slip[i] - e.joint_bias[i] + m.pull[i] - m.spring[i] * s.q[i]
        e.free[i] = torque - damping(m, s.e.w, i) + drag(m, i)
    factor_inertia(m, 0.0)
    solve(e.lower, 0, e.free, 0, n)
    put_mobility(m, k)
    for i in range(m.axes):
        o = k.axis[i]
        o.n = 1.0
        o.a = o.rest = along(m, e.joint_J, i, e.free, 0)
    if m.axes > 2:
        z = k.z
        z.f = m.z.push + m.weight[2] - hand.resistance(m, z.p, z.v, z.c, 2)
        k.Sxx, k.Sxy, k.Syy = k.Wxx, k.Wxy, k.Wyy
        eliminate(k, m.z.mass)
        k.Wxx, k.Wxy, k.Wyy = k.Sxx, k.Sxy, k.Syy


def force_along_z(m, k, fx, fy, ax, ay):
    """Force of the hand along z on a sensor, under forces in the plane and accelerations there."""
    z = k.z
    px, py = fx - m.x.mass * ax, fy - m.y.mass * ay
    a = (z.a + k.Wxz * px + k.Wyz * py + k.Wzz * z.f) / (1.0 + k.Wzz * m.z.mass)
    return z.f - m.z.mass * a


# ---- the step ------------------------------------------------------------------------------------


def step(m, s, k, h):
    """Moves the arm to the rates of a kick: the engine does, where its terms are used."""
    s.sensed, n = 0, m.joints
    if m.computed:
        for j in range(n):
            s.q[j], s.w[j], s.g[j] = s.q[j] + h * k.w[j], k.w[j], k.g[j]
        return
    e = m.engine
    for i in range(e.freedoms):
        e.w[i], e.applied[i] = 0.0, e.forces[i]
    for j in range(n):
        d, a = m.dof[j], (k.w[j] - s.w[j]) / h
        e.w[d] = s.w[j]
        for i in range(e.freedoms):
            e.applied[i] += e.M[i * e.freedoms + d] * a
    e.timestep[0] = h
    e.move(e.model, e.data)
    for j in range(n):
        s.q[j], s.w[j], s.g[j] = e.q[m.dof[j]], k.w[j], k.g[j]


# ---- a row ---------------------------------------------------------------------------------------


def width(m):
    """Numbers of the part of a row that such an arm adds: q, q', tau; p, v and force of hand z."""
    return 3 * m.joints + (3 if m.axes > 2 else 0)


def write(m, s, k, share):
    """Writes that part; `share`: of a kick to the event at the sample, see sampled.shown_output."""
    out, n, at = m.extra, m.joints, width(m) * s.row
    for i in range(n):
        rate = k.o[i] + k.L * (k.w[i] - k.o[i])
        driven = m.drive_pull[i] - m.drive_spring[i] * s.q[i] - m.drive_damper[i] * rate
        out[at + i], out[at + n + i], out[at + 2 * n + i] = s.q[i], rate, k.tau[i] + driven
    if m.axes > 2:
        z, at, h = k.z, at + 3 * n, hand.force(m, k, 2)
        out[at], out[at + 1] = z.p, z.v + k.L * (z.u - z.v)
        out[at + 2] = h + share * (s.fh[2] - h)
