"""The report: whole, self-contained, and made of the runs."""

import dataclasses
import json
import re

import pytest
from matplotlib.figure import Figure

from hapticclay.cli import app
from hapticclay.paper import claims, ledger, report
from hapticclay.paper.ledger import Row

ROW = Row("a", "Eq. 1", "1", "m", 1.0, 1.001, 1e-2, "given", "why")


@pytest.mark.parametrize(
    "expected,ours,tolerance,agrees",
    [
        (1.0, 1.001, 1e-2, True),
        (1.0, 1.1, 1e-2, False),
        (0.0, 1e-9, 1e-8, True),
        (0.0, 1e-3, 1e-8, False),
        (1.0, None, 1e-2, False),
        (1.0, 2.0, None, None),
        (None, 2.0, None, None),
        (1.0, float("nan"), 1e-2, False),
    ],
)
def test_agreement(expected, ours, tolerance, agrees):
    row = dataclasses.replace(ROW, expected=expected, ours=ours, tolerance=tolerance)
    assert row.agrees is agrees
    assert report.format_verdict(row) == {True: "yes", False: "NO", None: ""}[agrees]


@pytest.mark.parametrize(
    "x,unit,text",
    [
        (None, "m", ""),
        (1e-12, "m", "0 m"),
        (0.05, "m", "0.05 m"),
        (910.19, "1/s", "910.19 1/s"),
        (0.9, "1", "0.9"),
        (float("nan"), "m", "none"),
    ],
)
def test_numbers_for_tables(x, unit, text):
    assert report.format_number(x, unit) == text


def test_runs_are_made_once_and_when_asked(monkeypatch):
    made = []
    monkeypatch.setattr(ledger, "simulate", lambda scenario: made.append(scenario) or scenario)
    runs = ledger.Runs()
    assert not made
    runs.free()
    runs.free()
    runs.free(gain=(2.0, 2.0))
    assert len(made) == 2


@pytest.fixture(scope="module")
def written(tmp_path_factory, paper_runs, ledger_rows):
    """Folder and rows of a report; what is written does not depend on the layout of its figures."""
    out = tmp_path_factory.mktemp("paper")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "get_layout_engine", lambda self: None)
        rows = report.reproduce(out, quick=True, runs=paper_runs)
    assert rows == ledger_rows
    return out, rows


def test_report_is_one_file_with_every_figure(written):
    out, rows = written
    text = (out / "report.html").read_text()
    names = [p.name for p in report.PICTURES if p.quick]
    for name in names:
        assert f'id="{name}"' in text and (out / "figures" / f"{name}.svg").stat().st_size > 8000
    assert text.count("data:image/svg+xml;base64,") == len(names)
    assert not re.search(r'(src|href)="(?!data:)', text), "must not load anything"
    for figure in (
        "Fig. 4",
        "Fig. 5",
        "Fig. 6",
        "Fig. 7",
        "Fig. 8",
        "Fig. 9",
        "Fig. 10",
        "Fig. 11",
        "Nyquist",
        "Bode",
    ):
        assert figure in text
    for row in rows:
        assert (
            report.aligned(row.ours, report.digits(row)) in text
            and report.typeset(row.unit) in text
        )
    for p in report.PICTURES:  # of the paper's figures: what of it stands beside ours
        assert (p.paper and p.paper in text) or not p.name.startswith("fig")
    assert 'class="wide"' in text and "@page { size: A4" in text


def test_markdown_says_the_same(written):
    out, rows = written
    text = (out / "report.md").read_text()
    for name in re.findall(r"\]\((figures/[^)]+)\)", text):
        assert (out / name).is_file()
    lines = [
        line
        for line in text.splitlines()
        if line.startswith("| ") and not line.startswith("| quantity")
    ]
    assert len(lines) == len(rows)
    assert all(line.count(" | ") == 7 for line in lines)


def test_ledger_is_data(written):
    out, rows = written
    data = json.loads((out / "ledger.json").read_text(), parse_constant=lambda x: pytest.fail(x))
    assert data["schema"] == "hapticclay-ledger-1" and "mujoco" in data["versions"]
    assert [r["what"] for r in data["rows"]] == [r.what for r in rows]


def test_command_says_what_does_not_agree_and_fails(tmp_path, monkeypatch, capsys):
    wrong = dataclasses.replace(ROW, ours=2.0)
    monkeypatch.setattr(claims, "ledger_rows", lambda runs: [ROW, wrong])
    monkeypatch.setattr(report, "PICTURES", ())
    assert app.main(["reproduce", "--quick", "--out", str(tmp_path)]) == 1
    out = capsys.readouterr().out
    assert "does not agree: a (Eq. 1): 2 m, +100 %" in out and "1 of 2 numbers agree" in out
    assert str(tmp_path / "report.html") in out
    monkeypatch.setattr(claims, "ledger_rows", lambda runs: [ROW])
    assert app.main(["reproduce", "--quick", "--out", str(tmp_path)]) == 0


def test_changed_physics_changes_the_page(written):
    _, rows = written
    other = [dataclasses.replace(r, ours=(r.ours or 0.0) + 0.123) for r in rows]
    assert report.paper_page(other) != report.paper_page(rows)
