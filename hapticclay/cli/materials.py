"""`hapticclay materials`: the materials by name, and what they do to a tool."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from ..errors import Bound
from .console import significant, text_table

if TYPE_CHECKING:
    from ..model.tool import Tool

COLUMNS_SHOWN = (
    "material",
    "Fy [N]",
    "lowest",
    "highest",
    "K [N/(m/s)^n]",
    "n",
    "b [N.s/m]",
    "source",
)


def _small_tool(name: str) -> float:
    from ..model.materials import SMALL_TOOL

    return getattr(SMALL_TOOL, name)


@dataclass(frozen=True)
class MaterialsCommand:
    """List the materials that a scenario can name, and the force on a tool in each.

    The force on a tool at the speed v is Fy + K v^n + b v; lowest and highest are the range of Fy.

    Attributes:
        tool_width: Width of the tool [m].
        tool_depth: Depth of the cut [m].
    """

    tool_width: Annotated[float, Bound(unit="m")] = field(
        default_factory=lambda: _small_tool("width")
    )
    tool_depth: Annotated[float, Bound(unit="m")] = field(
        default_factory=lambda: _small_tool("depth")
    )

    def __call__(self) -> int:
        from ..model.tool import Tool

        print(material_table(Tool(self.tool_width, self.tool_depth)))
        return 0


def material_table(tool: Tool) -> str:
    """The materials with the flow of a tool in each and its source, for a terminal."""
    from ..model.materials import MATERIALS

    rows, sources = [], []
    for name, m in MATERIALS.items():
        if m.source not in sources:
            sources.append(m.source)
        flow, (low, high) = m.flow(tool), m.range(tool)
        forces = (flow.Fy, low.Fy, high.Fy)
        shown = [significant(f) if high.Fy else "" for f in forces]
        shown += [significant(x) if flow.K else "" for x in (flow.K, flow.n)]
        shown += [significant(flow.b) if flow.b else "", f"[{sources.index(m.source) + 1}]"]
        rows.append([name, *shown])
    told = [f"[{i}] {source}" for i, source in enumerate(sources, 1)]
    return "\n".join([text_table(rows, COLUMNS_SHOWN, "lrrrrrrl"), "", *told])
