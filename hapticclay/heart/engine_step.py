"""The engine's step: it gets torques, dampers and the rest of the hand force, and moves the arm."""

from __future__ import annotations

from ..model import arm
from . import fast, grooves, kick as kicks, springs, viscous, yielding
from .state import Axis, Before, Body, Clay, Clock, Filled, Loop, State, Status


def give(e, dt, tau, push, dampers, after):
    """Lets the engine step."""
    e.ctrl[0], e.ctrl[1] = tau
    if len(e.ctrl) > 2:
        e.ctrl[2], e.ctrl[3] = dampers
    e.push[0], e.push[1] = push
    e.timestep[0] = after
    e.step(e.model, e.data)


def command(parts, s, e, k, after):
    """Steps the engine to the rates of a kick."""
    if s.clock.before == after:
        # beside its dampers the engine gets all of the force
        b, u = k.viscous.b1, k.motion.u
        x, y = viscous.force(parts.grain, b, u)
        push = arm.joint_torques(k.motion.f[0] + x, k.motion.f[1] + y, s.body.pose.u)
        give(e, parts.time.dt, k.tau, push, b, after)
    else:  # its step is longer or shorter than the kick
        I1, I2, w, n, tau = parts.arm.links[2], parts.arm.links[3], s.body.w, k.w, k.tau
        a1, a2 = (n[0] - w[0]) / after, (n[0] + n[1] - w[0] - w[1]) / after
        push = I1 * a1 + I2 * a2 - tau[0], I2 * a2 - tau[1]
        give(e, parts.time.dt, tau, push, (0.0, 0.0), after)


def rest(felt, e):
    """Stops an arm that clay holds: the engine's rounding would creep."""
    if felt is None:
        return
    if felt.still > 0.0:
        e.w[0], e.w[1] = 0.0, 0.0


def taken(parts, s, e, k, after, target):
    """The state after the step behind a kick."""
    command(parts, s, e, k, after)
    rest(k.motion.felt, e)
    q, w, c, t = (e.q[0], e.q[1]), (e.w[0], e.w[1]), s.clay, s.clock.t
    body = Body(q, w, k.g, kicks.pose_at(parts, q))
    filled = noted(k.motion.felt, parts, s, e, t)
    p, v = body.pose.p, arm.handle_velocity(w[0], w[0] + w[1], body.pose.u)
    elastic = springs.moved(parts.springs, c.elastic, c.region, parts.table, p, after)
    old = Before(c.region.base, c.region.rate, c.region.flow)
    region, old = viscous.at_place(parts.smooth, parts.table, c.region, old, p)
    region, old, cut = grooves.moved(parts.groove, grooves.passed(parts.groove, c.cut), region, old, p, v)
    hit = fast.hit_after(parts.stiff, parts, c.hit, k)
    clay = Clay(region, old, k.motion.owed, k.motion.felt, elastic, cut, hit)
    x, y = commanded(parts.command, k, t, t + after, 0.5 * parts.time.dt)
    clock = Clock(t + after, s.clock.i, after)
    if target - (t + after) <= 1e-9 * parts.time.dt:
        clock = Clock(target, s.clock.i + 1, after)
    a = s.status
    status = Status(a.code, a.closing, a.landings, a.steps + 1)
    return State(clock, body, Loop(x, y, k.form), clay, s.ledger, status, filled, s.machine)


def commanded(table, k, t0, t1, h):
    """The loop with the change of the command in its output."""
    if table is None:
        return k.x, k.y
    dx, dy = kicks.command_change(table, t0, t1, h)
    x, y = k.x, k.y
    return Axis(x.delta + dx, x.rate, x.y, x.yrate), Axis(y.delta + dy, y.rate, y.y, y.yrate)


def noted(felt, parts, s, e, t):
    """Notes where clay that yields stops the handle or lets it go; what is then filled."""
    if felt is None:
        return s.filled
    now, was, f = felt.contact.stuck, s.clay.felt.contact.stuck, s.filled
    n = f.stops
    if parts.flow.along is not None:
        if now[0] != was[0]:
            n = note(e, n, 2.0, now[0], t + felt.times[0] if now[0] > 0.0 else t)
    else:
        if now[0] != was[0]:
            n = note(e, n, 0.0, now[0], t + felt.times[0] if now[0] > 0.0 else t)
        if now[1] != was[1]:
            n = note(e, n, 1.0, now[1], t + felt.times[1] if now[1] > 0.0 else t)
    return Filled(f.rows, f.crossings, n)


def note(e, n, axis, stops, t):
    e.stops[n, 0], e.stops[n, 1], e.stops[n, 2] = axis, stops, t
    return n + 1
