"""Where modes of yielding clay end: the accurate method ends a step there."""

import math

from . import march, methods, modes, search


def put_ends(s, endx, endy):
    """Puts what ends the step."""
    s.mode[0].ends, s.mode[1].ends = endx, endy


def leaves_mode(m, s, vx, vy):
    """Whether the step tried, along the motion, reverses or leaves the speed range of its mode."""
    a, b = s.mode[0], s.mode[1]
    speed = vx * a.way + vy * b.way
    if a.mode == modes.SLIDING:
        return speed < 0.0
    if a.mode != modes.TURNED_IN:
        return False
    turns = modes.strength(s, 0, speed) * modes.turning(s.a.last.B, a.way, b.way)
    return modes.TURN * speed > 2.0 * modes.TURNING * m.dt * turns


def shorten_to_end(m, s, after):
    """Shortens the step tried to where a mode first ends, as detected at its end."""
    x, y, shortest = s.mode[0], s.mode[1], modes.shortest_step(m, s)
    if x.ends != 0.0 or y.ends != 0.0:
        return after, False
    z = s.a.end
    vx, vy = modes.velocity(m, s, z.q1, z.q2, z.w1, z.w2)
    strays = m.modal == 2 and modes.is_active(s, 0)
    if after > shortest and strays and leaves_mode(m, s, vx, vy):
        return max(0.5 * after, shortest), True
    watchx, watchy = may_end(m, s, vx, 0), may_end(m, s, vy, 1)
    if not (watchx or watchy):
        return after, False
    march.evaluate_end(m, s, after)
    grip, span, endx, endy = s.a.now.grip, math.inf, 0.0, 0.0
    gapx = modes.gap(m, s, grip, 0) if watchx else 0.0
    gapy = modes.gap(m, s, grip, 1) if watchy else 0.0
    freex, freey = end_of_mode(m, s, grip, 0), end_of_mode(m, s, grip, 1)
    if gapx < 0.0:
        span = search.find_root(m, s, after, gapx, search.MODE_X, 0.0)
        endx = freex
    if gapy < 0.0:
        h = search.find_root(m, s, after, gapy, search.MODE_X + 1, 0.0)
        if h < span:
            span, endx, endy = h, 0.0, freey
    if span == math.inf:
        return after, False
    put_ends(s, endx, endy)
    return min(max(span, shortest), after), True


def end_of_mode(m, s, grip, i):
    """What ends the mode of an axis, by the clay at the end of a longer step."""
    if s.mode[i].mode != 0.0:
        return modes.RESTS
    if m.modal == 2 or grip.axis[i].f > 0.0:
        return modes.FREE
    return -modes.FREE


def may_end(m, s, v, i):
    """Whether the mode of an axis may end in a step that leads to a velocity v."""
    mode = s.mode[i].mode
    if m.modal == 2:
        return i == 0 and modes.is_active(s, 0) and s.mode[0].mode != modes.SLIDING
    return modes.is_active(s, i) and (mode == 0.0 or mode * v < 0.0)


# ---- whole steps ---------------------------------------------------------------------------------


def is_calm(m, s, after):
    """Whether the step tried ends within its region and keeps its modes."""
    z, x, y = s.a.end, s.x, s.y
    if not march.is_finite(z):
        return False
    px, py = methods.place_after(m, s, after)
    touch = march.TOUCH
    if not (x.low - touch <= px and px <= x.high + touch):
        return False
    if not (y.low - touch <= py and py <= y.high + touch):
        return False
    if not m.modal:
        return True
    vx, vy = modes.velocity(m, s, z.q1, z.q2, z.w1, z.w2)
    return s.mode[0].mode != modes.TURNED_IN and modes.goes_on(m, s, after, vx, vy)
