"""Whole steps within one region of the clay, many at a time; `inline` writes the laws into these loops."""

from __future__ import annotations

from . import loop

ROW = 14 * 8  # bytes of one row: q, p, v before and after the kick, f, tau, delta, two axes each


def advance(rows, c, k, state, read, write, keep, motion, drive, buffer, step, model, data):
    """Whole steps within one region of the clay, which is not stiff.

    Args:
        rows: range of offsets into the record, one for each step [bytes].
        c, k: from `loop.coefficients` and `loop.inputs`, for whole steps before and after.
        state: see `loop.tick`.
        read: unpacks q1, q2, w1, w2 from the engine's memory, motion.
        write: packs a command into the engine's memory, drive.
        keep: packs one row into the record, buffer. step, model, data: the engine.

    Returns:
        The state after the last step.
    """
    s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11 = state
    for row in rows:
        q1, q2, w1, w2 = read(motion)
        (
            (s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11),
            (t1, t2, bx, by, p1, p2),
            (px, py, vx, vy, fx, fy, dx, dy, _, _),
            (ux, uy, n1, n2),
        ) = loop.tick(c, k, q1, q2, w1, w2, (s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11))
        write(drive, 0, t1, t2, bx, by, p1, p2)
        keep(buffer, row, q1, q2, px, py, vx, vy, ux, uy, fx, fy, t1, t2, dx, dy)
        step(model, data)
    return s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11


def vary(steps, rest, c, state, read, write, keep, motion, drive, buffer, step, model, data):
    """As `advance`, where the clay is stiff, or the clay, the muscle force or the command change from step to step.

    Args:
        steps: for each step its offset into the record [bytes], `loop.inputs`, change of the command x, y over it [m].
        rest: list that gets the clay's force beside its dampers x, y in each kick [N].
    """
    s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11 = state
    for row, k, cx, cy in steps:
        q1, q2, w1, w2 = read(motion)
        (
            (s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11),
            (t1, t2, bx, by, p1, p2),
            (px, py, vx, vy, fx, fy, dx, dy, rx, ry),
            (ux, uy, n1, n2),
        ) = loop.tick(c, k, q1, q2, w1, w2, (s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11))
        s0 += cx
        s1 += cy
        write(drive, 0, t1, t2, bx, by, p1, p2)
        keep(buffer, row, q1, q2, px, py, vx, vy, ux, uy, fx, fy, t1, t2, dx, dy)
        rest.append((rx, ry))
        step(model, data)
    return s0, s1, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11
