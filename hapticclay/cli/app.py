"""The command line: `hapticclay`, or `python -m hapticclay`."""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import functools
import inspect
import io
import itertools
import logging
import os
import pkgutil
import re
import shutil
import signal
import sys
import types
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from ..errors import ParameterError, Warning, choice, quantity
from ..files import sources_kept, versions
from ..units import is_quantity
from .console import ends, scenario_words

COMMANDS = {  # a command is a dataclass of its options; calling it returns the exit status
    "run": "hapticclay.cli.run:RunCommand",
    "stability": "hapticclay.cli.stability:StabilityCommand",
    "accuracy": "hapticclay.cli.accuracy:AccuracyCommand",
    "reproduce": "hapticclay.cli.reproduce:ReproduceCommand",
    "passivity": "hapticclay.cli.passivity:PassivityCommand",
    "robustness": "hapticclay.cli.robustness:RobustnessCommand",
    "compare": "hapticclay.cli.compare:CompareCommand",
    "sweep": "hapticclay.cli.sweep:SweepCommand",
    "zwidth": "hapticclay.cli.zwidth:ZWidthCommand",
    "identify": "hapticclay.cli.identify:IdentifyCommand",
    "fit": "hapticclay.cli.fit:FitCommand",
    "impedance": "hapticclay.cli.impedance:ImpedanceCommand",
    "mbk": "hapticclay.cli.mbk:MBKCommand",
    "lab": "hapticclay.cli.lab:LabCommand",
    "bench": "hapticclay.cli.bench:BenchCommand",
    "fields": "hapticclay.cli.fields:FieldsCommand",
    "materials": "hapticclay.cli.materials:MaterialsCommand",
    "view": "hapticclay.cli.view:ViewCommand",
    "device": "hapticclay.cli.device:DeviceCommand",
    "video": "hapticclay.cli.video:VideoCommand",
    "info": "hapticclay.cli.info:InfoCommand",
    "export": "hapticclay.cli.export:ExportCommand",
    "version": "hapticclay.cli.app:VersionCommand",
}
PATHS = ("file", "record")  # words behind a command before the path of a scenario or a record
MARKERS = (
    tyro.conf.OmitSubcommandPrefixes,
    tyro.conf.OmitArgPrefixes,
    tyro.conf.CascadeSubcommandArgs,
)


@dataclass(frozen=True)
class VersionCommand:
    """Print the versions of hapticclay, Python and the packages it needs."""

    def __call__(self) -> int:
        print("  ".join(f"{name} {number}" for name, number in versions().items()))
        return 0


NARROWEST = 20  # columns of a terminal in which help is laid out; in five that never ends


