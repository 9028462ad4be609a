"""The command line: from words to a command. A word that is wrong is an error of one line."""

from __future__ import annotations

import inspect
import itertools
import math
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import cyclopts

from ..errors import ParameterError, choice, nearest
from ..fields import UNSET, field_descriptions
from ..units import is_quantity
from .commands import COMMANDS, load_command
from .options import (
    RECORD,
    SCENARIO,
    SET,
    SET_HELP,
    Option,
    Several,
    Verbatim,
    experiment_options,
    options_of,
)
from .unused import Unused, refuse_unused

EXPERIMENT, FILE = "experiment", "file"  # and RECORD: what a scenario comes from
OF_SAMPLING = Unused(
    ("render",),
    "is of sampled control: give --control sampled too",
    without=("control=sampled", "scenario=file"),
)
Given = Mapping[str, tuple[str, ...] | bool]


@dataclass(frozen=True)
class Line:
    """What a command line says.

    Attributes:
        name: the command.
        kind: its dataclass.
        options: all that it takes, by name.
        origin: EXPERIMENT, FILE or RECORD where the command has a scenario; else "".
        source: name of that experiment, or path.
        values: what was given, by name.
    """

    name: str
    kind: type
    options: dict[str, Option]
    origin: str = ""
    source: str = ""
    values: Mapping[str, Any] = ()  # type: ignore[assignment]

    @property
    def path(self) -> str:
        """The command with its experiment."""
        return f"{self.name} {self.source}" if self.origin == EXPERIMENT else self.name

    def command(self) -> Any:
        """The command with its options, ready to be called; files are read only now."""
        parts: dict[str, dict[str, Any]] = {"": {}, SCENARIO: {}}
        for name, value in self.values.items():
            parts.setdefault(self.options[name].part, {})[name] = value
        own, parameters = parts.pop(""), parts.pop(SCENARIO)
        kinds = get_type_hints(self.kind)
        made = {part: kinds[part](**values) for part, values in parts.items()}
        if self.origin:
            own[SCENARIO] = self._scenario(parameters)
        return self.kind(**own, **made)

    def _scenario(self, parameters: dict[str, Any]) -> Any:
        """The scenario, or the record."""
        if self.origin == RECORD:
            from ..simulation.record import Record

            return Record.load(self.source)
        from ..scene.changes import named_values
        from ..scene.experiments import EXPERIMENTS
        from ..scene.scenario import Scenario

        changes = named_values("--set", parameters.pop(SET, ()))
        if self.origin == FILE:
            return Scenario.load(self.source, changes)
        return EXPERIMENTS[self.source].of(parameters, changes)


def read(words: Sequence[str]) -> Line:
    """Reads a command line.

    Raises:
        ParameterError: it has a word that its command does not take.
    """
    line, rest = begun([f" {w}" if w.startswith("-") and is_quantity(w) else w for w in words])
    try:
        _, bound, _ = app_of(line).parse_args(rest, exit_on_error=False, print_error=False)
    except cyclopts.CycloptsError as error:
        raise _refusal(error, line) from None
    given = {name: texts for name, texts in bound.arguments.items() if texts != ()}
    rules = getattr(line.kind, "unused", ())
    refuse_unused((*rules, OF_SAMPLING), _given_words(line, given))
    values = {
        name: texts if isinstance(texts, bool) else line.options[name].value(texts)
        for name, texts in given.items()
    }
    _note_repeats(rest)
    return replace(line, values=values)


def begun(words: Sequence[str], whole: bool = True) -> tuple[Line, list[str]]:
    """The command of a command line and where its scenario comes from; and the words behind.

    Where the line is not `whole`, as for a help page, the scenario may be left out.
    """
    if not words:
        raise _refused(f"give a command: {', '.join(COMMANDS)}")
    name, *rest = words
    if name.startswith("-"):
        raise _refused(f"{name}: no option of hapticclay; see hapticclay --help")
    kind = load_command(choice("command", name, tuple(COMMANDS)))
    options = options_of(kind)
    line = Line(name, kind, options)
    if SCENARIO not in options or (not whole and _first_loose(line, rest) is None):
        return line, rest
    from ..scene.experiments import EXPERIMENTS

    origin, source, rest = _scenario_of(line, rest)
    of_scenario = experiment_options(EXPERIMENTS[source]) if origin == EXPERIMENT else {}
    if origin != RECORD:
        of_scenario[SET] = Option(SET, Several([Verbatim(str)], many=True), SET_HELP, (), SCENARIO)
    own = {name: option for name, option in options.items() if name != SCENARIO}
    return replace(line, options=own | of_scenario, origin=origin, source=source), rest


