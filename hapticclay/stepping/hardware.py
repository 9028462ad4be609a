"""The hardware between computer and arm in a sample: one function per imperfection.

Each takes its part and its state and returns values; if the part is None, it returns its input.
"""

from __future__ import annotations

from ..model import hardware as law
from .kick import at_rates, handle_at
from .parts import INF
from .state import Body, Guard, Hold, Machine, Pull, Queue, Rates

NONE = (0.0, 0.0)
QUEUED = 11  # numbers of an entry: time, then torques, force, guard, pull and velocity of its tool
CHANCE = 4  # numbers of a sample: its delay [s], whether it is lost, noise (x, y) [N]


# ---- chance --------------------------------------------------------------------------------------


def late(chance, k):
    """How late a sample is [s]."""
    if chance is None:
        return 0.0
    return chance.numbers[CHANCE * (k - chance.first)]


def is_lost(chance, k):
    """Whether a sample is lost."""
    return chance.numbers[CHANCE * (k - chance.first) + 1] > 0.0


def noise(chance, k, f):
    """The force with the noise of a sample, (x, y) [N]."""
    if chance is None:
        return f
    i = CHANCE * (k - chance.first) + 2
    return f[0] + chance.numbers[i], f[1] + chance.numbers[i + 1]


# ---- force ---------------------------------------------------------------------------------------


def filtered(part, x, f):
    """The force after its filter, (x, y) [N], and the filter's states at the next sample."""
    if part is None:
        return f, x
    a, b = law.filter_step(part, x[0], x[1], f[0])
    c, d = law.filter_step(part, x[2], x[3], f[1])
    return (x[0], x[2]), (a, b, c, d)


def converted(part, x):
    """Two numbers after their converter."""
    if part is None:
        return x
    span = part.span
    return law.quantize(x[0], part.bits, span[0]), law.quantize(x[1], part.bits, span[1])


# ---- joints --------------------------------------------------------------------------------------


def encoded(encoder, q):
    """Joint angles as the encoders read them [rad]."""
    if encoder is None:
        return q
    return law.encode(q[0], encoder), law.encode(q[1], encoder)


def differenced(part, x, k, Ts, q, w):
    """Joint rates as measured at sample k [rad/s], and their state after it."""
    if part is None:
        return w, x
    ring, row, k = part.ring, 3 * x.oldest, float(k)
    then = ring[row], ring[row + 1], ring[row + 2]
    w = law.velocity_difference(then[0], (then[1], then[2]), k, q, Ts)
    newest = ring[3 * ((x.oldest - 1) % part.velocity_window)]
    w = smoothed(part.cutoff, x.w, w, (k - newest) * Ts)
    return w, Rates(w, (x.oldest + 1) % part.velocity_window)


def smoothed(cutoff, old, w, span):
    if cutoff is None:
        return w
    return law.low_pass(old[0], w[0], cutoff, span), law.low_pass(old[1], w[1], cutoff, span)


def handle_seen(encoder, difference, arm, at, q, w):
    """The handle as measured."""
    if encoder is None:
        return handle_turning(difference, at, w)
    return handle_at(arm, Body(q, w, NONE), 0.0)


def handle_turning(difference, at, w):
    if difference is None:
        return at
    return at_rates(at, w)


def note_angles(part, machine, q):
    """Stores the angles of the next sample [rad]."""
    if part is None:
        return
    ring, row = part.ring, 3 * machine.rates.oldest
    ring[row], ring[row + 1], ring[row + 2] = float(machine.samples.k), q[0], q[1]


# ---- the rendered clay ---------------------------------------------------------------------------


def nothing(part):
    """No force of a part that has one."""
    if part is None:
        return part
    return NONE


def no_pull(part):
    """No pull of a coupling."""
    if part is None:
        return part
    return Pull(NONE, NONE)


def coupled(part, special, state, tool, at, b, f, Ts):
    """Force of the clay through the coupling [N]; the pull; the tool after the sample."""
    if part is None:
        return f, part, tool
    return coupled_in_clay(special, part, state, tool, at, b, Ts)


def coupled_in_clay(special, part, state, tool, at, b, Ts):
    if special is None:
        return coupled_in_flow(special, part, state, tool, at, b, Ts)
    return coupled_in_flow(special.flow, part, state, tool, at, b, Ts)


def coupled_in_flow(flow, part, state, tool, at, b, Ts):
    if flow is None:
        p, v = at.p, at.v
        x, ux = law.virtual_coupling(tool[0], p[0], v[0], b[0], part, Ts)
        y, uy = law.virtual_coupling(tool[1], p[1], v[1], b[1], part, Ts)
        f = b[0] * ux, b[1] * uy
        return f, Pull(f, (ux, uy)), (x, y)
    along = flow.along is not None
    ux, uy, fx, fy = law.tool_that_yields(tool, at.p, at.v, b, state.flow.law, along, part, Ts)
    return (fx, fy), Pull((fx, fy), (ux, uy)), (tool[0] + Ts * ux, tool[1] + Ts * uy)


