"""Files of scenarios and walls, TOML or JSON: plain data read and written."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..errors import ParameterError
from ..fields import plain_data
from ..files import MOST_SETTINGS, atomic, parse_json, parse_toml, read_text
from .earlier_names import with_present_names

SCENARIO_FILES = (".toml", ".json")


def is_scenario_file(word: str) -> bool:
    """Whether a word names a scenario file."""
    return Path(word).suffix.lower() in SCENARIO_FILES


@contextlib.contextmanager
def naming_file(path: str | os.PathLike[str], name: str = "scenario") -> Iterator[None]:
    """Adds the file to an error about one of its fields."""
    try:
        yield
    except ParameterError as error:
        if error.field == name:  # the file itself
            raise
        bound = f"{error.bound} (in {Path(path)})"
        raise ParameterError(error.field, error.value, bound) from None


def read_settings(path: str | os.PathLike[str], name: str = "scenario") -> dict[str, Any]:
    """Reads a file of a scenario, or of what `name` says, as plain data."""
    data = file_data(path, name)
    schema = data.get("schema")
    if isinstance(schema, str) and not schema.startswith(f"hapticclay-{name}-"):
        raise ParameterError(name, str(path), f"must be a {name}; its schema is {schema!r}")
    if name == "scenario" and isinstance(data.get("leader"), Mapping):
        bound = "must be a scenario; a leader and a follower are for hapticclay pair"
        raise ParameterError(name, str(path), bound)
    return data


def file_data(path: str | os.PathLike[str], name: str = "scenario") -> dict[str, Any]:
    """Reads a file, whatever it describes; what has no name gets that of the file."""
    file = Path(path)
    kind = _file_kind(file, name)
    try:
        text = read_text(file, MOST_SETTINGS)
        data = parse_toml(text) if kind == "TOML" else parse_json(text, _table)
        if not isinstance(data, dict):
            raise ValueError("it holds no table")
    except OSError as error:
        bound = f"must be a file that can be read ({error.strerror})"
        raise ParameterError(name, str(path), bound) from None
    except ValueError as error:
        fault = " ".join(str(error).split())
        if isinstance(error, UnicodeDecodeError):
            fault = f"byte {error.start} is not UTF-8"
        bound = f"must be {kind}: {fault}"
        raise ParameterError(name, str(path), bound) from None
    data = with_present_names(data)
    arm = data.get("arm")
    if isinstance(arm, Mapping) and isinstance(arm.get("file"), str):
        data = {**data, "arm": {**arm, "file": beside(arm["file"], file.parent)}}
    return {"name": file.stem, **data}


def beside(name: str, folder: Path) -> str:
    """A file beside one that names it; else the name as it is, which may be one of the package."""
    if not os.path.isfile(folder / name):
        return name
    plain = os.path.normpath(folder / name)  # without a/.., unless a is a link
    return plain if os.path.isfile(plain) else str(folder / name)


def _from_folder(data: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Data whose arm has a relative path, which then holds from the folder of the file."""
    arm = data.get("arm")
    if not isinstance(arm, Mapping):
        return dict(data)
    name = arm.get("file")
    if not isinstance(name, str) or os.path.isabs(name) or not os.path.isfile(name):
        return dict(data)
    with contextlib.suppress(ValueError):  # on another drive
        name = os.path.relpath(os.path.realpath(name), os.path.realpath(folder))
    return {**data, "arm": {**arm, "file": Path(name).as_posix()}}


def _table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    out = dict(pairs)
    if len(out) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(n for n in names if names.count(n) > 1)
        raise ValueError(f"{twice!r} is given twice")
    return out


def _file_kind(file: Path, name: str) -> str:
    if not is_scenario_file(file.name):
        raise ParameterError(name, str(file), "must be a .toml or a .json file")
    return file.suffix[1:].upper()


def write_part(
    path: str | os.PathLike[str], head: Mapping[str, Any], part: Any, name: str = "scenario"
) -> Path:
    """Writes the fields of a part that differ from the defaults, whole or not at all."""
    file, units = Path(path), {}
    kind = _file_kind(file, name)
    data = _from_folder({**head, **plain_data(part, False, units)}, file.parent)
    text = toml_text(data, units) if kind == "TOML" else json.dumps(data, indent=2) + "\n"
    try:
        raw = text.encode()
    except UnicodeEncodeError:
        raise ParameterError("name", data["name"], "must be text that UTF-8 can encode") from None
    with atomic(file) as f:
        f.write(raw)
    return file


def toml_text(data: Mapping[str, Any], units: Mapping[str, str] = {}) -> str:
    """Plain data as TOML, the unit of a number behind it; "none" stands for None."""
    return "\n".join(_toml_table(data, units)).strip("\n") + "\n"


def _toml_table(
    data: Mapping[str, Any],
    units: Mapping[str, str],
    names: tuple[str, ...] = (),
    key: str = "",
    row: bool = False,
) -> list[str]:
    """Lines of a table, or of an entry of an array of tables: values first, then nested tables."""
    values = {k: v for k, v in data.items() if not _holds_tables(v)}
    shown = key and (values or row or not data)
    lines = ["", f"[[{key}]]" if row else f"[{key}]"] if shown else []
    for name, value in values.items():
        unit = units.get(".".join((*names, name)), "")
        lines.append(f"{_toml_key(name)} = {_toml_value(value)}{f'  # {unit}' if unit else ''}")
    for name, value in data.items():
        inner = f"{key}.{_toml_key(name)}" if key else _toml_key(name)
        if isinstance(value, Mapping):
            lines += _toml_table(value, units, (*names, name), inner)
        elif name not in values:
            for i, table in enumerate(value):
                lines += _toml_table(table, units, (*names, name, str(i)), inner, True)
    return lines


def _holds_tables(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(isinstance(v, Mapping) for v in value)
    return isinstance(value, Mapping)


def _toml_key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _toml_value(name)


def _toml_value(value: Any) -> str:
    if value is None:
        return '"none"'
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml_value, value))}]"
    if isinstance(value, Mapping):
        inner = (f"{_toml_key(k)} = {_toml_value(v)}" for k, v in value.items())
        return f"{{{', '.join(inner)}}}"
    if isinstance(value, str):  # JSON and TOML escape the same characters, except one
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value).lower()  # true, false; numbers to the last bit
