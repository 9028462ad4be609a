"""The sampled loop of `parts`, by name, as `store` keeps it."""

from typing import NamedTuple

import numpy as np

from tests.oracles.parts import sampled


class Samples(NamedTuple):
    """Positions, velocities and torques at the samples, (n, 2) each."""

    p: np.ndarray
    v: np.ndarray
    tau: np.ndarray


def solve(*case) -> Samples:
    """As `parts.sampled`."""
    return Samples(*sampled(*case))
