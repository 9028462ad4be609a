"""The start of a run: arm at its place, clay around it, and controller."""

from __future__ import annotations

from ..model import arm, regions
from . import borders, grooves, hardware, sampled, viscous, yielding
from .engine_step import put
from .kick import handle_at, place
from .parts import INF
from .state import (
    OPEN,
    Axis,
    Body,
    Clay,
    Clock,
    Course,
    Event,
    Filled,
    Formed,
    Growth,
    Guard,
    Hold,
    Laws,
    Loop,
    Machine,
    Modes,
    Queue,
    Rates,
    Region,
    Sampled,
    State,
    Status,
)

NONE = (0.0, 0.0)


def arm_at(parts, e, p, v):
    """The arm with its handle at p, moving with v."""
    part = parts.arm
    q = arm.inverse_kinematics(part.ox + p[0], part.oy + p[1], part.links)
    r1, r2 = arm.joint_velocity(v[0], v[1], arm.jacobian(q[0], q[1], part.links), 1.0)
    w = r1, r2 - r1
    put(e.q, 0, q)
    put(e.w, 0, w)
    return Body(q, w, NONE)


def axis_at(servo, p, v):
    """Compensator and reference model of an axis in steady motion at v."""
    return Axis((p + servo.damping / servo.stiffness * v) / servo.ratio, v / servo.ratio, p, v)


def loop_at(form, loop, servo, p, v):
    """The controller of a handle at p in steady motion at v; `loop` has the states of form."""
    x, y = axis_at(servo[0], p[0], v[0]), axis_at(servo[1], p[1], v[1])
    if form is None:
        return Loop(x, y, loop.form)
    x, y = Axis(x.delta, 0.0, x.y, x.yrate), Axis(y.delta, 0.0, y.y, y.yrate)
    return Loop(x, y, loop.form)


def clay_at(parts, blocks, body, p):
    """The clay around a handle at p; `blocks` are those of its laws before any motion."""
    index = regions.region_of(parts.table, p)
    clay = Clay(
        Region(index, NONE, NONE),
        NONE,
        NONE,
        blocks.growth,
        blocks.hit,
        blocks.reaction,
        blocks.laws,
    )
    at = handle_at(parts.arm, body, 0.0)
    clay = borders.clay_in(parts, clay, index, 0.0, at.p, -1, 1.0)
    growth = viscous.same_growth(blocks.growth, clay.growth)
    clay = Clay(clay.region, clay.b, clay.b, growth, clay.hit, clay.reaction, clay.laws)
    return cut_at(parts.special, clay, at)


def cut_at(special, clay, at):
    """The clay after the first cut of the tool, before the first sample."""
    if special is None:
        return clay
    x = clay.laws
    b, old, cut = grooves.moved(special.groove, x.cut, clay, at.p, at.v)
    x = Laws(yielding.behind(special.flow, x.flow), x.elastic, cut, x.more)
    return Clay(clay.region, b, old, clay.growth, clay.hit, clay.reaction, x)


def begun(parts, blocks, e, p, v):
    """The state of a run at its start.

    Args:
        parts: the scene.
        blocks: a state, for the blocks of the parts that it has; see scene.blocks.
        e: the engine.
        p: place of the handle, (x, y) [m].
        v: its velocity [m/s].
    """
    body = arm_at(parts, e, p, v)
    loop = loop_at(parts.form, blocks.loop, parts.servo, p, v)
    clay = clay_at(parts, blocks.clay, body, p)
    ix, iy = clay.region.index
    status = Status(OPEN, OPEN, 0, 0, (ix, ix, iy, iy))
    s = State(Clock(0.0, 0, 0.0), body, loop, clay, blocks.work, status, Filled(0, 0, 0, 0))
    return controlled(parts.sampler, parts, s, p)


# ---- the controller of a method ------------------------------------------------------------------


def controlled(sampler, parts, s, p):
    """The state with the controller in sampled time, or that of the accurate method."""
    if sampler is None:
        return on_course(parts.accurate, parts.modal, s)
    machine, at, w = machine_at(sampler, parts, s, p), handle_at(parts.arm, s.body, 0.0), s.body.w
    hold, reaction = machine.hold, s.clay.reaction
    event = Event(0.0, at, w, reaction, NONE, s.work, NONE, 0.0, hold, machine)
    return with_loop(s, Sampled(machine, event))


def with_loop(s, loop):
    return State(s.clock, s.body, loop, s.clay, s.work, s.status, s.filled)


