"""The documents say what is so: snippets run, commands exist, figures and symbols are current."""

import importlib
import inspect
import pkgutil
import re
import shlex
from pathlib import Path

import pytest

import hapticclay as hc
from hapticclay.cli import app, parser
from hapticclay.kernel import engine
from hapticclay.model import constants
from hapticclay.simulation import record
from tests.public import NAMES, told_by, used_in
from tests.snippets import printed_by

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


@pytest.mark.parametrize("block", re.findall(r"```python\n(.*?)```", README, re.S))
def test_readme_snippet_runs_and_prints_what_it_says(block, tmp_path):
    out = printed_by(block, tmp_path)
    said = re.findall(r"print\(.*\)  # ([^:\n]*)", block)
    assert out.splitlines() == said and len(said) >= 3
    assert (tmp_path / "out" / "record.npz").is_file()


@pytest.mark.parametrize("page", ["stability", "limit_cycles", "hardware", "design"])
def test_stability_pages_say_what_their_snippets_print(page, tmp_path):
    text = (ROOT / "docs" / f"{page}.md").read_text()
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
    out = printed_by(code, tmp_path)
    said = " ".join(re.findall(r"print\(.*\)  # ([^:\n]*)", code)).split()
    for a, b in zip(out.split(), said, strict=True):
        assert a == b or float(a) == pytest.approx(float(b), rel=1e-3)


def test_signals_page_runs(tmp_path):
    """Its example, with a file of its columns."""
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "signals.md").read_text(), re.S)
    (tmp_path / "force.csv").write_text("t,fx,fy\n0,0,0\n0.5,1,0.2\n1,0,0\n")
    out = printed_by(code, tmp_path)
    assert "at " in out


FORMATS = ("text", "parquet", "matlab", "hdf5", "numpy", "excel", "ros")
PRINTING = ("materials.md", "fit.md", "logs.md", "pair_log.md", "pair.md", "replay.md") + tuple(
    f"logs/{name}.md" for name in FORMATS
)


@pytest.mark.parametrize("page", PRINTING)
def test_page_says_what_its_snippet_prints(page, tmp_path):
    code = "\n".join(re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(), re.S))
    out = printed_by(code, tmp_path)
    assert out.splitlines() == re.findall(r"print\(.*\)  # (.*)", code) != []


@pytest.mark.parametrize("page", ["arm", "servo_gain", "mujoco_stable", "own_arm"])
def test_pages_of_arms_print_what_they_say(page, tmp_path):
    text = (ROOT / "docs" / f"{page}.md").read_text()
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
    said = [a or b for a, b in re.findall(r"print\(.*?\)  # (.*)|^# (.*)", code, re.M)]
    assert printed_by(code, tmp_path).splitlines() == said != []


SYMPTOMS = ("wall_vibrates", "fast_enough", "theory_and_practice", "stick_slip") + (
    "velocity_filter",
    "identify_device",
)


@pytest.mark.parametrize("page", SYMPTOMS)
def test_a_symptom_page_prints_what_it_says_and_names_the_program_of_its_picture(page, tmp_path):
    text = (ROOT / "docs" / f"{page}.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", text, re.S)
    out = printed_by(code, tmp_path)
    said = re.findall(r"print\(.*\)  # (.*)", code) or re.findall(r"^# (.*)", code, re.M)
    assert out.splitlines() == said != []
    (picture,) = re.findall(r"!\[.*?\]\((\w+)\.png\)", text)
    assert f"examples/symptoms/{picture}.py" in text
    assert (ROOT / "examples" / "symptoms" / f"{picture}.py").is_file()


@pytest.mark.parametrize("page", ["groove.md", "own_controller.md"])
def test_the_page_says_line_by_line_what_it_prints(page, tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text(), re.S)
    out = printed_by(code, tmp_path)
    assert out.splitlines() == re.findall(r"^# (.*)", code, re.M) != []


