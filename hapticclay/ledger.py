"""The ledger: what the paper prints or implies beside what the simulator gives, row by row.

Every figure in a row, those in its reason too, comes from a run or from the loop's own polynomials; the only
numbers typed are the printed ones of params.py, by name.
"""

from __future__ import annotations

from . import paper_cuts, paper_model
from .entries import Row, Runs


def rows(runs: Runs | None = None) -> list[Row]:
    """All rows, in the paper's order.

    Args:
        runs: what they are made from; None for new ones.
    """
    runs = runs or Runs()
    parts = (
        paper_model.machine, paper_model.blocks, paper_cuts.constant, paper_cuts.variable, paper_model.limits,
        paper_cuts.maneuver,
    )  # fmt: skip
    return [row for part in parts for row in part(runs)]