def on_course(accurate, modal, s):
    """The state at the start of a run, by the accurate method where the scene uses it."""
    if accurate is None:
        return s
    x = s.loop
    return with_loop(s, Course(x.x, x.y, x.form, 0, 0.0, first_modes(modal)))


def first_modes(modal):
    if modal is None:
        return modal
    law = 0.0, 0.0, 1.0, 0.0, 0.0, 1.0
    return Modes(law, (1.0, 1.0), NONE, NONE, NONE, NONE, NONE, INF)


def machine_at(part, parts, s, p):
    """Controller and hardware at the start; fills past samples into the rings of the sensors."""
    loop, nothing = s.loop, hardware.nothing(part.passivity)
    x, y = reference_of(part.own, loop)
    return Machine(
        x, y, first_form(part.state_space, loop), first_own(part.own),
        Hold(NONE, NONE, nothing, hardware.no_pull(part.coupling)),
        sampled.samples_from(part, parts.time.dt, 0), NONE,
        first_rates(part.difference, part, s.body), unfiltered(part.filter),
        first_guard(part.passivity, p), first_tool(part.coupling, p), first_queue(part.delay),
    )  # fmt: skip


def reference_of(own, loop):
    """Compensator and reference model of both axes; at rest beside the user's own controller."""
    if own is None:
        return loop.x, loop.y
    rest = Axis(0.0, 0.0, 0.0, 0.0)
    return rest, rest


def first_form(state_space, loop):
    if state_space is None:
        return state_space
    x, y = loop.form
    return Formed(x, y, (loop.x.delta, loop.y.delta))


def first_own(own):
    if own is None:
        return own
    return own.start


def first_rates(part, sampler, body):
    if part is None:
        return part
    ring, n, q, w = part.ring, part.velocity_window, body.q, body.w
    for i in range(n):  # before the start the joints have long turned at this rate
        j = i - n
        q1, q2 = q[0] + j * sampler.Ts * w[0], q[1] + j * sampler.Ts * w[1]
        q1, q2 = hardware.encoded(sampler.encoder, (q1, q2))
        ring[3 * i], ring[3 * i + 1], ring[3 * i + 2] = float(j), q1, q2
    return Rates(w, 0)


def unfiltered(part):
    if part is None:
        return part
    return 0.0, 0.0, 0.0, 0.0


def first_guard(part, p):
    if part is None:
        return part
    for i in range(len(part.ring)):  # before the start the motors have held nothing
        part.ring[i] = 0.0
    return Guard(NONE, p, 0)


def first_tool(coupling, p):
    if coupling is None:
        return coupling
    return p


def first_queue(delay):
    if delay is None:
        return delay
    return Queue(0, 0, INF, INF)


# ---- a scene that changes ------------------------------------------------------------------------


def changed(parts, blocks, s, before):
    """The state in a changed scene with the same borders; in CPython only.

    Laws of the clay in both scenes keep their state; new laws begin.

    Args:
        parts: the scene.
        blocks: from scene.blocks.
        s: the state so far.
        before: the scene so far.
    """
    p = place(parts.arm, s.body.q)
    clay = blocks.clay._replace(region=s.clay.region)
    fresh = borders.clay_in(parts, clay, s.clay.region.index, s.clock.t, p, -1, 0.0)
    old = s.clay
    reaction = kept_blocks(fresh.reaction, old.reaction)
    laws = kept_blocks(fresh.laws, old.laws)
    if laws is not None:
        laws = laws._replace(flow=fresh.laws.flow, elastic=fresh.laws.elastic)
        grooves.met_anew(parts.special.groove, p)
    hit = old.hit if fresh.hit and old.hit else fresh.hit
    fresh = fresh._replace(old=old.old, hit=hit, reaction=reaction, laws=laws)
    if fresh.growth is not None and old.growth is not None:
        fresh = fresh._replace(growth=Growth(fresh.growth.rate, old.growth.old))
    work = s.work
    if work.hardware is None:  # entries that begin with the changed scene
        work = work._replace(hardware=blocks.work.hardware)
    return s._replace(clay=fresh, work=work)


def kept_blocks(fresh, before):
    """Blocks of a new scene; those that continue keep their state.

    Args:
        fresh: those of the new scene.
    """
    if fresh is None or before is None:
        return fresh
    pairs = zip(fresh, before, strict=True)
    return type(fresh)(*(new if new is None or old is None else old for new, old in pairs))
