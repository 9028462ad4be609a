"""The state of a run: values, a block a part; None where the scene lacks the part."""

from __future__ import annotations

from typing import Any, NamedTuple

OPEN, FINISHED, TIME_LIMIT, NOT_FINITE = range(4)  # how a run stands


class Pose(NamedTuple):
    """The arm at a sample.

    Attributes:
        u: arm.jacobian [m].
        p: handle position [m].
        W: arm.mobility [1/kg].
    """

    u: Any
    p: Any
    W: Any


class Axis(NamedTuple):
    """Compensator and reference model of one axis.

    Attributes:
        delta: compensator output [m]; of another shape, start and command alone.
        rate: its rate [m/s].
        y: reference position [m].
        yrate: reference rate [m/s].
    """

    delta: float
    rate: float
    y: float
    yrate: float


class Region(NamedTuple):
    """Where all laws of the clay keep their value.

    Attributes:
        index: along x and along y.
        low: its borders [m].
        high: its borders [m].
        base: clay, see clay.damping_at.
        rate: its growth.
        flow: Fy, K, n of x, then of y; None where nothing yields.
    """

    index: Any
    low: Any
    high: Any
    base: Any
    rate: Any
    flow: Any


class Before(NamedTuple):
    """The clay of the step before the sample.

    Attributes:
        base: as in Region.
        rate: as in Region.
        flow: as in Region.
    """

    base: Any
    rate: Any
    flow: Any


class Contact(NamedTuple):
    """Whether yielding clay holds the handle.

    Attributes:
        stuck: whether x and y rest, 1.0 or 0.0.
        anchor: where an axis came to rest beside one that slides [m], NaN elsewhere.
    """

    stuck: Any
    anchor: Any


class Elastic(NamedTuple):
    """The springs of the clay.

    Attributes:
        numbers: Spring.numbers and the direction of a surface, of x and of y.
        rest: of the first spring, of x and of y [m].
        stretch: elongation of the second [m].
        at: place of the handle at the last sample [m].
        force: now [N].
        before: at the end of the clay before [N].
        lost: energy lost [J].
        stored: energy stored [J].
        resolved: longest step that resolves it [s].
    """

    numbers: Any
    rest: Any
    stretch: Any
    at: Any
    force: Any
    before: Any
    lost: float
    stored: float
    resolved: float


class Cut(NamedTuple):
    """The tool in clay that stays cut.

    Attributes:
        at: place of the last cut [m].
        bare: clay without it [N.s/m].
        bare_before: that of the step before [N.s/m].
        drag: damping of it [N.s/m].
    """

    at: Any
    bare: Any
    bare_before: Any
    drag: float


class Hit(NamedTuple):
    """A hit that drives motors into their limits.

    Attributes:
        fine: longest step on the way from it [s].
        struck: whether the handle has just come into this clay, 1.0 or 0.0.
    """

    fine: float
    struck: float


class Work(NamedTuple):
    """The ledger [J].

    Attributes:
        muscle: of the muscle.
        motors: of the motors.
        clay: taken by the clay.
        hand: taken by the damper of the hand.
        through: sum of the magnitudes.
    """

    muscle: float
    motors: float
    clay: float
    hand: float
    through: float


class Filled(NamedTuple):
    """What a run has written since the last look.

    Attributes:
        rows: of the record.
        crossings: of borders.
        stops: in clay that yields.
    """

    rows: int
    crossings: int
    stops: int


class Clock(NamedTuple):
    """Where in time a run is.

    Attributes:
        t: now [s].
        i: the sample at or before now.
        before: length of the step that led here [s].
    """

    t: float
    i: int
    before: float


class Body(NamedTuple):
    """The arm.

    Attributes:
        q: joint angles [rad].
        w: joint rates [rad/s].
        g: link accelerations of the last kick [rad/s^2].
        pose: at q.
    """

    q: Any
    w: Any
    g: Any
    pose: Pose


class Loop(NamedTuple):
    """The controller in continuous time.

    Attributes:
        x: loop of x.
        y: loop of y.
        form: states of compensators of another shape, of x and of y.
    """

    x: Axis
    y: Axis
    form: Any


class Clay(NamedTuple):
    """The clay.

    Attributes:
        region: clay now.
        old: clay before the sample.
        owed: impulse owed by stiff clay [N.s].
        felt: what clay that yields did in the last kick.
        elastic: clay that springs back.
        cut: clay that stays cut.
        hit: a hit that saturates.
    """

    region: Region
    old: Before
    owed: Any
    felt: Any
    elastic: Any
    cut: Any
    hit: Any


