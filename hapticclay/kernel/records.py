"""The records of a run: Model (what does not change), State, and the value of a Kick.

Units stand beside the names. A flag is 1 or 0; a number that only one part of a scene uses is 0
without that part, and no function reads it then.
"""

# the annotations of a declaration are what `layout.record` reads, not types
# pyright: reportInvalidTypeForm=false, reportGeneralTypeIssues=false

from .layout import Kind, floats, many, real, record, thing, whole, wholes

LAWS = 4  # most laws of the clay of a user in a scene
JOINTS = 12  # most joints of an arm
engine_step, engine_bias = Kind("engine_step"), Kind("engine_bias")
engine_full, engine_jac = Kind("engine_full"), Kind("engine_jac")
engine_dot = Kind("engine_dot")
own_control, law_load = Kind("own_control"), Kind("law_load")
law_moved, law_force = Kind("law_moved"), Kind("law_force")
engine_of = Kind("Engine_s *")
FUNCTIONS = """\
typedef void (*engine_step)(void *, void *);
typedef void (*engine_bias)(void *, void *, int, double *);
typedef void (*engine_full)(void *, void *, double *);
typedef void (*engine_jac)(void *, void *, double *, double *, int);
typedef void (*engine_dot)(void *, void *, double *, double *, double *, int);
typedef void (*own_control)(double *);
typedef void (*law_load)(double *, Kick_s *);
typedef void (*law_moved)(double *, double, double, double, double, double);
typedef void (*law_force)(double *, double, double, double, double, double *);
"""
TYPES = """\
    ctypedef void (*engine_step)(void *, void *) noexcept nogil
    ctypedef void (*engine_bias)(void *, void *, int, double *) noexcept nogil
    ctypedef void (*engine_full)(void *, void *, double *) noexcept nogil
    ctypedef void (*engine_jac)(void *, void *, double *, double *, int) noexcept nogil
    ctypedef void (*engine_dot)(void *, void *, double *, double *, double *, int) noexcept nogil
    ctypedef void (*own_control)(double *) noexcept nogil
    ctypedef void (*law_load)(double *, Kick_s *) noexcept nogil
    ctypedef void (*law_moved)(double *, double, double, double, double, double) noexcept nogil
    ctypedef void (*law_force)(double *, double, double, double, double, double *) noexcept nogil
"""


@record
class Engine:
    """The physics engine that moves the arm: its functions, and the numbers that it shares."""

    kinematics: engine_step  # mj_kinematics, and what else a step consists of
    com_pos: engine_step
    inertia: engine_step
    factor: engine_step
    transmission: engine_step
    com_vel: engine_step
    bias: engine_bias
    at_velocity: engine_step
    actuation: engine_step
    acceleration: engine_step
    integrate: engine_step
    model: thing
    data: thing
    q: floats
    w: floats
    ctrl: floats
    applied: floats
    timestep: floats
    ranges: floats  # of the torques
    M: floats
    forces: floats  # of bias
    out: floats  # of the force of a user's law
    # of an arm on the engine's terms
    full: engine_full  # mj_fullM
    move: engine_step  # mj_step2
    jacobian: engine_jac  # mj_jacSite or mj_jacBody
    jacobian_rate: engine_dot  # mj_jacDot
    handle: floats  # its place [m]
    J: floats  # engine's Jacobian of the handle, and its rate, by axis and degree of freedom
    Jdot: floats
    scratch: thing  # data of poses that are tried
    scratch_q: floats
    scratch_handle: floats
    scratch_forces: floats
    scratch_J: floats  # at measured angles: Jacobian of the handle, torques that hold the arm
    scratch_bias: floats
    joint_M: floats  # by the joints: inertia, Jacobian of the handle, bias torques
    joint_J: floats
    joint_bias: floats
    # where Python computes them: dampers beside the joints' own, torques of a fluid beside these,
    joint_D: floats
    joint_F: floats
    joint_c: floats  # centripetal acceleration
    pose: floats  # and the positions and rates for which
    at_pose: own_control
    at_rates: own_control
    at_scratch: own_control
    none: floats  # no array
    site: whole  # the handle's index as a site or body, and that of its body
    body: whole
    freedoms: whole
    # scratch of a kick
    factored: real  # time over which dampers stand in that factor
    lower: floats  # Cholesky factor of the inertia of a kick, by rows
    Y: floats  # rates of the joints per force of the handle, by joint and axis
    free: floats  # rates after a kick, at first without that force
    moment: floats  # momentum after a kick without friction and that force
    matrix: floats  # scratch of the solution with friction
    pivots: wholes


