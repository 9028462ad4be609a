"""A run from start to end without its samples."""

from . import begin, energy, path, rows, watch

CROSSINGS = 8  # that a summary keeps


def finish(m, s, out, px, py, vx, vy, room):
    """Makes a run, the handle starting at p with velocity v; looks at so many rows at a time.

    It stops where the monitor may have something to report: `s.watch.quiet` is then 0.
    """
    begin.begin(m, s, px, py, vx, vy)
    out.crossings = out.steps = 0
    store(m, s, out, 0)
    while s.code == path.OPEN and s.watch.quiet:
        path.advance(m, s, room)
        note(m, s, out)
        if s.row >= room or s.code != path.OPEN:
            look(m, s, out)
    store(m, s, out, 1)


def store(m, s, out, i):
    """Keeps the energy stored in arm and hand, at the start or the end."""
    out.kinetic[i], out.at_hand[i] = energy.kinetic(m, s), energy.of_hand(m, s)


def note(m, s, out):
    """Keeps the crossings of the steps just made, and counts both."""
    for j in range(s.crossing):
        n = out.crossings
        if n < CROSSINGS:
            for i in range(3):  # not the border, between axis and time
                out.crossed[3 * n + i] = m.crossings[4 * j + (i + 1 if i else 0)]
        out.crossings = n + 1
    out.steps += s.steps
    s.steps = s.crossing = s.stopped = 0


def look(m, s, out):
    """Looks at the rows made, and keeps the last one."""
    if s.code == path.NOT_FINITE or s.code == path.UNRESOLVED:
        s.watch.quiet = 0
        return
    n = s.row
    watch.look(m, s, 0, n)
    if n > 0:
        for j in range(rows.ROW):
            out.row[j] = m.rows[rows.ROW * (n - 1) + j]
        for i in range(2):
            out.force[i] = m.rendered[3 * (n - 1) + i] if m.records_clay_force else 0.0
    s.row = 0
