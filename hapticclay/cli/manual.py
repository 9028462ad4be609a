"""The help pages of the command line."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence

import cyclopts
from rich.console import Console

from . import parser
from .commands import COMMANDS, load_command
from .options import RECORD, SCENARIO

NARROWEST = 20  # columns of a terminal in which help is laid out; in five that never ends
ABOUT = "Virtual clay, cut with a simulated haptic arm."
MORE = "hapticclay COMMAND --help shows the options of a command."


def print_help(words: Sequence[str]) -> None:
    """Prints the help page of a command line."""
    if not words or words[0].startswith("-"):
        app = parser.new_app("hapticclay", ABOUT)
        for name in COMMANDS:
            _list(app, name, load_command(name))
        app.help_epilogue = MORE
    else:
        line, _ = parser.begun(words, whole=False)
        app = parser.app_of(line)
        if SCENARIO in line.options:
            _add_experiments(app, line)
    width = max(shutil.get_terminal_size().columns, NARROWEST)
    color = None if os.environ.get("NO_COLOR") else "auto"
    app.help_print([], console=Console(width=width, color_system=color))


def _add_experiments(app: cyclopts.App, line: parser.Line) -> None:
    from ..scene.experiments import EXPERIMENTS

    for name, kind in EXPERIMENTS.items():
        _list(app, name, kind, group="Experiments")
    record = "|RECORD" if line.options[SCENARIO].note == RECORD else ""
    app.usage = f"Usage: hapticclay {line.name} EXPERIMENT|FILE{record} [OPTIONS]"
    app.help_epilogue = f"hapticclay {line.name} EXPERIMENT --help shows the options of one."


def _list(app: cyclopts.App, name: str, kind: type, **look: str) -> None:
    """Adds a line on what a command or an experiment is."""
    app.command(parser.new_app(name, parser.help_text(kind).partition("\n")[0], **look))
