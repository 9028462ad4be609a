"""Sampled control: a machine around the kick. It senses, computes, queues and holds.

At an event (a control sample or a change of the torques) the kick is split in two. The first, under
the old torques, brings the velocity to the sample, where it is measured. The second is under the
new torques.
"""

from __future__ import annotations

from ..model import arm, compensator, controller
from ..model import flow as yielding_law
from ..model import spring as spring_law
from . import friction, grooves, hardware, laws, rows, servo, viscous, yielding
from .driver import behind, pushed
from .engine_step import moved_arm, put
from .hand import masses, with_hand_now
from .kick import (
    at_rates,
    clipped,
    command_change,
    handle_at,
    link_torques,
    push_now,
    row_ahead,
    step_around,
    velocity,
)
from .parts import INF
from .sampled_controller import asked_law, is_refused
from .state import (
    NOT_FINITE,
    Answer,
    Axis,
    Event,
    Formed,
    Handle,
    Hold,
    Load,
    Machine,
    Sampled,
    Samples,
    State,
    Status,
    Step,
)

SLACK = 1e-9  # share of dt: events so close count as one
NONE = (0.0, 0.0)
REACTION = 1e-9  # [s] a force within this time after a sample counts as that at it
FORM_MEMORY = 48  # rows (z, y, y', start, f) of z, y and y' at the next sample, of one axis


# ---- the operator's force on the sensor, and that of clay that yields, at an instant -------------


def instant_acceleration(parts, at, tau, f):
    """Acceleration of the handle and its hand under torques and a force, (x, y) [m/s^2]."""
    x, y = masses(parts.hand)
    # a kick of one second from rest, in which the velocity after it is the acceleration
    at = Handle(at.u, at.p, at.W, NONE, at.c)
    law = servo.torque_law(parts.arm.links, Step(1.0, 0.0, 1.0, 0.0, 1.0), at, tau)
    return servo.solve(law, Load(f, (x, y, 0.0)))


def resisted(hand, uh, at):
    """Muscle force less that of the hand without its acceleration along the way, (x, y) [N]."""
    return with_hand_now(hand, Load(uh, (0.0, 0.0, 0.0)), at).f


def without_clay(part, sampler, grain, s, at, f):
    """A force without that of the clay before the sample that does not yield, (x, y) [N]."""
    if part is None:
        return f
    b = viscous.now(part, s.clay, True, s.clock.t)
    bx, by = viscous.force(grain, b, at.v)
    px, py = special_before(sampler.special, s.clay.laws, at)
    return f[0] - bx - px, f[1] - by - py


def special_before(special, state, at):
    if special is None:
        return NONE
    x, y = elastic_before(special.springs, state)
    fx, fy = laws.force(special.more, state.more, at.p, at.v)
    return x + fx, y + fy


def elastic_before(springs, state):
    if springs is None:
        return NONE
    return state.elastic.before


def reaction(special, sampler, parts, s, before, at, tau, uh):
    """Force of physical clay that yields at an instant, (x, y) [N].

    Where clay holds the handle, this is the force that prevents acceleration.

    Args:
        special: laws of the clay that acts.
        sampler: the machine.
        parts: the scene.
        s: the state.
        before: reaction of the clay after the kick that leads to the instant.
        at: the handle.
        tau: torques on the joints [N.m].
        uh: muscle force [N].
    """
    if special is None:
        return NONE
    return reaction_of(special.flow, sampler, parts, s, before, at, tau, uh)


