"""Where modes of yielding clay begin and end: the accurate method ends a step there."""

from __future__ import annotations

from ..model import regions
from . import modes as m_
from .instant import instant, moment
from .march import axis_of, point_of
from .modes import FREE, NONE, RESTS, SLIDING, TURNED_IN
from .parts import INF
from .search import MODE_X, felt_behind, find_root
from .state import Body, Course, Grip, Modes, State


def with_modes(s, modes):
    x = s.loop
    loop = Course(x.x, x.y, x.form, x.left, x.share, modes)
    return State(s.clock, s.body, loop, s.clay, s.work, s.status, s.filled)


def moving(modal, part, body, v):
    """The arm with another velocity of the handle along the axes of the clay."""
    w = NONE
    if v[0] != 0.0 or v[1] != 0.0:
        w = m_.joint_rates(modal, part, body.q, v)
    return Body(body.q, w, body.g)


def evaluate_contact(parts, s, body, modes):
    """What yielding clay does now, in these modes."""
    when = moment(parts.accurate.ahead, s.clock.t, 0.0, -1)
    return instant(parts, when, point_of(body, s.loop), s.clay, modes).grip


# ---- where they begin ----------------------------------------------------------------------------


def law_of(table, index):
    """Fy, K, n of x, then of y, of a region."""
    ax, bx, cx = regions.enter_flow(table, 0, index[0], index[1])
    ay, by, cy = regions.enter_flow(table, 1, index[0], index[1])
    return ax, bx, cx, ay, by, cy


def acted(modal, parts, s, after):
    """The state with the modes of the next step, and the step length that they allow [s].

    A handle that is nearly at rest is put to rest.
    """
    if modal is None:
        return s, after
    m = s.loop.modes
    law = law_of(parts.table, s.clay.region.index)
    m = Modes(law, m.mode, m.way, m.anchor, m.ended, NONE, m.stuck, m.fine)
    body, m, x = chosen(modal.along, parts, s, m)
    fine = max(m_.longest_step(modal.along, m, x, x.v), m_.shortest_step(modal.dt, s.clock.t))
    m = Modes(law, m.mode, m.way, m.anchor, m.ended, NONE, m.stuck, fine)
    s = with_modes(State(s.clock, body, s.loop, s.clay, s.work, s.status, s.filled), m)
    return s, min(after, fine)


def first_mode(m, i, v):
    """Mode of an axis at its velocity, and whether it is at rest, so that the mode is open."""
    mode, ended = m.mode[i], abs(m.ended[i])
    if not m_.is_active(m.law, i):
        return 1.0, False
    if ended == FREE or mode == 0.0 or ended == RESTS or v == 0.0:
        return mode, True
    return (1.0 if v > 0.0 else -1.0), False


def tried_mode(k, rests, ended, mode):
    """The k-th mode to try: the present one, unless the axis rests; the first is rest."""
    if not rests:
        return mode
    if abs(ended) == FREE:
        return 1.0 if ended > 0.0 else -1.0
    return 0.0 if k == 0 else 1.0 if k == 1 else -1.0


def chosen(along, parts, s, m):
    """The arm, the modes in which the clay acts from now on, and its action in them."""
    if along is None:
        return chosen_axes(parts, s, m)
    return chosen_way(parts, s, m)


def chosen_axes(parts, s, m):
    """The same for clay whose axes yield separately."""
    modal, body = parts.modal, s.body
    v = m_.velocity(modal, parts.arm, body.q, body.w)
    (x, restx), (y, resty) = first_mode(m, 0, v[0]), first_mode(m, 1, v[1])
    m = m_.with_mode(m, x, y)
    grip = evaluate_contact(parts, s, body, m)
    restx, resty = rests_now(modal, m.law, grip, 0, restx), rests_now(modal, m.law, grip, 1, resty)
    if not (restx or resty):
        return body, m, grip
    at, anchor = m_.place_of(modal, parts.arm, body.q), m.anchor
    anchor = at[0] if restx and x != 0.0 else anchor[0], at[1] if resty and y != 0.0 else anchor[1]
    if (restx and v[0] != 0.0) or (resty and v[1] != 0.0):
        body = moving(modal, parts.arm, body, (0.0 if restx else v[0], 0.0 if resty else v[1]))
    m = Modes(m.law, m.mode, m.way, anchor, m.ended, m.ends, m.stuck, m.fine)
    m, grip = fitting(parts, s, body, m, restx, resty)
    return body, m, grip


def rests_now(modal, law, grip, i, rests):
    """Whether an axis has no velocity, or nearly none."""
    if rests or not m_.is_active(law, i):
        return rests
    return m_.is_nearly_at_rest(modal.along, modal, law, grip, i)


def fitting(parts, s, body, m, restx, resty):
    """The consistent ones of the nine pairs of modes, and what the clay does in them.

    A consistent pair agrees with its own accelerations.

    Args:
        restx: whether x has no velocity.
        resty: whether y has none.
    """
    modal, (x, y), (endx, endy) = parts.modal, m.mode, m.ended
    openx, openy = restx and abs(endx) != FREE, resty and abs(endy) != FREE
    least, tried, last = INF, 0, 9
    best, chosen = m_.with_mode(m, 0.0, 0.0), Grip(NONE, (0.0, 0.0, 0.0, 0.0), NONE, NONE)
    while tried < last:
        j, k = tried // 3, tried % 3
        tried += 1
        if (j > 0 and not restx) or (k > 0 and not resty):
            continue
        m = m_.with_mode(m, tried_mode(j, restx, endx, x), tried_mode(k, resty, endy, y))
        grip = evaluate_contact(parts, s, body, m)
        wrongx = m_.misfit(modal, m, grip, 0) if openx else 0.0
        wrongy = m_.misfit(modal, m, grip, 1) if openy else 0.0
        wrong = max(wrongx, wrongy)
        if wrong < least:
            least, best, chosen = wrong, m, grip
        if least <= 0.0:
            break
    return best, chosen


