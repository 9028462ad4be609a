"""The start of a run: arm at its place, clay around it, and controller."""

import math

from ..formulas import arm as arm_law
from ..formulas import regions
from . import (
    arm,
    borders,
    groove,
    hardware,
    joint_law,
    memory,
    methods,
    sampled,
    viscous,
    watch,
    yielding,
)


def begin(m, s, px, py, vx, vy):
    """Puts a state to the start of a run, the handle at p with velocity v."""
    memory.cleared(s)
    if m.general:
        for i in range(m.joints):
            s.q[i] = m.start[i]
    else:
        put_joints(m, s, px, py, vx, vy)
    s.max_step = s.spring_step = s.mode_step = math.inf
    s.form_before = s.form_after = -1.0
    arm.put(m, s)
    for i in range(2):
        put_axis(m, s, i, py if i else px, vy if i else vx)
    put_clay(m, s, px, py)
    watch.begin(s.watch)
    if m.method == methods.SAMPLED:
        put_machine(m, s, px, py)


def put_joints(m, s, px, py, vx, vy):
    """Joints of the arm in closed form, with the handle at p and velocity v."""
    s.q[0], s.q[1] = arm_law.inverse_kinematics(m.ox + px, m.oy + py, m.links)
    u = s.k.u
    u[0], u[1], u[2], u[3] = arm_law.jacobian(s.q[0], s.q[1], m.links)
    r1, r2 = arm_law.joint_velocity(vx, vy, u, 1.0)
    s.w[0], s.w[1] = r1, r2 - r1


def put_axis(m, s, i, p, v):
    """Compensator, reference model and clay of an axis in steady motion."""
    c, z, a = m.axis[i].servo, s.axis[i], s.mode[i]
    z.delta, z.rate, z.y, z.yrate = (p + c[1] / c[2] * v) / c[0], v / c[0], p, v
    if m.formed:
        z.rate = 0.0
        memory.copied4(z.z, m.axis[i].z0)
    z.n = z.old_n = a.n = a.mode = 1.0
    z.anchor = z.cut = math.nan


def put_clay(m, s, px, py):
    """The clay around the handle."""
    ix, iy = regions.region_of(m.table, (px, py))
    k, seen = s.k, s.seen
    arm.put_handle(m, s, k)
    borders.enter(m, s, ix, iy, k.x.p, k.y.p, -1, 1.0)
    viscous.age(s)
    if m.groove:
        groove.move(m, s, k.x.p, k.y.p, k.x.v, k.y.v)
    if m.flow:
        yielding.age(s)
    seen[0], seen[1], seen[2], seen[3] = ix, ix, iy, iy


def put_machine(m, s, px, py):
    """Controller and hardware; fills past samples into the rings of the sensors."""
    now = s.now
    for i in range(2):
        z, a, p = now.axis[i], s.axis[i], py if i else px
        if not m.own:
            z.delta, z.rate, z.y, z.yrate, z.start = a.delta, a.rate, a.y, a.yrate, a.delta
            memory.copied4(z.z, a.z)
        z.place, z.tool = p, p
    for j in range(m.joints):
        now.w[j], now.past[j] = s.w[j], hardware.encoded(m, j, s.q[j])
    if (m.joint_law or m.own) and m.feeds_gravity:  # until the first torque arrives
        joint_law.hold_weight(m, s)
    now.due = now.due_then = math.inf
    sampled.put_times(m, now, 0)
    if m.window > 0:
        fill_angles(m, s)
    if m.guard:  # before the start the motors have held nothing
        for j in range(2 * (m.guard_whole + 2)):
            m.forces[j] = 0.0
    memory.copied(s.next, now)


def fill_angles(m, s):
    """Past angles: before the start the joints have long turned at their rates."""
    ring, width = m.angles, m.joints + 1
    for j in range(m.window):
        n = j - m.window
        ring[width * j] = 1.0 * n
        for i in range(m.joints):
            ring[width * j + 1 + i] = hardware.encoded(m, i, s.q[i] + n * m.Ts * s.w[i])


def change(m, s):
    """Continues in a changed scene with the same borders."""
    px, py = arm.here(m, s)
    drag, entered, s.drag = s.drag, s.entered, 0.0
    s.springs_dissipated = s.springs_stored = 0.0
    for i in range(2):
        z, o = s.axis[i], s.k.axis[i]
        o.b0, o.b1, o.p = z.old, z.old_rate, z.bare  # these stay
        z.force = 0.0
    borders.enter(m, s, s.x.index, s.y.index, px, py, -1, 0.0)
    s.drag, s.entered = drag, entered
    for i in range(2):
        z, o = s.axis[i], s.k.axis[i]
        z.old, z.old_rate, z.bare = o.b0, o.b1, o.p
    if m.groove:
        groove.touch(m, px, py)
    arm.put(m, s)
