"""The report of `hapticclay reproduce`: all figures and numbers of the paper, with ours."""

from __future__ import annotations

import base64
import functools
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import views
from ..display import fields_of
from ..files import atomic, versions
from ..model.constants import B_CONSTANT, B_STABILITY, GAINS_FIG11
from ..model.operator import Operator
from ..results import with_schema, write_json
from ..studies import workspace
from ..studies.chart import Chart
from ..views.chart_plots import chart_plot
from ..views.figure import Figure
from . import claims
from .classics.classic import CLASSIC_STATUSES, Classic, Found
from .ledger import STATUSES, Row, Runs

TEMPLATES = Path(__file__).parent / "templates"
THE_PAPER = {
    "heading": "The paper, reproduced",
    "citation": "M.-G. Her, K.-S. Hsu, T.-S. Lan, M. Karkoub, Haptic Direct-Drive Robot Control "
    "Scheme in Virtual Reality, Journal of Intelligent and Robotic Systems 35 (2002) 247-264",
    "notes": (),
}
WIDE = 7.0  # [inch] wider figures have panels side by side and span both columns of the page


@dataclass(frozen=True)
class Picture:
    """A figure of the report."""

    name: str  # name of the file
    title: str
    caption: str
    draw: Callable[[Runs], Any]  # draws the figure from the runs of the ledger
    # data of the paper's figure to compare with ours; its curves are not reproduced
    paper: str = ""
    quick: bool = True  # whether the quick report includes it


def _identified(runs: Runs, what: str) -> Any:
    axes = "x" if what == "Th" else "xy"
    return views.identification_plots.identification_plot(
        [runs.identified(what, axis) for axis in axes]
    )


def _readings(runs: Runs) -> Any:
    names = ("none", "0.15/s", "30/s", "0.15/sample")
    return views.run_plots.readings_plot({name: runs.variable(name) for name in names})


def _maneuver(runs: Runs, over: str) -> Any:
    return views.run_plots.maneuver_plot([runs.stability(K) for K in GAINS_FIG11], over=over)


def _nyquist(axis: str, gains: tuple[float, ...], operator: Operator | None) -> Any:
    return views.theory_plots.nyquist_plot(axis, B_STABILITY, gains, operator=operator)


