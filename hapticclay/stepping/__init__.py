"""How a run advances: parts of a scene in, values of a kick out.

`parts` and `state` define all data of a step; an argument named like one of their fields is that
field. The other names have one meaning in every module here:

Names:
    parts: the Parts of a scene.
    part: the part that the function handles; None where the scene lacks it.
    state: of a part or of a law.
    states: of several of them.
    s: the State of a run, or in `scene` the Scenario.
    e: the Engine, with the arrays that a run fills.
    probe: the Engine, where the accurate method evaluates its steps; None for the fast method.
    k: the value of a Kick, or the Stride of the accurate method.
    acting: what acts in a kick, an Acting.
    now: an Instant, or what holds now.
    sums: the Sums of a step.
    runs: the Runs of a batch.
    signal: a Signal.
    like: a value of the same kind.
    m: Modes, Motion or Machine.
    z: a loop, or states of a compensator.
    x: a block of the state, or an x component.
    y: a y component.
    i: index of an axis, sample, row or border.
    n: weight, number or index.
    o: offset into an array of numbers.
    t: time [s].
    h: length of a step [s].
    dt: length of a whole step [s].
    H: length of a kick [s].
    L: share of a kick before its sample.
    after: length of the step behind a sample [s].
    before: length of the step before a sample [s], or the state before.
    target: time of the next stop [s].
    on_grid: whether now is a sample.
    shows: whether the step that begins now has a row in the record.
    room: rows that may be filled.
    q: joint angles [rad].
    w: joint rates [rad/s].
    g: link accelerations [rad/s^2].
    p: position of the handle [m].
    v: velocity of the handle [m/s].
    slow: velocity at a sample where the clay is not stiff [m/s].
    u: velocity after a kick [m/s], or arm.jacobian [m].
    c: centripetal acceleration [m/s^2], a Clock or a Clay.
    a: what acts in a kick, or an acceleration [m/s^2].
    f: force [N].
    shift: change of the command to the next sample [m].
    fe: force of the clay [N].
    fh: force of the hand [N].
    uh: muscle force [N].
    tau: torques [N.m].
    limit: largest torques of both joints [N.m].
    b: damping [N.s/m].
    rests: whether an axis rests.
    d: damping on the velocity after a kick [N.s/m].
    W: acceleration per unit of force [1/kg].
    B: velocity or acceleration per unit of force.
    K: gain of a compensator [1/kg], or consistency of clay that yields.
    law: what drives the handle, or the numbers of a clay law.
    law_: a Law, where `law` is a module.
    load: a Load.
    signal: a Signal of the parts.
    states: of laws that are modules of their own.
    at: a Handle.
    links: arm.Arm.links.
    r: a Region.
    pull: force of the clay or of a coupling [N].
    laws_: the Laws of the clay.
    index: of a region, (x, y).
    here: place of the handle now, (x, y) [m].
    border: place of a border [m].
    crossed: coordinate of the border that the handle crosses, -1 for none.
    what: coordinate of a border, or from search.MODE_X on the axis whose mode ends.
    up: side of a border, 1 or -1.
"""
