"""The leapfrog on numbers alone: many steps, borders included, without an object.

`compiled` compiles it. It repeats what `leapfrog.Leapfrog` does with regions, signals and records,
on floats and arrays, with the same floating-point operations in the same order.
"""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np

from ..model import arm, clay, signals
from ..model.constants import L1, L2
from . import energy, loop
from .engine import TOUCH, find_root, next_sample
from .leapfrog import FIRST_OF_HIT, HIT_GROWTH, LANDINGS

UNFINISHED, FINISHED, TIME_LIMIT, NOT_FINITE = range(4)  # why `step_many` returned
STRIDE_ROW = 14  # floats of a row: q, p, v, fh, tau, delta, b, two axes each

STATE = np.dtype(
    [
        ("t", "f8"),  # now [s]
        ("before", "f8"),  # length of the step that led here [s]
        ("fine", "f8"),  # longest step on the way from a hit [s]
        ("loop", "f8", 12),  # state of loop.step_loop
        ("clay", "f8", 4),  # base and rate before the sample, see clay.damping_at
        ("work", "f8", 5),  # see energy.kick_work
        ("last", "f8", 6),  # of the last kick: position, velocity and joint rates after it
        ("index", "i8", 2),  # of the region along x and y
        ("i", "i8"),  # of the sample at or before now
        ("closing", "i8"),  # why the next kick is the last, MORE where it is not
        ("landings", "i8"),  # on borders since the last sample
        ("steps", "i8"),  # engine steps made
        ("struck", "i8"),  # whether the handle has just come into this clay
    ]
)


class Hand(NamedTuple):
    """The operator's arm in numbers; zeros for Th = 0.

    Attributes:
        mass: [kg].
        damper: [N.s/m].
        spring: [N/m].
    """

    mass: float
    damper: float
    spring: float


class Given(NamedTuple):
    """What a run takes from its scenario.

    Attributes:
        gain: as in Scenario.
        force: as in Scenario [N].
        origin: as in Scenario [m].
        torque_limit: as in Scenario [N.m].
        operator: the operator's arm.
        shaping: as in Scenario.
        held: whether there is an operator's arm.
        dampers: whether there is clay.
        dt: as in Scenario [s].
        t_max: as in Scenario [s].
        last: number of whole steps.
    """

    gain: tuple[float, float]
    force: tuple[float, float]
    origin: tuple[float, float]
    torque_limit: tuple[float, float]
    operator: Hand
    shaping: bool
    held: bool
    dampers: bool
    dt: float
    t_max: float
    last: int


class StrideEngine(NamedTuple):
    """Addresses in the engine.

    Attributes:
        step: of mj_step.
        model: of the model.
        data: of the data.
        q: of the joint angles.
        w: of the joint rates.
        ctrl: of the controls.
        push: of the applied joint torques.
        timestep: of the length of a step.
    """

    step: int
    model: int
    data: int
    q: int
    w: int
    ctrl: int
    push: int
    timestep: int


def load_double(address):
    """The float at an address.

    Args:
        address: where it lies.
    """
    return ctypes.c_double.from_address(address).value


def store_double(address, x):
    """Writes a float to an address.

    Args:
        address: where it goes.
        x: the float.
    """
    ctypes.c_double.from_address(address).value = x


def call_engine(address, a, b):
    """Calls the function at an address with two pointers.

    Args:
        address: of the function.
        a: first pointer.
        b: second pointer.
    """
    ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(address)(a, b)


def _mean_signal(lines, t, h):
    """Mean of a multisine over [t - h, t + h] [s], x and y; lines from `compiled`, one a row."""
    x, y = 0.0, 0.0
    for j in range(len(lines)):
        x += lines[j, 3] * signals.multisine_line(lines[j, 0], lines[j, 1], t, h)
        y += lines[j, 4] * signals.multisine_line(lines[j, 0], lines[j, 2], t, h)
    return x, y


