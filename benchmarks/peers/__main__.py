"""Prints every peer against the reference:

`python -m peers [file ...] [--problem NAME] [--all]`, from benchmarks/.
"""

from __future__ import annotations

import argparse
import importlib

from .common import PROBLEMS

FILES = ("scipy_ivp", "python_control", "pybullet_peer", "drake_peer", "pinocchio_peer")


def main() -> None:
    """Largest error of the crossing times [s] and wall time [s] per method and setting."""
    from ..problems import reference

    args = argparse.ArgumentParser(description=__doc__)
    args.add_argument("files", nargs="*", default=FILES)
    args.add_argument("--problem", default="default cut", choices=list(PROBLEMS))
    args.add_argument("--all", action="store_true", help="all problems")
    a = args.parse_args()
    for problem in PROBLEMS if a.all else [a.problem]:
        exact = [float(t) for t in reference(problem).crossings]
        for file in a.files:
            try:
                peer = importlib.import_module(f".{file}", __package__)
            except ImportError as error:
                print(f"{file}: {error}")
                continue
            for method, settings in peer.methods().items():
                for setting in settings:
                    r = peer.solve(problem, method, setting)
                    gaps = [abs(x - y) for x, y in zip(r.crossings, exact, strict=False)]
                    worst = (
                        f"{max(gaps):9.2e}" if len(gaps) == len(exact) else f"{len(gaps)} of 3  "
                    )
                    line = f"{problem:16s} {peer.NAME:15s} {method:20s} {setting:8.1e} {worst}"
                    print(line, f"{r.wall:8.3f}", [f"{g:.1e}" for g in gaps], r.note, flush=True)


if __name__ == "__main__":
    main()
