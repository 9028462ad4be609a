"""The tool at the handle."""

from __future__ import annotations

from typing import Annotated

from ..arguments import part
from ..errors import Bound, Real

WIDTH_MIN = 4e-3  # [m] two of the largest cells of a picture's map (studies/removal.py)


@part("tool.")
class Tool:
    """The cutting tool at the handle.

    Attributes:
        width: diameter of its round footprint, across the motion [m], 0.004 to 0.1.
        depth: depth of the cut [m], 0.0001 to 0.025.
    """

    width: Annotated[Real, Bound(WIDTH_MIN, 0.1, "m")] = 0.02
    depth: Annotated[Real, Bound(1e-4, 0.025, "m")] = 0.01


SMALL_TOOL = Tool(0.010, 0.005)
