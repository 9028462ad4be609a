"""Changes of fields by dotted name, from files, sweeps and the command line."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from ..arguments import checked
from ..errors import ParameterError
from ..fields import (
    AXES,
    ENTIRE,
    join_names,
    laid_over,
    make_part,
    nodes_of,
    value_of_text,
    values_of,
)

T = TypeVar("T")
HAND = ["mass", "damper", "spring"]  # fields that add a hand


@checked
def with_fields(part: T, changes: Mapping[str, Any]) -> T:
    """Copies a part with some fields changed.

    Args:
        part: the part, as a scenario.
        changes: values by dotted name, as in {"arm.l1": 0.3, "gain.x": 2.0}: numbers, "5 cm",
            parts, or plain data of parts. Changes of an entry override those of the whole.

    Returns:
        A part of the same class. One number, or one part, given for a pair applies to both axes.
        A part that was None starts from its defaults. A hand must be added as a whole, by its
        mass, damper and spring.

    Raises:
        ParameterError: part is not a part, there is no such field, a value was refused, or a hand
            is added incompletely.
    """
    if not _is_part(part):
        raise ParameterError("part", part, "must be a part, as a Scenario")
    data, values = nested(changes), values_of(part)
    check_added_hand(values.get("operator"), data)
    return make_part(type(part), data, values)


def _is_part(part: Any) -> bool:
    """Whether a value has fields that are checked, as results have not."""
    if not dataclasses.is_dataclass(part) or isinstance(part, type):
        return False
    try:
        nodes_of(type(part))
    except TypeError:
        return False
    return True


def check_added_hand(old: Any, *changes: Mapping[Any, Any]) -> None:
    """Refuses a mass, damper or spring alone where there is no hand, which would add the others."""
    given = functools.reduce(laid_over, changes, {}).get("operator")
    _check_hand(given, old, "operator")


def _check_hand(given: Any, old: Any, path: str) -> None:
    if not isinstance(given, Mapping):
        return
    if ENTIRE in given:
        old = None if str(given[ENTIRE]).lower() == "none" else given[ENTIRE]
    both = {n: given[n] for n in HAND if n in given}
    for i, axis in enumerate(AXES):
        if isinstance(given.get(axis), Mapping):
            before = old[i] if isinstance(old, tuple) else old
            _check_hand(both | given[axis], before, f"{path}.{axis}")
    named = list(both)
    if named and (old is None or isinstance(old, tuple) and None in old) and named != HAND:
        more = " and ".join(join_names(path, n) for n in HAND if n not in named)
        bound = f"adds a hand to a scene without one: also give {more}, 0 for none"
        raise ParameterError(join_names(path, named[0]), given[named[0]], bound)


def nested(changes: Mapping[str, Any]) -> dict[Any, Any]:
    """Converts values by dotted name to plain data; the key None holds a whole field's value."""
    out: dict[Any, Any] = {}
    for name, value in changes.items():
        try:
            _insert(out, str(name).split("."), value)
        except KeyError as twice:
            bound = f"must be given once, and {twice.args[0]!r} is given twice"
            raise ParameterError(str(name), value, bound) from None
        except RecursionError:
            raise ParameterError(str(name), ..., "is nested too deeply") from None
    return out


def _insert(tree: dict[Any, Any], names: Sequence[Any], value: Any) -> None:
    name, rest = names[0], names[1:]
    if rest or isinstance(value, Mapping):
        below = tree.get(name)
        if not isinstance(below, dict):
            below = tree[name] = {ENTIRE: below} if name in tree else {}
        if rest:
            _insert(below, rest, value)
        elif isinstance(value, Mapping):
            for key, inner in value.items():
                _insert(below, [key] if key is ENTIRE else str(key).split("."), inner)
    elif isinstance(tree.get(name), dict):
        tree[name][ENTIRE] = value
    elif name in tree:
        raise KeyError(name)
    else:
        tree[name] = value


def split_words(field: str, words: Iterable[str], how: str) -> dict[str, str]:
    """Splits words name=value; `how` describes them in the error."""
    out: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        name = name.strip()
        if not equals or not name or name in out:
            raise ParameterError(field, word, how)
        out[name] = value.strip()
    return out


def named_values(field: str, words: Iterable[str]) -> dict[str, Any]:
    """Reads the words "arm.l1=0.3", "gain=1,0.5", "inertia_shaping=true", "dt=0.1ms"."""
    texts = split_words(field, words, "must be name=value, each name once")
    return {name: value_of_text(text) for name, text in texts.items()}
