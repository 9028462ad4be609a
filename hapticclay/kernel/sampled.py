"""Sampled control around the kick: it senses, computes, queues and holds torques.

At an event (a control sample or a change of the torques) the kick is split in two. The first, under
the old torques, brings the velocity to the sample, where it is measured. The second is under the
new torques.
"""

import math

from ..formulas import arm as arm_law
from ..formulas import compensator, controller, numbers
from . import (
    arm,
    friction,
    hand,
    hardware,
    joint_kick,
    joint_law,
    joints,
    kick,
    laws,
    ledger,
    memory,
    servo,
    signals,
    viscous,
    yielding,
)

SLACK = 1e-9  # share of dt: events so close count as one
REACTION = 1e-9  # [s] a force within this time after a sample counts as that at it
NOT_FINITE = 3


# ---- a kick under held torques -------------------------------------------------------------------


def is_early(s, after):
    """Whether the kick before a step begins at an event."""
    return s.at_event and after > 0.0


def machine_of(s, after):
    """The machine whose torques act in the kick before a step of length `after`."""
    return s.next if is_early(s, after) else s.now


def by_hold(m, s, k, after):
    """The kick under the torques that the motors hold: from an event, else across the sample."""
    if is_early(s, after):
        kick.begin(k, 0.0, after)
        from_event(m, s, s.e, k)
        move_under(m, s, k, s.next)
    else:
        across(m, s, k, after)


def across(m, s, k, after):
    """The kick across the sample, even if an event begins there."""
    kick.begin(k, s.before, after)
    kick.take_over(m, s, k)
    if m.general:
        joints.before_kick(m, s, k)
    else:
        r1, r2 = s.w[0], s.w[0] + s.w[1]
        arm.handle_at(m, k, s.q[0], s.q[1], r1, r2)
        arm.turning(k, r1, r2)
    move_under(m, s, k, s.now)


def move_under(m, s, k, machine):
    """Motion in a kick under the torques of a machine."""
    for i in range(m.joints):
        k.tau[i], k.slip[i] = machine.tau[i], 0.0
    if m.general:
        joint_kick.move_under(m, s, k)
        return
    kick.load(m, s, k)
    if m.friction:
        friction.find(m, s, k, k.tau[0], k.tau[1])
        friction.drive(m, s, k, k.tau[0] + k.slip[0], k.tau[1] + k.slip[1])
    else:
        friction.drive(m, s, k, k.tau[0], k.tau[1])


def from_event(m, s, e, k):
    """Begins where the kick to an event ended."""
    for i in range(m.joints):
        k.o[i] = e.w[i]
    if m.general:
        joints.from_event(m, s, k)
        return
    memory.copied4(k.u, e.u)
    k.Wxx, k.Wxy, k.Wyy = e.Wxx, e.Wxy, e.Wyy
    for i in range(2):
        o, z = k.axis[i], e.axis[i]
        o.p, o.v, o.c, o.owed0, o.stuck0, o.anchor0 = z.p, z.v, z.c, z.owed, z.stuck, z.anchor


# ---- an event ------------------------------------------------------------------------------------


def act(m, s):
    """Lets the controller sample, and changes the torques, at the beginning of a step."""
    now = s.t + SLACK * m.dt
    samples = s.now.when <= now
    if samples or (m.delay > 0.0 and s.now.due <= now):
        event(m, s, 1 if samples else 0, now)
    else:
        s.at_event = 0


def event(m, s, samples, now):
    """The kick that leads to an event, the measurement, and the torques after it."""
    e = s.e
    for i in range(m.axes):
        s.fh[i] = 0.0
    for i in range(m.joints):
        e.tau[i] = e.slip[i] = 0.0
    s.at_event = 0
    if s.before > 0.0:
        across(m, s, e, 0.0)
        for i in range(m.axes):
            s.fh[i] = hand.force(m, e, i)
        ledger.add_work(m, s.work, s.work_at_event, e, e.o, s.now, s.q)
    else:
        rest(m, s, e)
        memory.copied(s.work_at_event, s.work)
    if m.general:
        joints.at_event(m, e)
    else:
        arm.at_rates(e, e.w[0], e.w[1])
    memory.copied(s.next, s.now)
    s.delta1, s.delta2 = s.now.x.delta, s.now.y.delta
    s.at_event, s.responded = 1, 0
    if samples:
        sample(m, s)
    if m.delay > 0.0:
        hardware.advance_queue(m, s, now)


