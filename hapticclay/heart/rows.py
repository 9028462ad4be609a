"""What a run keeps of a kick: its row of the record, and its entry in the ledger."""

from __future__ import annotations

from ..model import arm
from . import energy, kick as kicks, viscous, yielding
from .state import Filled, Ledger, State, Work, with_filled


def written(parts, s, e, k, after):
    """Writes the row of the sample; the state with one more."""
    i, pose, q, f = s.filled.rows, s.body.pose, s.body.q, s.filled
    v = kicks.velocity(parts, k)
    r, o, t = s.clay.region, s.clay.old, s.clock.t
    b = viscous.damping(parts.growth, r.base, r.rate, t)
    if after == 0.0:
        b = viscous.damping(parts.growth, o.base, o.rate, t)
        v = last_velocity(parts.stiff, parts, s, k, v)
    fh = kicks.hand_force(parts.hand, k)
    r1, r2 = arm.joint_velocity(v[0], v[1], pose.u, 1.0)
    row = e.rows[i]
    row[0], row[1], row[2], row[3] = q[0], q[1], pose.p[0], pose.p[1]
    row[4], row[5], row[6], row[7] = v[0], v[1], fh[0], fh[1]
    row[8], row[9], row[10], row[11] = k.tau[0], k.tau[1], k.delta[0], k.delta[1]
    row[12], row[13], row[14], row[15] = b[0], b[1], r1, r2 - r1
    rendered(parts.flow, parts.springs, parts, s, e, k, i, b, v)
    return with_filled(s, Filled(i + 1, f.crossings, f.stops))


def last_velocity(stiff, parts, s, k, v):
    """Velocity at the end of a run: in stiff clay that of a whole kick, the last step repeated."""
    if stiff is None or s.clock.before == 0.0:
        return v
    j = kicks.kick(parts, s, s.clock.before)
    if j.viscous.soft[0] > 0.0 or j.viscous.soft[1] > 0.0:
        x, y = kicks.velocity(parts, j)
        return (x if j.viscous.soft[0] > 0.0 else k.motion.u[0]), (
            y if j.viscous.soft[1] > 0.0 else k.motion.u[1]
        )
    return v


def rendered(flow, springs, parts, s, e, k, i, b, v):
    """Writes the force of the clay where b v does not tell it."""
    if flow is None and springs is None:
        return
    x, y = viscous.force(parts.grain, b, v)
    fx, fy = felt_force(flow, k.motion.felt)
    px, py = sprung_force(springs, s.clay.elastic, k.step.L)
    e.rendered[i, 0], e.rendered[i, 1] = x + fx + px, y + fy + py
    removed(parts.groove, e, i)


def felt_force(flow, felt):
    if flow is None:
        return 0.0, 0.0
    return felt.f


def sprung_force(springs, elastic, L):
    if springs is None:
        return 0.0, 0.0
    a, b = elastic.before, elastic.force
    return L * a[0] + (1.0 - L) * b[0], L * a[1] + (1.0 - L) * b[1]


def removed(groove, e, i):
    if groove is None:
        return
    e.rendered[i, 2] = groove.removed[0] + groove.removed[1]


def worked(parts, s, k):
    """The state with the works of a kick in the ledger."""
    v, u, w0, w1, H = k.v, k.motion.u, s.body.w, k.w, k.step.H
    dx, dy = viscous.dampers(parts.hand)
    vx, vy, r1, r2 = 0.5 * (v[0] + u[0]), 0.5 * (v[1] + u[1]), 0.5 * (w0[0] + w1[0]), 0.5 * (w0[1] + w1[1])
    muscle = H * (k.uh[0] * vx + k.uh[1] * vy)
    motors = H * (k.tau[0] * r1 + k.tau[1] * r2)
    clay = H * (k.fe[0] * vx + k.fe[1] * vy)
    hand = H * (dx * vx * vx + dy * vy * vy)
    a = s.ledger.work
    work = Work(
        a.muscle + muscle, a.motors + motors, a.clay + clay, a.hand + hand,
        a.through + (abs(muscle) + abs(motors)),
    )  # fmt: skip
    ledger = Ledger(work, s.body.pose.p, u, w1)
    return State(s.clock, s.body, s.loop, s.clay, ledger, s.status, s.filled, s.machine)
