"""Files that are written whole or not at all, and the versions noted in them."""

from __future__ import annotations

import contextlib
import functools
import os
import platform
import tempfile
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
        ParameterError: it cannot.
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


class atomic:
    """Opens a file under a temporary name and renames it when it is complete.

    Args:
        path: the file.

    Raises:
        ParameterError: the file cannot be written; nothing is left behind.
    """

    def __init__(self, path: Path):
        self.path = path

    def __enter__(self):
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(dir=self.path.parent, prefix=f".{self.path.name}.")
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
                return os.replace(self.temporary, self.path)
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
