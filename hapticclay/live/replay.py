"""Playback of a record like a session."""

from __future__ import annotations

import numpy as np

from ..simulation.record import Record
from ..studies.removal import TOOL, Tool
from ..theory.pose_limits import PoseLimits
from .clock import Clock
from .frame import Frame, Listener, Partner
from .verdict import LiveVerdict, live_gain_limits, live_verdict


class Replay:
    """A record played like a session, with the tool that its session had; `n` is the sample."""

    stream: Listener | None = None
    partner = Partner()
    point = None  # no hand pulls

    def __init__(self, record: Record, tool: Tool = TOOL):
        self.source, self.scenario = record, record.scenario
        self._held = record.held()
        self.tool = Tool(**record.notes["tool"]) if "tool" in record.notes else tool
        self.restart()

    def restart(self) -> None:
        self.paused, self.clock, self.t, self.n = False, Clock(), 0.0, 0
        self.frames = [self._frame(0)]
        self._limits = PoseLimits(self.scenario)

    @property
    def angles(self) -> list[float]:
        """Angles of the arm [rad]."""
        return self.source.q[self.n].tolist()

    @property
    def ended(self) -> str:
        """The status of the record once its end is reached; empty before."""
        return self.source.status if self.n >= len(self.source.t) - 1 else ""

    def advance(self, seconds: float) -> np.ndarray:
        """Advances, unless paused."""
        if self.paused or self.ended:
            return np.empty((0, 2))
        self.t += seconds
        before = self.n
        self.n = max(int(np.searchsorted(self.source.t, self.t, "right")), 1) - 1
        self.frames.append(self._frame(self.n))
        return self.source.p[before : self.n + 1]

    @property
    def gain(self) -> tuple[float, float]:
        """Current K [1/kg]."""
        x, y = (
            self.source.extra["gain"][self.n].tolist()
            if "gain" in self.source.extra
            else self.scenario.gain
        )
        return x, y

    @property
    def b(self) -> tuple[float, float]:
        """Damping of the clay at the handle [N.s/m]."""
        x, y = self.source.b[self.n].tolist()
        return x, y

    def verdict(self) -> LiveVerdict:
        """As for a session; the outcome of the record replaces the monitor's finding."""
        r = self.source
        found = r.outcome.code in ("diverged", "limit cycle") and r.t[self.n] >= r.outcome.time
        limit = live_gain_limits(self._limits, self.frames[-1].p, self.b)
        return live_verdict(self.gain, limit, r.outcome if found else None, True)

    def _frame(self, n: int) -> Frame:
        r = self.source
        p, v, fe, fh, held = (tuple(x[n].tolist()) for x in (r.p, r.v, r.fe, r.fh, self._held))
        return Frame(float(r.t[n]), p, v, fe, fh, held)
