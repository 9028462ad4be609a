"""The ledger of energy: what a kick adds to it."""

from . import hand, joints


def add_work(m, of, to, k, w, machine, q):
    """The ledger `of` with the works of a kick, into `to`.

    w are the joint rates before it, q their positions in it; `machine` is the one whose torques act
    in it.
    """
    x, y, H = k.x, k.y, k.H
    vx, vy = 0.5 * (x.v + x.u), 0.5 * (y.v + y.u)
    muscle = H * (x.uh * vx + y.uh * vy)
    power = k.tau[0] * (w[0] + k.w[0])
    for i in range(1, m.joints):
        power += k.tau[i] * (w[i] + k.w[i])
    if m.general:
        power += by_drives(m, k, w, q)
    motors = 0.5 * H * power
    clay = H * (x.fe * vx + y.fe * vy)
    taken = H * (hand.damping_force(m, k, 0) * vx + hand.damping_force(m, k, 1) * vy)
    if m.general:
        to.joints = taken_by_joints(m, k, w, of.joints)
        if m.axes > 2:
            muscle, taken = along_z(m, k, muscle, taken)
    to.muscle, to.motors, to.clay = of.muscle + muscle, of.motors + motors, of.clay + clay
    to.hand, to.through = of.hand + taken, of.through + (abs(muscle) + abs(motors))
    if m.hardware:
        add_hardware_work(m, of, to, k, w, machine)


def along_z(m, k, muscle, taken):
    """Work of the muscle, and what the damper of the hand takes, with those along z [J]."""
    way = k.H * 0.5 * (k.z.v + k.z.u)
    return muscle + k.z.uh * way, taken + hand.damping_force(m, k, 2) * way


def by_drives(m, k, w, q):
    """Twice the power of drives that run the law of the joints [W]."""
    power = 0.0
    for i in range(m.joints):
        rate = k.L * w[i] + k.R * k.w[i]
        torque = m.drive_pull[i] - m.drive_spring[i] * q[i] - m.drive_damper[i] * rate
        power += torque * (w[i] + k.w[i])
    return power


def taken_by_joints(m, k, w, taken):
    """What the dampers of the joints, and a fluid, take in addition [J]."""
    for i in range(m.joints):
        force = k.L * joints.damping(m, w, i) + k.R * joints.damping(m, k.w, i) - joints.drag(m, i)
        force -= m.drive_damper[i] * (k.L * w[i] + k.R * k.w[i])
        taken += 0.5 * k.H * force * (w[i] + k.w[i])
    return taken


def add_hardware_work(m, of, to, k, w, machine):
    """The same of hardware, and of clay that the motors hold."""
    a, b, x, y, H = machine.x, machine.y, k.x, k.y, k.H
    vx, vy = 0.5 * (x.v + x.u), 0.5 * (y.v + y.u)
    power = k.slip[0] * (0.5 * (w[0] + k.w[0]))
    for i in range(1, m.joints):
        power += k.slip[i] * (0.5 * (w[i] + k.w[i]))
    to.friction = of.friction - H * power
    to.guard = of.guard + H * (a.guard * vx + b.guard * vy)
    to.coupling = of.coupling + H * (a.pull * (vx - a.pull_rate) + b.pull * (vy - b.pull_rate))
    if m.renders:
        to.rendered = of.rendered + H * (a.force * vx + b.force * vy)
