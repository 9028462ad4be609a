"""`hapticclay bench`: the benchmarks of a checkout."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from ..errors import ParameterError
from ..files import writable
from .unused import Unused


@dataclass(frozen=True)
class BenchCommand:
    """Run the benchmarks of a checkout: accuracy against run time, stiff scenes, throughput.

    The installed package does not contain the benchmarks. Other packages that are missing are
    listed as omitted. After an interruption, the same command measures only the parts that are
    missing or were measured on other code.

    Attributes:
        out: Folder for the pages (bench.md is the first), the data and the diagrams.
        quick: Run fewer jobs, settings and scenes: about two minutes.
        anew: Measure again what was measured before.
        check: Measure nothing; name the parts in the folder that are older than kernel, formulas
            or model, and exit with status 1 if there are any.
    """

    out: Path = Path("out/bench")
    quick: bool = False
    anew: bool = False
    check: bool = False

    unused: ClassVar[tuple[Unused, ...]] = (
        Unused(("quick", "anew"), "is for measuring: leave it out with --check", ("check",)),
    )

    def __call__(self) -> int:
        checkout = Path(__file__).resolve().parents[2]
        if not (checkout / "benchmarks" / "bench.py").is_file():
            bound = "not found: run from a checkout, after pip install -e .[bench]"
            raise ParameterError("benchmarks", str(checkout / "benchmarks"), bound)
        sys.path.insert(0, str(checkout))
        import importlib

        bench = importlib.import_module("benchmarks.bench")
        if self.check:
            return bench.check(self.out)
        writable(self.out)
        bench.main(self.out, self.quick, anew=self.anew)
        return 0
