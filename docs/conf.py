"""Sphinx configuration: `make docs` builds the site, docs/*.md are its pages.

docs/gallery is made from examples/, and no part of the checkout.
"""

import collections
import functools
import logging
import os
import re
import sys
import typing
import zlib
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "agg")
logging.getLogger("fontTools").setLevel(logging.WARNING)  # it tells of each table of a font
DOCS = Path(__file__).parent
COLON = "\N{RATIO}"  # stands for a colon while napoleon looks for one
sys.path.insert(0, str(DOCS.parent))  # the checkout, not an installed release

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402
import xarray as xr  # noqa: E402
from matplotlib.figure import Figure  # noqa: E402
from sphinx_gallery.sorting import ExplicitOrder  # noqa: E402

import hapticclay as hc  # noqa: E402
from hapticclay.model import spring  # noqa: E402
from hapticclay.scene import scenario  # noqa: E402
from hapticclay.views.record_plots import RecordPlots  # noqa: E402
from tests.public import NAMES, told_by, used_in  # noqa: E402

CHECKED = {  # imported for type checks alone, or by the module of a base class
    "np": np,
    "DataFrame": pd.DataFrame,
    "Dataset": xr.Dataset,
    "Figure": Figure,
    "Accuracy": hc.Accuracy,
    "RecordPlots": RecordPlots,
    "Render": scenario.Render,
    "STIFFNESS_MAX": spring.STIFFNESS_MAX,
}

project = "hapticclay"
author = "The hapticclay authors"
copyright = author
version = release = hc.__version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.intersphinx",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx-mathjax-offline",  # MathJax is part of the site, which needs no network
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["templates", "gallery/**/*.ipynb", "**/sg_execution_times.rst"]
highlight_language = "none"  # indented blocks are equations and commands
default_role = "py:obj"  # `name` in a docstring links to the name, where there is one
myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]  # as GitHub writes display formulas
mathjax3_config = {"chtml": {"scale": 0.95}}  # letters as high as those of the text
suppress_warnings = ["config.cache"]  # of functions in sphinx_gallery_conf
nitpicky = True
nitpick_ignore_regex = [
    ("py:obj", ".*"),  # `text` in a docstring may be any code
    ("py:class", r"hapticclay\.scene\.\w+\.T|mujoco\._structs\.MjModel"),
    ("py:class", r"hapticclay\.model\.traits\.\w+|.*\.Ladder|Service|PairPlant"),  # not public
    ("py:class", r".*\.Exchanged|Chart"),  # what logs and labs hold
    ("py:class", r".*\.(StabilityMap|YieldMap)"),  # made by the command line
    (
        "py:class",
        r".*\.Mechanism|(.*\.)?(Stamps|Table|Progress|Reading)",
    ),  # what arms and logs hold
    ("py:class", r"(.*\.)?Saved"),  # what a snapshot holds
    ("py:class", r"[\d.]+"),  # bounds of one kind of force of several
    ("py:class", r"gymnasium\..*"),  # by their private modules
    ("py:class", r"collections\.abc\.Callable\[\[\]"),  # beside a default that is a function
]
linkcheck_timeout = 20

smartquotes_action = "qe"  # no dashes: an option, --quick, remains what it is

html_theme = "furo"
html_title = f"hapticclay {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_copy_source = False
pygments_dark_style = "monokai"
templates_path = ["templates"]
html_context = {"versions": [x.split("=", 1) for x in os.environ.get("DOCS_VERSIONS", "").split()]}
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "sidebar/versions.html",
        "sidebar/scroll-end.html",
    ]
}

napoleon_numpy_docstring = False
napoleon_use_ivar = True  # the fields of a part in one list
napoleon_use_rtype = False
napoleon_attr_annotations = False  # the signature has the types
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_typehints = "signature"
python_maximum_signature_line_length = 88
add_module_names = False
toc_object_entries_show_parents = "hide"

