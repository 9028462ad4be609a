"""Checks of the names and types of arguments of public functions and classes."""

from __future__ import annotations

import contextlib
import functools
import inspect
import itertools
import os
import pkgutil
import re
import sys
import types
from collections import ChainMap
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from .errors import ParameterError, nearest

F = TypeVar("F", bound=Callable[..., Any])
IN_WORDS: dict[Any, str] = {
    Callable: "a function",
    Iterable: "an iterable, as a list",
    Mapping: "a dictionary",
    dict: "a dictionary",
    bool: "True or False",
    os.PathLike: "a path",
    type(None): "None",
}
WIDER: dict[Any, Any] = {Sequence: Iterable, Path: os.PathLike}  # an array is not a Sequence


class UnknownArgument(ParameterError, TypeError):
    """An argument with an unknown name was refused."""


def known_names(name: str, given: Mapping[str, Any], known: Collection[str]) -> None:
    """Refuses arguments of unknown names."""
    for word, value in given.items():
        if word not in known:
            near = nearest(word, known)
            told = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
            raise UnknownArgument(word, value, f"unexpected argument of {name}; {told}") from None


def named(made: F) -> F:
    """Lets a function or a dataclass suggest the nearest name for an unknown argument."""
    inner: Any = made.__init__ if isinstance(made, type) else made

    @functools.wraps(inner)
    def guarded(*args: Any, **given: Any) -> Any:
        try:
            return inner(*args, **given)
        except TypeError:  # looked into only here: parts are made often
            parameters = _parameters(made)
            if all(p.kind is not p.VAR_KEYWORD for p in parameters.values()):
                known_names(made.__name__, given, parameters)
            raise

    if isinstance(made, type):
        made.__init__ = guarded
        made.__signature__ = SignatureInWords()  # type: ignore[attr-defined]
        return made  # type: ignore[return-value]
    return guarded  # type: ignore[return-value]


class SignatureInWords:
    """The signature of a class, and of each of its subclasses, with units in words."""

    def __get__(self, instance: Any, owner: type) -> inspect.Signature:
        init: Any = owner.__init__
        scopes = [vars(sys.modules[kind.__module__]) for kind in owner.__mro__]
        told = in_words(inspect.signature(init), ChainMap(*scopes))
        return told.replace(parameters=list(told.parameters.values())[1:])


class Words(str):
    """An annotation that a signature shows verbatim."""

    __repr__ = str.__str__


def in_words(signature: inspect.Signature, scope: Mapping[str, Any]) -> inspect.Signature:
    """A signature with units in place of bounds: `float [N/m]`."""
    return signature.replace(
        parameters=[
            p.replace(annotation=unit_in_words(p.annotation, scope))
            for p in signature.parameters.values()
        ]
    )


def unit_in_words(hint: Any, scope: Mapping[str, Any]) -> Any:
    """An annotation with units in place of bounds, and with aliases expanded."""
    if not isinstance(hint, str):
        return hint
    unit = ""
    if found := re.fullmatch(r"Annotated\[(.*), (?:Bound\((.*)\)|(\w+))\]", hint, re.S):
        hint, inner, name = found.groups()
        unit = (
            scope[name].unit if name else "".join(re.findall(r"(?:, |unit=)'([^']+)'", inner)[:1])
        )
    units = [unit] if unit else []

    def spelled(match: re.Match[str]) -> str:
        named_ = scope.get(match[0])
        if get_origin(named_) is Annotated:
            units.append(get_args(named_)[1].unit)
        return _alias_text(named_) or match[0]

    text = re.sub(r"\b(?<!')[A-Z]\w*\b(?!')", spelled, hint)
    return Words(text + _of_unit(", ".join(dict.fromkeys(filter(None, units)))))


def _alias_text(kind: Any) -> str:
    """The expansion of an alias of a type; "" for anything else."""
    if get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    elif get_origin(kind) not in (Literal, Union, types.UnionType):
        return ""
    if isinstance(kind, type) and not get_args(kind):
        return kind.__name__
    return str(kind).replace("typing.", "")


def _of_unit(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def checked(made: F) -> F:
    """As `named`, and refuses arguments that are not of the classes in their annotations.

    The function itself checks numbers, words, arrays and tuples, since it knows their bounds.
    """
    inner: Any = made.__init__ if isinstance(made, type) else made
    parameters = list(_parameters(inner).values())
    kinds_of = [p.kind for p in parameters]
    many = inspect.Parameter.VAR_POSITIONAL  # as *changes, to which all further values belong
    end = kinds_of.index(many) if many in kinds_of else len(parameters)
    names, rest = [p.name for p in parameters[:end]], [p.name for p in parameters[end : end + 1]]

    @functools.wraps(inner)
    def entry(*args: Any, **given: Any) -> Any:
        kinds = argument_kinds(inner)
        ordered = itertools.chain(names, itertools.cycle(rest))
        for name, value in (*zip(ordered, args, strict=False), *given.items()):
            if name in kinds and not _is_of(value, kinds[name]):
                told = " or ".join(dict.fromkeys(map(_in_words, kinds[name])))
                raise ParameterError(name, value, f"must be {told}")
        return inner(*args, **given)

    if isinstance(made, type):
        made.__init__ = entry
        return named(made)  # type: ignore[return-value]
    return named(entry)  # type: ignore[arg-type]


def _is_of(value: Any, kinds: tuple[Any, ...]) -> bool:
    """Whether an argument is of one of the classes; a text is no list of characters."""
    if isinstance(value, str | bytes) and str not in kinds:
        return False
    if getattr(value, "ndim", 1) == 0 and Iterable in kinds:  # NumPy's scalars say they iterate
        return False
    return isinstance(value, kinds)


def _parameters(made: Any) -> Mapping[str, inspect.Parameter]:
    return inspect.signature(made).parameters


@functools.cache
def argument_kinds(made: Callable[..., Any]) -> dict[str, tuple[Any, ...]]:
    """Required classes of the arguments of a function; no entry for those it checks itself."""
    hints = get_type_hints(made)
    found = {name: _classes(hints[name]) for name in _parameters(made) if name in hints}
    return {name: kinds for name, kinds in found.items() if kinds}


def _classes(hint: Any) -> tuple[Any, ...]:
    """The classes of a type; none if classes do not determine it, as for numbers and arrays."""
    members = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    kinds = tuple(get_origin(m) or m for m in members)
    kinds = tuple(WIDER.get(k, k) for k in kinds)
    plain = (k for k in kinds if k is not str or os.PathLike not in kinds)
    told = all(isinstance(k, type) and (k in IN_WORDS or _is_own(k)) for k in plain)
    return kinds if told else ()


def _is_own(kind: Any) -> bool:
    return kind.__module__.partition(".")[0] == __name__.partition(".")[0]


def _in_words(kind: Any) -> str:
    if kind in IN_WORDS:
        return IN_WORDS[kind]
    if kind is str:
        return IN_WORDS[os.PathLike]
    return f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}"


def function_name(function: Any) -> str:
    """The name "package.module:name" by which a function can be imported; "" for none."""
    name = f"{getattr(function, '__module__', '')}:{getattr(function, '__qualname__', '')}"
    with contextlib.suppress(ImportError, AttributeError, ValueError):
        if not name.startswith("__main__") and pkgutil.resolve_name(name) is function:
            return name
    return ""
