"""The pages are found by the words of their readers, and name only what exists."""

import dataclasses
import importlib
import inspect
import pkgutil
import re
import tomllib
import types
from pathlib import Path

import pytest

import benchmarks
import hapticclay as hc
from hapticclay.theory.client_loop import Handle

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = {page.stem: page.read_text() for page in DOCS.glob("*.md")}
WRITTEN = {name: text for name, text in PAGES.items() if name not in ("changelog", "contributing")}
WRITTEN["README"] = (ROOT / "README.md").read_text()


TERMS = {
    name: told.split("; ")
    for name, _, told in (x.partition(": ") for x in (DOCS / "terms.txt").read_text().splitlines())
}


def ranked(phrase):
    """Pages that a phrase finds, best first.

    The rule is that of the site's own search (Sphinx, searchtools.js): an entry of the index at
    least half of which is the phrase counts 100 by that share, a heading 15; a page that has every
    word counts 15 for one in its title and 5 for one in its text.
    """
    phrase, found = phrase.lower(), []
    words = re.findall(r"\w+", phrase)
    for name, text in PAGES.items():
        text = text.lower()
        headings = re.findall(r"^#+ (.*)$", text, re.M)
        scores = [0]
        for most, given in ((100, [x.lower() for x in TERMS.get(name, ())]), (15, headings)):
            named = (x for x in given if phrase in x and len(phrase) >= 0.5 * len(x))
            scores += [round(most * len(phrase) / len(x)) for x in named]
        if headings and all(word in text for word in words):
            scores += [15 if word in headings[0] else 5 for word in words]
        found.append((max(scores), name))
    return [name for score, name in sorted(found, reverse=True) if score]


@pytest.mark.parametrize("name", TERMS)
def test_a_page_has_the_words_of_its_terms(name):
    for term in TERMS[name]:
        for word in re.findall(r"\w+", term.lower()):
            assert word.removesuffix("s") in PAGES[name].lower(), (name, term)


def test_a_term_has_one_first_page():
    every = [term for told in TERMS.values() for term in told]
    assert len(set(every)) == len(every)


@pytest.mark.parametrize(
    "phrase, page",
    [
        ("virtual wall vibrates", "wall_vibrates"),
        ("MuJoCo says stable", "mujoco_stable"),
        ("which gain", "servo_gain"),
        ("URDF", "own_arm"),
        ("friction compensation", "arm"),
        ("zero-order hold", "wall_vibrates"),
        ("stick-slip", "stick_slip"),
        ("time-domain passivity", "passivity"),
        ("fast enough", "fast_enough"),
        ("stable in theory", "theory_and_practice"),
        ("velocity filter", "velocity_filter"),
        ("device from data", "identify_device"),
        ("test without a device", "device"),
        ("latency", "fast_enough"),
        ("virtual coupling", "hardware"),
        ("unilateral constraint", "springs"),
        ("event detection", "step"),
        ("impedance control", "impedance"),
        ("human-in-the-loop", "view"),
        ("Z-width", "zwidth"),
        ("passivity controller", "hardware"),
        ("quantization limit cycle", "zwidth"),
        ("encoder resolution", "zwidth"),
        ("haptics sampling rate", "fast_enough"),
        ("CRTK", "device"),
        ("Haply", "device"),
        ("Inverse3", "connect"),
        ("Gymnasium", "gym"),
    ],
)
def test_a_search_finds_its_page_first(phrase, page):
    assert ranked(phrase)[0] == page, ranked(phrase)[:4]


def test_the_terms_of_the_field_stand_in_the_glossary_and_on_a_page():
    terms = (
        "zero-order hold, latency, event detection, unilateral constraint, stick-slip, JND, "
        "Z-width, time-domain passivity, impedance control, admittance, virtual coupling, "
        "transparency, human-in-the-loop, hardware-in-the-loop, uncoupled stability"
    )
    for term in terms.split(", "):
        assert f"| {term} |" in PAGES["glossary"] or f"| {term}," in PAGES["glossary"], term
        others = " ".join(text for name, text in PAGES.items() if name != "glossary")
        assert term.lower() in others.lower(), term


def test_one_address_of_the_repository():
    address = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["urls"]["Repository"]
    for name in ("README", "index", "start", "policy"):
        named = re.findall(r"https://\S+?hapticclay(?=[\s/.])", WRITTEN[name])
        assert named and set(named) == {address}, name


CODE = {name: re.findall(r"`([^`\n]+)`", text) for name, text in WRITTEN.items()}


