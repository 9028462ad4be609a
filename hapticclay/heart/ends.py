"""Where modes of clay that yields begin and end: the accurate method ends a step there."""

from __future__ import annotations

from . import modes as m_
from .borders import find_root
from .instant import instant
from .march import march
from .modes import FREE, NONE, RESTS, SLIDING, TURNED_IN
from .parts import INF
from .state import Body, Clock, Course, Modes, Point, State, Stride


def with_modes(s, modes):
    x = s.loop
    loop = Course(x.x, x.y, x.form, x.left, x.share, modes)
    return State(s.clock, s.body, loop, s.clay, s.work, s.status, s.filled)


def moving(parts, s, v):
    """The state with another velocity of the handle along the axes of the clay."""
    q, w = s.body.q, NONE
    if v[0] != 0.0 or v[1] != 0.0:
        w = m_.joint_rates(parts.accurate.modal, parts.arm, q, v)
    return State(s.clock, Body(q, w, s.body.g), s.loop, s.clay, s.work, s.status, s.filled)


def feel(parts, s, modes):
    """What clay that yields does now, in these modes."""
    x = s.loop
    return instant(parts, s.clock.t, Point(s.body.q, s.body.w, x.x, x.y, x.form), s.clay, modes).grip


# ---- where they begin ----------------------------------------------------------------------------


def acted(accurate, parts, s, after):
    """The state with the modes of the next step, and the length that they allow it [s]."""
    if accurate is None:
        return s, after
    return chosen(accurate.modal, parts, s, after)


def chosen(modal, parts, s, after):
    """The same; the handle is put to rest where it nearly is."""
    if modal is None:
        return s, after
    law = s.clay.special.felt.law
    s, x = chosen_by(modal.along, parts, s, law)
    m = s.loop.modes
    fine = max(m_.longest_step(modal.along, m, law, x, x.v), m_.shortest_step(modal.dt, s.clock.t))
    return with_modes(s, Modes(m.mode, m.way, m.anchor, m.ended, fine)), min(after, fine)


def chosen_by(along, parts, s, law):
    """The state with its modes, and what the clay does in them."""
    if along is None:
        return chosen_axes(parts, s, law)
    return chosen_way(parts, s, law)


def first_mode(m, law, i, v):
    """Mode of an axis at its velocity, and whether it has none, so that its mode is open."""
    mode, ended = m.mode[i], abs(m.ended[i])
    if not m_.is_active(law, i):
        return 1.0, False
    if ended == FREE or mode == 0.0 or ended == RESTS or v == 0.0:
        return mode, True
    return (1.0 if v > 0.0 else -1.0), False


def tried_mode(k, rests, ended, now):
    """The k-th mode to be tried: the present one unless the axis rests; the first is rest."""
    if not rests:
        return now
    if abs(ended) == FREE:
        return 1.0 if ended > 0.0 else -1.0
    return 0.0 if k == 0 else 1.0 if k == 1 else -1.0


def chosen_axes(parts, s, law):
    """As `chosen_by`, of clay whose axes yield each by itself."""
    modal, m, q = parts.accurate.modal, s.loop.modes, s.body.q
    v = m_.velocity(modal, parts.arm, q, s.body.w)
    (x, restx), (y, resty) = first_mode(m, law, 0, v[0]), first_mode(m, law, 1, v[1])
    m = m_.with_mode(m, x, y)
    grip = feel(parts, s, m)
    restx, resty = rests_now(modal, law, grip, 0, restx), rests_now(modal, law, grip, 1, resty)
    if not (restx or resty):
        return with_modes(s, m), grip
    at, anchor = m_.place_of(modal, parts.arm, q), m.anchor
    anchor = at[0] if restx and x != 0.0 else anchor[0], at[1] if resty and y != 0.0 else anchor[1]
    if (restx and v[0] != 0.0) or (resty and v[1] != 0.0):
        s = moving(parts, s, (0.0 if restx else v[0], 0.0 if resty else v[1]))
    m = Modes(m.mode, m.way, anchor, m.ended, m.fine)
    m = fitting(parts, s, law, m, restx, resty)
    return with_modes(s, m), feel(parts, s, m)


