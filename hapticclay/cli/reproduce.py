"""`hapticclay reproduce`: the whole paper beside ours."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..files import atomic, writable
from .console import FigureOptions, progress_bar, save_figures


@dataclass(frozen=True)
class ReproduceCommand:
    """Reproduce the paper: every printed figure and number beside the simulated one, on one page.

    The exit status is 1 if a number that should agree does not.

    Attributes:
        out: Folder for report.html (self-contained), report.md, ledger.json and figures/.
        quick: Leave out the map of Sh over the workspace.
        page: Also write the table of numbers alone, as Markdown, to this file.
        figures: Formats and style of figures/; the report itself has SVG figures for a screen.
    """

    out: Path = Path("out/paper")
    quick: bool = False
    page: Path | None = None
    figures: FigureOptions = FigureOptions(format=("svg",))

    def __call__(self) -> int:
        writable(self.out)
        from ..paper import report

        with progress_bar(total=0, bar_format="{elapsed} {desc}") as bar:
            rows = report.reproduce(
                self.out,
                self.quick,
                bar.set_description_str,
                lambda figures, folder: save_figures(figures, folder, self.figures),
            )
        if self.page:
            with atomic(self.page) as f:
                f.write(report.paper_page(rows).encode())
        wrong = [r for r in rows if r.agrees is False]
        for r in wrong:
            ours = f"{report.format_number(r.ours, r.unit)}, {report.format_error(r)}"
            print(f"does not agree: {r.what} ({r.where}): {ours}")
        agree = sum(r.agrees is True for r in rows)
        print(
            f"{agree} of {agree + len(wrong)} numbers agree; "
            f"{len(rows) - agree - len(wrong)} more are explained"
        )
        print(f"report: {(self.out / 'report.html').resolve()}")
        return 1 if wrong else 0
