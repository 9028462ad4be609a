"""Figures of virtual walls: the region of stable K and B, and families of regions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from ..scene.virtual_wall import VirtualWall
from ..studies.wall import as_wall
from ..studies.zwidth import BY_GROWTH, ZRegion, ZWidth
from .captions import hand_name, unit_text
from .palette import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY_BLUE, VERMILION, WHITE
from .panels import (
    MARKS,
    add_legend,
    curve_look,
    hollow,
    label_axes,
    plain_ticks,
    positive,
    ring,
    set_title,
    single,
)
from .style import figure_style, narrow, points, stroke

LIMIT_LOOKS: dict[str, Any] = {  # by the first word of the name
    "exact,": dict(color=BLUE, ls="-"),
    "Colgate,": dict(color=GREEN, ls="--"),
    "Hulin": dict(color=VERMILION, ls="-."),
    "Abbott,": dict(color=PURPLE, marker="D", ls="none"),
    "worst": dict(color=ORANGE, ls=(0, (1, 1))),
}
KIND_WORDS = {"exact": "", "sufficient": " (sufficient)", "rule": " (rule)"}
REGION_ALPHA = 0.22
LABEL_ROOM = 0.05  # share of the height that the name of a region takes
SPREAD = 20.0  # ratio of B from which an axis is logarithmic
SHOWN_SHARE = 1e-4  # of the largest K: lower end of a logarithmic axis
NEAR_ORIGIN = 0.05  # share of an axis below which a wall is not legible on a linear one
LABEL_SIDE = 0.15  # share of the width beside its ends, where a centred label would cross the axis


@figure_style()
def zwidth_plot(chart: ZWidth) -> Figure:
    """Plots the region of stable walls, or a family of regions.

    Markers are runs and lines are theory. Each region of a family has its runs, the exact line of
    its linear loop and, where there is room, its name.
    """
    figure, ax = single(5.4)
    _set_axes(ax, chart.regions)
    if len(chart.regions) == 1:
        _draw_region(ax, chart.regions[0])
    else:
        _draw_family(ax, chart.regions)
        if not narrow():
            _name_regions(ax, chart.regions)
    add_legend(figure, 2)
    set_title(ax, *_device_parts(chart))
    return figure


@figure_style()
def regions_plot(regions: Sequence[ZRegion], walls: Sequence[VirtualWall]) -> Figure:
    """Plots the regions of several devices superimposed, and one wall of each."""
    figure, ax = single(5.0)
    _set_axes(ax, regions, walls)
    _draw_family(ax, regions)
    bottom = ax.get_ylim()[0]
    for i, wall in enumerate(walls):
        look: Any = ring(curve_look(i)["color"], 10.0) | dict(clip_on=False, zorder=6)
        look["marker"] = "o" if wall.K >= bottom else "v"
        ax.plot(wall.B, max(wall.K, bottom), **look)
    add_legend(figure, 2)
    set_title(ax, "lines: exact linear loop", "marks: runs", "rings: the walls themselves")
    return figure


def _draw_region(ax: Axes, r: ZRegion) -> None:
    """The region of one device with all its lines."""
    bottom = ax.get_ylim()[0]
    ax.fill_between(*_region_edge(r), bottom, color=SKY_BLUE, alpha=REGION_ALPHA, lw=0, zorder=0.5)
    for limit in r.limits:
        look = LIMIT_LOOKS[limit.name.split(" ")[0]]
        if limit.name.startswith("exact"):
            left_out = ", ".join(as_wall(r.wall).left_out)
            label = limit.name if r.linear else f"linear loop, {left_out} left out"
            label = label.partition(",")[0] + " alone" if narrow() and not r.linear else label
        else:  # one column has no room for the kind beside two names
            label = limit.name + ("" if narrow() else KIND_WORDS[limit.kind])
        if "marker" in look:
            mark = dict(mew=stroke(1.8), zorder=6, clip_on=False)
            look = hollow(look["color"], look["marker"], 8.0, **mark)
        ax.plot(limit.B, positive(limit.K), label=label, **look)
    runs: Any = dict(ls="none", color=BLACK, ms=stroke(6), zorder=5, clip_on=False)
    how = "stability" if r.verdict == BY_GROWTH else "rest"
    ax.plot(r.B, _above(r.K, bottom), marker="o", label=f"runs: limit of {how}", **runs)
    if r.box:
        label = "runs with the worst hand"
        ax.plot(r.B, _above(r.box_K, bottom), marker="s", mfc=WHITE, label=label, **runs)


def _draw_family(ax: Axes, regions: Sequence[ZRegion]) -> None:
    """Runs and exact line of each region."""
    bottom = ax.get_ylim()[0]
    for i, r in enumerate(regions):
        look = curve_look(i)
        if r.linear:
            ax.plot(r.limits[0].B, positive(r.limits[0].K), **look)
        else:
            ax.plot(*_region_edge(r), lw=stroke(1.0), **look)
        color, fill = look["color"], WHITE if i % 2 else look["color"]
        marks = hollow(color, MARKS[i % len(MARKS)], 5, mfc=fill, clip_on=False, zorder=5)
        ax.plot(r.B, _above(r.K, bottom), label=r.name, color=color, **marks)


def _name_regions(ax: Axes, regions: Sequence[ZRegion]) -> None:
    """Labels each region beside its edge, at B = 0 or at its top, where the edges are separate."""
    places = {
        "left": [(r.B[0], r.K[0]) for r in regions],
        "top": [max(zip(r.B, r.K, strict=True), key=lambda p: p[1]) for r in regions],
    }

    def room(side: str) -> float:
        """Least distance of two edges there, as a share of the height."""
        at = ax.transAxes.inverted().transform(ax.transData.transform(places[side]))
        return min((b - a for a, b in pairwise(sorted(y for _, y in at))), default=1.0)

    if not all(K > 0.0 for _, K in places["left"]):
        places.pop("left")
    side = max(places, key=room)
    if room(side) < LABEL_ROOM:
        return  # the legend names them
    for i, (r, place) in enumerate(zip(regions, places[side], strict=True)):
        left, color = side == "left", curve_look(i)["color"]
        share = ax.transAxes.inverted().transform(ax.transData.transform(place))[0]
        beside = left or share < LABEL_SIDE
        ends = "left" if beside else "right" if share > 1.0 - LABEL_SIDE else "center"
        offset = stroke(7.0) if beside else 0.0, stroke(-5.0 if left else 6.0)
        look: Any = dict(color=color, fontsize=points(9.0), ha=ends, va="top" if left else "bottom")
        look["path_effects"] = [withStroke(linewidth=stroke(3.0), foreground=WHITE)]
        name = unit_text(r.name)
        ax.annotate(name, place, offset, textcoords="offset points", zorder=7, **look)


def _region_edge(r: ZRegion) -> tuple[list[float], list[float]]:
    """The edge of a region: the exact line if the loop is linear, else a line through the runs."""
    if r.linear and r.limits:
        return list(r.limits[0].B), list(r.limits[0].K)
    B, K = list(r.B), list(r.K)
    return (B, K) if math.isnan(r.most_B) else ([*B, r.most_B], [*K, 0.0])


def _above(K: Sequence[float], bottom: float) -> np.ndarray:
    """K of markers, kept above the axes."""
    return positive(np.where(np.asarray(K) >= bottom, K, np.nan))


def _set_axes(ax: Axes, regions: Sequence[ZRegion], walls: Sequence[VirtualWall] = ()) -> None:
    """Scales and limits for every run: logarithmic where values span much, with B = 0."""
    label_axes(ax, "virtual damping B [N.s/m]", "virtual stiffness K [N/m]")
    B = sorted({x for r in regions for x in r.B if x > 0.0} | {w.B for w in walls if w.B > 0.0})
    K = [x for r in regions for x in (*r.K, *r.box_K) if x > 0.0] + [w.K for w in walls]
    least = [x for r in regions for x in r.K[:1] if x > 0.0] + [w.K for w in walls if w.K]
    least += [x for r in regions if len(regions) == 1 for limit in r.limits for x in limit.K[:1]]
    top = max([*B, *(w.B for w in walls), *(r.largest_B for r in regions)], default=1.0)
    most = max(K, default=1.0)
    left = min(0.0, *(r.B[0] for r in regions), *(w.B for w in walls))
    near = any(0.0 < w.K < NEAR_ORIGIN * most for w in walls)
    if not B or left < 0.0 or (B[-1] < SPREAD * B[0] and not near):
        ax.set(xlim=(left, 1.05 * top if top > left else 1.0), ylim=(0.0, 1.1 * most))
        return
    first = max(B[0], SHOWN_SHARE * top)
    ax.set_xscale("symlog", linthresh=first, linscale=0.45)
    ax.set_xlim(0.0, 1.35 * top)
    powers = [10.0**n for n in range(math.ceil(math.log10(first)), math.floor(math.log10(top)) + 1)]
    ax.set_xticks([0.0, *(powers or [first])])
    ax.set_xticks([], minor=True)
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_yscale("log")
    ax.set_ylim(max(0.4 * min([*least, most]), SHOWN_SHARE * most), 2.0 * most)
    plain_ticks(ax)


def _device_parts(chart: ZWidth) -> list[str]:
    """Phrases for the title: the parts of the device common to all regions."""
    wall = as_wall(chart.regions[0].wall)
    parts = [text for name, text in wall.phrases().items() if name != chart.vary]
    rest = any(r.verdict != BY_GROWTH for r in chart.regions)
    still = f"rest within {chart.rest_words()}" if rest else ""
    return [*parts, hand_name(wall.subject.operator), still]