def _scenario_of(line: Line, words: list[str]) -> tuple[str, str, list[str]]:
    """Where a scenario comes from, the experiment or path, and the words without it."""
    from ..scene.experiments import EXPERIMENTS
    from ..scene.files import is_scenario_file

    recorded = line.options[SCENARIO].note == RECORD
    at = _first_loose(line, words)
    if at is None and recorded:
        return EXPERIMENT, "constant", words
    if at is None:
        raise _refused(f"give an experiment or a scenario file: {', '.join(EXPERIMENTS)}")
    word, rest = words[at], words[:at] + words[at + 1 :]
    if word == FILE or (recorded and word == RECORD):
        if at == len(rest) or rest[at].startswith("-"):
            raise _refused(f"give the path of a {word} behind {line.name} {word}")
        return word, rest[at], rest[:at] + rest[at + 1 :]
    if is_scenario_file(word):
        return FILE, word, rest
    if recorded and word not in EXPERIMENTS and _is_record(word):
        return RECORD, word, rest
    try:
        return EXPERIMENT, choice(EXPERIMENT, word, tuple(EXPERIMENTS)), rest
    except ParameterError as error:
        kinds = "a scenario file, .toml or .json"
        kinds += ", or the folder of a record" if recorded else ""
        if os.sep in word or os.path.exists(word):  # a file of another kind, no misspelt name
            name = "file" if os.path.isfile(word) else "path"
            raise ParameterError(name, word, f"must be {kinds}, or an experiment") from None
        raise ParameterError(error.field, error.value, f"{error.bound} (or give {kinds})") from None


def _first_loose(line: Line, words: list[str]) -> int | None:
    """Index of the first word that is neither an option nor a value of one.

    An option that the command lacks may be one of the experiment, which is not known yet: then as
    many words are its values as stand before the name of an experiment or of a file.
    """
    from ..scene.experiments import EXPERIMENTS
    from ..scene.files import is_scenario_file

    arity = {f"--{option.word}": option.node.arity for option in line.options.values()}
    arity |= {f"--no-{option.word}": 0 for option in line.options.values() if not option.node.arity}
    left: float = 0
    for i, word in enumerate(words):
        named = word in EXPERIMENTS or (is_scenario_file(word) and "=" not in word)
        if word.startswith("-"):
            name, given, _ = word.replace("_", "-").partition("=")
            left = arity.get(name, math.inf) - bool(given)
        elif left <= 0 or (left == math.inf and named):
            return i
        else:
            left -= 1
    return None


def _is_record(word: str) -> bool:
    """Whether a word is the path of a record: a folder, or an .npz file, there or not."""
    suffix = Path(word).suffix.lower()
    return os.path.isdir(word) or suffix == ".npz" or (os.sep in word and not suffix)


# ---- the parser ----------------------------------------------------------------------------------


def app_of(line: Line) -> cyclopts.App:
    """The parser of a command, which prints its help too."""
    about, kind = field_descriptions(line.kind), line.kind
    if line.origin == EXPERIMENT:
        from ..scene.experiments import EXPERIMENTS

        kind = EXPERIMENTS[line.source]
    titles = {"": "Options", SCENARIO: f"Options of {line.source}"}
    groups = {
        part: cyclopts.Group.create_ordered(
            titles.get(part, part.capitalize()), help="" if part in titles else about[part]
        )
        for part in dict.fromkeys(option.part for option in line.options.values())
    }
    parameters = [_parameter(option, groups[option.part]) for option in line.options.values()]

    def command(*words: Any, **given: Any) -> None: ...

    command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        sorted(parameters, key=lambda p: p.kind)
    )
    app = new_app(f"hapticclay {line.path}", help_text(kind))
    app.default(command)
    return app


def new_app(name: str, about: str, **look: Any) -> cyclopts.App:
    """A parser without options for help and version: they are read before it."""
    bare: dict[str, Any] = {"help_flags": (), "version_flags": (), "help_format": "plaintext"}
    return cyclopts.App(name=name, help=about, end_of_options_delimiter="", **bare, **look)


def help_text(kind: type) -> str:
    """What a command or an experiment is, a line a paragraph."""
    text = inspect.cleandoc(kind.__doc__ or "").partition("Attributes:\n")[0]
    return "\n\n".join(" ".join(part.split()) for part in text.strip().split("\n\n"))