@record
class ModelAxis:
    """One axis of the handle."""

    servo: real[6]  # gain, damping [1/s], stiffness [1/s^2] of G, then of Sh
    K: real  # gain of the compensator [1/kg]
    pole: real  # of the compensator K/(s (s + pole)) [rad/s]
    z0: real[4]  # states of one of another shape, of a handle in steady motion
    memory: real[48]  # compensator and reference over a control sample: rows of `over_sample`
    mass: real  # of the hand [kg]; 0 without one, as damper and spring
    damper: real  # [N.s/m]
    spring: real  # [N/m]
    push: real  # constant muscle force [N]
    push_rate: real  # its rate [N/s]


@record
class LawSlot:
    """A law of the clay that is functions of a user."""

    load: law_load  # load(z, k): adds its load to that of a kick
    moved: law_moved  # moved(z, px, py, vx, vy, h): its state after a step
    force: law_force  # force(z, px, py, vx, vy, out): its force at an instant [N]
    z: floats  # its numbers: parameters and state
    scratch: floats  # the same, for a state that is tried
    size: whole


@record
class Span:
    """Numbers of a scene that steps write."""

    at: floats
    kept: floats  # room for a copy
    size: whole


@record
class Model:
    """A scene: what a run does not change."""

    # times
    dt: real  # [s]
    t_max: real  # [s]
    last: whole  # number of whole steps
    method: whole  # see methods
    # arm
    links: real[5]  # Arm.links
    ox: real  # world position of p = 0 [m]
    oy: real
    limit: real[12]  # of the torques [N.m]
    joints: whole
    axes: whole  # of the handle
    general: whole  # the arm is on the engine's terms, not in closed form
    computed: whole  # Python computes its terms: its chain is closed, or some are not linear
    dof: wholes  # degree of freedom of each joint
    row: whole[3]  # axis of the world of each axis
    at: real[3]  # place of p = 0 [m]
    places: whole  # borders or the end of the path are looked for
    damper: real[12]  # of the joints [N.m.s/rad]
    spring: real[12]  # [N.m/rad]
    pull: real[12]  # of the spring at q = 0 [N.m]
    drive_damper: real[12]  # the part of these that motors make
    drive_spring: real[12]
    drive_pull: real[12]
    joint_law: whole  # proportional and derivative laws drive the joints
    gains: real[12]  # [N.m/rad], 0 where the drives have them
    rate_gains: real[12]  # [N.m.s/rad]
    reference: real[12]  # [rad]
    rate: whole  # how a joint's rate is had: 0 exact, 1 difference, 2 filter
    rate_cutoff: real  # [rad/s]
    rate_bits: whole
    rate_range: real  # [rad/s]
    fed_friction: real[36]  # Fc, k, Fv of each joint
    feeds_gravity: whole
    weight: real[3]  # of the hand [N]
    start: real[12]  # joints at the start [rad]
    extra: floats  # what such an arm adds to rows
    # loop
    shaping: whole  # inertia is shaped
    formed: whole  # compensators have another shape than K/(s (s + pole))
    order: whole  # of these, the higher one
    form: real[50]  # of these, compensator.form_numbers of x and of y
    hand: whole
    spring_uses_longer_step: whole  # the hand's spring acts over the longer step around a kick
    push_since: real  # [s]
    # signals over the next steps, see Drives
    muscle: whole
    muscle_table: floats
    muscle_ahead: floats
    muscle_halves: floats  # in sampled control
    muscle_first: whole
    command: whole
    command_table: floats
    command_ahead: floats
    command_first: whole
    # clay
    clay: whole
    acts: whole  # it acts on the handle; else the motors render it
    special: whole  # more than viscous
    table: floats  # regions
    rotated: whole
    yields_rotated: whole  # it yields along its rotated axes
    cosine: real  # of the angle between its axes and x, y
    sine: real
    grows: whole
    smooth: whole  # which axes are: 1 x, 2 y, 3 both
    stiff: whole
    mobility: real  # largest acceleration of handle and hand per unit of force [1/kg]
    hits: whole
    first_hit: real  # first step of a hit, times the damping [s.N.s/m]
    flow: whole  # 1 yields by axis, 2 along the motion
    springs: whole  # 1 physical, 2 rendered
    spring_step: real  # longest step that resolves the springs [s]
    groove: whole
    grid: real[10]  # Groove.numbers
    drags: whole  # it damps
    drag: real  # damping per cross-section [N.s/m^3]
    ground: floats  # remaining share of each cell
    relief: floats  # height of the cells [m]
    rim: floats  # clay in front of the tool
    removed: floats  # volume [m^3], and its rounding
    laws: whole  # number of laws of a user
    law: many(LawSlot, 4)
    # sampled control
    ratio: whole  # steps in a control sample
    Ts: real  # [s]
    uneven: whole  # events may lie between the steps
    drops_events: whole  # crossings and stops are overwritten, since nothing reads them
    halts: whole  # no further step is made: another thread may say so while steps are made
    records_clay_force: whole  # fe is recorded, since it is not b v
    records_held_force: whole  # as the motors hold it
    chance: whole
    chances: floats  # four numbers a sample
    chance_first: whole
    encoder: whole  # joints have encoders
    count: real[12]  # step of their readings [rad, m of slides], 0 for exact ones
    window: whole  # samples of the difference, 0 for exact rates
    cutoff: real  # of the low-pass after it [Hz], 0 for none
    angles: floats  # ring of past angles
    filtered: whole
    filter: real[6]
    adc_bits: whole
    adc_range: real  # [N]
    dac_bits: whole
    dac_range: real[12]  # [N.m]
    delay: real  # of the torques [s], 0 for none
    queue: floats  # ring of torques on their way
    queue_rows: whole
    friction: whole
    slip: real[12]  # Coulomb torques [N.m]
    guard: whole  # passivity controller
    guard_whole: whole  # whole samples of the delay
    guard_share: real  # the rest of it
    forces: floats  # ring of past forces
    coupling: whole
    coupling_spring: real  # [N/m]
    coupling_damper: real  # [N.s/m]
    own: whole  # the user's own controller
    control: own_control
    buffer: floats
    buffer_size: whole  # its numbers of state
    renders: whole  # the motors hold the force of clay that the loop computes
    hardware: whole  # the ledger counts what motors and their hardware take
    # accurate method
    substeps: whole  # engine steps per sample
    blocks: wholes  # the same by block of samples, where the clay grows
    ahead: whole  # signals drive the run
    times: floats  # starts and middles of the next steps [s]
    times_count: whole
    breaks: floats  # times at which a step must end [s]
    breaks_count: whole
    slack: real  # times that differ by no more are equal [s]
    modal: whole  # clay that yields: 1 by axis, 2 along the motion
    lightness: real  # largest acceleration per unit of force, by way of C too [1/kg]
    # what a run fills
    engine: engine_of
    spans: whole  # of numbers of the scene that steps write
    span: many(Span, 12)
    rows: floats
    crossings: floats
    stops: floats
    rendered: floats
    max_crossings: whole
    max_stops: whole
    axis: many(ModelAxis, 3)