def _kick_inputs(g, muscle, t, before, after, old, new):
    """loop.step_inputs of the kick at t between two steps, in clay old, then new: (base, rate)."""
    b0 = clay.damping_at(old[0], old[1], t - 0.25 * before)
    b1 = clay.damping_at(new[0], new[1], t + 0.25 * after)
    x, y = _mean_signal(muscle, t + 0.25 * (after - before), 0.25 * (before + after))
    k = loop.step_inputs(b0, b1, (g.force[0] + x, g.force[1] + y), before, after, g.operator)
    return k


def _kick_loop(g, muscle, t, before, after, old, new, q1, q2, w1, w2, state):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """loop.step_loop between steps of any length; arguments as in `_kick_inputs` and there."""
    c = loop.loop_coefficients(g, before, after)
    k = _kick_inputs(g, muscle, t, before, after, old, new)
    to, command, sample, out = loop.step_loop(c, k, q1, q2, w1, w2, state)
    return to, command, sample, out


def _position_after(g, q1, q2, w1, w2, h):
    """Handle position [m] after the joints have turned for h seconds."""
    x, y = arm.handle_position(q1 + h * w1, q2 + h * w2)
    return x - g.origin[0], y - g.origin[1]


def _border_side(p, low, high):
    """1 beyond the upper border, -1 beyond the lower, 0 within; a NaN is within."""
    return 1 if p > high + TOUCH else -1 if p < low - TOUCH else 0


def _region_exit(g, q1, q2, sample, out, after, low, high):
    """Borders that a step from angles q would cross, as `_border_side` (x, y)."""
    r2 = out[2] + out[3]
    # where the velocity points, the handle ends up to within this
    slack = 0.5 * after * after * (L1 * out[2] * out[2] + L2 * r2 * r2) + TOUCH
    x, y = sample[0] + after * out[0], sample[1] + after * out[1]
    if low[0] + slack <= x <= high[0] - slack and low[1] + slack <= y <= high[1] - slack:
        return 0, 0
    x, y = _position_after(g, q1, q2, out[2], out[3], after)
    return _border_side(x, low[0], high[0]), _border_side(y, low[1], high[1])


def _distance_beyond(h, g, muscle, t, before, old, new, q1, q2, w1, w2, state, i, border):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """Distance by which a step of length h would pass this border of coordinate i [m]."""
    out = _kick_loop(g, muscle, t, before, h, old, new, q1, q2, w1, w2, state)[3]
    return _position_after(g, q1, q2, out[2], out[3], h)[i] - border


def _locate_event(  # noqa: PLR0913  # compiled and inlined: plain numbers
    g, muscle, t, before, after, old, new, q1, q2, w1, w2, state, out, sx, sy, low, high
):
    """(length, coordinate, side) of the step that ends on the first border in its way."""
    x, y = _position_after(g, q1, q2, out[2], out[3], after)
    span, i, up = after, -1, 0
    if sx:
        border = high[0] if sx > 0 else low[0]
        span = find_root(
            _distance_beyond,
            after,
            x - border,
            g,
            muscle,
            t,
            before,
            old,
            new,
            q1,
            q2,
            w1,
            w2,
            state,
            0,
            border,
        )
        i, up = 0, sx
    if sy:
        border = high[1] if sy > 0 else low[1]
        other = find_root(
            _distance_beyond,
            after,
            y - border,
            g,
            muscle,
            t,
            before,
            old,
            new,
            q1,
            q2,
            w1,
            w2,
            state,
            1,
            border,
        )
        if i < 0 or other < span:
            span, i, up = other, 1, sy
    return span, i, up


def _velocity_at_border(i, g, muscle, t, before, old, new, q1, q2, w1, w2, state):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """Velocity of coordinate i at a border, see Leapfrog._velocity."""
    k = _kick_inputs(g, muscle, t, before, before, old, new)
    after = before if k[10 + i] > 0.0 else 0.0
    _, _, sample, out = _kick_loop(g, muscle, t, before, after, old, new, q1, q2, w1, w2, state)
    return (
        loop.velocity_at_sample(k, i, sample[2 + i], out[i], sample[8 + i])
        if after > 0.0
        else out[i]
    )


