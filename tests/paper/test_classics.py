"""Classics of haptics: each claim is found by runs that do not know it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from hapticclay.cli import app
from hapticclay.cli.reproduce import ReproduceCommand
from hapticclay.errors import ParameterError
from hapticclay.paper import report
from hapticclay.paper.classics import CLASSICS, chawda2015, classic, hannaford2002, hulin2006
from hapticclay.paper.classics.classic import CLASSIC_STATUSES, FORMULA, QUOTED
from tests.hunt import some

PAGES = Path(__file__).parents[2] / "docs" / "classics"


@pytest.mark.parametrize("name", CLASSICS)
def test_quick_runs_agree_with_every_claim(name, monkeypatch):
    monkeypatch.setattr(chawda2015, "PRESSES", some(chawda2015.PRESSES, 2))
    told = []
    found = classic(name).make(True, told.append)
    assert told and found.rows and found.charts
    for row in found.rows:
        assert row.agrees, (row.what, row.expected, row.ours)
        assert row.status in CLASSIC_STATUSES and row.reason
    assert any(row.status in (QUOTED, FORMULA) for row in found.rows)
    for chart in found.charts:
        assert all(len(c.x) == len(c.y) for c in chart.curves)
        assert any(c.kind == "marks" for c in chart.curves) or name in ("hannaford2002", "ryu2004")


@pytest.mark.parametrize("name", CLASSICS)
def test_page_of_a_classic_is_that_of_its_source(name):
    page, source = (PAGES / f"{name}.md").read_text(), classic(name)
    for words in (source.title, source.citation, source.read, source.method):
        assert report.typeset(words) in page, words
    assert "| NO |" not in page and f"hapticclay reproduce {name}" in page
    for picture in re.findall(r"\]\(([^)]+\.png)\)", page):
        assert (PAGES / picture).is_file(), picture


def test_a_wrong_formula_would_not_agree():
    """The rule without the half sample of the hold, beside the same run."""
    wall = hulin2006._wall(4.0, 1.0)
    ours = hulin2006._by_runs(wall, 0.0)[0]
    assert ours == pytest.approx(hulin2006.rule(4.0, 0.0, 1.0), rel=hulin2006.RULE)
    assert ours != pytest.approx(4.0 / 1e-3, rel=0.3)


def test_the_published_controller_dissipates_what_the_observer_lacks():
    """f + alpha v at alpha = -E/(dT v^2) takes back E over a sample, to first order in dT."""
    K, lever, Ts, W, E, v = 0.0, 0.24, 1e-3, 1e-3, -1e-6, 0.1
    state = (E, 0.0, 0.0, 1.0)
    q, qd = (0.5 * np.pi, 0.0), (-v / lever, 0.0)
    params = (K, lever, Ts, hannaford2002.PUBLISHED, W)
    (torque, _), after = hannaford2002.observed_wall(0.0, q, qd, (0.0, 0.0), state, params)
    assert after[0] == E  # nothing moved since the last sample
    assert torque / lever * v * Ts == pytest.approx(-E, rel=1e-12)
    stiff = (K, lever, Ts, hannaford2002.PUBLISHED, 1.0)
    (held, _), _ = hannaford2002.observed_wall(0.0, q, qd, (0.0, 0.0), (-1.0, *state[1:]), stiff)
    assert held / lever == pytest.approx(0.5 / Ts * v)  # of 1 kg: half of the speed in a sample


def test_command_writes_report_ledger_and_figures(tmp_path, capsys):
    page = tmp_path / "page" / "hannaford2002.md"
    words = ["--quick", "--out", str(tmp_path / "out"), "--page", str(page)]
    assert app.main(["reproduce", "hannaford2002", *words]) == 0
    out = capsys.readouterr().out
    assert "a wall of 100 N/mm is stable with the controller" in out and "numbers agree" in out
    ledger = json.loads((tmp_path / "out" / "ledger.json").read_text())
    assert ledger["schema"] == "hapticclay-ledger-1" and all(r["agrees"] for r in ledger["rows"])
    html = (tmp_path / "out" / "report.html").read_text()
    assert "Hannaford" in html and "data:image/svg+xml;base64," in html
    assert (tmp_path / "out" / "figures" / "energy.svg").is_file()
    assert (page.parent / "hannaford2002_energy.png").is_file() and "## Quoted" in page.read_text()


def test_an_unknown_classic_is_refused_with_the_nearest_name():
    with pytest.raises(ParameterError, match="did you mean 'hulin2006'"):
        ReproduceCommand("hulin2005")()