@record
class KickAxis:
    """One axis of the handle in a kick."""

    p: real  # position [m]
    v: real  # velocity before [m/s]
    c: real  # centripetal acceleration [m/s^2]
    uh: real  # muscle force [N]
    b0: real  # damping of the clay on the velocity before [N.s/m]
    b1: real  # on that after
    share: real  # of the slow force of stiff clay, owed to the next kick
    soft: real  # 1/b where both steps are stiff [m/(N.s)]
    f: real  # load f - d u [N]
    d: real  # [N.s/m]
    clay: real  # force of the clay on the velocity before [N]
    clay_d: real  # and damping on that after [N.s/m]
    damped: real  # force of the dampers after the sample [N]
    n: real  # law n u = a + S (f - d u) [1/s]
    a: real  # [m/s^2]
    rest: real  # a of a handle at rest
    u: real  # velocity after [m/s]
    net: real  # net force [N]
    fe: real  # mean force of the clay [N]
    pull: real  # of its springs [N]
    freed: real  # 1 where a surface would pull, and has let go
    back: real  # what stiff clay returns less what it owes [N]
    owed0: real  # impulse owed before [N.s]
    owed: real  # and after
    stuck0: real  # rests in clay that yields, before
    stuck: real  # after
    anchor0: real  # where it came to rest [m]
    anchor: real
    mean: real  # force of yielding [N]
    sv: real  # velocity at the sample [m/s]
    sf: real  # force of yielding there [N]
    stop: real  # when it came to rest after the sample [s]
    delta: real  # compensator output at the sample, without the force of the kick [m]
    feed: real  # what each unit of that force adds [m/N]
    ref: real  # rate of the reference, without that force [m/s]
    ref_feed: real  # and with each unit of it [m/(N.s)]
    next_delta: real  # compensator and reference after the step
    next_rate: real
    next_y: real
    next_yrate: real
    z: real[4]  # compensator of another shape, after the step


