"""Every public name, in which door it stands, and what it names."""

import re
import types

import hapticclay as hc

DOORS = ("theory", "walls", "studies", "materials", "ports")
NAMES = {
    f"{door}.{name}" if door else name: getattr(module, name)
    for door, module in [("", hc), *((x, getattr(hc, x)) for x in DOORS)]
    for name in module.__all__
    if not (name == "__version__" or isinstance(getattr(module, name), types.ModuleType))
}


def used_in(text):
    """Public names that a text uses, as hc.Grid.sample uses Grid."""
    found = set()
    for words in re.findall(r"\bhc\.([\w.]+)", text):
        head, *rest = words.split(".")
        found |= {head, f"{head}.{rest[0]}" if rest else head}
    return found & set(NAMES)


def told_by(name):
    """Public names in what a function returns, or in the fields of a class."""
    notes = dict(getattr(NAMES[name], "__annotations__", {}))
    text = notes.get("return", "") if "return" in notes else list(notes.values())
    words = set(re.findall(r"\w+", str(text)))
    return {other for other in NAMES if other.rpartition(".")[2] in words}