def reaction_of(flow, sampler, parts, s, before, at, tau, uh):
    if flow is None:
        return NONE
    f = resisted(parts.hand, uh, at)
    f = without_clay(sampler.clay, sampler, parts.grain, s, at, f)
    ax, ay = instant_acceleration(parts, at, tau, f)
    x, y = masses(parts.hand)
    xx, xy, yx, yy = controller.velocity_per_force((1.0, 1.0), at.W, (x, y, 0.0))
    h, grain, clay = REACTION, parts.grain, behind(sampler.special, s.clay, before)
    stuck = before.contact.stuck
    B, a = (h * xx, h * xy, h * yx, h * yy), (ax - at.c[0], ay - at.c[1])
    vx, vy = viscous.along(grain, at.v[0], at.v[1])
    v = 0.0 if stuck[0] > 0.0 else vx, 0.0 if stuck[1] > 0.0 else vy
    law = yielding.law_in_kick(sampler.special.groove, flow, clay, 1.0, B, v, a)
    ax, ay = viscous.along(grain, a[0], a[1])
    end = v[0] + h * ax, v[1] + h * ay
    B = yielding.rotated_matrix(grain, B)
    _, _, _, fs, _ = yielding.split_resist(yielding.resist_by(flow.along, B, v, end, law, 0.0))
    return viscous.across(grain, fs[0], fs[1])


def on_sensor(hand, sampler, parts, s, at, tau, uh, pull):
    """Force of the operator on the sensor at an instant, (x, y) [N].

    At the start the handle does not accelerate.

    Args:
        hand: the operator's arm.
        sampler: the machine.
        parts: the scene.
        s: the state.
        at: the handle.
        tau: torques on the joints [N.m].
        uh: muscle force [N].
        pull: force of physical clay that yields [N].
    """
    if hand is None:
        return uh
    if s.clock.before == 0.0:
        return resisted(hand, uh, Handle(at.u, at.p, at.W, at.v, NONE))
    x, y = resisted(hand, uh, at)
    fx, fy = without_clay(sampler.clay, sampler, parts.grain, s, at, (x, y))
    ax, ay = instant_acceleration(parts, at, tau, (fx - pull[0], fy - pull[1]))
    return x - hand[0].mass * ax, y - hand[1].mass * ay


# ---- sense ---------------------------------------------------------------------------------------


def soft_velocity(special, sampler, parts, s, at, u):
    """Velocity at a sample [m/s]: u, after the kick that leads to it, except in stiff clay."""
    if special is None:
        return u
    return stiff_velocity(special.stiff, sampler, parts, s, at, u)


def stiff_velocity(part, sampler, parts, s, at, u):
    """As `soft_velocity`, in stiff clay.

    Half a kick holds too little of stiff clay; the velocity is that of a whole kick, with the step
    before it repeated.
    """
    if part is None:
        return u
    t, before = s.clock.t, s.clock.before
    if before == 0.0:
        return u
    step = step_around(before, before)
    _, split = viscous.damping(sampler.clay, sampler.special, s.clay, t, parts.hand, step)
    soft = split.soft  # type: ignore[union-attr]
    if soft[0] == 0.0 and soft[1] == 0.0:
        return u
    k = pushed(sampler, parts, s.clock, step, at, s.body.w, s.clay, s.loop.machine.hold)
    x, y = velocity(sampler.special, parts.grain, k)
    return x if soft[0] > 0.0 else u[0], y if soft[1] > 0.0 else u[1]


# ---- compute -------------------------------------------------------------------------------------


def rendered_clay(part, special, sampler, parts, s, at, b, pull):
    """Force of clay with damping b as the controller evaluates it [N]; pull is that of yielding."""
    if part is None:
        return NONE
    x, y = viscous.force(parts.grain, b, at.v)
    fx, fy = special_force(special, sampler, parts, s, at, pull)
    return x + fx, y + fy


def special_force(special, sampler, parts, s, at, pull):
    if special is None:
        return NONE
    x, y = flowing_force(special.flow, sampler.clay, special, parts, s.clay.laws, at.v, pull)
    px, py = springs_force(special.springs, sampler, s.clay.laws.elastic, at.p)
    fx, fy = laws.force(special.more, s.clay.laws.more, at.p, at.v)
    return x + px + fx, y + py + fy


def flowing_force(flow, clay, special, parts, state, v, pull):
    if flow is None:
        return NONE
    return force_in_motion(clay, flow, special.groove, parts.grain, state.flow, v, pull)