def _parameter(option: Option, group: cyclopts.Group) -> inspect.Parameter:
    """An option as a parameter of a function, as cyclopts reads it."""
    arity, many = option.node.arity, option.node.arity == math.inf
    settings: dict[str, Any] = {
        "help": option.about[:1].upper() + option.about[1:],
        "show_default": option.has_default and option.default_text,
        "allow_repeating": True,
    }
    if arity:
        settings |= {"converter": _texts, "negative": (), "metavar": option.metavar}
        settings |= {"n_tokens": -1 if many or option.fills_pair else int(arity)}
        settings |= {"consume_multiple": (1, 2) if option.fills_pair else 1 if many else None}
    kind = inspect.Parameter.POSITIONAL_ONLY
    if not option.note:
        kind = inspect.Parameter.KEYWORD_ONLY
        settings |= {"name": f"--{option.word}", "group": group}
    elif many:
        kind = inspect.Parameter.VAR_POSITIONAL
        settings = {"help": settings["help"]}
    hint: Any = bool if not arity else str if arity == 1 or option.note else tuple[str, ...]
    needed = option.default is UNSET or kind == inspect.Parameter.VAR_POSITIONAL
    return inspect.Parameter(
        option.name,
        kind,
        default=inspect.Parameter.empty if needed else None,
        annotation=Annotated[hint, cyclopts.Parameter(**settings)],
    )


def _texts(_: Any, tokens: Sequence[cyclopts.Token]) -> tuple[str, ...]:
    """The words of an option: where it is given again, the last ones; all those of --set."""
    starts = [i for i, token in enumerate(tokens) if token.index == 0]
    last = 0 if tokens[0].keyword in (None, f"--{SET}") else starts[-1]
    return tuple(token.value.removeprefix(" ") for token in tokens[last:])


def _refusal(error: cyclopts.CycloptsError, line: Line) -> ParameterError:
    """The error of cyclopts in a line, with the nearest name."""
    if isinstance(error, cyclopts.UnknownOptionError):
        return _unknown(error.token.keyword or error.token.value, line)
    if isinstance(error, cyclopts.UnusedCliTokensError):
        return _unexpected((error.unused_tokens or [""])[0], line)
    found = error.argument and error.argument.field_info.name
    if found not in line.options:
        return _refused(" ".join(str(error).split()))
    option = line.options[found]
    if isinstance(error, cyclopts.MissingArgumentError):
        if option.note:
            return _refused(f"{line.path} needs {option.word}: {option.node.wants()}")
        return option.refused(error.tokens_so_far)
    token = getattr(error, "token", None)
    return option.refused([token.value] if token else [])


def _unknown(word: str, line: Line) -> ParameterError:
    """The error for an option that the command lacks."""
    head = word.partition("=")[0]
    near = nearest(head.lstrip("-").replace("_", "-"), _option_names(line))
    hint = f"; did you mean --{near[0]}?" if near else f"; see hapticclay {line.path} --help"
    return _refused(f"{head}: no option of {line.path}{hint}")


def _unexpected(word: str, line: Line) -> ParameterError:
    """The error for a word without a name, of which the command takes no more."""
    if word.startswith("-"):
        return _unknown(word, line)
    name, equals, value = word.partition("=")
    name = name.replace("_", "-")
    hint = f"; did you mean --{name} {value}?" if equals and name in _option_names(line) else ""
    return _refused(f"unexpected argument {word!r} of {line.path}{hint}")


def _option_names(line: Line) -> list[str]:
    options = [option for option in line.options.values() if not option.note]
    return [o.word for o in options] + [f"no-{o.word}" for o in options if not o.node.arity]


def _refused(text: str) -> ParameterError:
    return ParameterError("arguments", "", text)


# ---- what was given ------------------------------------------------------------------------------


def _given_words(line: Line, given: Given) -> dict[str, tuple[str, ...]]:
    """What is given by the names of the command line, with the fields behind --set.

    Refuses a field that an option gives too.
    """
    out: dict[str, tuple[str, ...]] = {}
    for name, texts in given.items():
        word = line.options[name].word
        out |= {f"no-{word}": ()} if texts is False else {word: () if texts is True else texts}
    if line.origin:
        out[SCENARIO] = (line.source if line.origin == EXPERIMENT else line.origin,)
    fields: dict[str, tuple[str, ...]] = {}
    for text in out.get(SET, ()):
        name, _, value = text.partition("=")
        fields[name.strip().replace("_", "-")] = (value,)
    for name in fields.keys() & out.keys():
        raise _refused(f"--{name}, --set {name}: give one once")
    return fields | out


def _note_repeats(words: Sequence[str]) -> None:
    """Says which options are given again; the last counts, as in other programs."""
    seen: dict[str, str] = {}
    for word in words:
        name = word.partition("=")[0].replace("_", "-")
        stem = name.removeprefix("--no-").removeprefix("--")
        if not name.startswith("--") or name == f"--{SET}":
            continue
        if before := seen.get(stem):
            both = "twice" if before == name else f"beside {before}"
            print(f"hapticclay: {name} is given {both}: the last counts", file=sys.stderr)
        seen[stem] = name


def sources(words: Sequence[str]) -> list[Path]:
    """Files, and folders of records, that a command line names to be read."""
    pairs = itertools.pairwise(["", *words])
    named = [Path(word) for before, word in pairs if before not in ("--out", "--page")]
    return [p for p in named if any(map(os.path.isfile, (p, p / "record.npz")))]
