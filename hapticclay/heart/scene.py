"""A scene compiled of the parts that it has, and the state at its start."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..model import arm, compensator, groove, hardware as interface, regions
from ..model.constants import B_MAX
from ..model.scenario import Scenario
from ..stepping import engine
from ..stepping.engine import mujoco
from ..model.sampled_controller import DESK, LawCaller
from ..stepping.run import spring_step
from ..stepping.sampled import delay_in_samples, formed_memory, held_memory
from . import borders, grooves, hardware, kick, parts as p_, path, sampled, state as s_
from .parts import INF
from .state import OPEN

CHUNK, CROSSINGS = 4096, 64
NONE = (0.0, 0.0)
TOLD = [None]


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


def hand_parts(s: Scenario):
    if not any(s.operators):
        return None
    longer = 1 if s.control == "sampled" else None
    none = p_.Hand(0.0, 0.0, 0.0, longer)
    return tuple(p_.Hand(th.mass, th.damper, th.spring, longer) if th else none for th in s.operators)


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


def is_held(s: Scenario) -> bool:
    """Whether the motors render the clay."""
    return s.control == "sampled" and s.render == "held"


def stiffness(s: Scenario) -> float:
    """Largest share of its velocity that a step of explicit damping would take from the handle."""
    b = B_MAX if s.clay.grows else s.clay.largest
    return b * s.dt * max(s.mobility, s.arm.links[4])


def clay_part(s: Scenario):
    clay = s.clay
    if clay is None:
        return None, None, None, None
    grain = (math.cos(clay.angle), math.sin(clay.angle)) if clay.angle else None
    flow = p_.Flow(1 if clay.isotropic or clay.groove else None) if clay.yields else None
    springy = block = None
    if clay.springs:
        springy = p_.Springs(float(spring_step(s)), 1 if is_held(s) else None)
    if clay.groove:
        g = clay.groove
        block = p_.Groove(
            g.numbers, float(g.damping) if g.damping else None, g.shares.copy(), g.relief,
            np.zeros(groove.RIM), np.zeros(2),
        )  # fmt: skip
    b = 0.0 if is_held(s) else stiffness(s)
    stiff = p_.Stiff(float(s.mobility)) if b > 1.0 else None
    hits = p_.Hits(0.02 / s.arm.links[4]) if b > 0.02 and s.control != "sampled" else None
    special = p_.Special(clay.smooth or None, stiff, flow, springy, block)
    special = special if any(x is not None for x in special) else None
    return p_.Clay(1 if clay.grows else None), grain, hits, special


def parts_of(s: Scenario):
    lag, form = compensators(s)
    clay = clay_part(s)
    x, y = s.force
    if s.muscle is not None and not s.muscle.varies:
        more = s.muscle(0.0)
        x, y = x + float(more[0]), y + float(more[1])
    return p_.Parts(
        p_.Time(float(s.dt), float(s.t_max), math.floor(s.t_max / s.dt + 1e-6)),
        p_.Arm(tuple(map(float, s.arm.links)), *map(float, s.origin)),
        tuple(p_.Servo(*map(float, each.numbers)) for each in s.servo), 1 if s.shaping else None, lag, form,
        hand_parts(s), p_.Push((0.0, float(x), float(y), 0.0, 0.0), None), None,
        tuple(map(float, s.torque_limit)), regions.region_table(s.clay, s.length), *clay, sampler(s, *clay[::3]), None,
    )  # fmt: skip


def sampler(s: Scenario, clay, special):
    """Sampled control and its hardware."""
    if s.control != "sampled":
        return None
    ratio, io = round((s.Ts or s.dt) / s.dt), s.interface
    Ts = ratio * float(s.dt)
    axes = list(zip(s.servo, s.compensators, s.gain, strict=True))
    lags = [c.lag for c in s.compensators]
    memory = formed = own = None
    if all(x and x[0] == 1.0 for x in lags):
        memory = np.ravel([held_memory(*axis, Ts) for axis in axes])
    else:
        formed = np.ravel([formed_memory(*axis, Ts) for axis in axes])
    if s.controller is not None:
        state = s.controller.state
        desk = np.array([0.0] * DESK + [*state, *state, *s.controller.params])
        own = p_.Own(LawCaller(s.controller, desk), memoryview(desk), len(state))
    physical = (None, None) if is_held(s) else (clay, special)
    told = is_held(s) and (io or (not own and s.clay and (s.clay.yields or s.clay.springs)))
    first = ratio, Ts, *physical, 1 if told else None, memory, formed, own, None
    return p_.Sampler(*first, *(hardware_parts(s, io, Ts) if io else (None,) * 11))


def hardware_parts(s: Scenario, io, Ts):
    """The parts of a Sampler from `chance` on."""
    chance = difference = lag = adc = dac = delay = friction = passivity = coupling = None
    if io.jitter > 0.0 or io.lost > 0.0 or io.force_noise > 0.0:
        n = int(s.t_max / Ts) + 8
        chance = interface.SampleNoise(io).table(0, n).ravel()
    if io.velocity == "difference":
        cutoff = float(io.velocity_filter) if io.velocity_filter else None
        difference = p_.Difference(io.window, cutoff, np.zeros(3 * io.window))
    if io.force_filter is not None:
        lag = interface.butterworth(io.force_filter, io.filter_order, Ts)
    if io.adc_bits:
        adc = p_.Converter(io.adc_bits, (float(io.adc_range), float(io.adc_range)))
    if io.dac_bits:
        dac = p_.Converter(io.dac_bits, tuple(map(float, io.dac_range or s.torque_limit)))
    whole, share = delay_in_samples(io.delay, Ts)
    if io.delay > 0.0:
        delay = p_.Delay(float(io.delay), whole + 4, np.zeros(hardware.QUEUED * (whole + 4)))
    if any(io.friction):
        friction = tuple(map(float, io.friction))
    if io.passivity:
        passivity = p_.Passivity(whole, float(share), np.zeros(2 * (whole + 2)))
    if io.coupling is not None:
        coupling = p_.Coupling(float(io.coupling.spring), float(io.coupling.damper))
    uneven = 1 if io.jitter > 0.0 or io.delay > 0.0 else None
    return chance, uneven, io.encoder or None, difference, lag, adc, dac, delay, friction, passivity, coupling


def first_machine(part, parts, s: Scenario, q, w):
    """Controller and hardware at the start; the past of the sensors goes into their rings."""
    loop, p = first_loop(parts, s), tuple(map(float, s.start))
    x, y, form = loop.x, loop.y, None
    own = tuple(map(float, s.controller.state)) if s.controller else None
    if own is not None:
        x = y = s_.Axis(0.0, 0.0, 0.0, 0.0)
    if loop.form is not None:
        form = s_.Formed(*loop.form, (x.delta, y.delta))
    rates = None
    if part.difference:
        ring, n = part.difference.ring, part.difference.window
        for i in range(n):  # before the start the joints have turned so for long
            j = i - n
            then = q[0] + j * part.Ts * w[0], q[1] + j * part.Ts * w[1]
            ring[3 * i] = float(j)
            ring[3 * i + 1], ring[3 * i + 2] = hardware.encoded(part.encoder, then)
        rates = s_.Rates(w, 0)
    hold = s_.Hold(
        NONE, NONE, hardware.nothing(part.passivity), hardware.no_pull(part.coupling)
    )  # fmt: skip
    return s_.Machine(
        x, y, form, own, hold, sampled.samples_from(part, parts.time.dt, 0), NONE, rates,
        (0.0,) * 4 if part.filter else None, s_.Guard(NONE, p, 0) if part.passivity else None,
        p if part.coupling else None, s_.Queue(0, 0, INF, INF) if part.delay else None,
    )  # fmt: skip


def first_sampled(part, parts, s: Scenario, body, clay, work):
    machine = first_machine(part, parts, s, body.q, body.w)
    hold, at = machine.hold, kick.handle_at(parts.arm, body, 0.0)
    event = s_.Event(0.0, at, body.w, clay.special, NONE, work, NONE, 0.0, hold, machine)
    return s_.Sampled(machine, event)


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
    works = s_.HardwareWork(0.0, 0.0, 0.0) if s.interface and parts.sampler else None
    work, part = s_.Work(0.0, 0.0, 0.0, 0.0, 0.0, works), parts.sampler
    loop = first_sampled(part, parts, s, body, clay, work) if part else first_loop(parts, s)
    return s_.State(
        s_.Clock(0.0, 0, 0.0), body, loop, clay, work,
        s_.Status(OPEN, OPEN, 0, 0, (ix, ix, iy, iy)), s_.Filled(0, 0, 0, 0),
    )  # fmt: skip


def make_engine(s: Scenario):
    model = engine.build(s)
    data = mujoco.MjData(model)
    clay = s.clay
    stops = np.zeros(3 * 16 * CHUNK if clay and clay.yields else 0)
    told = clay and (clay.yields or clay.springs) or is_held(s) and s.interface
    rendered = np.zeros(3 * CHUNK if told else 0)
    arrays = (
        data.qpos, data.qvel, data.ctrl, data.qfrc_applied, engine.timestep_view(model),
        np.zeros(CHUNK * 16), np.zeros(CROSSINGS * 4), stops, rendered,
    )  # fmt: skip
    bounds = CROSSINGS - 3, len(stops) // 3 - 8 if len(stops) else 1
    plain = Engine(mujoco.mj_step, model, data, *map(memoryview, arrays), *bounds)
    return plain, arrays, bounds, model, data


def viewed(part):
    """Parts whose arrays are memoryviews, which CPython reads as plain floats."""
    if isinstance(part, np.ndarray):
        return memoryview(part)
    if isinstance(part, tuple):
        x = [viewed(each) for each in part]
        return type(part)(*x) if hasattr(part, "_fields") else tuple(x)
    return part


def run(s: Scenario, advance=None, engine_of=None):
    e, arrays, bounds, model, data = make_engine(s)
    parts = parts_of(s)
    st = start(parts, s, e)
    if engine_of:
        e = engine_of(model, data, arrays, bounds)
    rows, crossings, stops, told = [], [], [], []
    go = advance or path.advance
    if not engine_of:
        parts = viewed(parts)
    while st.status.code == OPEN:
        st = go(parts, st, e, CHUNK - 1)
        x = st.filled
        rows.append(arrays[5][: 16 * x.rows].reshape(-1, 16).copy())
        crossings += arrays[6][: 4 * x.crossings].reshape(-1, 4).tolist()
        told.append(arrays[8][: 3 * x.rows].reshape(-1, 3).copy())
        stops += arrays[7][: 3 * x.stops].reshape(-1, 3).tolist()
        st = path.with_filled(st, s_.Filled(0, 0, 0, 0))
    TOLD[0] = np.concatenate(told)
    return np.concatenate(rows), crossings, stops, st, parts
