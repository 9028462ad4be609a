"""The path of a run: samples, borders of the clay and the end, for every method of stepping.

`advance` makes whole steps by the method's own loop and all others by `careful`: the first step,
those around an event or a border, and the last. The code runs in CPython, and numba compiles the
same source (`compiled`); both read and write the run through the arguments. What a method supplies
is listed in `Method`.

`s` is the state of the run, by name: a record when compiled, a dictionary of floats and memoryviews
when not. `e` holds its arrays: NumPy's when compiled, memoryviews when not.
"""

from __future__ import annotations

import math
import struct
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..model import arm, clay, compensator, groove, pieces, regions
from ..model import spring as springs
from . import loop

TOUCH = 1e-13  # [m] a border is crossed when the handle is so far beyond it: hundreds of roundings
OPEN, FINISHED, TIME_LIMIT, NOT_FINITE, UNRESOLVED = range(5)  # how a run stands
ROW = 16  # floats of a row: q, p, v, fh, tau, delta, b, q', two axes each
FELT = 14  # see loop.yield_in_kick
SUMS = 8  # of energy.kick_work, and energy.HARDWARE_WORK
INF = np.inf
NAN = np.nan
NEAR = 1e-6  # of dt: a jump of a signal so close to the end of a step is at its end
# times that the handle comes back to a region within one sample; a handle that slides along a
# border then completes the step
LANDINGS = 4
MOST_STEPS = 20_000  # from one sample to the next; a run that needs more ends as unresolved

SCENARIO = [  # in numbers, see model.scenario
    ("dt", "f8"),
    ("t_max", "f8"),
    ("last", "i8"),  # number of whole steps
    ("gain", "f8", 2),
    ("force", "f8", 2),
    ("origin", "f8", 2),
    ("torque_limit", "f8", 2),
    ("arm", "f8", 5),  # arm.Arm.links
    ("servox", "f8", 6),  # controller.Servo.numbers
    ("servoy", "f8", 6),
    ("lag", "f8", 2),  # poles of a compensator K/(s (s + pole)) [rad/s]; not used if
    # order of a compensator of another shape, 0 where both axes have that one, and its numbers
    ("formed", "i8"),
    ("form", "f8", 2 * compensator.FORM),
    ("handx", "f8", 3),  # mass, damper, spring of the operator's arm; zeros for Th = 0
    ("handy", "f8", 3),
    ("held", "i8"),  # whether there is an operator's arm
    ("mobility", "f8"),  # largest acceleration of both per unit of force [1/kg]
    ("sprung_step", "f8"),  # longest step in clay that springs back [s]
    ("shaping", "i8"),
    ("dampers", "i8"),  # whether there is clay
    ("turned_clay", "i8"),  # whether its axes are not x and y
    ("smooth", "i8"),  # which axes have smooth clay, see clay.Clay.smooth
    ("grain", "f8", 2),  # cosine and sine of the angle between them
    ("grooved", "i8"),  # whether clay stays cut: 1, or 2 where it damps too
    ("block", "f8", groove.BLOCK_NUMBERS),  # Groove.numbers
    ("drag", "f8"),  # Groove.damping
    ("springs", "i8"),  # whether clay springs back anywhere: 1 by itself, 2 by motors that hold
    ("beyond", "i8"),  # whether clay has a force that b v does not tell
    ("yields", "i8"),  # whether clay yields anywhere: 1 each axis by itself, 2 along the motion
    ("ramp", "f8", 5),  # muscle force that changes evenly: since [s], x, y [N], rate x, y [N/s]
]
STATE = [
    ("t", "f8"),  # now [s]
    ("i", "i8"),  # of the sample at or before now
    ("q", "f8", 2),  # joint angles [rad]
    ("w", "f8", 2),  # joint rates [rad/s]
    ("before", "f8"),  # length of the step that led here [s]
    ("fine", "f8"),  # longest step on the way from a hit [s]
    ("struck", "i8"),  # whether the handle has just come into this clay
    ("landings", "i8"),  # times that the handle has come back to a region since the last sample
    ("least_index", "i8", 2),  # of the regions since then
    ("most_index", "i8", 2),
    ("careful", "i8"),  # steps since then
    ("closing", "i8"),  # why the next row is the last, OPEN where it is not
    ("code", "i8"),  # how the run stands
    ("steps", "i8"),  # engine steps made
    ("filled", "i8"),  # rows written since the last look
    ("crossed", "i8"),  # crossings since the last look
    ("first", "i8"),  # sample of the first row of Engine.ahead; -1 if nothing varies
    ("index", "i8", 2),  # of the region along x and y
    ("low", "f8", 2),  # its borders [m]
    ("high", "f8", 2),
    ("base", "f8", 2),  # its clay, see clay.damping_at
    ("rate", "f8", 2),
    ("old", "f8", 4),  # base and rate of the clay before the sample
    # of clay that stays cut: base without it, now and before the sample; groove.cut's rim and
    # removed volume [m^3]; place of the last cut [m], NaN before the first
    ("bare", "f8", 4),
    ("dragging", "f8"),  # damping of it [N.s/m]
    ("rim", "f8", groove.RIM),
    ("removed", "f8", 2),
    ("cut_at", "f8", 2),
    # of clay that yields: Fy, K, n of x and of y now, and before the sample; whether x and y rest
    ("flow", "f8", 6),
    ("flow_old", "f8", 6),
    ("stuck", "i8", 2),
    # of clay that springs back: Spring.numbers and the direction of a surface now, of x and of y;
    # rest of the first spring [m] and elongation of the second [m] of each; place of the handle at
    # the last sample [m]; force now, and at the end of the clay before (x, y each) [N]; energy lost
    # and stored [J]; longest step that resolves it [s]
    ("spring", "f8", 2 * regions.SPRING),
    ("stretch", "f8", 4),
    ("sprung_at", "f8", 2),
    ("sprung", "f8", 4),
    ("sprung_energy", "f8", 2),
    ("resolved", "f8"),
    ("anchor", "f8", 2),  # where an axis came to rest beside one that slides [m], NaN elsewhere
    ("stopped", "i8"),  # rows of Engine.stops filled since the last look
    ("felt", "f8", FELT),  # of the kick or stage last worked out, see loop.yield_in_kick
    ("work", "f8", SUMS),  # [J]
    ("final", "f8", 6),  # of the last kick: position, velocity and joint rates after it
]


