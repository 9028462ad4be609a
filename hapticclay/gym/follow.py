"""Following a line with the handle: the common base of CutLine and PareEdge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from . import lines
from .draws import Truth
from .quantities import Quantity, either_way
from .task import FORCE, Arrays, Command, Handles, Judged, Task, saturated

SPEED = 0.05  # [m/s] along the line
AHEAD = 5e-3  # [m]
END, LOST = 10.0, -50.0  # rewards
SLOW = 4.0  # the cost of a wrong speed saturates here, so that haste does not pay
SETTLING = 25  # first control periods, not counted for success

PUSH = (
    either_way("muscle force along the line", 1.0),
    either_way("muscle force across the line, to the left", 1.0),
)
MOTION = (
    either_way("velocity along the line", 100.0, "cm/s"),
    either_way("velocity across the line", 100.0, "cm/s"),
    either_way("force of the hand on the handle, along", 100.0, "N"),
    either_way("force of the hand on the handle, across", 100.0, "N"),
    either_way("last action, along", 1.0),
    either_way("last action, across", 1.0),
    Quantity("remaining length of the line", 0.0, 20.0, "cm"),
    Quantity("gain of the device, share of the default", 0.0, 2.0),
)


@dataclass(frozen=True)
class Follow(Task):
    """Task: follow a line at constant speed.

    Attributes:
        pieces: number of straight pieces of the line.
        far: distance from the line at which an episode ends [m].
        most: muscle force at an action of 1 [N].
    """

    actions: ClassVar[tuple[Quantity, ...]] = PUSH
    far: ClassVar[float] = 0.02
    most: ClassVar[float] = FORCE

    @property
    def pieces(self) -> int:
        """Straight pieces of the line."""
        return len(self.line({"angle": 0.0, "depth": 0.0, "depth_at_end": 0.0})) - 1

    def line(self, truth: Truth) -> np.ndarray:
        """Nodes of the line of an episode [m], shape (pieces + 1, 2).

        Args:
            truth: numbers drawn.
        """
        raise NotImplementedError

    def error(self, m: Arrays, at: lines.Place) -> np.ndarray:
        """Deviation from the line, in tolerances, shape (n,).

        Args:
            m: memory of the task.
            at: positions of the handles along their lines.
        """
        raise NotImplementedError

    @override
    def memory(self, n: int) -> Arrays:
        sums = {name: np.zeros(n) for name in ("errors", "speeds", "squares")}
        return {
            **lines.empty(n, self.pieces), **sums, "s": np.zeros(n), "action": np.zeros((n, 2)),
            "count": np.zeros(n), "gain": np.ones(n), "depth": np.ones(n),
            "depth_at_end": np.ones(n), "tangent": np.zeros((n, 2)),
        }  # fmt: skip

    @override
    def begin(self, m: Arrays, i: int, truth: Truth, rng: np.random.Generator) -> None:
        for name in ("errors", "speeds", "squares", "s", "action", "count"):
            m[name][i] = 0.0
        for name in ("gain", "depth", "depth_at_end"):
            m[name][i] = truth.get(name, 1.0)
        lines.lay(m, i, self.line(truth))
        m["at"] = None
        m["tangent"][i] = m["tangents"][i, 0]

    @override
    def command(self, m: Arrays, actions: np.ndarray) -> Command:
        t = m["tangent"]
        a, b = self.most * actions[:, 0], self.most * actions[:, 1]
        return Command(np.stack((t[:, 0] * a - t[:, 1] * b, t[:, 1] * a + t[:, 0] * b), axis=1))

    def beside(self, m: Arrays, h: Handles) -> lines.Place:
        """Positions of the handles along their lines, as found by `judge`; computed after a reset.

        Args:
            m: memory of the task.
            h: handles.
        """
        if m["at"] is None:
            m["at"] = lines.place(m, h.p, AHEAD)
        return m["at"]

    def motion(self, m: Arrays, h: Handles, at: lines.Place) -> list[np.ndarray]:
        """The observations listed in MOTION.

        Args:
            m: memory of the task.
            h: handles.
            at: positions of the handles along their lines.
        """
        v, w = lines.along_across(at.tangent, h.v)
        f, g = lines.along_across(at.tangent, h.fh)
        last = m["action"]
        left = m["length"] - at.s
        return [100.0 * v, 100.0 * w, f, g, last[:, 0], last[:, 1], 100.0 * left, m["gain"]]

    @override
    def judge(self, m: Arrays, h: Handles, actions: np.ndarray) -> Judged:
        at = m["at"] = lines.place(m, h.p, AHEAD)
        error = self.error(m, at)
        speed = lines.along_across(at.tangent, h.v)[0]
        change = actions - m["action"]
        late = speed / SPEED - 1.0
        cost = 0.5 * saturated(error * error) + 0.5 * SLOW * saturated(late * late / SLOW)
        cost += 0.01 * (change[:, 0] * change[:, 0] + change[:, 1] * change[:, 1])
        reward = 100.0 * (at.s - m["s"]) - cost
        lost = h.diverged | ~(at.distance <= self.far)
        done = ~lost & (at.s >= m["length"])
        reward = np.where(lost, LOST, reward + np.where(done, END, 0.0))
        m["s"], m["tangent"], m["action"] = at.s, at.tangent, actions.copy()
        self._count(m, np.abs(error), speed)
        return Judged(reward, lost | done, self._told(m, done, lost))

    def _count(self, m: Arrays, error: np.ndarray, speed: np.ndarray) -> None:
        m["count"] = m["count"] + 1.0
        on = m["count"] > SETTLING
        m["errors"] = m["errors"] + np.where(on, error, 0.0)
        m["speeds"] = m["speeds"] + np.where(on, speed, 0.0)
        m["squares"] = m["squares"] + np.where(on, speed * speed, 0.0)

    def _told(self, m: Arrays, done: np.ndarray, lost: np.ndarray) -> Arrays:
        n = np.maximum(m["count"] - SETTLING, 1.0)
        error, mean = m["errors"] / n, m["speeds"] / n
        spread = np.sqrt(np.maximum(m["squares"] / n - mean * mean, 0.0)) / SPEED
        success = done & (error < 0.5) & (spread < 0.2)
        return {
            "progress": m["s"] / m["length"], "mean_error": error, "speed_spread": spread,
            "is_success": success, "lost": lost,
        }  # fmt: skip
