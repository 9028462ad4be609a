"""Classics of haptics and teleoperation, compared with runs: a page and a command for each."""

from __future__ import annotations

import importlib

from ...errors import choice
from .classic import Classic

CLASSICS = (  # one module of this folder each, by year
    "niemeyer1991",
    "lawrence1993",
    "yokokohji1994",
    "colgate1997",
    "hannaford2002",
    "ryu2004",
    "abbott2005",
    "diolaiti2006",
    "hulin2006",
    "chawda2015",
)


def classic(name: str) -> Classic:
    """Returns a classic by name; imports its module on demand."""
    choice("classic", name, CLASSICS)
    return importlib.import_module(f"{__name__}.{name}").CLASSIC
