"""Files: written whole or not at all, with the versions noted in them; read within bounds."""

from __future__ import annotations

import contextlib
import contextvars
import errno
import functools
import json
import lzma
import os
import platform
import re
import stat
import struct
import tempfile
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from .errors import ParameterError

MOST_READ = 2**30  # [bytes] of a file of data, ...
MOST_TABLE = 2**28  # ... of a table as text, whose cells take several times its size, and ...
MOST_SETTINGS = 2**26  # ... of a file of settings, TOML or JSON
DEEPEST = 100  # tables and lists in one another; what this package writes has some ten
MOST_WHOLE = 2**64  # of whole numbers in a file: seeds are the largest
DAMAGED = (  # what zipfile, its decompressors, NumPy and json raise, and a part of the wrong type
    OSError,
    EOFError,
    LookupError,
    ValueError,
    ArithmeticError,
    TypeError,
    AttributeError,
    RuntimeError,
    SyntaxError,
    tokenize.TokenError,  # by NumPy, of a damaged head
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
)
_KEY = r"""(?>[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_DEEP_KEY = re.compile(rf"(?<![\w-]){_KEY}(?:[ \t]*+\.[ \t]*+{_KEY}){{{DEEPEST}}}")


@functools.cache  # some milliseconds
def versions() -> dict[str, str]:
    """Versions of Python and of the packages a run depends on."""
    out = {"python": platform.python_version()}
    for package in ("hapticclay", "mujoco", "numpy", "scipy"):
        try:
            out[package] = version(package)
        except PackageNotFoundError:
            out[package] = "unknown"
    return out


def writable(folder: Path) -> None:
    """Checks that a folder can be made and written, before any work is done."""
    made = [p for p in (folder, *folder.parents) if not os.path.lexists(p)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        why = "it is a file" if os.path.isfile(folder) else error.strerror
        raise ParameterError("out", str(folder), f"must be a writable folder ({why})") from None
    finally:
        for p in made:
            with contextlib.suppress(OSError):
                p.rmdir()


_read_from: contextvars.ContextVar[frozenset[str]] = contextvars.ContextVar(
    "read_from", default=frozenset()
)


@contextlib.contextmanager
def sources_kept(paths: Iterable[Path]) -> Iterator[None]:
    """Protects the files that a command reads from being replaced."""
    files = [f for p in paths for f in (p.iterdir() if os.path.isdir(p) else [p])]
    token = _read_from.set(frozenset(os.path.realpath(f) for f in files))
    try:
        yield
    finally:
        _read_from.reset(token)


def _kind_of_file(path: str) -> str:
    """Kind of object at a path that prevents writing a file; "" for a regular file or nothing."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):  # nothing is there, or the system will say what is wrong
        return ""
    kinds = {stat.S_IFREG: "", stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe"}
    return kinds.get(stat.S_IFMT(mode), "a device or socket")


class Unfit(OSError):
    """A path is no regular file, or the file is larger than its reader accepts.

    Args:
        fault: what is wrong, in words.
    """

    def __init__(self, fault: str):
        super().__init__(errno.EINVAL, fault)

    def __reduce__(self):
        return type(self), (self.strerror,)


def check_regular(path: str | os.PathLike[str]) -> None:
    """Refuses a path at which something other than a regular file lies."""
    if "\0" in os.fsdecode(path):
        raise Unfit("no name of a file holds a null byte")
    if kind := _kind_of_file(os.fspath(path)):
        raise Unfit(f"it is {kind}, not a regular file")


def read_bytes(path: str | os.PathLike[str], most: int = MOST_READ) -> bytes:
    """Content of a regular file; a pipe or a device, which may never end, is not opened."""
    check_regular(path)
    too_large = Unfit(f"it is larger than {most / 2**20:.3g} MiB")
    # not to wait, should a pipe have taken its place
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as file:
        size = os.fstat(handle).st_size
        if size > most:
            raise too_large
        content = file.read(size + 1)
        while more := file.read(2**16):  # it grows, or is one that tells no size, as in /proc
            content += more
            if len(content) > most:
                raise too_large
    return content


def read_text(path: str | os.PathLike[str], most: int = MOST_READ) -> str:
    """As `read_bytes`, decoded from UTF-8; a byte order mark is left out."""
    return read_bytes(path, most).decode("utf-8-sig")


def parse_json(
    text: str | bytes, pairs: Callable[[list[tuple[str, Any]]], Any] | None = None
) -> Any:
    """Plain data of a JSON text."""
    try:
        return _bounded(json.loads(text, object_pairs_hook=pairs))
    except RecursionError:
        raise ValueError(_too_deep()) from None


def parse_toml(text: str) -> dict[str, Any]:
    """Plain data of a TOML text."""
    import tomllib

    if _DEEP_KEY.search(text):  # tomllib would take the square of the time
        raise ValueError(_too_deep())
    try:
        return _bounded(tomllib.loads(text))
    except RecursionError:
        raise ValueError(_too_deep()) from None


def _bounded(data: Any) -> Any:
    """The data; ValueError if they are deeper or their numbers longer than any that we write."""
    layer: list[Any] = [[data]]
    for _ in range(DEEPEST + 1):
        inside = []
        for x in layer:
            for value in x.values() if isinstance(x, dict) else x:
                if isinstance(value, dict | list):
                    inside.append(value)
                elif type(value) is int and abs(value) > MOST_WHOLE:
                    raise ValueError(f"a whole number is beyond {MOST_WHOLE:.2g} in size")
        if not inside:
            return data
        layer = inside
    raise ValueError(_too_deep())


def _too_deep() -> str:
    return f"it is nested more than {DEEPEST} deep"


class atomic:
    """Opens a file under a temporary name and renames it when it is complete.

    A symbolic link is kept; its target is replaced.

    Args:
        path: the file.

    Raises:
        ParameterError: the file cannot be written, is not a regular file, or is one that the
            command reads from; no temporary file remains.
    """

    def __init__(self, path: Path):
        self.path = path
        self.target = Path(os.path.realpath(path))

    def __enter__(self):
        if kind := _kind_of_file(str(self.target)):
            raise ParameterError("out", str(self.path), f"must be a regular file, is {kind}")
        if str(self.target) in _read_from.get():
            bound = "must not be a file that the command reads from"
            raise ParameterError("out", str(self.path), bound)
        try:
            self.target.parent.mkdir(parents=True, exist_ok=True)
            name = f".{self.target.name}.{os.urandom(4).hex()}"
            self.temporary = self.target.parent / name
            try:
                self.file = self.temporary.open("xb")
                return self.file
            except BaseException:  # Ctrl-C too
                self.temporary.unlink(missing_ok=True)
                raise
        except OSError as error:
            raise self._refusal(error) from None

    def __exit__(self, kind, error, trace):
        try:
            with self.file:
                if kind is None:
                    self.file.flush()
                    os.fsync(self.file.fileno())
            if kind is None:
                os.replace(self.temporary, self.target)
        except OSError as late:
            error = error or late
        finally:
            self.temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise self._refusal(error) from None

    def _refusal(self, error: OSError) -> ParameterError:
        return ParameterError(
            "out", str(self.path), f"must be writable ({error.strerror or error})"
        )
