"""A scene compiled from its parts, and the state at its start."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..model import compensator, groove, pieces, regions
from ..model import hardware as devices
from ..model.constants import B_MAX
from ..model.sampled_controller import BUFFER, Controller, LawCaller
from ..scene.scenario import Scenario
from . import begin, hardware, laws, pace, rows
from . import parts as p_
from . import state as s_
from .machine_code import kind_of
from .march import GROWTH_BLOCK
from .memories import delay_in_samples, formed_memory, held_memory
from .modes import SUBSTEPS
from .parts import INF

NONE = (0.0, 0.0)
QUEUE = 4  # rows of the queue of torques in addition to the whole samples of their delay
STIFF, HITTING = 1.0, 0.02  # see `hardness`
NOISE_AHEAD = 16384  # control samples whose random effects are drawn at once


def hand_parts(s: Scenario):
    if not any(s.operators):
        return None
    longer = 1 if s.control == "sampled" else None
    none = p_.Hand(0.0, 0.0, 0.0, longer)
    return tuple(
        p_.Hand(th.mass, th.damper, th.spring, longer) if th else none for th in s.operators
    )


def compensators(s: Scenario):
    lags: Any = [c.lag for c in s.compensators]
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


def largest_damping(s: Scenario) -> float:
    """Largest damping that the clay may ever have [N.s/m]."""
    clay: Any = s.clay
    return B_MAX if clay.grows else clay.largest


def hardness(s: Scenario, b: Any) -> tuple[Any, Any]:
    """Whether a scene has the parts Stiff and Hits, in clay of some largest damping [N.s/m].

    Args:
        s: the scene.
        b: the damping, a number or an array over runs.
    """
    if is_held(s) or (s.integrator != "fast" and s.control != "sampled"):
        return False, False
    # share of its velocity that a step of explicit damping would take from a handle without a hand
    k = b * s.dt * s.arm.links[4]
    return k > STIFF, s.control != "sampled" and k > HITTING


def clay_part(s: Scenario):
    clay = s.clay
    if clay is None:
        return None, None, None, None
    grain = (math.cos(clay.angle), math.sin(clay.angle)) if clay.angle else None
    fast = s.integrator == "fast" or s.control == "sampled"
    flow = None
    if clay.yields and fast:
        flow = p_.Flow(1 if clay.isotropic or clay.groove else None)
    springy = block = None
    if clay.springs:
        springy = p_.Springs(float(pace.spring_step(s)), 1 if is_held(s) else None)
    if clay.groove:
        g = clay.groove
        block = p_.Groove(
            g.numbers, float(g.damping) if g.damping else None, g.shares.copy(), g.relief,
            np.zeros(groove.RIM), np.zeros(2),
        )  # fmt: skip
    is_stiff, is_hit = hardness(s, largest_damping(s))
    stiff = p_.Stiff(float(s.mobility)) if is_stiff else None
    hits = p_.Hits(HITTING / s.arm.links[4]) if is_hit else None
    special = p_.Special(clay.smooth or None, stiff, flow, springy, block, laws.parts_of(s))
    special = special if any(x is not None for x in special) else None
    return p_.Clay(1 if clay.grows else None), grain, hits, special


def steady_force(s: Scenario) -> tuple[float, float]:
    """The constant part of the muscle force, (x, y) [N]."""
    (x, y), muscle = s.force, s.muscle
    if muscle is not None and not muscle.varies:
        more = muscle(0.0)
        x, y = x + more[0], y + more[1]
    return float(x), float(y)


def accurate_parts(s: Scenario):
    """The accurate method, and clay that yields in it."""
    if s.integrator == "fast" or s.control == "sampled":
        return None, None
    pace.check_explicit(s)
    blocks = modal = None
    if s.clay and s.clay.grows:
        blocks = substeps_of_blocks(s)
    if s.clay and s.clay.yields:
        along, grain = (1, None) if s.clay.isotropic else (None, clay_part(s)[1])
        modal = p_.Modal(along, grain, float(pace.largest_lightness(s)), float(s.dt))
    return p_.Accurate(pace.parts_of_sample(s, 0), blocks), modal


def substeps_of_blocks(s: Scenario):
    """Engine steps a sample, by block; they grow, and after SUBSTEPS all are as many."""
    count = math.floor(s.t_max / s.dt + 1e-6) // GROWTH_BLOCK + 1
    blocks = np.empty(count, dtype=np.int64)
    for j in range(count):
        blocks[j] = pace.parts_of_sample(s, j * GROWTH_BLOCK)
        if blocks[j] > SUBSTEPS:
            blocks[j:] = SUBSTEPS + 1
            break
    return blocks


def parts_of(s: Scenario, controller: Controller | None = None):
    """The parts of a scene.

    Args:
        s: the scene.
        controller: the user's own, in place of the scene's.
    """
    lag, form = compensators(s)
    clay = clay_part(s)
    parts = p_.Parts(
        p_.Time(float(s.dt), float(s.t_max), math.floor(s.t_max / s.dt + 1e-6)),
        p_.Arm(tuple(map(float, s.arm.links)), *map(float, s.origin)),
        tuple(p_.Servo(*map(float, each.numbers)) for each in s.servo),
        1 if s.inertia_shaping else None, lag, form, hand_parts(s),
        p_.Push((0.0, *steady_force(s), 0.0, 0.0), None), None,
        tuple(map(float, s.torque_limit)), regions.region_table(s.clay, s.length), *clay,
        sampler(s, controller or s.controller, *clay[::3]), *accurate_parts(s),
    )  # fmt: skip
    return with_signals(parts, s) if s.driven else parts


def with_signals(parts, s: Scenario):
    """The parts with signals over no step yet, see signal_ahead.Drives."""
    accurate, sampler, push = parts.accurate, parts.sampler, parts.push
    signal = p_.Signal(np.zeros((1, pieces.PIECE)), np.zeros((0, 2)), 0)
    if accurate is not None:
        parts = parts._replace(
            accurate=accurate._replace(ahead=p_.Ahead(np.zeros(0), np.full(1, INF), 0.0))
        )
    if s.muscle is not None and s.muscle.varies:
        halves = np.zeros((0, 6)) if sampler is not None else None
        parts = parts._replace(push=push._replace(muscle=signal._replace(halves=halves)))
    if s.command is not None and s.command.varies:
        if sampler is not None:
            return parts._replace(sampler=sampler._replace(command=signal))
        return parts._replace(command=signal)
    return parts


def sampler(s: Scenario, controller, clay, special):
    """Sampled control and its hardware.

    Args:
        controller: the user's own, as it runs; None for none.
    """
    if s.control != "sampled":
        return None
    ratio, io = round((s.Ts or s.dt) / s.dt), s.hardware
    Ts = ratio * float(s.dt)
    axes = list(zip(s.servo, s.compensators, s.gain, strict=True))
    lags = [c.lag for c in s.compensators]
    memory = state_space = own = None
    if all(x and x[0] == 1.0 for x in lags):
        memory = np.ravel([held_memory(*axis, Ts) for axis in axes])
    else:
        state_space = np.ravel([formed_memory(*axis, Ts) for axis in axes])
    if controller is not None:
        state = controller.state
        buffer = np.array([0.0] * BUFFER + [*state, *state, *controller.params])
        own = p_.Own(LawCaller(controller, buffer), buffer, tuple(map(float, state)))
    physical = (None, None) if is_held(s) else (clay, special)
    told = is_held(s) and (io or (not own and special is not None and rows.tells(special)))
    first: Any = ratio, Ts, *physical, 1 if told else None, memory, state_space, own, None
    none = (None,) * (len(p_.Sampler._fields) - len(first))
    return p_.Sampler(*first, *(hardware_parts(s, io, Ts) if io else none))


def hardware_parts(s: Scenario, io, Ts):
    """The parts of a Sampler from `chance` on.

    Args:
        io: the Hardware.
    """
    chance = difference = lag = adc = dac = delay = friction = passivity = coupling = None
    if io.jitter > 0.0 or io.dropout_probability > 0.0 or io.force_noise > 0.0:
        n = min(int(s.t_max / Ts), NOISE_AHEAD) + 8
        chance = p_.Chance(devices.SampleNoise(io).table(0, n).ravel(), 0)
    if io.velocity == "difference":
        cutoff = float(io.velocity_filter) if io.velocity_filter else None
        difference = p_.Difference(io.velocity_window, cutoff, np.zeros(3 * io.velocity_window))
    if io.force_filter is not None:
        lag = devices.butterworth(io.force_filter, io.filter_order, Ts)
    if io.adc_bits:
        adc = p_.Converter(io.adc_bits, (float(io.adc_range), float(io.adc_range)))
    if io.dac_bits:
        dac = p_.Converter(io.dac_bits, tuple(map(float, io.dac_range or s.torque_limit)))
    whole, share = delay_in_samples(io.delay, Ts)
    if io.delay > 0.0:
        delay = late_torques(float(io.delay), whole)
    if any(io.friction):
        friction = tuple(map(float, io.friction))
    if io.passivity:
        passivity = guard(whole, float(share))
    if io.coupling is not None:
        coupling = p_.Coupling(float(io.coupling.spring), float(io.coupling.damper))
    uneven = 1 if io.jitter > 0.0 or io.delay > 0.0 else None
    more = difference, lag, adc, dac, delay, friction, passivity, coupling
    return chance, uneven, io.encoder or None, *more


def late_torques(delay: float, whole: int):
    """Torques that come late by so many whole samples, and a rest."""
    return p_.Delay(delay, whole + QUEUE, np.zeros(hardware.QUEUED * (whole + QUEUE)))


def guard(whole: int, share: float):
    """The passivity controller behind a delay of so many whole samples, and a rest."""
    return p_.Passivity(whole, share, np.zeros(2 * (whole + 2)))


def for_delays(parts, longest: float):
    """The parts of a scene with rings for a longer delay of the torques.

    Args:
        parts: of the scene.
        longest: delay [s].
    """
    sampler = parts.sampler
    if sampler is None:
        return parts
    whole, share = delay_in_samples(longest, sampler.Ts)
    delay = late_torques(longest, whole) if sampler.delay else None
    passivity = guard(whole, share) if sampler.passivity else None
    return parts._replace(sampler=sampler._replace(delay=delay, passivity=passivity))


def first_reaction(special):
    """Reaction of the clay before the first kick."""
    if special is None:
        return None
    contact = s_.Contact(NONE, NONE, NONE, NONE, (math.nan, math.nan), 0.0, NONE)
    split = s_.Split(0.0, NONE, NONE) if special.stiff else None
    return s_.Reaction(NONE, split, contact if special.flow else None)


def first_laws(special, p):
    """State of the laws before any motion of the handle."""
    if special is None:
        return None
    law, none = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0), (0.0,) * 6
    elastic = s_.Elastic((none, none), NONE, NONE, p, NONE, NONE, 0.0, 0.0, INF)
    return s_.Laws(
        s_.Flow(law, law) if special.flow else None,
        elastic if special.springs else None,
        s_.Cut((math.nan, math.nan), NONE, NONE, 0.0) if special.groove else None,
        laws.start(special.more, p),
    )  # fmt: skip


def first_form(parts, s):
    """States of compensators of another shape, of a handle in steady motion."""
    if parts.form is None:
        return None
    both = zip(s.compensators, parts.servo, s.velocity, strict=True)
    return tuple(tuple(compensator.moving_states(c, v / x.ratio)) for c, x, v in both)


def blocks(parts, s: Scenario):
    """A state with the blocks of all parts, before any motion of the handle."""
    axis = s_.Axis(0.0, 0.0, 0.0, 0.0)
    growth = s_.Growth(NONE, NONE) if parts.clay and parts.clay.growth else None
    hit = s_.Hit(INF, 0.0) if parts.hits else None
    works = s_.HardwareWork(0.0, 0.0, 0.0, 0.0) if counts_hardware(parts, s) else None
    clay = s_.Clay(
        s_.Region((0, 0), NONE, NONE), NONE, NONE, growth, hit,
        first_reaction(parts.special), first_laws(parts.special, NONE),
    )  # fmt: skip
    return s_.State(
        s_.Clock(0.0, 0, 0.0), s_.Body(NONE, NONE, NONE), s_.Loop(axis, axis, first_form(parts, s)),
        clay, s_.Work(0.0, 0.0, 0.0, 0.0, 0.0, works), s_.Status(0, 0, 0, 0, (0, 0, 0, 0)),
        s_.Filled(0, 0, 0, 0),
    )  # fmt: skip


def renders_clay(parts) -> bool:
    """Whether the motors hold the force of clay that the loop computes."""
    x = parts.sampler
    return x is not None and x.own is None and x.clay is None and parts.clay is not None


def counts_hardware(parts, s: Scenario) -> bool:
    """Whether the ledger has entries of hardware, or of clay that the motors hold."""
    return renders_clay(parts) or (parts.sampler is not None and s.hardware is not None)


def start(parts, s: Scenario, e):
    """The state at the start of a run."""
    p, v = tuple(map(float, s.start)), tuple(map(float, s.velocity))
    return begin.begun(parts, blocks(parts, s), e, p, v)


def traits(s: Scenario) -> tuple[Any, ...]:
    """What decides which parts a scene has; scenes with equal traits share machine code.

    Args:
        s: the scenario.
    """
    clay, io, own, law, wires = s.clay, s.hardware, s.controller, None, None
    if clay is not None:
        block, hard = clay.groove, hardness(s, largest_damping(s))
        law = (
            clay.grows, clay.smooth, clay.yields, clay.springs, bool(clay.angle), clay.isotropic,
            block is not None and bool(block.damping), block is not None, hard,
        )  # fmt: skip
    if io is not None:
        random = (
            io.jitter > 0.0,
            io.dropout_probability > 0.0 or io.force_noise > 0.0,
            io.delay > 0.0,
        )
        order = io.filter_order if io.force_filter is not None else 0
        wires = (
            *random, order, io.velocity == "difference" and bool(io.velocity_filter), io.velocity,
            *map(bool, (io.encoder, io.adc_bits, io.dac_bits, any(io.friction), io.passivity)),
            io.coupling is not None,
        )  # fmt: skip
    driven = (x is not None and x.varies for x in (s.muscle, s.command))
    forms = ((c.lag and c.lag[0], c.order) for c in s.compensators)
    more = kind_of(laws.parts_of(s)) if laws.TABLE else None
    return (
        s.control, s.render, s.integrator, bool(s.inertia_shaping), any(s.operators), *driven,
        *forms, law, wires, own and len(own.state), more,
    )  # fmt: skip


def written(parts):
    """Arrays of a scene that steps write into."""
    out = [parts.table]
    if parts.special is not None and parts.special.groove is not None:
        g = parts.special.groove
        out += [g.ground, g.rim, g.removed]
    return out + ([] if parts.sampler is None else rings(parts.sampler))


def keep_written(parts, before):
    """Takes over what steps have written into the arrays of a scene whose numbers change."""
    regions.keep_entries(parts.table, before.table)
    for new, old in zip(written(parts)[1:], written(before)[1:], strict=True):
        new[:] = old


def takes_gain(parts) -> bool:
    """Whether another gain changes nothing but the numbers K of the compensators."""
    return parts.lag is not None and parts.sampler is None and parts.accurate is None


def with_gain(parts, gain: tuple[float, float]):
    """The parts with another gain, where `takes_gain`.

    Args:
        gain: K of x and y [1/kg].
    """
    lag = tuple(x._replace(K=K) for x, K in zip(parts.lag, gain, strict=True))
    return parts._replace(lag=lag)


def rings(sampler):
    """Arrays in which the hardware keeps past samples."""
    parts = sampler.difference, sampler.delay, sampler.passivity
    return [x.ring for x in parts if x is not None]


def own_law(parts):
    """The caller of the user's own controller; None without any."""
    if parts.sampler is None or parts.sampler.own is None:
        return None
    return parts.sampler.own.law


def cause_of_end(parts):
    """Why no further step is possible."""
    law = own_law(parts)
    if law is not None and not law.finite():
        return "the torques of the controller are not finite"
    return "the arm is stretched or folded"


def viewed(part):
    """Parts with memoryviews in place of arrays: CPython reads plain floats from them, and faster.

    Args:
        part: the parts of a scene.
    """
    if isinstance(part, np.ndarray):
        return memoryview(part)  # type: ignore[arg-type]
    if isinstance(part, tuple):
        made = map(viewed, part)
        return type(part)._make(made) if hasattr(part, "_make") else tuple(made)
    return part


def tells(parts):
    """Whether the force of the clay is recorded, because b v does not give it."""
    own = parts.modal is not None or (parts.special is not None and rows.tells(parts.special))
    return own or (parts.sampler is not None and parts.sampler.rendered is not None)
