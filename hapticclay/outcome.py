"""Judges a run while it goes on: is it still a run, or has an axis gone unstable?"""

from __future__ import annotations

import math

import numpy as np

from . import lti
from .params import AXES, Scenario
from .record import Outcome

FOLD = math.sin(math.radians(1.0))  # out of reach: elbow within 1 degree of stretched or folded
SPEED = 20.0  # [m/s] beyond any hand
FLOOR = 1e-9  # [m/s] swings below this are rounding
GROWTH = 30.0  # an oscillation that has grown this much, swing by swing, is unstable
STEP = 2.0  # growth of one swing counts to this factor at most: a border crossed is no instability
SWINGS = 6  # consecutive swings that a verdict needs


class Watch:
    """Looks at the rows of a run, chunk by chunk, for the end of its good part.

    An axis is unstable if the swings of its velocity (from one turning point to the next) grow one by
    one, SWINGS of them at least and by GROWTH together; or if SWINGS in a row hardly shrink while a
    motor is in its torque limit; or if it oscillates out of reach above the gain limit of its loop.
    """

    def __init__(self, scenario: Scenario):
        self.scenario = scenario
        self.turn = [0.0, 0.0]  # velocity at the last turning point [m/s]
        self.velocity = [0.0, 0.0]  # last velocity seen [m/s]
        self.swings: list[list[tuple[float, bool]]] = [[], []]  # of the present growth: size [m/s], saturated

    def look(self, rows: np.ndarray, first: int) -> tuple[int, Outcome | None]:
        """Judges the next rows.

        Args:
            rows: shape (n, 14), as loop.advance keeps them. first: index of the first.

        Returns:
            (number of good rows, outcome that ends the run there or None).
        """
        dt = self.scenario.dt
        v, q2 = rows[:, 6:8], rows[:, 1]
        fold = np.abs(np.sin(q2)) < FOLD
        bad = ~np.isfinite(rows).all(axis=1) | (np.abs(v) > SPEED).any(axis=1) | fold
        good = int(bad.argmax()) if bad.any() else len(rows)
        found = self._unstable(rows[:good])
        if found is not None:
            n, axis, cause = found
            step = first + n - 1
            return n, Outcome("diverged", step * dt, step, axis, cause, self._advice(axis))
        if good == len(rows):
            return good, None
        step = max(first + good - 1, 0)
        axis = self._blame([i for i in (0, 1) if len(self.swings[i]) >= 2 and self._above_limit(i)])
        if axis:
            return good, Outcome("diverged", step * dt, step, axis, "oscillation out of reach", self._advice(axis))
        if fold[good]:
            where = "stretched" if math.cos(q2[good]) > 0.0 else "folded"
            advice = "choose a force, start or origin that keeps the handle within 0.11 to 0.59 m of the shoulder"
            return good, Outcome("out of reach", step * dt, step, "", f"the arm is {where}", advice)
        axis = AXES[int(np.argmax(np.nan_to_num(np.abs(v[good]), nan=np.inf)))]
        return good, Outcome("diverged", step * dt, step, axis, f"faster than {SPEED:g} m/s", self._advice(axis))

    def _unstable(self, rows: np.ndarray) -> tuple[int, str, str] | None:
        verdicts = {}
        limit = np.array(self.scenario.torque_limit)
        hit = (np.abs(rows[:, 10:12]) >= limit).any(axis=1)
        for i in range(2):
            v = np.concatenate(([self.velocity[i]], rows[:, 6 + i]))
            sign = np.sign(np.diff(v))
            begin = 0
            for k in np.flatnonzero((sign[1:] != sign[:-1]) & (sign[1:] != 0.0)):
                self._swing(i, v[k + 1], bool(hit[begin : k + 1].any()))
                begin = k + 1
                cause = self._verdict(i)
                if cause:
                    verdicts[i] = (int(k) + 1, cause)
                    break
            if len(rows):
                self.velocity[i] = float(v[-1])
        if not verdicts:
            return None
        growing = [i for i in (0, 1) if len(self.swings[i]) >= 3]
        axis = self._blame([i for i in growing if self._above_limit(i)] or list(verdicts))
        n, cause = min(verdicts.values())
        return n, axis, cause

    def _swing(self, i: int, velocity: float, saturated: bool) -> None:
        size = abs(velocity - self.turn[i])
        self.turn[i] = float(velocity)
        last = self.swings[i][-1][0] if self.swings[i] else 0.0
        if size < FLOOR or size < (0.8 if saturated else 1.0) * last:
            self.swings[i] = []
        if size >= FLOOR:
            self.swings[i].append((size, saturated))

    def _verdict(self, i: int) -> str:
        swings = self.swings[i]
        if len(swings) < SWINGS:
            return ""
        if all(saturated for _, saturated in swings[-SWINGS:]):
            return "oscillation against the torque limits"
        sizes = [size for size, _ in swings]
        if math.prod(min(b / a, STEP) for a, b in zip(sizes, sizes[1:], strict=False)) > GROWTH:
            return "growing oscillation"
        return ""

    def _blame(self, axes: list[int]) -> str:
        return AXES[max(axes, key=lambda i: self.swings[i][-1][0])] if axes else ""

    def _limit(self, i: int) -> tuple[float, float]:
        """The clay and the gain limit of the linear loop of axis i at the nominal pose."""
        clay = self.scenario.clay
        values = getattr(clay, AXES[i]).values if clay else (0.0,)
        return min(((b, lti.gain_limit(AXES[i], b, self.scenario.operator)) for b in values), key=lambda x: x[1])

    def _above_limit(self, i: int) -> bool:
        return self.scenario.gain[i] > self._limit(i)[1]

    def _advice(self, axis: str) -> str:
        s = self.scenario
        i = AXES.index(axis)
        b, limit = self._limit(i)
        if s.gain[i] > limit:
            return (
                f"lower gain[{axis}] from {s.gain[i]:g} to less than {limit:.4g}, "
                f"the limit of the linear loop at b = {b:g} N.s/m"
            )
        if not s.shaping:
            return "turn shaping on: the loop is stable at the nominal pose, the arm's inertia changes along the path"
        return f"lower dt from {s.dt:g} s, or gain[{axis}] from {s.gain[i]:g}"
