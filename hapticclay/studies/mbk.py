"""Renderable masses, dampers and springs: stability borders by theory and by runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Annotated, Any, NamedTuple

import numpy as np

from ..arguments import checked, named
from ..display import table_of
from ..errors import Bound, numbers_of
from ..results import Result, figure_of
from ..scene.scenario import Scenario
from ..scene.virtual_wall import VirtualWall
from ..theory.hand_boxes import Box
from ..theory.mbk import (
    PLANES,
    DynamicRange,
    Plane,
    Region,
    dynamic_range,
    least_mass,
    renderable,
    stable_band,
)
from .boundary import PushedLoop, find_crossing, of_scenario, simulated_gain
from .wall_runs import growth_rates

MBK_UNITS = {"M": "kg", "B": "N.s/m", "K": "N/m"}
MOST_SOUGHT = 100.0  # end of a search, in multiples of the exact border
HANDS = Box((0.1, 1.0), (1.0, 10.0), (0.0, 300.0))  # a choice of ours: light to firm grips
DECAYS = (1.0, 1000.0)  # [1/s] B/M of admittances
RANGE_BAND = (0.5, 30.0)  # [Hz]


class Border(NamedTuple):
    """A border of stability found by runs.

    Attributes:
        x: value on the horizontal axis of the plane.
        y: value on the vertical axis, found by runs.
        exact: value on the vertical axis by theory.
        end: "high" or "low".
    """

    x: float
    y: float
    exact: float
    end: str


@named
@dataclass(frozen=True, eq=False, repr=False)
class DeviceMBK(Result):
    """Stable renderings of a bare device: a region over each plane, and the dynamic range.

    Attributes:
        wall: device, hand and sampling; each plane keeps one of its K, B and M.
        regions: by plane.
        found: borders found by runs, by plane.
        range: from free motion to the stiffest stable wall.
    """

    drawn_by = "hapticclay.views.impedance_plots:mbk_plot"
    written_as = "mbk"
    printed = {"borders": ()}
    formats = {"off": "+.2g %"}

    wall: VirtualWall
    regions: dict[Plane, Region]
    found: dict[str, tuple[Border, ...]]
    range: DynamicRange

    def headline(self) -> str:
        """Dynamic range and stiffest wall, in one line."""
        r = self.range
        return f"{r.mean:.3g} dB from free motion to the stiffest wall of {r.stiffest.K:.4g} N/m"

    @property
    def gap(self) -> float:
        """Largest relative difference of a border found by runs from the exact one; NaN if none."""
        gaps = [abs(x.y / x.exact - 1.0) for some in self.found.values() for x in some]
        return max(gaps, default=math.nan)

    def tables(self) -> dict[str, dict[str, list[Any]]]:
        """The numbers of the figures, by table, columns headed with their units."""
        out: dict[str, dict[str, list[Any]]] = {}
        for plane, region in self.regions.items():
            a, b = (f"{name} [{MBK_UNITS[name]}]" for name in PLANES[plane])
            low, high = region.low.tolist(), region.high.tolist()
            out[plane] = {a: region.x.tolist(), f"least {b}": low, f"largest {b}": high}
            out[f"{plane} by runs"] = table_of((a, b, f"exact {b}", "end"), self.found[plane])
        out["borders"] = table_of(
            ("plane", "at", "border", "by runs", "exact", "off"),
            [
                (plane, x.x, x.end, x.y, x.exact, x.y / x.exact - 1.0)
                for plane, some in self.found.items()
                for x in some
            ],
        )
        r = self.range
        out["range"] = {
            "f [Hz]": (r.omega / (2.0 * math.pi)).tolist(),
            "free |Z| [N.s/m]": r.free.tolist(),
            "least |Z| [N.s/m]": r.least.tolist(),
            "stiffest |Z| [N.s/m]": r.most.tolist(),
            "range [dB]": r.decibels.tolist(),
        }
        return out

    def remarks(self) -> list[str]:
        """Units of the planes, the dynamic range, and what the theory ignores."""
        r = self.range
        low, high = (float(r.omega[i]) / (2.0 * math.pi) for i in (0, -1))
        wall = f"K = {r.stiffest.K:.4g} N/m with B = {r.stiffest.B:.4g} N.s/m"
        ends = f"{r.decibels[0]:.3g} dB at {low:.3g} Hz, {r.decibels[-1]:.3g} dB at {high:.3g} Hz"
        lines = [
            "mass-damper: kg, N.s/m; mass-stiffness: kg, N/m; damper-stiffness: N.s/m, N/m",
            f"dynamic range from the free device to {wall}: {ends}, mean {r.mean:.3g} dB",
        ]
        device = r.stiffest.device
        if device.friction or device.quantum or r.stiffest.unilateral:
            lines.append("all of the linear loop: friction, encoder and surface are ignored")
        return lines

    def figures(self) -> dict[str, Any]:
        """The planes, and the dynamic range."""
        tables = self.tables()
        span = {"range": tables.pop("range")}
        del tables["borders"]
        by = "hapticclay.views.impedance_plots:dynamic_range_plot"
        return {"mbk": figure_of(self, tables=tables), "range": figure_of(self, by, span)}

    def contents(self) -> dict[str, Any]:
        """Wall, stiffest wall, mean dynamic range and tables."""
        r = self.range
        return {
            "kind": "device",
            "wall": self.wall,
            "gap": self.gap,
            "range_mean_dB": r.mean,
            "stiffest": r.stiffest,
            "tables": self.tables(),
        }


@named
@dataclass(frozen=True, eq=False, repr=False)
class ArmMBK(Result):
    """The least masses that the arm renders as an admittance 1/(M s^2 + B s).

    Every larger mass of the same B/M is stable as well.

    Attributes:
        loop: arm, servo, hand and sampling; its compensator and gain are ignored.
        box: hands.
        nominal: M [kg] and B [N.s/m] of the border with the loop's own hand, shape (2, n).
        worst: the same for the worst hand of the box; in a sampled loop this includes the loop's
            own hand.
        found: the border by runs with the loop's own hand.
    """

    drawn_by = "hapticclay.views.impedance_plots:least_mass_plot"
    written_as = "mbk"
    printed = {"least masses": ()}

    loop: PushedLoop
    box: Box
    nominal: np.ndarray
    worst: np.ndarray
    found: tuple[Border, ...]

    def headline(self) -> str:
        """Least mass with the loop's own hand and with all hands of the box, in one line."""
        M, worst = self.nominal[0].min(), self.worst[0].min()
        return f"masses from {M:.4g} kg with this hand, from {worst:.4g} kg with any of the box"

    @property
    def gap(self) -> float:
        """Largest relative difference of a mass found by runs from the exact one; NaN if none."""
        return max((abs(r.y / r.exact - 1.0) for r in self.found), default=math.nan)

    def tables(self) -> dict[str, dict[str, list[Any]]]:
        """The numbers of the figure, by table, columns headed with their units."""
        M, B = "least M [kg]", "B [N.s/m]"
        out: dict[str, dict[str, list[Any]]] = {
            name: {B: b.tolist(), M: m.tolist()}
            for name, (m, b) in (("this hand", self.nominal), ("hand box", self.worst))
        }
        out["runs"] = table_of((B, M, "exact M [kg]"), self.found)
        by_runs = {r.exact: r.y for r in self.found}
        out["least masses"] = {
            B: self.nominal[1].tolist(),
            M: self.nominal[0].tolist(),
            "by runs [kg]": [by_runs.get(m) for m in self.nominal[0].tolist()],
            f"hand box: {B}": self.worst[1].tolist(),
            f"hand box: {M}": self.worst[0].tolist(),
        }
        return out

    def remarks(self) -> list[str]:
        """Nothing: the table shows all."""
        return []

    def figures(self) -> dict[str, Any]:
        """The least masses over the damper."""
        tables = self.tables()
        del tables["least masses"]
        return {"mass": figure_of(self, tables=tables)}

    def contents(self) -> dict[str, Any]:
        """Loop, hands and tables."""
        tables = {"gap": self.gap, "tables": self.tables()}
        return {"kind": "arm", "loop": self.loop, "box": self.box, **tables}