def _show_line(usual: Callable[..., None], message: Any, category: type, *where: Any) -> None:
    """Prints a warning of ours as a line, others as usual."""
    if issubclass(category, Warning):
        print(f"hapticclay: {message}", file=sys.stderr)
    else:
        usual(message, category, *where)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line.

    Args:
        argv: its words; None for those of this process.

    Returns:
        The exit status: 0; 1 if the command failed, 2 for bad input, 130 for Ctrl-C, 141 if the
        reader of the output has gone, 128 + number for SIGTERM (143) and SIGHUP (129).
    """
    # matplotlib warns of a home that cannot be written
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    with contextlib.suppress(AttributeError, ValueError):
        sys.stdout.reconfigure(errors="replace")  # terminals without frames or bullets
    if shutil.get_terminal_size().columns < NARROWEST:
        os.environ["COLUMNS"] = str(NARROWEST)
    with ends() as received:
        code = _exit_status(argv, received)
    return 128 + received[0] if received else code


def _exit_status(argv: Sequence[str] | None, received: list[int]) -> int:
    """Runs the command line under `ends`; returns the exit status without its signals."""
    try:
        words = list(sys.argv[1:] if argv is None else argv)
        command = parse_words(words)
        with warnings.catch_warnings():
            warnings.showwarning = functools.partial(_show_line, warnings.showwarning)
            with sources_kept(sources(words)):
                code = command() if command else 0
        if sys.stdout:  # None where it was closed before we came
            sys.stdout.flush()
        return code
    except Warning as error:  # by python -W error
        print(f"hapticclay: {error}", file=sys.stderr)
        return 2
    except ParameterError as error:
        text = error.bound if error.field == "arguments" else str(error)
        _tell(text)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except MemoryError as error:
        _tell(f"out of memory: {error or 'none is left'}")
        return 1
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        _tell(f"{where}{error.strerror or error}")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        _tell(f"ended by {signal.Signals(received[0]).name}" if received else "interrupted")
        return 130


def _tell(text: str) -> None:
    """Prints a line about the end of a command, unless its terminal has gone."""
    with contextlib.suppress(OSError):
        print(f"hapticclay: {text}", file=sys.stderr, flush=True)


def parse_words(words: Sequence[str]) -> Callable[[], int] | None:
    """The command of a command line; None if it asked for help, which is then printed.

    Args:
        words: the command line.

    Raises:
        ParameterError: there is no such command, or one of its options is wrong.
    """
    words = with_units(ordered(words))
    named = words[:1] and words[0] in COMMANDS
    tyro._experimental_options["ansi_codes"] = not os.environ.get("NO_COLOR")
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            command, rest = tyro.cli(
                load_command(words[0]) if named else _overview(),  # type: ignore[arg-type]
                prog=f"hapticclay {words[0]}" if named else "hapticclay",
                description=None if named else "Virtual clay, cut with a simulated haptic arm.",
                args=words[1:] if named else words,
                config=MARKERS,
                return_unknown_args=True,
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            return None
        raise _refusal(words, complaint.getvalue()) from None
    if rest:
        raise _unknown(words, rest[0])
    return command


def with_units(words: Sequence[str]) -> list[str]:
    """The words of a command line, those with a unit as numbers in the unit of their option.

    Args:
        words: the command line, ordered.

    Raises:
        ParameterError: a unit is unknown, or of another kind than the option's.
    """
    numbers = any(is_quantity(word.rpartition("=")[2]) for word in words)
    if not numbers or words[0] not in COMMANDS:
        return list(words)
    kinds, told, out = options(words), _option_units(words), []
    name, place = "", 0  # the option, and that of its values which comes next
    for word in words:
        head, equals, value = "", "", word
        if _is_option(word):
            head, equals, value = word.partition("=")
            name, place = _plain(head), 0
        if is_quantity(value) and float in _members(kinds.get(name)):
            own = told.get(name, "").split(", ")
            number = quantity(f"--{name}", value, own[min(place, len(own) - 1)])
            word = f"{head}{equals}{number!r}"
        place += not head or bool(equals)
        out.append(word)
    return out


def _option_units(words: Sequence[str]) -> dict[str, str]:
    """Units of options, by name: those of an experiment, and those in brackets in their help."""
    from ..scene.experiments import EXPERIMENTS, parameters
    from ..scene.fields import field_descriptions

    kind = load_command(words[0])
    nested: Any = filter(dataclasses.is_dataclass, _hints(kind).values())
    out: dict[str, str] = {}
    for part in (*nested, kind):
        for name, about in field_descriptions(part).items():
            found = re.search(r"\[([^]]*)\]", about)
            out[name] = found[1] if found else ""
    if len(words) > 1 and words[1] in EXPERIMENTS:
        out |= {name: p.unit for name, p in parameters(EXPERIMENTS[words[1]]).items()}
    return {_plain(name): unit for name, unit in out.items()}


def _members(kind: Any) -> set[Any]:
    """Types that a type is made of."""
    return {kind}.union(*map(_members, get_args(kind)))


def sources(words: Sequence[str]) -> list[Path]:
    """Files, and folders of records, that a command line names to be read.

    Args:
        words: the command line.
    """
    pairs = itertools.pairwise(["", *words])
    named = [Path(word) for before, word in pairs if before not in ("--out", "--page")]
    return [p for p in named if p.is_file() or (p / "record.npz").is_file()]


def load_command(name: str) -> type:
    """The class of a command, whose module is imported only now.

    Args:
        name: a name in COMMANDS.
    """
    return pkgutil.resolve_name(COMMANDS[name])


def _overview() -> Any:
    """All commands as subcommands that have a summary and nothing else."""
    summaries = {
        name: inspect.cleandoc(load_command(name).__doc__ or "").partition("\n\n")[0]
        for name in COMMANDS
    }
    return Union[  # noqa: UP007
        tuple(
            Annotated[Any, tyro.conf.subcommand(name, constructor=dict, description=summary)]
            for name, summary in summaries.items()
        )
    ]


FRAME_CHARACTERS = " |+-\u2500\u2502\u2570\u256f"  # of tyro's messages, with and without Unicode
FRAME_RULE = re.compile("[-\u2500]{5}")
KINDS: dict[Any, str] = {float: "number", int: "whole number"}


def ordered(words: Sequence[str]) -> list[str]:
    """Moves the experiment, or "file" or "record" and its path, right behind the command.

    A path needs neither "file" nor "record". Commands that take a record take the constant cut by
    default.

    Args:
        words: the command line.

    Raises:
        ParameterError: a word is neither a command, nor an experiment, nor a file.
    """
    if words[:1] == ["--version"]:
        return ["version"]
    if words[:1] == ["help"]:
        return ordered([*words[1:2], "--help"])
    if not words or words[0].startswith("-"):
        return list(words)
    command, *rest = words
    choice("command", command, tuple(COMMANDS))
    own = options([command])
    if "scenario" not in own:
        return list(words)
    from ..scene.experiments import EXPERIMENTS
    from ..scene.files import is_scenario_file

    recorded = scenario_words in (m.constructor_factory for m in own["scenario"].__metadata__)
    at = _positional(rest, own, lambda w: w in EXPERIMENTS or is_scenario_file(w) and "=" not in w)
    if at is None:
        bare = not recorded or {"-h", "--help"} & set(rest)
        return [command, *rest] if bare else [command, "constant", *rest]
    word = rest.pop(at)
    if word == "file" or (recorded and word == "record"):
        return [command, word, *rest]
    if is_scenario_file(word):
        return [command, "file", word, *rest]
    if recorded and (os.sep in word or Path(word).exists()) and word not in EXPERIMENTS:
        return [command, "record", word, *rest]
    try:
        return [command, choice("experiment", word, tuple(EXPERIMENTS)), *rest]
    except ParameterError as error:
        more = " (or give a scenario file, .toml or .json"
        more += ", or the folder of a record)" if recorded else ")"
        raise ParameterError(error.field, error.value, error.bound + more) from None


def _positional(
    words: list[str], own: dict[str, Any], is_scenario: Callable[[str], bool]
) -> int | None:
    """Index of the first word that is neither an option nor the value of one."""
    i = 0
    while i < len(words):
        word = words[i]
        if not _is_option(word):
            return i
        name, given, _ = word.partition("=")
        i += 1
        kind = own.get(_plain(name))
        if kind is not None and _plain(name) != "set" and not _any_number(kind):
            i += 0 if given else _count(kind)
        else:  # as many words as follow; or an option of the experiment, which comes later
            while i < len(words) and not _is_option(words[i]) and not is_scenario(words[i]):
                i += 1
    return None


def options(words: Sequence[str]) -> dict[str, Any]:
    """Types of the options of a command and of its experiment, by name.

    Args:
        words: the command line, ordered.
    """
    out: dict[str, Any] = {}
    if words[:1] and words[0] in COMMANDS:
        kind = load_command(words[0])
        hints = _hints(kind)
        for f in dataclasses.fields(kind):
            nested = dataclasses.is_dataclass(hints[f.name])
            name = "set" if f.name == "changes" else f.name
            out |= _hints(hints[f.name]) if nested else {name: hints[f.name]}
    if "scenario" in out:
        from ..scene.experiments import EXPERIMENTS, parameters

        if len(words) > 1 and words[1] in EXPERIMENTS:
            out |= {name: p.kind for name, p in parameters(EXPERIMENTS[words[1]]).items()}
        if words[1:2] != ["record"]:
            out["set"] = tuple[str, ...]
    return {name.replace("_", "-"): kind for name, kind in out.items()}


@functools.cache
def _hints(kind: type) -> dict[str, Any]:
    """Types of the fields; without annotations, but for the one that tells the scenarios."""
    bare = get_type_hints(kind)
    full = get_type_hints(kind, include_extras=True)
    return {name: full[name] if name == "scenario" else bare[name] for name in bare}


def _option_names(known: dict[str, Any]) -> list[str]:
    names = [n for n in known if n not in ("scenario", "spec", "source", "record")]  # words
    return names + [f"no-{n}" for n in names if known[n] is bool]


def _unknown(words: Sequence[str], word: str) -> ParameterError:
    """The error for a word that was left over."""
    known = options(words)
    with_experiment = "scenario" in known and words[1:2] and not _is_option(words[1])
    path = " ".join(words[: 2 if with_experiment and words[1] not in PATHS else 1])
    word = word.partition("=")[0]
    if not _is_option(word):
        return ParameterError("arguments", "", f"{word!r}: one word too many for {path}")
    near = difflib.get_close_matches(_plain(word), _option_names(known), n=1)
    hint = f"; did you mean --{near[0]}?" if near else f"; see hapticclay {path} --help"
    return ParameterError("arguments", "", f"{word}: no option of {path}{hint}")


def _refusal(words: Sequence[str], complaint: str) -> ParameterError:
    """The error for tyro's framed complaint: what the option takes, in plain words."""
    text, known = _one_line(complaint), options(words)
    names = _option_names(known)
    for word in words[1:]:
        if _is_option(word) and _plain(word.partition("=")[0]) not in names:
            return _unknown(words, word)
    if missing := re.match(r"Expected one of {(.*)}", text):
        what = "an experiment or a scenario file" if words else "a command"
        names = missing[1].removesuffix(", file")
        return ParameterError("arguments", "", f"give {what}: {names}")
    found = re.match(r"(?:Error parsing|invalid choice|Missing value).*?--([\w-]+)", text)
    if not found or _plain(found[1]) not in known:
        return ParameterError("arguments", "", re.sub(r"^Error parsing \w+: ", "", text))
    kind = known[_plain(found[1])]
    at = max(i for i, w in enumerate(words) if _plain(w.partition("=")[0]) == _plain(found[1]))
    _, _, first = words[at].partition("=")
    given = [first] if first else []
    most = None if _any_number(kind) else _count(kind) - len(given)
    for word in words[at + 1 :][:most]:
        if _is_option(word):
            break
        given.append(word)
    name, value = f"--{found[1]}", " ".join(given)
    if _any_number(kind) and get_origin(get_args(kind)[0]) is Literal:
        kind = get_args(kind)[0]
        value = next((word for word in given if word not in get_args(kind)), "")
    if get_origin(kind) is Literal:
        try:
            choice(name, value, get_args(kind))
        except ParameterError as error:  # it suggests the nearest
            return error
    return ParameterError(name, value, f"must be {_meaning(kind)}")


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


