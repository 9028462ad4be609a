"""The help pages of the command line."""

from __future__ import annotations

import inspect
import io
import os
import shutil
import sys
import textwrap
from collections.abc import Sequence

from ..fields import UNSET
from . import parser
from .commands import MOST, groups, load_command
from .options import SCENARIO

NARROWEST = 20  # columns of a terminal in which help is laid out; in five that never ends
PAPER = (
    "Sections, figures and equations are those of Her, Hsu, Lan, Karkoub, J. Intelligent and "
    "Robotic Systems 35 (2002)."
)
ABOUT = "A simulator of a person's hand, an arm or a haptic device, and virtual clay in one loop."


def print_help(words: Sequence[str]) -> None:
    width = max(shutil.get_terminal_size().columns, NARROWEST)
    if words and not words[0].startswith("-"):
        _print_command(words, width)
        return
    _print_begin(width)
    for title, names in groups().items():
        print(f"\n{title}:")
        _print_commands(names, width)
    print("\n" + textwrap.fill("hapticclay COMMAND --help shows the options of a command.", width))


def print_overview() -> None:
    """What most people need, and the names of the rest."""
    width = max(shutil.get_terminal_size().columns, NARROWEST)
    _print_begin(width)
    print()
    for title, names in groups().items():
        text, indent = f"{title}: {', '.join(names)}", " " * 2
        print(textwrap.fill(text, width, subsequent_indent=indent))
    last = "hapticclay --help says what each is for, hapticclay COMMAND --help shows its options."
    print("\n" + textwrap.fill(last, width))


def _print_begin(width: int) -> None:
    """What the program is, and the commands that most people need."""
    print(f"Usage: hapticclay COMMAND [OPTIONS]\n\n{textwrap.fill(ABOUT, width)}\n")
    _print_commands(MOST, width)


def _print_commands(names: Sequence[str], width: int) -> None:
    for name in names:
        text, indent = f"  {name:11} {_paragraphs(load_command(name))[0]}", " " * 14
        print(textwrap.fill(text, width, subsequent_indent=indent))


def _print_command(words: Sequence[str], width: int) -> None:
    from rich.console import Console

    line, _ = parser.begun(words, whole=False)
    app, about = parser.app_of(line), _paragraphs(line.kind)
    if SCENARIO in line.options or line.origin:
        from ..scene.experiments import EXPERIMENTS

        if line.origin == parser.EXPERIMENT:
            about, app.help_epilogue = _paragraphs(EXPERIMENTS[line.source]), PAPER
        elif not line.origin:
            for name, kind in EXPERIMENTS.items():
                app.command(parser.new_app(name, help=_paragraphs(kind)[0], group="Experiments"))
            app.help_epilogue = (
                f"hapticclay {line.name} EXPERIMENT --help shows the options of one. {PAPER}"
            )
    loose = [option for option in line.options.values() if option.note]
    shown = [option.usage if option.default is UNSET else f"[{option.usage}]" for option in loose]
    usage = " ".join(["Usage: hapticclay", line.path, *shown, "[OPTIONS]"])
    for text in (usage, *about):
        print(textwrap.fill(text, width) + "\n")
    color = None if os.environ.get("NO_COLOR") else "auto"
    page = io.StringIO()  # not the output: rich flushes it, and exits with 1 where it is closed
    is_terminal = bool(sys.stdout) and sys.stdout.isatty()
    console = Console(file=page, width=width, color_system=color, force_terminal=is_terminal)
    app.help_print([], console=console)
    print(page.getvalue(), end="")


def _paragraphs(kind: type) -> list[str]:
    """What a command or an experiment is."""
    text = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")[0]
    return [" ".join(part.split()) for part in text.strip().split("\n\n")]
