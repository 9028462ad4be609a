"""The largest stable gain and stiffness of a loop, and of a scenario."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.polynomial import Polynomial

from ..model.constants import AXES
from ..model.spring import STIFFNESS_MAX
from ..scene.scenario import Scenario
from . import linear_loop, roots
from .gain_crossings import critical_gain, is_stable
from .loops import TIMING, Loop, of_loop


@of_loop("b", "operator", timing=True)
def gain_limit(loop: Loop) -> float:
    """Largest compensator gain K up to which the loop of one axis is stable at the nominal pose.

    Every gain between 0 and the limit is stable. In continuous time without delay the limit is the
    first crossing of the closed-loop polynomial (Eq. 8), in exact arithmetic; a pole or zero of the
    open loop on the imaginary axis within rounding is no crossing. Otherwise see `sampled_loop`
    (sampled) and `delayed_loop` (continuous, with delayed motors).

    Args:
        loop: the loop, its K ignored; or axis, b, operator, and other parts by name.

    Returns:
        K; inf if there is no limit, 0 if the loop is unstable at any small gain.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    return critical_gain(loop)[0]


@of_loop("K", "b", "operator", timing=True)
def stiffness_limit(loop: Loop) -> float:
    """Largest stiffness k of the clay up to which the loop of one axis is stable [N/m].

    In continuous time without delay the limit is exact: the first crossing of the closed-loop
    polynomial, which is linear in k. Otherwise k rises from 1e-3 N/m in 20 values per decade until
    the loop is unstable, and bisection refines the limit. A narrower window of k may be missed.

    Args:
        loop: the loop with its K > 0, its k ignored; or axis, K, b, operator, and other parts by
            name.

    Returns:
        k; inf if there is no limit up to 1e9 N/m, 0 if the loop is unstable at any small k.
    """
    soft = replace(loop, k=0.0)
    if loop.Ts is None and not loop.delay:
        per_place = linear_loop.device_admittance(soft)[0]
        return roots.first_crossing(linear_loop.characteristic(soft), per_place)[0]
    grid = np.geomspace(1e-3, STIFFNESS_MAX, 241).tolist()
    low, high = roots.first_failure(lambda k: is_stable(replace(loop, k=k)), grid, rtol=1e-10)
    return high if low else 0.0


def continuous_limit(scenario: Scenario, axis: str, b: float) -> float:
    """Gain limit of the loop of a scenario for continuous control without delay."""
    if scenario.controller is not None:
        return math.inf
    return gain_limit(replace(Loop.of(scenario, axis, b), **TIMING))


def spring_crossover(scenario: Scenario, i: int, k: float) -> float:
    """Highest frequency at which a spring has a loop gain of 1; above it the spring moves no pole.

    It solves k |P| = 1 with P = (G C + Sh)/(1 + m s^2 (G C + Sh)), the handle with the mass of the
    hand. Without shaping the gain of Sh is trace W, an upper bound over poses and directions.
    """
    loop = Loop.of(scenario, AXES[i], 0.0)
    if not scenario.inertia_shaping:
        S = replace(loop.servo.S, gain=scenario.arm.links[4])
        loop = replace(loop, servo=replace(loop.servo, S=S))
    num, den = linear_loop.device_admittance(loop)
    num, den = num * k, den + num * Polynomial([0.0, 0.0, loop.hand.mass])
    found = roots.positive_roots(roots.squared_magnitude(num) - roots.squared_magnitude(den))
    return math.sqrt(max(found, default=0.0))