# the cheapest way for CPython to write floats into an array: (array, offset [bytes], floats)
put4, put5, put6, put8, put10, put12, put14, put17, put22, put33 = (
    struct.Struct(f"{n}d").pack_into for n in (4, 5, 6, 8, 10, 12, 14, 17, 22, 33)
)


class Engine(NamedTuple):
    """The arrays of a run: the engine's, those that the loops read, and those that they fill.

    Attributes:
        step: mj_step.
        forward: mj_forward.
        model: the model, or its address.
        data: the data, or its address.
        q: joint angles [rad].
        w: joint rates [rad/s].
        acceleration: joint accelerations [rad/s^2].
        ctrl: controls.
        push: applied joint torques [N.m].
        timestep: length of a step [s], shape (1,).
        table: from regions.region_table.
        muscle: table of the muscle's signal, see model.pieces; empty for none.
        command: table of the command's signal, whose pieces are counted from their start.
        ahead: what changes from step to step, from sample s["first"] on; see `steps_ahead` of the
            method.
        rows: of the record, shape (n, ROW).
        crossings: shape (n, 4): coordinate, border [m], time [s], speed along it [m/s].
        raw: workspace for a block of whole steps.
        varied: workspace for what varies in it.
        chance: of a sampled run: random effects, a row a sample, see hardware.SampleNoise.
        ring: its memory, shape (n, 11), three rings one after the other: index and angles [rad] of
            past samples, `window` rows; forces of the clay at past samples [N], whole_delay + 2;
            the queue: time [s] and what to hold from then on, whole_delay + 4.
        rendered: force of the clay [N] where b v does not tell it, a line a row, shape (n, 2), and
            in a third column the volume removed where clay stays cut [m^3]; (0, 2) elsewhere.
        felt: of clay that yields, what each kick of a block felt, as state felt, shape (n, FELT).
        stops: where it stops the handle or lets it go, shape (n, 3): coordinate, or 2.0 for both;
            1.0 for a stop, 0.0 for the end of one; time [s].
        ground: of clay that stays cut, share of each cell that is left, shape (n, m).
        relief: height of the cells before any cut [m], as ground.
        breaks: times at which steps of an accurate run must end: a signal jumps there [s].
        law: of a sampled controller of the user's own, called with law_data.
        law_data: what it is called with.
        desk: the floats that it reads and writes, see sampled_controller.DESK.
    """

    step: Any
    forward: Any
    model: Any
    data: Any
    q: Any
    w: Any
    acceleration: Any
    ctrl: Any
    push: Any
    timestep: Any
    table: Any
    muscle: Any
    command: Any
    ahead: Any
    rows: Any
    crossings: Any
    raw: Any
    varied: Any
    chance: Any
    ring: Any
    rendered: Any
    felt: Any
    stops: Any
    ground: Any
    relief: Any
    breaks: Any
    law: Any
    law_data: Any
    desk: Any