def _any_number(kind: Any) -> bool:
    """Whether an option of this type takes any number of words."""
    return get_origin(kind) is tuple and get_args(kind)[-1] is Ellipsis


def _count(kind: Any) -> int:
    """Number of words that an option of this type takes."""
    if kind is bool:
        return 0
    return len(get_args(kind)) if get_origin(kind) is tuple else 1


def _meaning(kind: Any) -> str:
    """What an option of this type takes, in words."""
    if get_origin(kind) in (Union, types.UnionType):
        return " or ".join(_meaning(k) for k in get_args(kind))
    if get_origin(kind) is Literal:
        return f"one of {', '.join(get_args(kind))}"
    if _any_number(kind):
        return "one or more, each " + _meaning(get_args(kind)[0])
    if get_origin(kind) is tuple:
        return f"{len(get_args(kind))} {KINDS[get_args(kind)[0]]}s"
    if kind is type(None):
        return "None"
    return f"a {KINDS[kind]}" if kind in KINDS else "a path" if kind is Path else "a word"


def _one_line(box: str) -> str:
    """The message of tyro's framed complaint, without frame and hints on help."""
    text: list[str] = []
    for line in box.splitlines()[1:]:
        if FRAME_RULE.search(line) and text:
            break
        text += filter(None, [line.strip(FRAME_CHARACTERS)])
    return " ".join(text) or "bad arguments"
