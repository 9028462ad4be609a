"""What the host of a pair measures: joint positions by encoders, forces by a sensor."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..formulas import hardware as law
from ..model.hardware import Hardware, butterworth
from ..scene.pair import Pair
from ..scene.pair_hardware import turning

IDEAL = Hardware()


class Sensors:
    """Sensors of an arm, from sample to sample."""

    def __init__(self, pair: Pair, i: int, axes: int):
        self.parts = pair.hardware[i] or IDEAL
        self.counts = self.parts.count_sizes(turning(pair.arms[i], pair.n))
        self.quantum = float(getattr(pair.arms[i], "quantum", 0.0))
        self.random = np.random.default_rng([self.parts.seed, i])
        cutoff, order = self.parts.force_filter, self.parts.filter_order
        self.filter: Any = None if cutoff is None else butterworth(cutoff, order, pair.Ts)
        self.state = [(0.0, 0.0)] * axes

    @property
    def is_exact(self) -> bool:
        """Whether positions are measured as they are."""
        return not any(self.counts) and not self.quantum

    def positions(self, q: np.ndarray) -> np.ndarray:
        """Joint positions as encoders read them."""
        if self.is_exact:
            return q
        if self.quantum:
            return np.array([law.round_to_even(float(x), self.quantum) for x in q])
        read = zip(q.tolist(), self.counts, strict=True)
        return np.array([law.encode(x, count) for x, count in read])

    def forces(self, f: np.ndarray) -> np.ndarray:
        """A force along the axes of the handle with noise, filtered, converted."""
        parts = self.parts
        if parts.force_noise:
            f = f + parts.force_noise * self.random.standard_normal(len(f))
        if self.filter is not None:
            out = np.array([x for x, _ in self.state])
            self.state = [
                law.filter_step(self.filter, *z, u) for z, u in zip(self.state, f, strict=True)
            ]
            f = out
        if parts.adc_bits:
            f = np.array([law.quantize(float(x), parts.adc_bits, parts.adc_range) for x in f])
        return f