def rests_now(modal, law, grip, i, rests):
    """Whether an axis has no velocity, or nearly none."""
    if rests or not m_.is_active(law, i):
        return rests
    return m_.is_nearly_at_rest(modal.along, modal, law, grip, i)


def fitting(parts, s, law, m, restx, resty):
    """Of the nine pairs of modes, those that agree with their own accelerations."""
    modal, (x, y), (endx, endy) = parts.accurate.modal, m.mode, m.ended
    least, best = INF, NONE
    openx, openy = restx and abs(endx) != FREE, resty and abs(endy) != FREE
    for j in range(3 if restx else 1):
        for k in range(3 if resty else 1):
            if least <= 0.0:
                continue
            m = m_.with_mode(m, tried_mode(j, restx, endx, x), tried_mode(k, resty, endy, y))
            grip = feel(parts, s, m)
            wrongx = m_.misfit(modal, m, law, grip, 0) if openx else 0.0
            wrongy = m_.misfit(modal, m, law, grip, 1) if openy else 0.0
            wrong = max(wrongx, wrongy)
            if wrong < least:
                least, best = wrong, m.mode
    return m_.with_mode(m, best[0], best[1])


def chosen_way(parts, s, law):
    """As `chosen_by`, of clay that resists along the motion."""
    modal, m, ended = parts.accurate.modal, s.loop.modes, s.loop.modes.ended[0]
    slides = m_.with_mode(m, SLIDING, SLIDING)
    if not m_.is_active(law, 0):
        return with_modes(s, slides), feel(parts, s, slides)
    v = m_.velocity(modal, parts.arm, s.body.q, s.body.w)
    rests = m.mode[0] == 0.0 or ended != 0.0 or (v[0] == 0.0 and v[1] == 0.0)
    grip = feel(parts, s, m if rests else slides)
    if not rests:
        rests = m_.is_nearly_at_rest(modal.along, modal, law, grip, 0)
    if rests:
        if v[0] != 0.0 or v[1] != 0.0:
            v, s = NONE, moving(parts, s, NONE)
        m = m_.with_mode(m, 0.0, 0.0)
        grip = feel(parts, s, m)
        if ended != FREE and m_.gap(modal.along, modal, m, law, grip, 0) >= 0.0:
            return with_modes(s, m), grip
        slides = m_.with_way(slides, m_.set_out(m, law, grip))
        grip = feel(parts, s, slides)
    return led(parts, s, law, slides, grip, v)


def led(parts, s, law, m, grip, v):
    """The state of a handle that slides; a slow one keeps the direction of its push."""
    modal = parts.accurate.modal
    speed, way = m_.way_of(m, v)
    m = m_.with_way(m, way)
    if not m_.is_turned_in(modal.dt, law, grip, way):
        return with_modes(s, m), grip
    way = m_.turned_in(law, grip, speed, way)
    m = m_.with_way(m_.with_mode(m, TURNED_IN, TURNED_IN), way)
    if speed > 0.0:
        s = moving(parts, s, (speed * way[0], speed * way[1]))
    return with_modes(s, m), feel(parts, s, m)


# ---- where they end ------------------------------------------------------------------------------


def felt_behind(parts, s, k, h):
    """What clay that yields does at the end of a step of length h, in its modes."""
    c, body, modes = s.clock, Body(k.q, k.w, s.body.g), s.loop.modes
    behind = State(Clock(c.t + h, c.i, h), body, k.loop, s.clay, s.work, s.status, s.filled)
    return feel(parts, behind, modes)


def gap_behind(h, probe, parts, s, i):
    """As modes.gap, at the end of a step of length h."""
    modal, law = parts.accurate.modal, s.clay.special.felt.law
    grip = felt_behind(parts, s, march(probe, parts, s, h), h)
    return m_.gap(modal.along, modal, s.loop.modes, law, grip, i)


