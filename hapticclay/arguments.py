"""Checks of the names and types of arguments of public functions and classes."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import inspect
import itertools
import re
from collections.abc import Callable, Collection, Mapping
from typing import (
    Annotated,
    Any,
    ParamSpec,
    TypeVar,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

from .errors import Bound, ParameterError, nearest
from .fields import Node, check_fields, field_descriptions, node_of
from .threads import one_thread

P = ParamSpec("P")
T = TypeVar("T")
R = TypeVar("R")
F = TypeVar("F", bound=Callable[..., Any])
QUESTIONS = ("hapticclay.theory.", "hapticclay.studies.")  # modules whose matrices are small


class UnknownArgument(ParameterError, TypeError):
    """An argument with an unknown name was refused."""


def known_names(name: str, given: Mapping[str, Any], known: Collection[str]) -> None:
    """Refuses arguments of unknown names."""
    for word, value in given.items():
        if word not in known:
            near = nearest(word, known)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(known)}"
            raise UnknownArgument(word, value, f"unexpected argument of {name}; {hint}") from None


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


@dataclass_transform(frozen_default=True, field_specifiers=(dataclasses.field,))
def part(prefix: str = "", **options: Any) -> Callable[[type[T]], type[T]]:
    """Makes a frozen dataclass, `named`, whose fields are checked by their annotations.

    Its own `__post_init__` follows the check. prefix stands before the fields in errors.
    """

    def decorate(kind: type[T]) -> type[T]:
        own = vars(kind).get("__post_init__")

        def __post_init__(self: Any) -> None:
            check_fields(self, prefix)
            if own is not None:
                own(self)

        kind.__post_init__ = __post_init__  # type: ignore[attr-defined]
        return named(dataclasses.dataclass(frozen=True, **options)(kind))

    return decorate


class SignatureInWords:
    """The signature of a class, and of each of its subclasses, with units: `float [N/m]`."""

    def __get__(self, instance: Any, owner: Any) -> inspect.Signature:
        _, *parameters = inspect.signature(owner.__init__).parameters.values()
        with contextlib.suppress(NameError):  # a type that is imported for type checkers alone
            source = owner if dataclasses.is_dataclass(owner) else owner.__init__
            hints = get_type_hints(source, include_extras=True)
            parameters = [
                p.replace(annotation=_spelled(hints.get(p.name, p.annotation))) for p in parameters
            ]
        return inspect.Signature(parameters)


class Words(str):
    """An annotation that a signature shows verbatim."""

    __repr__ = str.__str__


def _spelled(hint: Any) -> Words:
    """A type without modules and bounds, with its unit."""
    unit = ""
    if get_origin(hint) is Annotated:
        hint, *notes = get_args(hint)
        unit = next((n.unit for n in notes if isinstance(n, Bound)), "")
    plain = isinstance(hint, type) and not get_args(hint)
    text = hint.__name__ if plain else re.sub(r"\b(?:[a-z_]\w*\.)+(?=\w)", "", str(hint))
    return Words(f"{text} [{unit}]" if unit else text)


def checked(made: F) -> F:
    """As `named`, and checks arguments by their annotations, as the fields of a part.

    Enforced are bounds, `Annotated[float, Bound(...)]`, words, `Literal[...]`, flags, classes of
    this package, functions, iterables, dictionaries and paths; what is given arrives as its type,
    "5 cm" as 0.05. A number or an array without a bound is left to the function. A function of
    theory or studies runs on one thread of BLAS.
    """
    inner: Any = made.__init__ if isinstance(made, type) else made
    run = _question(inner)
    parameters = list(_parameters(inner).values())
    kinds_of = [p.kind for p in parameters]
    many = inspect.Parameter.VAR_POSITIONAL  # as *changes, to which all further values belong
    end = kinds_of.index(many) if many in kinds_of else len(parameters)
    names, rest = [p.name for p in parameters[:end]], [p.name for p in parameters[end : end + 1]]

    @functools.wraps(inner)
    def entry(*args: Any, **given: Any) -> Any:
        nodes = argument_nodes(inner)
        ordered = zip(itertools.chain(names, itertools.cycle(rest)), args, strict=False)
        taken = [nodes[name].check(name, x) if name in nodes else x for name, x in ordered]
        for name in given:
            if name in nodes:
                given[name] = nodes[name].check(name, given[name])
        return run(*taken, *args[len(taken) :], **given)

    if isinstance(made, type):
        made.__init__ = entry
        return named(made)  # type: ignore[return-value]
    return named(entry)  # type: ignore[arg-type]


def _question(made: F) -> F:
    """A function, on one thread of BLAS where it is one of theory or studies."""
    return one_thread(made) if made.__module__.startswith(QUESTIONS) else made  # type: ignore


def _parameters(made: Any) -> Mapping[str, inspect.Parameter]:
    return inspect.signature(made).parameters


@functools.cache
def argument_nodes(made: Callable[..., Any]) -> dict[str, Node]:
    """Types of the arguments of a function that are enforced, by name."""
    hints = get_type_hints(made, include_extras=True)
    nodes = {name: node_of(hints[name], None) for name in _parameters(made) if name in hints}
    return {name: node for name, node in nodes.items() if type(node) is not Node}


def function_of(
    kind: Callable[P, T], name: str, answer: Callable[[T], R], refused: str
) -> Callable[P, R]:
    """Makes a function with the fields of a dataclass as arguments, and its description."""
    assert isinstance(kind, type)
    signature, descriptions = inspect.signature(kind), field_descriptions(kind)
    run = _question(answer)

    def make(*args: P.args, **given: P.kwargs) -> R:
        known_names(name, given, signature.parameters)
        return run(kind(*args, **given))

    made: Any = make
    made.__name__ = made.__qualname__ = name
    made.__module__ = answer.__module__
    back = get_type_hints(answer)["return"]
    made.__signature__ = signature.replace(return_annotation=back)
    made.__annotations__ = {"return": back}
    summary = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")[0].rstrip()
    about = "\n".join(f"    {name}: {descriptions[name]}" for name in signature.parameters)
    made.__doc__ = f"{summary}\n\nArgs:\n{about}\n\nRaises:\n    ParameterError: {refused}"
    return made