class Method(Protocol):
    """What a way of stepping supplies: a named tuple of integers with these functions.

    They work on the state `s` and the arrays `e` of a run.
    """

    def glide(self, s: Any, e: Any, room: int) -> int:
        """Makes whole steps within one region of the clay, up to one that would leave it.

        Args:
            s: state of the run.
            e: its arrays.
            room: largest number of rows to fill.

        Returns:
            Number of steps made.
        """
        ...

    def stop(self, s: Any) -> tuple[float, float, bool]:
        """Where the next step leads to, as `next_sample`.

        Args:
            s: state of the run.
        """
        ...

    def arrive(self, s: Any, target: float) -> None:
        """Moves the clock there.

        Args:
            s: state of the run.
            target: the time [s].
        """
        ...

    def act(self, s: Any, e: Any) -> None:
        """The controller acts: once a step, before it is worked out.

        Args:
            s: state of the run.
            e: its arrays.
        """
        ...

    def strike(self, s: Any, e: Any, after: float) -> float:
        """Length of the first step in clay that the handle has come into [s].

        Args:
            s: state of the run.
            e: its arrays.
            after: length that it may have [s].
        """
        ...

    def propose(self, s: Any, e: Any, after: float) -> None:
        """Works out a step, without effect on the run.

        Args:
            s: state of the run.
            e: its arrays.
            after: its length [s].
        """
        ...

    def meet(self, s: Any, e: Any, after: float, lands: bool) -> float:
        """Shortens that step to where clay that yields begins or ceases to hold the handle.

        Args:
            s: state of the run.
            e: its arrays.
            after: its length [s].
            lands: whether it ends on a border, and is not to be shortened.

        Returns:
            Length of the step, which is worked out [s].
        """
        ...

    def finite(self, s: Any, e: Any) -> bool:
        """Whether the numbers of that step are finite.

        Args:
            s: state of the run.
            e: its arrays.
        """
        ...

    def place(self, s: Any, e: Any, h: float) -> tuple[float, float]:
        """Handle position on the way of that step, (x, y) [m].

        Args:
            s: state of the run.
            e: its arrays.
            h: time since its beginning [s].
        """
        ...

    def keep(self, s: Any, e: Any, after: float, shows: bool) -> None:
        """Takes that step into the ledger and, at a sample, the record.

        Args:
            s: state of the run.
            e: its arrays.
            after: its length [s]; 0 ends the run.
            shows: whether now is a sample.
        """
        ...

    def commit(self, s: Any, e: Any, after: float) -> None:
        """Makes that step in the engine.

        Args:
            s: state of the run.
            e: its arrays.
            after: its length [s].
        """
        ...

    def speed(self, s: Any, e: Any, i: int) -> float:
        """Velocity of a coordinate at a border, on its near side [m/s].

        Args:
            s: state of the run.
            e: its arrays.
            i: the coordinate, 0 for x, 1 for y.
        """
        ...


def arm_of(s):
    """The arm's numbers, see arm.Arm.links.

    Args:
        s: state of the run.
    """
    a = s["arm"]
    return a[0], a[1], a[2], a[3], a[4]


def next_sample(t, i, last, dt, t_max):
    """The next sample of a run.

    Args:
        t: now [s].
        i: index of the sample at or before now.
        last: number of whole steps.
        dt: step [s].
        t_max: end of the run [s].

    Returns:
        (time of the next sample [s], length of the step to it [s], whether now is a sample). The
        length is 0 at the end.
    """
    on_grid = t == i * dt
    if i > last:
        return t, 0.0, on_grid
    target = (i + 1) * dt if i < last else t_max
    after = dt if on_grid and i < last else target - t
    return target, after if after > 1e-9 * dt else 0.0, on_grid