@pytest.mark.parametrize("page", ["figures.md", "labs.md", "passivity.md", "robustness.md"])
def test_snippets_of_the_page_run_and_print_its_numbers(page, tmp_path):
    text = (ROOT / "docs" / page).read_text()
    code = "\n".join(re.findall(r"```python\n(.*?)```", text, re.S))
    out = printed_by(code, tmp_path)
    printed = re.findall(r"^[\d.e+-]+|(?<=\[)[\d.]+", out, re.M)
    for said in re.findall(r"print\(.*\)  # ([\d.]+)", code):
        assert any(float(x) == pytest.approx(float(said), rel=1e-3) for x in printed), said


FIGURE_PAGES = (
    "zwidth", "impedance", "passivity", "robustness", "compare", "figures", "classics", "labs",
)  # fmt: skip
LINES = [
    line
    for page in FIGURE_PAGES
    for line in re.findall(
        r"^    hapticclay (.+)$", (ROOT / "docs" / f"{page}.md").read_text(), re.M
    )
]


@pytest.mark.parametrize("line", LINES)
def test_options_of_the_commands_of_a_page_exist(line, capsys):
    """Their runs take too long for a page each; tests/cli runs them."""
    command, *words = line.split()
    experiment = [word for word in words[:1] if not word.startswith("-")]
    assert app.main([command, *experiment, "--help"]) == 0
    shown = capsys.readouterr().out
    for option in (word for word in words if word.startswith("--")):
        assert re.search(rf"{option}\b", shown), option


PARTS = (ROOT / "docs" / "parts.md").read_text()
BLOCKS = re.findall(r"## ([^\n]*)\n\n```python\n(.*?)```", PARTS, re.S)


@pytest.mark.parametrize("block", [b for _, b in BLOCKS], ids=[name for name, _ in BLOCKS])
def test_a_block_about_a_part_prints_what_it_says(block, tmp_path):
    out = printed_by(block, tmp_path)
    assert out.splitlines() == re.findall(r"print\(.*\)  # (.*)", block) != []


