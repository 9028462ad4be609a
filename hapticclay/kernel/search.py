"""The length at which a step first passes a border, or outlasts a mode."""

from . import march, methods, modes

MODE_X = 2  # from here on, what is looked for is the end of a mode; before, a border


def gap_after(m, s, h, what, border):
    """Distance by which a step of length h would pass a border [m]; of modes see modes.gap."""
    methods.attempt(m, s, h)
    if what >= MODE_X:
        march.evaluate_end(m, s, h)
        return modes.gap(m, s, s.a.now.grip, what - MODE_X)
    x, y = methods.place_after(m, s, h)
    return (y if what else x) - border


def find_root(m, s, b, fb, what, border):
    """Root of `gap_after` between 0 and b, to rounding (false position, Illinois) [s].

    fb is the gap at b. At the start of the step the gap may be 0: the root is then the next one.
    """
    first, end, leaves, opening = 1e-9 * b, b, False, True
    a, fa, h = 0.0, 0.0, first
    for _ in range(100):
        f = gap_after(m, s, h, what, border)
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