class Ledger(NamedTuple):
    """Energy.

    Attributes:
        work: so far.
        p: place of the last kick [m].
        v: velocity after it [m/s].
        w: joint rates after it [rad/s].
    """

    work: Work
    p: Any
    v: Any
    w: Any


class Status(NamedTuple):
    """How a run stands.

    Attributes:
        code: OPEN while it goes on.
        closing: why the next row is the last, OPEN where it is not.
        landings: on borders since the last sample.
        steps: engine steps since the start.
    """

    code: int
    closing: int
    landings: int
    steps: int


class State(NamedTuple):
    """A run between two steps.

    Attributes:
        clock: where in time it is.
        body: the arm.
        loop: the controller.
        clay: the clay.
        ledger: energy.
        status: how it stands.
        filled: rows, crossings and stops written since the last look.
        machine: sampled control.
    """

    clock: Clock
    body: Body
    loop: Loop
    clay: Clay
    ledger: Ledger
    status: Status
    filled: Filled
    machine: Any


def with_clay(s, clay):
    """The state with other clay."""
    return State(s.clock, s.body, s.loop, clay, s.ledger, s.status, s.filled, s.machine)


def with_status(s, status):
    """The state with another status."""
    return State(s.clock, s.body, s.loop, s.clay, s.ledger, status, s.filled, s.machine)


def with_filled(s, filled):
    """The state with other counts."""
    return State(s.clock, s.body, s.loop, s.clay, s.ledger, s.status, filled, s.machine)


class Step(NamedTuple):
    """The steps around a sample.

    Attributes:
        H: length of the kick [s].
        L: share of it before the sample.
        R: share of it after the sample.
        before: length of the step before [s].
        after: length of the step after [s].
    """

    H: float
    L: float
    R: float
    before: float
    after: float


class Viscous(NamedTuple):
    """Damping in a kick: fe = b0 v + b1 u, v and u the velocities before and after it.

    Attributes:
        b0: of x and y [N.s/m].
        b1: of x and y [N.s/m].
        stiff: 1.0 where a part is reduced, else 0.0.
        share: see clay.split_damping [s].
        soft: the same [m/(N.s)].
    """

    b0: Any
    b1: Any
    stiff: float
    share: Any
    soft: Any


class Load(NamedTuple):
    """Force on the handle f - D u, u its velocity after the kick.

    Attributes:
        f: (x, y) [N].
        d: D, (xx, yy, xy) [N.s/m].
    """

    f: Any
    d: Any


class Law(NamedTuple):
    """What drives the handle: n u = a + W (f - D u).

    Attributes:
        n: (x, y) [1/s].
        a: (x, y) [m/s^2].
        rest: a of a handle at rest [m/s^2].
        W: (xx, xy, yy) [1/kg].
    """

    n: Any
    a: Any
    rest: Any
    W: Any


class Felt(NamedTuple):
    """What clay that yields did in a kick.

    Attributes:
        mean: force [N].
        v: velocity at the sample [m/s].
        f: force at the sample [N].
        contact: behind the kick.
        still: 1.0 where both axes rest.
        times: after the sample at which x and y came to rest [s].
    """

    mean: Any
    v: Any
    f: Any
    contact: Contact
    still: float
    times: Any


class Motion(NamedTuple):
    """The handle in a kick.

    Attributes:
        u: velocity after it [m/s].
        f: net force [N].
        rest: clay force beside its dampers, springs and yielding [N].
        owed: impulse owed [N.s].
        felt: clay that yields.
    """

    u: Any
    f: Any
    rest: Any
    owed: Any
    felt: Any


class Kick(NamedTuple):
    """A kick.

    Attributes:
        step: the steps around it.
        v: velocity before [m/s].
        w: joint rates after [rad/s].
        g: link accelerations [rad/s^2].
        viscous: damping in it.
        motion: of the handle.
        fe: mean force of the clay [N].
        uh: muscle force [N].
        tau: torques [N.m].
        delta: compensator output at the sample [m].
        x: loop behind the step after it.
        y: the same, y.
        form: the same of compensators of another shape.
    """

    step: Step
    v: Any
    w: Any
    g: Any
    viscous: Viscous
    motion: Motion
    fe: Any
    uh: Any
    tau: Any
    delta: Any
    x: Axis
    y: Axis
    form: Any