def force_in_motion(clay, flow, groove, grain, state, v, pull):
    """Force of yielding clay, in addition to b v, on a moving handle; none at rest.

    For physical clay, this is the force that holds the handle.
    """
    if clay is None:
        law = law_now(groove, state, v)
        x, y = viscous.along(grain, v[0], v[1])
        x, y = yielding_law.motion_force(law, flow.along is not None, x, y)
        return viscous.across(grain, x, y)
    return pull


def law_now(groove, state, v):
    """Fy, K, n of x and y of clay that yields, in a direction."""
    if groove is None:
        return state.law
    return grooves.law_along(groove, v[0], v[1])


def springs_force(part, sampler, elastic, p):
    if part is None:
        return NONE
    return sprung_force(part.rendered, sampler, elastic, p)


def sprung_force(rendered, sampler, elastic, p):
    if rendered is None:
        return elastic.force
    return measured_pull(sampler.encoder, elastic, p)


def measured_pull(encoder, x, p):
    """Force of the springs that the motors render, at a place as an encoder reads it, (x, y) [N].

    What gave way and relaxed since then follows the true place.
    """
    if encoder is None:
        return x.force
    (a, b), rest, stretch, at = x.numbers, x.rest, x.stretch, x.at
    return (
        axis_pull(a, rest[0], stretch[0], at[0], p[0]),
        axis_pull(b, rest[1], stretch[1], at[1], p[1]),
    )


def axis_pull(n, rest, stretch, at, p):
    _, f, _, _ = spring_law.spring_step(n[0], n[1], n[5], rest, p)
    # the second spring is as long as when the handle was last seen, and what was misread
    _, f1, _, _ = spring_law.spring_step(n[2], INF, n[5], at - stretch, p)
    return f + f1


def outputs(state_space, form, m, f):
    """Output of the compensators at a sample under a net force, (x, y) [m]."""
    if state_space is None:
        return m.x.delta, m.y.delta
    z = m.form
    return (
        shown_axis(form, 0, z.x, z.start[0] + form_feed(form, 0) * f[0]),
        shown_axis(form, 1, z.y, z.start[1] + form_feed(form, 1) * f[1]),
    )


def form_feed(form, i):
    """Direct feedthrough of a compensator, per unit of force [m/N]."""
    return form.gain[i] * form.numbers[compensator.FORM * i + 24]


def shown_axis(form, i, z, out):
    """Output of a compensator of another shape [m].

    Args:
        out: the part of it that comes from no state [m].
    """
    c, o = form.numbers, compensator.FORM * i + 20
    for j in range(compensator.ORDER):
        out += c[o + j] * z[j]
    return out


def servo_torques(parts, m, at, delta, f):
    """Torques of the servo, beside a net force on the handle [N.m]."""
    (sx, sy), x, y, p, v, c = parts.servo, m.x, m.y, at.p, at.v, at.c
    ax, _ = controller.feedback_law(sx, delta[0], x.y, x.yrate, p[0], v[0], c[0])
    ay, _ = controller.feedback_law(sy, delta[1], y.y, y.yrate, p[1], v[1], c[1])
    xx, xy, yy = servo.servo_mobility(parts.shaping, parts.servo, at.W)
    ax, ay = ax + xx * f[0] + xy * f[1], ay + xy * f[0] + yy * f[1]
    return link_torques(parts.arm.links, at.u, arm.joint_velocity(ax, ay, at.u, 1.0), f)


def held_torques(clay, at, tau, fe):
    """Torques that render the clay as well, where it is not physical [N.m]."""
    if clay is None:
        x, y = arm.joint_torques(fe[0], fe[1], at.u)
        return tau[0] - x, tau[1] - y
    return tau


def driven_torques(part, limits, tau):
    """Torques of the motors, within their limits and after the converter [N.m]."""
    return hardware.converted(part, clipped(tau, limits))


