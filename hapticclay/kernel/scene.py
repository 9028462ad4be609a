"""A scene turned into a Model and the arrays that it names."""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from ..arms.joint_law import JointPD
from ..formulas import compensator as form
from ..formulas import groove as groove_law
from ..formulas import pieces
from ..formulas.constants import B_MAX
from ..model import compensator, controller, regions
from ..model import hardware as devices
from ..model.controller import Servo
from ..model.sampled_controller import Controller, LawCaller
from ..scene.joint_numbers import turning
from ..scene.scenario import Scenario
from . import hardware, methods, modes, pace, records, sampled, user_laws
from .march import GROWTH_BLOCK

QUEUE = 4  # rows of the queue of torques in addition to the whole samples of their delay
STIFF, HITTING = 1.0, 0.02  # see `hardness`
NOISE_AHEAD = 16384  # control samples whose random effects are drawn at once
NEVER = 1 << 62  # sample from which no random effects are drawn


class Compiled(NamedTuple):
    """A scene, ready to run: its Model, and the arrays that its empty fields are to name."""

    m: Any
    arrays: dict[str, np.ndarray]
    written: tuple[str, ...]  # names of those that steps write
    caller: LawCaller | None  # of the user's own controller
    laws: tuple[Any, ...]  # of the user, each a UserLaw


def compile_scene(s: Scenario, own: Controller | None = None) -> Compiled:
    """The model of a scene; `own`: the user's controller, in place of the scenario's."""
    m, arrays = records.Model(), {"table": regions.region_table(s.clay, s.length)}
    put_arm(m, arrays, s)
    put_axes(m, s)
    put_clay(m, arrays, s)
    caller = None
    if s.control == "sampled":
        caller = put_sampler(m, arrays, s, own)
    elif s.integrator != "fast":
        put_accurate(m, arrays, s)
    laws = user_laws.of_scene(s)
    put_signals(m, arrays, s)
    put_special(m, s, bool(laws))
    names = ("table", "ground", "rim", "removed", "angles", "queue", "forces", "buffer")
    return Compiled(m, arrays, tuple(x for x in names if x in arrays), caller, laws)


# ---- arm and loop --------------------------------------------------------------------------------


def put_arm(m: Any, arrays: dict[str, np.ndarray], s: Scenario) -> None:
    """Times, arm and the limits of its motors."""
    m.dt, m.t_max, m.last = float(s.dt), float(s.t_max), math.floor(s.t_max / s.dt + 1e-6)
    if not s.is_closed_form:
        from . import joint_scene  # imported only for an arm from a file

        joint_scene.put_arm(m, arrays, s)
        return
    m.links[:] = map(float, s.arm.links)
    m.ox, m.oy = map(float, s.origin)
    m.joints = m.axes = 2
    m.limit[:2] = map(float, s.torque_limit)
    m.shaping = int(bool(s.inertia_shaping))


def put_axes(m: Any, s: Scenario) -> None:
    """Compensator, servo, hand and muscle of each axis."""
    m.hand, m.spring_uses_longer_step = int(any(s.operators)), int(s.control == "sampled")
    force = s.steady_force
    for i, a in enumerate(m.axis[: m.axes]):
        if th := s.operators[min(i, 1)]:
            a.mass, a.damper, a.spring = float(th.mass), float(th.damper), float(th.spring)
        a.push = force[i]
    for i, a in enumerate(m.axis[:2]):
        a.servo[:] = map(float, s.servo[i].numbers)
        a.K = float(s.gain[i])
    lags = [c.lag for c in s.compensators]
    if all(x and x[0] == 1.0 for x in lags):
        for a, lag in zip(m.axis[:2], lags, strict=True):
            a.pole = float(lag[1])  # type: ignore[index]
        return
    m.formed, m.order = 1, max(1, *(c.order for c in s.compensators))
    m.form[:] = [float(x) for c in s.compensators for x in compensator.form_numbers(c)]
    for i, a in enumerate(m.axis[:2]):
        z = compensator.moving_states(s.compensators[i], s.velocity[i] / a.servo[0])
        a.z0[:] = [float(x) for x in z]


def takes_gain(m: Any) -> bool:
    """Whether another gain changes nothing but the numbers K of the compensators."""
    return not m.formed and m.method == methods.CONTINUOUS


# ---- clay ----------------------------------------------------------------------------------------


def is_held(s: Scenario) -> bool:
    """Whether the motors render the clay."""
    return s.control == "sampled" and s.render == "held"


def largest_damping(s: Scenario) -> float:
    """Largest damping that the clay may ever have [N.s/m]."""
    clay: Any = s.clay
    return B_MAX if clay.grows else clay.largest


