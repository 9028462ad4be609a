"""Clay that springs back: its force in a kick, and its state after a step."""

import math

from ..formulas import regions
from ..formulas import spring as law

NEAR = 1e-6  # of a step


def force(s, i, L):
    """Force of an axis at a sample, share L before it [N]."""
    z = s.axis[i]
    return L * z.force_before + (1.0 - L) * z.force


def load(s, k):
    """Adds their force to the load of a kick."""
    for i in range(2):
        o = k.axis[i]
        o.pull, o.freed = force(s, i, k.L), 0.0
        o.f -= o.pull


# ---- surfaces, which push and never pull ---------------------------------------------------------


def pulls(m, z, f):
    """Whether a force of spring and damping is one by which a surface would pull.

    Stiff clay, whose damping a step splits, holds what it has.
    """
    return m.stiff == 0 and z.way * f < 0.0


def let_go(m, s, k):
    """Takes surfaces that would pull out of the load of a kick; returns whether there are any."""
    found = 0
    for i in range(2):
        o = k.axis[i]
        if pulls(m, s.axis[i], o.pull + o.clay + o.clay_d * o.u):
            o.f, o.d, o.freed = o.f + (o.pull + o.clay), o.d - o.clay_d, 1.0
            found = 1
    return found


def put_freed(k):
    """Makes spring and damping of a surface that has let go no force, in a kick."""
    for i in range(2):
        o = k.axis[i]
        if o.freed > 0.0:
            o.pull = -(o.clay + o.damped)


def added(m, s, i, L, damping, f):
    """A force with that of the spring of an axis; without its damping where a surface would pull.

    f: force of the damping, and more [N].
    """
    pull = force(s, i, L)
    return f - damping if pulls(m, s.axis[i], pull + damping) else f + pull


def beside(m, s, i, damping):
    """Force of an axis before a sample besides its damping, which a surface takes back [N]."""
    return added(m, s, i, 1.0, damping, 0.0)


def longest_step(s, after):
    """The step in equal parts that resolve the springs [s]."""
    if after <= s.spring_step:
        return after
    return after / math.ceil(after / s.spring_step - NEAR)


def force_for_controller(m, s, i, p):
    """Force of an axis as the controller evaluates it [N].

    Springs that the motors render are evaluated at the place that encoders read; what gave way and
    relaxed since follows the true place.
    """
    z = s.axis[i]
    if m.springs == 1 or m.encoder == 0:
        return z.force
    _, f, _, _ = law.spring_step(z.k, z.k_limit, z.way, z.rest, p)
    # the second spring is as long as when the handle was last seen, and what was misread
    _, f1, _, _ = law.spring_step(z.k1, math.inf, z.way, z.at - z.stretch, p)
    return f + f1


def move(m, s, px, py, h):
    """The springs after the handle has moved."""
    table, kept, lost = m.table, 0.0, 0.0
    for i in range(2):
        z, p, before = s.axis[i], py if i else px, s.axis[i].rest
        z.rest, f, kept0, lost0 = law.spring_step(z.k, z.k_limit, z.way, z.rest, p)
        z.stretch, f1, kept1, lost1 = law.relaxing_step(z.k1, z.tau, z.way, z.stretch, p - z.at, h)
        kept, lost = kept + (kept0 + kept1), lost + (lost0 + lost1)
        z.at, z.force = p, f + f1
        if h > 0.0:
            z.force_before = z.force
        if z.way != 0.0 and z.rest != before:
            table[dent_place(m, s, i)] = z.rest
    s.springs_dissipated, s.springs_stored = s.springs_dissipated + lost, kept


def dent_place(m, s, i):
    """Where the dent of a surface is noted in the table."""
    return regions.spring_place(m.table, i, s.x.index, s.y.index) + regions.SPRING - 1


def enter(m, s, px, py, crossed):
    """The springs of a region that the handle enters; those left behind lose their energy."""
    most = 0.0
    for i in range(2):
        z, p = s.axis[i], py if i else px
        if i == crossed and m.stiff == 0 and is_outside(z, p):
            z.old = z.old_rate = 0.0  # it has let go before
        at = regions.spring_place(m.table, i, s.x.index, s.y.index)
        z.rest, z.way = rest_on_entry(m.table, z, at, p, i == crossed, crossed < 0)
        z.k, z.k_limit, z.k1, z.tau = m.table[at], m.table[at + 1], m.table[at + 2], m.table[at + 3]
        z.stretch, z.at, z.force_before, z.force = 0.0, p, z.force, 0.0
        most = max(most, z.k + z.k1)
    s.springs_dissipated, s.springs_stored = s.springs_dissipated + s.springs_stored, 0.0
    s.spring_step = m.spring_step if most > 0.0 and m.springs == 1 else math.inf
    if most > 0.0:
        move(m, s, px, py, 0.0)


def is_outside(z, p):
    """Whether the handle has left a surface by its border: z has that surface, and new borders."""
    return z.way != 0.0 and (z.way > 0.0) == (z.high - p < p - z.low)


def rest_on_entry(table, z, at, p, crosses, begins):
    """Rest of the spring of an axis [m], and the direction in which a surface pushes."""
    if table[at + 4] <= 0.0:
        return p, 0.0
    up = p - z.low <= z.high - p  # pushed from the border that is nearer
    way, border = 1.0 if up else -1.0, z.low if up else z.high
    rest = border if crosses else p  # else the tool is in it already, at rest
    dented = table[at + regions.SPRING - 1]
    if dented == dented and way * (dented - rest) > 0.0:
        rest = dented
    if begins and way * (rest - border) > 0.0:
        table[at + regions.SPRING - 1] = rest
    return rest, way
