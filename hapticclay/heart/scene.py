"""A scene compiled of the parts that it has, and the state at its start."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..model import arm, compensator, groove, regions
from ..model.constants import B_MAX
from ..model.scenario import Scenario
from ..stepping import engine, runge_kutta
from ..stepping.engine import mujoco
from ..stepping.run import spring_step
from . import borders, grooves, kick, parts as p_, path, state as s_
from .engine_step import Probe
from .march import GROWTH_BLOCK
from .modes import SUBSTEPS
from .parts import INF
from .state import OPEN

CHUNK, CROSSINGS = 4096, 64
NONE = (0.0, 0.0)


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
    most_crossings: int
    most_stops: int
    probe: Any


def hand_parts(s: Scenario):
    if not any(s.operators):
        return None
    return tuple(p_.Hand(th.mass, th.damper, th.spring) if th else p_.Hand(0.0, 0.0, 0.0) for th in s.operators)


def compensators(s: Scenario):
    lags = [c.lag for c in s.compensators]
    if all(x and x[0] == 1.0 for x in lags):
        return tuple(p_.Lag(float(K), float(x[1])) for K, x in zip(s.gain, lags, strict=True)), None
    numbers = np.array([x for c in s.compensators for x in compensator.form_numbers(c)])
    work = np.append(np.zeros(2 * compensator.KICK), (-1.0, -1.0))
    return None, p_.Form(
        tuple(map(float, s.gain)), max(1, *(c.order for c in s.compensators)), numbers, work,
        np.zeros(compensator.WORK),
    )  # fmt: skip


def stiffness(s: Scenario) -> float:
    """Largest share of its velocity that a step of explicit damping would take from the handle."""
    b = B_MAX if s.clay.grows else s.clay.largest
    return b * s.dt * max(s.mobility, s.arm.links[4])


def clay_part(s: Scenario):
    clay = s.clay
    if clay is None:
        return None, None, None, None
    grain = (math.cos(clay.angle), math.sin(clay.angle)) if clay.angle else None
    fast = s.integrator == "fast"
    flow = None
    if clay.yields and fast:
        flow = p_.Flow(1 if clay.isotropic or clay.groove else None)
    springy = block = None
    if clay.springs:
        held = s.control == "sampled" and s.render == "held"
        springy = p_.Springs(float(spring_step(s)), 1 if held else None)
    if clay.groove:
        g = clay.groove
        block = p_.Groove(
            g.numbers, float(g.damping) if g.damping else None, g.shares.copy(), g.relief,
            np.zeros(groove.RIM), np.zeros(2),
        )  # fmt: skip
    b = stiffness(s) if fast else 0.0
    stiff = p_.Stiff(float(s.mobility)) if b > 1.0 else None
    hits = p_.Hits(0.02 / s.arm.links[4]) if b > 0.02 else None
    special = p_.Special(clay.smooth or None, stiff, flow, springy, block)
    special = special if any(x is not None for x in special) else None
    return p_.Clay(1 if clay.grows else None), grain, hits, special


def accurate_parts(s: Scenario):
    """The accurate method, and clay that yields in it."""
    if s.integrator == "fast":
        return None, None
    runge_kutta.check_explicit(s)
    blocks = modal = None
    if s.clay and s.clay.grows:
        blocks = substeps_of_blocks(s)
    if s.clay and s.clay.yields:
        along, grain = (1, None) if s.clay.isotropic else (None, clay_part(s)[1])
        modal = p_.Modal(along, grain, float(runge_kutta.largest_lightness(s)), float(s.dt))
    return p_.Accurate(runge_kutta.parts_of_sample(s, 0), blocks), modal


def substeps_of_blocks(s: Scenario):
    """Engine steps a sample, by block; they grow, and after SUBSTEPS all are as many."""
    count = math.floor(s.t_max / s.dt + 1e-6) // GROWTH_BLOCK + 1
    blocks = np.empty(count, dtype=np.int64)
    for j in range(count):
        blocks[j] = runge_kutta.parts_of_sample(s, j * GROWTH_BLOCK)
        if blocks[j] > SUBSTEPS:
            blocks[j:] = SUBSTEPS + 1
            break
    return blocks


def parts_of(s: Scenario):
    lag, form = compensators(s)
    x, y = s.force
    if s.muscle is not None and not s.muscle.varies:
        more = s.muscle(0.0)
        x, y = x + float(more[0]), y + float(more[1])
    return p_.Parts(
        p_.Time(float(s.dt), float(s.t_max), math.floor(s.t_max / s.dt + 1e-6)),
        p_.Arm(tuple(map(float, s.arm.links)), *map(float, s.origin)),
        tuple(p_.Servo(*map(float, each.numbers)) for each in s.servo), 1 if s.shaping else None, lag, form,
        hand_parts(s), p_.Push((0.0, float(x), float(y), 0.0, 0.0), None), None,
        tuple(map(float, s.torque_limit)), regions.region_table(s.clay, s.length), *clay_part(s), None, *accurate_parts(s),
    )  # fmt: skip


def first_loop(parts, s):
    axes, form, p = [], None, s.start
    for i in (0, 1):
        G = s.servo[i].G
        v, ratio = float(s.velocity[i]), parts.servo[i].ratio
        axes.append(s_.Axis((p[i] + G.damping / G.stiffness * v) / ratio, v / ratio, float(p[i]), v))
    if parts.form is not None:
        form = tuple(
            tuple(compensator.moving_states(c, v / x.ratio))
            for c, x, v in zip(s.compensators, parts.servo, s.velocity, strict=True)
        )
        axes = [s_.Axis(a.delta, 0.0, a.y, a.yrate) for a in axes]
    if parts.accurate is not None:
        modes = None
        if parts.modal:
            law = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0)
            modes = s_.Modes(law, (1.0, 1.0), NONE, NONE, NONE, NONE, NONE, INF)
        return s_.Course(*axes, form, 0, 0.0, modes)
    return s_.Loop(*axes, form)


def first_special(special, p):
    """State of the special laws before the handle has been anywhere."""
    if special is None:
        return None
    law, nan = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0), (math.nan, math.nan)
    return s_.Special(
        NONE,
        s_.Split(0.0, NONE, NONE) if special.stiff else None,
        s_.Felt(law, law, NONE, NONE, NONE, NONE, nan, 0.0, NONE) if special.flow else None,
        s_.Elastic(((0.0,) * 6, (0.0,) * 6), NONE, NONE, p, NONE, NONE, 0.0, 0.0, INF)
        if special.springs else None,
        s_.Cut(nan, NONE, NONE, 0.0) if special.groove else None,
    )  # fmt: skip


def start(parts, s: Scenario, e):
    links, part = parts.arm.links, parts.clay
    q = arm.inverse_kinematics(s.origin[0] + s.start[0], s.origin[1] + s.start[1], links)
    r = arm.joint_velocity(*map(float, s.velocity), arm.jacobian(*q, links), 1.0)
    e.q[0], e.q[1], e.w[0], e.w[1] = q[0], q[1], r[0], r[1] - r[0]
    q, w = (e.q[0], e.q[1]), (e.w[0], e.w[1])
    body, p = s_.Body(q, w, NONE), tuple(map(float, s.start))
    special = parts.special
    clay = s_.Clay(
        s_.Region((0, 0), NONE, NONE), NONE, NONE,
        s_.Growth(NONE, NONE) if part and part.growth else None,
        s_.Hit(INF, 0.0) if parts.hits else None, first_special(special, p),
    )  # fmt: skip
    index = regions.region_of(parts.table, p)
    # at the very place: the start may be off by the rounding of the angles
    clay = borders.clay_in(parts, clay, index, 0.0, kick.place(parts.arm, q), -1, 0.0)
    if special is not None and special.groove is not None:
        at = kick.handle_at(parts.arm, body, 0.0)
        b, old, cut = grooves.moved(special.groove, clay.special.cut, clay, at.p, at.v)
        clay = clay._replace(b=b, special=clay.special._replace(cut=cut))
    x = clay.special
    if special is not None and special.flow is not None:
        x = x._replace(felt=x.felt._replace(old=x.felt.law))
    growth = s_.Growth(clay.growth.rate, clay.growth.rate) if clay.growth else None
    clay = clay._replace(old=clay.b, growth=growth, special=x)
    ix, iy = index
    return s_.State(
        s_.Clock(0.0, 0, 0.0), body, first_loop(parts, s), clay, s_.Work(0.0, 0.0, 0.0, 0.0, 0.0),
        s_.Status(OPEN, OPEN, 0, 0, (ix, ix, iy, iy)), s_.Filled(0, 0, 0, 0),
    )  # fmt: skip


def make_engine(s: Scenario):
    model = engine.build(s)
    data = mujoco.MjData(model)
    clay = s.clay
    stops = np.zeros(3 * 4 * CHUNK if clay and clay.yields else 0)
    rendered = np.zeros(3 * CHUNK if clay and (clay.yields or clay.springs) else 0)
    arrays = (
        data.qpos, data.qvel, data.ctrl, data.qfrc_applied, engine.timestep_view(model),
        np.zeros(CHUNK * 16), np.zeros(CROSSINGS * 4), stops, rendered,
    )  # fmt: skip
    bounds = CROSSINGS - 3, len(stops) // 3 - 8 if len(stops) else 1
    probe = None
    if s.integrator == "accurate":
        probe = Probe(
            mujoco.mj_forward, model, data,
            *map(memoryview, (data.qpos, data.qvel, data.qacc, data.ctrl, data.qfrc_applied)),
        )  # fmt: skip
    plain = Engine(mujoco.mj_step, model, data, *map(memoryview, arrays), *bounds, probe)
    return plain, arrays, bounds, model, data


def run(s: Scenario, advance=None, engine_of=None):
    e, arrays, bounds, model, data = make_engine(s)
    parts = parts_of(s)
    st = start(parts, s, e)
    if engine_of:
        e = engine_of(model, data, arrays, bounds)
    rows, crossings, stops = [], [], []
    go = advance or path.advance
    while st.status.code == OPEN:
        st = go(parts, st, e, CHUNK - 1)
        x = st.filled
        rows.append(arrays[5][: 16 * x.rows].reshape(-1, 16).copy())
        crossings += arrays[6][: 4 * x.crossings].reshape(-1, 4).tolist()
        stops += arrays[7][: 3 * x.stops].reshape(-1, 3).tolist()
        st = path.with_filled(st, s_.Filled(0, 0, 0, 0))
    return np.concatenate(rows), crossings, stops, st, parts
