"""The commands of `hapticclay`: a module of this folder each, imported when it is used."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

SHARED = (
    "app",
    "arm_options",
    "commands",
    "console",
    "device_options",
    "log_options",
    "manual",
    "options",
    "parser",
)
SHARED += ("unused", "walls")  # modules that are no commands
COMMANDS = {
    name: f"{__package__}.{name}"
    for _, name, _ in pkgutil.iter_modules([str(Path(__file__).parent)])
    if name not in SHARED
}
"""Module of each command by its name. It has a class NameCommand, upper and lower case alike, a
dataclass of the options; calling it returns the exit status."""

MOST = ("arm", "pair", "device", "zwidth", "identify", "run", "view")  # what most people need
GROUPS = {
    "Measured data": ("columns", "fit", "replay"),
    "Stability and walls": ("stability", "mbk", "passivity", "impedance", "robustness", "compare"),
    "Many runs, and their records": ("sweep", "accuracy", "info", "export", "video"),
    "What a scene is made of": ("fields", "materials"),
    "Courses and learning": ("lab", "gym"),
    "The paper, and the package": ("reproduce", "bench", "version"),
}


def groups() -> dict[str, tuple[str, ...]]:
    """The commands beside MOST, by what they are about; those of no group come last."""
    known = {*MOST, *(name for names in GROUPS.values() for name in names)}
    others = tuple(name for name in COMMANDS if name not in known)
    return GROUPS | ({"Others": others} if others else {})


def load_command(name: str) -> type:
    """The class of a command, whose module is imported only now."""
    module = importlib.import_module(COMMANDS[name])
    return next(x for n, x in vars(module).items() if n.lower() == f"{name}command")