def rest(m, s, e):
    """A kick of no length."""
    kick.take_over(m, s, e)
    e.H = 0.0
    for i in range(m.joints):
        e.w[i], e.g[i] = s.w[i], 0.0
    if m.general:
        joints.before_kick(m, s, e)
    else:
        arm.handle_at(m, e, s.q[0], s.q[1], s.w[0], s.w[0] + s.w[1])
    for i in range(m.axes):
        o = e.axis[i]
        o.u, o.owed, o.stuck, o.anchor, o.sf, o.stop = o.v, o.owed0, o.stuck0, o.anchor0, 0.0, 0.0


def put_times(m, machine, k):
    """Puts sample k and the one after it into a machine."""
    machine.k = k
    machine.when = k * m.ratio * m.dt + hardware.lateness(m, k)
    machine.then = (k + 1) * m.ratio * m.dt + hardware.lateness(m, k + 1)


def sample(m, s):
    """Sense, compute, hold."""
    seen, fx, fy = s.k, 0.0, 0.0
    sense(m, s, seen)
    if not m.joint_law:
        ux, uy = signals.push_now(m, s)
        fx, fy = on_sensor(m, s, seen, ux, uy)
        fx, fy = hardware.measured(m, s, 0, fx), hardware.measured(m, s, 1, fy)
        if m.axes > 2:
            s.fz = hardware.converted(m, s.fz)
    dx, dy = signals.command_over_sample(m, s)
    if not hardware.is_lost(m, s.now.k):
        s.responded = 1
        respond(m, s, seen, fx, fy)
        hardware.note_request(m, s)
    if not m.own and not m.joint_law:
        advance(m, s, 0, dx)
        advance(m, s, 1, dy)
    put_times(m, s.next, s.now.k + 1)


def respond(m, s, k, fx, fy):
    """Response of the controller to a sample that is not lost."""
    q, w = s.angles, s.rates
    for i in range(m.joints):
        q[i] = hardware.encoded(m, i, s.q[i])
    if m.window > 0:
        hardware.differenced(m, s, q, w)
    if m.own:
        call_own_controller(m, s, k, fx, fy)
    elif m.joint_law:
        joint_law.respond(m, s, k)
    else:
        if m.encoder > 0:
            arm.handle_at(m, k, q[0], q[1], w[0], w[0] + w[1])
            arm.turning(k, w[0], w[0] + w[1])
        elif m.window > 0:
            arm.at_rates(k, w[0], w[1])
        compute(m, s, k, fx, fy)


# ---- sense ---------------------------------------------------------------------------------------


def sense(m, s, k):
    """The handle at a sample, into k, and the joint rates there [rad/s].

    Half a kick holds too little of stiff clay: the velocity there is that of a whole kick, with the
    step before it repeated.
    """
    e, x, y = s.e, s.e.x, s.e.y
    for i in range(m.joints):
        s.rates[i] = e.w[i]
    if m.general:
        joints.sensed_handle(m, s, k)
        return
    vx, vy = x.u, y.u
    if m.acts and m.special and m.stiff and s.before > 0.0:
        across(m, s, k, s.before)
        vx = kick.velocity(m, k, 0) if k.x.soft > 0.0 else vx
        vy = kick.velocity(m, k, 1) if k.y.soft > 0.0 else vy
    memory.copied4(k.u, e.u)
    k.Wxx, k.Wxy, k.Wyy = e.Wxx, e.Wxy, e.Wyy
    for i in range(2):
        o, z = k.axis[i], e.axis[i]
        o.p, o.v, o.c = z.p, z.v, z.c
    if vx == x.u and vy == y.u:
        return
    r1, r2 = arm_law.joint_velocity(vx, vy, e.u, 1.0)
    s.rates[0], s.rates[1] = r1, r2 - r1
    arm.at_rates(k, r1, r2 - r1)


def on_sensor(m, s, k, ux, uy):
    """Force of the operator on the sensor, (x, y) [N]; that of physical clay that yields, into k.

    At the start the handle does not accelerate.
    """
    x, y = k.x, k.y
    if m.general:
        joints.prepare_sensor(m, s, k)
    hx, hy = ux, uy
    if m.hand:
        hx -= hand.resistance(m, x.p, x.v, x.c, 0)
        hy -= hand.resistance(m, y.p, y.v, y.c, 1)
    fx, fy = hx, hy
    x.pull = y.pull = 0.0
    if m.acts:
        fx, fy = laws.without_clay(m, s, k, fx, fy)
        if m.special and m.flow:
            x.pull, y.pull = reaction(m, s, k, fx, fy)
    s.fz = m.z.push
    if not m.hand:
        return ux, uy
    if s.before == 0.0:
        hx = ux - hand.resistance(m, x.p, x.v, 0.0, 0)
        return hx, uy - hand.resistance(m, y.p, y.v, 0.0, 1)
    ax, ay = acceleration(m, s, k, fx - x.pull, fy - y.pull)
    if m.axes > 2:
        s.fz = joints.force_along_z(m, k, fx - x.pull, fy - y.pull, ax, ay)
    return hx - m.x.mass * ax, hy - m.y.mass * ay


