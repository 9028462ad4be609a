"""`hapticclay materials`: the materials by name, and what they do to a tool."""

from __future__ import annotations

from dataclasses import dataclass

from ..display import text_table
from ..model.tool import SMALL_TOOL, Tool
from .options import Prefixed


@dataclass(frozen=True)
class MaterialsCommand:
    """List the materials that a scenario can name, and the force on a tool in each.

    The force on a tool at the speed v is Fy + K v^n + b v; lowest and highest are the range of Fy.

    Attributes:
        tool: The tool.
    """

    tool: Prefixed[Tool] = SMALL_TOOL

    def __call__(self) -> int:
        print(material_table(self.tool))
        return 0


def material_table(tool: Tool) -> str:
    """The materials with the flow of a tool in each and its source, for a terminal."""
    from ..model.materials import MATERIALS

    known = dict.fromkeys(m.source for m in MATERIALS.values())
    sources = {source: f"[{i}]" for i, source in enumerate(known, 1)}
    flows = [m.flow(tool) for m in MATERIALS.values()]
    ranges = [m.range(tool) for m in MATERIALS.values()]
    table = {
        "material": list(MATERIALS),
        "Fy [N]": [f.Fy if high.Fy else None for f, (_, high) in zip(flows, ranges, strict=True)],
        "lowest": [low.Fy if high.Fy else None for low, high in ranges],
        "highest": [high.Fy or None for _, high in ranges],
        "K [N/(m/s)^n]": [f.K or None for f in flows],
        "n": [f.n if f.K else None for f in flows],
        "b [N.s/m]": [f.b or None for f in flows],
        "source": [sources[m.source] for m in MATERIALS.values()],
    }
    notes = [f"{mark} {source}" for source, mark in sources.items()]
    return "\n".join([text_table(table), "", *notes])
