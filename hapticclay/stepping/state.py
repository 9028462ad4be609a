"""The state of a run, and the value of a kick: a block a part, None where the scene lacks it."""

from __future__ import annotations

from typing import Any, NamedTuple

OPEN, FINISHED, TIME_LIMIT, NOT_FINITE, UNRESOLVED = range(5)  # status of a run


class Axis(NamedTuple):
    """Compensator and reference model of one axis.

    Attributes:
        delta: compensator output [m]; for another shape, only start and command.
        rate: its rate [m/s].
        y: reference position [m].
        yrate: reference rate [m/s].
    """

    delta: float
    rate: float
    y: float
    yrate: float


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


class Sampled(NamedTuple):
    """Sampled control.

    Attributes:
        machine: controller and hardware now.
        event: what happens at this step's beginning; past once the step is taken.
    """

    machine: Any
    event: Any


class Machine(NamedTuple):
    """The controller in sampled time, and its hardware; missing parts are None.

    Attributes:
        x: compensator and reference model of x at the next sample.
        y: those of y.
        form: states of compensators of another shape.
        own: state of the user's own controller.
        hold: actuator output.
        samples: times of the next samples.
        force: net force last given to the compensators, (x, y) [N].
        rates: joint rates as measured by difference.
        filtered: states of the filters of the force, two of x, two of y.
        guard: the passivity observer.
        tool: place of the virtual tool, (x, y) [m].
        queue: torques on their way.
    """

    x: Axis
    y: Axis
    form: Any
    own: Any
    hold: Any
    samples: Any
    force: Any
    rates: Any
    filtered: Any
    guard: Any
    tool: Any
    queue: Any


class Formed(NamedTuple):
    """Compensators of another shape in sampled time.

    Attributes:
        x: states of x.
        y: states of y.
        start: output of start and command, to which they add, (x, y) [m].
    """

    x: Any
    y: Any
    start: Any


class Hold(NamedTuple):
    """Actuator output, held between samples.

    Attributes:
        tau: their torques [N.m].
        force: of the clay, as rendered [N].
        guard: the part of it that comes from the passivity controller [N].
        pull: the virtual coupling.
    """

    tau: Any
    force: Any
    guard: Any
    pull: Any


class Pull(NamedTuple):
    """The virtual coupling.

    Attributes:
        f: its force, (x, y) [N].
        u: velocity of its tool, (x, y) [m/s].
    """

    f: Any
    u: Any


class Held(NamedTuple):
    """What acts on the joints in a kick.

    Attributes:
        hold: actuator output.
        slip: torques of friction [N.m].
    """

    hold: Hold
    slip: Any


class Samples(NamedTuple):
    """Times of control samples.

    Attributes:
        k: index of the next.
        when: its time [s].
        then: time of the one after it [s].
    """

    k: int
    when: float
    then: float


class Rates(NamedTuple):
    """Joint rates as measured by difference.

    Attributes:
        w: after their filter [rad/s].
        oldest: row of the ring of past samples.
    """

    w: Any
    oldest: int


class Guard(NamedTuple):
    """The passivity observer.

    Attributes:
        energy: that the clay has taken, of x and y [J].
        place: of the handle at the last sample [m].
        newest: row of the ring of past forces.
    """

    energy: Any
    place: Any
    newest: int


class Queue(NamedTuple):
    """Torques on their way to the motors.

    Attributes:
        first: number of the next, counted from the start.
        n: how many there are.
        due: when the next come [s], INF for none.
        then: those after them.
    """

    first: int
    n: int
    due: float
    then: float


class Answer(NamedTuple):
    """Response of the controller to a sample.

    Attributes:
        shown: 1.0, 0.0 where the sample is lost.
        hold: requested actuator output.
        force: net force for the compensators [N].
        delta: their output at the sample [m].
        own: as Machine.own; and so on.
        rates: joint rates as measured.
        guard: the passivity observer.
        tool: the virtual tool.
    """

    shown: float
    hold: Hold
    force: Any
    delta: Any
    own: Any
    rates: Any
    guard: Any
    tool: Any


