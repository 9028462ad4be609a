"""The palette, the shading of clay, and the helpers that all figures share.

Colours are hex strings, as matplotlib takes them; `rgb` and `rgb_bytes` convert them for MuJoCo and
viser. Importing this module does not load matplotlib: the page, the window and the stage need the
palette alone.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import choice
from ..model.clay import Clay
from ..model.operator import Operator

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito (2008), distinct under every form of colour blindness
BLUE, VERMILION, GREEN, ORANGE = "#0072B2", "#D55E00", "#009E73", "#E69F00"
PURPLE, SKY_BLUE, YELLOW = "#CC79A7", "#56B4E9", "#F0E442"
BLACK, WHITE = "#222222", "#FFFFFF"
GREY, MID_GREY, LIGHT_GREY, PALE_GREY = "#555555", "#888888", "#BBBBBB", "#E6E6E6"
CURVE_STYLES: tuple[tuple[str, Any], ...] = (
    (BLUE, "-"),
    (VERMILION, "--"),
    (GREEN, "-."),
    (PURPLE, (0, (1, 1))),
    (ORANGE, (0, (5, 1, 1, 1, 1, 1))),
)
FORCE_COLORS = {  # whose force, along which axis; the window's titles name the colours
    ("hand", 0): GREEN,
    ("clay", 0): BLUE,
    ("hand", 1): ORANGE,
    ("clay", 1): VERMILION,
}
COLOR_NAMES = {GREEN: "green", BLUE: "blue", ORANGE: "orange", VERMILION: "red"}
VERDICT_COLORS = {"unstable": "#C92A2A", "stable": "#0D6B52", "other": "#B86B00"}  # under white
PART_COLORS = {"dark": "#38404A", "steel": "#B2BAC4", "blue": BLUE, "orange": VERMILION}
TABLE, GRID, SKY = "#CDD3D8", "#B4BCC4", ("#ECF0F5", "#D6DCE4")  # of the page, as in room.xml
CLAY_PALE, CLAY_DEEP = "#DEA884", "#BA643E"  # clay of the least and of the largest damping
STYLE: Any = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": PALE_GREY,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "pdf.fonttype": 42,  # text stays text, its fonts within the file; journals refuse type 3
    "svg.fonttype": "path",  # text drawn as outlines: identical without the font
    "svg.hashsalt": "hapticclay",  # the same figure gives the same file
}
PRINT: Any = STYLE | {
    "font.size": 7.5,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "lines.linewidth": 1.0,
    "lines.markersize": 4.0,
    "axes.linewidth": 0.6,
    "axes.labelpad": 2.0,
    "axes.titlepad": 4.0,
    "grid.linewidth": 0.4,
    "hatch.linewidth": 0.6,
    **{f"{side}tick.{kind}.width": 0.5 for side in "xy" for kind in ("major", "minor")},
    **{f"{side}tick.major.{what}": 2.5 for side in "xy" for what in ("size", "pad")},
    **{f"{side}tick.minor.size": 1.5 for side in "xy"},
    "legend.handlelength": 1.8,
    "legend.columnspacing": 1.2,
    "legend.labelspacing": 0.35,
    "figure.constrained_layout.w_pad": 0.03,
}
SCREEN_WIDTHS = {1: 6.4, 2: 9.6}  # [inch] of figures of one and of two columns
LOG_SPAN = 30.0  # a scale is logarithmic where its values span more
LEAST_TEXT = 6.0  # [points] legible in print
TITLE_SIZE = 9.0  # [points] on a screen
TITLE_MARGIN = 0.9  # [inch] of a figure's width that a title cannot use: left of the axes
CLAY_ALPHA = 0.35  # of clay behind curves
HELD_COLOR, HELD_ALPHA = SKY_BLUE, 0.35  # time for which clay that yields holds the handle
UNSTABLE: Any = dict(  # where the linear loop of a run is unstable
    facecolor="none", hatch="\\\\\\", linewidth=0.0, edgecolor=BLACK, label="gain margin < 1"
)
SHADED = 0.01, 1e-3  # speed [m/s], about that of the paper's cut, and indentation [m] of shades


class Look(NamedTuple):
    """Parameters of a style.

    Attributes:
        parameters: rcParams of matplotlib.
        width: of every figure [inch]; None where each has its own.
        scale: of heights, and of sizes that a figure states, against the screen's.
        dpi: of pictures made of pixels [1/inch].
    """

    parameters: Any
    width: float | None
    scale: float
    dpi: float


STYLES = {
    "screen": Look(STYLE, None, 1.0, 100.0),
    "print": Look(PRINT, 8.5 / 2.54, 0.75, 300.0),  # one column of a journal
    "print-wide": Look(PRINT, 17.5 / 2.54, 0.75, 300.0),  # two columns
}
_STYLE: ContextVar[str] = ContextVar("style", default="screen")


@contextlib.contextmanager
def styled(style: str) -> Iterator[Look]:
    """Context in which figures are drawn and saved in a style."""
    before = _STYLE.set(choice("style", style, tuple(STYLES)))
    try:
        with figure_style():
            yield STYLES[style]
    finally:
        _STYLE.reset(before)


def look() -> Look:
    """Returns the current look of figures."""
    return STYLES[_STYLE.get()]


def narrow() -> bool:
    """Whether figures are one printed column wide, so that panels are stacked."""
    return _STYLE.get() == "print"


def figure_size(columns: int, height: float, width: float | None = None) -> tuple[float, float]:
    """Returns the size of a figure in the current style, for `figsize` [inch]."""
    now = look()
    return now.width or width or SCREEN_WIDTHS[columns], now.scale * height


def map_size(across: float, least: float, ratio: float) -> tuple[float, float]:
    """Returns the size of a figure of a map to scale, in the current style [inch]."""
    width, scale = figure_size(1, 1.0)
    across *= width / SCREEN_WIDTHS[1]
    return width, min(max(across * ratio, scale * least) + 1.3 * scale, width)


def panel_grid(count: int) -> tuple[int, int]:
    """Returns rows and columns of some panels: side by side, or in one printed column stacked."""
    return (count, 1) if narrow() else (1, count)


def points(size: float) -> float:
    """Returns a size of text in the current style [points]."""
    return size if _STYLE.get() == "screen" else max(LEAST_TEXT, look().scale * size)


def stroke(size: float) -> float:
    """Returns a line width or marker size in the current style [points]."""
    return look().scale * size


def map_edges(values: np.ndarray, log: bool) -> np.ndarray:
    """Borders of the cells of a map around values: half way between them."""
    v = np.log(values) if log else values
    middle = 0.5 * (v[1:] + v[:-1])
    edges = np.concatenate(([2.0 * v[0] - middle[0]], middle, [2.0 * v[-1] - middle[-1]]))
    return np.exp(edges) if log else edges


def rgb(color: str) -> tuple[float, float, float]:
    """Converts a hex colour to three numbers from 0 to 1."""
    r, g, b = rgb_bytes(color)
    return r / 255.0, g / 255.0, b / 255.0


def rgb_bytes(color: str) -> tuple[int, int, int]:
    """Converts a hex colour to three bytes."""
    r, g, b = bytes.fromhex(color.removeprefix("#"))
    return r, g, b


def clay_color(share: Any) -> np.ndarray:
    """Colour of clay by cutting force."""
    pale, deep = np.array(rgb(CLAY_PALE)), np.array(rgb(CLAY_DEEP))
    return pale + np.asarray(share)[..., None] ** 2 * (deep - pale)


def along_motion(v: np.ndarray, fe: np.ndarray, main: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed and force along the motion; at rest, 0 and all of the force.

    Both are negative where the motion, or at rest the force, is against the main axis.
    """
    speed, size = np.hypot(*v.T), np.hypot(*fe.T)
    still = speed == 0.0
    along = np.where(still, size, (fe * v).sum(axis=1) / np.where(still, 1.0, speed))
    back = np.where(np.where(still, fe[:, main], v[:, main]) < 0.0, -1.0, 1.0)
    return back * speed, back * along


