"""Makes pictures of pages, those about symptoms and some others: the figures of their examples.

python docs/pictures.py [NAME ...]
"""

import os
import runpy
import sys
from pathlib import Path

os.environ.setdefault("MPLBACKEND", "agg")

import matplotlib.pyplot as plt

DOCS = Path(__file__).parent
EXAMPLES = DOCS.parent / "examples"
OTHERS = [
    EXAMPLES / name
    for name in (
        "studies/pair_log.py",
        "records/replay.py",
        "runs/pair_at_a_wall.py",
        "walls/arm_as_device.py",
    )
]


def main(names: list[str]) -> None:
    """Runs examples and saves the figure of each as docs/NAME.png.

    Args:
        names: of the examples; none for all.
    """
    plt.show = lambda: None
    for path in (*sorted(EXAMPLES.glob("symptoms/*.py")), *OTHERS):
        if not names or path.stem in names:
            runpy.run_path(str(path), run_name="__main__")
            plt.savefig(DOCS / f"{path.stem}.png", dpi=110)
            plt.close("all")


if __name__ == "__main__":
    main(sys.argv[1:])
