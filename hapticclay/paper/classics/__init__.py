"""Classic results of haptics, each beside runs of the simulator: a page and a command for each."""

from __future__ import annotations

import importlib

from ...errors import choice
from .classic import Classic

CLASSICS = (  # a module of this folder each, in the order of the years
    "colgate1997",
    "hannaford2002",
    "abbott2005",
    "diolaiti2006",
    "hulin2006",
    "chawda2015",
)


def classic(name: str) -> Classic:
    """A classic by name; its module is imported only now.

    Args:
        name: as in CLASSICS.

    Raises:
        ParameterError: there is no such classic.
    """
    choice("classic", name, CLASSICS)
    return importlib.import_module(f"{__name__}.{name}").CLASSIC