def answer(chance, sampler, parts, s, at, w, f, pull):
    """Response of the controller to a sample.

    Args:
        chance: random effects.
        sampler: the machine.
        parts: the scene.
        s: the state.
        at: the handle.
        w: joint rates [rad/s].
        f: force of the operator as the sensor measures it [N].
        pull: force of physical clay that yields [N].
    """
    if chance is None:
        return heard(sampler.own, sampler, parts, s, at, w, f, pull)
    m = s.loop.machine
    if hardware.is_lost(chance, m.samples.k):
        delta = m.x.delta, m.y.delta
        return Answer(0.0, m.hold, m.force, delta, m.own, m.rates, m.guard, m.tool)
    return heard(sampler.own, sampler, parts, s, at, w, f, pull)


def heard(own, sampler, parts, s, at, w, f, pull):
    """The same for a sample that is not lost: of the paper's controller, or the user's own."""
    m = s.loop.machine
    q = hardware.encoded(sampler.encoder, s.body.q)
    w, rates = hardware.differenced(sampler.difference, m.rates, m.samples.k, sampler.Ts, q, w)
    if own is None:
        at = hardware.handle_seen(sampler.encoder, sampler.difference, parts.arm, at, q, w)
        return computed(sampler, parts, s, at, f, pull, rates)
    tau, state = asked_law(own, s.clock.t, q, w, f, m.own)
    if not is_refused(tau):
        tau = driven_torques(sampler.dac, parts.limits, tau)
    none, pull = hardware.nothing(sampler.passivity), hardware.no_pull(sampler.coupling)
    hold = Hold(tau, NONE, none, pull)
    return Answer(1.0, hold, m.force, NONE, state, rates, m.guard, m.tool)


def computed(sampler, parts, s, at, f, pull, rates):
    """Response of compensator and servo to a sample."""
    m, state, Ts = s.loop.machine, s.clay.laws, sampler.Ts
    b = viscous.now(parts.clay, s.clay, False, s.clock.t)
    fe = rendered_clay(parts.clay, parts.special, sampler, parts, s, at, b, pull)
    fe, pulled, tool = hardware.coupled(
        sampler.coupling, parts.special, state, m.tool, at, b, fe, Ts
    )
    fe, added, guard = hardware.guarded(sampler.passivity, m.guard, at, fe, Ts)
    f = f[0] - fe[0], f[1] - fe[1]
    delta = outputs(sampler.state_space, parts.form, m, f)
    tau = held_torques(sampler.clay, at, servo_torques(parts, m, at, delta, f), fe)
    hold = Hold(driven_torques(sampler.dac, parts.limits, tau), fe, added, pulled)
    return Answer(1.0, hold, f, delta, m.own, rates, guard, tool)


# ---- compensator and reference model at the next sample ------------------------------------------


def advanced(own, sampler, parts, m, f, shift):
    """The loops of x and y, and states of other compensators, a sample later."""
    if own is None:
        return advanced_by(sampler.memory, sampler, parts, m, f, shift)
    return m.x, m.y, m.form


def advanced_by(memory, sampler, parts, m, f, shift):
    if memory is None:
        return advanced_form(sampler.state_space, parts.form, m, f, shift)
    x = over_sample(memory, 0, m.x, f[0], shift[0])
    return x, over_sample(memory, 20, m.y, f[1], shift[1]), m.form


def over_sample(m, o, z, f, shift):
    """One axis a sample later, under a force that is held."""
    d, e, y, r = z
    return Axis(
        m[o] * d + m[o + 1] * e + m[o + 2] * y + m[o + 3] * r + m[o + 4] * f + shift,
        m[o + 5] * d + m[o + 6] * e + m[o + 7] * y + m[o + 8] * r + m[o + 9] * f,
        m[o + 10] * d + m[o + 11] * e + m[o + 12] * y + m[o + 13] * r + m[o + 14] * f,
        m[o + 15] * d + m[o + 16] * e + m[o + 17] * y + m[o + 18] * r + m[o + 19] * f,
    )


