"""Identified blocks and their drift over the workspace, as one result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ..display import table_of
from ..results import Result, figure_of
from .identification import COEFFICIENT_UNITS, Identified, response_tables, unit_of
from .workspace import Drift

FIGURES = {"G": "fig4", "S": "fig5", "Th": "fig6"}  # of the paper


@dataclass(frozen=True, eq=False, repr=False)
class IdentifiedBlocks(Result):
    """What `hapticclay identify` finds: blocks on one or both axes, and their drift.

    Attributes:
        results: the blocks.
        drift: their coefficients over the workspace; None for no map.
        paper: whether to show the printed coefficients and the axis beside the fitted ones.
    """

    drawn_by = "hapticclay.views.identification_plots:blocks_plot"
    written_as = "identify"
    printed = {"coefficients": (), "over the workspace": ()}
    formats = {"printed": "g", "fitted": ".6g", "error": "+.4f %"}

    results: tuple[Identified, ...]
    drift: Drift | None = None
    paper: bool = True

    def headline(self) -> str:
        """The headlines of the blocks."""
        return "; ".join(r.headline() for r in self.results)

    def tables(self) -> dict[str, dict[str, Any]]:
        """Coefficients of all blocks, and their ranges over the workspace."""
        head = ("block", "axis", "coefficient", "printed", "fitted", "95 % interval", "error")
        rows = []
        for r in self.results:
            for c in r.coefficients:
                name, span = f"{c.name} [{c.unit}]", f"{c.low:.6g} to {c.high:.6g}"
                rows.append((r.what, r.axis, name, c.printed, c.value, span, c.error))
        table = table_of(head, rows)
        if not self.paper:
            table = {n: table[n] for n in table if n not in ("axis", "printed", "error")}
        drift = {"over the workspace": self.drift.tables()["ranges"]} if self.drift else {}
        return {"coefficients": table, **drift}

    def remarks(self) -> list[str]:
        """Lines and their coherence, the device of measured columns, and warnings."""
        low = min(float(r.coherence.min()) for r in self.results)
        counts = ", ".join(
            f"{r.what}{r.axis if self.paper else ''} {len(r.frequency)}" for r in self.results
        )
        measured = [r for r in self.results if r.scenario is None]
        way = "".join(f"; {r.source}: {r.estimate}" for r in measured)
        lines = [f"lines: {counts}; lowest coherence {low:.6f}{way}"]
        for r in measured:
            if r.what == "S":
                names = ("inertia" if r.rotary else "mass", "damper", "spring")
                units = (unit_of(x, r.rotary) for x in COEFFICIENT_UNITS["Th"])
                triples = zip(names, r.device, units, strict=True)
                lines.append("as a device: " + ", ".join(f"{n} {x:.5g} {u}" for n, x, u in triples))
        lines += [f"warning: {x}" for r in self.results for x in r.warnings]
        return lines + ([self.drift.headline()] if self.drift else [])

    def figures(self) -> dict[str, Any]:
        """A figure of each block, named after that of the paper, and the map."""
        out = {}
        for what, name in FIGURES.items():
            if same := tuple(r for r in self.results if r.what == what):
                shown = response_tables(same, self.paper)
                figure = figure_of(replace(self, results=same), tables=shown)
                out[name if same[0].scenario else "identify"] = figure
        return out | (self.drift.figures() if self.drift else {})

    def contents(self) -> dict[str, Any]:
        """Results and map."""
        drift = self.drift and self.drift.summary()
        return {"results": [r.summary() for r in self.results], "map": drift}