def chosen_way(parts, s, m):
    """The same for clay that resists along the motion; a slow handle follows its push."""
    modal, body, ended = parts.modal, s.body, m.ended[0]
    v, active = m_.velocity(modal, parts.arm, body.q, body.w), m_.is_active(m.law, 0)
    rests = active and (m.mode[0] == 0.0 or ended != 0.0 or (v[0] == 0.0 and v[1] == 0.0))
    m = m_.with_way(m, 0.0 if rests else SLIDING, m.way)
    grip = evaluate_contact(parts, s, body, m)
    if not active:
        return body, m, grip
    if not rests and m_.is_nearly_at_rest(modal.along, modal, m.law, grip, 0):
        rests, m = True, m_.with_way(m, 0.0, m.way)
    if rests:
        v, body = NONE, moving(modal, parts.arm, body, NONE)
        grip = evaluate_contact(parts, s, body, m)
        if ended != FREE and m_.gap(modal.along, modal, m, grip, 0) >= 0.0:
            return body, m, grip
        m = m_.with_way(m, SLIDING, m_.set_out(m, grip))
        grip = evaluate_contact(parts, s, body, m)
    speed, way = m_.way_of(m, v)
    m = m_.with_way(m, SLIDING, way)
    if not m_.is_turned_in(modal.dt, m.law, grip, way):
        return body, m, grip
    way = m_.turned_in(m.law, grip, speed, way)
    m = m_.with_way(m, TURNED_IN, way)
    if speed > 0.0:
        body = moving(modal, parts.arm, body, (speed * way[0], speed * way[1]))
    return body, m, evaluate_contact(parts, s, body, m)


# ---- where they end ------------------------------------------------------------------------------


def leaves_mode(modal, part, m, k):
    """Whether a step along the motion reverses, or leaves the speed range of its mode."""
    v, mode = m_.velocity(modal, part, k.end.q, k.end.w), m.mode[0]
    along = v[0] * m.way[0] + v[1] * m.way[1]
    if mode == SLIDING:
        return along < 0.0
    if mode != TURNED_IN:
        return False
    turns = m_.strength(m.law, 0, along) * m_.across(k.last.B, m.way)
    return m_.TURN * along > 2.0 * m_.TURNING * modal.dt * turns


def ending(modal, s, ends):
    """The state with what ends the step."""
    if modal is None:
        return s
    m = s.loop.modes
    m = Modes(m.law, m.mode, m.way, m.anchor, m.ended, ends, m.stuck, m.fine)
    return with_modes(s, m)


def met(modal, probe, parts, s, k, after):
    """A step shortened to where a mode first ends, as detected at its end.

    Args:
        modal: the part.
        probe: of the engine.
        parts: the scene.
        s: the state.
        k: the step.
        after: its length [s].

    Returns:
        The state with what ends the step; length of the step [s]; whether that is another one.
    """
    if modal is None:
        return s, after, False
    m, shortest = s.loop.modes, m_.shortest_step(modal.dt, s.clock.t)
    if m.ends[0] != 0.0 or m.ends[1] != 0.0:
        return s, after, False
    if after > shortest and strays_along(modal.along, modal, parts.arm, m, k):
        return s, max(0.5 * after, shortest), True
    v = m_.velocity(modal, parts.arm, k.end.q, k.end.w)
    watched = may_end(modal.along, m, v, 0), may_end(modal.along, m, v, 1)
    if not (watched[0] or watched[1]):
        return s, after, False
    grip, span, ends = felt_behind(parts, s, k, after), INF, NONE
    for i in range(2):
        gap = m_.gap(modal.along, modal, m, grip, i) if watched[i] else 0.0
        if gap < 0.0:
            h = find_root(after, gap, probe, parts, s, MODE_X + i, 0.0)
            if h < span:
                span, end = h, end_of_mode(modal.along, m, grip, i)
                ends = (end, 0.0) if i == 0 else (0.0, end)
    if span == INF:
        return s, after, False
    return ending(modal, s, ends), min(max(span, shortest), after), True


def end_of_mode(along, m, grip, i):
    """What ends the mode of an axis, by the clay at the end of a longer step."""
    if m.mode[i] != 0.0:
        return RESTS
    if axis_of(along) > 0.0 or grip.f[i] > 0.0:
        return FREE
    return -FREE


def strays_along(along, modal, part, m, k):
    """The same for any clay; other clay gives the handle no direction to keep."""
    if along is None:
        return False
    return m_.is_active(m.law, 0) and leaves_mode(modal, part, m, k)


def may_end(along, m, v, i):
    """Whether the mode of an axis may end in a step that leads to a velocity v."""
    if along is None:
        return m_.is_active(m.law, i) and (m.mode[i] == 0.0 or m.mode[i] * v[i] < 0.0)
    return i == 0 and m_.is_active(m.law, 0) and m.mode[0] != SLIDING
