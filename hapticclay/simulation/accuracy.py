"""The error of a run: requested and estimated."""

from __future__ import annotations

from dataclasses import dataclass

from ..arguments import named


@named
@dataclass(frozen=True)
class Accuracy:
    """Requested and estimated error of a run.

    Attributes:
        asked: the requested error [unit].
        unit: "s", the largest error of the times at which borders are crossed; or "m", of the
            position at the samples.
        estimate: the error of the record [unit]; None where nothing bounds it.
        reached: whether the estimate is at most the requested error.
        integrator: the one chosen.
        dt: step of the record [s].
        order: observed over the last three steps; None where it cannot be determined.
        runs: number of runs made to choose and to verify.
        wall_time: of all these runs [s].
        note: why there is no estimate, or why it exceeds the requested error; else "".
    """

    asked: float
    unit: str
    estimate: float | None
    reached: bool
    integrator: str
    dt: float
    order: float | None = None
    runs: int = 0
    wall_time: float = 0.0
    note: str = ""

    def __str__(self) -> str:
        found = "unknown" if self.estimate is None else f"{self.estimate:.1e} {self.unit}"
        kept = "reached" if self.reached else "not reached"
        how = f"{self.integrator}, dt = {self.dt:.3g} s, {self.runs} runs"
        return f"{found}, {self.asked:g} {self.unit} requested: {kept} ({how})"
