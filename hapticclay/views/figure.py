"""A figure as an object: its drawing, its numbers and its files."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import ParameterError, choice, number
from ..files import atomic
from . import style as styles
from .captions import plain_text

if TYPE_CHECKING:
    import matplotlib.figure

Table = Mapping[str, Sequence[Any]]  # columns by name and unit, "K [N/m]", of equal length
FORMATS = ("png", "svg", "pdf")
UNDATED: dict[str, Any] = {"svg": {"Date": None}, "pdf": {"CreationDate": None}, "png": None}


class Figure:
    """A figure that can be drawn in every style, with the numbers that it shows.

    Args:
        draw: returns the matplotlib figure in the current style (`style.figure_style`), or None if
            it does not apply.
        tables: the numbers by name of table, and by name and unit of column; or a function that
            returns them, called on demand; None for the drawn curves.
    """

    def __init__(
        self,
        draw: Callable[[], matplotlib.figure.Figure | None],
        tables: Mapping[str, Table] | Callable[[], Mapping[str, Table]] | None = None,
    ):
        self._draw = draw
        self._tables = tables

    def draw(self, style: str = "screen") -> matplotlib.figure.Figure | None:
        """Draws the figure.

        Args:
            style: "screen", "print" (8.5 cm wide) or "print-wide" (17.5 cm).

        Raises:
            ParameterError: there is no such style.
        """
        with styles.styled(style):
            figure = self._draw()
            if figure is not None:
                figure.draw_without_rendering()  # makes its ticks, in this style
            return figure

    def tables(self) -> Mapping[str, Table]:
        """Returns the numbers that the figure shows, by table and column."""
        if self._tables is not None:
            return self._tables() if callable(self._tables) else self._tables
        with styles.styled("screen"):
            figure = self._draw()
            return {} if figure is None else curves_drawn(figure)

    def save(
        self,
        path: str | Path,
        formats: Sequence[str] = (),
        dpi: float | None = None,
        style: str = "screen",
        data: bool = False,
    ) -> list[Path]:
        """Writes the figure, each file whole or not at all, after all files are rendered.

        Args:
            path: the file; its ending gives the format unless `formats` does.
            formats: of "png", "svg" and "pdf"; path is then without an ending. Without both it is
                "png".
            dpi: pixels per inch of PNG files and of embedded pictures [1/inch]; None for that of
                the style, 100 on a screen and 300 in print.
            style: "screen", "print" (8.5 cm wide) or "print-wide" (17.5 cm).
            data: whether to write the numbers too: the first table as PATH.csv, each other one as
                PATH-TABLE.csv.

        Returns:
            The files written; none if the figure does not apply.

        Raises:
            ParameterError: an unknown format or style, dpi out of bounds, no numbers to write, or
                a file that cannot be written.
        """
        path = Path(path)
        if not formats and path.suffix:
            formats, path = (path.suffix[1:],), path.with_suffix("")
        kinds = [choice("format", kind, FORMATS) for kind in dict.fromkeys(formats or ("png",))]
        if dpi is not None:
            number("dpi", dpi, 10.0, 2400.0)
        with styles.styled(style) as look:
            figure = self._draw()
            if figure is None:
                return []
            files = {
                f"{path.name}.{kind}": _encoded(figure, kind, dpi or look.dpi) for kind in kinds
            }
        if data:
            tables = self.tables()
            if not tables:
                raise ParameterError("data", data, f"{path.name} has no numbers to write")
            for i, (name, table) in enumerate(tables.items()):
                stem = f"{path.name}-{name}" if i else path.name
                files[f"{stem}.csv"] = csv_text(table).encode()
        written = []
        for name, content in files.items():
            with atomic(path.parent / name) as f:
                f.write(content)
            written.append(path.parent / name)
        return written

    def svg(self, style: str = "screen") -> str:
        """Returns the figure as the text of an SVG file, empty if it does not apply.

        Args:
            style: as in `draw`.
        """
        return self._bytes("svg", style).decode()

    def png(self, style: str = "screen") -> bytes:
        """Returns the figure as a PNG file, empty if it does not apply.

        Args:
            style: as in `draw`.
        """
        return self._bytes("png", style)

    def _bytes(self, kind: str, style: str) -> bytes:
        with styles.styled(style) as look:
            figure = self._draw()
            return b"" if figure is None else _encoded(figure, kind, look.dpi)

    def _repr_svg_(self) -> str | None:
        return self.svg() or None


def _encoded(figure: matplotlib.figure.Figure, kind: str, dpi: float) -> bytes:
    """As `Figure.savefig` of matplotlib, to the byte; that draws all once more, for its layout."""
    from matplotlib.backends import backend_agg, backend_pdf, backend_svg

    canvases: Any = {
        "png": backend_agg.FigureCanvasAgg,
        "svg": backend_svg.FigureCanvasSVG,
        "pdf": backend_pdf.FigureCanvasPdf,
    }
    data, canvas_before, dpi_before = io.BytesIO(), figure.canvas, figure.dpi
    canvas = canvases[kind](figure)
    try:
        figure.dpi = dpi
        getattr(canvas, f"print_{kind}")(data, metadata=UNDATED[kind])
    finally:
        figure.dpi = dpi_before
        figure.set_canvas(canvas_before)
    return data.getvalue()


def curves_drawn(figure: matplotlib.figure.Figure) -> dict[str, Table]:
    """One table per panel: curve, and x and y under the labels of their axes."""
    out: dict[str, Table] = {}
    axes: Any = figure.axes
    for ax in axes:
        curves = [x for x in ax.lines if x.get_transform() == ax.transData]  # axhline is none
        curves = [x for x in curves if all(map(len, x.get_data()))]
        if not curves:
            continue
        x_name, y_name = plain_text(ax.get_xlabel()) or "x", plain_text(ax.get_ylabel()) or "y"
        names = [str(x.get_label()) for x in curves]
        names = [f"curve {i}" if n.startswith("_") else n for i, n in enumerate(names, 1)]
        xy = [x.get_xydata() for x in curves]
        x, y = np.concatenate(xy).T.tolist()
        out[f"panel{len(out) + 1}"] = {
            "curve": np.repeat(names, [len(each) for each in xy]).tolist(),
            x_name: x,
            y_name if y_name != x_name else f"{y_name} (y)": y,
        }
    return out


def csv_text(table: Table) -> str:
    """Returns a table as CSV; numbers read back bit-identically."""
    lengths = {name: len(column) for name, column in table.items()}
    if len(set(lengths.values())) > 1:
        raise ParameterError("table", lengths, "must have columns of equal length")
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(table)
    writer.writerows(
        zip(*([_as_written(x) for x in column] for column in table.values()), strict=True)
    )
    return out.getvalue()


def _as_written(x: Any) -> Any:
    x = x.item() if hasattr(x, "item") else x
    return repr(x) if isinstance(x, float) else "" if x is None else x
