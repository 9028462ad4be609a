"""Who makes the steps of a run: the compiled kernel where it is there, else CPython."""

from __future__ import annotations

import sys
from importlib.metadata import distributions
from pathlib import Path

from ..errors import ParameterError, choice
from ..kernel import native

ENGINES = ("auto", "python", "native")
LONG = 50_000  # steps that take Python more than a second
STALE = "built from other sources"  # how a clone is after its sources have changed
_notice_given = False


def engine_for(engine: str, steps: float = 0.0) -> str:
    """Who makes the steps, "python" or "native"."""
    engine = choice("engine", engine, ENGINES)
    if engine == "python":
        return engine
    why = native.why_not()
    if not why:
        return "native"
    if engine == "native":
        raise ParameterError("engine", engine, f"needs the compiled kernel ({why}): {remedy(why)}")
    if steps > LONG or (why.startswith(STALE) and _in_clone()):
        give_notice(why)
    return "python"


def remedy(why: str) -> str:
    """What gets the compiled kernel."""
    root = native.PACKAGE.parent
    again = f"pip install -e {root}" if _in_clone() else "pip install . again"
    if why == "not built" and _installed_elsewhere():
        return f"these are the sources: run outside {root}, where the installed one is, or {again}"
    lacks = "compiler" in why or "Python.h" in why
    return f"apt install gcc python3-dev, then {again}" if lacks else again


def _in_clone() -> bool:
    """Whether these are the sources, with what builds them beside them."""
    return (native.PACKAGE.parent / "setup.py").is_file()


def _installed_elsewhere() -> bool:
    """Whether Python would import another hapticclay, had it not found this one."""
    places = (Path(str(d.locate_file("hapticclay"))) for d in distributions(name="hapticclay"))
    return any(
        (p / "__init__.py").is_file() and p.resolve() != native.PACKAGE.resolve() for p in places
    )


def made_by() -> str:
    """Who makes the steps of runs here, and why if it is Python."""
    why = native.why_not()
    return f"Python: no compiled kernel ({why}); {remedy(why)}" if why else "the compiled kernel"


def give_notice(why: str) -> None:
    """Says once that runs are slow, why, and what helps."""
    global _notice_given
    if not _notice_given:
        _notice_given = True
        print(
            "hapticclay: Python makes the steps, some 15 times slower: "
            f"no compiled kernel ({why}); {remedy(why)}",
            file=sys.stderr,
        )
