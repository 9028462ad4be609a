"""`hapticclay reproduce`: the whole paper beside ours."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..files import atomic, writable


@dataclass(frozen=True)
class Reproduce:
    """Run the whole paper: every figure and number beside ours, on one page.

    The exit status is 1 if a number that should agree does not.
    """

    out: Path = Path("out/paper")
    """Folder for report.html (self-contained), report.md, ledger.json and figures/."""
    quick: bool = False
    """Leave out the map of Sh over the workspace."""
    page: Path | None = None
    """Also write the ledger alone, as Markdown, to this file."""

    def __call__(self) -> int:
        writable(self.out)
        from tqdm import tqdm

        from ..paper import report

        with tqdm(
            total=0, delay=2.0, bar_format="{elapsed} {desc}", disable=None, leave=False
        ) as bar:
            rows = report.reproduce(
                self.out, self.quick, lambda name: bar.set_description_str(name)
            )
        if self.page:
            with atomic(self.page) as f:
                f.write(report.paper_page(rows).encode())
        wrong = [r for r in rows if r.agrees is False]
        for r in wrong:
            print(
                f"does not agree: {r.what} ({r.where}): {report.format_number(r.ours, r.unit)}, {report.format_error(r)}"
            )
        agree = sum(r.agrees is True for r in rows)
        print(
            f"{agree} of {agree + len(wrong)} numbers agree; {len(rows) - agree - len(wrong)} more are explained"
        )
        print(f"report: {(self.out / 'report.html').resolve()}")
        return 1 if wrong else 0