SECTIONS = (
    "tutorials symptoms runs records clay parts hardware theory walls studies robustness".split()
)
SOURCES = [*DOCS.parent.glob("examples/*/*.py")]
FIRST = ["first_cut.py", "force_over_velocity.py"]  # of their sections; the others by name
sphinx_gallery_conf = {
    "examples_dirs": ["../examples"],
    "gallery_dirs": ["gallery"],
    "filename_pattern": r"\.py$",
    "subsection_order": ExplicitOrder([*(f"../examples/{x}" for x in SECTIONS), "*"]),
    "within_subsection_order": ExplicitOrder(FIRST + sorted({x.name for x in SOURCES} - {*FIRST})),
    "backreferences_dir": "gallery/backreferences",
    "doc_module": ("hapticclay",),
    "abort_on_example_error": True,
    "capture_repr": (),
    "remove_config_comments": True,
    "image_srcset": ["2x"],
    "write_computation_times": False,
    "download_all_examples": False,
}


def write_inventories(folder: Path) -> dict[str, tuple[str, str]]:
    """Turns docs/objects.txt into inventories, so that a build needs no network.

    Args:
        folder: where they are written.

    Returns:
        `intersphinx_mapping`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mapping, names = {}, {}
    for line in (DOCS / "objects.txt").read_text().splitlines():
        if line.startswith("["):
            project, address = line.strip("[]").split()
            mapping[project] = (address, str(folder / f"{project}.inv"))
            names[project] = []
        elif line:
            name, role, place = line.split()
            names[project].append(f"{name} py:{role} 1 {place} -\n")
    for project, lines in names.items():
        head = f"# Sphinx inventory version 2\n# Project: {project}\n# Version:\n"
        head += "# The remainder of this file is compressed using zlib.\n"
        body = zlib.compress("".join(lines).encode())
        (folder / f"{project}.inv").write_bytes(head.encode() + body)
    return mapping


intersphinx_mapping = write_inventories(DOCS.parent / "out" / "inventories")


def list_others(app, docname: str, source: list[str]) -> None:
    """Lists under How-to the pages of docs/ that no other page lists.

    Args:
        app: the application.
        docname: name of the page.
        source: its text, changed in place.
    """
    if docname == "howto":
        listed = {
            "index",
            *re.findall(r"^[\w/]+$", "\n".join(map(toctrees, DOCS.glob("*.md"))), re.M),
        }
        others = sorted(page.stem for page in DOCS.glob("*.md") if page.stem not in listed)
        source[0] = source[0].replace("(others)", "\n".join(others))


@functools.cache
def terms() -> dict[str, list[str]]:
    """Pages, and the terms of readers of which they are the first page: docs/terms.txt."""
    lines = (line.partition(": ") for line in (DOCS / "terms.txt").read_text().splitlines())
    return {name: told.split("; ") for name, _, told in lines}


def index_terms(app, docname: str, source: list[str]) -> None:
    """Puts the terms of a page into the index, which the search looks up first.

    Args:
        app: the application.
        docname: name of the page.
        source: its text, changed in place.
    """
    if docname in terms():
        title, _, rest = source[0].partition("\n")
        entries = "\n\n".join(f"```{{index}} ! single: {x}\n```" for x in terms()[docname])
        source[0] = f"{title}\n\n{entries}\n\n{rest}"


def toctrees(page: Path) -> str:
    """The toctrees of a page.

    Args:
        page: its file.
    """
    return "\n".join(re.findall(r"^```\{toctree\}\n(.*?)^```", page.read_text(), re.M | re.S))


def plain_types(app, call, bound_method: bool) -> None:
    """Resolves the types of a signature, without bounds: the docstring states these.

    Args:
        app: the application.
        call: the function.
        bound_method: whether it is a method.
    """
    call = getattr(call, "__func__", call)
    spelled = getattr(call, "__annotations__", {})
    if signature := getattr(call, "__signature__", None):
        spelled = {
            name: re.sub(r" \[[^\]]*\]$", "", p.annotation)
            if isinstance(p.annotation, str)
            else p.annotation
            for name, p in signature.parameters.items()
        }
    module = vars(sys.modules.get(call.__module__, hc))
    found = {name: resolved(text, module) for name, text in spelled.items()}
    if signature:
        given = [p.replace(annotation=found[n]) for n, p in signature.parameters.items()]
        call.__signature__ = signature.replace(parameters=given)
    elif found:
        call.__annotations__ = found


def plain_defaults(app, what, name, thing, options, signature, returned):
    """Writes a signature as Python: ... for a default that is made anew, and types without units.

    Args:
        app: the application.
        what: kind of the object.
        name: its name.
        thing: the object.
        options: of the directive.
        signature: the text of its arguments.
        returned: the text of what it returns.
    """
    spelled = (signature or "").replace("<factory>", "...")
    spelled = re.sub(r"(?<![\w.])(?:np\.)?ndarray", "numpy.ndarray", spelled)
    return re.sub(r"(?<!=) \[[^\]]*\]", "", spelled) or None, returned


def resolved(annotation, module: dict):
    """The type of an annotation without its bounds; the text itself where it has none.

    Args:
        annotation: a type, or its text.
        module: names of the module that has the annotation.
    """
    holder = type("Holder", (), {"__annotations__": {"it": annotation}})
    try:
        return typing.get_type_hints(holder, {**CHECKED, **module})["it"]
    except (NameError, TypeError):
        return annotation


def plain_text(app, what: str, name: str, thing, options, lines: list[str]) -> None:
    """Escapes what reStructuredText would take for markup, as in |v|: before napoleon.

    Args:
        app: the application.
        what: kind of the object.
        name: its name.
        thing: the object.
        options: of the directive.
        lines: its docstring, changed in place.
    """
    out, code = [], False
    for last, line in zip(["", *lines], lines, strict=False):
        if line and not line.startswith(" "):
            code = False
        elif line and not last and out and not code and not section(out):
            out += ["::", ""]  # an indented block outside of a section
            code = True
        out.append(line if code else typeset_unit(re.sub(r"([|*\\])", r"\\\1", line)))
    if what in ("property", "attribute") and out:  # "The speed: ..." has no type to split off
        out[0] = out[0].replace(":", COLON)
    lines[:] = out


def typeset_unit(text: str) -> str:
    """Units with a centred dot and raised powers, as figures and pages have them."""
    text = re.sub(r"\b(N|kg)\.(?=[sm]\b)", r"\1·", text)
    return re.sub(r"(?<=[ms])\^2\b", "²", text)


def section(lines: list[str]) -> bool:
    """Whether the last line that is not indented is the head of a section.

    Args:
        lines: of the docstring so far.
    """
    heads = [line for line in lines if line and not line.startswith(" ")]
    return bool(heads) and re.fullmatch(r"[A-Z]\w+:", heads[-1]) is not None


def mended(app, what: str, name: str, thing, options, lines: list[str]) -> None:
    """Joins what napoleon took for the type of a returned value, and adds the examples.

    Args:
        app: the application.
        what: kind of the object.
        name: its name.
        thing: the object.
        options: of the directive.
        lines: its docstring, changed in place.
    """
    text = re.sub(r"^(:returns: )\*(.*?)\* -- ", r"\1\2: ", "\n".join(lines), flags=re.M)
    lines[:] = text.replace(COLON, ":").splitlines()
    if what in ("class", "function", "exception") and (found := examples_of(name)):
        lines += ["", ".. minigallery::", "", *(f"   {path}" for path in found), ""]


def examples_of(name: str) -> list[str]:
    """The examples that use a name: those that use the fewest others, three at most.

    Args:
        name: with its module.
    """
    uses, size = gallery_uses()
    return sorted(uses.get(name, ()), key=lambda path: (size[path], path))[:3]


@functools.cache
def gallery_uses() -> tuple[dict[str, set[str]], collections.Counter]:
    """Examples by the public name that they use, and how many names each uses."""
    uses: dict[str, set[str]] = collections.defaultdict(set)
    for path in SOURCES:
        for name in used_in(path.read_text()):
            uses[f"hapticclay.{name}"].add(os.path.relpath(path, DOCS))
    for name in NAMES:  # what a function returns, as a Verdict, and what that consists of
        for result in told_by(name):
            uses[f"hapticclay.{result}"] |= uses[f"hapticclay.{name}"]
    return uses, collections.Counter(path for paths in uses.values() for path in paths)


def setup(app):
    app.connect("source-read", list_others)
    app.connect("source-read", index_terms)
    app.connect("autodoc-before-process-signature", plain_types)
    app.connect("autodoc-process-signature", plain_defaults)
    app.connect("autodoc-process-docstring", plain_text, priority=400)
    app.connect("autodoc-process-docstring", mended, priority=600)
