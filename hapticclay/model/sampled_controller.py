"""A sampled controller of the user's own: a function from what is measured to the torques."""

from __future__ import annotations

import math
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

from ..errors import Bound, ParameterError, check_fields

# floats of the desk that loop and law share: time [s], joint angles [rad] and rates [rad/s] as
# measured, hand force [N], torques [N.m]; then the law's state now and after, and its parameters
DESK = 9
TORQUE = 7  # place of the torques

Law = Callable[
    [float, tuple[float, ...], tuple[float, ...], tuple[float, ...], Any, Any], tuple[Any, Any]
]


@dataclass(frozen=True)
class Controller:
    """A controller that takes the place of compensator and servo in a sampled loop.

    The function is called once a control sample as law(t, q, qd, fh, state, params) and returns
    (torques, state): t [s]; q [rad] and qd [rad/s] of shoulder and elbow as they are measured; fh
    [N] (x, y), force of the hand on the handle as it is measured; state and params tuples of
    floats. The torques (shoulder, elbow) [N.m] are held for a sample, within the torque limits and
    behind converter and delay of the interface. The state is handed to the next call. Rendering
    the clay is up to the law, unless the scenario's `render` is "implicit", where it is physical.

    Runs compile the function with numba where they are compiled themselves and it can be; Python
    runs it otherwise, to the same numbers, and a line says so. Variables outside of the function
    are constants to machine code: what changes from call to call belongs in the state.

    Attributes:
        law: the function, or "package.module:name" of it.
        state: at the first sample.
        params: what else the function needs.
    """

    law: Any
    state: Annotated[tuple[float, ...], Bound()] = ()
    params: Annotated[tuple[float, ...], Bound()] = ()

    def __post_init__(self):
        if isinstance(self.law, str):
            try:
                object.__setattr__(self, "law", pkgutil.resolve_name(self.law))
            except (ImportError, AttributeError, ValueError) as error:
                bound = f"must name a function as package.module:name ({error})"
                raise ParameterError("controller.law", self.law, bound) from None
        if not callable(self.law):
            raise ParameterError("controller.law", self.law, "must be a function")
        check_fields(self, "controller.")


class LawFailed(RuntimeError):
    """The function of a `Controller` raised an exception, its cause, or returned something else."""


class LawCaller:
    """Calls a law between the loop's reading of the desk and its taking the torques.

    Args:
        controller: whose law.
        desk: the shared floats, shape (n,).

    Attributes:
        error: exception of a call that failed, after which the torques are not finite.
    """

    def __init__(self, controller: Controller, desk: Any):
        self.controller = controller
        self.desk: Any = memoryview(desk)
        self.error: Exception | None = None
        self._ends = DESK + len(controller.state), DESK + 2 * len(controller.state)

    def __call__(self, _desk: object = None) -> None:
        if self.error is not None:
            return
        t, q1, q2, w1, w2, fx, fy = self.desk[:TORQUE].tolist()
        middle, end = self._ends
        state = tuple(self.desk[DESK:middle].tolist())
        try:
            torque, after = self.controller.law(
                t, (q1, q2), (w1, w2), (fx, fy), state, self.controller.params
            )
            t1, t2 = torque
            after = tuple(map(float, after))
            if len(after) != len(state):
                raise TypeError(f"state must have {len(state)} numbers, not {len(after)}")
            values = float(t1), float(t2), after
        except Exception as error:  # of any kind: it is the user's function
            self.error = error
            values = math.nan, math.nan, state
        self.desk[TORQUE], self.desk[TORQUE + 1] = values[:2]
        for j, x in enumerate(values[2]):
            self.desk[middle + j] = x

    def check(self) -> None:
        """Raises LawFailed if a call has failed; machine code of it leaves torques not finite.

        Torques that are not finite end a run, but for those of its first sample, which is none.
        """
        if not all(map(math.isfinite, self.desk[TORQUE : TORQUE + 2].tolist())):
            self()  # in Python, which says why
            torques = tuple(self.desk[TORQUE : TORQUE + 2].tolist())
            if self.error is None and self.desk[0] <= 0.0:
                self.error = ValueError(f"torques must be finite, not {torques}")
        if self.error is not None:
            what = f"{type(self.error).__name__}: {self.error}"
            raise LawFailed(f"controller.law at t = {self.desk[0]:g} s: {what}") from self.error