@pytest.mark.parametrize("line", re.findall(r"^    hapticclay (.+)$", PARTS, re.M))
def test_commands_with_parts_run(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command, *words = shlex.split(line)
    short = {"sweep": ["--workers", "1", "--fixed", "t_max=0.5"], "run": ["--no-plots"]}
    assert app.main([command, *words, *short.get(command, ())]) == 0


def test_every_limit_in_the_stability_page_is_recomputed():
    text = (ROOT / "docs" / "stability.md").read_text()
    rows = re.findall(r"^\| ([xy]) \| (nominal|none) \| (\d+) \|(.*)\|$", text, re.M)
    Ts = constants.TS
    columns = (
        {},
        dict(Ts=Ts),
        dict(Ts=Ts, delay=Ts),
        dict(delay=1e-3),
        dict(Ts=Ts, render="physical"),
    )
    assert len(rows) == 12
    for axis, hand, b, cells in rows:
        for cell, kw in zip(cells.split("|"), columns, strict=True):
            limit = hc.theory.gain_limit(
                axis, float(b), hc.Operator() if hand == "nominal" else None, **kw
            )
            assert f"{limit:.4f}" == cell.strip()


@pytest.mark.parametrize("line", re.findall(r"^    (?:\$ )?hapticclay (.+)$", README, re.M))
def test_readme_commands_run(line, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = line.split()
    if words[0] == "reproduce":  # test_report.py runs it
        words = [words[0], "--help"]
    assert app.main([*words, "--no-plots"] if words[0] == "run" else words) == 0
    if "--gain 1 1" in line:
        shown = re.search(rf"\$ hapticclay {re.escape(line)}\n(.*?)\n\n", README, re.S)
        assert shown
        out = capsys.readouterr().out
        for expected in shown[1].splitlines():
            assert expected.strip() in out


def test_readme_figures_and_links_exist():
    pictures = re.findall(r'!\[.*?\]\((.*?)\)|<img src="(.*?)"', README)
    assert len(pictures) >= 4
    for target in (a or b for a, b in pictures):
        assert (ROOT / target).is_file(), target
    for target in re.findall(r"`((?:docs|mjcf)/\S+?)`|\]\(([^)#:]+)\)", README):
        assert (ROOT / (target[0] or target[1])).is_file(), target


def test_make_targets_named_in_the_documents_exist():
    makefile = (ROOT / "Makefile").read_text()
    for text in (README, (ROOT / "CONTRIBUTING.md").read_text()):
        for names in re.findall(
            r"^    make ((?:demo|test|coverage|check|docs|bench|build)(?: \w+)*?)(?:  |$)",
            text,
            re.M,
        ):
            for name in names.split():
                assert re.search(rf"^{name}:", makefile, re.M), name


def test_every_recorded_array_is_in_the_symbol_table():
    text = (ROOT / "docs" / "equations.md").read_text()
    for name in record.ARRAYS:
        assert name == "t" or f"`{name}`" in text, name


STEP = (ROOT / "docs" / "equations.md").read_text().partition("\n## 4. ")[2].partition("\n## ")[0]
NAMED = [
    name
    for row in re.findall(r"^\|(.*)\|$", STEP, re.M)
    for name in re.findall(r"`(\w+\.\w+)`", re.split(r"(?<!\\)\|", row)[2])
]


@pytest.mark.parametrize("name", NAMED)
def test_a_function_that_the_table_of_the_step_names_exists(name):
    module, function = name.split(".")
    found = importlib.import_module(f"hapticclay.kernel.{module}")
    assert inspect.isfunction(getattr(found, function)), name


def test_the_table_of_the_step_names_functions_for_each_row():
    assert len(NAMED) > 10 and {"kick", "servo", "viscous"} <= {x.split(".")[0] for x in NAMED}


def test_inertias_in_the_documents_are_those_of_the_model():
    import mujoco

    text = (ROOT / "docs" / "equations.md").read_text()
    model = hc.build(hc.free())
    link1 = float(model.body("link1").inertia[2])
    shoulder = constants.L1**2 / constants.S[0].gain
    elbow = constants.L2**2 / constants.S[1].gain
    for inertia in (link1, shoulder, elbow):
        assert f"{inertia:.6g} kg·m²" in text
    mujoco.MjModel.from_xml_path(str(engine.mjcf_folder() / "arm.xml"))


def test_every_public_name_has_a_docstring():
    for name, made in NAMES.items():
        assert made.__doc__ or name == "SCENARIOS", name


def test_changelog_has_the_present_version():
    assert f"## [{hc.__version__}]" in (ROOT / "CHANGELOG.md").read_text()


START = (ROOT / "docs" / "start.md").read_text()


@pytest.mark.parametrize("block", re.findall(r"```python\n(.*?)```", START, re.S))
def test_start_page_says_what_it_prints(block, tmp_path):
    out = printed_by(block, tmp_path)
    assert out.splitlines() == re.findall(r"print\(.*\)  # (.*)", block) != []


def test_the_home_page_says_what_its_lines_print(tmp_path):
    (code,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "index.md").read_text(), re.S)
    out = printed_by(code, tmp_path)
    assert out.splitlines() == re.findall(r"print\(.*\)  # ([^:\n]*)", code) != []


@pytest.mark.parametrize("line", re.findall(r"^    hapticclay (.+)$", START, re.M))
def test_start_page_commands_run(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert app.main([*shlex.split(line), "--no-plots"]) == 0


API = "\n".join(page.read_text() for page in sorted((ROOT / "docs" / "api").glob("*.rst")))
PAGES = sorted((ROOT / "docs").glob("*.md"))


def test_the_reference_has_every_public_name_once():
    entry = r"^\.\. (?:auto\w+|py:data):: (?:hapticclay\.)?([\w.]+)$"
    told = re.findall(entry, API, re.M)
    assert sorted(name for name in told if name in NAMES) == sorted(NAMES)


ENTRIES = re.findall(r"^\.\. (?:py:)?(currentmodule|auto\w+):: ([\w.]+)$", API, re.M)


def test_what_the_reference_names_exists():
    """Names that moved are found here, before the site is built."""
    module = "hapticclay"
    for kind, name in ENTRIES:
        if kind == "currentmodule":
            module = name
            continue
        dotted = name if name.startswith("hapticclay.") else f"{module}.{name}"
        pkgutil.resolve_name(dotted)


def test_no_public_name_is_deep():
    assert all(name.count(".") < 2 for name in NAMES)
    assert not re.search(r"\bhapticclay\.(?:studies|theory|model|simulation)\.\w+\.\w+", API)


SOURCES = [*(ROOT / "examples").rglob("*.py")]


def test_every_public_name_has_an_example():
    """Its own, that of a function which returns it, or one that its entry names."""
    entry = r"^\.\. auto\w+:: (?:hapticclay\.)?([\w.]+)\n(?:   :.*\n)*\n   (?:\.\. mini|Example:)"
    used = set(re.findall(entry, API, re.M)).union(*(used_in(x.read_text()) for x in SOURCES))
    while more := set().union(*map(told_by, used)) - used:  # a Coefficient is told by an Identified
        used |= more
    assert set(NAMES) - used == set()


@pytest.mark.parametrize("page", PAGES, ids=[page.stem for page in PAGES])
def test_links_within_the_documents_lead_somewhere(page):
    """Files exist, and headings too; the site's own build checks them again."""
    for target in re.findall(r"\]\((?!https?:)([^)\s]+)\)", page.read_text()):
        name, _, heading = target.partition("#")
        if re.match(r"gallery/", name):  # made by the build
            continue
        file = page.parent / name if name else page
        assert file.is_file(), target
        if heading:
            titles = re.findall(r"^#+ (.*)$", file.read_text(), re.M)
            assert heading in {re.sub(r"[^\w\- ]", "", t.lower()).replace(" ", "-") for t in titles}


TEXTS = [*(x for x in PAGES if x.suffix == ".md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]


def commands_in(text):
    """Commands that a reader copies: lines of blocks, and words in backquotes."""
    text = re.sub(r"\\\n\s*", "", text)  # a line that goes on
    blocks = re.findall(r"^ {4}hapticclay (.+)$", text, re.M)
    fences = re.findall(r"^```\w*\n(.*?)^```", text, re.M | re.S)
    return blocks + [x for f in fences for x in re.findall(r"^hapticclay (.+)$", f, re.M)]


@pytest.mark.parametrize("page", TEXTS, ids=[page.stem for page in TEXTS])
def test_a_command_can_be_copied_as_it_stands(page):
    """A shell ends it at its remark; the command line takes its words, and ignores none."""
    for line in commands_in(page.read_text()):
        assert line.isascii(), line
        parser.read(shlex.split(line, comments=True))


@pytest.mark.parametrize("page", TEXTS, ids=[page.stem for page in TEXTS])
def test_an_option_in_the_text_is_set_as_code(page):
    """Elsewhere a page may turn its two hyphens into a dash."""
    text = re.sub(r"^(```|~~~).*?^\1|<!--.*?-->", "", page.read_text(), flags=re.S | re.M)
    text = re.sub(r"^ {4}.*$", "", text, flags=re.M)
    text = re.sub(r"(`+)(?!`).+?(?<!`)\1(?!`)", "", text, flags=re.S)
    assert re.findall(r"(?<![-\w|:])--[A-Za-z][\w-]*", text) == []


@pytest.mark.parametrize("page", TEXTS, ids=[page.stem for page in TEXTS])
def test_a_file_of_the_checkout_that_a_page_names_is_there(page):
    for name in re.findall(r"\b(?:tests|benchmarks|examples)/[\w/.-]+\.\w+", page.read_text()):
        if "NAME" not in name and "FOLDER" not in name:
            assert (ROOT / name).is_file(), name
