"""The quick test of the monitor: whether the next rows can have nothing to report."""

import math

from ..formulas import numbers

FOLD = math.sin(math.radians(1.0))  # out of reach: elbow within 1 degree of stretched or folded
SPEED = 20.0  # [m/s] beyond any hand
FLOOR = 1e-9  # [m/s] swings below this are rounding
STILL = 1e-5  # [m/s] a handle slower than this is at rest
SWING_GROWTH = 30.0  # an oscillation that has grown this much, swing by swing, is unstable
STEP_GROWTH = 2.0  # growth of one swing counts to this factor: a crossed border is no instability
SWINGS = 6  # consecutive swings that a verdict of growth needs
SWING_SPACING = 5.0  # samples a swing must last for that: faster is chatter over a border
CYCLE = 30  # consecutive swings into the torque limits that do not decay are a limit cycle
QUIET = 16  # numbers of an axis
ROW = 16


def begin(w):
    """Puts the test to the start of a run."""
    w.quiet = 1
    w.seen[0], w.seen[1], w.seen[2], w.seen[3] = 0, -1, -1, 0
    for j in range(2 * QUIET):
        w.swings[j] = 0.0


def look(m, s, first, n):
    """Tests rows from one on, up to another; a test that failed once stays failed."""
    w = s.watch
    while w.quiet and first < n:
        w.quiet = 1 if is_quiet(m, w, ROW * first) else 0
        first += 1


def strained(m, s, n, motor, limit):
    """How many of the last n rows have |tau| of a motor at a limit or above; NaN counts too."""
    row, found, j = m.rows, 0, max(s.row - n, 0)
    while j < s.row:
        if not abs(row[ROW * j + 8 + motor]) < limit:
            found += 1
        j += 1
    return found


def is_quiet(m, w, at):
    """Whether a row can have nothing to report."""
    row, seen = m.rows, w.seen
    vx, vy = abs(row[at + 4]), abs(row[at + 5])
    bound = abs(row[at + 8]) >= m.limit[0] or abs(row[at + 9]) >= m.limit[1]
    if not (vx <= SPEED and vy <= SPEED and abs(math.sin(row[at + 1])) >= FOLD):
        return False
    if vx > STILL or vy > STILL:
        seen[1] = seen[0]
    if bound:
        seen[3] += 1
    else:
        seen[2] = seen[0]
    seen[0] += 1
    for i in range(2):
        if not swings_quietly(w, QUIET * i, row[at + 4 + i], 1.0 if bound else 0.0):
            return False
    return True


def swings_quietly(w, o, v, bound):
    """The same of the swings of an axis."""
    s, quiet = w.swings, True
    s[o + 5] += bound
    if (v > s[o]) != (s[o] > s[o + 1]):
        quiet = turned(w, o, bound)
    s[o + 1], s[o] = s[o], v
    return quiet


def turned(w, o, bound):
    """The same at a turning point."""
    s = w.swings
    size = abs(s[o] - s[o + 2])
    grown = s[o + 4] + 1.0 if size >= (0.8 if s[o + 5] else 1.0) * s[o + 3] else 1.0
    if size < FLOOR:
        grown = 0.0
    if grown > 1.0 and s[o + 3] > 0.0:
        s[o + 6] *= max(1.0, min(size / s[o + 3], STEP_GROWTH))
    else:
        s[o + 6], s[o + 7], s[o + 9] = 1.0, 0.0, s[o + 8]
    s[o + 7] = s[o + 7] + 1.0 if s[o + 5] else 0.0
    s[o + 8] = 1.0 * w.seen[0]
    n = numbers.whole(grown)
    s[o + 9 + n % (SWINGS + 1)] = s[o + 8]
    slow = s[o + 8] - s[o + 9 + (n + 1) % (SWINGS + 1)] + 2.0 >= SWING_SPACING * SWINGS
    s[o + 2], s[o + 3], s[o + 4], s[o + 5] = s[o], size if grown else 0.0, grown, 2.0 * bound
    # except for rounding of the product
    if grown >= SWINGS and slow and s[o + 6] > 0.999 * SWING_GROWTH:
        return False
    return s[o + 7] < CYCLE