def find_root(f, b, fb, *args):
    """Root of f between 0 and b, to rounding (false position, Illinois).

    f may vanish at 0 itself, as when a handle enters stiff clay, stops and returns; the root of f/x
    is then found. Where f does not change its sign, the result lies next to 0.

    Args:
        f: function of (x, *args).
        b: end of the interval, b > 0.
        fb: f at b.
        args: further arguments of f.

    Returns:
        The root.
    """
    first, end = 1e-9 * b, b
    a, fa = first, f(first, *args)
    leaves = fa == 0.0 or (fa > 0.0) == (fb > 0.0)
    if leaves:
        while fa == 0.0 or (fa > 0.0) == (fb > 0.0):
            a *= 8.0
            if a > 0.5 * b:
                return first
            fa = f(a, *args)
        fa, fb = fa / a, fb / b
    for _ in range(60):
        h = b - fb * (b - a) / (fb - fa)
        fh = f(h, *args)
        small = abs(fh) < 4e-16  # rounding of a position
        if leaves:
            fh /= h
        if (fh > 0.0) != (fb > 0.0):
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = h, fh
        if abs(b - a) <= 1e-12 * end or small:
            break
    return b


def mean_force(s, e, t, h):
    """Mean muscle force over [t - h, t + h].

    Args:
        s: state of the run.
        e: its arrays.
        t: centre of the interval [s].
        h: half its length [s].

    Returns:
        (x, y) [N].
    """
    return muscle_force(s, e.muscle, t, h)


def muscle_force(s, muscle, t, h):
    """As `mean_force`.

    Args:
        s: state of the run.
        muscle: see Engine; compiled code pays for each array that it passes on.
        t: centre of the interval [s].
        h: half its length [s].
    """
    x, y = 0.0, 0.0
    if len(muscle) > 0:
        x, y = pieces.mean_of_table(muscle, t, h)
    return steady_force(s, t, x, y)


def steady_force(s, t, x, y):
    """Muscle force with its parts that are constant or change evenly.

    Args:
        s: state of the run.
        t: time [s].
        x: force of the signal along x [N].
        y: force of the signal along y [N].

    Returns:
        (x, y) [N].
    """
    force, ramp = s["force"], s["ramp"]
    x += ramp[1] + (t - ramp[0]) * ramp[3]
    y += ramp[2] + (t - ramp[0]) * ramp[4]
    return force[0] + x, force[1] + y


def force_at(s, e, t, near):
    """Muscle force at a time, from one side of it where it jumps.

    Args:
        s: state of the run.
        e: its arrays.
        t: the time [s].
        near: a time beside it [s].

    Returns:
        (x, y) [N].
    """
    x, y = 0.0, 0.0
    if len(e.muscle) > 0:
        x, y = pieces.value_of_table(e.muscle, t, near)
    return steady_force(s, t, x, y)


def command_at(e, t, near):
    """Change of the command since t = 0, (x, y) [m], from one side of a time where it jumps.

    Args:
        e: arrays of the run.
        t: the time [s].
        near: a time beside it [s].
    """
    x0, y0 = pieces.mean_of_lines(e.command, 0.0, 0.0)
    x1, y1 = pieces.value_of_table(e.command, t, near)
    return x1 - x0, y1 - y0


def command_change(e, t0, t1, h):
    """Change of the command between two times, (x, y) [m].

    Args:
        e: arrays of the run.
        t0: first time [s].
        t1: second time [s].
        h: pieces count by their mean over h before and after a time, or over less next to t = 0
            [s]; 0 for their value.
    """
    x0, y0 = pieces.mean_of_lines(e.command, t0, 0.0)
    x1, y1 = pieces.mean_of_lines(e.command, t1, 0.0)
    if pieces.has_pieces(e.command):
        ax, ay = pieces.mean_of_pieces(e.command, t0, min(h, t0))
        bx, by = pieces.mean_of_pieces(e.command, t1, min(h, t1))
        x1 += bx - ax
        y1 += by - ay
    return x1 - x0, y1 - y0


def damping_before(s, t):
    """Clay of the step that led here at a time, (x, y) [N.s/m].

    Args:
        s: state of the run.
        t: time [s].
    """
    old = s["old"]
    return clay.damping_at((old[0], old[1]), (old[2], old[3]), t)


def damping_now(s, t):
    """Clay of the present region at a time, (x, y) [N.s/m].

    Args:
        s: state of the run.
        t: time [s].
    """
    base, rate = s["base"], s["rate"]
    return clay.damping_at((base[0], base[1]), (rate[0], rate[1]), t)