def advanced_form(memory, form, m, f, shift):
    z = m.form
    x, zx = form_over_sample(memory, form, 0, m.x, z.x, z.start[0], f[0], shift[0])
    y, zy = form_over_sample(memory, form, 1, m.y, z.y, z.start[1], f[1], shift[1])
    return x, y, Formed(zx, zy, (z.start[0] + shift[0], z.start[1] + shift[1]))


def form_over_sample(memory, form, i, x, z, start, f, shift):
    """Loop and states of one axis a sample later."""
    o, at = FORM_MEMORY * i, (x.y, x.yrate, start, f)
    a, b = form_row(memory, o, z, at), form_row(memory, o + 8, z, at)
    c, d = form_row(memory, o + 16, z, at), form_row(memory, o + 24, z, at)
    z1 = a, b, c, d
    delta = shown_axis(form, i, z1, start + shift + form_feed(form, i) * f)
    y, rate = form_row(memory, o + 32, z, at), form_row(memory, o + 40, z, at)
    return Axis(delta, 0.0, y, rate), z1


def form_row(m, o, z, at):
    out = m[o + 4] * at[0] + m[o + 5] * at[1]
    out += m[o + 6] * at[2] + m[o + 7] * at[3]
    for j in range(compensator.ORDER):
        out += m[o + j] * z[j]
    return out


def shift_of(command, dt, clock, Ts):
    """Change of the command over a control sample, (x, y) [m]."""
    if command is None:
        return NONE
    if clock.t == clock.i * dt:
        return row_ahead(command, clock.i)
    return command_change(command.table, clock.t, clock.t + Ts, 0.0)


# ---- an event ------------------------------------------------------------------------------------


def samples_from(sampler, dt, k):
    """The times of sample k and the one after it."""
    when, then = k * sampler.ratio * dt, (k + 1) * sampler.ratio * dt
    chance = sampler.chance
    return Samples(k, when + hardware.late(chance, k), then + hardware.late(chance, k + 1))


def acted(sampler, parts, s):
    """The state with the controller's action at the beginning of a step; otherwise unchanged."""
    if sampler is None:
        return s
    m, dt = s.loop.machine, parts.time.dt
    now = s.clock.t + SLACK * dt
    acts = m.samples.when <= now
    if acts or hardware.is_due(sampler.delay, m.queue, now):
        e = event(sampler, parts, s, acts, now)
        return with_event(unless_refused(sampler.own, s, e), e)
    if s.loop.event.on == 0.0:
        return s
    return with_event(s, past(s.loop.event))


def unless_refused(own, s, e):
    """The state; that of an ended run if the user's own controller requests non-finite torques.

    Limits would hide such torques, and a delay would postpone the failure.
    """
    if own is None:
        return s
    if e.shown > 0.0 and is_refused(e.asked.tau):
        x = s.status
        x = Status(NOT_FINITE, x.closing, x.careful, x.landings, x.seen)
        return State(s.clock, s.body, s.loop, s.clay, s.work, x, s.filled)
    return s


def with_event(s, e):
    loop = Sampled(s.loop.machine, e)
    return State(s.clock, s.body, loop, s.clay, s.work, s.status, s.filled)


def past(e):
    """A past event."""
    return Event(
        0.0, e.at, e.w, e.reaction, e.fh, e.work, e.delta, e.shown, e.asked, e.machine
    )  # fmt: skip


def event(sampler, parts, s, acts, t):
    """An event: the kick that leads to it, the measurement, and the actuator output after it.

    Args:
        acts: whether the controller takes a sample.
    """
    clock, m, w = s.clock, s.loop.machine, s.body.w
    at = handle_at(parts.arm, s.body, 0.0)
    left, work, fh, u, tau = s.clay.reaction, s.work, NONE, at.v, NONE
    if clock.before > 0.0:
        step = step_around(clock.before, 0.0)
        k = pushed(sampler, parts, clock, step, at, w, s.clay, m.hold)
        left, fh = k.motion.reaction, rows.hand_force(parts.hand, k)
        work = rows.with_work(parts, work, k, w)
        tau, w, u = friction.on_joints(k.loop.slip, m.hold.tau), k.w, k.motion.u
    late = at_rates(at, w)
    delta, shown_, hold, machine = (m.x.delta, m.y.delta), 0.0, m.hold, m
    if acts:
        v = soft_velocity(sampler.special, sampler, parts, s, at, u)
        sight, seen = seen_handle(late, w, u, v)
        machine, a = sampled(sampler, parts, s, sight, seen, left, tau)
        delta, shown_, hold = a.delta, a.shown, a.hold
    machine = hardware.queued(sampler.delay, m, machine, shown_, t)
    return Event(1.0, late, w, left, fh, work, delta, shown_, hold, machine)