def hardness(s: Scenario, b: Any) -> tuple[Any, Any]:
    """Whether a step may overshoot, and whether a hit may saturate the motors within one."""
    if is_held(s) or (s.integrator != "fast" and s.control != "sampled"):
        return False, False
    # share of its velocity that a step of explicit damping would take from a handle without a hand
    k = b * s.dt * s.free_mobility
    return k > STIFF, s.control != "sampled" and k > HITTING


def put_clay(m: Any, arrays: dict[str, np.ndarray], s: Scenario) -> None:
    """The clay and its laws."""
    clay = s.clay
    if clay is None:
        return
    m.clay, m.acts, m.grows = 1, int(not is_held(s)), int(clay.grows)
    if clay.angle:
        m.rotated, m.cosine, m.sine = 1, math.cos(clay.angle), math.sin(clay.angle)
    m.smooth = int(clay.smooth or 0)
    if clay.yields and (s.integrator == "fast" or s.control == "sampled"):
        m.flow = 2 if clay.isotropic or clay.groove else 1
        m.yields_rotated = m.rotated
    if clay.springs:
        m.springs, m.spring_step = 2 if is_held(s) else 1, float(pace.spring_step(s))
    stiff, hits = hardness(s, largest_damping(s))
    if stiff:
        m.stiff, m.mobility = 1, float(s.mobility)
    if hits:
        m.hits, m.first_hit = 1, HITTING / s.free_mobility
    if clay.groove:
        put_groove(m, arrays, clay.groove)


def put_groove(m: Any, arrays: dict[str, np.ndarray], g: Any) -> None:
    """Clay that stays cut."""
    m.groove, m.drags, m.drag = 1, int(bool(g.damping)), float(g.damping)
    m.grid[:] = map(float, g.numbers)
    arrays |= {"ground": g.shares.copy(), "relief": np.ascontiguousarray(g.relief, float)}
    arrays |= {"rim": np.zeros(groove_law.RIM), "removed": np.zeros(2)}


def put_special(m: Any, s: Scenario, has_laws: bool) -> None:
    """Whether the clay has more laws than plain damping, and which force is recorded."""
    more = m.flow or m.springs or has_laws
    m.special = int(bool(m.smooth or m.stiff or m.groove or more))
    holds = is_held(s) and (s.hardware is not None or (not m.own and bool(more)))
    m.records_held_force = int(holds)
    m.records_clay_force = int(bool(m.modal or more or holds))


# ---- the accurate method -------------------------------------------------------------------------


def put_accurate(m: Any, arrays: dict[str, np.ndarray], s: Scenario) -> None:
    """The accurate method, and clay that yields in it."""
    pace.check_explicit(s)
    m.method, m.substeps = methods.ACCURATE, pace.parts_of_sample(s, 0)
    if s.clay and s.clay.grows:
        arrays["blocks"] = substeps_of_blocks(s)
    if s.clay and s.clay.yields:
        m.modal = 2 if s.clay.isotropic else 1
        m.yields_rotated = int(m.modal == 1 and m.rotated)
        m.lightness = float(pace.largest_lightness(s))


def substeps_of_blocks(s: Scenario) -> np.ndarray:
    """Engine steps a sample, by block; they grow, and after SUBSTEPS all are as many."""
    count = math.floor(s.t_max / s.dt + 1e-6) // GROWTH_BLOCK + 1
    blocks = np.empty(count, dtype=np.int64)
    for j in range(count):
        blocks[j] = pace.parts_of_sample(s, j * GROWTH_BLOCK)
        if blocks[j] > modes.SUBSTEPS:
            blocks[j:] = modes.SUBSTEPS + 1
            break
    return blocks


# ---- sampled control -----------------------------------------------------------------------------


def put_sampler(
    m: Any, arrays: dict[str, np.ndarray], s: Scenario, own: Controller | None
) -> LawCaller | None:
    """Sampled control and its hardware; returns the caller of the user's own controller."""
    m.method, m.ratio = methods.SAMPLED, round((s.Ts or s.dt) / s.dt)
    m.Ts, caller = m.ratio * float(s.dt), None
    if own is None and isinstance(s.controller, Controller):
        own = s.controller
    if own is not None:
        caller = LawCaller(own, m.joints, m.axes)
        m.own, m.buffer_size, arrays["buffer"] = 1, len(own.state), caller.numbers
    elif isinstance(s.controller, JointPD):
        from . import joint_scene  # imported only for a law of joints

        joint_scene.put_law(m, s.controller)
    else:
        put_memory(m, s)
    if s.hardware is not None:
        put_hardware(m, arrays, s, s.hardware)
    m.renders = int(m.clay and not m.acts and not m.own)
    m.hardware = int(m.renders or m.friction or s.hardware is not None)
    return caller


