"""The length at which a step first passes a border, or outlasts a mode."""

from __future__ import annotations

from . import modes as m_
from .instant import instant, moment
from .march import place_behind, worked

X, Y, MODE_X, MODE_Y = range(4)  # what is looked for: coordinates of borders, axes of modes


def gap_behind(probe, parts, s, h, what, border):
    """Distance by which a step of length h would pass a border [m]; of modes see modes.gap."""
    k = worked(probe, parts, s, h)
    return missed(parts.modal, probe, parts, s, k, h, what, border)


def missed(modal, probe, parts, s, k, h, what, border):
    """The same of a step worked out."""
    if modal is None:
        return place_behind(probe, parts.arm, s.body.q, k, h)[what] - border
    if what < MODE_X:
        return place_behind(probe, parts.arm, s.body.q, k, h)[what] - border
    m = s.loop.modes
    return m_.gap(modal.along, modal, m, felt_behind(parts, s, k, h), what - MODE_X)


def felt_behind(parts, s, k, h):
    """What yielding clay does at the end of a step of length h, in its modes."""
    when = moment(parts.accurate.ahead, s.clock.t, h, -1)
    return instant(parts, when, k.end, s.clay, s.loop.modes).grip


def find_root(b, fb, probe, parts, s, what, border):
    """Root of `gap_behind` between 0 and b, to rounding (false position, Illinois) [s].

    It may vanish at 0 itself, as when a handle enters stiff clay, stops and returns; the root of
    f/h is then found. Where f does not change its sign, the result lies next to 0.

    Args:
        fb: `gap_behind` at b [m].
    """
    first, end, leaves, opening = 1e-9 * b, b, False, True
    a, fa, h = 0.0, 0.0, first
    for _ in range(100):
        f = gap_behind(probe, parts, s, h, what, border)
        if opening:
            opening = f == 0.0 or (f > 0.0) == (fb > 0.0)
            if opening:
                leaves, h = True, 8.0 * h
                if h > 0.5 * b:
                    return first
                continue
            a, fa = h, f
            if leaves:
                fa, fb = fa / a, fb / b
        else:
            small = abs(f) < 4e-16  # rounding of a position
            if leaves:
                f /= h
            if (f > 0.0) != (fb > 0.0):
                a, fa = b, fb
            else:
                fa *= 0.5
            b, fb = h, f
            if abs(b - a) <= 1e-12 * end or small:
                break
        h = b - fb * (b - a) / (fb - fa)
    return b
