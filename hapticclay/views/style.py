"""The styles of figures, on a screen and in print: sizes, widths, text."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from contextvars import ContextVar
from typing import Any, NamedTuple

from ..errors import choice
from .palette import PALE_GREY

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
LEAST_TEXT = 6.0  # [points] legible in print


class Look(NamedTuple):
    """Parameters of a style."""

    parameters: Any  # rcParams of matplotlib
    width: float | None  # [inch] of every figure; None where each has its own
    scale: float  # of heights, strokes and text, against the screen's
    dpi: float  # of pictures made of pixels [1/inch]


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


@contextlib.contextmanager
def figure_style(**more: Any) -> Iterator[None]:
    """Context, or decorator of a function, in which figures are drawn in the current style.

    Settings of the user (matplotlibrc, a style sheet) do not change them: the same run gives the
    same files on every machine.
    """
    from matplotlib import style

    parameters: Any = {**look().parameters, **{k.replace("_", ".", 1): v for k, v in more.items()}}
    with style.context(["default", parameters]):
        yield
