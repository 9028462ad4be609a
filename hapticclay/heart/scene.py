"""A scene compiled of the parts that it has, and the state at its start."""

from __future__ import annotations

import math

import numpy as np

from ..model import compensator, groove, regions
from ..model.constants import B_MAX
from ..model.scenario import Scenario
from ..stepping.run import spring_step
from . import begin, laws, parts as p_, state as s_
from .parts import INF

NONE = (0.0, 0.0)


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
    flow = p_.Flow(1 if clay.isotropic or clay.groove else None) if clay.yields else None
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
    b = stiffness(s)
    stiff = p_.Stiff(float(s.mobility)) if b > 1.0 else None
    hits = p_.Hits(0.02 / s.arm.links[4]) if b > 0.02 else None
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


def parts_of(s: Scenario):
    lag, form = compensators(s)
    return p_.Parts(
        p_.Time(float(s.dt), float(s.t_max), math.floor(s.t_max / s.dt + 1e-6)),
        p_.Arm(tuple(map(float, s.arm.links)), *map(float, s.origin)),
        tuple(p_.Servo(*map(float, each.numbers)) for each in s.servo), 1 if s.shaping else None, lag, form,
        hand_parts(s), p_.Push((0.0, *steady_force(s), 0.0, 0.0), None), None,
        tuple(map(float, s.torque_limit)), regions.region_table(s.clay, s.length), *clay_part(s), None, None,
    )  # fmt: skip


def first_reaction(special):
    """What clay left to the first kick."""
    if special is None:
        return None
    felt = s_.Felt(NONE, NONE, NONE, NONE, (math.nan, math.nan), 0.0, NONE)
    split = s_.Split(0.0, NONE, NONE) if special.stiff else None
    return s_.Reaction(NONE, split, felt if special.flow else None)


def first_laws(special, p):
    """State of the laws before the handle has been anywhere."""
    if special is None:
        return None
    law, none = (0.0, 0.0, 1.0, 0.0, 0.0, 1.0), (0.0,) * 6
    return s_.Laws(
        s_.Flow(law, law) if special.flow else None,
        s_.Elastic((none, none), NONE, NONE, p, NONE, NONE, 0.0, 0.0, INF) if special.springs else None,
        s_.Cut((math.nan, math.nan), NONE, NONE, 0.0) if special.groove else None,
        laws.start(special.more, p),
    )  # fmt: skip


def first_form(parts, s):
    """States of compensators of another shape, of a handle that has long moved evenly."""
    if parts.form is None:
        return None
    both = zip(s.compensators, parts.servo, s.velocity, strict=True)
    return tuple(tuple(compensator.moving_states(c, v / x.ratio)) for c, x, v in both)


def blocks(parts, s: Scenario):
    """A state with the blocks of all parts, before the handle has been anywhere."""
    axis = s_.Axis(0.0, 0.0, 0.0, 0.0)
    growth = s_.Growth(NONE, NONE) if parts.clay and parts.clay.growth else None
    hit = s_.Hit(INF, 0.0) if parts.hits else None
    clay = s_.Clay(
        s_.Region((0, 0), NONE, NONE), NONE, NONE, growth, hit,
        first_reaction(parts.special), first_laws(parts.special, NONE),
    )
    return s_.State(
        s_.Clock(0.0, 0, 0.0), s_.Body(NONE, NONE, NONE), s_.Loop(axis, axis, first_form(parts, s)),
        clay, s_.Work(0.0, 0.0, 0.0, 0.0, 0.0), s_.Status(0, 0, 0, 0, (0, 0, 0, 0)),
        s_.Filled(0, 0, 0, 0),
    )  # fmt: skip


def start(parts, s: Scenario, e):
    """The state at the start of a run."""
    p, v = tuple(map(float, s.start)), tuple(map(float, s.velocity))
    return begin.begun(parts, blocks(parts, s), e, p, v)


def written(parts):
    """Arrays of a scene that steps write into."""
    out = [parts.table]
    if parts.special is not None and parts.special.groove is not None:
        g = parts.special.groove
        out += [g.ground, g.rim, g.removed]
    return out


def beyond(parts):
    """Why no step can go on from an arm beyond floating point."""
    return "the arm is stretched or folded"


def viewed(part):
    """Parts with memoryviews in place of arrays: CPython reads plain floats from them, and sooner.

    Args:
        part: the parts of a scene.
    """
    if isinstance(part, np.ndarray):
        return memoryview(part)
    if isinstance(part, tuple):
        made = map(viewed, part)
        return type(part)._make(made) if hasattr(part, "_make") else tuple(made)
    return part