PICTURES = (
    Picture(
        "fig04",
        "Fig. 4: closed position loop G",
        "Response of the simulated arm to position commands, and Eqs. 15 and 16.",
        lambda r: _identified(r, "G"),
        "the fitted curve, Eqs. 15 and 16, is drawn; the measured points are not available.",
    ),
    Picture(
        "fig05",
        "Fig. 5: sensitivity Sh",
        "Response of the simulated arm to forces at the handle, and Eqs. 17 and 18.",
        lambda r: _identified(r, "S"),
        "the fitted curve, Eqs. 17 and 18, is drawn; the measured points are not available.",
    ),
    Picture(
        "fig06",
        "Fig. 6: operator's arm Th",
        "Hand force over handle position, and Eq. 19.",
        lambda r: _identified(r, "Th"),
        "the fitted curve, Eq. 19, is drawn, and its crossover near 3 rad/s is in the table; the "
        "points measured on three operators are not available.",
    ),
    Picture(
        "fig07",
        "Fig. 7: path of the constant cut",
        "Straight through the slab. Without inertia shaping the arm pulls the handle aside by less "
        "than a millimetre.",
        lambda r: views.path_plots.path_plot(r.constant()),
        "the slab is drawn as printed, 10 cm long from 5 cm on; the path is not available.",
    ),
    Picture(
        "fig08a",
        "Fig. 8, top: velocity over position",
        "The speed is K f/(10 + K b) in the clay and ten times that outside.",
        lambda r: views.run_plots.velocity_plot(r.constant()),
        "the speed is called approximately constant, without a number; the curve is not available. "
        "The level drawn follows from the printed K, b and force.",
    ),
    Picture(
        "fig08b",
        "Fig. 8, bottom: force over velocity",
        "The clay's share is b inside the slab and zero outside; the operator also feels 10/K, the "
        "compensator's own damping.",
        lambda r: views.run_plots.force_ratio_plot(r.constant()),
        "the table and the levels drawn have the printed 90 N·s/m in the clay and about zero "
        "outside; the curve is not available.",
    ),
    Picture(
        "fig09",
        "Fig. 9: path of the variable cut",
        "Clay of 50 N·s/m up to 5 cm on each axis and of 100 N·s/m beyond, growing in x.",
        lambda r: views.path_plots.path_plot(r.variable()),
        "the borders of the clay are drawn as printed: 5 cm on both axes, 50 and 100 N·s/m; the "
        "path is not available.",
    ),
    Picture(
        "fig10",
        "Fig. 10: velocity of the variable cut",
        "The velocity is constant up to 5 cm, drops abruptly there, and then decreases slowly in x "
        "while the clay grows by 30 N·s/m each second.",
        lambda r: views.run_plots.velocity_plot(r.variable(), "xy"),
        "the text says constant, an abrupt drop at 5 cm and a slow decrease; the table puts a "
        "number on each. The curve is not available.",
    ),
    Picture(
        "fig10_printed",
        "Fig. 10 with K = 1 on both axes, as printed",
        "The printed model is unstable in y. The run ends once the instability is certain.",
        lambda r: views.run_plots.velocity_plot(r.variable(as_printed=True), "xy"),
        "the figure shows a steady cut with these gains, which Eqs. 16 and 18 rule out.",
    ),
    Picture(
        "readings",
        "Readings of the growth",
        "The printed growth of the clay can be read in three ways. Each gives another speed in x.",
        _readings,
    ),
    Picture(
        "fig11a",
        "Fig. 11: force during a maneuver, over time",
        "Below the gain limit the force follows the muscle. Far above it the motor torques swing "
        "between their limits.",
        lambda r: _maneuver(r, "time"),
        "the gains are 3 and 25 in the text, 2 and 25 in the caption. The table puts numbers on "
        "the words irregular and much smaller; the curves are not available.",
    ),
    Picture(
        "fig11b",
        "Fig. 11: force during a maneuver, over position",
        "The same runs.",
        lambda r: _maneuver(r, "position"),
        "the caption has a position on the horizontal axis, the text has time; we draw both.",
    ),
    Picture(
        "nyquist_x",
        "Nyquist diagram of x",
        "The loop (GC + Sh)(Te + Th) for the gains of Fig. 11.",
        lambda r: _nyquist("x", GAINS_FIG11, Operator()),
    ),
    Picture(
        "nyquist_y",
        "Nyquist diagram of y",
        "The curve of K = 1, as printed, encloses -1; that of K = 0.5 does not.",
        lambda r: _nyquist("y", (0.5, 1.0), None),
    ),
    Picture(
        "bode_x",
        "Bode diagram of x",
        "Margins of the constant cut with K = 1.",
        lambda r: views.theory_plots.bode_plot("x", 1.0, B_CONSTANT, operator=Operator()),
    ),
    Picture(
        "small_gain_y",
        "Inequality (13) on y",
        "The sufficient condition of the paper fails in the shaded band for every K.",
        lambda r: views.theory_plots.small_gain_plot("y", 1.0, B_STABILITY, operator=Operator()),
    ),
    Picture(
        "map",
        "Drift of Sh over the workspace",
        "Without inertia shaping, the printed Sh holds only at the nominal pose.",
        lambda r: views.workspace_plots.workspace_plot(workspace.drift_map()),
        quick=False,
    ),
)


def format_number(x: float | None, unit: str = "", digits: int = 6) -> str:
    """Formats a value for a table; None gives an empty cell."""
    if x is None:
        return ""
    if math.isnan(x):
        return "none"
    text = "0" if abs(x) < 1e-9 else f"{float(f'{x:.{digits}g}'):.6g}"
    return f"{text} {typeset(unit)}".strip()


def digits(row: Row) -> int:
    """Significant digits that a found value carries by its row's tolerance; at least those of the
    expected value where it is printed with five or fewer.
    """
    if not row.tolerance:
        return 4
    if row.expected == 0.0:
        return 2
    shown = _significant(row.expected)
    return min(6, max(3, 2 - math.floor(math.log10(row.tolerance)), shown if shown < 6 else 0))


def expected_digits(row: Row) -> int:
    """All digits of an expected value that is printed so; those of the found value otherwise."""
    return 6 if _significant(row.expected) < 6 else digits(row)


def _significant(x: float | None) -> int:
    """Significant digits of a value of a table, of six at most."""
    return len(format_number(x).partition("e")[0].replace(".", "").strip("-0"))


def typeset(unit: str) -> str:
    """Typesets a unit, and units in a sentence: N·s/m, 1/s²; nothing for "1"."""
    return "" if unit == "1" else re.sub(r"\bN\.(?=[ms]\b)", "N·", unit).replace("^2", "²")


def aligned(x: float | None, digits: int = 6) -> Any:
    """Formats a value so that the decimal points of an HTML column align."""
    import markupsafe  # a dependency of jinja2

    whole, point, rest = format_number(x, digits=digits).partition(".")
    cell = '<span><span class="i">{}</span><span class="f">{}</span></span>'
    return markupsafe.Markup(cell).format(whole, point + rest)