def resolved(dotted):
    """What a dotted name of hc stands for, a field of a part too; None if there is no such name."""
    thing = hc
    for word in dotted.split("."):
        if word in {x.name for x in fields_of(thing)}:
            return True
        thing = getattr(thing, word, None)
        if thing is None:
            return None
    return thing


def fields_of(thing):
    return dataclasses.fields(thing) if dataclasses.is_dataclass(thing) else ()


@pytest.mark.parametrize("page", sorted(CODE))
def test_a_name_of_the_package_in_the_text_exists(page):
    """`hc.Name`, and `Name(field=...)` of a part: with the fields that it has."""
    for span in CODE[page]:
        for dotted in re.findall(r"\bhc\.([A-Za-z_][\w.]*\w)", span):
            assert resolved(dotted), span
        for name, inside in re.findall(r"\b(?:hc\.)?([A-Z]\w+)\(([^()]*)\)", span):
            made = getattr(hc, name, None)
            if made is None:
                continue
            allowed = inspect.signature(made).parameters
            for field in re.findall(r"\b(\w+)=", inside):
                assert field in allowed, span


OTHER_PACKAGES = "index_col make_reader open_dataset read_csv set_options to_pandas".split()


@pytest.fixture(scope="module")
def identifiers():
    """Names of all that can be imported here, and of parameters, fields and keys."""
    found = {*OTHER_PACKAGES}
    for package in (hc, benchmarks):
        for x in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            found |= {*x.name.split(".")}
            if not re.search(r"native|peers|__main__|stable_baselines$", x.name):
                found |= names_in(importlib.import_module(x.name))
    return found


def names_in(thing, depth=0):
    """Names in a module or a class, and in its functions and classes."""
    found = {*dir(thing), *getattr(thing, "__annotations__", {})}
    for name, made in list(vars(thing).items()):
        made = inspect.unwrap(made) if callable(made) else getattr(made, "fget", made)
        if inspect.isfunction(made):
            found |= words_of(made.__code__)
        elif isinstance(made, dict):
            found |= {x for x in made if isinstance(x, str)}
        elif isinstance(made, type) and depth < 2 and not name.startswith("__"):
            found |= names_in(made, depth + 1)
    return found


def words_of(code):
    """Names and texts of a function, and of those within it."""
    found = {*code.co_varnames, *code.co_names}
    for x in code.co_consts:
        if isinstance(x, types.CodeType):
            found |= words_of(x)
        elif isinstance(x, str | tuple):
            found |= {y for y in ([x] if isinstance(x, str) else x) if isinstance(y, str)}
    return found


@pytest.mark.parametrize("page", sorted(set(CODE) - {"policy"}))
def test_an_identifier_in_the_text_exists(page, identifiers):
    """Names with an underscore: what was renamed is found here."""
    for span in CODE[page]:
        if "/" not in span and "." not in span.rpartition(" ")[2].rstrip("."):
            for word in re.findall(r"\b[a-z]{2,}_\w+\b", span):
                assert word in identifiers, span


@pytest.mark.parametrize("page, first", [("hardware", "jitter"), ("equations", "jitter")])
def test_the_fields_of_a_table_of_hardware_exist(page, first):
    rows = re.findall(r"^\| (.*?) \|", PAGES[page], re.M)
    named = " ".join(row for row in rows[next(i for i, x in enumerate(rows) if first in x) :])
    fields = {x.name for x in dataclasses.fields(hc.Hardware)} | {"torque_limit"}
    known = [name for name in re.findall(r"`(\w+)[`=]", named) if name != "velocity"]
    assert known and set(known) <= fields, set(known) - fields


def test_letters_and_names_of_the_glossary_exist():
    text = PAGES["glossary"].partition("## Letters")[2]
    letters, _, names = text.partition("## Names")
    for row in re.findall(r"^\| (?!letter|---)(.*?) \| (.*?) \|", letters, re.M):
        for span in re.findall(r"`([\w.]+)`", row[1]):
            part, _, field = span.removeprefix("hc.").partition(".")
            if field and part != "record":
                assert resolved(f"{part}.{field}") or field in named_in_theory(part), span
    for span in re.findall(r"^\| (`hc\..*?) \|", names, re.M):
        for dotted in re.findall(r"hc\.([\w.]+)", span):
            assert resolved(dotted), dotted
    assert fields_of(Handle)  # of a module that a page imports by its own name


def named_in_theory(name):
    made = getattr(hc.theory, name, None)
    return {x.name for x in fields_of(made)} | {*dir(made)} if made else set()
