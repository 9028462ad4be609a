"""The whole paper, reproduced: one HTML page, the same in Markdown, the ledger as data."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..files import atomic, versions
from ..model.constants import B_CONSTANT, B_STABILITY, GAINS_FIG11
from ..model.operator import Operator
from . import claims
from .ledger import STATUSES, Row, Runs

LEDGER_SCHEMA = "hapticclay-ledger-1"
TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Picture:
    """A figure of the report: file name, title, caption, and what draws it."""

    name: str
    title: str
    caption: str
    draw: Callable[[Runs], Any]
    quick: bool = True  # whether the quick report has it


def _plot(name: str, *args: Any, **kw: Any) -> Any:
    from ..views import run_plots

    return getattr(run_plots, name)(*args, **kw)


def _response_figure(runs: Runs, what: str) -> Any:
    from ..views import study_plots

    return study_plots.bode(
        [runs.identified(what, axis) for axis in ("x" if what == "Th" else "xy")]
    )


def _theory(name: str, *args: Any, **kw: Any) -> Any:
    from ..views import theory_plots

    return getattr(theory_plots, name)(*args, **kw)


def _map(runs: Runs) -> Any:
    from ..studies.workspace import drift_map
    from ..views import study_plots

    return study_plots.workspace(drift_map())


PICTURES = (
    Picture("fig04", "Fig. 4: closed position loop G",
            "Response of the simulated arm to commands, and Eqs. 15 and 16.", lambda r: _response_figure(r, "G")),
    Picture("fig05", "Fig. 5: sensitivity Sh",
            "Response to forces at the handle, and Eqs. 17 and 18.", lambda r: _response_figure(r, "S")),
    Picture("fig06", "Fig. 6: operator's arm Th",
            "Hand force over handle position, and Eq. 19.", lambda r: _response_figure(r, "Th")),
    Picture("fig07", "Fig. 7: path of the constant cut",
            "Straight through the slab; without shaping the arm's inertia pulls it aside by less than a millimetre.",
            lambda r: _plot("path", r.constant())),
    Picture("fig08a", "Fig. 8, top: velocity against position",
            "The speed K f/(10 + K b) in the clay, ten times that outside.",
            lambda r: _plot("velocity_position", r.constant())),
    Picture("fig08b", "Fig. 8, bottom: force over velocity",
            "The clay's share is b inside and nothing outside; the operator feels the compensator's 10/K on top.",
            lambda r: _plot("force_velocity", r.constant())),
    Picture("fig09", "Fig. 9: path of the variable cut",
            "Clay of 50 N·s/m up to 5 cm on each axis, 100 beyond, growing in x.",
            lambda r: _plot("path", r.variable())),
    Picture("fig10", "Fig. 10: velocity of the variable cut",
            "Constant up to 5 cm, an abrupt drop, then slowly less in x as the clay grows by 30 N·s/m a second.",
            lambda r: _plot("velocity_position", r.variable(), "xy")),
    Picture("fig10_printed", "Fig. 10 with K = 1 on both axes, as printed",
            "The y axis is unstable in the printed model; the run ends where that is certain.",
            lambda r: _plot("velocity_position", r.variable(as_printed=True), "xy")),
    Picture("readings", "Readings of the growth",
            "The paper prints the growth in three ways; each would have given this speed in x.",
            lambda r: _plot("readings", {x: r.variable(x) for x in ("none", "0.15/s", "30/s", "0.15/sample")})),
    Picture("fig11a", "Fig. 11: force during a maneuver, against time",
            "Below the limit the hand feels its own muscle; far above it the motors swing against their limits.",
            lambda r: _plot("force_maneuver", [r.stability(K) for K in GAINS_FIG11])),
    Picture("fig11b", "Fig. 11: force during a maneuver, against position", "The same runs.",
            lambda r: _plot("force_maneuver", [r.stability(K) for K in GAINS_FIG11], "x", "position")),
    Picture("nyquist_x", "Nyquist diagram of x", "The loop (GC + Sh)(Te + Th) for the gains of Fig. 11.",
            lambda r: _theory("nyquist", "x", B_STABILITY, gains=GAINS_FIG11, operator=Operator())),
    Picture("nyquist_y", "Nyquist diagram of y", "K = 1, as printed, encloses -1; K = 0.5 does not.",
            lambda r: _theory("nyquist", "y", B_STABILITY, gains=(0.5, 1.0))),
    Picture("bode_x", "Bode diagram of x", "Margins of the constant cut, K = 1.",
            lambda r: _theory("bode", "x", 1.0, B_CONSTANT, operator=Operator())),
    Picture("small_gain_y", "Inequality (13) on y", "Where the paper's sufficient condition fails, whatever K.",
            lambda r: _theory("small_gain", "y", 1.0, B_STABILITY, operator=Operator())),
    Picture("map", "Drift of Sh over the workspace",
            "Without shaping the printed Sh holds at the nominal pose only.", _map, quick=False),
)  # fmt: skip


def format_number(x: float | None, unit: str = "") -> str:
    """x for a table, to six digits; an empty cell for None."""
    if x is None:
        return ""
    if math.isnan(x):
        return "none"
    text = "0" if abs(x) < 1e-9 else f"{x:.6g}"
    return f"{text} {unit}".strip() if unit != "1" else text


def format_error(row: Row) -> str:
    """The row's error for a table: percent, or in its unit where 0 is expected."""
    if row.error is None or math.isnan(row.error):
        return ""
    if row.expected == 0.0:
        return format_number(row.error if abs(row.error) > 1e-6 else 0.0, row.unit)
    percent = 100.0 * row.error
    return "0 %" if abs(percent) < 5e-4 else f"{percent:+.3f} %"


