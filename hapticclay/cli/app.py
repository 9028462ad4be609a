"""The command line: `hapticclay`, or `python -m hapticclay`."""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import io
import logging
import os
import re
import sys
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from ..errors import ParameterError, choice
from ..files import versions
from ..model.experiments import SCENARIOS
from .bench import Bench
from .identify import Identify
from .reproduce import Reproduce
from .run import Run
from .stability import Stability
from .sweep import SweepCommand
from .video import Video
from .view import View


@dataclass(frozen=True)
class Version:
    """Print the versions of hapticclay and of what it runs on."""

    def __call__(self) -> int:
        print("  ".join(f"{name} {number}" for name, number in versions().items()))
        return 0


COMMANDS = {
    "run": Run,
    "stability": Stability,
    "reproduce": Reproduce,
    "sweep": SweepCommand,
    "identify": Identify,
    "bench": Bench,
    "view": View,
    "video": Video,
    "version": Version,
}
Command = Union[
    tuple(Annotated[kind, tyro.conf.subcommand(name)] for name, kind in COMMANDS.items())
]  # noqa: UP007
MARKERS = (
    tyro.conf.OmitSubcommandPrefixes,
    tyro.conf.OmitArgPrefixes,
    tyro.conf.CascadeSubcommandArgs,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line; returns its exit status: 0, 1 if it failed, 2 for bad input, 130 for Ctrl-C."""
    logging.getLogger("matplotlib").setLevel(
        logging.ERROR
    )  # it warns of a home that cannot be written
    with contextlib.suppress(AttributeError, ValueError):
        sys.stdout.reconfigure(errors="replace")  # a terminal that knows no frames or bullets
    try:
        command = _parsed(list(sys.argv[1:] if argv is None else argv))
        code = command() if command else 0
        if sys.stdout:  # None where it was closed before we came
            sys.stdout.flush()
        return code
    except ParameterError as error:
        text = error.bound if error.field == "arguments" else str(error)
        print(f"hapticclay: {text}", file=sys.stderr)
        return 2
    except BrokenPipeError:  # whoever read our output has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except MemoryError as error:
        print(f"hapticclay: out of memory: {error or 'it is all taken'}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"hapticclay: {error}", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except KeyboardInterrupt:
        print("hapticclay: interrupted", file=sys.stderr)
        return 130


def _parsed(words: list[str]) -> Callable[[], int] | None:
    """The command that the words stand for; None if they asked for help, which is then printed.

    Raises:
        ParameterError: they stand for none.
    """
    words = ordered(words, COMMANDS)
    tyro._experimental_options["ansi_codes"] = not os.environ.get("NO_COLOR")
    complaint = io.StringIO()
    try:
        with contextlib.redirect_stderr(complaint):
            command, rest = tyro.cli(
                Command,  # type: ignore[arg-type]
                prog="hapticclay",
                description="Virtual clay, cut with a simulated haptic arm.",
                args=words,
                config=MARKERS,
                return_unknown_args=True,
            )
    except SystemExit as stop:
        if stop.code in (0, None):
            return None
        raise refused(words, complaint.getvalue(), COMMANDS) from None
    if rest:
        raise unknown(words, rest, COMMANDS)
    return command


FRAME = " |+-\u2500\u2502\u2570\u256f"  # of tyro's complaints, with and without Unicode
RULE = re.compile("[-\u2500]{5}")
NUMBERS: dict[Any, str] = {float: "number", int: "whole number"}


def ordered(words: Sequence[str], commands: Mapping[str, type]) -> list[str]:
    """Words with the experiment, or "record" and its path, right behind the command, wherever they stood.

    Where a record may stand, no experiment is the constant one, and the word "record" may be left out.

    Raises:
        ParameterError: a word is neither a command, nor an experiment, nor a file.
    """
    if words[:1] == ["--version"]:
        return ["version"]
    if words[:1] == ["help"]:
        return [*words[1:2], "--help"]
    if not words or words[0].startswith("-"):
        return list(words)
    command, *rest = words
    choice("command", command, tuple(commands))
    own = options(commands[command])
    if "scenario" not in own:
        return list(words)
    recorded, at = command != "run", _positional(rest, own)
    if at is None:
        bare = not recorded or {"-h", "--help"} & set(rest)
        return [command, *rest] if bare else [command, "constant", *rest]
    word = rest.pop(at)
    if recorded and word == "record":
        return [command, word, *rest]
    if recorded and (os.sep in word or Path(word).exists()) and word not in SCENARIOS:
        return [command, "record", word, *rest]
    try:
        return [command, choice("experiment", word, tuple(SCENARIOS)), *rest]
    except ParameterError as error:
        more = "; or the folder of a record" if recorded else ""
        raise ParameterError(error.field, error.value, error.bound + more) from None


def _positional(words: list[str], own: dict[str, Any]) -> int | None:
    """Index of the first word that is neither an option nor the value of one."""
    i = 0
    while i < len(words):
        word = words[i]
        if not _is_option(word):
            return i
        name, given, _ = word.partition("=")
        i += 1
        if _plain(name) in own:
            i += 0 if given else _count(own[_plain(name)])
        else:  # of an experiment; which one stands further on
            while i < len(words) and not _is_option(words[i]) and words[i] not in SCENARIOS:
                i += 1
    return None


def options(command: type, experiment: str = "") -> dict[str, Any]:
    """Options of a command, and of the experiment it runs, by name: their types."""
    hints = get_type_hints(command)
    out = {f.name: hints[f.name] for f in dataclasses.fields(command)}
    if experiment in SCENARIOS:
        out |= {k: v for k, v in get_type_hints(SCENARIOS[experiment]).items() if k != "return"}
    return {name.replace("_", "-"): kind for name, kind in out.items()}


def _names(known: dict[str, Any]) -> list[str]:
    names = [n for n in known if n not in ("scenario", "spec")]  # which are no options but words
    return names + [f"no-{n}" for n in names if known[n] is bool]


def unknown(
    words: Sequence[str], rest: Sequence[str], commands: Mapping[str, type]
) -> ParameterError:
    """What to say of the words that were left over."""
    path = " ".join(words[: 2 if words[1:2] and words[1] in SCENARIOS else 1])
    word = rest[0].partition("=")[0]
    if not _is_option(word):
        return ParameterError("arguments", "", f"{word!r}: one word too many for {path}")
    known = options(commands[words[0]], words[1] if len(words) > 1 else "")
    near = difflib.get_close_matches(_plain(word), _names(known), n=1)
    hint = f"; did you mean --{near[0]}?" if near else f"; see hapticclay {path} --help"
    return ParameterError("arguments", "", f"{word}: no option of {path}{hint}")


def refused(words: Sequence[str], complaint: str, commands: Mapping[str, type]) -> ParameterError:
    """What to say of the parser's framed complaint: what the option takes, in plain words."""
    text = _one_line(complaint)
    known = (
        options(commands[words[0]], words[1] if len(words) > 1 else "")
        if words[:1] and words[0] in commands
        else {}
    )
    strange = [
        w for w in words[1:] if _is_option(w) and _plain(w.partition("=")[0]) not in _names(known)
    ]
    if strange:
        return unknown(words, strange, commands)
    found = re.match(r"(?:Error parsing|invalid choice|Missing value).*?--([\w-]+)", text)
    if not found or _plain(found[1]) not in known:
        return ParameterError("arguments", "", text)
    kind = known[_plain(found[1])]
    at = max(i for i, w in enumerate(words) if _plain(w.partition("=")[0]) == _plain(found[1]))
    _, _, first = words[at].partition("=")
    given = [first] if first else []
    for word in words[at + 1 :][: _count(kind) - len(given)]:
        if _is_option(word):
            break
        given.append(word)
    name, value = f"--{found[1]}", " ".join(given)
    if get_origin(kind) is Literal:
        try:
            choice(name, value, get_args(kind))
        except ParameterError as error:  # which names the nearest
            return error
    return ParameterError(name, value, f"must be {_meant(kind)}")


def _is_option(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return word.startswith("-")
    return False


def _plain(option: str) -> str:
    return option.lstrip("-").replace("_", "-")


def _count(kind: Any) -> int:
    """Number of words that an option of this type takes."""
    if kind is bool:
        return 0
    return len(get_args(kind)) if get_origin(kind) is tuple else 1


def _meant(kind: Any) -> str:
    """What an option of this type takes, in words."""
    if get_origin(kind) in (Union, types.UnionType):
        return " or ".join(_meant(k) for k in get_args(kind))
    if get_origin(kind) is Literal:
        return f"one of {', '.join(get_args(kind))}"
    if get_origin(kind) is tuple:
        return f"{len(get_args(kind))} {NUMBERS[get_args(kind)[0]]}s"
    if kind is type(None):
        return "None"
    return f"a {NUMBERS[kind]}" if kind in NUMBERS else "a path" if kind is Path else "a word"


def _one_line(box: str) -> str:
    """The message of tyro's framed complaint, without frame and hints on help."""
    text: list[str] = []
    for line in box.splitlines()[1:]:
        if RULE.search(line) and text:
            break
        text += filter(None, [line.strip(FRAME)])
    return " ".join(text) or "bad arguments"
