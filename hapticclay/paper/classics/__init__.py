"""Classic results of haptics, compared with runs: one page and one command for each."""

from __future__ import annotations

import importlib

from ...errors import choice
from .classic import Classic

CLASSICS = (  # one module of this folder each, by year
    "colgate1997",
    "hannaford2002",
    "abbott2005",
    "diolaiti2006",
    "hulin2006",
    "chawda2015",
)


def classic(name: str) -> Classic:
    """Returns a classic by name; imports its module on demand."""
    choice("classic", name, CLASSICS)
    return importlib.import_module(f"{__name__}.{name}").CLASSIC
