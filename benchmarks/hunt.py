"""A hunt: the tests with all of their cases, and ten times as many random examples.

python -m benchmarks.hunt [arguments of pytest]

The suite tries a part of the cases of each search (`tests/hunt.py`). A hunt tries all of them, and
draws other random examples at each call. An example that fails is kept in `.hypothesis`, and tried
first from then on. It takes hours; name a folder or a test to search in it alone.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence


def main(arguments: Sequence[str]) -> int:
    """Runs the tests as a hunt.

    Args:
        arguments: of pytest.

    Returns:
        Its exit status.
    """
    words = [sys.executable, "-m", "pytest", *arguments]
    return subprocess.run(words, env={**os.environ, "HAPTICCLAY_HUNT": "1"}).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