class Event(NamedTuple):
    """A control sample, or a change of the torques, at the beginning of a step.

    Attributes:
        on: whether there is one, 1.0 or 0.0.
        at: the handle after the kick that leads to it.
        w: joint rates there [rad/s].
        reaction: of the clay there.
        fh: force of the hand in that kick [N].
        work: the ledger with it.
        delta: compensator output at the sample [m].
        shown: 1.0 where a sample requests torques.
        asked: the requested output.
        machine: controller and hardware after the event.
    """

    on: float
    at: Any
    w: Any
    reaction: Any
    fh: Any
    work: Any
    delta: Any
    shown: float
    asked: Hold
    machine: Machine


class Clock(NamedTuple):
    """Present time of a run.

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
    """

    q: Any
    w: Any
    g: Any


class Region(NamedTuple):
    """Region in which all laws of the clay are constant.

    Attributes:
        index: along x and along y.
        low: its borders [m].
        high: its borders [m].
    """

    index: Any
    low: Any
    high: Any


class Growth(NamedTuple):
    """Clay that grows.

    Attributes:
        rate: of the damping [N.s/m per s].
        old: that of the clay before the sample.
    """

    rate: Any
    old: Any


class Clay(NamedTuple):
    """The clay.

    Attributes:
        region: where the handle is.
        b: present damping; that at t = 0 where it grows [N.s/m].
        old: that of the clay before the sample.
        growth: clay that grows.
        hit: a hit that drives motors into their limits.
        reaction: of the last kick.
        laws: beside plain viscous damping.
    """

    region: Region
    b: Any
    old: Any
    growth: Any
    hit: Any
    reaction: Any
    laws: Any


class Reaction(NamedTuple):
    """What clay beyond plain viscous damping did in a kick, and leaves to the next one.

    Attributes:
        owed: impulse owed by stiff clay [N.s].
        split: how the damping of stiff clay was split.
        contact: clay that yields.
    """

    owed: Any
    split: Any
    contact: Any


class Laws(NamedTuple):
    """Laws of the clay whose state changes with each step.

    Attributes:
        flow: clay that yields.
        elastic: clay that springs back.
        cut: clay that stays cut.
        more: states of the laws that are modules of their own.
    """

    flow: Any
    elastic: Any
    cut: Any
    more: Any


class Split(NamedTuple):
    """See damping.split_damping.

    Attributes:
        over: 1.0 where any part is reduced, else 0.0.
        share: of the force that is owed to the next kick, (x, y) [s].
        soft: 1/b where both steps are stiff, else 0.0, (x, y) [m/(N.s)].
    """

    over: float
    share: Any
    soft: Any


class Hit(NamedTuple):
    """A hit that drives motors into their limits.

    Attributes:
        fine: longest step after it [s].
        struck: whether the handle has just entered this clay, 1.0 or 0.0.
    """

    fine: float
    struck: float


class Flow(NamedTuple):
    """Clay that yields.

    Attributes:
        law: Fy, K, n of x, then of y.
        old: that of the clay before the sample.
    """

    law: Any
    old: Any


class Contact(NamedTuple):
    """Clay that yields, in a kick.

    Attributes:
        mean: force [N].
        v: velocity at the sample [m/s].
        f: force there [N].
        stuck: whether x and y rest after it, 1.0 or 0.0.
        anchor: where an axis came to rest beside one that slides [m], NaN elsewhere.
        still: whether both rest, 1.0 or 0.0.
        times: when they came to rest after the sample [s].
    """

    mean: Any
    v: Any
    f: Any
    stuck: Any
    anchor: Any
    still: float
    times: Any


