"""The page of `hapticclay compare`: controllers or bare devices side by side."""

from __future__ import annotations

import re
from typing import Any

from ..display import cell_text
from ..files import versions
from ..studies.comparison import COMPARED_HANDS, PUSHED, Comparison, differing_fields
from ..views.compare_plots import compare_figures
from .report import template_environment

SVG_COLORS = {  # colours of a figure, and the page variables that replace them, light or dark
    "#000000": "--ink",
    "#222222": "--ink",
    "#262626": "--ink",
    "#555555": "--soft",
    "#ffffff": "--paper",
    "#e6e6e6": "--grid",
    "#0072b2": "--blue",
    "#d55e00": "--red",
    "#009e73": "--green",
    "#cc79a7": "--pink",
    "#e69f00": "--amber",
}
ABOUT = {
    True: f"Bare devices, each with a virtual wall; the run is a push at {1e3 * PUSHED:g} mm/s.",
    False: "Controllers, each in its own scenario; the run is that of the scenario.",
}
UNDER = "Controllers, each run under the recording {}, which lies beside them."
NOTES = {
    True: "Stable and passive stiffness are exact for the linear wall with its own B, M, Ts and "
    "delay; only the Z-width by runs includes friction and encoder. The dynamic range is the mean "
    "from 0.5 to 30 Hz. ",
    False: "The gain limit and the least mass (of an admittance 1/(M (s² + 10 s)) without clay) "
    "include the scenario's sampling and delay; margins, worst hand, passivity, damper and "
    "effective impedance are those of the continuous loop. ",
}


def comparison_page(found: Comparison) -> str:
    """Renders a comparison as a self-contained HTML page."""
    walls = found[0].loop is None
    (m0, m1), (d0, d1), (k0, k1) = COMPARED_HANDS.mass, COMPARED_HANDS.damper, COMPARED_HANDS.spring
    hands = f"Worst hand of {m0:g} to {m1:g} kg, {d0:g} to {d1:g} N.s/m, {k0:g} to {k1:g} N/m."
    rows = zip(*found.tables()["side by side"].values(), strict=True)
    context = {
        "names": [x.name for x in found],
        "about": UNDER.format(found[0].replayed.name) if found[0].replayed else ABOUT[walls],
        "notes": NOTES[walls] + hands,
        "numbers": {name: list(map(cell_text, row)) for name, *row in rows},
        "pictures": [
            {"name": name, "title": title, "svg": inline_svg(figure.svg(), name)}
            for name, (title, figure) in compare_figures(found).items()
        ],
        "fields": {
            name: [_field_text(x) for x in row] for name, row in differing_fields(found).items()
        },
        "versions": versions(),
    }
    return template_environment().get_template("compare.html").render(context)


def inline_svg(text: str, name: str) -> str:
    """Prepares an SVG file for embedding in a page: no header, unique ids, colours of the page."""
    text = re.sub(r"<metadata>.*?</metadata>", "", text[text.index("<svg") :], flags=re.S)
    text = re.sub(r'\b(id="|href="#|url\(#)', rf"\g<1>{name}-", text)
    for color, variable in SVG_COLORS.items():
        text = re.sub(f"{color}\\b", f"var({variable})", text, flags=re.I)
    return text


def _field_text(value: Any) -> str:
    return "-" if value is None else f"{value:.6g}" if isinstance(value, float) else str(value)
