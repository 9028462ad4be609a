"""Which code a page's figures were measured on, and whether that code is still the one that ships.

Figures of run time and error depend on how a run advances and on what a scene is, so a page is
stale once `formulas`, `model`, `kernel`, runs of `simulation` or a model in `mjcf/` compute
something else; so are those about arms from files once `arms` does, which no other runs.
Comments, docstrings and layout of Python files compute nothing and do not count.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import os
import subprocess
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
ROOMS = "formulas/*", "kernel/*", "model/*"
RUNS = "many", "monitor", "one_run", "run", "vectored"  # of simulation
FILES = (*(f"{room}.{kind}" for room in ROOMS for kind in ("py", "pxd", "pyx")),
         *(f"simulation/{name}.py" for name in RUNS))  # fmt: skip
MEASURED = *(f"hapticclay/{file}" for file in FILES), "mjcf/*"
ARMS = "hapticclay/arms/*.py", "mjcf/arms/*"
ABOUT_ARMS = "arms", "pairs", "first_results"  # parts that read arms from files
UNKNOWN = "unknown"  # commit of a copy without history


def code_digest(part: str, root: Path = ROOT) -> str:
    """Digest of the code that a part's figures depend on.

    Args:
        part: name of the part.
        root: of a checkout.

    Returns:
        16 hexadecimal digits.
    """
    digest = hashlib.sha256()
    patterns = MEASURED + ARMS * (part in ABOUT_ARMS)
    for file in sorted(f for pattern in patterns for f in root.glob(pattern) if f.is_file()):
        digest.update(str(file.relative_to(root)).encode())
        digest.update(_meaning(file.read_bytes()) if file.suffix == ".py" else file.read_bytes())
    return digest.hexdigest()[:16]


@functools.cache  # each part of the benchmark asks anew
def _meaning(source: bytes) -> bytes:
    """What a module computes: its syntax without docstrings."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [x for x in body if not _is_text(x)]  # type: ignore[attr-defined]
    return ast.dump(tree).encode()


def _is_text(node: ast.AST) -> bool:
    """Whether a statement is a string that nothing takes, as a docstring."""
    value = getattr(node, "value", None)
    return (
        isinstance(node, ast.Expr) and isinstance(value, ast.Constant) and type(value.value) is str
    )


def commit(root: Path = ROOT) -> str:
    """The commit of a checkout, with "+" where tracked files have changed since.

    Args:
        root: of the checkout.

    Returns:
        The first 10 digits of the commit; "unknown" outside of git.
    """
    try:
        said = subprocess.run(
            ["git", "-C", str(root), "describe", "--always", "--abbrev=10", "--dirty=+",
             "--exclude=*"],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return UNKNOWN
    return said.stdout.strip()


class Stopwatch:
    """Notes commit, code, date, duration and load of a measurement that begins now."""

    def __init__(self, part: str):
        """Starts the clock.

        Args:
            part: name of what is measured.
        """
        self._begin, self._load = time.monotonic(), os.getloadavg()[0]
        self._commit, self._code = commit(), code_digest(part)

    def stamp(self) -> dict[str, Any]:
        """What a file of figures says of its making, at the end of the measurement.

        Returns:
            commit; code, the digest of what was measured; date; took, the duration [s]; load, the
            load average of the machine before and after.
        """
        return {
            "commit": self._commit,
            "code": self._code,
            "date": time.strftime("%Y-%m-%d"),
            "took": round(time.monotonic() - self._begin, 1),
            "load": [round(x, 1) for x in (self._load, os.getloadavg()[0])],
        }


def stale(data: dict[str, dict[str, Any]], root: Path = ROOT) -> dict[str, str]:
    """Parts of a page that were measured on other code than the one in a checkout.

    Args:
        data: of the parts, by name.
        root: of the checkout.

    Returns:
        Name of each such part and the commit that it was measured on.
    """
    old = {
        name: x
        for name, x in data.items()
        if x.get("made", {}).get("code") != code_digest(name, root)
    }
    return {name: x.get("made", {}).get("commit", UNKNOWN) for name, x in old.items()}