def side(p, low, high):
    """1 beyond the upper border, -1 beyond the lower, 0 within; a NaN is within.

    Args:
        p: coordinate [m].
        low: lower border [m].
        high: upper border [m].
    """
    return 1 if p > high + TOUCH else -1 if p < low - TOUCH else 0


def put_handle(s, e, x, y, vx, vy):
    """Puts the handle to its start.

    Args:
        s: state of the run, with the numbers of the scenario.
        e: its arrays.
        x: position, x [m].
        y: the same, y [m].
        vx: velocity, x [m/s].
        vy: the same, y [m/s].
    """
    links, origin = arm_of(s), s["origin"]
    q1, q2 = arm.inverse_kinematics(origin[0] + x, origin[1] + y, links)
    r1, r2 = arm.joint_velocity(vx, vy, arm.jacobian(q1, q2, links), 1.0)
    e.q[0], e.q[1], e.w[0], e.w[1] = q1, q2, r1, r2 - r1
    for j in range(2):
        s["q"][j], s["w"][j] = e.q[j], e.w[j]
    s["fine"], s["struck"], s["first"], s["resolved"] = INF, 1, -1, INF
    ix, iy = regions.region_of(e.table, (x, y))
    s["index"][0], s["index"][1] = ix, iy


def settle(s, table, crossed):
    """Takes borders and clay of the region in which the run continues.

    Args:
        s: state of the run.
        table: from regions.region_table.
        crossed: coordinate whose border the handle has crossed, 0 for x, 1 for y, -1 for none.
    """
    low, high, base, rate = regions.enter_region(table, s["index"][0], s["index"][1], s["t"])
    for j in range(2):
        s["low"][j], s["high"][j], s["base"][j], s["rate"][j] = low[j], high[j], base[j], rate[j]
    if s["yields"]:
        for axis in range(2):
            Fy, K, n = regions.enter_flow(table, axis, s["index"][0], s["index"][1])
            flow = s["flow"]
            flow[3 * axis], flow[3 * axis + 1], flow[3 * axis + 2] = Fy, K, n
    if s["springs"]:
        enter_spring(s, table, crossed)
    if s["smooth"]:
        feel_place(s, table)
    if s["grooved"]:
        for j in range(2):
            s["bare"][j] = base[j]
            s["base"][j] += s["dragging"]


def handle_place(s):
    """Place of the handle by the joint angles, (x, y) [m].

    Args:
        s: state of the run.
    """
    ox, oy = s["origin"]
    u1x, u1y, u2x, u2y = arm.jacobian(s["q"][0], s["q"][1], arm_of(s))
    return u1y + u2y - ox, -oy - u1x - u2x


def enter_spring(s, table, crossed):
    """Takes the springs of the region in which the run continues; those left behind lose theirs.

    Args:
        s: state of the run.
        table: from regions.region_table.
        crossed: as in `settle`.
    """
    spring, stretch, sprung, n = s["spring"], s["stretch"], s["sprung"], regions.SPRING
    at, stiffest = s["sprung_at"], 0.0
    at[0], at[1] = handle_place(s)
    sprung[2], sprung[3] = sprung[0], sprung[1]
    s["sprung_energy"][0] += s["sprung_energy"][1]
    s["sprung_energy"][1] = 0.0
    for i in range(2):
        place = regions.spring_place(table, i, s["index"][0], s["index"][1])
        for j in range(n - 1):
            spring[n * i + j] = table[place + j]
        stiffest = max(stiffest, spring[n * i] + spring[n * i + 2])
        way, rest = 0.0, at[i]
        if spring[n * i + 4] > 0.0:  # pushed from the border that is nearer
            up = at[i] - s["low"][i] <= s["high"][i] - at[i]
            way, border = (1.0, s["low"][i]) if up else (-1.0, s["high"][i])
            if i == crossed:  # else the tool is in it already, at rest
                rest = border
            dent = table[place + n - 1]
            if dent == dent and way * (dent - rest) > 0.0:
                rest = dent
            if crossed < 0 and way * (rest - border) > 0.0:
                table[place + n - 1] = rest
        spring[n * i + n - 1] = way
        stretch[2 * i], stretch[2 * i + 1], sprung[i] = rest, 0.0, 0.0
    s["resolved"] = INF
    if stiffest > 0.0:
        if s["springs"] == 1:
            s["resolved"] = s["sprung_step"]
        feel_spring(s, table, 0.0)


