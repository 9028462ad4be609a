"""Machine code on disk, each function in a file of its own that is verified before it is loaded.

The linker does not check its input: a truncated file crashes the process. So a file begins with the
digest of the rest; a file that fails the check is deleted and compiled again. Its name encodes the
types of the arguments, the processor and the versions. It is written whole by a rename, so
processes may share a folder. Where nothing can be written, functions are compiled for this process
alone.
"""

from __future__ import annotations

import contextlib
import contextvars
import hashlib
import os
import pickle
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

from numba.core import types
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from .machine_code import MARK

DIGEST = hashlib.sha256().digest_size
lost: set[Path] = set()  # folders that machine code could not be written to
on_miss: contextvars.ContextVar[Callable[[], object]] = contextvars.ContextVar("on_miss")


class FileCache(_Cache):
    """Keeps the machine code of one function, for any types of its arguments.

    Args:
        function: the function, as Python has it.
        folder: of the files, named by all that the code depends on except types and processor.
    """

    def __init__(self, function: Any, folder: Path):
        self.folder, self.on = folder, True
        self.name = f"{function.__module__.rpartition('.')[2]}.{function.__qualname__}"
        self.code = hashlib.sha256(function.__code__.co_code).hexdigest()

    @property
    def cache_path(self) -> Any:
        """The folder."""
        return str(self.folder)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Loads the function for some types; None if it is missing or damaged.

        Args:
            sig: the types.
            target_context: of numba.
        """
        target_context.refresh()
        found = self._stored(sig, target_context)
        if found is None and (say := on_miss.get(None)):
            say()  # numba compiles next
        return found

    def _stored(self, sig: Any, target_context: Any) -> Any:
        key = self._key(sig, target_context.codegen())
        file = self._file(key)
        try:
            data = file.read_bytes() if self.on else None
        except OSError:
            return None
        if data is None:
            return None
        try:
            if hashlib.sha256(data[DIGEST:]).digest() == data[:DIGEST]:
                stored, payload = pickle.loads(data[DIGEST:])
                if stored == key:
                    return CompileResult._rebuild(target_context, *payload)
        except Exception:  # complete, but not readable by this process
            pass
        for stale in (file, *self.folder.glob("*" + MARK)):  # the marks would refer to deleted code
            with contextlib.suppress(OSError):
                stale.unlink()
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Stores the function for some types, if there is room; otherwise prints a line.

        Args:
            sig: the types.
            data: what numba compiled.
        """
        if not self.on or any(not x.can_cache for x in data.lifted):
            return
        if data.library.has_dynamic_globals:
            return
        key = self._key(sig, data.codegen)
        body = dumps((key, data._reduce()))
        try:
            write(self._file(key), hashlib.sha256(body).digest() + body)
        except OSError as error:
            unkept(self.folder, error)

    def enable(self) -> None:
        """Loads and stores functions from now on."""
        self.on = True

    def disable(self) -> None:
        """Neither loads nor stores functions from now on."""
        self.on = False

    def flush(self) -> None:
        """Deletes the files of this function."""
        for file in self.folder.glob(f"{self.name}-*.code"):
            file.unlink(missing_ok=True)

    def _key(self, sig: Any, codegen: Any) -> tuple[Any, ...]:
        return str(sig), tuples_in(sig), codegen.magic_tuple(), self.code, sys.version

    def _file(self, key: tuple[Any, ...]) -> Path:
        digest = hashlib.sha256(repr(key).encode()).hexdigest()
        return self.folder / f"{self.name}-{digest[:16]}.code"


def tuples_in(sig: Any) -> tuple[str, ...]:
    """The named tuples among types, with the sources of those from outside of the package.

    Args:
        sig: types of numba.
    """
    found = {f"{x.__module__}.{x.__qualname__} {source_of(x.__module__)}" for x in classes_in(sig)}
    return tuple(sorted(found))


def classes_in(kind: Any) -> Iterator[type]:
    """The classes of the named tuples among types.

    Args:
        kind: types of numba.
    """
    if hasattr(kind, "instance_class"):
        yield kind.instance_class
    if isinstance(kind, tuple | types.BaseTuple):
        for x in cast(Any, kind):
            yield from classes_in(x)


def source_of(module: str) -> str:
    """Digest of the source of a module; "" of one that the folder is named by.

    Args:
        module: its name.
    """
    file = getattr(sys.modules.get(module), "__file__", None)
    if file is None or Path(__file__).parent in Path(file).parents:
        return ""
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()


def write(file: Path, data: bytes) -> None:
    """Writes a file, whole or not at all.

    Args:
        file: the file; its folder is created.
        data: its content.

    Raises:
        OSError: it cannot be written; nothing is left behind.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=file.parent, prefix=".", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as f:
            f.write(data)
        os.replace(temporary, file)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise


def unkept(folder: Path, error: OSError) -> None:
    """Reports once that machine code cannot be stored.

    Args:
        folder: where it was to be stored.
        error: the reason.
    """
    if folder not in lost:
        lost.add(folder)
        why = error.strerror or error
        print(f"hapticclay: machine code is not kept in {folder}: {why}", file=sys.stderr)
