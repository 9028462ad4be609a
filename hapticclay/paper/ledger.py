"""Rows of the ledger, and the runs that check its claims."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..model.operator import Operator
from ..scene.experiments import constant_cut, free, stability_test, variable_cut
from ..simulation.record import Record
from ..simulation.simulate import simulate
from ..studies.identification import Identified, identify
from ..theory import loops

TH = Operator()  # Eq. 19
STATUSES = {
    "given": "printed in the paper, and reproduced",
    "inferred": "not printed, but follows from printed numbers",
    "corrected": "printed differently; the reading we use, and why",
    "not recoverable": "neither printed nor derivable from what is printed",
    "contradicted": "printed, but at odds with the printed model",
}


@dataclass(frozen=True)
class Row:
    """One row of the ledger."""

    what: str  # the quantity
    where: str  # its place in the paper
    printed: str  # text as printed in the paper
    unit: str  # unit of `expected` and `ours`
    expected: float | None  # by our reading of the paper; None if there is nothing to compare
    ours: float | None  # by the simulator; None if there is nothing to find
    # relative, or absolute where 0 is expected; None if the row need not agree
    tolerance: float | None
    status: str  # one of STATUSES
    reason: str = ""  # why, with the evidence

    def __post_init__(self):
        for field in ("expected", "ours"):  # plain numbers, not those of NumPy
            value = getattr(self, field)
            object.__setattr__(self, field, None if value is None else float(value))

    @property
    def error(self) -> float | None:
        """Relative error, absolute where expected is 0; None where there is nothing to compare."""
        if self.expected is None or self.ours is None:
            return None
        return self.ours / self.expected - 1.0 if self.expected else self.ours

    @property
    def agrees(self) -> bool | None:
        """Whether the error is within the tolerance; None if the row need not agree."""
        if self.tolerance is None:
            return None
        return self.error is not None and abs(self.error) <= self.tolerance


class Runs:
    """The runs behind rows and figures, each run once, on first use; `progress` takes its name."""

    def __init__(self, progress: Callable[[str], None] | None = None):
        self.progress = progress or (lambda name: None)
        self._kept: dict[str, Any] = {}

    def _get(self, name: str, make: Callable[[], Any]) -> Any:
        if name not in self._kept:
            self.progress(name)
            self._kept[name] = make()
        return self._kept[name]

    def constant(self, **kw) -> Record:
        return self._get(f"constant cut {_keywords(kw)}", lambda: simulate(constant_cut(**kw)))

    def variable(self, growth: Any = "30/s", **kw) -> Record:
        return self._get(
            f"variable cut, growth {growth} {_keywords(kw)}",
            lambda: simulate(variable_cut(growth, **kw)),
        )

    def stability(self, gain: float, **kw) -> Record:
        return self._get(
            f"stability test, K = {gain:g} {_keywords(kw)}",
            lambda: simulate(stability_test(gain, **kw)),
        )

    def free(self, **kw) -> Record:
        return self._get(f"free {_keywords(kw)}", lambda: simulate(free(**kw)))

    def identified(self, what: Any, axis: Any) -> Identified:
        """An identification from a single run."""
        return self._get(
            f"identification of {what}{axis}", lambda: identify(axis, what, realisations=1)
        )


def _keywords(kw: dict) -> str:
    return " ".join(f"{k}={v}" for k, v in kw.items())


def steady(r: Record, axis: str, k: int, name: str) -> float:
    """A steady-state quantity of one region of the path."""
    value = r.regions(axis)[k][axis][name]
    value = value["mean"] if isinstance(value, dict) else value
    return math.nan if value is None else value


def rightmost(axis: str, K: float, b: float, th: Operator | None) -> complex:
    """Rightmost pole of the loop at the nominal pose [1/s]; of a pair, the upper one."""
    poles = loops.closed_loop_poles(axis, K, b, th)
    return complex(max((p for p in poles if p.imag >= 0.0), key=lambda p: p.real))


def row(
    cells: str,
    figures: tuple[float | None, float | None, float | None],
    status: str,
    reason: str = "",
) -> Row:
    what, where, printed, unit = cells.split(" | ")
    return Row(what, where, printed, unit, *figures, status, reason)