class Elastic(NamedTuple):
    """Clay that springs back.

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


class Work(NamedTuple):
    """The ledger [J].

    Attributes:
        muscle: of the muscle.
        motors: of the motors.
        clay: taken by the clay.
        hand: taken by the damper of the hand.
        through: sum of the magnitudes.
        hardware: what hardware and held clay take; None without either.
    """

    muscle: float
    motors: float
    clay: float
    hand: float
    through: float
    hardware: Any


class HardwareWork(NamedTuple):
    """Energy that motors and their hardware take [J]; all but friction is part of motors.

    Attributes:
        friction: of the joints.
        guard: of the passivity controller.
        coupling: of the virtual coupling.
        rendered: of the force that the motors hold for the clay; 0 where the clay is physical.
    """

    friction: float
    guard: float
    coupling: float
    rendered: float


class Status(NamedTuple):
    """Status of a run.

    Attributes:
        code: OPEN while it is running.
        closing: why the next row is the last, OPEN where it is not.
        careful: steps with event detection since the last sample.
        landings: returns of the handle to a region since the last sample.
        seen: regions since then: least and most index along x, then along y.
    """

    code: int
    closing: int
    careful: int
    landings: int
    seen: Any


class Filled(NamedTuple):
    """What a run has made since the last check.

    Attributes:
        steps: engine steps.
        rows: of the record.
        crossings: of borders.
        stops: in clay that yields.
    """

    steps: int
    rows: int
    crossings: int
    stops: int


class State(NamedTuple):
    """A run between two steps.

    Attributes:
        clock: where in time it is.
        body: the arm.
        loop: the controller.
        clay: the clay.
        work: the ledger.
        status: status of the run.
        filled: what it has made.
    """

    clock: Clock
    body: Body
    loop: Any
    clay: Clay
    work: Work
    status: Status
    filled: Filled


# ---- the value of a kick -------------------------------------------------------------------------


class Step(NamedTuple):
    """The steps around a sample.

    Attributes:
        H: length of the kick [s].
        L: share of the kick before the sample.
        R: share of the kick after the sample.
        before: length of the step before [s].
        after: length of the step after [s].
    """

    H: float
    L: float
    R: float
    before: float
    after: float


class Handle(NamedTuple):
    """The handle at a sample, before the kick.

    Attributes:
        u: arm.jacobian [m].
        p: position [m].
        W: arm.mobility [1/kg].
        v: velocity [m/s].
        c: centripetal acceleration [m/s^2].
    """

    u: Any
    p: Any
    W: Any
    v: Any
    c: Any


class Load(NamedTuple):
    """Force on the handle that is linear in its velocity u after the kick: f - d u.

    Attributes:
        f: (x, y) [N].
        d: (xx, yy, xy) [N.s/m].
    """

    f: Any
    d: Any


class Law(NamedTuple):
    """What drives the handle: n u = a + W (f - d u).

    Attributes:
        n: weight of u, (x, y) [1/s].
        a: acceleration without forces, (x, y) [m/s^2].
        rest: the same of a handle at rest.
        W: acceleration per unit of net force, (xx, xy, yy) [1/kg].
    """

    n: Any
    a: Any
    rest: Any
    W: Any


class Viscous(NamedTuple):
    """Damping of the clay in a kick.

    Attributes:
        b0: on the velocity before it, (x, y) [N.s/m].
        b1: on the velocity after it.
    """

    b0: Any
    b1: Any


class Acting(NamedTuple):
    """What acts on the handle in a kick, whatever drives it.

    Attributes:
        step: the steps around it.
        at: the handle before it.
        viscous: damping in it.
        split: how stiff clay splits that.
        load: all of it that is linear in the velocity after the kick.
        f: of it the force of the clay on the velocity before [N].
        d: of it the damping of the clay on the velocity after, (xx, yy, xy) [N.s/m].
        uh: muscle force [N].
    """

    step: Step
    at: Handle
    viscous: Viscous
    split: Any
    load: Load
    f: Any
    d: Any
    uh: Any


class Motion(NamedTuple):
    """The handle in a kick.

    Attributes:
        u: velocity after it [m/s].
        f: net force [N].
        rest: force that stiff clay returns, less what it owes [N].
        beside: clay force beside its dampers [N].
        reaction: of the clay.
    """

    u: Any
    f: Any
    rest: Any
    beside: Any
    reaction: Any


class Kick(NamedTuple):
    """A kick.

    Attributes:
        step: the steps around it.
        at: the handle before it.
        viscous: damping in it.
        motion: of the handle.
        w: joint rates after it [rad/s].
        g: link accelerations [rad/s^2].
        damped: force of the dampers behind the sample [N].
        fe: mean force of the clay [N].
        uh: muscle force [N].
        tau: torques [N.m].
        delta: compensator output at the sample [m]; none of sampled control.
        loop: behind the step after it; of sampled control what acts on the joints.
    """

    step: Step
    at: Handle
    viscous: Viscous
    motion: Motion
    w: Any
    g: Any
    damped: Any
    fe: Any
    uh: Any
    tau: Any
    delta: Any
    loop: Any


# ---- the accurate method -------------------------------------------------------------------------


class Modes(NamedTuple):
    """How yielding clay acts in a step; along the motion, the first of each pair counts.

    Attributes:
        law: Fy, K, n of x, then of y.
        mode: of each axis, 0.0 where it rests, or the sign of its velocity; along the motion see
            modes.REST_MODE.
        way: direction of a handle that slides slowly or begins to slide, (x, y).
        anchor: where an axis that rests came to rest [m].
        ended: what ended the step before, see modes.RESTS.
        ends: what ends this one.
        stuck: whether x and y are noted as stopped, 1.0 or 0.0.
        fine: longest step that they allow [s].
    """

    law: Any
    mode: Any
    way: Any
    anchor: Any
    ended: Any
    ends: Any
    stuck: Any
    fine: float


class Course(NamedTuple):
    """The controller in the accurate method, in place of a Loop.

    Attributes:
        x: loop of x; its command is not in delta.
        y: loop of y.
        form: states of compensators of another shape, of x and of y.
        left: steps to the next sample; 0 where they must be recounted.
        share: length of each but the last [s].
        modes: of clay that yields.
    """

    x: Axis
    y: Axis
    form: Any
    left: int
    share: float
    modes: Any


class Moment(NamedTuple):
    """Time of a stage of a step.

    Attributes:
        t: time [s].
        near: a nearby time within the step, at which signals are evaluated [s].
        row: of the signals ahead; -1 where they have none.
        since: time since the start of the step [s].
    """

    t: float
    near: float
    row: int
    since: float


class Point(NamedTuple):
    """State at a stage of a step.

    Attributes:
        q: joint angles [rad].
        w: joint rates [rad/s].
        x: loop of x.
        y: loop of y.
        form: states of compensators of another shape.
    """

    q: Any
    w: Any
    x: Axis
    y: Axis
    form: Any


class Grip(NamedTuple):
    """What yielding clay does at an instant; along its axes where they yield separately.

    Attributes:
        a: acceleration of the handle without its force [m/s^2].
        B: acceleration removed per unit of it (xx, xy, yx, yy) [1/kg].
        v: velocity [m/s].
        f: its force [N].
    """

    a: Any
    B: Any
    v: Any
    f: Any


class Response(NamedTuple):
    """Response of the handle to forces.

    Attributes:
        g: its acceleration and centripetal acceleration [m/s^2].
        f: net force [N].
        r: force of yielding [N].
        grip: clay that yields.
    """

    g: Any
    f: Any
    r: Any
    grip: Any


class Instant(NamedTuple):
    """The loop at an instant.

    Attributes:
        p: position [m].
        v: velocity [m/s].
        b: damping of the clay [N.s/m].
        fe: force of the clay [N].
        fh: force of the hand [N].
        tau: torques [N.m].
        push: joint torques of hand and clay [N.m].
        delta: compensator output [m].
        x: delta'' and y'' of x [m/s^2].
        y: the same of y.
        form: rates of compensators of another shape.
        power: of muscle, motors, clay, the damper of the hand, and the sum of the magnitudes [W].
        grip: clay that yields.
    """

    p: Any
    v: Any
    b: Any
    fe: Any
    fh: Any
    tau: Any
    push: Any
    delta: Any
    x: Any
    y: Any
    form: Any
    power: Any
    grip: Any


class Sums(NamedTuple):
    """Sums over the stages of a step.

    Attributes:
        first: accelerations over all but the last: of the joints, delta and y of x, of y; six.
        last: the same over all but the first.
        form: rates of compensators of another shape, weighted.
        power: as Instant.power, weighted.
    """

    first: Any
    last: Any
    form: Any
    power: Any


class Shown(NamedTuple):
    """Quantities of an instant in a record, as Instant.

    Attributes:
        p: position [m].
        v: velocity [m/s].
        fh: force of the hand [N].
        tau: torques [N.m].
        delta: compensator output [m].
        b: damping of the clay [N.s/m].
        fe: force of the clay [N].
    """

    p: Any
    v: Any
    fh: Any
    tau: Any
    delta: Any
    b: Any
    fe: Any


class Stride(NamedTuple):
    """A step of the accurate method.

    Attributes:
        shown: its start.
        begin: force of yielding at its start, as Grip.f.
        last: clay that yields at its last stage.
        end: its end.
        work: the ledger there.
    """

    shown: Shown
    begin: Any
    last: Any
    end: Point
    work: Work