def clay_share(clay: Clay, x: Any, y: Any) -> np.ndarray:
    """Cutting force of clay at given places relative to the hardest of the scene, growth aside.

    It is the force along the harder axis, at the same speed and indentation for all clay.
    """
    x, y = np.asarray(x), np.asarray(y)
    here = [law.forces_at(clay.kinds, x, y, *SHADED) for law in clay.laws]
    here += [block.at_speed(SHADED[0]) * block.holds(x, y) for block in clay.blocks]
    return np.maximum.reduce(np.broadcast_arrays(*here)) / (cutting_force(clay) or 1.0)


def cutting_force(clay: Clay) -> float:
    """Force on a tool that moves slowly through the hardest clay, growth aside [N]."""
    laws = [float(law.forces(clay.kinds, *SHADED).max()) for law in clay.laws]
    return max(*laws, *(block.at_speed(SHADED[0]) for block in clay.blocks))


def verdict_color(text: str, unstable: bool) -> str:
    """Returns the colour behind a verdict on the loop."""
    kind = "unstable" if unstable else "stable" if text.startswith("stable") else "other"
    return VERDICT_COLORS[kind]


def figure_style(**more: Any) -> Any:
    """Returns the context in which figures are drawn: matplotlib's defaults, and ours on top.

    Settings of the user (matplotlibrc, a style sheet) do not change them: the same run gives the
    same files on every machine.
    """
    from matplotlib import style

    parameters: Any = {**look().parameters, **{k.replace("_", ".", 1): v for k, v in more.items()}}
    return style.context(["default", parameters])


