"""The hardware between computer and arm in a sample: one function for each imperfection."""

import math

from ..formulas import hardware as law
from . import arm

QUEUED = 9  # numbers of an entry besides torques: time, force, guard, pull and velocity of its tool
CHANCE = 4  # numbers of a sample: its delay [s], whether it is lost, noise (x, y) [N]


# ---- chance --------------------------------------------------------------------------------------


def lateness(m, k):
    """How late a sample is [s]."""
    return m.chances[CHANCE * (k - m.chance_first)] if m.chance else 0.0


def is_lost(m, k):
    """Whether a sample is lost."""
    return m.chance and m.chances[CHANCE * (k - m.chance_first) + 1] > 0.0


def noise(m, k, i):
    """Noise of a sample on an axis of the force [N]."""
    return m.chances[CHANCE * (k - m.chance_first) + 2 + i]


# ---- force ---------------------------------------------------------------------------------------


def measured(m, s, i, f):
    """An axis of the force as the computer gets it [N]: with noise, filtered, converted."""
    if m.chance:
        f += noise(m, s.now.k, i)
    if m.filtered:
        z, to = s.now.axis[i].filter, s.next.axis[i].filter
        to[0], to[1] = law.filter_step(m.filter, z[0], z[1], f)
        f = z[0]
    return converted(m, f)


def converted(m, f):
    """An axis of the force after the converter [N]."""
    return law.quantize(f, m.adc_bits, m.adc_range)


# ---- joints --------------------------------------------------------------------------------------


def encoded(m, i, q):
    """The position of a joint as its encoder reads it."""
    return law.encode(q, m.count[i])


def differenced(m, s, q, w):
    """Joint rates by the difference of measured angles q, into w [rad/s]."""
    ring, now, after, n = m.angles, s.now, s.next, m.joints + 1
    old, k = n * now.oldest, 1.0 * now.k
    last = (k - ring[n * ((now.oldest + m.window - 1) % m.window)]) * m.Ts
    for i in range(m.joints):
        w[i] = law.velocity_difference(ring[old], ring[old + 1 + i], k, q[i], m.Ts)
        if m.cutoff > 0.0:
            w[i] = law.low_pass(now.w[i], w[i], m.cutoff, last)
        after.w[i] = w[i]
    after.oldest = (now.oldest + 1) % m.window


def note_angles(m, s):
    """Stores the angles of the next sample."""
    ring, row = m.angles, (m.joints + 1) * s.now.oldest
    ring[row] = 1.0 * s.now.k
    for i in range(m.joints):
        ring[row + 1 + i] = encoded(m, i, s.q[i])


# ---- torques -------------------------------------------------------------------------------------


def drive(m, s, tau):
    """Gives torques to the motors."""
    for i in range(m.joints):
        s.next.tau[i] = given(m, i, tau[i])


def given(m, i, tau):
    """Torque of a motor, within its limit and after the converter [N.m]."""
    return law.quantize(arm.clipped(tau, m.limit[i]), m.dac_bits, m.dac_range[i])


# ---- the rendered clay ---------------------------------------------------------------------------


def couple(m, s, k, bx, by):
    """Force of the clay through the coupling, (x, y) [N]; moves its tool."""
    now, after, T, coupling = s.now, s.next, m.Ts, (m.coupling_spring, m.coupling_damper)
    x, y = k.x, k.y
    if m.flow:
        a, b = s.x, s.y
        fyk = a.Fy, a.Kn, a.n, b.Fy, b.Kn, b.n
        tool = now.x.tool, now.y.tool
        ux, uy, fx, fy = law.tool_that_yields(
            tool, (x.p, y.p), (x.v, y.v), (bx, by), fyk, m.flow == 2, coupling, T
        )
        after.x.tool, after.y.tool = now.x.tool + T * ux, now.y.tool + T * uy
    else:
        after.x.tool, ux = law.virtual_coupling(now.x.tool, x.p, x.v, bx, coupling, T)
        after.y.tool, uy = law.virtual_coupling(now.y.tool, y.p, y.v, by, coupling, T)
        fx, fy = bx * ux, by * uy
    after.x.pull, after.y.pull, after.x.pull_rate, after.y.pull_rate = fx, fy, ux, uy
    return fx, fy


