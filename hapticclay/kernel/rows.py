"""What a run keeps of a kick: its row of the record, and its entry in the ledger of energy."""

from ..formulas import arm as arm_law
from . import hand, joints, kick, laws, ledger, own_laws, sampled, springs, viscous

ROW = 16  # floats of a row: q, p, v, fh, tau, delta, b, q', two axes each


def write(m, s, k, after):
    """Writes the row of a kick before a step of length `after`, 0 at the end of a run."""
    x, y, end = k.x, k.y, 1 if after == 0.0 else 0
    yields = m.acts and m.special and m.flow
    vx, vy = kick.velocity(m, k, 0), kick.velocity(m, k, 1)
    fx, fy = x.sf if yields else 0.0, y.sf if yields else 0.0
    if end:
        vx, vy, fx, fy = arrived(m, s, vx, vy, fx, fy)
    bx, by = viscous.damping(m, s, 0, end), viscous.damping(m, s, 1, end)
    hx, hy = hand.force(m, k, 0), hand.force(m, k, 1)
    share = 0.0
    if m.ratio:
        dx, dy, share = sampled.shown_output(s, after)
        hx, hy = hx + share * (s.fh[0] - hx), hy + share * (s.fh[1] - hy)
        if m.special and m.flow:
            fx, fy = x.sf + share * (s.e.x.sf - x.sf), y.sf + share * (s.e.y.sf - y.sf)
            fx, fy = laws.motion_force(m, s, vx, vy, fx, fy)
    else:
        dx, dy = kick.shown_delta(k, 0), kick.shown_delta(k, 1)
    r1 = r2 = 0.0
    if m.general:
        joints.write(m, s, k, share)
    else:
        r1, r2 = arm_law.joint_velocity(vx, vy, k.u, 1.0)
    row, n = m.rows, ROW * s.row
    row[n], row[n + 1], row[n + 2], row[n + 3] = s.q[0], s.q[1], x.p, y.p
    row[n + 4], row[n + 5], row[n + 6], row[n + 7] = vx, vy, hx, hy
    row[n + 8], row[n + 9], row[n + 10], row[n + 11] = k.tau[0], k.tau[1], dx, dy
    row[n + 12], row[n + 13], row[n + 14], row[n + 15] = bx, by, r1, r2 - r1
    if m.records_clay_force:
        write_force(m, s, k, end, vx, vy, fx, fy)
    if m.records_held_force:
        machine, out = sampled.machine_of(s, after), m.rendered
        out[3 * s.row], out[3 * s.row + 1] = machine.x.force, machine.y.force


def write_force(m, s, k, end, vx, vy, fx, fy):
    """Writes the force of the clay where b v does not give it; f is that of yielding."""
    out, n = m.rendered, 3 * s.row
    bx, by = viscous.force(m, viscous.damping(m, s, 0, end), viscous.damping(m, s, 1, end), vx, vy)
    x, y = bx + fx, by + fy
    if m.springs:
        x, y = springs.added(m, s, 0, k.L, bx, x), springs.added(m, s, 1, k.L, by, y)
    if m.laws:
        ax, ay = own_laws.force(m, k.x.p, k.y.p, vx, vy, 0.0)
        x, y = x + ax, y + ay
    out[n], out[n + 1] = x, y
    if m.groove:
        out[n + 2] = m.removed[0] + m.removed[1]


def repeat(m, s, k, after):
    """A kick across the sample, whatever begins there."""
    if m.ratio:
        sampled.across(m, s, k, after)
    else:
        kick.by_servo(m, s, k, after)


def arrived(m, s, vx, vy, fx, fy):
    """Velocity and force of yielding at the end of a step, from those of half a kick.

    Half a kick holds too little of stiff clay: there they are those of a whole one, with the step
    before it repeated.
    """
    if not (m.acts and m.special and m.stiff) or s.before == 0.0:
        return vx, vy, fx, fy
    k = s.e
    repeat(m, s, k, s.before)
    if k.x.soft > 0.0:
        vx, fx = kick.velocity(m, k, 0), k.x.sf if m.flow else 0.0
    if k.y.soft > 0.0:
        vy, fy = kick.velocity(m, k, 1), k.y.sf if m.flow else 0.0
    return vx, vy, fx, fy


def keep(m, s, k, after, shows, works):
    """Keeps the results of a kick: its row, if now is a sample, and its works."""
    if shows:
        write(m, s, k, after)
        s.row += 1
    if not works:
        return
    if sampled.is_early(s, after):
        ledger.add_work(m, s.work_at_event, s.work, k, s.e.w, s.next, s.q)
    else:
        ledger.add_work(m, s.work, s.work, k, s.w, s.now, s.q)
