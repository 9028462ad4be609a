"""Files that are written whole or not at all, and the versions noted in them."""

from __future__ import annotations

import contextlib
import contextvars
import functools
import os
import platform
import stat
import tempfile
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from .errors import ParameterError


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
    """Checks that a folder can be made and written, before any work is done.

    Args:
        folder: the folder; it is not made.

    Raises:
        ParameterError: the folder cannot be made or written.
    """
    made = [p for p in (folder, *folder.parents) if not p.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ParameterError(
            "out", str(folder), f"must be a writable folder ({error.strerror})"
        ) from None
    finally:
        for p in made:
            with contextlib.suppress(OSError):
                p.rmdir()


_read_from: contextvars.ContextVar[frozenset[str]] = contextvars.ContextVar(
    "read_from", default=frozenset()
)


@contextlib.contextmanager
def sources_kept(paths: Iterable[Path]) -> Iterator[None]:
    """Protects the files that a command reads from being replaced.

    Args:
        paths: the files; of a folder, those in it.
    """
    files = [f for p in paths for f in (p.iterdir() if p.is_dir() else [p])]
    token = _read_from.set(frozenset(os.path.realpath(f) for f in files))
    try:
        yield
    finally:
        _read_from.reset(token)


def _kind_of_file(path: str) -> str:
    """Kind of object at a path that prevents writing a file; "" for a regular file or nothing."""
    try:
        mode = os.stat(path).st_mode
    except OSError:  # nothing is there, or writing will say what is wrong
        return ""
    kinds = {stat.S_IFREG: "", stat.S_IFDIR: "a folder", stat.S_IFIFO: "a pipe"}
    return kinds.get(stat.S_IFMT(mode), "a device or socket")


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
            folder, prefix = self.target.parent, f".{self.target.name}."
            handle, name = tempfile.mkstemp(dir=folder, prefix=prefix)
        except OSError as error:
            raise self._refusal(error) from None
        self.temporary = Path(name)
        self.file = os.fdopen(handle, "wb")
        return self.file

    def __exit__(self, kind, error, trace):
        try:
            with self.file:
                if kind is None:
                    self.file.flush()
                    os.fsync(self.file.fileno())
                    umask = os.umask(0)
                    os.umask(umask)
                    os.fchmod(self.file.fileno(), 0o666 & ~umask)
            if kind is None:
                return os.replace(self.temporary, self.target)
        except OSError as late:
            error = error or late
        self.temporary.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise self._refusal(error) from None
        return None

    def _refusal(self, error: OSError) -> ParameterError:
        return ParameterError(
            "out", str(self.path), f"must be writable ({error.strerror or error})"
        )