def feel_spring(s, table, h):
    """Moves the springs on to the place of the handle.

    Args:
        s: state of the run.
        table: from regions.region_table.
        h: time since the last place [s].
    """
    spring, stretch, at, n = s["spring"], s["stretch"], s["sprung_at"], regions.SPRING
    px, py = handle_place(s)
    stored = 0.0
    for i in range(2):
        p, way = (py if i else px), spring[n * i + 5]
        rest, f, kept, lost = springs.spring_step(
            spring[n * i], spring[n * i + 1], way, stretch[2 * i], p
        )
        z, f1, kept1, lost1 = springs.relaxing_step(
            spring[n * i + 2], spring[n * i + 3], way, stretch[2 * i + 1], p - at[i], h
        )
        if lost > 0.0 and way != 0.0:
            table[regions.spring_place(table, i, s["index"][0], s["index"][1]) + n - 1] = rest
        stretch[2 * i], stretch[2 * i + 1], s["sprung"][i] = rest, z, f + f1
        s["sprung_energy"][0] += lost + lost1
        stored += kept + kept1
        at[i] = p
        if h > 0.0:
            s["sprung"][2 + i] = s["sprung"][i]
    s["sprung_energy"][1] = stored


def viscous_parts(s, bx, by, vx, vy):
    """Force of the clay's damping, (x, y) [N]. Floats, or arrays over samples.

    Args:
        s: state of the run.
        bx: damping, x or the clay's own first axis [N.s/m].
        by: the same, y or its second axis [N.s/m].
        vx: velocity, x [m/s].
        vy: the same, y [m/s].
    """
    if s["turned_clay"]:
        return clay.turned_force(s["grain"][0], s["grain"][1], bx, by, vx, vy)
    return clay.viscous_force(bx, by, vx, vy)


def note_stop(s, e, t, stuckx, stucky):
    """Notes where clay that yields stops the handle or lets it go.

    Args:
        s: state of the run.
        e: its arrays.
        t: time of the sample [s], in whose kick it does; state felt tells when.
        stuckx: whether x rests now.
        stucky: whether y rests now.
    """
    stuck, felt = s["stuck"], s["felt"]
    if stuckx == stuck[0] and stucky == stuck[1]:
        return
    stops, along = e.stops, s["yields"] == 2
    for i in range(2):
        now = stucky if i else stuckx
        if now != stuck[i] and not (along and i):
            n = s["stopped"]
            stops[n, 0], stops[n, 1] = 2.0 if along else float(i), float(now)
            stops[n, 2] = t + felt[10 + i] if now else t
            s["stopped"] = n + 1
    stuck[0], stuck[1] = stuckx, stucky


def may_glide(s):
    """Whether whole steps within one region of the clay may follow in a method that leaps.

    Args:
        s: state of the run.
    """
    dt, base, rate, old = s["dt"], s["base"], s["rate"], s["old"]
    if s["before"] != dt or s["t"] != s["i"] * dt or s["closing"] != OPEN or s["struck"]:
        return False
    if s["beyond"] and not (loop.is_one_flow(s) and s["resolved"] == INF):
        return False
    return old[0] == base[0] and old[1] == base[1] and old[2] == rate[0] and old[3] == rate[1]


def feel_place(s, table):
    """Takes the clay of the place of the handle, where it is smooth: that before and after it too.

    Args:
        s: state of the run.
        table: from regions.region_table.
    """
    base, old, which = s["base"], s["old"], s["smooth"]
    x, y = handle_place(s)
    base[0], base[1] = regions.smooth_clay(table, which, x, y, base[0], base[1])
    for j in range(2):
        if which != 2 - j:
            old[j], old[2 + j] = base[j], 0.0


def cut_place(s, e):
    """As `cut_clay`, at the handle.

    Args:
        s: state of the run.
        e: its arrays.
    """
    q1, q2 = s["q"]
    w1, w2 = s["w"]
    ox, oy = s["origin"]
    u1x, u1y, u2x, u2y = arm.jacobian(q1, q2, arm_of(s))
    r2 = w1 + w2
    x, y = u1y + u2y - ox, -oy - u1x - u2x
    cut_clay(s, e, x, y, u1x * w1 + u2x * r2, u1y * w1 + u2y * r2)