def set_title(ax: Axes, *parts: str, panel: bool = False, **more: Any) -> None:
    """Puts a title over the axes, in as many lines as keep it within the figure.

    In print only titles that distinguish panels are drawn; the caption has the rest.
    """
    from matplotlib import rcParams

    if _STYLE.get() != "screen" and not panel:
        return
    figure, size = ax.figure, points(TITLE_SIZE)
    room = 72.0 * (figure.get_figwidth() - stroke(TITLE_MARGIN))  # type: ignore[union-attr]
    families = tuple(rcParams["font.family"])

    def fits(text: str) -> bool:
        return _width(text, size, families) <= room

    lines: list[str] = []
    for i, part in enumerate(parts):
        part += "," * (i < len(parts) - 1)
        if lines and fits(f"{lines[-1]} {part}".removesuffix(",")):
            lines[-1] += f" {part}"
            continue
        lines.append("")
        for word in part.split(" ") if not fits(part.removesuffix(",")) else [part]:
            longer = f"{lines[-1]} {word}".lstrip()
            if lines[-1] and not fits(longer):
                lines.append(word)
            else:
                lines[-1] = longer
    ax.set_title("\n".join(lines), fontsize=size, loc="left", color=GREY, **more)


@functools.lru_cache(maxsize=4096)  # the figures of a run share phrases
def _width(text: str, size: float, families: tuple[str, ...]) -> float:
    """Width of a text [pt], in the first of the font families that there is."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    font = FontProperties(family=list(families))
    return TextPath((0.0, 0.0), text, size=size, prop=font).get_extents().width


def add_legend(figure: Figure, ax: Axes | None, ncols: int = 5, **more: Any) -> None:
    """Puts the legend of one of the axes above the figure, in as many columns as fit into it."""
    if ax is not None:
        more["handles"], more["labels"] = ax.get_legend_handles_labels()
    count = len(more["handles"])
    for columns in range(ncols, 0, -1):
        if columns > 1 and -(-count // columns) == -(-count // (columns - 1)):
            continue  # as many rows with a column less: rows of even length
        legend = figure.legend(loc="outside upper center", ncols=columns, **more)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            break
        legend.remove()


def plain_ticks(axis: Any) -> None:
    """Labels a logarithmic axis with plain numbers, two of them at least.

    The numbers are powers of ten; powers of ten times 1, 2 and 5 if the axis spans less than two
    decades; or evenly spaced numbers if it holds fewer than two of these.
    """
    from matplotlib.ticker import FormatStrFormatter, LogLocator, MaxNLocator, NullFormatter

    low, high = sorted(axis.get_view_interval())
    some = (1.0, 2.0, 5.0) if high < 100.0 * low else (1.0,)
    locator: Any = LogLocator(subs=some)
    if sum(low <= x <= high for x in locator.tick_values(low, high)) < 2:
        locator = MaxNLocator(5)
    axis.set_major_locator(locator)
    axis.set_major_formatter(FormatStrFormatter("%g"))
    axis.set_minor_formatter(NullFormatter())


def hand_name(operator: Operator | None | tuple[Operator | None, Operator | None]) -> str:
    """Names the hand in a title."""
    if operator is None or operator == (None, None):
        return "no hand"
    return "nominal hand" if operator == Operator() else "given hand"


def unit_text(text: str) -> str:
    """Typesets units: N.s/m with a centred dot, s^2 with an exponent."""
    return text.replace("N.", "N$\\cdot$").replace("^2", "$^2$")


def shade_clay(ax: Axes, edges: Sequence[float], forces: Sequence[float]) -> None:
    """Shades the intervals of the x axis with clay, darker where it is harder to cut."""
    label, edges = "clay", (-1.0, *edges, 1.0)
    for low, high, force in zip(edges, edges[1:], forces, strict=False):
        if force > 0.0:
            color = clay_color(force / max(forces))
            ax.axvspan(100.0 * low, 100.0 * high, color=color, alpha=CLAY_ALPHA, lw=0, label=label)
            label = "_"


def shade_held(ax: Axes, spans: Any) -> None:
    """Shades the times at which yielding clay held the handle."""
    bars = [(begin, end - begin) for begin, end in spans]
    if bars:
        across: Any = ax.get_xaxis_transform()
        look: Any = dict(color=HELD_COLOR, alpha=HELD_ALPHA, lw=0, label="held still", zorder=0.5)
        ax.broken_barh(bars, (0.0, 1.0), transform=across, **look)
