"""Every public name says what each of its arguments and fields is."""

import dataclasses
import inspect
import re

import pytest

from tests import public

FIRST = ("self", "cls")


def documented(made, *sections):
    """Names on lines of their own in sections of a docstring."""
    text = inspect.getdoc(made) or ""
    found = re.findall(rf"^(?:{'|'.join(sections)}):\n((?:[ \t]+.*\n?|\n)+)", text + "\n", re.M)
    return set(re.findall(r"^ {4}\*{0,2}(\w+)(?: \(.*?\))?:", "\n".join(found), re.M))


def lacking(made):
    """Arguments that a function's docstring, or that of what it overrides, leaves out."""
    if not inspect.getdoc(made):
        return ["a docstring"]
    names = [n for n in inspect.signature(inspect.unwrap(made)).parameters if n not in FIRST]
    told = documented(made, "Args", "Attributes")
    return [n for n in names if n not in told and not n.startswith("_")]


def methods(kind):
    """Public methods of a class by name, those of its bases in this package too."""
    for base in kind.__mro__:
        if base.__module__.startswith("hapticclay"):
            for name, made in vars(base).items():
                made = getattr(made, "__func__", made)
                if inspect.isfunction(made) and not name.startswith("_"):
                    yield name, made


def undocumented(made):
    """What a public function or class leaves out, by name."""
    if not isinstance(made, type):
        return {"": lacking(made)}
    told = documented(made, "Args", "Attributes")
    fields = dataclasses.fields(made) if dataclasses.is_dataclass(made) else ()
    names = [f.name for f in fields] or list(getattr(made, "_fields", ()))
    for base in made.__mro__[1:]:
        told |= documented(base, "Args", "Attributes")
    out = {"": [n for n in names if n not in told and not n.startswith("_")]}
    for name, method in methods(made):  # an override has the arguments of what it overrides
        left = lacking(method)
        out[name] = [n for n in left if n in out.get(name, left)]
    return out


@pytest.mark.parametrize("name", [n for n, x in public.NAMES.items() if callable(x)])
def test_every_public_argument_is_documented(name):
    """Each stands as `name:` on a line of its own under Args or Attributes."""
    found = {where: names for where, names in undocumented(public.NAMES[name]).items() if names}
    assert not found


def test_what_is_not_documented_is_found():
    """The check itself, on what it must tell apart."""

    @dataclasses.dataclass(frozen=True)
    class Part:
        """A part.

        Attributes:
            gain: of the loop [1/kg].
            one, two: both on one line.
        """

        gain: float
        one: float
        _own: float

        def run(self, t, *, every, **more):
            """Runs it.

            Args:
                t: time [s]; every: not on a line of its own.
                more: options.
            """

    Part.__module__ = "hapticclay.model"
    assert undocumented(Part) == {"": ["one"], "run": ["every"]}

    def go(a, *rest, _c=None):
        """Goes. Args: a: no section."""

    assert undocumented(go) == {"": ["a", "rest"]}
