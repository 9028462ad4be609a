"""The command line: from words to a command. A word that is wrong is an error of one line."""

from __future__ import annotations

import inspect
import itertools
import math
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import cyclopts

from ..errors import ParameterError, choice, nearest
from ..fields import UNSET, field_descriptions
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
    parts_of,
)
from .unused import Unused

NEGATIVE = re.compile(r"^-(?=\.?\d|inf$|nan$)")  # no option: it gets a space in front
EXPERIMENT, FILE = "experiment", "file"  # and RECORD: where a scenario comes from
SET_WORDS = Several([Verbatim(str)], many=True)
OF_SAMPLING = Unused(
    ("render",),
    "is of sampled control: give --control sampled too",
    without=("control=sampled", "scenario=file"),
)


@dataclass(frozen=True)
class Line:
    """What a command line says."""

    name: str
    kind: type  # dataclass of the command
    options: dict[str, Option]  # all that it takes, by name
    origin: str = ""  # EXPERIMENT, FILE or RECORD where it has a scenario; else ""
    source: str = ""  # name of that experiment, or path
    values: Mapping[str, Any] = field(default_factory=dict)

    @property
    def path(self) -> str:
        """The command with its experiment."""
        return f"{self.name} {self.source}" if self.origin == EXPERIMENT else self.name

    def command(self) -> Any:
        """The command with its options, ready to be called; files are read only now."""
        own = self._values("")
        for part, default in parts_of(self.kind).items():
            own[part] = replace(default, **self._values(part))
        if self.origin:
            own[SCENARIO] = self._scenario(self._values(SCENARIO))
        return self.kind(**own)

    def _values(self, part: str) -> dict[str, Any]:
        """What was given of a part of the command."""
        given = ((self.options[name], x) for name, x in self.values.items())
        return {option.field: x for option, x in given if option.part == part}

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
    """Reads a command line; refuses a word that its command does not take."""
    line, rest = begun([NEGATIVE.sub(r" \g<0>", word) for word in words])
    quiet: Any = object()  # a console would be imported for an error, which nobody prints there
    try:
        _, bound, _ = app_of(line).parse_args(
            rest, exit_on_error=False, print_error=False, error_console=quiet
        )
    except cyclopts.CycloptsError as error:
        raise _refusal(error, line) from None
    given = {line.options[name]: texts for name, texts in bound.arguments.items() if texts != ()}
    owners = (line.kind, *parts_of(line.kind).values())
    rules = (rule for owner in owners for rule in getattr(owner, "unused", ()))
    by_word = _given_words(line, given)
    for rule in (*rules, OF_SAMPLING):
        rule.refuse(by_word)
    values = {
        option.name: texts if isinstance(texts, bool) else option.value(texts)
        for option, texts in given.items()
    }
    _note_repeats(rest)
    return replace(line, values=values)


def begun(words: Sequence[str], whole: bool = True) -> tuple[Line, list[str]]:
    """The command of a command line and where its scenario comes from; and the words behind.

    Where the line is not `whole`, as for a help page, the scenario may be left out.
    """
    name, *rest = words
    if name.startswith("-"):
        raise _refused(f"{name}: no option of hapticclay; see hapticclay --help")
    kind = load_command(choice("command", name, tuple(COMMANDS)))
    line = Line(name, kind, options_of(kind))
    at = _first_loose(line.options, rest) if SCENARIO in line.options else None
    if SCENARIO not in line.options or (at is None and not whole):
        return line, rest
    from ..scene.experiments import EXPERIMENTS

    origin, source = _scenario_of(line, rest, at)
    of_scenario = experiment_options(EXPERIMENTS[source]) if origin == EXPERIMENT else {}
    if origin != RECORD:
        of_scenario[SET] = Option(SET, SET_WORDS, SET_HELP, (), SCENARIO, "", SET)
    own = {name: option for name, option in line.options.items() if name != SCENARIO}
    return replace(line, options=own | of_scenario, origin=origin, source=source), rest


def _scenario_of(line: Line, words: list[str], at: int | None) -> tuple[str, str]:
    """Where a scenario comes from, and the experiment or path; takes them off the words."""
    from ..scene.experiments import EXPERIMENTS
    from ..scene.files import is_scenario_file

    recorded = line.options[SCENARIO].note == RECORD
    usual = line.options[SCENARIO].default
    if at is None and usual is not UNSET:
        return EXPERIMENT, usual
    if at is None:
        raise _refused(f"give an experiment or a scenario file: {', '.join(EXPERIMENTS)}")
    word = words.pop(at)
    if word == FILE or (recorded and word == RECORD):
        if at == len(words) or words[at].startswith("-"):
            raise _refused(f"give the path of a {word} behind {line.name} {word}")
        return word, words.pop(at)
    if is_scenario_file(word):
        return FILE, word
    suffix = Path(word).suffix.lower()  # a record is a folder or an .npz file, there or not
    as_record = os.path.isdir(word) or suffix == ".npz" or (os.sep in word and not suffix)
    if recorded and as_record and word not in EXPERIMENTS:
        return RECORD, word
    try:
        return EXPERIMENT, choice(EXPERIMENT, word, tuple(EXPERIMENTS))
    except ParameterError as error:
        kinds = "a scenario file, .toml or .json"
        kinds += ", or the folder of a record" if recorded else ""
        if os.sep in word or os.path.exists(word):  # a file of another kind, no misspelt name
            name = "file" if os.path.isfile(word) else "path"
            raise ParameterError(name, word, f"must be {kinds}, or an experiment") from None
        raise ParameterError(error.field, error.value, f"{error.bound} (or give {kinds})") from None


