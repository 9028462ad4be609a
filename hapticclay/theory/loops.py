"""A loop as the argument of an analysis: its parts, a scenario, or keywords.

The decorator `of_loop` gives every analysis of `theory` these three forms.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

import numpy as np

from ..arguments import checked, known_names, named
from ..errors import ParameterError, choice
from ..model.clay import Clay
from ..model.constants import AXES
from ..scene.scenario import Scenario
from . import roots
from .gain_crossings import critical_gain
from .linear_loop import LinearLoop, characteristic

Answer = TypeVar("Answer")
NO_TIMING = "must be {} here: the analysis is one of continuous time without delay"
MOST_DAMPINGS = 64  # dampings of a scenario's clay among which the worst is searched
TIMING = {"Ts": None, "delay": 0.0}  # of such a loop


@named
@dataclass(frozen=True)
class Loop(LinearLoop):
    """The linear loop of one axis at the nominal pose: the parts of a run for the analysis.

    The analysis applies to the machine at the nominal pose, where the axes are decoupled, for small
    motions and with the motors within their torque limits. At other poses it applies with inertia
    shaping in continuous time.

    It has the parts of `LinearLoop`.
    """

    @classmethod
    @checked
    def of(cls, scenario: Scenario, axis: str, b: float | None = None) -> Loop:
        """The loop of one axis of a scenario, at the nominal pose of its arm.

        The loop has no muscle force, pose or friction, and of the hardware only the delay. For
        yielding or elastic clay it has b alone, without Fy, K and springs. In clay of b = 0 a gain
        limit may therefore be inf for any Fy. For yielding clay see `push_outcomes` and
        `limit_cycles`.

        Args:
            scenario: the run.
            axis: "x" or "y".
            b: clay [N.s/m]; None for the damping of the scenario's clay, before growth, with the
                least gain limit, 0 without clay. At most MOST_DAMPINGS values are tested; clay with
                rotated axes contributes the values of both of its axes.

        Raises:
            ParameterError: no scenario, a scenario with a user's controller, unknown axis, or b out
                of its bounds.
        """
        if not isinstance(scenario, Scenario):
            raise ParameterError("scenario", scenario, "must be a Scenario")
        if not scenario.is_closed_form:
            bound = "must be the one in closed form: hapticclay arm judges arms from files"
            raise ParameterError("arm", scenario.arm, bound)
        if scenario.controller is not None:
            bound = "must be None: see hc.theory.controller_stability for a controller of your own"
            raise ParameterError("controller", scenario.controller, bound)
        i, clay = AXES.index(choice("axis", axis, AXES)), scenario.clay
        servo, bare = scenario.servo[i], scenario.arm.nominal_mobility[i]
        shaped = scenario.inertia_shaping and bare != servo.S.gain
        sampled = scenario.control == "sampled"
        loop = Loop(
            axis=AXES[i],
            operator=scenario.operators[i],
            servo=servo
            if scenario.inertia_shaping
            else replace(servo, S=replace(servo.S, gain=bare)),
            compensator=scenario.compensators[i],
            K=scenario.gain[i],
            Ts=(scenario.Ts or scenario.dt) if sampled else None,
            delay=scenario.hardware.delay if scenario.hardware else 0.0,
            render=scenario.render if sampled else "held",
            mobility=bare if shaped else None,
        )
        if b is not None:
            return replace(loop, b=b)

        def limit(x: Loop) -> float:
            return critical_gain(x)[0]

        dampings = dampings_of(clay, (i,))
        return min((replace(loop, b=x) for x in dampings), key=limit, default=loop)


def dampings_of(clay: Clay | None, axes: Sequence[int]) -> list[float]:
    """The dampings of clay on some axes [N.s/m], at most MOST_DAMPINGS."""
    laws = [] if clay is None else [law for i in axes for law in clay.laws_on(i)]
    found = np.unique(np.concatenate([law.damping.ravel() for law in laws] or [[]]))
    if len(found) > MOST_DAMPINGS:
        found = found[np.linspace(0, len(found) - 1, MOST_DAMPINGS).astype(int)]
    return found.tolist()


PARTS = tuple(f.name for f in fields(Loop))


def of_loop(
    *order: str, timing: bool = False
) -> Callable[[Callable[..., Answer]], Callable[..., Answer]]:
    """Lets an analysis of a `Loop` accept a scenario or the parts of a loop, too.

    `f(loop, ...)` and `f(loop, K=2.0, ...)`; `f(scenario, "x", ...)`, with b= for another clay; or
    `f("x", *order, servo=..., compensator=..., ...)`: the axis, what `order` names by position or
    by name, and every other part of a Loop by name. Without `timing` a sampled or delayed loop is
    refused.
    """

    def decorate(analysis: Callable[..., Answer]) -> Callable[..., Answer]:
        name, guarded = analysis.__name__, checked(analysis)
        own = [p for n, p in inspect.signature(analysis).parameters.items() if n != "loop"]
        free = [n for n in order if n not in PARTS]
        form = _form(["axis", *order], own)
        forms = {Loop: _form(["axis", *free], own), Scenario: _form(["loop", "axis", *free], own)}
        closed = all(p.kind is not p.VAR_KEYWORD for p in own)

        @functools.wraps(analysis)
        def ask(*args: Any, **given: Any) -> Answer:
            if "loop" in given:
                args = (given.pop("loop"), *args)
            if closed:
                known_names(name, given, {"loop", *form.parameters})
            first = args[0] if args else given.get("axis")
            try:
                whole = (each for kind, each in forms.items() if isinstance(first, kind))
                bound = next(whole, form).bind(*args, **given)
            except TypeError as error:
                raise TypeError(f"{name}(): {error}") from None
            rest = bound.kwargs | dict(zip(bound.signature.parameters, bound.args, strict=False))
            loop = _loop({n: rest.pop(n) for n in ("loop", *PARTS) if n in rest})
            if not timing:
                _refuse_timing(loop)
            return guarded(loop, **rest)

        ask.__signature__ = form  # type: ignore[attr-defined]
        return ask

    return decorate


def _form(order: Sequence[str], own: Sequence[inspect.Parameter]) -> inspect.Signature:
    """A call by position in a given order, or by name, with every part of a Loop by name."""
    P, defaults = inspect.Parameter, {f.name: f.default for f in fields(Loop)}
    kinds = {"axis": "str | Loop | Scenario"}
    out = [
        P(n, P.POSITIONAL_OR_KEYWORD, annotation=kinds.get(n, P.empty),
          default=None if n == "operator" else P.empty)
        for n in order
    ]  # fmt: skip
    out += [P(n, P.KEYWORD_ONLY, default=defaults[n]) for n in PARTS if n not in order]
    rest = [p for p in own if p.name not in order]
    out += [p.replace(kind=P.KEYWORD_ONLY) for p in rest if p.kind is not P.VAR_KEYWORD]
    return inspect.Signature(out + [p for p in rest if p.kind is P.VAR_KEYWORD])


def _loop(parts: dict[str, Any]) -> Loop:
    """The loop of a scenario's axis, a loop with another gain, or that of some parts."""
    if "loop" in parts:
        axis, b = parts.pop("axis"), parts.pop("b", None)
        parts["axis"] = Loop.of(parts.pop("loop"), axis, b)
    if not isinstance(parts["axis"], Loop):
        return Loop(**parts)
    loop = parts.pop("axis")
    for word, value in parts.items():
        if word != "K":
            raise ParameterError(word, value, "must not be given beside a Loop, which has its own")
    return replace(loop, **parts) if parts else loop


def _refuse_timing(loop: Loop) -> None:
    """Refuses a sampled or delayed loop."""
    for word, value in TIMING.items():
        if getattr(loop, word) != value:
            raise ParameterError(word, getattr(loop, word), NO_TIMING.format(value))


@of_loop("K", "b", "operator")
def closed_loop_poles(loop: Loop) -> np.ndarray:
    """Poles of the loop at the nominal pose [rad/s], shape (4 + order of C,).

    With an integrator in C and no spring in Th one pole lies at s = 0: free motion of the handle.

    Args:
        loop: the loop with its K; or axis, K, b, operator, and other parts by name.
    """
    return roots.roots(characteristic(loop))
