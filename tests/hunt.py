"""How much of a search a test makes: a part in the suite, all of it in a hunt.

`python -m benchmarks.hunt` runs the tests as a hunt: with all of their cases, and with other random
examples at each call, ten times as many.
"""

import os
from collections.abc import Iterable

from hypothesis import settings

HUNTS = "HAPTICCLAY_HUNT" in os.environ
MORE = 10 if HUNTS else 1
EXAMPLES = 30  # random examples of a test that does not say how many


def some(cases: Iterable, n: int) -> list:
    """Return n of the cases, evenly spread from the first to the last; in a hunt all of them.

    Args:
        cases: in any order.
        n: how many, 2 or more.
    """
    found = list(cases)
    if HUNTS or len(found) <= n:
        return found
    return [found[round(i * (len(found) - 1) / (n - 1))] for i in range(n)]


def examples(n: int) -> settings:
    """Return the decorator of a test with n random examples; in a hunt ten times as many.

    Args:
        n: how many.
    """
    return settings(max_examples=MORE * n)
