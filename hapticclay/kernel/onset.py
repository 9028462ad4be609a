"""Where modes of yielding clay begin: the accurate method chooses them before each step."""

import math

from ..formulas import regions
from . import instant, march, modes


def evaluate(m, s):
    """What yielding clay does now, in the modes of the state."""
    march.start(m, s, s.a.z)
    instant.evaluate(m, s, s.a.z, 0.0, -1, s.a.now)
    return s.a.now.grip


def set_velocity(m, s, vx, vy):
    """Gives the arm another velocity of the handle along the axes of the clay."""
    s.w[0] = s.w[1] = 0.0
    if vx != 0.0 or vy != 0.0:
        s.w[0], s.w[1] = modes.joint_rates(m, s, s.q[0], s.q[1], vx, vy)


def choose_modes(m, s, after):
    """Puts the modes of the next step into the state; the step length that they allow [s]."""
    for i in range(2):
        a = s.mode[i]
        a.Fy, a.Kn, a.n = regions.enter_flow(m.table, i, s.x.index, s.y.index)
        a.ends = 0.0
    if m.modal == 2:
        choose_way(m, s)
    else:
        choose_axes(m, s)
    grip = s.a.now.grip
    allowed = modes.longest_step(m, s, grip, grip.x.v, grip.y.v)
    s.mode_step = max(allowed, modes.shortest_step(m, s))
    return min(after, s.mode_step)


def first_mode(s, i, v):
    """Mode of an axis at its velocity, and whether it is at rest, so that the mode is open."""
    a = s.mode[i]
    ended = abs(a.ended)
    if not modes.is_active(s, i):
        return 1.0, False
    if ended == modes.FREE or a.mode == 0.0 or ended == modes.RESTS or v == 0.0:
        return a.mode, True
    return 1.0 if v > 0.0 else -1.0, False


def tried_mode(j, is_open, ended, mode):
    """The j-th mode to try: the present one, unless the axis rests; the first is rest."""
    if not is_open:
        return mode
    if abs(ended) == modes.FREE:
        return 1.0 if ended > 0.0 else -1.0
    return 0.0 if j == 0 else 1.0 if j == 1 else -1.0


def choose_axes(m, s):
    """Puts the modes of clay whose axes yield separately."""
    x, y = s.mode[0], s.mode[1]
    vx, vy = modes.velocity(m, s, s.q[0], s.q[1], s.w[0], s.w[1])
    x.mode, restx = first_mode(s, 0, vx)
    y.mode, resty = first_mode(s, 1, vy)
    grip = evaluate(m, s)
    restx = restx or (modes.is_active(s, 0) and modes.is_nearly_at_rest(m, s, grip, 0))
    resty = resty or (modes.is_active(s, 1) and modes.is_nearly_at_rest(m, s, grip, 1))
    if not (restx or resty):
        return
    px, py = modes.place_of(m, s.q[0], s.q[1])
    if restx and x.mode != 0.0:
        x.anchor = px
    if resty and y.mode != 0.0:
        y.anchor = py
    if (restx and vx != 0.0) or (resty and vy != 0.0):
        set_velocity(m, s, 0.0 if restx else vx, 0.0 if resty else vy)
    fit_modes(m, s, restx, resty)


def fit_modes(m, s, restx, resty):
    """Puts the consistent ones of the nine pairs of modes; where none is, those that fit best."""
    x, y, endx, endy = s.mode[0], s.mode[1], s.mode[0].ended, s.mode[1].ended
    nowx, nowy = x.mode, y.mode
    openx, openy = restx and abs(endx) != modes.FREE, resty and abs(endy) != modes.FREE
    least, bestx, besty = math.inf, 0.0, 0.0
    for pair in range(9):
        j, k = pair // 3, pair % 3
        if (j > 0 and not restx) or (k > 0 and not resty):
            continue
        modes.put(s, tried_mode(j, restx, endx, nowx), tried_mode(k, resty, endy, nowy))
        grip = evaluate(m, s)
        wrongx = modes.violation(m, s, grip, 0) if openx else 0.0
        wrongy = modes.violation(m, s, grip, 1) if openy else 0.0
        wrong = max(wrongx, wrongy)
        if wrong < least:
            least, bestx, besty = wrong, x.mode, y.mode
        if least <= 0.0:
            break
    if x.mode != bestx or y.mode != besty:
        modes.put(s, bestx, besty)
        evaluate(m, s)


def choose_way(m, s):
    """Puts the modes of clay that resists along the motion; a slow handle follows its push."""
    a, ended = s.mode[0], s.mode[0].ended
    vx, vy = modes.velocity(m, s, s.q[0], s.q[1], s.w[0], s.w[1])
    active = modes.is_active(s, 0)
    rests = active and (a.mode == 0.0 or ended != 0.0 or (vx == 0.0 and vy == 0.0))
    modes.put(s, 0.0 if rests else modes.SLIDING, 0.0 if rests else modes.SLIDING)
    grip = evaluate(m, s)
    if not active:
        return
    if not rests and modes.is_nearly_at_rest(m, s, grip, 0):
        rests = True
        modes.put(s, 0.0, 0.0)
    if rests:
        vx = vy = 0.0
        set_velocity(m, s, 0.0, 0.0)
        grip = evaluate(m, s)
        if ended != modes.FREE and modes.gap(m, s, grip, 0) >= 0.0:
            return
        wayx, wayy = modes.direction_of_onset(s, grip)
        modes.put_way(s, modes.SLIDING, wayx, wayy)
        grip = evaluate(m, s)
    speed, wayx, wayy = modes.way_of(s, vx, vy)
    modes.put_way(s, modes.SLIDING, wayx, wayy)
    if not modes.is_turned_in(m, s, grip, wayx, wayy):
        return
    wayx, wayy = modes.turned_in(s, grip, speed, wayx, wayy)
    modes.put_way(s, modes.TURNED_IN, wayx, wayy)
    if speed > 0.0:
        set_velocity(m, s, speed * wayx, speed * wayy)
    evaluate(m, s)
