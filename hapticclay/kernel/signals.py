"""The muscle force over time, and the command: prepared for whole steps, evaluated elsewhere."""

from ..formulas import pieces


def is_on_grid(m, s):
    """Whether now is a sample."""
    return s.t == s.i * m.dt


# ---- the muscle ----------------------------------------------------------------------------------


def push(m, s, k):
    """Mean muscle force over a kick."""
    t = s.t + 0.25 * (k.after - k.before) - m.push_since
    for i in range(m.axes):
        a = m.axis[i]
        k.axis[i].uh = a.push + t * a.push_rate
    if m.muscle:
        x, y = muscle_in_kick(m, s, k)
        k.x.uh += x
        k.y.uh += y


def muscle_in_kick(m, s, k):
    """Mean of the muscle's signal over a kick, (x, y) [N]."""
    dt, grid = m.dt, is_on_grid(m, s)
    if grid and k.before == dt and k.after == dt:
        j = 2 * (s.i - m.muscle_first)
        return m.muscle_ahead[j], m.muscle_ahead[j + 1]
    if grid and m.ratio:
        j = 6 * (s.i - m.muscle_first)
        if k.before == dt and k.after == 0.0:
            return m.muscle_halves[j], m.muscle_halves[j + 1]
        if k.before == 0.0 and k.after == dt:
            return m.muscle_halves[j + 2], m.muscle_halves[j + 3]
    t = s.t + 0.25 * (k.after - k.before)
    return pieces.mean_of_table(m.muscle_table, t, 0.5 * k.H)


def push_now(m, s):
    """Muscle force at the beginning of a step in sampled control, (x, y) [N]."""
    t, a, b = s.t - m.push_since, m.x, m.y
    x, y = a.push + t * a.push_rate, b.push + t * b.push_rate
    if not m.muscle:
        return x, y
    if is_on_grid(m, s):
        j = 6 * (s.i - m.muscle_first) + 4
        return x + m.muscle_halves[j], y + m.muscle_halves[j + 1]
    dx, dy = pieces.mean_of_table(m.muscle_table, s.t, 0.0)
    return x + dx, y + dy


# ---- the command ---------------------------------------------------------------------------------


def add_command(m, s, k):
    """Adds the change of the command over a step to the compensators' output."""
    if is_on_grid(m, s) and k.before == m.dt and k.after == m.dt:
        j = 2 * (s.i - m.command_first)
        x, y = m.command_ahead[j], m.command_ahead[j + 1]
    else:
        x, y = command_change(m.command_table, s.t, s.t + k.after, 0.5 * m.dt)
    s.x.delta += x
    s.y.delta += y


def command_over_sample(m, s):
    """Change of the command over a control sample, (x, y) [m]."""
    if not m.command:
        return 0.0, 0.0
    if is_on_grid(m, s):
        j = 2 * (s.i - m.command_first)
        return m.command_ahead[j], m.command_ahead[j + 1]
    return command_change(m.command_table, s.t, s.t + m.Ts, 0.0)


def command_change(table, t0, t1, h):
    """Change of the command between two times, by its mean over h around each, (x, y) [m]."""
    x0, y0 = pieces.mean_of_lines(table, t0, 0.0)
    x1, y1 = pieces.mean_of_lines(table, t1, 0.0)
    if pieces.has_pieces(table):
        ax, ay = pieces.mean_of_pieces(table, t0, min(h, t0))
        bx, by = pieces.mean_of_pieces(table, t1, min(h, t1))
        x1 += bx - ax
        y1 += by - ay
    return x1 - x0, y1 - y0


# ---- of the accurate method ----------------------------------------------------------------------


def push_at(m, t, near, row):
    """Muscle force at a stage of a step, (x, y) [N]; `near`: a time within the step."""
    since, a, b = t - m.push_since, m.x, m.y
    x, y = a.push + since * a.push_rate, b.push + since * b.push_rate
    if not m.muscle:
        return x, y
    if row >= 0:
        return x + m.muscle_ahead[2 * row], y + m.muscle_ahead[2 * row + 1]
    dx, dy = pieces.value_of_table(m.muscle_table, t, near)
    return x + dx, y + dy


def command_at(m, t, near, row):
    """Change of the command since t = 0 at a stage of a step, (x, y) [m]."""
    if row >= 0:
        return m.command_ahead[2 * row], m.command_ahead[2 * row + 1]
    x0, y0 = pieces.mean_of_lines(m.command_table, 0.0, 0.0)
    x1, y1 = pieces.value_of_table(m.command_table, t, near)
    return x1 - x0, y1 - y0
