"""Learning curves of `ppo.py` and `sac.py`: a panel for each environment, with the baselines.

python examples/learning/curves.py out/learning/*.csv --out gym_learning.png
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

from matplotlib.figure import Figure

LINES = ("-", "--", "-.", ":")
REFERENCES = {  # means over the seeds 0 to 99, of the pages of the environments
    "CutLine-v0": {"PD along the line": 17.38},
    "AdaptiveGain-v0": {"robust gain": -15.09, "oracle": -7.59},
}


def curve(file: Path) -> tuple[list[float], list[float]]:
    """Control periods in thousands, and mean returns, of a file of theirs."""
    with file.open(newline="") as f:
        rows = [row for row in csv.DictReader(f) if row["return"] not in ("", "nan")]
    return [float(r["steps"]) / 1000.0 for r in rows], [float(r["return"]) for r in rows]


def label_of(file: Path) -> str:
    """Algorithm and seed of a file."""
    algorithm, *_, seed = file.stem.split("-")
    return f"{algorithm.upper()}, seed {seed}"


def draw(files: list[Path]) -> Figure:
    """A panel for each environment that the files name."""
    names = sorted({"-".join(f.stem.split("-")[1:-1]) for f in files}, reverse=True)
    figure = Figure(figsize=(6.4, 2.9 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, squeeze=False)[:, 0]
    for name, ax in zip(names, panels, strict=True):
        own = sorted(f for f in files if f"-{name}-" in f.name)
        for file, line in zip(own, LINES, strict=False):
            ax.plot(*curve(file), line, label=label_of(file))
        for (label, x), line in zip(REFERENCES.get(name, {}).items(), (":", "-."), strict=False):
            ax.axhline(x, color="0.3", ls=line, lw=1.0, label=label)
        ax.set(title=name, xlabel="control periods [thousand]", ylabel="return")
        worst = min(REFERENCES.get(name, {"": 0.0}).values())
        if worst < 0.0:  # the first returns would hide the difference from the references
            ax.set_ylim(bottom=5.0 * worst)
        ax.grid(color="0.9")
        ax.legend(frameon=False, fontsize=8)
    return figure


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("gym_learning.png"))
    given = parser.parse_args()
    draw(given.files).savefig(given.out, dpi=130)
