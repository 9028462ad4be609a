"""The palette, the shading of clay, and the helpers that all figures share.

Colours are hex strings, as matplotlib takes them; `rgb` and `rgb_bytes` convert them for MuJoCo and
viser. Importing this module does not load matplotlib: the page, the window and the stage need the
palette alone.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..model.clay import Clay, Grid, Profile, Smooth
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
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}
TITLE_SIZE = 9.0  # [points]
TITLE_MARGIN = 0.9  # [inch] of a figure's width that a title cannot use: left of the axes
CLAY_ALPHA = 0.35  # of clay behind curves
HELD_COLOR, HELD_ALPHA = SKY_BLUE, 0.35  # time for which clay that yields holds the handle
SHADED_SPEED = 0.01  # [m/s] at which clays that yield are compared, about that of the paper's cut
SHADED_DENT = 1e-3  # [m] at which clays that spring back are


def rgb(color: str) -> tuple[float, float, float]:
    """Converts a hex colour to three numbers from 0 to 1.

    Args:
        color: such as "#0072B2".
    """
    r, g, b = rgb_bytes(color)
    return r / 255.0, g / 255.0, b / 255.0


def rgb_bytes(color: str) -> tuple[int, int, int]:
    """Converts a hex colour to three bytes.

    Args:
        color: such as "#0072B2".
    """
    r, g, b = bytes.fromhex(color.removeprefix("#"))
    return r, g, b


def clay_color(share: Any) -> np.ndarray:
    """Shades clay by how hard it is to cut.

    Args:
        share: damping over the largest damping of the scene, or as `clay_share` in clay that
            yields, 0 to 1, any shape.

    Returns:
        Red, green and blue from 0 to 1, shape (..., 3).
    """
    pale, deep = np.array(rgb(CLAY_PALE)), np.array(rgb(CLAY_DEEP))
    return pale + np.asarray(share)[..., None] ** 2 * (deep - pale)


def along_motion(v: np.ndarray, fe: np.ndarray, main: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed and force along the motion; at rest, 0 and all of the force.

    Both are negative where the motion, or at rest the force, is against the main axis.

    Args:
        v: velocity of the handle [m/s], shape (n, 2).
        fe: force of the clay [N], shape (n, 2).
        main: axis that tells forth from back, 0 or 1.

    Returns:
        Speed [m/s] and force [N], shape (n,) each.
    """
    speed, size = np.hypot(*v.T), np.hypot(*fe.T)
    still = speed == 0.0
    along = np.where(still, size, (fe * v).sum(axis=1) / np.where(still, 1.0, speed))
    back = np.where(np.where(still, fe[:, main], v[:, main]) < 0.0, -1.0, 1.0)
    return back * speed, back * along


def clay_share(clay: Clay, x: Any, y: Any) -> np.ndarray:
    """How hard clay is to cut at some places, over the hardest of the scene, growth aside.

    Along the harder axis: the damping, or in a scene with clay that yields or springs back the
    force at SHADED_SPEED and SHADED_DENT.

    Args:
        clay: of the scene.
        x: coordinates [m].
        y: the same along y.

    Returns:
        0 to 1, of the shape of x and y together.
    """
    if not (clay.yields or clay.springs):
        return clay.at(x, y).max(axis=0) / (clay.largest or 1.0)
    here, most = [], 0.0
    for law in clay.laws:
        if isinstance(law, Smooth):
            most = max(most, SHADED_SPEED * float(law.damping.max()))
            here.append(SHADED_SPEED * law.at(x, y))
        else:
            force = law_force(law)
            most = max(most, float(force.max()))
            here.append(force[law.index(x, y)])
    if clay.groove:
        (x0, x1), (y0, y1) = clay.groove.x, clay.groove.y
        inside = (np.asarray(x) >= x0) & (x <= x1) & (np.asarray(y) >= y0) & (y <= y1)
        force = clay.groove.hardest + SHADED_SPEED * clay.groove.thickest
        most = max(most, force)
        here.append(force * inside)
    return np.maximum.reduce(np.broadcast_arrays(*here)) / (most or 1.0)


