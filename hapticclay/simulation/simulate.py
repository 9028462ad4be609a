"""One run: the engine steps the arm, the loop closes around it, the record keeps the result."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, overload

from ..arguments import checked
from ..errors import Bound, ParameterError
from ..scene.pair import Pair
from ..scene.plausible import warn_implausible
from ..scene.scenario import Scenario
from .one_run import run_once
from .record import Record
from .run import Progress

if TYPE_CHECKING:
    from .pair_record import PairRecord


@overload
def simulate(
    scenario: Scenario,
    *,
    every: int = 1,
    progress: Progress | None = None,
    engine: str = "auto",
    error: float | str | None = None,
) -> Record: ...
@overload
def simulate(scenario: Pair, *, engine: str = "auto") -> PairRecord: ...


@checked
def simulate(
    scenario: Scenario | Pair,
    *,
    every: Annotated[int, Bound(1, 1_000_000)] = 1,
    progress: Progress | None = None,
    engine: str = "auto",
    error: float | str | None = None,
) -> Any:
    """Runs a scenario, or a leader and a follower, to its end.

    Args:
        scenario: what to run. Of a pair both arms run with their full motion, joint friction,
            torque limits and joint stops; `every`, `progress` and `error` are for scenarios.
        every: keep each every-th sample, and the last.
        progress: called now and then with (simulated time [s], handle x [m]); True ends the run, as
            "interrupted".
        engine: "python"; "native", by the compiled kernel; or "auto", compiled where that kernel
            is installed. All give the same record, bit for bit.
        error: largest allowed error: seconds at the border crossings (1e-6, "1e-6 s"), or metres
            of position ("1e-7 m"), 1e-11 or more. Integrator and dt are then chosen, and refined
            until runs at other steps confirm the error. record.error holds the error reached;
            progress starts at 0 s in each run. None runs the scenario as it is.

    Returns:
        The record, of a pair a `PairRecord`. Instability and similar ends are outcomes
        (record.status), not exceptions.

    Raises:
        ParameterError: an argument is of the wrong kind, there is no compiled kernel, the scene
            is too stiff for its integrator, the record may not fit into memory, the law of its
            controller is not found, an error in seconds is requested without a border to cross, or
            no part of the control sample of a pair, down to 1/40, divides all its delays.
        RuntimeError: the law of its controller raised an exception (`LawFailed`). Interruptions
            such as Ctrl-C are raised unchanged.
    """
    if isinstance(scenario, Pair):
        given = {"every": (every, 1), "progress": (progress, None), "error": (error, None)}
        for name, (value, default) in given.items():
            if value != default:
                raise ParameterError(name, value, "must be left out with a pair")
        from .pair_run import PairRun  # imported only for a pair

        return PairRun(scenario, engine).to_end()
    warn_implausible(scenario)
    if error is not None:
        from .asked_error import simulate_within  # imported only if an error is requested

        return simulate_within(scenario, error, every=every, progress=progress, engine=engine)
    return run_once(scenario, every, engine, progress)
