"""The reference of the benchmarks under a random signal, as `store` keeps it.

The signal's numbers and the text of the reference are part of the case.
"""

from pathlib import Path

from benchmarks import reference


def case(s, times):
    """What `solve` takes."""
    return s, times, s.muscle.cosines, Path(reference.__file__).read_text()


def solve(s, times, *_):
    """As `reference.solve`."""
    return reference.solve(s, times)