def _first_loose(options: Mapping[str, Option], words: Sequence[str]) -> int | None:
    """Index of the first word that is neither an option nor a value of one.

    An option that the command lacks may be one of the experiment, which is not known yet: then as
    many words are its values as stand before the name of an experiment or of a file.
    """
    from ..scene.experiments import EXPERIMENTS
    from ..scene.files import is_scenario_file

    arity = {f"--{option.word}": option.node.arity for option in options.values()}
    arity |= {f"--no-{option.word}": 0 for option in options.values() if not option.node.arity}
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


# ---- the parser ----------------------------------------------------------------------------------


def app_of(line: Line) -> cyclopts.App:
    """The parser of a command, which prints its options too."""
    about = field_descriptions(line.kind)
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
    app = new_app(line.name)
    app.default(command)
    return app


def new_app(name: str, **look: Any) -> cyclopts.App:
    """A parser without options for help and version, which are read before it."""
    bare: dict[str, Any] = {"help_flags": (), "version_flags": (), "help_format": "plaintext"}
    return cyclopts.App(name=name, usage="", end_of_options_delimiter="", **bare, **look)


def _parameter(option: Option, group: cyclopts.Group) -> inspect.Parameter:
    """An option as a parameter of a function, as cyclopts reads it."""
    P, arity, many = inspect.Parameter, option.node.arity, option.node.arity == math.inf
    kind = P.KEYWORD_ONLY if not option.note else P.VAR_POSITIONAL if many else P.POSITIONAL_ONLY
    default = None if option.default == () else option.default
    settings: dict[str, Any] = {"help": option.about[:1].upper() + option.about[1:]}
    if isinstance(default, tuple):
        settings["show_default"] = _joined
    if not option.note:
        settings |= {"name": f"--{option.word}", "group": group, "allow_repeating": True}
    if arity and kind != P.VAR_POSITIONAL:
        settings |= {"converter": _texts, "negative": (), "n_tokens": -1 if many else int(arity)}
    if not option.note and many:
        settings["consume_multiple"] = 1
    if option.part == SCENARIO and arity == 2:  # one number for both axes, as in --set
        settings |= {"n_tokens": -1, "consume_multiple": (1, 2)}
    hint = str if kind == P.VAR_POSITIONAL else option.node.hint
    return P(
        option.name,
        kind,
        default=P.empty if default is UNSET or kind == P.VAR_POSITIONAL else default,
        annotation=Annotated[hint, cyclopts.Parameter(**settings)],
    )


def _joined(values: tuple[Any, ...]) -> str:
    """A tuple as it is given on the command line."""
    return " ".join(map(str, values))


def _texts(_: Any, tokens: Sequence[cyclopts.Token]) -> tuple[str, ...]:
    """The words of an option: where it is given again, the last ones; all those of --set."""
    starts = [i for i, token in enumerate(tokens) if token.index == 0]
    last = 0 if tokens[0].keyword in (None, f"--{SET}") else starts[-1]
    return tuple(token.value.removeprefix(" ") for token in tokens[last:])


def _refusal(error: cyclopts.CycloptsError, line: Line) -> ParameterError:
    """The error of cyclopts in a line, with the nearest name."""
    if isinstance(error, cyclopts.UnknownOptionError):
        return _unknown(error.token.keyword or error.token.value, line)
    if error.unused_tokens and isinstance(error, cyclopts.UnusedCliTokensError):
        return _unknown(error.unused_tokens[0], line)
    found = error.argument and error.argument.field_info.name
    if found not in line.options:
        return _refused(" ".join(str(error).split()))
    option = line.options[found]
    token = getattr(error, "token", None)
    texts = getattr(error, "tokens_so_far", [token.value] if token else [])
    if option.note and not texts:
        return _refused(f"{line.path} needs {option.word}: {option.node.wants()}")
    return ParameterError(option.label, " ".join(texts), f"must be {option.node.wants()}")


def _unknown(word: str, line: Line) -> ParameterError:
    """The error for an option that the command lacks, or for a word too many."""
    options = [option for option in line.options.values() if not option.note]
    names = [o.word for o in options] + [f"no-{o.word}" for o in options if not o.node.arity]
    head, equals, value = word.partition("=")
    name = head.lstrip("-").replace("_", "-")
    if not word.startswith("-"):
        hint = f"; did you mean --{name} {value}?" if equals and name in names else ""
        return _refused(f"unexpected argument {word!r} of {line.path}{hint}")
    near = nearest(name, names)
    hint = f"; did you mean --{near[0]}?" if near else f"; see hapticclay {line.path} --help"
    return _refused(f"{head}: no option of {line.path}{hint}")


def _refused(text: str) -> ParameterError:
    return ParameterError("arguments", "", text)


# ---- what was given ------------------------------------------------------------------------------


def _given_words(
    line: Line, given: Mapping[Option, tuple[str, ...] | bool]
) -> dict[str, tuple[str, ...]]:
    """What is given by its words, with the fields behind --set; refuses one that stands in both."""
    out: dict[str, tuple[str, ...]] = {}
    for option, texts in given.items():
        word = f"no-{option.word}" if texts is False else option.word
        out[word] = () if isinstance(texts, bool) else texts
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
