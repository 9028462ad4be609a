"""The parts of a scene, as plain numbers; a part that the scene lacks is None.

A function that takes a part checks for None first: numba prunes that branch, so missing parts are
neither compiled nor run. Machine code is cached by the types of the parts.
"""

from __future__ import annotations

from typing import Any, NamedTuple

INF = float("inf")
FASTEST = 1e30  # [rad/s] faster joints have no state: their powers would leave the floats


class Time(NamedTuple):
    """Times of the samples.

    Attributes:
        dt: step [s].
        t_max: end of the run [s].
        last: number of whole steps.
    """

    dt: float
    t_max: float
    last: int


class Arm(NamedTuple):
    """The arm.

    Attributes:
        links: arm.Arm.links.
        ox: world position of p = 0, x [m].
        oy: the same, y [m].
    """

    links: Any
    ox: float
    oy: float


class Servo(NamedTuple):
    """The servo of one axis, see controller.Servo.numbers.

    Attributes:
        ratio: static gain of G.
        damping: of G [1/s].
        stiffness: of G [1/s^2].
        S: gain of Sh [1/kg].
        Sdamping: of Sh [1/s].
        Sstiffness: of Sh [1/s^2].
    """

    ratio: float
    damping: float
    stiffness: float
    S: float
    Sdamping: float
    Sstiffness: float


class Lag(NamedTuple):
    """The compensator of one axis as printed, K/(s (s + pole)).

    Attributes:
        K: gain [1/kg].
        pole: [rad/s].
    """

    K: float
    pole: float


class Form(NamedTuple):
    """Compensators of another shape.

    Attributes:
        gain: K of x and of y.
        order: the higher one.
        numbers: compensator.form_numbers of x, then of y.
        kick: compensator.form_kick of both, and the lengths of the steps that it is for.
        work: its workspace.
    """

    gain: Any
    order: int
    numbers: Any
    kick: Any
    work: Any


class Hand(NamedTuple):
    """Th of one axis.

    Attributes:
        mass: [kg].
        damper: [N.s/m].
        spring: [N/m].
        longer: 1 where a kick counts its spring by the longer step around it, else by their mean.
    """

    mass: float
    damper: float
    spring: float
    longer: Any


class Signal(NamedTuple):
    """A signal over the next steps.

    Attributes:
        table: of it, see model.pieces.
        ahead: for whole steps, one row per sample: the mean of a muscle force around it [N], or the
            change of a command to the next sample [m], to the next control sample where control is
            sampled. For the accurate method, one row per time of Ahead: the value there, or the
            change of a command since t = 0; (x, y).
        first: sample of the first row.
        halves: for a muscle force in sampled control, one row per sample: its mean over half a step
            before and after the sample, its value there [N]; (x, y) each.
    """

    table: Any
    ahead: Any
    first: int
    halves: Any = None


class Push(NamedTuple):
    """The muscle force.

    Attributes:
        steady: the part that is constant or changes evenly: since [s], x, y [N], rates x, y [N/s].
        muscle: the muscle's Signal.
    """

    steady: Any
    muscle: Any


class Clay(NamedTuple):
    """The clay.

    Attributes:
        growth: 1 where damping grows.
    """

    growth: Any


class Special(NamedTuple):
    """Laws of the clay in addition to plain viscous damping.

    Attributes:
        smooth: which axes have smooth clay.
        stiff: clay that a step may overshoot.
        flow: clay that yields.
        springs: clay that springs back.
        groove: clay that stays cut.
        more: laws that are modules of their own, see laws.
    """

    smooth: Any
    stiff: Any
    flow: Any
    springs: Any
    groove: Any
    more: Any


class Stiff(NamedTuple):
    """Clay so stiff that a step may overshoot.

    Attributes:
        mobility: largest acceleration of handle and hand per unit of force [1/kg].
    """

    mobility: float


class Hits(NamedTuple):
    """Clay so stiff that a hit may drive the motors into their limits within a step.

    Attributes:
        first: first step of such a hit, times the damping [s.N.s/m].
    """

    first: float


class Flow(NamedTuple):
    """Clay that yields.

    Attributes:
        along: None where the axes yield separately, 1 along the motion.
    """

    along: Any


class Springs(NamedTuple):
    """Clay that springs back.

    Attributes:
        longest: longest step that resolves them [s].
        rendered: None where the clay is physical, 1 where the motors render it.
    """

    longest: float
    rendered: Any


class Groove(NamedTuple):
    """Clay that stays cut.

    Attributes:
        numbers: groove.Groove.numbers.
        drag: damping per cross-section [N.s/m^3]; None for none.
        ground: remaining share of each cell.
        relief: height of the cells before any cut [m].
        rim: the clay in front of the tool, see groove.cut.
        removed: volume removed, see groove.add [m^3].
    """

    numbers: Any
    drag: Any
    ground: Any
    relief: Any
    rim: Any
    removed: Any


