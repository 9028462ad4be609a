"""What figures are built of: panels, titles and legends that fit, ticks, marks, levels."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.cbook import is_math_text
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path
from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullFormatter

from .captions import unit_text
from .palette import BLACK, BLUE, CURVE_STYLES, GREY, SKY_BLUE, VERMILION, WHITE
from .style import figure_size, look, panel_grid, points, stroke

LOG_SPAN = 30.0  # a scale is logarithmic where its values span more
TITLE_SIZE = 9.0  # [points] on a screen
TITLE_MARGIN = 0.9  # [inch] of a figure's width that a title cannot use: left of the axes
MARKS = "osD^vPX"


def single(height: float, width: float | None = None) -> tuple[Figure, Axes]:
    """A figure of one panel, one column wide; sizes are those on a screen [inch]."""
    figure = Figure(figsize=figure_size(1, height, width))
    return figure, figure.add_subplot()


def stacked(count: int, height: float, sharex: bool = True) -> tuple[Figure, list[Axes]]:
    """A figure of panels one over another."""
    figure = Figure(figsize=figure_size(1, height))
    axes = list(figure.subplots(count, 1, sharex=sharex, squeeze=False)[:, 0])
    figure.align_ylabels(axes)
    return figure, axes


def side_by_side(
    count: int, height: float, width: float | None = None
) -> tuple[Figure, list[Axes]]:
    """A figure of panels in a row, or in one printed column stacked; each has the height."""
    rows, columns = panel_grid(count)
    figure = Figure(figsize=figure_size(min(columns, 2), height * rows, width))
    return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def label_axes(ax: Axes, x: str = "", y: str = "") -> None:
    """Labels the axes, with typeset units."""
    ax.set(xlabel=unit_text(x or ax.get_xlabel()), ylabel=unit_text(y or ax.get_ylabel()))


def set_title(ax: Axes, *parts: str, panel: bool = False, **more: Any) -> None:
    """Puts a title over the axes, in as many lines as keep it within the figure.

    In print only titles that distinguish panels are drawn; the caption has the rest.
    """
    if look().width is not None and not panel:
        return
    size, families = points(TITLE_SIZE), tuple(rcParams["font.family"])
    room = 72.0 * (ax.figure.get_figwidth() - stroke(TITLE_MARGIN))  # type: ignore[union-attr]

    def fits(text: str) -> bool:
        return _width(text.removesuffix(","), size, families) <= room

    lines = [""]
    for phrase in unit_text(",\0".join(x for x in parts if x)).split("\0"):
        for piece in [phrase] if fits(phrase) else phrase.split(" "):
            if lines[-1] and not fits(f"{lines[-1]} {piece}"):
                lines.append("")
            lines[-1] = f"{lines[-1]} {piece}".lstrip()
    ax.set_title("\n".join(lines), fontsize=size, loc="left", color=GREY, **more)


@functools.lru_cache(maxsize=4096)  # the figures of a run share phrases
def _width(text: str, size: float, families: tuple[str, ...]) -> float:
    """Width of a text [pt], in the first of the font families that there is."""
    font = FontProperties(family=list(families), size=size)
    return text_to_path.get_text_width_height_descent(text, font, is_math_text(text))[0]


def add_legend(figure: Figure, ncols: int = 5, handles: Iterable[Any] = (), **more: Any) -> None:
    """Puts a legend above the figure, in as many columns as fit: of its curves, or of handles."""
    entries = {h.get_label(): h for h in handles}
    for ax in figure.axes if not entries else ():
        for handle, label in zip(*ax.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    more |= {"handles": [*entries.values()], "labels": [unit_text(str(x)) for x in entries]}
    for columns in range(ncols, 0, -1):
        if columns > 1 and -(-len(entries) // columns) == -(-len(entries) // (columns - 1)):
            continue  # as many rows with a column less: rows of even length
        legend = figure.legend(loc="outside upper center", ncols=columns, **more)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            break
        legend.remove()


def plain_ticks(ax: Axes) -> None:
    """Labels logarithmic axes with plain numbers, two of them at least.

    The numbers are powers of ten; powers of ten times 1, 2 and 5, or on a very short axis more, if
    it spans few decades; or evenly spaced numbers if it holds fewer than two of these.
    """
    for axis, few in ((ax.xaxis, 100.0), (ax.yaxis, 1000.0)):
        if axis.get_scale() != "log":
            continue
        low, high = sorted(axis.get_view_interval())
        ratio = high / low
        subs = (1, 2, 3, 5, 7) if ratio < 16.0 else (1, 2, 5) if ratio < few else (1,)
        locator: Any = LogLocator(subs=subs)
        if sum(low <= x <= high for x in locator.tick_values(low, high)) < 2:
            locator = MaxNLocator(5)
        axis.set_major_locator(locator)
        axis.set_major_formatter(FormatStrFormatter("%g"))
        axis.set_minor_formatter(NullFormatter())


def spans_decades(values: Any) -> bool:
    """Whether positive values span so much that their scale is logarithmic."""
    values = np.asarray(values)
    return bool(len(values) > 1 and values.min() > 0.0 and values.max() > LOG_SPAN * values.min())


def positive(values: Any) -> np.ndarray:
    """Values with a gap where there is none above zero: limits that do not exist, infinite ones."""
    values = np.asarray(values, dtype=float)
    return np.where(np.isfinite(values) & (values > 0.0), values, np.nan)


def level(ax: Axes, y: float = 0.0) -> None:
    """Draws a thin line across the axes."""
    ax.axhline(y, color=BLACK, lw=stroke(0.8), zorder=1.6)  # over the grid


def curve_look(i: int) -> dict[str, Any]:
    """Colour and dashes of the i-th curve."""
    color, dash = CURVE_STYLES[i % len(CURVE_STYLES)]
    return {"color": color, "ls": dash}


def hollow(edge: str = BLUE, marker: str = "o", size: float = 6.0, **more: Any) -> dict[str, Any]:
    """Look of marks, which are runs and measurements, over lines, which are theory."""
    look = {"ls": "none", "marker": marker, "ms": stroke(size), "mfc": WHITE, "mec": edge}
    return look | {"mew": stroke(1.2), "zorder": 4} | more


def ring(color: str = VERMILION, size: float = 13.0) -> dict[str, Any]:
    """Look of rings around marks."""
    return hollow(color, "o", size, mfc="none", mew=stroke(1.5))


def mark(ax: Axes, places: Iterable[Any], **look: Any) -> None:
    """Marks places (x, y), if there are any."""
    if places := list(places):
        look.setdefault("ls", "none")
        ax.plot(*zip(*places, strict=True), **look)


def cell_edges(values: np.ndarray, log: bool) -> np.ndarray:
    """Borders of the cells of a map around values: half way between them, on the axis's scale."""
    if len(values) == 1:
        return values[0] + np.array([-0.5, 0.5]) * (abs(values[0]) or 1.0) * 0.1
    v = np.log(values) if log else values
    middle = 0.5 * (v[1:] + v[:-1])
    edges = np.concatenate(([2.0 * v[0] - middle[0]], middle, [2.0 * v[-1] - middle[-1]]))
    return np.exp(edges) if log else edges


def map_axes(ax: Axes, low: Sequence[float], high: Sequence[float]) -> None:
    """Axes of a map of the workspace to scale, between two corners [cm]."""
    ax.set(xlabel="position x [cm]", ylabel="position y [cm]", aspect="equal")
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    ax.grid(False)


def draw_path(ax: Axes, p: np.ndarray, name: str, width: float = 1.6) -> None:
    """Draws the path of the handle [cm], its start and its end."""
    ax.plot(*p.T, color=BLUE, lw=stroke(width), label=name)
    ax.plot(*p[0], "o", color=BLUE, ms=stroke(5), label="start")
    ax.plot(*p[-1], "s", color=BLUE, ms=stroke(5), label="end")


def shade_held(ax: Axes, spans: Iterable[tuple[float, float]]) -> None:
    """Shades the times (begin, end) at which yielding clay held the handle."""
    if bars := [(begin, end - begin) for begin, end in spans]:
        across: Any = ax.get_xaxis_transform()
        look: Any = {"color": SKY_BLUE, "alpha": 0.35, "lw": 0, "label": "held still"}
        ax.broken_barh(bars, (0.0, 1.0), transform=across, zorder=0.5, **look)
