"""Interactive sessions: a person pulls the handle of a running simulation, frame by frame.

`Session` is the run, `Replay` plays a record instead, `Player` advances either in real time, and
`live_verdict` judges the stability of the loop. This module draws nothing: the window, the page or
a script sets the point to which the hand pulls. A slice is stepped by kicks, like any run.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import replace

import numpy as np

from ..errors import ParameterError, integer, number
from ..model.operator import NO_HAND
from ..scene.scenario import Scenario
from ..simulation import monitor
from ..simulation.record import Record
from ..simulation.run import COLUMNS
from ..studies.removal import TOOL, Tool, removed
from ..theory.pose_limits import PoseLimits
from .clock import FRAME_TIME, LATE_EDGES, Clock
from .frame import Frame, Listener, Partner
from .run import PULL_MARGIN, LiveRun, played
from .verdict import CALM_TIME, LiveVerdict, is_viscous, live_gain_limits, live_verdict


class Session:
    """A person, the arm and the clay.

    Attributes:
        tool: at the handle.
        stiffness: stiffness of the hand's spring, as a multiple of Th's.
        every: samples per sample kept.
        given: scenario as it was given.
        scenario: running scenario, with the present gain and damping.
        run: the run that steps it.
        paused: whether simulated time is paused.
        recording: whether samples are kept.
        clock: clock of real time.
        point: target point of the hand [m]; None if it does not pull.
        frames: end of each slice so far.
        stream: listener that receives each slice; None for none.
        partner: device whose samples the slices follow; None for none.
        frame_time: least simulated time between two frames [s].
    """

    stream: Listener | None = None
    partner: Partner | None = None
    frame_time = 0.0

    def __init__(
        self, scenario: Scenario, stiffness: float = 1.0, tool: Tool = TOOL, every: int = 1
    ):
        """Begins at the start of a scenario; its force, length and t_max are ignored."""
        self.tool, self.stiffness = tool, stiffness
        self.every = integer("every", every, 1, 1_000_000)
        self.start(scenario)

    def start(self, scenario: Scenario) -> None:
        """Starts a scenario with uncut clay and an empty record."""
        self.scenario = self.prepared(scenario)
        self.given = scenario
        self.run = LiveRun(self.scenario, self.every)
        self.paused, self.recording = False, True
        self.clock = Clock(FRAME_TIME if self.partner is None else self.partner.span)
        self.point: tuple[float, float] | None = None
        self._damping = 1.0
        self.frames: list[Frame] = []
        self._limits = PoseLimits(self.scenario)
        self._carry = 0.0
        self._swung = -math.inf  # time of the last growing oscillation [s]
        self._look()

    def prepared(self, scenario: Scenario) -> Scenario:
        """The scenario as it is run."""
        refuse_other(scenario, control="continuous", integrator="fast")
        return played(scenario, self.stiffness)

    def restart(self) -> None:
        """Restarts the same scenario with the present gain, damping and recording switch."""
        gain, b, recording = self.scenario.gain, self._damping, self.recording
        self.start(self.given)
        self.change(gain=gain, b=b)
        self.recording = recording

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self.run.t

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
        p = self.frames[-1].p
        limit = live_gain_limits(self._limits, p, self.b) if is_viscous(s, p) else None
        return live_verdict(self.gain, limit, onset, self.t - self._swung < CALM_TIME)

    def pull(self, point: tuple[float, float] | None) -> None:
        """Makes the hand pull to a point, within reach of the arm."""
        self.point = None if point is None else self._within_reach(point)

    def push(self, force: tuple[float, float]) -> None:
        """Makes the hand press with a constant force, in addition to any pull."""
        self.run.pull.force = tuple(number("force", f, -1e3, 1e3, unit="N") for f in force)

    def change(self, gain: tuple[float, float] | None = None, b: float | None = None) -> None:
        """Changes the gain or the damping."""
        scenario = self.scenario
        if gain is not None:
            scenario = replace(scenario, gain=gain)
        if b is not None:
            self._damping = number("b", b, 0.0, 1e6)
            clay = self.given.clay
            scenario = replace(scenario, clay=clay and clay.scaled(self._damping))
        self.scenario = scenario
        self.run.change(scenario)

    @property
    def damping(self) -> float:
        """Factor on the given damping, yield force and consistency of all clay."""
        return self._damping

    def advance(self, seconds: float) -> np.ndarray:
        """Advances by a slice of simulated time, unless paused."""
        run, dt = self.run, self.scenario.dt
        if self.paused or run.outcome:
            return np.empty((0, 2))
        steps = math.floor((seconds + self._carry) / dt + 1e-9)
        self._carry += seconds - steps * dt
        if not steps:
            return np.empty((0, 2))
        if self.point is None:
            run.pull.jump(run.t, *self.handle())
        else:
            run.pull.lead(run.t, self.point, steps * dt)
        run.keeping = self.recording
        before = run.position()
        run.slice(steps)
        self._look()
        return np.array([before, run.position()])

    def record(self) -> Record:
        """Ends the run and returns its record, with removed volume, hand's point and gain."""
        run = self.run
        if run.outcome is None and run.i:
            run.end()
        if not run.kept:
            raise ParameterError("record", self.scenario.name, "nothing was recorded")
        out = Record.of(run, max(self.clock.real, 1e-9))
        volume, rate = self._removed(out)
        knots = np.array(run.pull.knots)
        index = np.rint(out.t / self.scenario.dt)
        which = np.searchsorted([i for i, _ in run.gains], index, "right") - 1
        extra = {
            "removed": volume,
            "removal_rate": rate,
            "target": np.column_stack(
                [np.interp(out.t, knots[:, 0], knots[:, 1 + i]) for i in (0, 1)]
            ),
            "gain": np.array([gain for _, gain in run.gains])[which],
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

    def _look(self) -> None:
        watch = self.run.watch
        if watch.onset and max(map(len, watch.swings)) >= monitor.SWINGS:
            self._swung = self.t
        if self.frames and self.t < self.frames[-1].t + self.frame_time - 1e-9:
            return
        p, v = self.handle()
        b = self.b
        hands = [th or NO_HAND for th in self.scenario.operators]
        spring, damper = np.array([(th.spring, th.damper) for th in hands]).T
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