def seen_handle(at, w, u, v):
    """The handle at velocity v, and its joint rates [rad/s]; as given where v is u."""
    if v == u:
        return at, w
    r1, r2 = arm.joint_velocity(v[0], v[1], at.u, 1.0)
    w = r1, r2 - r1
    return at_rates(at, w), w


def sampled(sampler, parts, s, at, w, special, tau):
    """Controller and hardware after a sample, without delay; and the controller's response.

    Args:
        sampler: the machine.
        parts: the scene.
        s: the state.
        at: the handle.
        w: joint rates [rad/s].
        special: laws of the clay after the kick that leads to the sample.
        tau: torques on the joints in it [N.m].
    """
    m, dt = s.loop.machine, parts.time.dt
    uh = push_now(parts.push, dt, s.clock)
    pull = reaction(sampler.special, sampler, parts, s, special, at, tau, uh)
    f = on_sensor(parts.hand, sampler, parts, s, at, tau, uh, pull)
    f = hardware.noise(sampler.chance, m.samples.k, f)
    f, filtered = hardware.filtered(sampler.filter, m.filtered, f)
    f = hardware.converted(sampler.adc, f)
    a = answer(sampler.chance, sampler, parts, s, at, w, f, pull)
    shift = shift_of(sampler.command, dt, s.clock, sampler.Ts)
    x, y, form = advanced(sampler.own, sampler, parts, m, a.force, shift)
    samples = samples_from(sampler, dt, m.samples.k + 1)
    return Machine(
        x, y, form, a.own, a.hold, samples, a.force, a.rates, filtered, a.guard, a.tool, m.queue
    ), a


# ---- the path ------------------------------------------------------------------------------------


def before_event(sampler, dt, s, target, after):
    """The next stop of the path and the step to it [s]: an event between the samples, if any."""
    if sampler is None:
        return target, after
    return before_uneven(sampler.uneven, sampler, dt, s, target, after)


def may_follow(sampler, time, c):
    """Whether a step may follow that needs no check but that of its end.

    This is a whole step between whole steps; where events lie between the samples, any step but
    the first and the last.
    """
    if sampler is None:
        return c.before == time.dt and c.t == c.i * time.dt and c.i < time.last
    return follows(sampler.uneven, time, c)


def follows(uneven, time, c):
    if uneven is None:
        return c.before == time.dt and c.t == c.i * time.dt and c.i < time.last
    return c.before > 0.0 and c.i < time.last


def before_uneven(uneven, sampler, dt, s, target, after):
    if uneven is None:
        return target, after
    t, near = s.clock.t, SLACK * dt
    if after <= 0.0:
        return target, after
    x = s.loop.machine.samples
    stop = first_after(t + near, x.when, first_after(t + near, x.then, INF))
    stop = first_due(sampler.delay, s.loop.machine, t + near, stop)
    if stop < target - near:
        return stop, stop - t
    return target, after


def first_after(t, when, target):
    return when if t < when < target else target


def first_due(delay, m, t, target):
    if delay is None:
        return target
    target = first_after(t, m.samples.when + delay.delay, target)
    return first_after(t, m.queue.due, first_after(t, m.queue.then, target))


def acting_laws(sampler, special):
    """Laws of the clay that act on the handle."""
    if sampler is None:
        return special
    return sampler.special


