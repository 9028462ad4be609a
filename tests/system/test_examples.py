"""Each example and each tutorial runs without a warning, prints or draws, and is short."""

import ast
import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

from hapticclay.views import style

ROOT = Path(__file__).parents[2]
TUTORIALS = sorted((ROOT / "examples" / "tutorials").glob("*.py"))
LEARNING = {*(ROOT / "examples" / "learning").glob("*.py")}  # need torch, and minutes
EXAMPLES = sorted({*(ROOT / "examples").rglob("*.py")} - {*TUTORIALS} - LEARNING)
PAGES = EXAMPLES + TUTORIALS
IDS = [f"{page.parent.name}/{page.stem}" for page in PAGES]


@pytest.fixture(autouse=True)
def clean_figures(monkeypatch):
    """Starts and leaves without figures, in matplotlib's own style."""
    monkeypatch.setattr(plt, "show", lambda: None)  # agg warns that it shows nothing
    with matplotlib.rc_context():
        yield
    plt.close("all")


@pytest.mark.parametrize("page", PAGES, ids=IDS)
def test_runs_and_shows_a_figure(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(page), run_name="__main__")
    assert plt.get_fignums()
    for number in plt.get_fignums():
        for ax in plt.figure(number).axes:
            labels = ax.get_xlabel() + ax.get_ylabel()
            shared = ax.get_shared_x_axes().get_siblings(ax)
            assert labels or len(shared) > 1, f"{page.name}: axes without a label"


@pytest.mark.parametrize("page", EXAMPLES, ids=IDS[: len(EXAMPLES)])
def test_an_example_is_short_and_takes_the_public_api(page):
    text = page.read_text()
    assert len(text.splitlines()) < 60
    tree = ast.parse(text)
    title = (ast.get_docstring(tree) or "").splitlines()
    assert len(title) > 3 and set(title[1]) == {"="} and len(title[1]) == len(title[0])
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            assert node.module != "hapticclay", f"{page.name}: import hapticclay as hc"
        if isinstance(node, ast.Attribute):
            assert not node.attr.startswith("_"), f"{page.name}: {node.attr}"


def test_there_are_enough():
    assert len(EXAMPLES) >= 20 and len(TUTORIALS) == 4


def test_the_style_sheet_is_the_style_of_the_figures():
    """hapticclay/views/figure.mplstyle, for figures of one's own, repeats style.STYLE."""
    sheet = matplotlib.rc_params_from_file(
        Path(style.__file__).with_name("figure.mplstyle"), use_default_template=False
    )
    assert all(sheet[name] == value for name, value in style.STYLE.items())
    colors = [x["color"] for x in sheet["axes.prop_cycle"]]
    assert colors == [style.BLUE, style.VERMILION, style.GREEN, style.PURPLE, style.ORANGE,
                      style.SKY_BLUE]  # fmt: skip