def guarded(part, x, at, f, Ts):
    """Force of the clay after the passivity controller [N]; the part it adds; its state."""
    if part is None:
        return f, part, x
    n, p, W, share = part.whole + 2, at.p, at.W, part.share
    # since the last sample the motors have held one force, then another
    a, b = 2 * ((x.newest - part.whole) % n), 2 * ((x.newest - part.whole - 1) % n)
    meanx = (1.0 - share) * part.ring[a] + share * part.ring[b]
    meany = (1.0 - share) * part.ring[a + 1] + share * part.ring[b + 1]
    taken = (
        x.energy[0] + meanx * (p[0] - x.place[0]), x.energy[1] + meany * (p[1] - x.place[1])
    )  # fmt: skip
    fx = law.passivity_controller(taken[0], f[0], at.v[0], Ts, W[0])
    fy = law.passivity_controller(taken[1], f[1], at.v[1], Ts, W[2])
    return (fx, fy), (fx - f[0], fy - f[1]), Guard(taken, p, (x.newest + 1) % n)


def note_force(part, machine, f):
    """Stores the force that a sample requests [N]; `machine` is the one after it."""
    if part is None:
        return
    row = 2 * machine.guard.newest
    part.ring[row], part.ring[row + 1] = f[0], f[1]


# ---- delay ---------------------------------------------------------------------------------------


def is_due(part, queue, t):
    """Whether torques are due by t."""
    if part is None:
        return False
    return queue.due <= t


def queued(part, machine, after, shown, now):
    """The machine after an event, with the queue advanced and the actuator output then in effect.

    Args:
        part: the delay.
        machine: before the event.
        after: after the event, without the delay.
        shown: 1.0 where a sample requests torques.
        now: [s].
    """
    if part is None:
        return after
    q, time, n, m = machine.queue, machine.samples.when + part.delay, 0, after
    while n < q.n and time_of(part, q.first + n) <= now:
        n += 1
    hold = machine.hold
    if n == q.n and shown > 0.0 and time <= now:
        hold, shown = after.hold, 0.0
    elif n > 0:
        hold = hold_of(part, hold, q.first + n - 1)
    first, left = q.first + n, q.n - n
    due, then = entry(part, first, left, 0, shown, time), entry(part, first, left, 1, shown, time)
    return Machine(
        m.x, m.y, m.form, m.own, hold, m.samples, m.force, m.rates, m.filtered, m.guard, m.tool,
        Queue(first, left + 1 if shown > 0.0 else left, due, then),
    )  # fmt: skip


def time_of(part, row):
    return part.ring[QUEUED * (row % part.rows)]


def entry(part, first, n, i, shown, time):
    """When the i-th of n entries is due, with one behind them where `shown` [s]."""
    if i < n:
        return time_of(part, first + i)
    return time if i == n and shown > 0.0 else INF


def hold_of(part, like, row):
    """Actuator output of an entry of the queue."""
    x, i = part.ring, QUEUED * (row % part.rows)
    return Hold(
        two(x, i + 1), two(x, i + 3), guard_of(like.guard, x, i + 5), pull_of(like.pull, x, i + 7)
    )


def two(x, i):
    return x[i], x[i + 1]


def guard_of(like, x, i):
    if like is None:
        return like
    return two(x, i)


def pull_of(like, x, i):
    if like is None:
        return like
    return Pull(two(x, i), two(x, i + 2))


def note_hold(part, before, machine, asked):
    """Writes the output that a sample requests into the queue, where it comes later.

    Args:
        part: the delay.
        before: the machine before the event.
        machine: after the event.
        asked: the requested output.
    """
    if part is None:
        return
    q, old, x = machine.queue, before.queue, part.ring
    end = q.first + q.n
    if end == old.first + old.n:
        return
    i = QUEUED * ((end - 1) % part.rows)
    x[i] = before.samples.when + part.delay
    write_two(x, i + 1, asked.tau)
    write_two(x, i + 3, asked.force)
    write_guard(asked.guard, x, i + 5)
    write_pull(asked.pull, x, i + 7)


def write_two(x, i, pair):
    """Writes two numbers into an array.

    Args:
        pair: the numbers.
    """
    x[i], x[i + 1] = pair[0], pair[1]


def write_guard(guard, x, i):
    if guard is None:
        return
    write_two(x, i, guard)


def write_pull(pull, x, i):
    if pull is None:
        return
    write_two(x, i, pull.f)
    write_two(x, i + 2, pull.u)
