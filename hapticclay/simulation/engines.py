"""Who makes the steps of a run: the compiled kernel where it is there, else CPython."""

from __future__ import annotations

import sys

from ..errors import ParameterError, choice
from ..kernel import native

ENGINES = ("auto", "python", "native")
REMEDY = "install a C compiler and Python's headers (apt install gcc python3-dev), then hapticclay"
LONG = 50_000  # steps that take Python more than a second
_told = False


def engine_for(engine: str, steps: float = 0.0) -> str:
    """Who makes the steps, "python" or "native".

    Args:
        engine: as a user gives it; "auto" takes the compiled kernel where it is there.
        steps: number of steps that are asked for; many in Python are worth a line on stderr.

    Raises:
        ParameterError: "native" where there is no compiled kernel.
    """
    engine = choice("engine", engine, ENGINES)
    if engine == "python":
        return engine
    why = native.why_not()
    if not why:
        return "native"
    if engine == "native":
        raise ParameterError("engine", engine, f"needs the compiled kernel ({why}): {REMEDY}")
    if steps > LONG:
        tell(why)
    return "python"


def tell(why: str) -> None:
    """Says once that runs are slow, why, and what helps.

    Args:
        why: there is no compiled kernel.
    """
    global _told
    if not _told:
        _told = True
        print(
            "hapticclay: Python makes the steps, some 15 times slower: no compiled kernel "
            f"({why}); {REMEDY}",
            file=sys.stderr,
        )
