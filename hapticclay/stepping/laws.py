"""Laws of the clay that are modules of their own, each a line in TABLE.

A law resists in addition to viscous damping. Its module has a named tuple `Part`, and these:
    part(scenario)                    the numbers of the law, a Part; None where the scene lacks it
    start(part, p)                    its state with the handle at p, a named tuple or None
    load(part, state, load, step, at) the load on the handle in a kick with that of the law
    moved(part, state, at, h)         its state after a step of length h that led to `at`
    force(part, state, p, v)          its force at an instant, (x, y) [N]
    refuses(scenario)                 what it cannot be combined with, in words; "" for nothing
All but the first, second and last are stepped: plain numbers and tuples, as everywhere here.

The fast method and the physical clay of sampled control take `load` in their kicks, the accurate
method and motors that render the clay `force`. The fast method stays of second order where `load`
is, at the sample: `at.v` is from before the kick, so behind it a force that is not linear in the
velocity u is its tangent at v, as c |u| u = c (2 |v| u - |v| v). The accurate one moves the state
from the start of a step to each of its stages: it stays of fourth order where `moved` is exact for
a path with the handle `at` its end, as of a state that follows from the place or the time, and is
else of the order of `moved`. It does not divide its steps by the stiffness of a law.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

from ..errors import ParameterError
from ..scene.scenario import Scenario

TABLE: list[ModuleType] = []


def module_of(part: Any) -> ModuleType:
    """The module of a law.

    Args:
        part: its numbers.
    """
    return sys.modules[type(part).__module__]


def parts_of(scenario: Scenario) -> Any:
    """The laws that a scene has: pairs of the first and the others; None for none.

    Args:
        scenario: the scene.

    Raises:
        ParameterError: one of them cannot be combined with something in the scene.
    """
    laws = None
    for module in reversed(TABLE):
        part = module.part(scenario)
        if part is None:
            continue
        told = module.refuses(scenario)
        if scenario.hardware is not None and scenario.hardware.coupling is not None:
            told = told or "must be without a coupling, which renders viscous clay and its yielding"
        if told:
            raise ParameterError("clay", scenario.clay, told)
        laws = part, laws
    return laws


def start(laws: Any, p: Any) -> Any:
    """Their states at the start, in pairs as they are.

    Args:
        laws: from `parts_of`.
        p: place of the handle, (x, y) [m].
    """
    if laws is None:
        return None
    part, rest = laws
    return module_of(part).start(part, p), start(rest, p)


# ---- of one law: compiled, the module is known by the type of its part ---------------------------


def load_of(part, state, load, step, at):
    """The load with that of a law."""
    return module_of(part).load(part, state, load, step, at)


def moved_of(part, state, at, h):
    """The state of a law after a step."""
    return module_of(part).moved(part, state, at, h)


def force_of(part, state, p, v):
    """Force of a law at an instant, (x, y) [N]."""
    return module_of(part).force(part, state, p, v)


# ---- of all --------------------------------------------------------------------------------------


def with_loads(laws, states, load, step, at):
    """The load with those of the laws."""
    if laws is None:
        return load
    (part, rest), (state, others) = laws, states
    return with_loads(rest, others, load_of(part, state, load, step, at), step, at)


def moved(laws, states, at, h):
    """The states after a step of length h that led to `at`."""
    if laws is None:
        return states
    (part, rest), (state, others) = laws, states
    return moved_of(part, state, at, h), moved(rest, others, at, h)


def force(laws, states, p, v):
    """Force of the laws at an instant, (x, y) [N]."""
    if laws is None:
        return 0.0, 0.0
    (part, rest), (state, others) = laws, states
    (x, y), (a, b) = force_of(part, state, p, v), force(rest, others, p, v)
    return x + a, y + b