def without_event(sampler, s):
    """The state for a kick that no event begins."""
    if sampler is None:
        return s
    return with_event(s, past(s.loop.event))


def is_early(s, after):
    """Whether a kick leads to an event before that of a step of length `after`."""
    return s.loop.event.on > 0.0 and after > 0.0


def shown(sampler, parts, s, k, after, v, f):
    """What a row shows in addition to the kick.

    Force of the hand [N], compensator output [m], force of clay that yields at velocity v [N].
    """
    if sampler is None:
        return rows.hand_force(parts.hand, k), k.delta, f
    f, e, m, share = rows.hand_force(parts.hand, k), s.loop.event, s.loop.machine, 0.0
    delta = m.x.delta, m.y.delta
    if is_early(s, after):
        delta, before = e.delta, s.clock.before
        if before > 0.0:  # the means of both kicks, half of each step, interpolated at the sample
            share = after / (before + after)
            f = f[0] + share * (e.fh[0] - f[0]), f[1] + share * (e.fh[1] - f[1])
    return f, delta, felt_at(parts.special, sampler, parts, s, k, share, v)


def felt_at(special, sampler, parts, s, k, share, v):
    if special is None:
        return NONE
    return flow_at(special.flow, sampler.clay, parts, s, k, share, v)


def flow_at(flow, clay, parts, s, k, share, v):
    if flow is None:
        return NONE
    x, old = k.motion.reaction.contact.f, s.loop.event.reaction.contact.f
    x = x[0] + share * (old[0] - x[0]), x[1] + share * (old[1] - x[1])
    return force_in_motion(clay, flow, parts.special.groove, parts.grain, s.clay.laws.flow, v, x)


def write_held(sampler, parts, e, i, k):
    """Writes the force of the clay that the motors hold, where they do."""
    if sampler is None:
        return
    write_rendered(sampler.rendered, e, i, k)


def write_rendered(rendered, e, i, k):
    if rendered is None:
        return
    put(e.rendered, 3 * i, k.loop.hold.force)


def ledger(sampler, s, after):
    """The ledger before the next kick, and the joint rates there [rad/s]."""
    if sampler is None:
        return s.work, s.body.w
    if is_early(s, after):
        return s.loop.event.work, s.loop.event.w
    return s.work, s.body.w


def noted_early(sampler, e, s, n):
    """Special laws of the clay before the next kick; stops noted in the kick to an event."""
    if sampler is None:
        return s.clay.reaction, n
    return noted_in(sampler.special, e, s, n)


def noted_in(special, e, s, n):
    if special is None:
        return s.clay.reaction, n
    n = noted_event(special.flow, e, s, n)
    return s.loop.event.reaction if is_early(s, 1.0) else s.clay.reaction, n


def noted_event(flow, e, s, n):
    if flow is None:
        return n
    if is_early(s, 1.0):
        now, was = s.loop.event.reaction.contact, s.clay.reaction.contact
        return yielding.noted(flow, e, now, was, s.clock.t, n)
    return n


def stepped_arm(sampler, parts, e, s, k, after):
    """Steps the engine to the rates of a kick, and of that to an event; joint angles and rates."""
    if sampler is None:
        return moved_arm(parts, e, s.clock.before, s.body.w, k, after)
    return moved_arm(parts, e, -1.0, s.body.w, k, after)


def taken(sampler, parts, s, k):
    """The loop after an accepted step."""
    if sampler is None:
        return k.loop
    loop, e = s.loop, s.loop.event
    if e.on == 0.0:
        return loop
    if e.shown > 0.0:
        note(sampler, s.body.q, loop.machine, e)
    return Sampled(e.machine, past(e))


def note(sampler, q, machine, e):
    """Stores a sample in the rings of the hardware."""
    hardware.note_angles(sampler.difference, machine, hardware.encoded(sampler.encoder, q))
    hardware.note_force(sampler.passivity, e.machine, e.asked.force)
    hardware.note_hold(sampler.delay, machine, e.machine, e.asked)
