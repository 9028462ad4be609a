"""The run of a session: a hand pulls to a point, and steps are made in slices."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from ..errors import number
from ..kernel import path
from ..model.operator import Operator
from ..model.signals import Multisine
from ..scene.scenario import Scenario
from ..simulation import monitor
from ..simulation.engines import engine_for
from ..simulation.run import Run

LONGEST_SESSION = 3600.0  # [s]
PULL_MARGIN = (0.05, 0.02)  # distance of the target point from the folded and the stretched arm [m]


class Pull:
    """The muscle force of a hand that pulls to a point with the spring of its impedance.

    The force is k times the position of the point. The loop applies the impedance of the hand to p,
    so the sum is fh = -Th applied to p - point. `force` is added [N], and `damper_force`, that of
    the damper of a moving hand [N]; `knots` is the point's path so far, (t [s], x, y [m]).
    """

    def __init__(self, spring: tuple[float, float], p: tuple[float, float]):
        """Places the point at the handle."""
        self.spring, self.force = np.array(spring), (0.0, 0.0)
        self.damper_force = 0.0, 0.0
        self.knots = [(0.0, *p)]
        self._motion = np.array(p), np.zeros(2), 0.0  # place [m], velocity [m/s], since [s]

    def gliding(self, t: float, to: tuple[float, float], span: float) -> tuple[Any, ...]:
        """Motion to a place at constant speed, and its knots, to `put`."""
        now = self.at(t)
        motion = now, (np.array(to) - now) / span, t
        return motion, len(self.knots), [(t, *now), (t + span, *to)]

    def released(self, t: float, p: tuple[float, float], v: tuple[float, float]) -> tuple[Any, ...]:
        """Motion with the handle, which is released, and its knots, to `put`."""
        return (np.array(p), np.array(v), t), len(self.knots), [(t, *p)]

    def put(self, motion: Any, n: int, knots: list[tuple[float, float, float]]) -> None:
        """Moves the point from now on; its path has the first n knots and these."""
        self._motion, self.knots[n:] = motion, knots

    def at(self, t: Any) -> np.ndarray:
        """Returns the position of the point [m], shape (2,) or (n, 2)."""
        p, v, since = self._motion
        return p + (np.asarray(t) - since)[..., None] * v

    def steady(self) -> tuple[float, ...]:
        """The force as parts.Push.steady: since [s], (x, y) [N], its rate [N/s]."""
        p, v, since = self._motion
        (fx, fy), (px, py) = self.force, (self.spring * p).tolist()
        cx, cy = self.damper_force
        return float(since), fx + cx + px, fy + cy + py, *(self.spring * v).tolist()

    def mean(self, t: Any, h: Any) -> np.ndarray:
        """Returns the mean force over [t - h, t + h] [N], as `Signal.mean`."""
        return np.array(self.force) + np.array(self.damper_force) + self.spring * self.at(t)


class LiveRun(Run):
    """A run in slices, whose muscle force `pull`, gain and clay may change between slices.

    Samples are kept while `keeping`; `gains` is (index of the first sample with it, gain) in turn.
    """

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every, engine_for("auto"))
        x, y = scenario.hands
        self.pull = Pull((x.spring, y.spring), scenario.start)
        # a person moves it: growing motion is no instability while the gain is below its limit
        self.watch = monitor.StabilityMonitor(self.watched(scenario))
        self.keeping = True
        self.gains = [(0, scenario.gain)]

    def slice(self, steps: int) -> None:
        """Makes the given number of steps, unless the run ends."""
        self.mend()
        self.pause = min(self.i + steps, self.row.m.last)
        if self.gains[-1][1] != self.scenario.gain:
            self.gains.append((self.i, self.scenario.gain))
        self.push_evenly(self.pull.steady())
        self.go(None)
        if self.filled:
            self.flush()

    def watched(self, scenario: Scenario) -> Scenario:
        return replace(scenario, muscle=Multisine())

    @property
    def held(self) -> tuple[bool, bool]:
        """Whether yielding clay holds the handle, along x and along y."""
        x, y = self.row.s.axis
        return bool(x.stuck), bool(y.stuck)

    def judge(self, made: np.ndarray) -> int:
        """As Run.judge; discards the samples while recording is off."""
        before = len(self.kept)
        good = super().judge(made)
        if not self.keeping:
            del self.kept[before:]
        return good

    def end(self) -> None:
        """Ends the run, with the status of a completed run."""
        self.row.s.closing = path.FINISHED
        self.advance(self.filled + 1)
        self.flush()


def session_scenario(scenario: Scenario, stiffness: float = 1.0) -> Scenario:
    """Returns the scenario of a session: a person as the muscle, and no end of the path."""
    stiffness = number("stiffness", stiffness, 1e-3, 1e4)
    x, y = (
        Operator(th.mass, th.damper * math.sqrt(stiffness), th.spring * stiffness)
        for th in (given or Operator() for given in scenario.operators)
    )
    return replace(
        scenario,
        operator=x if x == y else (x, y),
        force=(0.0, 0.0),
        muscle=None,
        command=None,
        length=None,
        t_max=LONGEST_SESSION,
        stop_when_unstable=False,
    )