@record
class Kick:
    """A kick: scratch; the run uses the last one."""

    H: real  # its length [s]
    L: real  # share before the sample
    R: real  # share after
    before: real  # step before [s]
    after: real  # step after [s]
    u: real[4]  # arm.jacobian [m]
    Wxx: real  # mobility [1/kg]
    Wxy: real
    Wyy: real
    Wxz: real
    Wyz: real
    Wzz: real
    Sxx: real  # that of the law
    Sxy: real
    Syy: real
    dxy: real  # of the load [N.s/m]
    clay_dxy: real  # of it, of the clay
    splits: real  # whether stiff clay is split
    still: real  # whether clay holds the handle
    o: real[12]  # joint rates before [rad/s]
    w: real[12]  # after
    g: real[12]  # accelerations [rad/s^2], in closed form those of the links
    tau: real[12]  # torques of the motors [N.m]
    slip: real[12]  # of friction [N.m]
    axis: many(KickAxis, 3)


@record
class LoopAxis:
    """Compensator and reference model of an axis."""

    delta: real  # compensator [m]; of another shape, its start and the command alone
    rate: real
    y: real  # reference model [m]
    yrate: real
    z: real[4]  # states of a compensator of another shape


@record
class StateAxis(LoopAxis):
    """One axis of controller and clay."""

    index: whole  # of the region
    low: real  # its borders [m]
    high: real
    b: real  # damping; at t = 0 where it grows [N.s/m]
    b_rate: real
    old: real  # of the clay before the sample
    old_rate: real
    owed: real
    stuck: real
    anchor: real
    Fy: real  # clay that yields
    Kn: real
    n: real
    old_Fy: real
    old_Kn: real
    old_n: real
    k: real  # spring of the clay
    k_limit: real
    k1: real
    tau: real
    way: real
    rest: real
    stretch: real
    at: real
    force: real
    force_before: real
    cut: real  # place of the last cut [m]
    bare: real  # clay without a groove [N.s/m]


@record
class MachineAxis(LoopAxis):
    """One axis of controller and hardware."""

    start: real  # its start and command [m]
    force: real  # of the clay as rendered [N]
    guard: real  # of it, from the passivity controller [N]
    pull: real  # of the virtual coupling [N]
    pull_rate: real  # velocity of its tool [m/s]
    net: real  # given to the compensator [N]
    filter: real[2]  # of the force
    energy: real  # that the passivity observer counts [J]
    place: real  # of the handle at the last sample [m]
    tool: real  # of the coupling [m]


@record
class Machine:
    """Controller and hardware of sampled control."""

    k: whole  # index of the next sample
    when: real  # its time [s]
    then: real  # of the one after it
    oldest: whole  # row of the ring of angles
    newest: whole  # row of the ring of forces
    first: whole  # queue of torques
    n: whole
    due: real
    due_then: real
    tau: real[12]  # that joints hold [N.m]
    w: real[12]  # joint rates as measured [rad/s]
    past: real[12]  # joint positions as measured at the last sample [rad]
    axis: many(MachineAxis, 2)


@record
class Work:
    """The ledger [J]."""

    muscle: real
    motors: real
    clay: real
    hand: real
    through: real
    friction: real  # of the joints; the next three are part of motors
    guard: real  # of the passivity controller
    coupling: real  # of the virtual coupling
    rendered: real  # of the force that the motors hold for the clay
    joints: real  # taken by the dampers of the joints


@record
class Point:
    """A stage of a step of the accurate method."""

    q1: real
    q2: real
    w1: real
    w2: real
    axis: many(LoopAxis, 2)


@record
class GripAxis:
    """What yielding clay does to one of its axes at an instant."""

    a: real  # acceleration of the handle without its force [m/s^2]
    v: real  # velocity [m/s]
    f: real  # its force [N]


@record
class Grip:
    """What yielding clay does at an instant."""

    B: real[4]  # acceleration removed per unit of its force (xx, xy, yx, yy) [1/kg]
    axis: many(GripAxis, 2)


@record
class InstantAxis:
    """One axis of the loop at an instant."""

    b: real  # damping of the clay [N.s/m]
    fe: real  # its force [N]
    fh: real  # of the hand [N]
    shown: real  # output of the compensator [m]
    ddelta: real  # delta''
    dy: real  # y''
    dz: real[4]  # rates of a compensator of another shape
    r: real  # force of yielding [N]
    acc: real  # acceleration [m/s^2]


