"""`hapticclay bench`: the benchmarks of a checkout."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from ..errors import ParameterError
from ..files import writable


@dataclass(frozen=True)
class Bench:
    """Error against run time beside peers, stiff and extreme scenes, throughput: diagrams, a page, the figures as JSON.

    Needs a checkout (the benchmarks are not installed); a peer whose package is missing is listed as left out.
    """

    out: Path = Path("out/bench")
    """Folder for bench.md, the data and the diagrams."""
    quick: bool = False
    """Fewer jobs, settings and scenes: about a minute."""

    def __call__(self) -> int:
        checkout = Path(__file__).resolve().parents[2]
        if not (checkout / "benchmarks" / "bench.py").is_file():
            bound = "not found: run from a checkout, after pip install -e .[bench]"
            raise ParameterError("benchmarks", str(checkout / "benchmarks"), bound)
        writable(self.out)
        sys.path.insert(0, str(checkout))
        import importlib

        importlib.import_module("benchmarks.bench").main(self.out, self.quick)
        return 0
