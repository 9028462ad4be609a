"""A run that a person takes part in: they pull at the handle while it goes on, in slices as long as a frame.

No graphics here: whoever shows the session (`view`, `web`) tells it where the hand pulls to and how much time
has passed; a script can do as much. A slice is computed as any run is, by the leapfrog.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
import signal
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import ParameterError, integer, number
from ..model.clay import Clay, Profile
from ..model.constants import AXES, B_MAX, L1, L2
from ..model.operator import Operator
from ..model.scenario import Scenario
from ..model.signals import Multisine
from ..simulation import record
from ..simulation.record import Record
from ..stepping import leapfrog, loop, monitor
from ..stepping.leapfrog import Leapfrog, written_out
from ..stepping.monitor import Outcome
from ..studies.removal import TOOL, Tool, removed
from ..theory import gain_limit

FRAME = 1.0 / 60.0  # [s] between two looks at the person
MOST_FORCE = (
    0.05  # longest slice of simulated time; a machine that needs longer for it slows the clock [s]
)
HOUR = 3600.0  # longest session [s]
REACH_SHORT = (
    abs(L2 - L1) + 0.05,
    L1 + L2 - 0.02,
)  # from the shoulder, of the point that the hand pulls to [m]
JITTER = (
    0.0,
    1.0,
    2.0,
    5.0,
    10.0,
    20.0,
    50.0,
    100.0,
    1000.0,
)  # edges of the histogram of lateness [ms]
RECENT = 60  # frames over which the real-time factor is shown
CALM = 1.0  # without growing swings until an unstable arm is called calm again [s]


class Pull:
    """The muscle force of a hand that pulls to a point through its own spring: k times where the point is.

    With the impedance that the loop holds against p itself, this makes fh = -Th applied to p - point.

    Attributes:
        force: a steady force beside it [N], (2,). knots: (time [s], x, y [m]) of the point's way so far.
    """

    def __init__(self, spring: float, p: tuple[float, float]):
        self.spring, self.force = spring, (0.0, 0.0)
        self.knots = [(0.0, *p)]
        self._from, self._rate, self._since = np.array(p), np.zeros(2), 0.0

    def lead(self, t: float, to: tuple[float, float], span: float) -> None:
        """From t [s] on the point moves evenly to reach `to` [m] after span [s]."""
        now = self.at(t)
        self._from, self._rate, self._since = now, (np.array(to) - now) / span, t
        self.knots += [(t, *now), (t + span, *to)]

    def jump(self, t: float, p: tuple[float, float], v: tuple[float, float]) -> None:
        """From t [s] on the point goes along with a handle at p [m] with v [m/s]: the hand lets go."""
        self._from, self._rate, self._since = np.array(p), np.array(v), t
        self.knots.append((t, *p))

    def at(self, t: Any) -> np.ndarray:
        """Where the point is at t [s], shape (2,) or (n, 2) [m]."""
        return self._from + (np.asarray(t) - self._since)[..., None] * self._rate

    def mean(self, begin: Any, end: Any) -> np.ndarray:
        """Mean force over [begin, end] [s], as signals.Signal.mean [N]."""
        return np.array(self.force) + self.spring * self.at(
            0.5 * (np.asarray(begin) + np.asarray(end))
        )


class _Live(Leapfrog):
    """A run that goes on slice by slice, and whose muscle, gain and clay may change between two."""

    def __init__(self, scenario: Scenario, every: int):
        super().__init__(scenario, every)
        assert scenario.operator is not None
        self.muscle = Pull(scenario.operator.spring, scenario.start)
        self.varies = True
        written_out(leapfrog.glide_varying, self.last)  # now, not while the hand waits
        self.limit = self.last
        # a person moves as they like: growth is no instability while the gain is below its limit
        self.watch = monitor.StabilityMonitor(replace(scenario, muscle=Multisine()))
        self.keeping = True
        self.gains = [(0, scenario.gain)]  # index of the first sample with it

    def slice(self, steps: int) -> None:
        """Makes so many steps, unless the run ends."""
        self.last = self.pause = min(self.i + steps, self.limit)
        self.go(None)
        if self.filled:
            self.flush()

    def change(self, scenario: Scenario) -> None:
        """Goes on with another gain, or other damping between the same borders."""
        if scenario.gain != self.scenario.gain:
            self.gains.append((self.i, scenario.gain))
        self.scenario = scenario
        self.whole = loop.loop_coefficients(scenario, scenario.dt, scenario.dt)
        self.watch.scenario = replace(scenario, muscle=Multisine())
        if scenario.clay is not None:
            self.regions.change(scenario.clay, self.t)

    def judge(self, rows: np.ndarray, b: Any) -> int:
        before = len(self.kept)
        good = super().judge(rows, b)
        if not self.keeping:
            del self.kept[before:]
        return good

    def end(self) -> None:
        """Ends the run here, as one that reached its end."""
        self._close("finished")
        self.flush()


class Clock:
    """Deals out simulated time as real time passes; where the machine is too slow, slower, and evenly so.

    Attributes:
        frames: dealt out. late: how late each was, counted by JITTER. slow: whether the machine is too slow now.
    """

    def __init__(self):
        self.frames, self.late, self.slow = 0, np.zeros(len(JITTER) - 1, dtype=int), False
        self.real = self.simulated = 0.0  # [s] in all
        self._recent: deque[tuple[float, float]] = deque(maxlen=RECENT)
        self._then: float | None = None
        self._owed = 0.0

    def due(self, now: float) -> float:
        """Simulated time to make at wall time now [s], at most MOST [s]."""
        passed = FRAME if self._then is None else now - self._then
        self._then = now
        self._owed += passed
        due = min(self._owed, MOST_FORCE)
        self._owed -= due
        self.slow = self._owed > 0.5 * MOST_FORCE
        if self._owed > MOST_FORCE:  # the rest will never be made good
            self._owed = MOST_FORCE
        self.frames += 1
        self.real += passed
        self.simulated += due
        late = min(max(1e3 * (passed - FRAME), 0.0), JITTER[-1] - 1e-9)
        self.late[np.searchsorted(JITTER, late, "right") - 1] += 1
        self._recent.append((passed, due))
        return due

    def rest(self) -> None:
        """Time passes that is not to be made good: a pause."""
        self._then, self._owed = None, 0.0

    @property
    def factor(self) -> float:
        """Simulated over real time, of late."""
        real, simulated = (
            (sum(x) for x in zip(*self._recent, strict=True)) if self._recent else (1.0, 1.0)
        )
        return simulated / real


class Session:
    """A person, the arm and the clay.

    Attributes:
        scenario: what runs, with the gain and damping of now. paused: whether time stands still.
        recording: whether samples are kept. clock: of real time. frames: (t, p, v, fe, fh) at the end of
            each slice, for plots that run along: t [s], the others (2,).
    """

    def __init__(
        self, scenario: Scenario, stiffness: float = 1.0, tool: Tool = TOOL, every: int = 1
    ):
        """A session begins at the start of the scenario; its own force, length and t_max do not count.

        Args:
            scenario: the clay, gain and arm. stiffness: scales the spring of Th, and its damper by the square root.
            tool: at the handle. every: keep each every-th sample.

        Raises:
            ParameterError: a value is out of its bounds; or the scenario is sampled, or accurate.
        """
        self.tool, self.stiffness = tool, stiffness
        self.every = integer("every", every, 1, 1_000_000)
        self.start(scenario)

    def start(self, scenario: Scenario) -> None:
        """Begins anew with a scenario: clay whole, record empty."""
        for field, value in (("control", "continuous"), ("integrator", "fast")):
            if getattr(scenario, field) != value:
                raise ParameterError(
                    field, getattr(scenario, field), f"must be {value!r} where a person takes part"
                )
        self.given = scenario
        self.scenario = played(scenario, self.stiffness)
        self.run = _Live(self.scenario, self.every)
        self.paused, self.recording = False, True
        self.clock = Clock()
        self.point: tuple[float, float] | None = None
        self._damping = 1.0
        self.frames: list[tuple] = []
        self._carry = 0.0
        self._swung = -math.inf  # when it last swung so that growth would be called unstable [s]
        self._look()

    def restart(self) -> None:
        """Begins the same scenario anew, with the gain and damping as they are now, recording if it is now."""
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
        """Why the run cannot go on (the arm is stretched, ...); empty if it can."""
        return "" if self.run.outcome is None else str(self.run.outcome)

    @property
    def recorded(self) -> bool:
        """Whether there is anything to make a record of."""
        return bool(self.run.kept)

    @property
    def b(self) -> tuple[float, float]:
        """Damping of the clay where the handle is [N.s/m]."""
        return self.run.regions.b(self.run.t)

    @property
    def gain(self) -> tuple[float, float]:
        """K now."""
        return self.scenario.gain

    def verdict(self) -> LiveVerdict:
        """What the monitor of the run, and its gain limit, say now."""
        s, onset = self.scenario, self.run.watch.onset
        return live_verdict(
            self.gain, live_gain_limits(self.b, s.operator), onset, self.t - self._swung < CALM
        )

    def pull(self, point: tuple[float, float] | None) -> None:
        """The hand pulls to this point [m] from now on, as far as the arm reaches; None lets go."""
        self.point = None if point is None else self._within_reach(point)

    def push(self, force: tuple[float, float]) -> None:
        """The hand presses with this steady force [N] from now on, beside any pull."""
        self.run.muscle.force = tuple(number("force", f, -1e3, 1e3, unit="N") for f in force)

    def change(self, gain: tuple[float, float] | None = None, b: float | None = None) -> None:
        """Changes the compensator's gain, or the damping of all clay to b times what the scenario has."""
        scenario = self.scenario
        if gain is not None:
            scenario = replace(scenario, gain=gain)
        if b is not None:
            self._damping = number("b", b, 0.0, 1e6)
            scenario = replace(scenario, clay=scaled(self.given.clay, self._damping))
        self.scenario = scenario
        self.run.change(scenario)

    @property
    def damping(self) -> float:
        """Damping of all clay, relative to what the scenario has."""
        return self._damping

    def advance(self, seconds: float) -> np.ndarray:
        """Makes a slice of simulated time, but nothing while paused; returns where the handle went, (n, 2) [m]."""
        run, dt = self.run, self.scenario.dt
        if self.paused or run.outcome:
            return np.empty((0, 2))
        steps = math.floor((seconds + self._carry) / dt + 1e-9)
        self._carry += seconds - steps * dt
        if not steps:
            return np.empty((0, 2))
        if self.point is None:
            run.muscle.jump(run.t, *self._state())
        else:
            run.muscle.lead(run.t, self.point, steps * dt)
        run.keeping = self.recording
        run.slice(steps)
        self._look()
        return np.array([self.frames[-2][1], self.frames[-1][1]])

    def record(self) -> record.Record:
        """Ends the run and returns what was recorded, with the removed volume, the hand's point and the gain."""
        run = self.run
        if run.outcome is None and run.i:
            run.last = run.limit
            run.end()
        if not run.kept:
            raise ParameterError("record", self.scenario.name, "nothing was recorded")
        out = record.Record.of(run, max(self.clock.real, 1e-9))
        volume, rate = self._removed(out)
        knots = np.array(run.muscle.knots)
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
            "late_ms": {"edges": list(JITTER), "frames": clock.late.tolist()},
        }
        return replace(out, extra=extra, notes=notes)

    def _removed(self, out: record.Record) -> tuple[np.ndarray, np.ndarray]:
        """As removal.removed, along the way that was really gone where recording was off."""
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

    def _state(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Handle position [m] and velocity [m/s], half a step ago."""
        p = self.run.position(self.run.angles, self.run.rates, 0.0)
        behind = self.run.position(self.run.angles, self.run.rates, -self.scenario.dt)
        vx, vy = ((a - b) / self.scenario.dt for a, b in zip(p, behind, strict=True))
        return p, (vx, vy)

    def _look(self) -> None:
        watch = self.run.watch
        if watch.onset and max(map(len, watch.swings)) >= monitor.SWINGS:
            self._swung = self.t
        p, v = self._state()
        b = self.b
        spring = self.run.muscle
        th = self.scenario.operator
        assert th is not None
        hand = spring.mean(self.t, self.t) - th.spring * np.array(p) - th.damper * np.array(v)
        self.frames.append((self.t, p, v, (b[0] * v[0], b[1] * v[1]), tuple(hand.tolist())))

    def _within_reach(self, point: tuple[float, float]) -> tuple[float, float]:
        x, y = (a + o for a, o in zip(point, self.scenario.origin, strict=True))
        x = x or 1e-9  # the shoulder itself lies in no direction
        r = math.hypot(x, y)
        scale = min(max(r, REACH_SHORT[0]), REACH_SHORT[1]) / r
        return x * scale - self.scenario.origin[0], y * scale - self.scenario.origin[1]


def played(scenario: Scenario, stiffness: float = 1.0) -> Scenario:
    """The scenario as a session runs it: the person is the muscle, and there is no end of the path."""
    stiffness = number("stiffness", stiffness, 1e-3, 1e4)
    th = scenario.operator or Operator()
    hand = Operator(th.mass, th.damper * math.sqrt(stiffness), th.spring * stiffness)
    return replace(
        scenario,
        operator=hand,
        force=(0.0, 0.0),
        muscle=None,
        command=None,
        length=None,
        t_max=HOUR,
        stop=False,
    )


def scaled(clay: Clay | None, factor: float) -> Clay | None:
    """The same clay with so many times the damping, at most B_MAX."""

    def times(values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(min(b * factor, B_MAX) for b in values)

    def law(f: Profile) -> Profile:
        return replace(f, values=times(f.values), growth=times(f.growth))

    return None if clay is None else Clay(x=law(clay.x), y=law(clay.y))


class Replay:
    """A record, played as the session it may have been; the attributes are those of Session."""

    def __init__(self, record: Record, tool: Tool = TOOL):
        self.source, self.scenario = record, record.scenario
        self.tool = Tool(**record.notes["tool"]) if "tool" in record.notes else tool
        self.restart()

    def restart(self) -> None:
        """Plays from the beginning."""
        self.paused, self.clock, self.t, self.n = False, Clock(), 0.0, 0
        self.frames: list[tuple] = [self._frame(0)]

    @property
    def ended(self) -> str:
        """How the record ended, once it has."""
        return self.source.status if self.n >= len(self.source.t) - 1 else ""

    def advance(self, seconds: float) -> np.ndarray:
        """Goes on by so much simulated time, but not while paused."""
        if self.paused or self.ended:
            return np.empty((0, 2))
        self.t += seconds
        before = self.n
        self.n = (
            int(np.searchsorted(self.source.t, self.t, "right").clip(1, len(self.source.t))) - 1
        )
        self.frames.append(self._frame(self.n))
        return self.source.p[before : self.n + 1]

    @property
    def gain(self) -> tuple[float, float]:
        """K now."""
        x, y = (
            self.source.extra["gain"][self.n].tolist()
            if "gain" in self.source.extra
            else self.scenario.gain
        )
        return x, y

    @property
    def b(self) -> tuple[float, float]:
        """Damping of the clay where the handle is [N.s/m]."""
        x, y = self.source.b[self.n].tolist()
        return x, y

    def verdict(self) -> LiveVerdict:
        """As of a session; what the monitor found is the outcome of the record."""
        r, n, s = self.source, self.n, self.scenario
        found = r.outcome.code in ("diverged", "limit cycle") and r.t[n] >= r.outcome.time
        limit = live_gain_limits(self.b, s.operator) if s.control == "continuous" else None
        return live_verdict(self.gain, limit, r.outcome if found else None, True)

    def _frame(self, n: int) -> tuple:
        r = self.source
        return (float(r.t[n]), *(tuple(x[n].tolist()) for x in (r.p, r.v, r.fe, r.fh)))


@contextlib.contextmanager
def stoppable() -> Iterator[threading.Event]:
    """An event that Ctrl-C sets, in place of an exception in the midst of anything; a second Ctrl-C is one."""
    stop, before = threading.Event(), signal.getsignal(signal.SIGINT)

    def heard(*_) -> None:
        stop.set()
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, heard)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


class Player(threading.Thread):
    """Plays until `stop`. Whoever reads or changes what is played holds the lock.

    Attributes:
        error: what went wrong, None if nothing did.
    """

    def __init__(self, play: Session | Replay):
        super().__init__(name="player", daemon=True)
        self.play, self.lock = (
            play,
            threading.RLock(),
        )  # what changes a page is told of the change at once
        self.error: Exception | None = None
        self._stop_now = threading.Event()

    def run(self) -> None:
        at = time.perf_counter()
        try:
            while not self._stop_now.is_set():
                with self.lock:
                    play = self.play
                    if play.paused or play.ended:
                        play.clock.rest()
                    else:
                        play.advance(play.clock.due(time.perf_counter()))
                at = max(at + FRAME, time.perf_counter())
                self._stop_now.wait(max(at - time.perf_counter(), 0.0005))
        except Exception as error:  # shown by whoever joins
            self.error = error

    def stop(self) -> None:
        """Ends the thread; raises what it died of, if it did."""
        self._stop_now.set()
        self.join()
        if self.error is not None:
            raise self.error


@dataclass(frozen=True)
class LiveVerdict:
    """What to say of the loop now.

    Attributes:
        text: in a line. unstable: whether the arm swings out of hand.
    """

    text: str
    unstable: bool


def live_verdict(
    gain: tuple[float, float],
    limit: tuple[float, float] | None,
    onset: Outcome | None,
    swings: bool,
) -> LiveVerdict:
    """Says what the stability monitor has found, or else how far the gain is from its limit.

    Args:
        gain: K. limit: of it, in the clay at the handle; None if unknown. onset: the instability that the monitor has
            found. swings: whether the arm still swings.
    """
    far = limit or (math.inf, math.inf)
    above = [
        f"K{a} {k:.3g} > {most:.3g}" for a, k, most in zip(AXES, gain, far, strict=True) if k > most
    ]
    text = "stable"
    if onset is not None and swings:
        text = f"UNSTABLE since {onset.time:.1f} s: {onset.cause}" + (
            f" of {onset.axis}" if onset.axis else ""
        )
    elif above:
        text = "beyond the limit of K"
    elif onset is not None:
        text = f"calm again, was unstable at {onset.time:.1f} s"
    if above:
        text += f"; here {', '.join(above)}"
    elif limit:
        each = ("none" if most == math.inf else f"{most:.3g}" for most in limit)
        text += f"; limit of K here: {'none' if limit == (math.inf, math.inf) else ', '.join(each)}"
    return LiveVerdict(text, bool(onset and swings))


def live_gain_limits(b: tuple[float, float], operator: Operator | None) -> tuple[float, float]:
    """The gain limit of the linear loop on each axis, with this clay at the handle [N.s/m]; inf for none."""
    x, y = (
        gain_limit.gain_limit(axis, damping, operator)
        for axis, damping in zip(AXES, b, strict=True)
    )
    return x, y