@functools.lru_cache(maxsize=256)
def formed_memory(servo: Servo, shape: compensator.Compensator, K: float, T: float) -> np.ndarray:
    """Rows of `sampled.form_row` of one axis, exact under a held force."""
    n, most = shape.order, form.ORDER
    A, B = controller.controller_matrices(servo, shape, K)
    m = np.zeros((n + 4, n + 4))
    m[: n + 2, : n + 2], m[: n + 2, n + 3] = A, B
    m[n + 1, n + 2] = servo.G.gain  # the start adds to delta
    e = controller.matrix_exponential(T * m)
    used = [*range(n), *range(most, most + 2)]
    out = np.zeros((most + 2, most + 4))
    out[np.ix_(used, [*used, most + 2, most + 3])] = e[: n + 2]
    return out


@functools.lru_cache(maxsize=256)
def held_memory(servo: Servo, shape: compensator.Compensator, K: float, T: float) -> np.ndarray:
    """Rows of `sampled.advance` of one axis."""
    return np.column_stack(controller.held_compensator(servo, shape, K, T))


def put_memory(m: Any, s: Scenario) -> None:
    """Compensator and reference over a control sample."""
    make = formed_memory if m.formed else held_memory
    for i, a in enumerate(m.axis[:2]):
        rows = make(s.servo[i], s.compensators[i], s.gain[i], m.Ts).ravel().tolist()
        a.memory[: len(rows)] = rows


def put_hardware(m: Any, arrays: dict[str, np.ndarray], s: Scenario, io: Any) -> None:
    """The hardware between computer and arm."""
    counts = io.count_sizes(turning(s))
    m.encoder, m.count[: m.joints] = int(any(counts)), counts
    if io.jitter > 0.0 or io.dropout_probability > 0.0 or io.force_noise > 0.0:
        n = min(int(s.t_max / m.Ts), NOISE_AHEAD) + 8
        m.chance, arrays["chances"] = 1, devices.SampleNoise(io).table(0, n).ravel()
    m.uneven = int(io.jitter > 0.0 or io.delay > 0.0)
    if io.velocity == "difference":
        m.window, m.cutoff = int(io.velocity_window), float(io.velocity_filter or 0.0)
        arrays["angles"] = np.zeros((m.joints + 1) * m.window)
    if io.force_filter is not None:
        m.filtered = 1
        m.filter[:] = devices.butterworth(io.force_filter, io.filter_order, m.Ts)
    m.adc_bits, m.adc_range = int(io.adc_bits or 0), float(io.adc_range)
    m.dac_bits = int(io.dac_bits or 0)
    m.dac_range[: m.joints] = map(float, io.dac_range or m.limit[: m.joints])
    put_delay(m, arrays, float(io.delay), io.passivity)
    if s.is_closed_form:
        m.friction, m.slip[:2] = int(any(io.friction)), map(float, io.friction)
    if io.coupling is not None:
        m.coupling = 1
        m.coupling_spring, m.coupling_damper = float(io.coupling.spring), float(io.coupling.damper)


def delay_in_samples(delay: float, Ts: float) -> tuple[int, float]:
    """A delay in whole samples, and the remaining share of a sample."""
    delay /= Ts
    whole = math.floor(delay + sampled.SLACK)
    return whole, max(delay - whole, 0.0)


def put_delay(m: Any, arrays: dict[str, np.ndarray], delay: float, guarded: bool) -> None:
    """The delay of the torques, and the passivity controller that accounts for it."""
    late, share = delay_in_samples(delay, m.Ts)
    m.delay = delay
    if delay > 0.0:
        m.queue_rows = late + QUEUE
        arrays["queue"] = np.zeros((hardware.QUEUED + m.joints) * m.queue_rows)
    if guarded:
        m.guard, m.guard_whole, m.guard_share = 1, late, float(share)
        arrays["forces"] = np.zeros(2 * (late + 2))


# ---- signals -------------------------------------------------------------------------------------


def put_signals(m: Any, arrays: dict[str, np.ndarray], s: Scenario) -> None:
    """Signals over no step yet, see signal_ahead.Drives."""
    for name, signal in (("muscle", s.muscle), ("command", s.command)):
        if signal is not None and signal.varies:
            setattr(m, name, 1)
            arrays[f"{name}_table"] = np.zeros(pieces.PIECE)
            arrays[f"{name}_ahead"] = np.zeros(2)
    if m.muscle and m.ratio:
        arrays["muscle_halves"] = np.zeros(6)
    if m.method == methods.ACCURATE and (m.muscle or m.command):
        m.ahead, m.breaks_count = 1, 1
        arrays |= {"times": np.zeros(1), "breaks": np.full(1, math.inf)}
