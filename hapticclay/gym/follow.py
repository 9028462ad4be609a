"""Following a line with the handle: the common base of CutLine and PareEdge."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from typing_extensions import override

from . import lines
from .columns import Value, clipped, negated, root, where
from .draws import Truth
from .quantities import Quantity, symmetric
from .task import FORCE, Command, Handle, Judged, Memory, Task, saturated

SPEED = 0.05  # [m/s] along the line
AHEAD = 5e-3  # [m]
END, LOST = 10.0, -50.0  # rewards
SLOW = 4.0  # the cost of a wrong speed saturates here, so that haste does not pay
SETTLING = 25  # first control periods, not counted for success

PUSH = (
    symmetric("muscle force along the line", 1.0),
    symmetric("muscle force across the line, to the left", 1.0),
)
MOTION = (
    symmetric("velocity along the line", 100.0, "cm/s"),
    symmetric("velocity across the line", 100.0, "cm/s"),
    symmetric("force of the hand on the handle, along", 100.0, "N"),
    symmetric("force of the hand on the handle, across", 100.0, "N"),
    symmetric("last action, along", 1.0),
    symmetric("last action, across", 1.0),
    Quantity("remaining length of the line", 0.0, 20.0, "cm"),
    Quantity("gain of the device, share of the default", 0.0, 2.0),
)


@dataclass(frozen=True)
class Follow(Task):
    """Task: follow a line at constant speed."""

    actions: ClassVar[tuple[Quantity, ...]] = PUSH
    far: ClassVar[float] = 0.02  # [m] distance from the line at which an episode ends
    most: ClassVar[float] = FORCE  # [N] muscle force at an action of 1

    def line(self, truth: Truth) -> np.ndarray:
        """Nodes of the line of an episode [m], shape (pieces + 1, 2)."""
        raise NotImplementedError

    def error(self, m: Memory, at: lines.Place) -> Value:
        """Deviation from the line, in tolerances."""
        raise NotImplementedError

    @override
    def begin(self, truth: Truth, rng: np.random.Generator) -> Memory:
        nodes = self.line(truth)
        pieces = lines.pieces_of(nodes)
        zero = dict.fromkeys(("errors", "speeds", "squares", "s", "count"), 0.0)
        return {
            **zero, **truth, "nodes": nodes, "pieces": pieces, "length": lines.length_of(nodes),
            "tangent": pieces[0][2:4], "action": (0.0, 0.0), "at": None,
        }  # fmt: skip

    @override
    def command(self, m: Memory, action: tuple[Value, ...]) -> Command:
        x, y = m["tangent"]
        a, b = self.most * action[0], self.most * action[1]
        return Command((x * a - y * b, y * a + x * b))

    def place(self, m: Memory, h: Handle) -> lines.Place:
        """Position of the handle along its line, from `judge`; computed after a reset."""
        if m["at"] is None:
            m["at"] = lines.place(m["pieces"], h.p, AHEAD)
        return m["at"]

    def motion(self, m: Memory, h: Handle, at: lines.Place) -> tuple[Value, ...]:
        """The observations listed in MOTION."""
        v, w = lines.along_across(at.tangent, h.v)
        f, g = lines.along_across(at.tangent, h.fh)
        remaining = m["length"] - at.s
        return 100.0 * v, 100.0 * w, f, g, *m["action"], 100.0 * remaining, m["gain"]

    @override
    def judge(self, m: Memory, h: Handle, action: tuple[Value, ...]) -> Judged:
        at = m["at"] = lines.place(m["pieces"], h.p, AHEAD)
        error = self.error(m, at)
        speed = lines.along_across(at.tangent, h.v)[0]
        a, b = action[0] - m["action"][0], action[1] - m["action"][1]
        late = speed / SPEED - 1.0
        cost = 0.5 * saturated(error * error) + 0.5 * SLOW * saturated(late * late / SLOW)
        cost = cost + 0.01 * (a * a + b * b)
        reward = 100.0 * (at.s - m["s"]) - cost
        lost = h.diverged | negated(at.distance <= self.far)
        done = negated(lost) & (at.s >= m["length"])
        reward = where(lost, LOST, reward + where(done, END, 0.0))
        m["s"], m["tangent"], m["action"] = at.s, at.tangent, action
        self._add(m, abs(error), speed)
        return Judged(reward, lost | done, self._info(m, done, lost))

    def _add(self, m: Memory, error: Value, speed: Value) -> None:
        """Adds error and speed to their sums, once the motion has settled."""
        m["count"] = m["count"] + 1.0
        settled = m["count"] > SETTLING
        for name, x in (("errors", error), ("speeds", speed), ("squares", speed * speed)):
            m[name] = m[name] + where(settled, x, 0.0)

    def _info(self, m: Memory, done: Value, lost: Value) -> Memory:
        n = clipped(m["count"] - SETTLING, 1.0, math.inf)
        error, mean = m["errors"] / n, m["speeds"] / n
        spread = root(clipped(m["squares"] / n - mean * mean, 0.0, math.inf)) / SPEED
        success = done & (error < 0.5) & (spread < 0.2)
        return {
            "progress": m["s"] / m["length"], "mean_error": error, "speed_spread": spread,
            "is_success": success, "lost": lost,
        }  # fmt: skip
