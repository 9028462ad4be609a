"""A copy of the package with edits, in which CPython runs a program."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import hapticclay as hc

PACKAGE = Path(hc.__file__).parent


def run_edited(folder, edits, program):
    """Runs a program with a copy of the package; returns what it prints.

    Args:
        folder: an empty one.
        edits: by file of the package, what stands there, and what then; or the text of a new file.
        program: its source.
    """
    no_caches = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, folder / "hapticclay", ignore=no_caches, symlinks=True)
    shutil.copytree(PACKAGE.parent / "mjcf", folder / "mjcf")
    for name, changes in edits.items():
        file = folder / "hapticclay" / name
        if isinstance(changes, str):
            assert not file.exists()
            file.write_text(changes)
            continue
        text = file.read_text()
        for old, new in changes:
            assert text.count(old) == 1, (name, old)
            text = text.replace(old, new)
        file.write_text(text)
    out = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
    )
    assert out.returncode == 0, out.stderr
    return out.stdout


def missing_in(section, edits):
    """Files of edits that a section of CONTRIBUTING.md does not name."""
    _, _, text = (PACKAGE.parent / "CONTRIBUTING.md").read_text().partition(f"### {section}\n")
    text, _, _ = text.partition("\n#")
    return [x for x in edits if f"`hapticclay/{x}`" not in text and f"`{Path(x).name}`" not in text]
