"""How finely a scene must be stepped, from its fastest rates."""

from __future__ import annotations

import math

import numpy as np

from ..errors import ParameterError
from ..formulas.constants import B_MAX
from ..model.operator import NO_HAND
from ..model.spring import RESOLVED
from ..scene.scenario import Scenario
from ..theory import gain_limits
from .march import GROWTH_BLOCK
from .modes import STABLE_STEP, SUBSTEPS, creep_speed

REFERENCE_SPEED = 0.1  # [m/s] of a usual cut: at which the consistency counts as a damper
CREEP_MOST = 1e-5  # [m/s] a slower creep may count as rest
SPRING_STEPS = 10_000  # parts of a step that springs may need; at most a second or two each


def spring_step(scenario: Scenario) -> float:
    """Longest step that resolves the springs of the clay, inf without any [s].

    A kick uses the force of a spring at the place before it, so a step must resolve the fastest
    motion that the spring can drive. In continuous control this is a motion of the whole loop: the
    compensator may have direct feedthrough, and the servo may impose a lighter handle.
    """
    laws = scenario.clay.laws if scenario.clay and scenario.clay.springs else ()
    most = [float((law.elastic[..., 0] + law.elastic[..., 2]).max()) for law in laws]
    if not any(most):
        return math.inf
    if scenario.control == "sampled":
        omega = math.sqrt(max(most) * scenario.mobility)
    else:
        omega = max(gain_limits.spring_crossover(scenario, i, k) for i, k in enumerate(most))
    longest = RESOLVED / omega if omega else math.inf
    if longest * SPRING_STEPS < scenario.dt:
        bound = (
            f"must be at most {longest * SPRING_STEPS:.3g} s: in clay of {max(most):g} N/m this "
            f"loop moves at up to {omega:.3g} rad/s, and needs steps of {longest:.2g} s"
        )
        raise ParameterError("dt", scenario.dt, bound)
    return longest


def fastest_rate(scenario: Scenario, grown: float = 0.0) -> float:
    """Fastest rate of a scene, by which the explicit method divides its steps [1/s].

    It is that of clay and hand against the handle; or of a servo or a pole of a compensator that
    the longest step does not hold.
    """
    hands = [th or NO_HAND for th in scenario.operators]
    damper, spring = max(th.damper for th in hands), max(th.spring for th in hands)
    b, W = steepest_clay(scenario, grown), largest_lightness(scenario)
    return max((b + damper) * W + math.sqrt(spring * W), 0.5 * own_rate(scenario))


def steepest_clay(scenario: Scenario, grown: float) -> float:
    """Largest damping of the clay, with that of its consistency at REFERENCE_SPEED [N.s/m]."""
    most, clay = 0.0, scenario.clay
    for law in clay.laws if clay else ():
        b = np.minimum(law.damping + grown * law.rates, B_MAX)
        if clay and clay.yields:
            _, K, n = law.flows
            b = b + n * K * REFERENCE_SPEED ** (n - 1.0)
        most = max(most, float(b.max()))
    return most


def largest_lightness(scenario: Scenario) -> float:
    """Largest acceleration of the handle per unit of force [1/kg]."""
    W, through = scenario.arm.links[4], 0.0
    for servo, shape, K in zip(scenario.servo, scenario.compensators, scenario.gain, strict=True):
        if scenario.inertia_shaping:
            W = max(W, servo.S.gain)
        if len(shape.num) == len(shape.den):  # C has direct feedthrough
            through = max(through, K * servo.G.gain * abs(shape.num[0]))
    return W + through


def creep_limit(scenario: Scenario) -> float:
    """Speed below which clay of n < 1 counts as at rest: it would need too many steps [m/s]."""
    W, most = largest_lightness(scenario), 0.0
    for law in scenario.clay.laws if scenario.clay else ():
        _, K, n = (x.ravel().tolist() for x in law.flows)
        most = max(creep_speed(W, scenario.dt, *x) for x in zip(K, n, strict=True))
    return most


def own_rate(scenario: Scenario) -> float:
    """Fastest rate of compensator and servo [1/s]."""
    blocks = [(1.0, x.damping, x.stiffness) for servo in scenario.servo for x in (servo.G, servo.S)]
    poles = [np.roots(x) for x in (*blocks, *(c.den for c in scenario.compensators))]
    return float(np.abs(np.concatenate(poles)).max())


def parts_of_sample(scenario: Scenario, i: int) -> int:
    """Engine steps per sample, the same for all samples of a block."""
    grown = 0.0
    if scenario.clay and scenario.clay.grows:  # at the end of the block: no clay has grown longer
        grown = min((i // GROWTH_BLOCK + 1) * GROWTH_BLOCK * scenario.dt, scenario.t_max)
    return max(1, math.ceil(scenario.dt * fastest_rate(scenario, grown) / STABLE_STEP))


def check_explicit(scenario: Scenario) -> None:
    """Refuses a scene that is too stiff for explicit steps at its start."""
    parts, bound = parts_of_sample(scenario, 0), ""
    if parts > SUBSTEPS:
        bound = f"would take {parts:.4g} steps a sample in so stiff a scene"
    elif scenario.clay and scenario.clay.yields and (creep := creep_limit(scenario)) > CREEP_MOST:
        bound = f"would treat creep below {creep:.2g} m/s in this clay as rest"
    if bound:
        bound = f"explicit: {bound}; choose 'fast'"
        raise ParameterError("integrator", scenario.integrator, bound)