@checked
def device_mbk(
    wall: VirtualWall,
    *,
    columns: Annotated[int, Bound(0, 100)] = 5,
    points: int = 41,
    band: tuple[float, float] = RANGE_BAND,
    progress: Callable[[Iterable], Iterable] = iter,
) -> DeviceMBK:
    """Stable renderings of a bare device over three planes, with runs at the borders.

    Args:
        wall: device, hand and sampling. The plane of M and B keeps its K, that of M and K its B,
            and that of B and K its M; a surface and the device's friction and quantum are ignored.
        columns: columns of each plane where runs search the border, 0 (theory alone) to 100.
        points: points of each line, 3 to 1001.
        band: lowest and highest frequency of the dynamic range [Hz].
        progress: wraps the iterable of the columns.

    Raises:
        ParameterError: a value is out of its bounds, or nothing in a plane is stable.
    """
    low, high = numbers_of("band", band, ("low", "high"), 0.0, 1e4, above=True, unit="Hz")
    linear = replace(wall.device, friction=0.0, quantum=0.0)
    wall = replace(wall, device=linear, unilateral=False)
    regions: dict[Plane, Region] = {x: renderable(wall, x, points) for x in PLANES}
    # away from the ends of a plane, where the borders meet
    shares = (np.arange(columns) + 0.5) / columns if columns else np.empty(0)
    searched = [
        (plane, float(region.x[0] + share * (region.x[-1] - region.x[0])))
        for plane, region in regions.items()
        for share in shares.tolist()
    ]
    found: dict[str, list[Border]] = {plane: [] for plane in PLANES}
    for plane, x in progress(searched):
        found[plane] += wall_borders(wall, plane, x)
    spread = dynamic_range(wall, 2.0 * math.pi * np.geomspace(low, high, points))
    return DeviceMBK(wall, regions, {k: tuple(v) for k, v in found.items()}, spread)