def strays(parts, s, k):
    """Whether a step along the motion turns back, or leaves the speeds of its mode."""
    modal, m, law = parts.accurate.modal, s.loop.modes, s.clay.special.felt.law
    v, mode = m_.velocity(modal, parts.arm, k.q, k.w), m.mode[0]
    along = v[0] * m.way[0] + v[1] * m.way[1]
    if mode == SLIDING:
        return along < 0.0
    if mode != TURNED_IN:
        return False
    turns = m_.strength(law, 0, along) * m_.across(k.grip.B, m.way)
    return m_.TURN * along > 2.0 * m_.TURNING * modal.dt * turns


def met(probe, parts, s, k, after, lands):
    """A step shortened to where a mode first ends, which its end tells; its length [s].

    Args:
        probe: of the engine.
        parts: the scene.
        s: the state.
        k: the step.
        after: its length [s].
        lands: whether it ends on a border, and is not to be shortened.
    """
    if probe is None:
        return k, after
    return modes_met(parts.accurate.modal, probe, parts, s, k, after, lands)


def modes_met(modal, probe, parts, s, k, after, lands):
    if modal is None:
        return k, after
    if lands or after == 0.0 or not abs(k.w[0]) + abs(k.w[1]) < INF:
        return k, after
    return met_by(modal.along, probe, parts, s, k, after)


def met_by(along, probe, parts, s, k, after):
    if along is None:
        x = axis_end(probe, parts, s, k, after, 0)
        y = axis_end(probe, parts, s, k, after, 1)
        return first_end(probe, parts, s, k, after, x, y)
    k, after = on_its_way(probe, parts, s, k, after)
    x = INF if s.loop.modes.mode[0] == SLIDING else mode_end(probe, parts, s, k, after, 0)
    return first_end(probe, parts, s, k, after, x, INF)


def on_its_way(probe, parts, s, k, after):
    """A step along the motion that does not stray; its length [s]."""
    shortest = m_.shortest_step(parts.time.dt, s.clock.t)
    if not m_.is_active(s.clay.special.felt.law, 0):
        return k, after  # here the handle has no way to keep to
    while after > shortest and strays(parts, s, k):
        after = max(0.5 * after, shortest)
        k = march(probe, parts, s, after)
    return k, after


def axis_end(probe, parts, s, k, after, i):
    """Length of a step at which the mode of an axis ends, INF where it does not [s]."""
    mode = s.loop.modes.mode[i]
    if mode != 0.0:
        v = m_.velocity(parts.accurate.modal, parts.arm, k.q, k.w)
        if mode * v[i] >= 0.0:
            return INF
    return mode_end(probe, parts, s, k, after, i)


def mode_end(probe, parts, s, k, after, i):
    modal, law = parts.accurate.modal, s.clay.special.felt.law
    if not m_.is_active(law, i):
        return INF
    grip = felt_behind(parts, s, k, after)
    gap = m_.gap(modal.along, modal, s.loop.modes, law, grip, i)
    if gap >= 0.0:
        return INF
    return find_root(gap_behind, after, gap, probe, parts, s, i)


def first_end(probe, parts, s, k, after, x, y):
    """The step to the first of two ends of modes; its length [s]."""
    span = min(x, y)
    if span == INF:
        return k, after
    span = min(max(span, m_.shortest_step(parts.time.dt, s.clock.t)), after)
    k = march(probe, parts, s, span)
    i, end = (0, RESTS) if x <= y else (1, RESTS)
    if s.loop.modes.mode[i] == 0.0:
        grip, along = felt_behind(parts, s, k, span), parts.accurate.modal.along
        end = FREE if is_along(along) or grip.f[i] > 0.0 else -FREE
    x = k.loop
    modes = m_.with_end(x.modes, (end, 0.0) if i == 0 else (0.0, end))
    loop = Course(x.x, x.y, x.form, x.left, x.share, modes)
    return Stride(k.now, k.grip, k.q, k.w, loop, k.work), span


def is_along(along):
    if along is None:
        return False
    return True