def cut_clay(s, e, x, y, vx, vy):
    """Takes away the clay between here and the last cut; where it damps, that is felt.

    Args:
        s: state of the run.
        e: its arrays.
        x: place of the tool, x [m].
        y: the same, y [m].
        vx: velocity on the way here, x [m/s].
        vy: the same, y [m/s].
    """
    at, grid = s["cut_at"], s["block"]
    ax, ay = at[0], at[1]
    if x != ax or y != ay:
        whole, n = 1, 1
        if ax == ax:
            dx, dy = x - ax, y - ay
            whole, n = 0, 1 + int(math.sqrt(dx * dx + dy * dy) / (groove.STRIDE * grid[7]))
            for k in range(1, n):
                groove.cut(
                    grid, e.ground, e.relief, ax + k * dx / n, ay + k * dy / n, 0, s["rim"],
                    s["removed"],
                )  # fmt: skip
        groove.cut(grid, e.ground, e.relief, x, y, whole, s["rim"], s["removed"])
        at[0], at[1] = x, y
    if s["grooved"] == 2:
        _, area = groove.resistance(s["rim"], vx, vy)
        base, old, bare, b = s["base"], s["old"], s["bare"], s["drag"] * area
        s["dragging"] = b
        base[0], base[1] = bare[0] + b, bare[1] + b
        old[0], old[1] = bare[2] + b, bare[3] + b


def move_on(s, table, i, up):
    """Takes the region beyond a border for the present one.

    Args:
        s: state of the run.
        table: from regions.region_table.
        i: coordinate, 0 for x, 1 for y.
        up: 1 for the upper border, -1 for the lower one.
    """
    index, least, most = s["index"], s["least_index"], s["most_index"]
    index[i] += up
    if least[i] <= index[i] <= most[i]:
        s["landings"] += 1
    least[i], most[i] = min(least[i], index[i]), max(most[i], index[i])
    settle(s, table, i)


def sides_of(s, table, x, y):
    """Borders between here and a place; moves the region on where one lies between cells alike.

    Args:
        s: state of the run.
        table: from regions.region_table.
        x: where a step leads, x [m].
        y: the same, y [m].

    Returns:
        (x, y), as `side`.
    """
    while True:
        sx, sy = side(x, s["low"][0], s["high"][0]), side(y, s["low"][1], s["high"][1])
        if (sx == 0) == (sy == 0) or not is_same_beyond(s, table, 1 if sy else 0, sx + sy):
            return sx, sy
        move_on(s, table, 1 if sy else 0, sx + sy)


def is_same_beyond(s, table, i, up):
    """Whether the clay beyond a border of the present region is the same.

    Args:
        s: state of the run.
        table: from regions.region_table.
        i: coordinate, 0 for x, 1 for y.
        up: 1 for the upper border, -1 for the lower one.
    """
    return regions.is_alike(table, s["index"][0], s["index"][1], i, up)


def cross(m, s, e, i, up):
    """Records a crossing and enters the next region; at the end of the path, closes the run.

    Args:
        m: the method.
        s: state of the run.
        e: its arrays.
        i: coordinate, 0 for x, 1 for y.
        up: 1 towards larger values, -1 towards smaller ones.
    """
    border = s["high"][i] if up > 0 else s["low"][i]
    n, crossings = s["crossed"], e.crossings
    crossings[n, 0], crossings[n, 1], crossings[n, 2] = float(i), border, s["t"]
    crossings[n, 3] = m.speed(s, e, i)
    s["crossed"] = n + 1
    if i == 0 and up > 0 and border == e.table[regions.END]:
        s["closing"] = FINISHED
    else:
        move_on(s, e.table, i, up)
        s["struck"] = 1


def distance_beyond(h, m, s, e, i, border):
    """Distance by which a step of length h would pass a border of coordinate i [m].

    Args:
        h: length of the step [s].
        m: the method.
        s: state of the run.
        e: its arrays.
        i: coordinate, 0 for x, 1 for y.
        border: where it lies [m].
    """
    m.propose(s, e, h)
    x, y = m.place(s, e, h)
    return (y if i else x) - border