def format_error(row: Row) -> str:
    """Formats the error of a row in percent, or in the row's unit if 0 is expected."""
    if row.error is None or math.isnan(row.error):
        return ""
    if row.expected == 0.0:
        return format_number(row.error if abs(row.error) > 1e-6 else 0.0, row.unit, 2)
    percent = float(f"{100.0 * row.error:.3f}")
    return f"{float(f'{percent:.2g}'):+.6g} %" if percent else "0 %"


def format_verdict(row: Row) -> str:
    """Formats the agreement of a row."""
    return {True: "yes", False: "NO", None: ""}[row.agrees]


def template_environment() -> Any:
    """The templates of this package, with filters for numbers and verdicts."""
    import jinja2

    env = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=jinja2.select_autoescape(["html"]),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    env.filters |= {
        "number": format_number,
        "aligned": aligned,
        "unit": typeset,
        "digits": digits,
        "expected_digits": expected_digits,
        "error": format_error,
        "verdict": format_verdict,
        "cell": lambda s: s.replace("|", "\\|"),
    }
    return env


def paper_page(rows: list[Row]) -> str:
    """Renders the ledger as a Markdown page (docs/paper.md)."""
    return template_environment().get_template("paper.md").render(rows=rows, statuses=STATUSES)


def classic_page(found: Found, source: Classic) -> str:
    """Renders the claims of a classic as a Markdown page (docs/classics/)."""
    words = {"source": source, "rows": found.rows, "charts": found.charts}
    template = template_environment().get_template("classic.md")
    return template.render(words, statuses=CLASSIC_STATUSES)


def reproduce(
    out: Path,
    quick: bool = False,
    progress: Callable[[str], None] | None = None,
    save: Callable[[dict[str, Figure], Path], object] | None = None,
    runs: Runs | None = None,
) -> list[Row]:
    """Writes report.html (self-contained), report.md, ledger.json and figures/."""
    runs = runs or Runs(progress)
    rows = claims.ledger_rows(runs)
    drawn = []
    for p in PICTURES:
        if quick and not p.quick:
            continue
        if progress:
            progress(p.title)
        drawn.append(_drawn(p, Figure(functools.partial(p.draw, runs)), out, save))
    _write(out, rows, STATUSES, drawn, THE_PAPER)
    return rows


def reproduce_classic(
    source: Classic,
    out: Path,
    quick: bool = False,
    progress: Callable[[str], None] | None = None,
    save: Callable[[dict[str, Figure], Path], object] | None = None,
) -> Found:
    """Writes report.html (self-contained), report.md, ledger.json and figures/ of a classic."""
    found = source.make(quick, progress or (lambda title: None))
    drawn = []
    for chart in found.charts:
        figure = Figure(functools.partial(chart_plot, chart), chart.tables)
        drawn.append(_drawn(chart, figure, out, save))
    about = {
        "heading": source.title,
        "citation": source.citation,
        "notes": (source.read, source.method),
    }
    _write(out, found.rows, CLASSIC_STATUSES, drawn, about)
    return found


def _drawn(
    picture: Picture | Chart,
    figure: Figure,
    out: Path,
    save: Callable[[dict[str, Figure], Path], object] | None,
) -> dict[str, Any]:
    """Writes a figure of a report; returns the values that the templates need."""
    svg = figure.svg()
    with atomic(out / "figures" / f"{picture.name}.svg") as f:
        f.write(svg.encode())
    if save is not None:
        save({picture.name: figure}, out / "figures")
    width = re.search(r'width="([\d.]+)pt"', svg)
    assert width
    return {
        "picture": picture,
        "paper": getattr(picture, "paper", ""),
        "data": base64.b64encode(svg.encode()).decode(),
        "wide": float(width[1]) / 72.0 > WIDE,
    }


def _write(
    out: Path,
    rows: Sequence[Row],
    statuses: dict[str, str],
    pictures: list[dict[str, Any]],
    about: dict[str, Any],
) -> None:
    """Writes the report as HTML and Markdown, and the ledger as data."""
    found = {"rows": rows, "statuses": statuses, "pictures": pictures, "versions": versions()}
    env = template_environment()
    for name in ("report.html", "report.md"):
        with atomic(out / name) as f:
            f.write(env.get_template(name).render(found | about).encode())
    table = [{**fields_of(r), "error": r.error, "agrees": r.agrees} for r in rows]
    write_json(with_schema("ledger", {"rows": table}), out / "ledger.json")