@record
class Instant:
    """The loop at an instant."""

    tau1: real
    tau2: real
    push1: real  # joint torques of hand and clay [N.m]
    push2: real
    power: real[5]  # muscle, motors, clay, damper of the hand, sum of the magnitudes [W]
    grip: Grip
    axis: many(InstantAxis, 2)


@record
class Sums:
    """Sums over the stages of a step."""

    first: real[6]  # accelerations of the joints, delta and y of x, of y: all but the last stage
    last: real[6]  # all but the first
    z: real[8]
    power: real[5]


@record
class ModeAxis:
    """How yielding clay acts on one of its axes; along the motion, the first one counts."""

    Fy: real
    Kn: real
    n: real
    mode: real  # 0 at rest, or the sign of the velocity; along the motion see modes.SLIDING
    way: real  # direction of a handle that slides slowly, or begins to slide
    anchor: real  # where an axis that rests came to rest [m]
    ended: real  # what ended the step before, see modes.RESTS
    ends: real  # what ends this one
    stuck: real  # noted as stopped


@record
class Stride:
    """A step of the accurate method: scratch."""

    length: real
    p1: real  # position at its start [m]
    p2: real
    v1: real
    v2: real
    now: Instant  # at the stage worked on
    shown: Instant  # at its start
    last: Grip  # at its last stage
    z: Point
    begin: Point
    end: Point
    sums: Sums
    work: Work


@record
class Watch:
    """What the quick test of the monitor carries from one look to the next."""

    quiet: whole  # nothing to report so far
    # samples; the last one that moved, the last one below the torque limits; samples at them
    seen: whole[4]
    swings: real[32]  # 16 of x, then of y


@record
class State:
    """A run between two steps."""

    t: real  # [s]
    i: whole  # sample at or before now
    before: real  # length of the step that led here [s]
    q: real[12]  # joints
    w: real[12]
    g: real[12]
    sensed: whole  # the engine has the arm at q
    max_step: real  # after a hit [s]
    entered: real  # 1.0 if the handle has just entered this clay
    springs_dissipated: real  # energy [J]
    springs_stored: real
    spring_step: real  # longest step that resolves the springs here [s]
    drag: real  # damping of a groove [N.s/m]
    form_kick: real[50]  # compensator.form_kick of x and of y, for these steps:
    form_before: real
    form_after: real
    form_work: real[64]
    code: whole
    closing: whole  # why the next row is the last, OPEN where it is not
    looks: whole  # rows with which a look ahead ends, 0 for none
    checked_steps: whole  # with event detection, since the last sample
    returns: whole  # to a region, since then
    seen: whole[4]  # regions since then: least and most index along x, then y
    steps: whole  # since the last look
    row: whole
    crossing: whole
    stopped: whole
    # sampled control
    at_event: whole  # an event begins the step
    responded: whole  # the controller responded to its sample
    requested: real[20]  # its response: torques, force, guard, pull and velocity of the tool
    angles: real[12]  # of the joints as measured [rad], and their rates [rad/s]
    rates: real[12]
    fz: real  # force of the hand along z on a sensor [N]
    fh: real[3]  # force of the hand in the kick to the event
    delta1: real  # compensator at the sample [m]
    delta2: real
    # accurate method
    steps_left: whole  # to the next sample; 0 where they must be counted again
    step_length: real  # of each but the last [s]
    mode_step: real  # longest step that the modes allow [s]
    axis: many(StateAxis, 2)
    mode: many(ModeAxis, 2)
    work: Work
    work_at_event: Work  # the ledger including the kick to the event
    now: Machine
    next: Machine  # after the event
    k: Kick  # of the step
    e: Kick  # to the event
    a: Stride
    watch: Watch


@record
class Summary:
    """The end of a run without its samples."""

    row: real[16]  # last one
    force: real[2]  # of the clay in it, where b v does not give it [N]
    crossings: whole
    crossed: real[24]  # axis, time [s] and speed [m/s] of the first eight
    steps: whole
    kinetic: real[2]  # energy of the arm at start and end [J]
    at_hand: real[2]  # stored in the hand


RECORDS = (
    Engine, ModelAxis, KickAxis, Kick, LawSlot, Span, Model, LoopAxis, StateAxis, MachineAxis,
    Machine, Work, Point, GripAxis, Grip, InstantAxis, Instant, Sums, ModeAxis, Stride, Watch,
    State, Summary,
)  # fmt: skip
