"""The look of every picture: palette, text, the shading of clay."""

from __future__ import annotations

from typing import Any

BLUE, ORANGE, GREEN, BLACK = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#222222",
)  # Okabe and Ito, safe for all eyes
CLAY, GREY = "#E8C9A8", "#555555"
STYLE: Any = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.6,
    "legend.frameon": False,
    "savefig.dpi": 160,
    "figure.constrained_layout.use": True,
}
