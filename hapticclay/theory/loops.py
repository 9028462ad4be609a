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
    """Lets an analysis of a `Loop` accept the parts of a loop, too.

    `f(loop, ...)`, `f(loop, K=2.0, ...)`; `f(scenario, "x", ...)`, with b= for another clay, which
    calls `Loop.of`; or `f("x", *order, servo=..., compensator=..., ...)`: the axis, what `order`
    names by position or by name, and every other part of a Loop by name.
    """

    def decorate(analysis: Callable[..., Answer]) -> Callable[..., Answer]:
        name = analysis.__name__
        own = [p for n, p in inspect.signature(analysis).parameters.items() if n != "loop"]
        free = tuple(n for n in order if n not in PARTS)
        guarded, signature = checked(analysis), _signature(order, own)
        known = {"loop", *PARTS, *signature.parameters}
        known = known if all(p.kind is not p.VAR_KEYWORD for p in own) else None

        @functools.wraps(analysis)
        def ask(*args: Any, **given: Any) -> Answer:
            if known:
                known_names(name, given, known)
            whole, *rest = _loop_first(name, args, given)
            _by_name(name, free if isinstance(whole, Loop) else order, rest, given)
            parts = {word: given.pop(word) for word in PARTS if word in given}
            if isinstance(whole, Loop):
                loop = _with_gain(whole, parts)
            else:
                missing = [n for n in order if n in PARTS and n not in ("operator", *parts)]
                if missing:
                    raise TypeError(f"{name}() lacks {', '.join(missing)}")
                loop = Loop(whole, **parts)
            if not timing:
                _refuse_timing(loop)
            return guarded(loop, **given)

        ask.__signature__ = signature  # type: ignore[attr-defined]
        return ask

    return decorate


def _loop_first(name: str, args: Sequence[Any], given: dict[str, Any]) -> Sequence[Any]:
    """Positional arguments of an analysis, after a Loop, the Loop of a Scenario, or an axis.

    The parts of the first argument are taken out of `given`, the arguments by name.
    """
    if args and isinstance(args[0], Scenario):
        scenario, *rest = args
        if not rest and "axis" not in given:
            raise TypeError(f"{name}() of a Scenario needs an axis")
        axis = rest.pop(0) if rest else given.pop("axis")
        args = (Loop.of(scenario, axis, given.pop("b", None)), *rest)
    for word in ("loop", "axis"):
        if word in given:
            args = (given.pop(word), *args)
    if not args:
        raise TypeError(f"{name}() needs a Loop, or a Scenario or parts and an axis")
    return args


def _by_name(name: str, names: Sequence[str], rest: Sequence[Any], given: dict[str, Any]) -> None:
    """Moves positional arguments to the arguments by name."""
    if len(rest) > len(names):
        raise TypeError(f"{name}() takes {1 + len(names)} positional arguments at most")
    for word, value in zip(names, rest, strict=False):
        if word in given:
            raise TypeError(f"{name}() got multiple values for argument {word!r}")
        given[word] = value


def _refuse_timing(loop: Loop) -> None:
    """Refuses a sampled or delayed loop."""
    for word, value in TIMING.items():
        if getattr(loop, word) != value:
            raise ParameterError(word, getattr(loop, word), NO_TIMING.format(value))


def _with_gain(loop: Loop, parts: dict[str, Any]) -> Loop:
    """The loop, with K if given."""
    for word, value in parts.items():
        if word != "K":
            raise ParameterError(word, value, "must not be given beside a Loop, which has its own")
    return replace(loop, **parts) if parts else loop


def _signature(order: Sequence[str], own: Sequence[inspect.Parameter]) -> inspect.Signature:
    """Signature of an analysis: an axis or a Loop, the positional arguments, and the rest."""
    P, more = inspect.Parameter, {p.name: p for p in own}
    blank = {"operator": None}
    out = [P("axis", P.POSITIONAL_OR_KEYWORD, annotation="str | Loop | Scenario")]
    out += [P(n, P.POSITIONAL_OR_KEYWORD, default=blank.get(n, P.empty)) for n in order]
    out += [
        P(f.name, P.KEYWORD_ONLY, default=f.default)
        for f in fields(Loop)
        if f.name != "axis" and f.name not in order
    ]
    rest = [p for n, p in more.items() if n not in order]
    out += [p.replace(kind=P.KEYWORD_ONLY) for p in rest if p.kind is not P.VAR_KEYWORD]
    return inspect.Signature(out + [p for p in rest if p.kind is P.VAR_KEYWORD])


@of_loop("K", "b", "operator")
def closed_loop_poles(loop: Loop) -> np.ndarray:
    """Poles of the loop at the nominal pose [rad/s], shape (4 + order of C,).

    With an integrator in C and no spring in Th one pole lies at s = 0: free motion of the handle.

    Args:
        loop: the loop with its K; or axis, K, b, operator, and other parts by name.
    """
    return roots.roots(characteristic(loop))
