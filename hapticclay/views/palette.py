"""The palette, and the colours of clay and of verdicts.

Colours are hex strings, as matplotlib takes them; `rgb` and `rgb_bytes` convert them for MuJoCo and
viser. The page, the window and the stage need no more than this.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model.clay import Clay

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
CLAY_ALPHA = 0.35  # of clay behind curves
UNSTABLE: Any = dict(  # where the linear loop of a run is unstable
    facecolor="none", hatch="\\\\\\", linewidth=0.0, edgecolor=BLACK, label="gain margin < 1"
)
SHADED = 0.01, 1e-3  # speed [m/s], about that of the paper's cut, and indentation [m] of shades


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
