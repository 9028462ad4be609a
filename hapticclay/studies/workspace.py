"""Drift of the coefficients of G and Sh over the workspace, with and without inertia shaping."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named
from ..display import fields_of
from ..errors import Bound, Real
from ..fields import Seed
from ..model.constants import AXES, L1, L2
from ..results import Result, figure_of
from .identification import (
    COEFFICIENT_NAMES,
    NOMINAL_POSE,
    endpoint_mobility,
    identify,
    printed_form,
)

DRIFT_BLOCKS = ("G", "S")
MAP_REACH_MARGIN = 0.04  # [m] to the stretched and the folded arm: nearer, joint rates grow
# A millimetre of motion would change the pose; without noise, a hundredth of that is enough.
DRIFT_SETTINGS: dict[str, Any] = dict(
    band=(1.0, 15.0), period=1.0, periods=2, realisations=1, lines=8, amplitude=2e-5
)


@named
@dataclass(frozen=True, eq=False, repr=False)
class Drift(Result):
    """Coefficients fitted over the workspace.

    Attributes:
        x: world positions [m], (m,), points of a square grid.
        y: world positions [m], (m,), all >= 0: turning the arm by 180 degrees changes no
            coefficient.
        spacing: distance of neighbouring points [m].
        coefficients: (m, 2, 2, 2, 3): without and with shaping; G and Sh; axis x and y; gain,
            damping, stiffness.
        mobility: Wxx and Wyy of the bare arm [1/kg], (m, 2): the gain of Sh without shaping.
    """

    drawn_by = "hapticclay.views.workspace_plots:workspace_plot"
    written_as = "map"
    printed = {"ranges": ()}
    formats = {"printed": "g"}
    summary_units = {"x": "m", "y": "m", "spacing": "m", "mobility": "1/kg"}

    x: np.ndarray
    y: np.ndarray
    spacing: float
    coefficients: np.ndarray
    mobility: np.ndarray

    def tables(self) -> dict[str, dict[str, Any]]:
        """The gain of Sh at each pose, and the range of each coefficient."""
        table: dict[str, Any] = {"world x [m]": self.x, "world y [m]": self.y}
        for i, axis in enumerate(AXES):
            for k, way in enumerate(("without shaping", "with shaping")):
                gain = self.coefficients[:, k, DRIFT_BLOCKS.index("S"), i, 0]
                table[f"gain of Sh along {axis} {way} [1/kg]"] = gain
            table[f"W of the bare arm along {axis} [1/kg]"] = self.mobility[:, i]
        pairs = list(zip(self.ranges()[::2], self.ranges()[1::2], strict=True))
        ranges = {name: [a[name] for a, _ in pairs] for name in ("what", "axis", "name", "printed")}
        for k, way in enumerate(("without shaping", "with shaping")):
            ranges[way] = [f"{x[k]['lowest']:.5g} to {x[k]['highest']:.5g}" for x in pairs]
        return {"poses": table, "ranges": ranges}

    def headline(self) -> str:
        """The number of poses."""
        return f"workspace: {len(self.x)} poses, {100.0 * self.spacing:g} cm apart"

    def figures(self) -> dict[str, Any]:
        return {"map": figure_of(self, tables={"poses": self.tables()["poses"]})}

    def ranges(self) -> list[dict[str, Any]]:
        """The range of each coefficient over the poses, beside the printed value."""
        out = []
        for j, i, n, k in np.ndindex(2, 2, 3, 2):
            what, axis, values = DRIFT_BLOCKS[j], AXES[i], self.coefficients[:, k, j, i, n]
            name, printed = COEFFICIENT_NAMES[what][n], printed_form(what, axis)[n]
            row = {"what": what, "axis": axis, "name": name, "inertia_shaping": bool(k)}
            ends = {"lowest": float(values.min()), "highest": float(values.max())}
            out.append({**row, "printed": printed, **ends})
        return out

    def contents(self) -> dict[str, Any]:
        axes = "pose", "shaping (off, on)", "block (G, S)", "axis (x, y)"
        order = (*axes, "gain, damping, stiffness")
        return {**fields_of(self), "order": order, "ranges": self.ranges()}


def poses(spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """World x and y [m] of a square grid through the nominal pose, within reach, y >= 0."""
    reach = L1 + L2

    def along(nominal: float, lowest: float) -> np.ndarray:
        first, last = -np.floor((nominal - lowest) / spacing), np.ceil((reach - nominal) / spacing)
        return nominal + spacing * np.arange(first, last)

    grid = np.meshgrid(along(NOMINAL_POSE[0], -reach), along(NOMINAL_POSE[1], 0.0))
    x, y = (z.ravel() for z in grid)
    r = np.hypot(x, y)
    inside = (r >= abs(L2 - L1) + MAP_REACH_MARGIN) & (r <= reach - MAP_REACH_MARGIN)
    return x[inside], y[inside]


Spacing = Annotated[Real, Bound(0.01, 0.3, "m")]


@checked
def drift_map(
    spacing: Spacing = 0.08, *, seed: Seed = 0, progress: Callable[[int, int], None] | None = None
) -> Drift:
    """Identify G and Sh on both axes over the workspace, without and with inertia shaping.

    It takes a few minutes.

    Args:
        spacing: distance of neighbouring poses [m], 0.01 to 0.3.
        seed: seed of the phases of the tones.
        progress: called after each pose with (poses done, poses in all).
    """
    x, y = poses(spacing)
    out = np.empty((len(x), 2, 2, 2, 3))
    places = list(zip(x.tolist(), y.tolist(), strict=True))
    for m, at in enumerate(places):
        for k, j, i in np.ndindex(2, 2, 2):
            place: dict[str, Any] = {"origin": at, "inertia_shaping": bool(k), "seed": seed}
            found = identify(AXES[i], DRIFT_BLOCKS[j], **place, **DRIFT_SETTINGS)
            out[m, k, j, i] = found.values
        if progress:
            progress(m + 1, len(x))
    w = np.array([endpoint_mobility(*at) for at in places])
    return Drift(x, y, spacing, out, w)