def acceleration(m, s, k, fx, fy):
    """Acceleration of the handle and its hand under torques and a force, (x, y) [m/s^2]."""
    e = s.e
    if m.general:
        ax, ay = k.x.rest, k.y.rest
    else:
        ax, ay = arm.pushed(m, k.u, e.tau[0] + e.slip[0], e.tau[1] + e.slip[1])
    gx, gy = ax + k.Wxx * fx + k.Wxy * fy, ay + k.Wxy * fx + k.Wyy * fy
    a, b = 1.0 + k.Wxx * m.x.mass, k.Wxy * m.y.mass
    c, d = k.Wxy * m.x.mass, 1.0 + k.Wyy * m.y.mass
    r = numbers.ratio(c, a)
    uy = numbers.ratio(gy - r * gx, d - r * b)
    return numbers.ratio(gx - b * uy, a), uy


def reaction(m, s, k, fx, fy):
    """Force of physical clay that yields at an instant, (x, y) [N].

    Where clay holds the handle, this is the force that prevents acceleration.
    """
    x, y, h = k.x, k.y, REACTION
    ax, ay = acceleration(m, s, k, fx, fy)
    B = controller.velocity_per_force((1.0, 1.0), (k.Wxx, k.Wxy, k.Wyy), (m.x.mass, m.y.mass, 0.0))
    ax, ay = ax - x.c, ay - y.c
    vx, vy = viscous.along(m, x.v, y.v)
    x.stuck0, y.stuck0 = s.e.x.stuck, s.e.y.stuck
    vx, vy = 0.0 if x.stuck0 > 0.0 else vx, 0.0 if y.stuck0 > 0.0 else vy
    B = yielding.of_plane(B)
    B = h * B[0], h * B[1], h * B[2], h * B[3]
    k.L = 1.0
    fyk = yielding.laws_in_kick(m, s, k, B, vx, vy, ax, ay)
    ax, ay = viscous.along(m, ax, ay)
    end = vx + h * ax, vy + h * ay
    B = viscous.rotated_matrix(m, B)
    found = yielding.resist_by(m, B, (vx, vy), end, fyk, 0.0)
    return viscous.across(m, found[6], found[7])


# ---- compute -------------------------------------------------------------------------------------


def compute(m, s, k, fx, fy):
    """Response of compensator and servo to a sample of the handle in k."""
    now, after, x, y = s.now, s.next, k.x, k.y
    fex, fey = laws.force_for_controller(m, s, k)
    if m.coupling:
        fex, fey = hardware.couple(
            m, s, k, viscous.damping(m, s, 0, 0), viscous.damping(m, s, 1, 0)
        )
    if m.guard:
        fex, fey = hardware.guarded(m, s, k, 0, fex), hardware.guarded(m, s, k, 1, fey)
        after.newest = (now.newest + 1) % (m.guard_whole + 2)
    x.net, y.net = fx - fex, fy - fey
    s.delta1, s.delta2 = output(m, now.x, 0, x.net), output(m, now.y, 1, y.net)
    ax, _ = servo.acceleration(m, 0, s.delta1, now.x.y, now.x.yrate, x.p, x.v, x.c)
    ay, _ = servo.acceleration(m, 1, s.delta2, now.y.y, now.y.yrate, y.p, y.v, y.c)
    servo.put_mobility(m, k)
    ax, ay = ax + k.Sxx * x.net + k.Sxy * y.net, ay + k.Sxy * x.net + k.Syy * y.net
    k.g[0], k.g[1] = arm_law.joint_velocity(ax, ay, k.u, 1.0)
    arm.link_torques(m, k)
    if not m.acts:  # the motors render the clay as well
        a1, a2 = arm_law.joint_torques(fex, fey, k.u)
        k.tau[0], k.tau[1] = k.tau[0] - a1, k.tau[1] - a2
    hardware.drive(m, s, k.tau)
    after.x.force, after.y.force, after.x.net, after.y.net = fex, fey, x.net, y.net


def output(m, z, i, f):
    """Output of a compensator at a sample under a net force [m]."""
    if not m.formed:
        return z.delta
    c, j, a = m.form, compensator.FORM * i + 20, z.z
    out = z.start + m.axis[i].K * c[j + 4] * f
    return out + c[j] * a[0] + c[j + 1] * a[1] + c[j + 2] * a[2] + c[j + 3] * a[3]


