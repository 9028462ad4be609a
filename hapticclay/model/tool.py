"""The tool at the handle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from ..arguments import named
from ..errors import Bound
from ..fields import check_fields

WIDTH_MIN = 4e-3  # [m] two of the largest cells of a picture's map (studies/removal.py)


@named
@dataclass(frozen=True)
class Tool:
    """The cutting tool at the handle.

    Attributes:
        width: of its round footprint, across the motion [m], 0.004 to 0.1.
        depth: of the cut [m], 0.0001 to 0.025.
    """

    width: Annotated[float, Bound(WIDTH_MIN, 0.1, "m")] = 0.02
    depth: Annotated[float, Bound(1e-4, 0.025, "m")] = 0.01

    def __post_init__(self):
        check_fields(self, "tool.")
