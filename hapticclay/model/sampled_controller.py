"""A user-defined sampled controller: a function from measurements to torques."""

from __future__ import annotations

import math
import pkgutil
import re
from collections.abc import Callable
from typing import Annotated, Any, cast

import numpy as np

from ..arguments import part
from ..display import one_line
from ..errors import Bound, ParameterError
from ..fields import function_name
from .traits import NO, Refusal, Trait

# floats that loop and law share: time [s], joint angles [rad] and rates [rad/s] as
# measured, hand force [N], torques [N.m]; then the law's state now and after, and its parameters;
# of the arm in closed form:
BUFFER = 9
NAME = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*(:[^\W\d]\w*(\.[^\W\d]\w*)*)?")

Law = Callable[
    [float, tuple[float, ...], tuple[float, ...], tuple[float, ...], Any, Any], tuple[Any, Any]
]


@part("controller.", eq=False)
class Controller:
    """A controller that replaces compensator and servo in a sampled loop.

    The function is called once a control sample as law(t, q, qd, fh, state, params) and returns
    (torques, state): t [s]; q [rad] and qd [rad/s], measured at shoulder and elbow, or at each
    joint of an arm from a file; fh [N], measured force of the hand along the axes of the handle;
    state and params, tuples of floats. The torques of the joints [N.m] are held for a sample,
    within the torque limits and after converter and delay of the hardware. The next call receives
    the state. The law must render the clay itself, unless the scenario's `render` is "physical".

    Python runs it, in compiled runs too. Values that change from call to call belong in the state,
    or a run cannot return to an earlier sample.

    Attributes:
        law: the function, or its name "package.module:name", imported when a run starts.
        state: state at the first sample.
        params: parameters of the function.
    """

    law: Any
    state: Annotated[tuple[float, ...], Bound()] = ()
    params: Annotated[tuple[float, ...], Bound()] = ()

    def __post_init__(self):
        if isinstance(self.law, str):
            if not NAME.fullmatch(self.law):
                raise self._refusal("must name a function as package.module:name")
        elif not callable(self.law):
            raise self._refusal("must be a function")

    def __eq__(self, other: object) -> bool:
        return self._key == other._key if isinstance(other, Controller) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._key)

    @property
    def _key(self) -> tuple[Any, ...]:
        """A function compares equal to its name, because files store the name."""
        name = self.law if isinstance(self.law, str) else function_name(self.law)
        return name or self.law, self.state, self.params

    @property
    def words(self) -> str:
        """The function by name."""
        return str(getattr(self.law, "__name__", self.law))

    def function(self) -> Law:
        """The function; a name is imported now, which executes its module.

        Raises:
            ParameterError: there is no such function.
        """
        law = self.law
        if isinstance(law, str):
            try:
                law = pkgutil.resolve_name(law)
            except (Exception, SystemExit) as error:  # any exception: it is the user's module
                why = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
                bound = f"must name a function as package.module:name ({one_line(why, 200)})"
                raise self._refusal(bound) from None
        if not callable(law):
            raise self._refusal("must be a function")
        return cast(Law, law)

    def _refusal(self, bound: str) -> ParameterError:
        return ParameterError("controller.law", self.law, bound)


class LawFailed(RuntimeError):
    """The function of a `Controller` raised an exception (the cause) or returned a wrong value."""


class LawCaller:
    """Calls a law between the write of measurements and the read of torques in shared floats.

    After a failed call, `error` holds the exception, and the torques are not finite.

    Attributes:
        numbers: these floats, for an arm of so many joints, and axes of its handle.
        start: where the law's state begins in them.
    """

    def __init__(self, controller: Controller, joints: int = 2, axes: int = 2):
        self.controller, self.law = controller, controller.function()
        self._joints, self._torque = joints, 1 + 2 * joints + axes
        self.start = self._torque + joints
        state = controller.state
        self.numbers = np.array([0.0] * self.start + [*state, *state, *controller.params])
        self.buffer: Any = memoryview(self.numbers)  # type: ignore[arg-type]
        self.error: BaseException | None = None
        self._returned: tuple[float, ...] = (0.0,) * joints
        self._ends = self.start + len(state), self.start + 2 * len(state)

    def __call__(self, _buffer: object = None) -> None:
        try:  # compiled code drops exceptions raised here: the run ends, and `check` raises them
            if self.error is None:
                self._answer()
        except BaseException as error:
            self.error = error
            self._put_torques((math.nan,) * self._joints)

    def _answer(self) -> None:
        n, (middle, _) = self._joints, self._ends
        t, *measured = self.buffer[: self._torque].tolist()
        q, qd, fh = measured[:n], measured[n : 2 * n], measured[2 * n :]
        state = tuple(self.buffer[self.start : middle].tolist())
        params = self.controller.params
        answer: Any = self.law(t, tuple(q), tuple(qd), tuple(fh), state, params)
        try:
            torques, after = answer
            torques, after = tuple(map(float, torques)), tuple(map(float, after))
            if len(torques) != n:
                raise ValueError
        except (TypeError, ValueError):
            what = "(shoulder, elbow)" if n == 2 else f"{n} torques"
            form = f"must return ({what}, state), torques [N.m] and a tuple of floats"
            raise TypeError(f"{form}, not {one_line(repr(answer))}") from None
        if len(after) != len(state):
            raise TypeError(f"state must have {len(state)} numbers, not {len(after)}")
        for j, x in enumerate(after):
            self.buffer[middle + j] = x
        self._returned = torques
        self._put_torques(torques)

    def _put_torques(self, torques: tuple[float, ...]) -> None:
        for j, x in enumerate(torques):
            self.buffer[self._torque + j] = x

    def _torques(self) -> list[float]:
        return self.buffer[self._torque : self.start].tolist()

    def finite(self) -> bool:
        """Whether the torques are finite."""
        return all(map(math.isfinite, self._torques()))

    def check(self) -> None:
        """Raises LawFailed if a call has failed, or Ctrl-C and its like unchanged.

        Torques that are not finite end a run; at the first sample they raise LawFailed.
        """
        if self.error is None and not self.finite():
            if all(map(math.isfinite, self._returned)):
                self.error = KeyboardInterrupt()  # raised before the call could store it
            torques = tuple(self._torques())
            if self.error is None and self.buffer[0] <= 0.0:
                self.error = ValueError(f"torques must be finite, not {torques}")
        if isinstance(self.error, Exception):
            what = f"{type(self.error).__name__}: {self.error}"
            raise LawFailed(f"controller.law at t = {self.buffer[0]:g} s: {what}") from self.error
        if self.error is not None:
            raise self.error


_REPLACES = {
    "fast": Refusal("control", "must be 'sampled' with your own controller or a law of the joints"),
    "inertia shaping": Refusal(
        "inertia_shaping", "must be False with a controller, which replaces the servo"
    ),
    "passivity controller": Refusal(
        "hardware", "must be without passivity controller and coupling with your own controller"
    ),
}
_REPLACES["accurate"] = _REPLACES["fast"]
_REPLACES["virtual coupling"] = _REPLACES["passivity controller"]
TRAITS = (
    Trait(
        "own controller", "part", lambda s: isinstance(s.controller, Controller), NO, _REPLACES
    ),
    Trait(
        "joint law", "part",
        lambda s: s.controller is not None and not isinstance(s.controller, Controller), NO,
        _REPLACES | {
            "velocity by difference": Refusal(
                "hardware.velocity", "must be 'exact' with a law of the joints, which has its own"
            ),
        },
    ),
)  # fmt: skip
