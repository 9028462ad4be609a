"""The ledger of energy: what a kick adds to it."""

from . import hand


def add_work(m, of, to, k, w1, w2, machine):
    """The ledger `of` with the works of a kick, into `to`.

    w1 and w2 are the joint rates before it, `machine` is the one whose torques act in it.
    """
    x, y, H = k.x, k.y, k.H
    vx, vy = 0.5 * (x.v + x.u), 0.5 * (y.v + y.u)
    muscle = H * (x.uh * vx + y.uh * vy)
    motors = 0.5 * H * (k.tau1 * (w1 + k.w1) + k.tau2 * (w2 + k.w2))
    clay = H * (x.fe * vx + y.fe * vy)
    taken = H * (hand.damping_force(m, k, 0) * vx + hand.damping_force(m, k, 1) * vy)
    to.muscle, to.motors, to.clay = of.muscle + muscle, of.motors + motors, of.clay + clay
    to.hand, to.through = of.hand + taken, of.through + (abs(muscle) + abs(motors))
    if m.hardware:
        add_hardware_work(m, of, to, k, w1, w2, machine)


def add_hardware_work(m, of, to, k, w1, w2, machine):
    """The same of hardware, and of clay that the motors hold."""
    a, b, x, y, H = machine.x, machine.y, k.x, k.y, k.H
    vx, vy = 0.5 * (x.v + x.u), 0.5 * (y.v + y.u)
    r1, r2 = 0.5 * (w1 + k.w1), 0.5 * (w2 + k.w2)
    to.friction = of.friction - H * (k.slip1 * r1 + k.slip2 * r2)
    to.guard = of.guard + H * (a.guard * vx + b.guard * vy)
    to.coupling = of.coupling + H * (a.pull * (vx - a.pull_rate) + b.pull * (vy - b.pull_rate))
    if m.renders:
        to.rendered = of.rendered + H * (a.force * vx + b.force * vy)
