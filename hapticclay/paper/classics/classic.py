"""Base of the classics: sources, results, and how claims are marked."""

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
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """Results of the runs of a classic: the table of claims, and its figures."""

    rows: tuple[Row, ...]
    charts: tuple[Chart, ...]


@dataclass(frozen=True)
class Classic:
    """A published result and the runs that check it."""

    name: str  # name of the command and the page
    title: str
    citation: str  # authors, title, journal, year
    read: str  # which parts of the source were available, and which were not
    method: str  # how the runs check the claims
    make: Callable[[bool, Progress], Found]  # makes the runs: quick, progress


def holds(cells: str, ours: bool, status: str, reason: str) -> Row:
    """A row for a claim that holds or not; 1 is expected."""
    return row(f"{cells} | 1", (1.0, float(ours), 0.0), status, reason)