def law_force(law: Profile | Grid) -> np.ndarray:
    """Force of each cell of a law at SHADED_SPEED and SHADED_DENT, growth aside [N].

    Args:
        law: of one axis.

    Returns:
        As `Grid.damping`.
    """
    (Fy, K, n), (k, limit, k1) = law.flows, np.moveaxis(law.elastic, -1, 0)[:3]
    springs = np.minimum(k * SHADED_DENT, limit) + k1 * SHADED_DENT
    return Fy + K * SHADED_SPEED**n + law.damping * SHADED_SPEED + springs


def verdict_color(text: str, unstable: bool) -> str:
    """Returns the colour behind a verdict on the loop.

    Args:
        text: the verdict.
        unstable: whether the arm swings with growing amplitude.
    """
    kind = "unstable" if unstable else "stable" if text.startswith("stable") else "other"
    return VERDICT_COLORS[kind]


def figure_style(**more: Any) -> Any:
    """Returns the context in which figures are drawn.

    Args:
        more: rcParams of matplotlib that differ from STYLE, dots written as underscores.
    """
    import matplotlib

    parameters: Any = {**STYLE, **{k.replace("_", ".", 1): v for k, v in more.items()}}
    return matplotlib.rc_context(parameters)


def set_title(ax: Axes, *parts: str, **more: Any) -> None:
    """Puts a title over the axes, in as many lines as keep it within the figure.

    Args:
        ax: the axes.
        parts: phrases, joined by commas; lines break between them.
        more: further arguments of `Axes.set_title`.
    """
    from matplotlib.textpath import TextPath

    figure: Any = ax.figure
    room = 72.0 * (figure.get_figwidth() - TITLE_MARGIN)
    lines = [parts[0]]
    for part in parts[1:]:
        longer = f"{lines[-1]}, {part}"
        if TextPath((0.0, 0.0), longer, size=TITLE_SIZE).get_extents().width <= room:
            lines[-1] = longer
        else:
            lines[-1] += ","
            lines.append(part)
    ax.set_title("\n".join(lines), fontsize=TITLE_SIZE, loc="left", color=GREY, **more)


def add_legend(figure: Figure, ax: Axes, ncols: int = 5, **more: Any) -> None:
    """Puts the legend of one of the axes above the figure.

    Args:
        figure: the figure.
        ax: the axes whose labels it lists.
        ncols: columns, at most.
        more: further arguments of `Figure.legend`.
    """
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=ncols, **more)


def hand_name(operator: Operator | None | tuple[Operator | None, Operator | None]) -> str:
    """Names the hand in a title.

    Args:
        operator: the hand, or one for each axis; None for no hand.
    """
    if operator is None or operator == (None, None):
        return "no hand"
    return "nominal hand" if operator == Operator() else "given hand"


def unit_text(text: str) -> str:
    """Typesets units: N.s/m with a centred dot, s^2 with an exponent.

    Args:
        text: that holds the units.
    """
    return text.replace("N.", "N$\\cdot$").replace("^2", "$^2$")


def shade_clay(ax: Axes, profile: Profile | None, axis: str) -> None:
    """Shades the intervals of the x axis that hold clay, darker where it is harder to cut.

    Args:
        ax: axes over the position along `axis` [cm].
        profile: of the clay; None for no clay.
        axis: "x" or "y"; a profile along the other axis is not shown.
    """
    if profile is None or profile.along != axis:
        return
    hard = profile.values
    if profile.yields or profile.springs:
        hard = tuple(law_force(profile).ravel().tolist())
    label, edges = "clay", (-1.0, *profile.edges, 1.0)
    for low, high, force in zip(edges, edges[1:], hard, strict=False):
        if force > 0.0:
            color = clay_color(force / max(hard))
            ax.axvspan(100.0 * low, 100.0 * high, color=color, alpha=CLAY_ALPHA, lw=0, label=label)
            label = "_"


def shade_held(ax: Axes, spans: Any) -> None:
    """Shades the times at which clay that yields held the handle.

    Args:
        ax: axes over the time [s].
        spans: (begin, end) of each [s].
    """
    bars = [(begin, end - begin) for begin, end in spans]
    if bars:
        across: Any = ax.get_xaxis_transform()
        look: Any = dict(color=HELD_COLOR, alpha=HELD_ALPHA, lw=0, label="held still", zorder=0.5)
        ax.broken_barh(bars, (0.0, 1.0), transform=across, **look)
