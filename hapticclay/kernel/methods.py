"""The methods that advance a run: what differs between them, a line for each.

| | continuous | sampled | accurate |
|---|---|---|---|
| a step is tried by | `kick.by_servo` | `sampled.by_hold` | `march.march` |
| into | `s.k` | `s.k`, after `s.e` | `s.a` |
| it may end | at a sample | at an event too | within a sample |
"""

from . import arm, joints, kick, march, onset, rows, sampled, servo, signals, yielding

CONTINUOUS, SAMPLED, ACCURATE = range(3)


def control(m, s):
    """Lets sampled control act at the beginning of a step."""
    if m.method == SAMPLED:
        sampled.act(m, s)


def attempt(m, s, after):
    """Tries a step of length `after`."""
    if m.method == ACCURATE:
        march.march(m, s, after)
    elif m.method == SAMPLED:
        sampled.by_hold(m, s, s.k, after)
    else:
        kick.by_servo(m, s, s.k, after)


def place_after(m, s, after):
    """Position of the handle after the step tried, (x, y) [m]."""
    if m.method == ACCURATE:
        return arm.place(m, s.a.end.q1, s.a.end.q2)
    k = s.k
    if m.general:
        return joints.place_after(m, s, after)
    return arm.place(m, s.q[0] + after * k.w[0], s.q[1] + after * k.w[1])


def is_sound(m, s):
    """Whether the step tried ends with rates of an arm."""
    if m.method == ACCURATE:
        return march.is_finite(s.a.end)
    total = abs(s.k.w[0])
    for i in range(1, m.joints):
        total += abs(s.k.w[i])
    return total < march.FASTEST


def keep(m, s, after, shows):
    """Keeps the results of the step tried: its row, if now is a sample, and its works."""
    if m.method == ACCURATE:
        if shows:
            march.write(m, s)
            s.row += 1
    else:
        rows.keep(m, s, s.k, after, shows, is_sound(m, s))  # without works that no motion has


def take(m, s, after):
    """Takes the step tried: the engine makes it; controller and arm become those after it."""
    if m.method == ACCURATE:
        march.take(m, s)
        return
    k, even = s.k, m.method == CONTINUOUS and s.before == after
    if m.acts and m.special and m.flow:
        if s.at_event:
            yielding.note(m, s, s.e)
        yielding.note(m, s, k)
    if m.method == SAMPLED:
        sampled.take(m, s)
    else:
        servo.take(m, s, k)
        if m.command:
            signals.add_command(m, s, k)
    if m.special and m.acts:
        for i in range(2):
            z, o = s.axis[i], k.axis[i]
            z.owed, z.stuck, z.anchor = o.owed, o.stuck, o.anchor
    if m.general:
        joints.step(m, s, k, after)
        return
    s.g[0], s.g[1] = k.g[0], k.g[1]
    arm.step_engine(m, s, k, after, even)
    if k.still > 0.0:  # the engine's rounding would let it creep
        w = m.engine.w
        w[0] = w[1] = s.w[0] = s.w[1] = 0.0


def halt(m, s):
    """The state after the last kick of a run, at its sample."""
    if m.method != ACCURATE:
        for i in range(m.joints):
            s.w[i], s.g[i] = s.k.w[i], s.k.g[i]
        s.before = 0.0


def arrive(m, s):
    """Velocity at the end of the step that led here, on its side of a border, (x, y) [m/s]."""
    k = s.k
    if m.method == ACCURATE:
        arm.handle_at(m, k, s.q[0], s.q[1], s.w[0], s.w[0] + s.w[1])
        return k.x.v, k.y.v
    rows.repeat(m, s, k, 0.0)
    vx, vy, _, _ = rows.arrived(m, s, kick.velocity(m, k, 0), kick.velocity(m, k, 1), 0.0, 0.0)
    return vx, vy


def pace(m, s, target, after, on_grid):
    """Length of the next step towards a stop that is `after` away [s]."""
    if m.method == ACCURATE:
        return march.pace(m, s, target, after, on_grid)
    return after


def bound(m, s, after):
    """Length of a step, bounded by what begins with it [s]."""
    if m.method == ACCURATE and m.modal:
        return onset.choose_modes(m, s, after)
    return after
