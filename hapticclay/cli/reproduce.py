"""`hapticclay reproduce`: the whole paper beside ours, or a classic of haptics."""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..display import text_table
from ..files import atomic, writable
from .console import FigureOptions, progress_bar, save_figures
from .options import Loose

if TYPE_CHECKING:
    from ..paper.ledger import Row

WIDE = 60  # characters of a claim in a row of the terminal
QUIET_FIGURES = FigureOptions(format=("svg",))


@dataclass(frozen=True)
class ReproduceCommand:
    """Reproduce the paper: every printed figure and number beside the simulated one, on one page.

    Add the name of a classic to reproduce that instead. Of walls: colgate1997, hannaford2002,
    abbott2005, diolaiti2006, hulin2006 or chawda2015. Of leader and follower: niemeyer1991,
    lawrence1993, yokokohji1994 or ryu2004. The exit status is 1 if a number that should agree does
    not.

    Attributes:
        source: The classic; none for the paper of 2002.
        out: Folder for report.html (self-contained), report.md, ledger.json and figures/; by
            default out/paper, or out/CLASSIC.
        quick: Omit the map of Sh over the workspace; for a classic, make fewer runs.
        page: Also write the table of numbers alone, as Markdown, to this file; of a classic, with
            its figures beside it.
        figures: Formats and style of figures/; the report itself has SVG figures for a screen.
    """

    source: Loose[str | None] = None
    out: Path | None = None
    quick: bool = False
    page: Path | None = None
    figures: FigureOptions = QUIET_FIGURES

    def __call__(self) -> int:
        from ..paper.classics import classic

        source = classic(self.source) if self.source is not None else None
        out = self.out or Path("out") / (self.source or "paper")
        writable(out)
        from ..paper import report

        def save(figures: dict[str, Any], folder: Path) -> None:
            save_figures(figures, folder, self.figures)
            if self.page and self.source:
                named = {f"{self.source}_{name}": x for name, x in figures.items()}
                save_figures(named, self.page.parent)

        make: Callable[..., Any] = report.reproduce
        if source is not None:
            make = functools.partial(report.reproduce_classic, source)
        with progress_bar(total=0, bar_format="{elapsed} {desc}") as bar:
            found: Any = make(out, self.quick, bar.set_description_str, save)
        rows: Any = found if source is None else found.rows
        if self.page:
            text = report.classic_page(found, source) if source else report.paper_page(rows)
            with atomic(self.page) as f:
                f.write(text.encode())
        return self._summarize(rows, out)

    def _summarize(self, rows: Sequence[Row], out: Path) -> int:
        """Prints what does not agree, of a classic every claim; returns the exit status."""
        from ..paper.report import format_error, format_number

        if self.source is not None:
            print(claims_table(rows))
        wrong = [r for r in rows if r.agrees is False]
        for r in wrong:
            ours = f"{format_number(r.ours, r.unit)}, {format_error(r)}"
            print(f"does not agree: {r.what} ({r.where}): {ours}")
        agree = sum(r.agrees is True for r in rows)
        print(
            f"{agree} of {agree + len(wrong)} numbers agree; "
            f"{len(rows) - agree - len(wrong)} more are explained"
        )
        print(f"report: {(out / 'report.html').resolve()}")
        return 1 if wrong else 0


def claims_table(rows: Sequence[Row]) -> str:
    """The claims of a classic, for a terminal."""
    from ..paper import report

    return text_table(
        {
            "claim": [textwrap.fill(r.what, WIDE) for r in rows],
            "expected": [
                report.format_number(r.expected, r.unit, report.expected_digits(r)) for r in rows
            ],
            "ours": [report.format_number(r.ours, r.unit, report.digits(r)) for r in rows],
            "error": [report.format_error(r) for r in rows],
            "agrees": [report.format_verdict(r) for r in rows],
        }
    )
