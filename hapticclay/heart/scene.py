"""A scene compiled of the parts that it has, and the state at its start."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..model import arm, compensator, groove, regions
from ..model.constants import B_MAX
from ..model.scenario import Scenario
from . import engine, grooves, kick, path, springs, viscous
from .engine import mujoco
from .parts import INF, Arm, Flow, Form, Groove, Hand, Lag, Parts, Servo, Springs, Stiff, Time
from .state import (
    OPEN, Axis, Before, Body, Clay, Clock, Contact, Cut, Elastic, Felt, Filled, Hit, Ledger, Loop, Region,
    State, Status, Work,
)  # fmt: skip

CHUNK, CROSSINGS = 4096, 64


class Engine(NamedTuple):
    step: Any
    model: Any
    data: Any
    q: Any
    w: Any
    ctrl: Any
    push: Any
    timestep: Any
    rows: Any
    crossings: Any
    stops: Any
    rendered: Any


def hand_parts(s: Scenario):
    if not any(s.operators):
        return None
    return tuple(Hand(th.mass, th.damper, th.spring) if th else Hand(0.0, 0.0, 0.0) for th in s.operators)


def compensators(s: Scenario):
    lags = [c.lag for c in s.compensators]
    if all(x and x[0] == 1.0 for x in lags):
        return tuple(Lag(float(K), float(x[1])) for K, x in zip(s.gain, lags, strict=True)), None
    numbers = np.array([x for c in s.compensators for x in compensator.form_numbers(c)])
    kick = np.append(np.zeros(2 * compensator.KICK), (-1.0, -1.0))
    return None, Form(
        tuple(map(float, s.gain)), max(1, *(c.order for c in s.compensators)), numbers, kick,
        np.zeros(compensator.WORK),
    )  # fmt: skip


def is_stiff(s: Scenario) -> bool:
    """Whether a step may overshoot in the clay, or a hit saturate the motors."""
    if s.clay is None:
        return False
    b = B_MAX if s.clay.grows else s.clay.largest
    return b * s.dt * max(s.mobility, s.arm.links[4]) > 0.02


def parts_of(s: Scenario) -> Parts:
    clay = s.clay
    lag, form = compensators(s)
    flow = springy = block = grain = None
    if clay is not None:
        grain = (math.cos(clay.angle), math.sin(clay.angle)) if clay.angle else None
        if clay.yields:
            flow = Flow(1 if clay.isotropic or clay.groove else None)
        if clay.springs:
            held = s.control == "sampled" and s.render == "held"
            springy = Springs(0.0 if held else s.mobility, 1 if held else None)
        if clay.groove:
            g = clay.groove
            block = Groove(
                g.numbers, float(g.damping) if g.damping else None, g.shares.copy(), g.relief,
                np.zeros(groove.RIM), np.zeros(2),
            )  # fmt: skip
    stiff = is_stiff(s)
    x, y = s.force
    if s.muscle is not None and not s.muscle.varies:
        more = s.muscle(0.0)
        x, y = x + float(more[0]), y + float(more[1])
    return Parts(
        Time(float(s.dt), float(s.t_max), math.floor(s.t_max / s.dt + 1e-6)),
        Arm(tuple(map(float, s.arm.links)), *map(float, s.origin)),
        tuple(Servo(*map(float, each.numbers)) for each in s.servo), lag, form, hand_parts(s),
        (0.0, float(x), float(y), 0.0, 0.0), None, None, tuple(map(float, s.torque_limit)),
        1 if s.shaping else None, regions.region_table(clay, s.length),
        None if clay is None else 1, grain, 1 if clay is not None and clay.grows else None,
        (clay.smooth or None) if clay is not None else None,
        Stiff(float(s.mobility), 0.02 / s.arm.links[4]) if stiff else None, flow, springy, block, None, None,
    )  # fmt: skip


def start(parts: Parts, s: Scenario, e) -> State:
    links = parts.arm.links
    q = arm.inverse_kinematics(s.origin[0] + s.start[0], s.origin[1] + s.start[1], links)
    r = arm.joint_velocity(*map(float, s.velocity), arm.jacobian(*q, links), 1.0)
    e.q[0], e.q[1], e.w[0], e.w[1] = q[0], q[1], r[0], r[1] - r[0]
    q, w = (e.q[0], e.q[1]), (e.w[0], e.w[1])
    body = Body(q, w, (0.0, 0.0), kick.pose_at(parts, q))
    p = tuple(map(float, s.start))
    ix, iy = regions.region_of(parts.table, p)
    region = path.region_at(parts, (0.0, 0.0, 1.0, 0.0, 0.0, 1.0) if parts.flow else None, ix, iy, 0.0)
    axes = []
    for i in (0, 1):
        G = s.servo[i].G
        v, ratio = float(s.velocity[i]), parts.servo[i].ratio
        axes.append(Axis((p[i] + G.damping / G.stiffness * v) / ratio, v / ratio, p[i], v))
    form = None
    if parts.form is not None:
        form = tuple(tuple(compensator.moving_states(c, v / x.ratio)) for c, x, v in zip(s.compensators, parts.servo, s.velocity, strict=True))
        axes = [Axis(a.delta, 0.0, a.y, a.yrate) for a in axes]
    none = 0.0, 0.0
    zero = (0.0,) * 6
    elastic = None
    if parts.springs is not None:
        elastic = Elastic((zero, zero), none, none, p, none, none, 0.0, 0.0, INF)
    cut = Cut((math.nan, math.nan), none, none, 0.0) if parts.groove is not None else None
    clay = Clay(
        region, Before(region.base, region.rate, region.flow), none if parts.stiff else None,
        Felt(none, none, none, Contact(none, (math.nan, math.nan)), 0.0, none) if parts.flow else None, elastic, cut,
        Hit(INF, 1.0) if parts.stiff else None,
    )  # fmt: skip
    state = State(
        Clock(0.0, 0, 0.0), body, Loop(*axes, form), clay,
        Ledger(Work(0.0, 0.0, 0.0, 0.0, 0.0), p, none, w), Status(OPEN, OPEN, 0, 0), Filled(0, 0, 0), None,
    )  # fmt: skip
    state = path.entered(parts, state, (ix, iy), 1.0)
    c = state.clay
    if parts.groove is not None:
        state = path.with_clay(state, c._replace(cut=c.cut._replace(bare_before=c.cut.bare)))
        c = state.clay
        v = arm.handle_velocity(w[0], w[0] + w[1], body.pose.u)
        region, old, tool = grooves.moved(parts.groove, c.cut, c.region, Before(c.region.base, c.region.rate, c.region.flow), p, v)
        c = c._replace(region=region, old=old, cut=tool)
    return path.with_clay(state, c._replace(old=Before(c.region.base, c.region.rate, c.region.flow)))


def make_engine(s: Scenario, native=None):
    model = engine.build(s)
    data = mujoco.MjData(model)
    clay = s.clay
    stops = np.zeros((4 * CHUNK if clay and clay.yields else 0, 3))
    rendered = np.zeros((CHUNK if clay and (clay.yields or clay.springs) else 0, 3))
    arrays = (
        data.qpos, data.qvel, data.ctrl, data.qfrc_applied, engine.timestep_view(model),
        np.zeros((CHUNK, 16)), np.zeros((CROSSINGS, 4)), stops, rendered,
    )  # fmt: skip
    plain = Engine(mujoco.mj_step, model, data, *arrays)
    return plain, arrays, model, data


def run(s: Scenario, advance=None, engine_of=None):
    e, arrays, model, data = make_engine(s)
    if engine_of:
        e = engine_of(model, data, arrays)
    parts = parts_of(s)
    st = start(parts, s, e)
    rows, crossings, stops = [], [], []
    go = advance or path.advance
    while st.status.code == OPEN:
        st = go(parts, st, e, CHUNK - 1)
        rows.append(e.rows[: st.filled.rows].copy())
        crossings += e.crossings[: st.filled.crossings].tolist()
        stops += e.stops[: st.filled.stops].tolist()
        st = path.with_filled(st, Filled(0, 0, 0))
    return np.concatenate(rows), crossings, stops, st, parts
