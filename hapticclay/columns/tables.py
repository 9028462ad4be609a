"""A table in a file, whatever its format: what readers of formats make, and which reads what."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from ..errors import ParameterError
from .heads import Head
from .text_tables import TextTable

if TYPE_CHECKING:
    import numpy as np


class Table(Protocol):
    """Columns under their heads."""

    @property
    def path(self) -> Path:
        """The file."""
        ...

    @property
    def heads(self) -> Sequence[Head]:
        """Names and units of the columns."""
        ...

    @property
    def rows(self) -> int:
        """Number of rows."""
        ...

    @property
    def form(self) -> str:
        """The format, in words."""
        ...

    @property
    def notes(self) -> Sequence[str]:
        """What was passed over, in words."""
        ...

    def numbers(self, place: int) -> np.ndarray:
        """A column of finite numbers in the unit of the file, (n,)."""
        ...

    def loose_numbers(self, place: int) -> np.ndarray:
        """The same, with NaN for what is no number."""
        ...

    def refusal(self, bound: str) -> ParameterError:
        """An error that names the file."""
        ...


def open_table(field: str, path: Path) -> Table:
    """The table in a file."""
    try:
        return TextTable.read(field, path)
    except OSError as error:
        bound = f"must be a readable file ({error.strerror})"
        raise ParameterError(field, str(path), bound) from None