def _record_crossing(  # noqa: PLR0913  # compiled and inlined: plain numbers
    crossing, g, muscle, t, before, old, new, q1, q2, w1, w2, state, i, up, low, high, end
):
    """Records the crossing of this border; True if it is the end of the path."""
    speed = 0.0
    if before > 0.0:
        speed = _velocity_at_border(i, g, muscle, t, before, old, new, q1, q2, w1, w2, state)
    border = high[i] if up > 0 else low[i]
    crossing[0], crossing[1], crossing[2], crossing[3] = i, border, t, speed
    return i == 0 and up > 0 and border == end


def _write_row(row, g, q1, q2, sample, command, out, k, b):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """Writes the row of a sample, see `leapfrog._rows_at_samples`."""
    row[0], row[1], row[2], row[3] = q1, q2, sample[0], sample[1]
    row[4] = loop.velocity_at_sample(k, 0, sample[2], out[0], sample[8])
    row[5] = loop.velocity_at_sample(k, 1, sample[3], out[1], sample[9])
    if g.held:
        row[6] = sample[4] + k[0] * sample[2] + k[1] * out[0] + sample[8]
        row[7] = sample[5] + k[2] * sample[3] + k[3] * out[1] + sample[9]
    else:
        row[6], row[7] = k[5], k[6]
    row[8], row[9], row[10], row[11] = command[0], command[1], sample[6], sample[7]
    row[12], row[13] = b


def _add_work(work, g, H, k, sample, command, out, w1, w2):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """Adds the work of a kick of length H to the ledger."""
    done = energy.kick_work(
        H, k, sample[8], sample[9], sample[2], sample[3], out[0], out[1], command[0], command[1],
        0.5 * (w1 + out[2]), 0.5 * (w2 + out[3]), g.operator.damper,
    )  # fmt: skip
    for j in range(5):
        work[j] += done[j]


def write_command(engine, dampers, command):
    """Gives the engine a command.

    Args:
        engine: addresses in the engine.
        dampers: whether the engine has clay.
        command: as loop.step_loop returns it.
    """
    store_double(engine.ctrl, command[0])
    store_double(engine.ctrl + 8, command[1])
    if dampers:
        store_double(engine.ctrl + 16, command[2])
        store_double(engine.ctrl + 24, command[3])
    store_double(engine.push, command[4])
    store_double(engine.push + 8, command[5])


def _step_engine(engine, dampers, whole, dt, after, command, w1, w2, out):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """Steps the engine by after; if that is not the length of the kick, the kick goes in whole."""
    if not whole:
        command = loop.whole_kick(w1, w2, out[2], out[3], command[0], command[1], after)
        store_double(engine.timestep, after)
    write_command(engine, dampers, command)
    call_engine(engine.step, engine.model, engine.data)
    if not whole:
        store_double(engine.timestep, dt)


def _motors_limited(g, command):
    """Whether a motor is at its limit in a kick."""
    return abs(command[0]) >= g.torque_limit[0] or abs(command[1]) >= g.torque_limit[1]


def _first_step_of_hit(g, muscle, t, before, after, old, new, q1, q2, w1, w2, state):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """See Leapfrog._first_of_a_hit."""
    x, y = clay.damping_at(new[0], new[1], t)
    b = max(x, y)
    first = FIRST_OF_HIT / (b * arm.TRACE_W) if b > 0.0 else np.inf
    if first >= after:
        return np.inf
    if before > 0.0:
        state, _, _, out = _kick_loop(g, muscle, t, before, 0.0, old, new, q1, q2, w1, w2, state)
        w1, w2 = out[2], out[3]
    command = _kick_loop(g, muscle, t, 0.0, first, old, new, q1, q2, w1, w2, state)[1]
    return first if _motors_limited(g, command) else np.inf