def format_verdict(row: Row) -> str:
    """Whether the row agrees, for a table."""
    return {True: "yes", False: "NO", None: ""}[row.agrees]


def _environment():
    import jinja2

    env = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=jinja2.select_autoescape(["html"]), trim_blocks=True,
        lstrip_blocks=True, keep_trailing_newline=True, undefined=jinja2.StrictUndefined,
    )  # fmt: skip
    env.filters |= {
        "number": format_number,
        "error": format_error,
        "verdict": format_verdict,
        "cell": lambda s: s.replace("|", "\\|"),
    }
    return env


def paper_page(rows: list[Row]) -> str:
    """The ledger as a Markdown page (docs/paper.md)."""
    return _environment().get_template("paper.md").render(rows=rows, statuses=STATUSES)


def reproduce(
    out: Path,
    quick: bool = False,
    progress: Callable[[str], None] | None = None,
    runs: Runs | None = None,
) -> list[Row]:
    """Runs everything and writes report.html (self-contained), report.md, ledger.json and figures/ into out.

    Args:
        out: folder. quick: leaves out the map over the workspace. progress: called with what comes next.

    Returns:
        The rows of the ledger.
    """
    runs = runs or Runs(progress)
    rows = claims.ledger_rows(runs)
    pictures = []
    for p in PICTURES:
        if quick and not p.quick:
            continue
        if progress:
            progress(p.title)
        data = io.BytesIO()
        p.draw(runs).savefig(data, format="png")
        with atomic(out / "figures" / f"{p.name}.png") as f:
            f.write(data.getvalue())
        pictures.append({"name": p.name, "title": p.title, "caption": p.caption,
                         "data": base64.b64encode(data.getvalue()).decode()})  # fmt: skip
    found = {"rows": rows, "statuses": STATUSES, "pictures": pictures, "versions": versions()}
    env = _environment()
    for name in ("report.html", "report.md"):
        with atomic(out / name) as f:
            f.write(env.get_template(name).render(found).encode())
    with atomic(out / "ledger.json") as f:
        table = [{**asdict(r), "error": r.error, "agrees": r.agrees} for r in rows]
        f.write(
            (
                json.dumps(
                    {"schema": LEDGER_SCHEMA, "versions": versions(), "rows": table}, indent=1
                )
                + "\n"
            ).encode()
        )
    return rows
