"""What every benchmark writes: its data with schema and machine, its numbers, its command line."""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from tabulate import tabulate

import hapticclay as hc
from hapticclay import files

from . import provenance

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
DISTRIBUTIONS = (
    "hapticclay",
    "mujoco",
    "numpy",
    "scipy",
    "numba",
    "control",
    "pybullet",
    "drake",
    "pin",
)


def warm() -> None:
    """Load the loops and make a run of each method before the clock runs."""
    for kind in ({}, {"integrator": "accurate"}, {"control": "sampled"}):
        hc.simulate(hc.free(t_max=0.01, **kind), engine="native")


def machine() -> list[str]:
    """Return lines on where and with what the figures were made."""
    found = []
    for name in DISTRIBUTIONS:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.is_file():
        names = [
            x.split(":", 1)[1].strip()
            for x in info.read_text().splitlines()
            if x.startswith("model name")
        ]
        cpu = names[0] if names else cpu
    return [
        f"{cpu}, {os.cpu_count()} cores, Python {platform.python_version()}",
        ", ".join(found),
        f"load average {os.getloadavg()[1]:.1f} at the end; "
        "run times are those of a quiet machine only where it is low",
    ]


def foot() -> list[str]:
    """Return lines on which code, when, where and with what the figures of a page were made."""
    return [f"commit `{provenance.commit()}`, {time.strftime('%Y-%m-%d')}", *machine()]


def number(x: float | None) -> str:
    """Format a figure of a table to two digits, as 3.4e-5; "-" for None."""
    return "-" if x is None else plain(format(x, ".1e"))


def plain(text: str) -> str:
    """A number in exponential notation without the zero and the plus of its exponent."""
    return text.replace("e-0", "e-").replace("e+0", "e").replace("e+", "e")


def milliseconds(seconds: float | None) -> str:
    """Format a run time in ms to two digits; "-" for None."""
    return "-" if seconds is None else format(float(f"{1e3 * seconds:.2g}"), "g")


def table(cells: list[Any], head: list[str] | str = "keys") -> str:
    """A Markdown table; text cells stay as they are."""
    return tabulate(cells, head, tablefmt="github", disable_numparse=True)


def write(out: Path, name: str, found: dict[str, Any]) -> dict[str, Any]:
    """Write out/name.json with schema and machine; return what it holds."""
    data = {"schema": f"hapticclay-{name.replace('_', '-')}-2", "machine": machine(), **found}
    note(out, name, data)
    return data


def note(out: Path, name: str, data: dict[str, Any]) -> None:
    """Write out/name.json anew, with more beside what `write` wrote.

    Args:
        out: the folder.
        name: of the part.
        data: all that the file is to hold.
    """
    with files.atomic(out / f"{name}.json") as f:
        f.write((json.dumps(data, indent=1, allow_nan=False) + "\n").encode())


def publish(out: Path | None, name: str, rows: list[dict[str, Any]], page: str) -> None:
    """Print a page and, with a folder, write it and its rows, with the machine.

    Args:
        out: the folder.
        name: of both files.
        rows: of the data; a number that was not found is NaN.
        page: the page.
    """
    print(page)
    if out:
        with files.atomic(out / f"{name}.json") as f:
            f.write((json.dumps({"machine": machine(), "rows": rows}, indent=1) + "\n").encode())
        with files.atomic(out / f"{name}.md") as f:
            f.write(page.encode())


def parser(doc: str | None) -> argparse.ArgumentParser:
    """Return the command line that all benchmarks share: --out.

    Args:
        doc: the module's docstring.
    """
    made = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("--out", type=Path, default=Path("out/bench"))
    return made