def step_many(g, muscle, commanded, table, engine, run, rows, crossings, most, room):  # noqa: PLR0913  # compiled and inlined: plain numbers
    """Steps until most kicks are made, rows or crossings is full, or the run is over.

    Args:
        g: the scenario in numbers.
        muscle: lines of the muscle's multisine, shape (n, 5).
        commanded: lines of the command's multisine, shape (n, 5).
        table: from clay.region_table.
        engine: addresses in the engine.
        run: array of one STATE, which is advanced.
        rows: one a sample, shape (room, STRIDE_ROW), as Run.judge takes them, and the clay.
        crossings: shape (n, 4), n >= 4: coordinate, border [m], time [s], speed along it [m/s].
        most: largest number of kicks.
        room: largest number of rows.

    Returns:
        (UNFINISHED, FINISHED, TIME_LIMIT or NOT_FINITE; rows written; crossings recorded).
    """
    now, dt = run[0], g.dt
    t, before, i, closing = now["t"], now["before"], now["i"], now["closing"]
    landings, steps, fine, struck = now["landings"], now["steps"], now["fine"], now["struck"]
    s, c = now["loop"], now["clay"]
    state = (s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9], s[10], s[11])
    old = ((c[0], c[1]), (c[2], c[3]))
    index = (now["index"][0], now["index"][1])
    low, high, base, rate = clay.enter_region(table, index[0], index[1], t)
    work, last = now["work"], now["last"]
    steady = loop.loop_coefficients(g, dt, dt)
    k = _kick_inputs(g, muscle, t, dt, dt, old, (base, rate))
    fresh = False  # k is that of whole steps here and now
    done, filled, crossed, code = 0, 0, 0, UNFINISHED
    while done < most and filled < room and crossed < len(crossings) - 3:
        target, after, on_grid = next_sample(t, i, g.last, dt, g.t_max)
        if closing == UNFINISHED and after == 0.0:
            closing = TIME_LIMIT
        if on_grid:
            landings = 0
        q1, q2 = load_double(engine.q), load_double(engine.q + 8)
        w1, w2 = load_double(engine.w), load_double(engine.w + 8)
        after = min(after, fine)
        axis, up = -1, 0  # border that the step ends on
        overx, overy = 0, 0  # borders stepped over without a step
        while True:
            if closing != UNFINISHED:
                after = 0.0
            if struck and after > 0.0:
                new = (base, rate)
                struck, fine = (
                    0,
                    _first_step_of_hit(
                        g, muscle, t, before, after, old, new, q1, q2, w1, w2, state
                    ),
                )
                if fine < after:
                    after = fine
                    if before > 0.0:  # see Leapfrog._halve
                        k = _kick_inputs(g, muscle, t, before, 0.0, old, new)
                        to, command, sample, out = _kick_loop(
                            g, muscle, t, before, 0.0, old, new, q1, q2, w1, w2, state
                        )
                        _add_work(work, g, 0.5 * before, k, sample, command, out, w1, w2)
                        state, before, w1, w2 = to, 0.0, out[2], out[3]
                        store_double(engine.w, w1)
                        store_double(engine.w + 8, w2)
            whole = before == dt and after == dt
            if whole:
                if not fresh:
                    k = _kick_inputs(g, muscle, t, dt, dt, old, (base, rate))
                    fresh = (
                        len(muscle) == 0
                        and rate[0] == 0.0
                        and rate[1] == 0.0
                        and old == (base, rate)
                    )
                to, command, sample, out = loop.step_loop(steady, k, q1, q2, w1, w2, state)
            else:
                fresh = False
                k = _kick_inputs(g, muscle, t, before, after, old, (base, rate))
                to, command, sample, out = loop.step_loop(
                    loop.loop_coefficients(g, before, after), k, q1, q2, w1, w2, state
                )
            if after == 0.0 or axis >= 0:
                break
            sx, sy = _region_exit(g, q1, q2, sample, out, after, low, high)
            # no way back over a border: it must not hold the run
            sx, sy = sx if overx in (0, sx) else 0, sy if overy in (0, sy) else 0
            if sx == 0 and sy == 0:
                break
            x, y = _position_after(g, q1, q2, out[2], out[3], 0.0)
            if sx and _border_side(x, low[0], high[0]):
                here, overx = 0, sx
            elif sy and _border_side(y, low[1], high[1]):
                here, overy = 1, sy
            else:
                if landings >= LANDINGS:
                    break
                after, axis, up = _locate_event(
                    g, muscle, t, before, after, old, (base, rate), q1, q2, w1, w2, state, out,
                    sx, sy, low, high,
                )  # fmt: skip
                continue
            up = sx if here == 0 else sy
            ended = _record_crossing(
                crossings[crossed], g, muscle, t, before, old, (base, rate), q1, q2, w1, w2, state,
                here, up, low, high, table[clay.AXIS_ROWS, 2],
            )  # fmt: skip
            crossed += 1
            if ended:
                closing = FINISHED
                if before == 0.0:
                    break
            else:
                fresh, struck = False, 1
                index = (index[0] + up, index[1]) if here == 0 else (index[0], index[1] + up)
                low, high, base, rate = clay.enter_region(table, index[0], index[1], t)
        if before > 0.0 or closing == UNFINISHED:
            _add_work(work, g, 0.5 * (before + after), k, sample, command, out, w1, w2)
            last[0], last[1], last[2], last[3], last[4], last[5] = sample[0], sample[1], *out
            done += 1
            if on_grid or closing != UNFINISHED:
                b = (
                    clay.damping_at(base, rate, t)
                    if after > 0.0
                    else clay.damping_at(old[0], old[1], t)
                )
                row = rows[filled]
                _write_row(row, g, q1, q2, sample, command, out, k, b)
                if after == 0.0 and k[7] > 0.0:
                    row[4] = _velocity_at_border(
                        0, g, muscle, t, before, old, (base, rate), q1, q2, w1, w2, state
                    )
                    row[5] = _velocity_at_border(
                        1, g, muscle, t, before, old, (base, rate), q1, q2, w1, w2, state
                    )
                filled += 1
        if closing != UNFINISHED:
            code = closing
            break
        if not abs(out[2]) + abs(out[3]) < np.inf:
            code = NOT_FINITE
            break
        _step_engine(engine, g.dampers, whole, dt, after, command, w1, w2, out)
        steps += 1
        state = to
        if len(commanded):
            x1, y1 = _mean_signal(commanded, t + after, 0.0)
            x0, y0 = _mean_signal(commanded, t, 0.0)
            state = (
                to[0] + (x1 - x0), to[1] + (y1 - y0),
                to[2], to[3], to[4], to[5], to[6], to[7], to[8], to[9], to[10], to[11],
            )  # fmt: skip
        old, before = (base, rate), after
        fine = fine * HIT_GROWTH if fine < np.inf and _motors_limited(g, command) else np.inf
        t += after
        if target - t <= 1e-9 * dt:
            i += 1
            t = target
        if axis >= 0:
            landings += 1
            fresh = False
            q1, q2 = load_double(engine.q), load_double(engine.q + 8)
            w1, w2 = load_double(engine.w), load_double(engine.w + 8)
            ended = _record_crossing(
                crossings[crossed], g, muscle, t, before, old, (base, rate), q1, q2, w1, w2, state,
                axis, up, low, high, table[clay.AXIS_ROWS, 2],
            )  # fmt: skip
            crossed += 1
            if ended:
                closing = FINISHED
            else:
                index = (index[0] + up, index[1]) if axis == 0 else (index[0], index[1] + up)
                low, high, base, rate = clay.enter_region(table, index[0], index[1], t)
                struck = 1
    now["t"], now["before"], now["i"], now["closing"] = t, before, i, closing
    now["landings"], now["steps"], now["fine"], now["struck"] = landings, steps, fine, struck
    now["index"][0], now["index"][1] = index
    for j in range(12):
        now["loop"][j] = state[j]
    c[0], c[1], c[2], c[3] = old[0][0], old[0][1], old[1][0], old[1][1]
    return code, filled, crossed


# For numba, beside the other laws: those with their own laws written into them, and plain ones.
INLINED = (_kick_inputs, _add_work, _position_after)
COMPILED = (
    write_command,
    _border_side,
    _distance_beyond,
    _first_step_of_hit,
    _kick_loop,
    _locate_event,
    _mean_signal,
    _motors_limited,
    _record_crossing,
    _region_exit,
    _step_engine,
    _velocity_at_border,
    _write_row,
    step_many,
)
