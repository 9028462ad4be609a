"""What a run keeps of a kick: its row of the record, and its entry in the ledger."""

from __future__ import annotations

from ..model import arm
from . import hand, laws, springs, viscous
from .engine_step import put
from .state import HardwareWork, Work

ROW = 16  # floats of a row: q, p, v, fh, tau, delta, b, q', two axes each


def hand_force(part, k):
    """Mean force of the operator in a kick, (x, y) [N]."""
    if part is None:
        return k.uh
    return k.motion.f[0] + k.fe[0], k.motion.f[1] + k.fe[1]


def write(rows, i, q, k, v, b, fh, delta):
    """Writes the row of a sample."""
    p, tau = k.at.p, k.tau
    r1, r2 = arm.joint_velocity(v[0], v[1], k.at.u, 1.0)
    put(
        rows, ROW * i,
        (
            q[0], q[1], p[0], p[1], v[0], v[1], fh[0], fh[1], tau[0], tau[1], delta[0], delta[1],
            b[0], b[1], r1, r2 - r1,
        ),
    )  # fmt: skip


def tells(special):
    """Whether the clay has a force that b v does not give."""
    return not (special.flow is None and special.springs is None and special.more is None)


def write_force(special, grain, e, i, k, states, seen):
    """Writes the force of the clay where b v does not give it.

    Args:
        special: laws of the clay.
        grain: as Parts.grain.
        e: the engine.
        i: the row.
        k: the kick.
        states: of the laws.
        seen: force of yielding [N], velocity [m/s] and damping [N.s/m] at the sample, (x, y) each.
    """
    if special is None:
        return
    f, v, b = seen
    if special.flow is None and special.springs is None and special.more is None:
        return
    x, y = viscous.force(grain, b, v)
    px, py = sprung_force(special.springs, states, k.step.L)
    fx, fy = laws.force(special.more, states.more, k.at.p, v)
    put(e.rendered, 3 * i, (x + f[0] + px + fx, y + f[1] + py + fy))
    write_removed(special.groove, e, i)


def yield_force(special, k):
    """Force of yielding at the sample of a kick, (x, y) [N]."""
    if special is None:
        return 0.0, 0.0
    return felt_force(special.flow, k.motion.reaction)


def felt_force(flow, state):
    if flow is None:
        return 0.0, 0.0
    return state.contact.f


def sprung_force(part, states, L):
    if part is None:
        return 0.0, 0.0
    return springs.force(states.elastic, L)


def write_removed(groove, e, i):
    if groove is None:
        return
    put(e.rendered, 3 * i + 2, (groove.removed[0] + groove.removed[1],))


def with_work(parts, a, k, w):
    """The ledger with the works of a kick; w are the joint rates before it."""
    v, u, n, H, uh, tau, fe = k.at.v, k.motion.u, k.w, k.step.H, k.uh, k.tau, k.fe
    dx, dy = hand.damping_force(parts.hand, k.step, v, u)
    vx, vy = 0.5 * (v[0] + u[0]), 0.5 * (v[1] + u[1])
    muscle = H * (uh[0] * vx + uh[1] * vy)
    motors = 0.5 * H * (tau[0] * (w[0] + n[0]) + tau[1] * (w[1] + n[1]))
    clay = H * (fe[0] * vx + fe[1] * vy)
    taken = H * (dx * vx + dy * vy)
    return Work(
        a.muscle + muscle, a.motors + motors, a.clay + clay, a.hand + taken,
        a.through + (abs(muscle) + abs(motors)),
        hardware_work(a.hardware, parts.sampler, k, w, (vx, vy)),
    )  # fmt: skip


def hardware_work(work, sampler, k, w, v):
    """What hardware has taken, with its work in a kick; v is the mean velocity."""
    if work is None:
        return work
    H, (hold, slip), n = k.step.H, k.loop, k.w
    rates = 0.5 * (w[0] + n[0]), 0.5 * (w[1] + n[1])
    return HardwareWork(
        work.friction + friction_work(slip, H, rates), work.guard + guard_work(hold.guard, H, v),
        work.coupling + coupling_work(hold.pull, H, v),
        work.rendered + rendered_work(sampler.clay, hold.force, H, v),
    )  # fmt: skip


def friction_work(slip, H, w):
    if slip is None:
        return 0.0
    return -H * (slip[0] * w[0] + slip[1] * w[1])


def guard_work(guard, H, v):
    if guard is None:
        return 0.0
    return H * (guard[0] * v[0] + guard[1] * v[1])


def rendered_work(physical, force, H, v):
    if physical is None:
        return H * (force[0] * v[0] + force[1] * v[1])
    return 0.0


def coupling_work(pull, H, v):
    if pull is None:
        return 0.0
    return H * (pull.f[0] * (v[0] - pull.u[0]) + pull.f[1] * (v[1] - pull.u[1]))