def call_own_controller(m, s, k, fx, fy):
    """The user's own controller: a function of a buffer, which it fills with torques and state.

    The host adds what holds the arm against gravity, where it does.
    """
    b, z, n = m.buffer, s.next, m.joints
    b[0], b[2 * n + 1], b[2 * n + 2] = s.t, fx, fy
    if m.axes > 2:
        b[2 * n + 3] = s.fz
    tau = 2 * n + 1 + m.axes
    for i in range(n):
        b[1 + i], b[n + 1 + i] = s.angles[i], s.rates[i]
        b[tau + i] = math.nan  # stays so where the call fails
    m.control(b)
    s.delta1 = s.delta2 = 0.0
    size = 0.0
    for i in range(n):
        size += abs(b[tau + i])
        k.tau[i] = b[tau + i]
    if not size < math.inf:
        s.code = NOT_FINITE
        for i in range(n):
            z.tau[i] = b[tau + i]
    else:
        if m.feeds_gravity:
            joint_law.see_pose(m, s)
            joint_law.feed_gravity(m, k)
        hardware.drive(m, s, k.tau)
    z.x.force = z.y.force = 0.0


# ---- compensator and reference model at the next sample ------------------------------------------


def advance(m, s, i, shift):
    """An axis a sample later, under a held force; `shift`: change of the command [m]."""
    a, z, to = m.axis[i].memory, s.now.axis[i], s.next.axis[i]
    if m.formed:
        advance_form(m, i, z, to, shift)
        return
    d, e, y, r, f = z.delta, z.rate, z.y, z.yrate, to.net
    to.delta = a[0] * d + a[1] * e + a[2] * y + a[3] * r + a[4] * f + shift
    to.rate = a[5] * d + a[6] * e + a[7] * y + a[8] * r + a[9] * f
    to.y = a[10] * d + a[11] * e + a[12] * y + a[13] * r + a[14] * f
    to.yrate = a[15] * d + a[16] * e + a[17] * y + a[18] * r + a[19] * f


def advance_form(m, i, z, to, shift):
    """As `advance`, of a compensator of another shape."""
    c, a, f = m.axis[i].memory, z.z, to.net
    for r in range(4):
        to.z[r] = form_row(c, 8 * r, a, z.y, z.yrate, z.start, f)
    to.start, to.rate = z.start + shift, 0.0
    to.y = form_row(c, 32, a, z.y, z.yrate, z.start, f)
    to.yrate = form_row(c, 40, a, z.y, z.yrate, z.start, f)
    to.delta = output(m, to, i, f)


def form_row(c, j, z, y, yrate, start, f):
    """A state of compensator or reference a sample later, by its row."""
    out = c[j + 4] * y + c[j + 5] * yrate
    out += c[j + 6] * start + c[j + 7] * f
    for r in range(4):
        out += c[j + r] * z[r]
    return out


# ---- a step --------------------------------------------------------------------------------------


def shown_output(s, after):
    """Compensator output that a row shows, (x, y) [m], and the share in it of a kick to an event.

    Force of hand and clay are the means of both kicks, half of each step, interpolated at the
    sample.
    """
    if not is_early(s, after):
        return s.now.x.delta, s.now.y.delta, 0.0
    share = after / (s.before + after) if s.before > 0.0 else 0.0
    return s.delta1, s.delta2, share


def take(m, s):
    """Keeps the results of an event, once the step after it is taken."""
    if not s.at_event:
        return
    if s.responded:
        if m.window > 0:
            hardware.note_angles(m, s)
        if m.guard:
            hardware.note_force(m, s)
        if m.own:
            keep_own_state(m)
        if m.delay > 0.0:
            hardware.enqueue(m, s)
    memory.copied(s.now, s.next)
    s.at_event = 0


def keep_own_state(m):
    """The state that the user's own controller returned becomes that before its next sample."""
    b, n, state = m.buffer, m.buffer_size, 3 * m.joints + 1 + m.axes
    for i in range(n):
        b[state + i] = b[state + n + i]


# ---- the path ------------------------------------------------------------------------------------


def before_event(m, s, target, after):
    """The next stop of the path and the step to it: an event between the samples, if any."""
    if not m.uneven or after <= 0.0:
        return target, after
    x, near = s.now, SLACK * m.dt
    t = s.t + near
    stop = first_after(t, x.when, first_after(t, x.then, math.inf))
    if m.delay > 0.0:
        stop = first_after(t, x.when + m.delay, stop)
        stop = first_after(t, x.due, first_after(t, x.due_then, stop))
    if stop < target - near:
        return stop, stop - s.t
    return target, after


def first_after(t, when, target):
    """`when` if it lies between t and target, else target."""
    return when if t < when and when < target else target
