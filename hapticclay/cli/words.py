"""The words of a command line: their order, their units, and whether the command takes them."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import itertools
import math
import os
import re
import sys
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import tyro

from ..errors import ParameterError, choice, nearest, quantity
from ..units import is_quantity
from .commands import COMMANDS, load_command
from .console import scenario_words
from .unused import Unused, refuse_unused

PATHS = ("file", "record")  # words behind a command before the path of a scenario or a record
HELP = ("-h", "--help")
OF_SAMPLING = (
    Unused(
        ("render",),
        "is of sampled control: give --control sampled too",
        without=("control=sampled", "scenario=file"),
    ),
)
KINDS: dict[Any, str] = {float: "number", int: "whole number"}


def ordered(words: Sequence[str]) -> list[str]:
    """Moves the experiment, or "file" or "record" and its path, right behind the command.

    A path needs neither "file" nor "record". Commands that take a record take the constant cut by
    default.
    """
    if words[:1] == ["--version"]:
        return ["version"]
    if words[:1] == ["help"]:
        return ordered([*words[1:2], "--help"])
    if not words or words[0].startswith("-"):
        return list(words)
    command, *rest = words
    choice("command", command, tuple(COMMANDS))
    slots = _slots([command])
    if "scenario" not in slots:
        return list(words)
    from ..scene.experiments import EXPERIMENTS
    from ..scene.files import is_scenario_file

    notes = slots["scenario"].kind.__metadata__
    recorded = scenario_words in (m.constructor_factory for m in notes)

    def is_scenario(word: str) -> bool:
        return word in EXPERIMENTS or is_scenario_file(word) and "=" not in word

    at = _positional(rest, slots, is_scenario)
    if at is None:
        bare = not recorded or not {*HELP}.isdisjoint(rest)
        return [command, *rest] if bare else [command, "constant", *rest]
    word = rest.pop(at)
    if word == "file" or (recorded and word == "record"):
        return [command, word, *rest]
    if is_scenario_file(word):
        return [command, "file", word, *rest]
    if recorded and _is_record(word) and word not in EXPERIMENTS:
        return [command, "record", word, *rest]
    try:
        return [command, choice("experiment", word, tuple(EXPERIMENTS)), *rest]
    except ParameterError as error:
        kinds = "a scenario file, .toml or .json"
        kinds += ", or the folder of a record" if recorded else ""
        if os.sep in word or os.path.exists(word):  # a file of another kind, no misspelt name
            name = "file" if os.path.isfile(word) else "path"
            raise ParameterError(name, word, f"must be {kinds}, or an experiment") from None
        raise ParameterError(error.field, error.value, f"{error.bound} (or give {kinds})") from None


def _is_record(word: str) -> bool:
    """Whether a word is the path of a record: a folder, or an .npz file, there or not."""
    suffix = Path(word).suffix.lower()
    return os.path.isdir(word) or suffix == ".npz" or (os.sep in word and not suffix)


def _positional(
    words: list[str], slots: dict[str, Slot], is_scenario: Callable[[str], bool]
) -> int | None:
    """Index of the first word that is neither an option nor the value of one."""
    i = 0
    while i < len(words):
        word = words[i]
        if not _is_option(word):
            return i
        name, given, _ = word.partition("=")
        i += 1
        most = _most(slots[_plain(name)].kind) if _plain(name) in slots else math.inf
        if most < math.inf:
            i += 0 if given else int(most)
        else:  # as many words as follow; or an option of the experiment, which comes later
            while i < len(words) and not _is_option(words[i]) and not is_scenario(words[i]):
                i += 1
    return None


def with_units(words: Sequence[str]) -> list[str]:
    """The words of a command line, values as the options' types take them.

    A number with a unit becomes a number in the unit of its option, "none" the None of an option
    that may have no value, and one number for a pair of an experiment, as for --set, two.
    """
    helping = not {*HELP}.isdisjoint(words)  # needs no values, nor what reads them
    if helping or len(words) < 2 or words[0] not in COMMANDS:
        return list(words)
    slots, told, pairs = _slots(words), _option_units(words), _experiment_options(words)
    out, left = [words[0]], list(words[1:])
    while left:
        word = left.pop(0)
        head, equals, value = word.partition("=")
        if not _is_option(word) or _plain(head) not in slots:
            out.append(word)
            continue
        name, kind = _plain(head), slots[_plain(head)].kind
        given = [value] if equals else []
        given += _values_of(left, _most(kind) - len(given))
        taken = [
            _value_in_unit(name, x, kind, _unit_at(told.get(name, ""), i))
            for i, x in enumerate(given)
        ]
        if name in pairs and len(taken) == 1 and _is_pair(kind) and _is_number(taken[0], float):
            taken *= 2
        first = [f"{head}={taken[0]}", *taken[1:]] if equals else [head, *taken]
        out += [head, *taken] if equals and len(taken) > 1 else first
    return out


def _values_of(left: list[str], most: float) -> list[str]:
    """Takes the values of an option off the words that are left."""
    out: list[str] = []
    while left and not _is_option(left[0]) and len(out) < most:
        out.append(left.pop(0))
    return out


def _value_in_unit(name: str, value: str, kind: Any, unit: str) -> str:
    members = _members(kind)
    if type(None) in members and value.lower() == "none":
        return "None" if str not in members and Path not in members else value
    number = quantity(f"--{name}", value, unit) if float in members else None
    return value if number is None else repr(number)


def _unit_at(told: str, place: int) -> str:
    """Unit of the value at a place, of those of an option; the last is that of all behind it."""
    own = told.split(", ")
    return own[min(place, len(own) - 1)]


def _is_pair(kind: Any) -> bool:
    """Whether a type is a pair of numbers."""
    return any(get_args(k) == (float, float) for k in _members(kind))


def _experiment_options(words: Sequence[str]) -> set[str]:
    """Names of the options that are parameters of the experiment of a command line."""
    from ..scene.experiments import EXPERIMENTS, parameters

    known = "scenario" in _own_slots(load_command(words[0])) and words[1:2]
    if not known or words[1] not in EXPERIMENTS:
        return set()
    return {_plain(name) for name in parameters(EXPERIMENTS[words[1]])}


def _option_units(words: Sequence[str]) -> dict[str, str]:
    """Units of options, by name: those of an experiment, and those in brackets in their help."""
    from ..fields import field_descriptions
    from ..scene.experiments import EXPERIMENTS, parameters

    kind = load_command(words[0])
    nested: Any = (x.kind for x in _own_slots(kind).values() if dataclasses.is_dataclass(x.kind))
    out: dict[str, str] = {}
    for part in (*nested, kind):
        for name, about in field_descriptions(part).items():
            out[name] = ", ".join(re.findall(r"\[([^]]*)\]", about))
    if len(words) > 1 and words[1] in EXPERIMENTS:
        out |= {name: p.unit for name, p in parameters(EXPERIMENTS[words[1]]).items()}
    return {_plain(name): unit for name, unit in out.items()}


def _members(kind: Any) -> set[Any]:
    """Types that a type is made of."""
    return {kind}.union(*map(_members, get_args(kind)))


def sources(words: Sequence[str]) -> list[Path]:
    """Files, and folders of records, that a command line names to be read."""
    pairs = itertools.pairwise(["", *words])
    named = [Path(word) for before, word in pairs if before not in ("--out", "--page")]
    return [p for p in named if any(map(os.path.isfile, (p, p / "record.npz")))]


class Slot(NamedTuple):
    """What a command takes.

    Attributes:
        kind: its type.
        named: whether it is an option; else it is a word without a name.
        needed: whether it must be given.
    """

    kind: Any
    named: bool = True
    needed: bool = False


def options(words: Sequence[str]) -> dict[str, Any]:
    """Types of the options of a command and of its experiment, by name."""
    return {name: slot.kind for name, slot in _slots(words).items() if slot.named}


def _slots(words: Sequence[str]) -> dict[str, Slot]:
    """What a command and its experiment take, by name."""
    out: dict[str, Slot] = {}
    if words[:1] and words[0] in COMMANDS:
        for name, slot in _own_slots(load_command(words[0])).items():
            nested = dataclasses.is_dataclass(slot.kind)
            out |= _own_slots(slot.kind) if nested else {name: slot}
    if "scenario" in out:
        from ..scene.experiments import EXPERIMENTS, parameters

        if len(words) > 1 and words[1] in EXPERIMENTS:
            found = parameters(EXPERIMENTS[words[1]])
            out |= {name: Slot(p.kind) for name, p in found.items()}
        if words[1:2] != ["record"]:
            out["set"] = Slot(tuple[str, ...])
    return {_plain(name): slot for name, slot in out.items()}


@functools.cache
def _own_slots(kind: Any) -> dict[str, Slot]:
    """What the fields of a dataclass stand for."""
    bare = get_type_hints(kind)
    full = get_type_hints(kind, include_extras=True)
    out = {}
    for f in dataclasses.fields(kind):
        plain = tyro.conf.Positional in getattr(full[f.name], "__metadata__", ())
        needed = f.default is f.default_factory is dataclasses.MISSING
        of = full[f.name] if f.name == "scenario" else bare[f.name]
        out[f.name] = Slot(of, not plain and f.name != "scenario", needed)
    return out


# ---- whether a command takes them ----------------------------------------------------------------


def check_words(words: Sequence[str]) -> None:
    """Refuses words that a command does not take."""
    if not words:
        raise _refused(f"give a command: {', '.join(COMMANDS)}")
    if not {*HELP}.isdisjoint(words) or any(w.startswith("--tyro-") for w in words):
        return
    slots, (path, *left) = _slots(words), words
    if path not in COMMANDS:
        raise _refused(f"{path}: no option of hapticclay; see hapticclay --help")
    given: dict[str, list[str]] = {}
    if "scenario" in slots:
        path, left = _scenario_of(path, left)
        given["scenario"] = list(words[1:2])
    loose: list[str] = []
    while left:
        word = left.pop(0)
        if not _is_option(word):
            loose.append(word)
            continue
        head, equals, value = word.partition("=")
        name = _plain(head)
        if name not in _option_names(slots) or not head.startswith("--"):
            raise _unknown(head, path, slots)
        slot = slots.get(name, Slot(bool))  # as --no-plots
        values = [value] if equals else []
        values += _values_of(left, _most(slot.kind) - len(values))
        _check_option(f"--{name}", values, slot.kind)
        _note(name, values, given)
    given |= _check_loose(loose, path, slots)
    rules = getattr(load_command(words[0]), "unused", ())
    refuse_unused((*rules, *OF_SAMPLING), _with_fields(given))


def _note(name: str, values: list[str], given: dict[str, list[str]]) -> None:
    """Notes what is given of an option, and says so where one given before no longer counts."""
    for before in {name, name.removeprefix("no-"), f"no-{name}"} if name != "set" else ():
        if given.pop(before, None) is not None:
            both = "twice" if before == name else f"beside --{before}"
            print(f"hapticclay: --{name} is given {both}: the last counts", file=sys.stderr)
    given[name] = given.get(name, []) + values


def _with_fields(given: dict[str, list[str]]) -> dict[str, list[str]]:
    """What is given, with the fields behind --set; refuses a field that an option gives too."""
    words = (word.partition("=") for word in given.get("set", ()))
    fields = {_plain(name.strip()): [value] for name, _, value in words}
    for name in fields:
        if name in given:
            raise _refused(f"--{name}, --set {name}: give one once")
    return fields | given


def _scenario_of(command: str, left: list[str]) -> tuple[str, list[str]]:
    """The command with its experiment, and the words behind them and behind a path."""
    from ..scene.experiments import EXPERIMENTS

    if not left or _is_option(left[0]):
        names = ", ".join(EXPERIMENTS)
        raise _refused(f"give an experiment or a scenario file: {names}")
    word, *left = left
    if word not in PATHS:
        return f"{command} {word}", left
    if not left or _is_option(left[0]):
        raise _refused(f"give the path of a {word} behind {command} {word}")
    return command, left[1:]


def _check_option(name: str, given: list[str], kind: Any) -> None:
    """Refuses values that an option does not take."""
    if _accepts(kind, given):
        return
    value = " ".join(given)
    if _most(kind) == math.inf and get_origin(get_args(kind)[0]) is Literal:
        kind = get_args(kind)[0]
        value = next((word for word in given if word not in get_args(kind)), "")
    names = [x for k in _members(kind) if get_origin(k) is Literal for x in get_args(k)]
    near = nearest(value, names)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    raise ParameterError(name, value, f"must be {_meaning(kind)}{hint}")


def _check_loose(loose: list[str], path: str, slots: dict[str, Slot]) -> dict[str, list[str]]:
    """Words without a name, by that of what they are; refuses what a command does not take."""
    out: dict[str, list[str]] = {}
    for name, (kind, named, needed) in slots.items():
        if named or name == "scenario":
            continue
        given = loose if _most(kind) == math.inf else loose[:1]
        loose = loose[len(given) :]
        if needed and not given:
            raise _refused(f"{path} needs {name}: {_meaning(kind)}")
        if given:
            _check_option(name, given, kind)
            out[name] = given
    if loose:
        name, equals, value = loose[0].partition("=")
        option = f"; did you mean --{_plain(name)} {value}?"
        hint = option if equals and _plain(name) in _option_names(slots) else ""
        raise _refused(f"unexpected argument {loose[0]!r} of {path}{hint}")
    return out


def _refused(text: str) -> ParameterError:
    return ParameterError("arguments", "", text)


def _option_names(slots: dict[str, Slot]) -> list[str]:
    names = [name for name, slot in slots.items() if slot.named]
    return names + [f"no-{n}" for n in names if slots[n].kind is bool]


def _unknown(word: str, path: str, slots: dict[str, Slot]) -> ParameterError:
    """The error for an option that a command lacks."""
    near = nearest(_plain(word), _option_names(slots))
    hint = f"; did you mean --{near[0]}?" if near else f"; see hapticclay {path} --help"
    return _refused(f"{word}: no option of {path}{hint}")


def _is_option(word: str) -> bool:
    if is_quantity(word):  # as -5cm
        return False
    try:
        float(word)
    except ValueError:
        return word.startswith("-")
    return False


def _plain(option: str) -> str:
    return option.lstrip("-").replace("_", "-")


# ---- types of options ----------------------------------------------------------------------------


def _is_union(kind: Any) -> bool:
    return get_origin(kind) in (Union, types.UnionType)


def _most(kind: Any) -> float:
    """Largest number of words that an option of this type takes; infinite for any number."""
    if _is_union(kind):
        return max(map(_most, get_args(kind)))
    if get_origin(kind) is tuple:
        return math.inf if get_args(kind)[-1] is Ellipsis else len(get_args(kind))
    return 0 if kind is bool else 1


def _accepts(kind: Any, given: Sequence[str]) -> bool:
    """Whether words are of a type."""
    if _is_union(kind):
        return any(_accepts(k, given) for k in get_args(kind))
    if get_origin(kind) is tuple:
        of, *more = get_args(kind)
        any_number = more == [Ellipsis]
        return (any_number or len(given) == 1 + len(more)) and all(_accepts(of, [w]) for w in given)
    if kind is bool:
        return not given
    if len(given) != 1:
        return False
    if kind is type(None):
        return given[0].lower() == "none"
    if get_origin(kind) is Literal:
        return given[0] in get_args(kind)
    return kind not in KINDS or _is_number(given[0], kind)


def _is_number(word: str, kind: Callable[[str], float]) -> bool:
    with contextlib.suppress(ValueError):
        return kind(word) is not None
    return False


def _meaning(kind: Any) -> str:
    """What an option of this type takes, in words."""
    if _is_union(kind):
        return " or ".join(_meaning(k) for k in get_args(kind))
    if get_origin(kind) is Literal:
        return f"one of {', '.join(get_args(kind))}"
    if _most(kind) == math.inf:
        return "one or more, each " + _meaning(get_args(kind)[0])
    if get_origin(kind) is tuple:
        return f"{len(get_args(kind))} {KINDS[get_args(kind)[0]]}s"
    if kind in (bool, type(None)):
        return "None" if kind is type(None) else "without a value"
    return f"a {KINDS[kind]}" if kind in KINDS else "a path" if kind is Path else "a word"
