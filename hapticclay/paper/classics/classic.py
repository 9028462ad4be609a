"""What the classics share: what one is, what it found, and how its claims are marked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ...studies.chart import Chart
from ..ledger import Row, row

QUOTED, FORMULA, BESIDE = "quoted", "formula", "beside"
CLASSIC_STATUSES = {
    QUOTED: "a sentence or number of the source that could be read, and a run of it",
    FORMULA: "a formula of the source, and runs that search for the same limit without it",
    BESIDE: "what the source does not state, found on the way",
}
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """What the runs of a classic gave.

    Attributes:
        rows: the table of claims.
        charts: its figures.
    """

    rows: tuple[Row, ...]
    charts: tuple[Chart, ...]


@dataclass(frozen=True)
class Classic:
    """A published result and the runs that stand beside it.

    Attributes:
        name: of the command and of the page.
        title: in a few words.
        citation: authors, title, journal, year.
        read: what of the source could be read for this page, and what could not.
        method: how the runs find what is claimed.
        make: makes the runs: whether quick, and what to call with the name of each step.
    """

    name: str
    title: str
    citation: str
    read: str
    method: str
    make: Callable[[bool, Tell], Found]


def holds(cells: str, ours: bool, status: str, reason: str) -> Row:
    """A row of a claim that holds or not: 1 is expected.

    Args:
        cells: "claim | place | as printed".
        ours: whether the runs show it.
        status: as in CLASSIC_STATUSES.
        reason: the numbers behind it.
    """
    return row(f"{cells} | 1", (1.0, float(ours), 0.0), status, reason)