def locate_event(m, s, e, after, place, sides):
    """The step that ends on the first border in its way.

    Args:
        m: the method.
        s: state of the run.
        e: its arrays.
        after: length of the step that crosses [s].
        place: where that leads, (x, y) [m].
        sides: borders that it crosses, see `side`, (x, y).

    Returns:
        (length [s], coordinate, side).
    """
    span, axis, up = after, -1, 0
    for i in range(2):
        if sides[i]:
            border = s["high"][i] if sides[i] > 0 else s["low"][i]
            length = find_root(distance_beyond, after, place[i] - border, m, s, e, i, border)
            if axis < 0 or length < span:
                span, axis, up = length, i, sides[i]
    return span, axis, up


def begin_sample(s):
    """Counts steps and regions from now on, a sample.

    Args:
        s: state of the run.
    """
    s["landings"], s["careful"] = 0, 0
    for i in range(2):
        s["least_index"][i] = s["most_index"][i] = s["index"][i]


def careful(m, s, e):
    """One step with a look at its end, which lies on a border if one is in the way.

    Args:
        m: the method.
        s: state of the run.
        e: its arrays.
    """
    target, after, on_grid = m.stop(s)
    if s["closing"] == OPEN and after == 0.0:
        s["closing"] = TIME_LIMIT
    s["careful"] += 1
    if on_grid:
        begin_sample(s)
    elif s["careful"] > MOST_STEPS:
        s["code"] = UNRESOLVED
        return
    axis, up = -1, 0  # border that the step ends on
    overx, overy = 0, 0  # borders stepped over without a step
    act = True
    while True:
        if after > s["resolved"]:  # in equal parts
            after /= math.ceil(after / s["resolved"] - NEAR)
        if s["closing"] != OPEN:
            after = 0.0
        elif act:  # once; anew in other clay
            m.act(s, e)
            act = False
            after = min(after, s["fine"])
        if s["struck"] and after > 0.0:
            s["struck"] = 0
            after = m.strike(s, e, after)
        m.propose(s, e, after)
        good = m.finite(s, e)
        if s["yields"] and after > 0.0 and good:
            after = m.meet(s, e, after, axis >= 0)
        if after == 0.0 or axis >= 0 or not good:
            break
        x, y = m.place(s, e, after)
        sx, sy = sides_of(s, e.table, x, y)
        # no way back over a border: it must not hold the run
        sx, sy = sx if overx in (0, sx) else 0, sy if overy in (0, sy) else 0
        if sx == 0 and sy == 0:
            break
        herex, herey = m.place(s, e, 0.0)
        if sx and side(herex, s["low"][0], s["high"][0]):
            i, over, overx = 0, sx, sx
        elif sy and side(herey, s["low"][1], s["high"][1]):
            i, over, overy = 1, sy, sy
        elif s["landings"] >= LANDINGS:
            break
        else:
            length, i, over = locate_event(m, s, e, after, (x, y), (sx, sy))
            if is_same_beyond(s, e.table, i, over):
                move_on(s, e.table, i, over)
            else:
                after, axis, up = length, i, over
            continue
        if is_same_beyond(s, e.table, i, over):
            move_on(s, e.table, i, over)
            continue
        cross(m, s, e, i, over)
        act = True
        if s["closing"] != OPEN and s["before"] == 0.0:
            break
    if s["before"] > 0.0 or s["closing"] == OPEN:
        m.keep(s, e, after, on_grid or s["closing"] != OPEN)
    if s["closing"] != OPEN:
        s["code"] = s["closing"]
    elif not good:
        s["code"] = NOT_FINITE
    else:
        m.commit(s, e, after)
        for j in range(2):
            s["old"][j], s["old"][2 + j] = s["base"][j], s["rate"][j]
        if s["yields"]:
            for j in range(6):
                s["flow_old"][j] = s["flow"][j]
        if s["grooved"]:
            s["bare"][2], s["bare"][3] = s["bare"][0], s["bare"][1]
            cut_place(s, e)
        s["before"] = after
        s["t"] += after
        if target - s["t"] <= 1e-9 * s["dt"]:
            m.arrive(s, target)
        if axis >= 0:
            cross(m, s, e, axis, up)


def advance(m, s, e, room):
    """Steps until rows or crossings are full, or the run is over.

    Args:
        m: the method.
        s: state of the run, which is advanced.
        e: its arrays.
        room: largest number of rows to fill.
    """
    while s["code"] == OPEN and s["filled"] < room and s["crossed"] < len(e.crossings) - 3:
        if s["yields"] and s["stopped"] > len(e.stops) - 8:
            break
        if not m.glide(s, e, room):
            careful(m, s, e)
