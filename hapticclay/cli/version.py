"""`hapticclay version`: the versions of what runs."""

from __future__ import annotations

from dataclasses import dataclass

from ..files import versions


@dataclass(frozen=True)
class VersionCommand:
    """Print the versions of hapticclay, Python and the packages it needs."""

    def __call__(self) -> int:
        print("  ".join(f"{name} {number}" for name, number in versions().items()))
        return 0