class Sampler(NamedTuple):
    """Sampled control and its hardware.

    Attributes:
        ratio: steps in a control sample.
        Ts: control sample [s].
        clay: the clay that acts on the handle; None where the motors render it.
        special: its laws in addition to plain viscous damping.
        rendered: 1 where the force that the motors hold is recorded.
        memory: rows (A, B) of controller.held_compensator of x, then of y.
        state_space: compensators of another shape.
        own: the user's own controller.
        command: the command's Signal.
        chance: random effects.
        uneven: 1 where events may lie between the steps.
        encoder: counts per turn.
        difference: joint rates by difference.
        filter: hardware.butterworth.
        adc: converter of the force.
        dac: converter of the torques.
        delay: of the torques.
        friction: Coulomb torques of both joints [N.m].
        passivity: the passivity controller.
        coupling: the virtual coupling.
    """

    ratio: int
    Ts: float
    clay: Any
    special: Any
    rendered: Any
    memory: Any
    state_space: Any
    own: Any
    command: Any
    chance: Any
    uneven: Any
    encoder: Any
    difference: Any
    filter: Any
    adc: Any
    dac: Any
    delay: Any
    friction: Any
    passivity: Any
    coupling: Any


class Own(NamedTuple):
    """The user's own controller.

    Attributes:
        law: called with the buffer.
        buffer: the floats that it reads and writes, see sampled_controller.BUFFER; compiled, their
            address.
        start: its state at the first sample.
    """

    law: Any
    buffer: Any
    start: Any


class Chance(NamedTuple):
    """Random effects on the next samples.

    Attributes:
        numbers: four a sample, see hardware.SampleNoise.
        first: sample of the first four.
    """

    numbers: Any
    first: int


class Difference(NamedTuple):
    """Joint rates by the difference of measured angles.

    Attributes:
        velocity_window: samples that it spans.
        cutoff: of the low-pass behind it [Hz].
        ring: index and angles of past samples, three numbers each.
    """

    velocity_window: int
    cutoff: Any
    ring: Any


class Converter(NamedTuple):
    """A converter of two channels.

    Attributes:
        bits: resolution.
        span: full scale of both.
    """

    bits: int
    span: Any


class Delay(NamedTuple):
    """Torques come late.

    Attributes:
        delay: [s].
        rows: of the ring.
        ring: torques on their way, QUEUED numbers each.
    """

    delay: float
    rows: int
    ring: Any


class Passivity(NamedTuple):
    """The passivity controller.

    Attributes:
        whole: whole samples of the delay.
        share: the remaining share of a sample.
        ring: forces at past samples, two numbers each.
    """

    whole: int
    share: float
    ring: Any


class Coupling(NamedTuple):
    """The virtual coupling.

    Attributes:
        spring: [N/m].
        damper: [N.s/m].
    """

    spring: float
    damper: float


class Modal(NamedTuple):
    """Yielding clay in the accurate method.

    Attributes:
        along: None where the axes yield separately, 1 along the motion.
        grain: as Parts.grain; None along the motion.
        mobility: largest acceleration per unit of force, including the path through C [1/kg].
        dt: length of a sample [s].
    """

    along: Any
    grain: Any
    mobility: float
    dt: float


class Ahead(NamedTuple):
    """Times of the accurate method where signals drive a run.

    Attributes:
        times: starts and middles of the next steps, ascending [s].
        breaks: times at which a step must end, ascending; the last is INF [s].
        slack: times that differ by no more count as equal [s].
    """

    times: Any
    breaks: Any
    slack: float


class Accurate(NamedTuple):
    """The accurate method.

    Attributes:
        substeps: engine steps per sample.
        blocks: the same by block of samples, where the clay grows.
        ahead: times where signals drive the run.
    """

    substeps: int
    blocks: Any
    ahead: Any = None


class Parts(NamedTuple):
    """A scene.

    Attributes:
        time: the samples.
        arm: the arm.
        servo: of x and of y.
        shaping: 1 where inertia is shaped.
        lag: compensators as printed, of x and of y; None where they have another shape.
        form: those of another shape.
        hand: the operator's arm, of x and of y.
        push: the muscle force.
        command: the command's Signal.
        limits: of the torques [N.m].
        table: borders and cells, from regions.region_table.
        clay: the clay.
        grain: cosine and sine of the angle between its axes and x, y.
        hits: clay in which a hit may saturate the motors within a step.
        special: laws of the clay, in addition to plain viscous damping, that every step resolves.
        sampler: sampled control.
        accurate: the accurate method.
        modal: clay that yields in it; special has no flow then.
    """

    time: Time
    arm: Arm
    servo: Any
    shaping: Any
    lag: Any
    form: Any
    hand: Any
    push: Push
    command: Any
    limits: Any
    table: Any
    clay: Any
    grain: Any
    hits: Any
    special: Any
    sampler: Any
    accurate: Any
    modal: Any