@checked
def wall_borders(wall: VirtualWall, plane: Plane, x: float) -> list[Border]:
    """The borders in one column of a plane by runs; the search starts at the exact borders.

    Low borders at or below 0 are not searched.

    Args:
        wall: as in `renderable`.
        plane: one of PLANES.
        x: the part on the horizontal axis.
    """
    across, up = PLANES[plane]
    wall = replace(wall, **{across: x})
    low, high = stable_band(wall, up)
    out = []

    def growth(y: float) -> float:
        return growth_rates([replace(wall, **{up: y})])[0]

    if math.isfinite(high) and high > 0.0:
        y = find_crossing(growth, high, MOST_SOUGHT * high)
        out.append(Border(x, y, high, "high"))
    if low > 0.0:
        y = find_crossing(lambda y: growth(1.0 / y), 1.0 / low, MOST_SOUGHT / low)
        out.append(Border(x, 1.0 / y if y else math.inf, low, "low"))
    return out


@checked
def arm_mbk(
    loop: PushedLoop | Scenario,
    box: Box = HANDS,
    *,
    axis: str = "x",
    columns: Annotated[int, Bound(0, 100)] = 5,
    points: Annotated[int, Bound(2, 1001)] = 15,
    samples: int = 24,
    progress: Callable[[Iterable], Iterable] = iter,
) -> ArmMBK:
    """The least masses that the arm renders over their damper, with runs.

    Args:
        loop: arm, servo, hand and sampling, or a scenario; its compensator and gain are ignored.
        box: hands.
        axis: axis of a scenario, "x" or "y".
        columns: number of B/M where runs search the border, 0 (theory alone) to 100.
        points: number of B/M of each line, 2 to 1001.
        samples: random members of the box tested in a sampled or delayed loop.
        progress: wraps the iterable of the points.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    loop = of_scenario(loop, axis)
    decays, linear = np.geomspace(*DECAYS, points), loop.linear
    nominal, worst, found = [], [], []
    runs = set(np.linspace(0, points - 1, columns).round().astype(int).tolist())
    for i, decay in enumerate(progress(decays.tolist())):
        M, B = least_mass(linear, decay)
        nominal.append((M, B))
        worst.append(least_mass(linear, decay, box, samples))
        if i in runs and 0.0 < M < math.inf:
            shape = replace(linear.compensator, num=(1.0,), den=(1.0, decay, 0.0))
            K = simulated_gain(replace(loop, compensator=shape), 1.0 / M, MOST_SOUGHT / M)
            found.append(Border(B, 1.0 / K if K else math.inf, M, "low"))
    return ArmMBK(loop, box, np.array(nominal).T, np.array(worst).T, tuple(found))
