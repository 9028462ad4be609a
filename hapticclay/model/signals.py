"""Signals that drive a run: multisines, their values and their exact means."""

from __future__ import annotations

from typing import Any

import numpy as np

from .scenario import Multisine


def line(omega: Any, phase: Any, t: Any, h: Any) -> Any:
    """Mean over [t - h, t + h] [s] of cos(omega t + phase): numbers, or arrays of them."""
    return np.sinc(omega * h / np.pi) * np.cos(omega * t + phase)


class Signal:
    """A multisine, ready to be evaluated.

    Attributes:
        omega: its lines [rad/s], shape (n,). phase: of each line and axis [rad], (n, 2).
        amplitude: of each line, on each axis, (2,).
    """

    def __init__(self, multisine: Multisine):
        m = multisine
        k = np.arange(np.ceil(m.low * m.period - 1e-9), np.floor(m.high * m.period + 1e-9) + 1.0)
        if m.lines is not None:
            want = np.geomspace(k[0], k[-1], m.lines)
            k = k[np.unique(np.abs(k[:, None] - want).argmin(axis=0))]
        self.omega = 2.0 * np.pi * k / m.period
        self.phase = np.random.default_rng(m.seed).uniform(0.0, 2.0 * np.pi, (len(k), 2))
        self.amplitude = np.array(m.rms) * np.sqrt(2.0 / len(k))

    def mean(self, begin: Any, end: Any) -> np.ndarray:
        """Mean over [begin, end] [s], shape (n, 2) for n spans, or (2,) for one; the value where they are equal."""
        begin, end = np.asarray(begin), np.asarray(end)
        t, h = 0.5 * (begin + end)[..., None], 0.5 * (end - begin)[..., None]
        lines = (line(self.omega, self.phase[:, i], t, h).sum(-1) for i in (0, 1))
        return np.stack([x * self.amplitude[i] for i, x in enumerate(lines)], -1)

    def __call__(self, t: Any) -> np.ndarray:
        """Value at t [s], shape (n, 2) or (2,)."""
        return self.mean(t, t)