def guarded(m, s, k, i, f):
    """An axis of the force of the clay after the passivity controller [N]."""
    o, z, to, ring, n = k.axis[i], s.now.axis[i], s.next.axis[i], m.forces, m.guard_whole + 2
    # since the last sample the motors have held one force, then another
    a = 2 * ((s.now.newest - m.guard_whole + n) % n)
    b = 2 * ((s.now.newest - m.guard_whole - 1 + n) % n)
    mean = (1.0 - m.guard_share) * ring[a + i] + m.guard_share * ring[b + i]
    to.energy, to.place = z.energy + mean * (o.p - z.place), o.p
    made = law.passivity_controller(to.energy, f, o.v, m.Ts, k.Wyy if i else k.Wxx)
    to.guard = made - f
    return made


def note_force(m, s):
    """Stores the force that a sample requests."""
    row = 2 * s.next.newest
    m.forces[row], m.forces[row + 1] = s.requested[m.joints], s.requested[m.joints + 1]


# ---- delay ---------------------------------------------------------------------------------------


def advance_queue(m, s, now):
    """Advances the queue of torques, and holds those that are due."""
    ring, q, after, width = m.queue, s.now, s.next, QUEUED + m.joints
    time, n = q.when + m.delay, 0
    while n < q.n and ring[width * ((q.first + n) % m.queue_rows)] <= now:
        n += 1
    waits = s.responded
    if n == q.n and s.responded and time <= now:
        waits = 0
    elif n > 0:
        hold(m, after, ring, width * ((q.first + n - 1) % m.queue_rows) + 1)
    else:
        for i in range(m.joints):
            after.tau[i] = q.tau[i]
        for i in range(2):
            z, to = q.axis[i], after.axis[i]
            to.force, to.guard, to.pull, to.pull_rate = z.force, z.guard, z.pull, z.pull_rate
    after.first, left = q.first + n, q.n - n
    after.due = due_time(m, after.first, left, 0, waits, time)
    after.due_then = due_time(m, after.first, left, 1, waits, time)
    after.n = left + 1 if waits else left


def hold(m, machine, of, j):
    """Lets the motors hold the numbers of an output, from index j on."""
    for i in range(m.joints):
        machine.tau[i] = of[j + i]
    j += m.joints
    for i in range(2):
        to = machine.axis[i]
        to.force, to.guard = of[j + i], of[j + 2 + i]
        to.pull, to.pull_rate = of[j + 4 + i], of[j + 6 + i]


def note_request(m, s):
    """Notes the output that a sample requests."""
    to, j = s.requested, m.joints
    for i in range(j):
        to[i] = s.next.tau[i]
    for i in range(2):
        z = s.next.axis[i]
        to[j + i], to[j + 2 + i], to[j + 4 + i], to[j + 6 + i] = (
            z.force, z.guard, z.pull, z.pull_rate
        )  # fmt: skip


def due_time(m, first, n, i, waits, time):
    """When the i-th of n entries is due [s]; after them, the one that waits, if any."""
    if i < n:
        return m.queue[(QUEUED + m.joints) * ((first + i) % m.queue_rows)]
    return time if i == n and waits else math.inf


def enqueue(m, s):
    """Writes the output that a sample requests into the queue, where it comes later."""
    end = s.next.first + s.next.n
    if end != s.now.first + s.now.n:
        ring, width = m.queue, QUEUED + m.joints
        j = width * ((end - 1) % m.queue_rows)
        ring[j] = s.now.when + m.delay
        for i in range(width - 1):
            ring[j + 1 + i] = s.requested[i]
