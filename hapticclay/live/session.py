"""Interactive sessions: a person pulls the handle of a running simulation, frame by frame.

`Session` is the run, `Replay` plays a record instead, `Player` advances either in real time, and
`live_verdict` judges the stability of the loop. This module draws nothing: the window, the page or
a script sets the point to which the hand pulls. A slice is stepped by kicks, like any run.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace
from typing import Annotated, Any

import numpy as np

from ..arguments import checked
from ..errors import Bound, ParameterError, Real
from ..scene.scenario import Scenario
from ..simulation import monitor
from ..simulation.record import Record
from ..simulation.run import COLUMNS
from ..studies.removal import TOOL, Tool, removed
from ..theory.pose_limits import PoseLimits
from .clock import LATE_EDGES, Clock
from .frame import Frame, Listener, Partner
from .run import PULL_MARGIN, LiveRun, session_scenario
from .verdict import CALM_TIME, LiveVerdict, live_gain_limits, live_verdict


class Session:
    """A person, the arm and the clay.

    `given` is the scenario as given, `run` steps it. `point` is where the hand pulls to [m], None
    if it does not pull. `frames` holds the state at the end of each slice, `frame_time` apart at
    least.
    """

    stream: Listener | None = None
    partner = Partner()
    frame_time = 0.0

    @checked
    def __init__(
        self,
        scenario: Scenario,
        stiffness: float = 1.0,
        tool: Tool = TOOL,
        every: Annotated[int, Bound(1, 1_000_000)] = 1,
    ):
        """Begins at the start of a scenario; its force, length and t_max are ignored.

        The hand's spring is stiffness times that of Th; every every-th sample is kept.
        """
        self.tool, self.stiffness = tool, stiffness
        self.every = every
        self.start(scenario)

    def start(self, scenario: Scenario) -> None:
        """Starts a scenario with uncut clay and an empty record."""
        self._pending: tuple[Any, ...] = "start", scenario
        self.given = scenario
        self.run = LiveRun(self.prepared(scenario), self.every)
        self.paused, self.recording = False, True
        self.clock = Clock(self.partner.span)
        self.point: tuple[float, float] | None = None
        self.damping = 1.0  # factor on damping, yield force and consistency of all clay
        self.frames: list[Frame] = []
        self._limits = PoseLimits(self.scenario)
        self._time_left = 0.0
        self._last_swing = -math.inf  # time of the last growing oscillation [s]
        self._observe()
        self._pending = ()

    @property
    def scenario(self) -> Scenario:
        """The running scenario, with the present gain and damping."""
        return self.run.scenario

    def mend(self) -> None:
        """Completes what Ctrl-C has ended early: a slice, a change, a start."""
        self.run.mend()
        if self._pending:
            name, *arguments = self._pending
            getattr(self, name)(*arguments)

    def prepared(self, scenario: Scenario) -> Scenario:
        """The scenario as it is run."""
        refuse_other(scenario, control="continuous", integrator="fast")
        return session_scenario(scenario, self.stiffness)

    def restart(self) -> None:
        """Restarts the same scenario with the present gain, damping and recording switch."""
        self.mend()
        gain, b, recording = self.scenario.gain, self.damping, self.recording
        self.start(self.given)
        self.change(gain=gain, b=b)
        self.recording = recording

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self.run.t

    @property
    def angles(self) -> list[float]:
        """Angles of the arm [rad]."""
        return list(self.run.q)

    @property
    def ended(self) -> str:
        """Why the run cannot continue (the arm is stretched, ...); empty if it can."""
        return "" if self.run.outcome is None else str(self.run.outcome)

    @property
    def recorded(self) -> bool:
        """Whether anything was recorded."""
        return bool(self.run.kept)

    @property
    def b(self) -> tuple[float, float]:
        """Damping of the clay at the handle [N.s/m]."""
        return self.run.b()

    @property
    def gain(self) -> tuple[float, float]:
        """Current K [1/kg]."""
        return self.scenario.gain

    def verdict(self) -> LiveVerdict:
        """Judges the stability of the loop by the monitor of the run and the gain limit."""
        s, onset = self.scenario, self.run.watch.onset
        if self._limits.scenario is not s:
            self._limits = PoseLimits(s)
        limit = live_gain_limits(self._limits, self.frames[-1].p, self.b)
        return live_verdict(self.gain, limit, onset, self.t - self._last_swing < CALM_TIME)

    def pull(self, point: tuple[float, float] | None) -> None:
        """Makes the hand pull to a point, within reach of the arm."""
        self.point = None if point is None else self._within_reach(point)

    @checked
    def push(self, force: Annotated[tuple[Real, Real], Bound(-1e3, 1e3, "N")]) -> None:
        """Makes the hand press with a constant force, in addition to any pull."""
        self.run.pull.force = force

    @checked
    def change(
        self,
        gain: tuple[float, float] | None = None,
        b: Annotated[float | None, Bound(0.0, 1e6)] = None,
    ) -> None:
        """Changes the gain or the damping; where a number is out of its bounds, nothing."""
        self.mend()
        scenario, damping = self.scenario, self.damping if b is None else b
        if gain is not None:
            scenario = replace(scenario, gain=gain)
        if b is not None:
            clay = self.given.clay
            scenario = replace(scenario, clay=clay and clay.scaled(damping))
        self._change_to(scenario, damping)

    def _change_to(self, scenario: Scenario, damping: float) -> None:
        if scenario is not self.scenario:
            self._pending = "_change_to", scenario, damping
            try:
                self.run.change(scenario)
            except ParameterError:
                self._pending = ()
                raise
        self.damping, self._pending = damping, ()

    def advance(self, seconds: float) -> np.ndarray:
        """Advances by a slice of simulated time, unless paused.

        One that Ctrl-C ended early is completed by the next call.
        """
        self.mend()
        run, dt = self.run, self.scenario.dt
        if self.paused or run.outcome:
            return np.empty((0, 2))
        steps = math.floor((seconds + self._time_left) / dt + 1e-9)
        left = self._time_left + (seconds - steps * dt)
        if not steps:
            self._time_left = left
            return np.empty((0, 2))
        if self.point is None:
            pull = run.pull.released(run.t, *self.handle())
        else:
            pull = run.pull.gliding(run.t, self.point, steps * dt)
        before = run.position()
        self._slice(run.i + steps, pull, left, self.recording)
        return np.array([before, run.position()])

    def _slice(self, end: int, pull: tuple[Any, ...], left: float, keeping: bool) -> None:
        """Makes steps up to a sample; `left`: time that is due then [s]."""
        self._pending = "_slice", end, pull, left, keeping
        self.run.pull.put(*pull)
        self.run.keeping = keeping
        self.run.slice(end - self.run.i)
        self._time_left = left
        self._observe()
        self._pending = ()

    def record(self) -> Record:
        """Ends the run and returns its record, with removed volume, hand's point and gain."""
        self.mend()
        run = self.run
        if run.outcome is None and run.i:
            run.end()
        if not run.kept:
            raise ParameterError("record", self.scenario.name, "nothing was recorded")
        out = Record.of(run, max(self.clock.real, 1e-9))
        volume, rate = self._removed(out)
        t, *point = np.array(run.pull.knots).T
        first, gains = zip(*run.gains, strict=True)
        which = np.searchsorted(first, np.rint(out.t / self.scenario.dt), "right") - 1
        extra = {
            "removed": volume,
            "removal_rate": rate,
            "target": np.column_stack([np.interp(out.t, t, x) for x in point]),
            "gain": np.array(gains)[which],
        }
        clock = self.clock
        notes = {
            "tool": dataclasses.asdict(self.tool),
            "real_time_factor": clock.simulated / clock.real if clock.real else 1.0,
            "frames": clock.frames,
            "late_ms": {"edges": list(LATE_EDGES), "frames": clock.late.tolist()},
        }
        return replace(out, extra=extra, notes=notes)

    def _removed(self, out: Record) -> tuple[np.ndarray, np.ndarray]:
        """As `removed`, along the true path, even where recording was off."""
        t, p, v = (np.array(x) for x in zip(*(f[:3] for f in self.frames), strict=True))
        after = np.searchsorted(out.t, t)
        begin = out.t[np.maximum(after - 1, 0)]
        end = np.append(out.t, math.inf)[after]
        off = (
            (t < out.t[-1])
            & ((after == 0) | (end - begin > 1.5 * self.every * self.scenario.dt))
            & (t != end)
        )
        order = np.argsort(np.concatenate((out.t, t[off])), kind="stable")
        way = replace(
            out, p=np.concatenate((out.p, p[off]))[order], v=np.concatenate((out.v, v[off]))[order]
        )
        kept = np.argsort(order)[: len(out.t)]
        volume, rate = removed(way, self.tool.width, self.tool.depth)
        return volume[kept], rate[kept]

    def handle(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Position of the handle [m], and its velocity half a step ago [m/s]."""
        p, behind = self.run.position(), self.run.position(-self.scenario.dt)
        vx, vy = ((a - b) / self.scenario.dt for a, b in zip(p, behind, strict=True))
        return p, (vx, vy)

    def _observe(self) -> None:
        watch = self.run.watch
        if watch.onset and max(map(len, watch.swings)) >= monitor.SWINGS:
            self._last_swing = self.t
        if self.frames and self.t < self.frames[-1].t + max(self.frame_time - 1e-9, 1e-9):
            return
        p, v = self.handle()
        b = self.b
        spring, damper = np.array([(th.spring, th.damper) for th in self.scenario.hands]).T
        hand = self.run.pull.mean(self.t, 0.0) - spring * np.array(p) - damper * np.array(v)
        fe = b[0] * v[0], b[1] * v[1]
        if self.run.records_force and self.run.last is not None:  # at the last sample
            fe = tuple(self.run.last[COLUMNS["fe"] :].tolist())
        self.frames.append(Frame(self.t, p, v, fe, tuple(hand.tolist()), self.run.held))

    def _within_reach(self, point: tuple[float, float]) -> tuple[float, float]:
        x, y = (a + o for a, o in zip(point, self.scenario.origin, strict=True))
        x = x or 1e-9  # the shoulder has no direction
        r = math.hypot(x, y)
        folded, stretched = self.scenario.arm.reach
        least = min(PULL_MARGIN[0], 0.25 * (stretched - folded))  # of a short arm
        most = min(PULL_MARGIN[1], 0.25 * (stretched - folded))
        scale = min(max(r, folded + least), stretched - most) / r
        return x * scale - self.scenario.origin[0], y * scale - self.scenario.origin[1]


def refuse_other(scenario: Scenario, **fields: str) -> None:
    """Refuses a scenario that a session cannot run."""
    for field, value in fields.items():
        if getattr(scenario, field) != value:
            raise ParameterError(field, getattr(scenario, field), f"must be {value!r} in a session")
