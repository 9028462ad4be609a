"""Prepares the signals of a run, the muscle force and the command, part by part."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..model import pieces
from ..model.signals import Signal
from ..scene.scenario import Scenario
from . import march
from . import parts as p_

COSINES = 2**22  # cosines that are tabulated at once where a multisine drives the accurate method
NEAR = 1e-6  # of dt: a jump of a signal so close to the end of a step counts as at its end


class Drives:
    """The signals of a run, put into its parts.

    Args:
        scenario: of the run; its muscle force or its command varies.
    """

    def __init__(self, scenario: Scenario):
        both = {"muscle": scenario.muscle, "command": scenario.command}
        self.signals = {
            name: Drive(signal, scenario.dt, name == "command")
            for name, signal in both.items()
            if signal is not None and signal.varies
        }

    def prepared(self, parts: p_.Parts, i: int, n: int) -> tuple[p_.Parts, int]:
        """The parts with the signals over the next whole steps.

        Args:
            parts: the scene.
            i: the sample at or before the present time.
            n: number of whole steps.

        Returns:
            The parts; number of whole steps for which they are ready.
        """
        dt, further, tables = parts.time.dt, 2, self.signals.values()
        if parts.accurate is not None:
            counts = march.substeps(parts.accurate.blocks, parts.accurate.substeps, i)
            cosines = max(1, *(x.cosines for x in tables))
            n = min(n, max(1, COSINES // (2 * counts * cosines)))
        elif parts.sampler is not None:
            further += parts.sampler.ratio
        begin, end = max(i - 1, 0) * dt, min((i + n + further) * dt, parts.time.t_max)
        for drive in tables:
            drive.prepare(begin, end)
        if parts.accurate is not None:
            return self._accurate(parts, i, n, (begin, end)), n
        if parts.sampler is not None:
            return self._sampled(parts, i, n), n
        return self._continuous(parts, i, n), n

    def _put(self, parts: p_.Parts, **signals: Any) -> p_.Parts:
        """The parts with signals: as they act on the handle, and on the controller."""
        muscle, command = signals.get("muscle"), signals.get("command")
        if muscle is not None:
            parts = parts._replace(push=parts.push._replace(muscle=muscle))
        if command is None:
            return parts
        if parts.sampler is not None:
            return parts._replace(sampler=parts.sampler._replace(command=command))
        return parts._replace(command=command)

    def _continuous(self, parts: p_.Parts, i: int, n: int) -> p_.Parts:
        t, dt, made = (i + np.arange(n + 1)) * parts.time.dt, parts.time.dt, {}
        for name, x in self.signals.items():
            if name == "muscle":
                ahead = x.mean(t[:n], 0.5 * dt)
            else:
                ahead = np.diff(x.around(t, 0.5 * dt), axis=0)
            made[name] = p_.Signal(x.table, ahead, i)
        return self._put(parts, **made)

    def _sampled(self, parts: p_.Parts, i: int, n: int) -> p_.Parts:
        dt, made = parts.time.dt, {}
        t = (i + np.arange(n)) * dt
        for name, x in self.signals.items():
            if name == "muscle":
                early, late = x.mean(t - 0.25 * dt, 0.25 * dt), x.mean(t + 0.25 * dt, 0.25 * dt)
                halves = np.column_stack((early, late, x(t)))
                made[name] = p_.Signal(x.table, 0.5 * (early + late), i, halves)
            else:
                made[name] = p_.Signal(x.table, x(t + parts.sampler.Ts) - x(t), i)
        return self._put(parts, **made)

    def _accurate(self, parts: p_.Parts, i: int, n: int, span: tuple[float, float]) -> p_.Parts:
        dt, made, accurate = parts.time.dt, {}, parts.accurate
        times = stage_times(accurate, dt, i, n)
        for name, x in self.signals.items():
            made[name] = p_.Signal(
                x.table, x(times) if name == "muscle" else x.since_start(times), i
            )
        breaks = np.unique(np.concatenate([x.breaks(*span) for x in self.signals.values()]))
        ahead = p_.Ahead(times, np.append(breaks, math.inf), NEAR * dt)
        return self._put(parts._replace(accurate=accurate._replace(ahead=ahead)), **made)


def stage_times(accurate: p_.Accurate, dt: float, i: int, n: int) -> np.ndarray:
    """Starts and middles of the steps of the accurate method, and the end of the last [s].

    Args:
        accurate: the method.
        dt: length of a sample [s].
        i: index of the first sample.
        n: number of samples.
    """
    k, blocks = i + np.arange(n), []
    counts = np.array([march.substeps(accurate.blocks, accurate.substeps, j) for j in k])
    for each in np.split(k, np.flatnonzero(np.diff(counts)) + 1):
        count = counts[each[0] - i]
        t, end = each * dt, (each + 1) * dt
        times = np.empty((len(each), 2 * count))
        for j in range(count):
            h = dt / count if j < count - 1 else end - t
            times[:, 2 * j], times[:, 2 * j + 1] = t, t + 0.5 * h
            t = t + h
        blocks.append(times.ravel())
    return np.append(np.concatenate(blocks), (i + n) * dt)


class Drive:
    """A signal, and its pieces over the next part of a run.

    Args:
        signal: the signal.
        dt: step of the run [s].
        from_start: count the pieces from their value at t = 0.

    Attributes:
        signal: the signal.
        cosines: number of its multisines' lines.
        table: for the loops, see model.pieces.
    """

    def __init__(self, signal: Signal, dt: float, from_start: bool):
        self.signal, self.dt = signal, dt
        lines = signal.cosines
        self.cosines, self._lines = len(lines), lines
        self._slack, self._first = NEAR * dt, np.zeros(2)
        self._pieces = pieces.NO_PIECES
        self.table = pieces.loop_table(lines, self._pieces, self._slack)
        if from_start:
            self.prepare(0.0, dt)
            if len(self._pieces):
                now = np.zeros(1)
                self._first = pieces.pieces_value(self._pieces, now, now + self._slack)[0]

    def prepare(self, begin: float, end: float) -> None:
        """Makes the pieces of the next part of a run, and from them the table.

        Args:
            begin: of the part, a whole multiple of dt [s].
            end: of the part, a whole multiple of dt or the end of the run [s].
        """
        made = self.signal.pieces(begin, end, self.dt)
        if len(made):
            made = made.copy()
            made[:, [1, 5]] -= self._first
            self.table = pieces.loop_table(self._lines, made, self._slack)
        self._pieces = made

    def breaks(self, begin: float, end: float) -> np.ndarray:
        """Times in the part made ready at which a step must end: jumps, and kinks off the samples.

        Args:
            begin: of the part [s].
            end: of the part [s].

        Returns:
            Ascending [s], shape (n,).
        """
        t = self.signal.breaks(begin, end)
        t = t[(t > begin) & (t < end)]
        if not len(t):
            return t
        before, after = (
            pieces.pieces_value(self._pieces, t, t + s * self._slack) for s in (-1.0, 1.0)
        )
        jumps = np.abs(after - before).max(axis=1) > 1e-12 * np.abs(after + before).max(axis=1)
        off = np.abs(t / self.dt - np.rint(t / self.dt)) > NEAR
        return t[jumps | off]

    def mean(self, t: np.ndarray, h: float) -> np.ndarray:
        """Mean over [t - h, t + h]; for h = 0 the value from t on.

        Args:
            t: centres of the intervals [s], shape (n,), in the part made ready.
            h: half their length [s].

        Returns:
            Shape (n, 2).
        """
        out = self.signal.mean_of_multisines(t, h)
        if len(self._pieces):
            if h == 0.0:
                return out + pieces.pieces_value(self._pieces, t, t + self._slack)
            return out + pieces.pieces_mean(self._pieces, t, np.full(len(t), h))
        return out

    def __call__(self, t: np.ndarray) -> np.ndarray:
        """Value from each time on.

        Args:
            t: times [s], shape (n,), in the part made ready.

        Returns:
            Shape (n, 2).
        """
        return self.mean(t, 0.0)

    def around(self, t: np.ndarray, h: float) -> np.ndarray:
        """Value at times, of pieces the mean over h before and after, or over less next to t = 0.

        Args:
            t: times [s], shape (n,), in the part made ready.
            h: half the length of that interval [s].

        Returns:
            Shape (n, 2).
        """
        out = self.signal.mean_of_multisines(t, 0.0)
        if len(self._pieces):
            out = out + pieces.pieces_mean(self._pieces, t, np.minimum(h, t))
        return out

    def since_start(self, t: np.ndarray) -> Any:
        """Change since t = 0, of a drive that counts its pieces from there.

        Args:
            t: times [s], shape (n,), in the part made ready.

        Returns:
            Shape (n, 2).
        """
        out = self.signal.mean_of_multisines(t, 0.0)
        out = out - self.signal.mean_of_multisines(np.zeros(1), 0.0)
        if len(self._pieces):
            out = out + pieces.pieces_value(self._pieces, t, t + self._slack)
        return out
