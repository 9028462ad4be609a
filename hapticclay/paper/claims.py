"""The ledger: what the paper prints or implies beside what the simulator gives, row by row.

Every figure in a row, those in its reason too, comes from a run or from the loop's own polynomials; the only
numbers typed are the printed ones of params.py, by name.
"""

from __future__ import annotations

from . import blocks, cuts
from .ledger import Row, Runs


def rows(runs: Runs | None = None) -> list[Row]:
    """All rows, in the paper's order.

    Args:
        runs: what they are made from; None for new ones.
    """
    runs = runs or Runs()
    parts = (
        blocks.machine, blocks.blocks, cuts.constant, cuts.variable, blocks.limits,
        cuts.maneuver,
    )  # fmt: skip
    return [row for part in parts for row in part(runs)]
