"""Interactive sessions: a person pulls the handle while the run goes on, in slices of a frame.

`Session` is the run, `Replay` plays a record in its place, `Player` advances either in real time,
and `live_verdict` says whether the loop is stable. Nothing here draws: the window and the page tell
the session where the hand pulls to, and a script can do the same. A slice is stepped as any run is,
by kicks.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import signal
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..errors import ParameterError, integer, number
from ..model.constants import AXES
from ..model.operator import NO_HAND, Operator
from ..model.signals import Multisine
from ..scene.scenario import Scenario
from ..simulation.engines import has_numba, load_compiled, saved_in_a_step
from ..simulation.record import Record
from ..simulation.stepwise import scaled
from ..stepping import monitor, path
from ..stepping.monitor import Outcome
from ..stepping.run import PLAIN, Kernel, Run
from ..studies.removal import TOOL, Tool, removed
from ..theory import gain_limits

FRAME_TIME = 1.0 / 60.0  # [s] between two slices
LONGEST_SLICE = 0.05  # [s]; a machine that needs longer for it slows the clock
LONGEST_SESSION = 3600.0  # [s]
PULL_MARGIN = (0.05, 0.02)  # of the point pulled to, to the folded and the stretched arm [m]
LATE_EDGES = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0)  # of a histogram [ms]
RECENT_FRAMES = 60  # over which the real-time factor is averaged
KEEPS_UP = 0.4  # of real time, that steps may take; the rest is for the picture
CALM_TIME = 1.0  # [s] without growing swings after which an unstable arm is called calm


class Pull:
    """The muscle force of a hand that pulls to a point through the spring of its impedance.

    The force is k times the position of the point. With the impedance of the hand, which the loop
    holds against p itself, this makes fh = -Th applied to p - point.

    Attributes:
        spring: k of x and y [N/m], (2,).
        force: steady force beside it [N], (2,).
        knots: (t [s], x, y [m]) of the point's path so far.
    """

    def __init__(self, spring: tuple[float, float], p: tuple[float, float]):
        """Puts the point at the handle.

        Args:
            spring: k of x and y [N/m].
            p: position of the handle [m].
        """
        self.spring, self.force = np.array(spring), (0.0, 0.0)
        self.knots = [(0.0, *p)]
        self._from, self._rate, self._since = np.array(p), np.zeros(2), 0.0

    def lead(self, t: float, to: tuple[float, float], span: float) -> None:
        """Moves the point evenly to a place.

        Args:
            t: from when on [s].
            to: the place [m].
            span: time to get there [s].
        """
        now = self.at(t)
        self._from, self._rate, self._since = now, (np.array(to) - now) / span, t
        self.knots += [(t, *now), (t + span, *to)]

    def jump(self, t: float, p: tuple[float, float], v: tuple[float, float]) -> None:
        """Lets go: the point moves with the handle.

        Args:
            t: from when on [s].
            p: position of the handle [m].
            v: velocity of the handle [m/s].
        """
        self._from, self._rate, self._since = np.array(p), np.array(v), t
        self.knots.append((t, *p))

    def at(self, t: Any) -> np.ndarray:
        """Returns the position of the point [m], shape (2,) or (n, 2).

        Args:
            t: time [s], a number or shape (n,).
        """
        return self._from + (np.asarray(t) - self._since)[..., None] * self._rate

    def steady(self) -> tuple[float, ...]:
        """The force as parts.Push.steady: since [s], (x, y) [N], its rate [N/s]."""
        (fx, fy), (px, py) = self.force, (self.spring * self._from).tolist()
        return float(self._since), fx + px, fy + py, *(self.spring * self._rate).tolist()

    def mean(self, t: Any, h: Any) -> np.ndarray:
        """Returns the mean force over [t - h, t + h] [N], as `Signal.mean`.

        Args:
            t: centre of the interval [s].
            h: half its length [s]; the force changes evenly, and h does not matter.
        """
        return np.array(self.force) + self.spring * self.at(t)


class LiveRun(Run):
    """A run that goes on slice by slice, and whose muscle, gain and clay may change in between.

    Args:
        scenario: what to run.
        every: keep each every-th sample.
        kernel: how the steps are made.

    Attributes:
        pull: the muscle.
        keeping: whether samples are kept.
        gains: (index of the first sample with it, gain), one after the other.
    """

    def __init__(self, scenario: Scenario, every: int, kernel: Kernel = PLAIN):
        super().__init__(scenario, every, kernel)
        x, y = (th or NO_HAND for th in scenario.operators)
        self.pull = Pull((x.spring, y.spring), scenario.start)
        # motion is the person's: growing motion is no instability while the gain is below its limit
        self.watch = monitor.StabilityMonitor(replace(scenario, muscle=Multisine()))
        self.keeping = True
        self.gains = [(0, scenario.gain)]

    def slice(self, steps: int) -> None:
        """Makes this many steps, unless the run ends.

        Args:
            steps: number of steps.
        """
        self.pause = min(self.i + steps, self.parts.time.last)
        self.push_evenly(self.pull.steady())
        self.go(None)
        if self.filled:
            self.flush()

    def change(self, scenario: Scenario) -> None:
        """Goes on with another gain, or with other damping between the same borders.

        Args:
            scenario: with the new gain and clay.
        """
        if scenario.gain != self.scenario.gain:
            self.gains.append((self.i, scenario.gain))
        super().change(scenario)
        self.watch.scenario = replace(scenario, muscle=Multisine())

    @property
    def held(self) -> tuple[bool, bool]:
        """Whether clay that yields holds the handle still, along x and along y."""
        reaction = self.state.clay.reaction
        if reaction is None or reaction.contact is None:
            return False, False
        x, y = reaction.contact.stuck
        return bool(x), bool(y)

    def judge(self, made: np.ndarray) -> int:
        """As Run.judge; forgets the samples while they are not to be kept.

        Args:
            made: as in Run.judge.
        """
        before = len(self.kept)
        good = super().judge(made)
        if not self.keeping:
            del self.kept[before:]
        return good

    def end(self) -> None:
        """Ends the run here, as one that reached its end."""
        self.state = path.closed(self.state)
        self.advance(self.filled + 1)
        self.flush()


class Clock:
    """Deals out simulated time as real time passes, and less of it on a machine that is too slow.

    Attributes:
        frames: number of slices dealt out.
        late: histogram of how late they came, with edges LATE_EDGES.
        slow: whether the machine is too slow now.
        real: real time that has passed [s].
        simulated: simulated time dealt out [s].
    """

    def __init__(self):
        self.frames, self.late, self.slow = 0, np.zeros(len(LATE_EDGES) - 1, dtype=int), False
        self.real = self.simulated = 0.0  # [s] in all
        self._recent: deque[tuple[float, float]] = deque(maxlen=RECENT_FRAMES)
        self._then: float | None = None
        self._owed = 0.0

    def due(self, now: float) -> float:
        """Returns the simulated time to make now [s], LONGEST_SLICE at most.

        Args:
            now: real time [s].
        """
        passed = FRAME_TIME if self._then is None else now - self._then
        self._then = now
        self._owed += passed
        due = min(self._owed, LONGEST_SLICE)
        self._owed -= due
        self.slow = self._owed > 0.5 * LONGEST_SLICE
        if self._owed > LONGEST_SLICE:  # the rest is lost
            self._owed = LONGEST_SLICE
        self.frames += 1
        self.real += passed
        self.simulated += due
        late = min(max(1e3 * (passed - FRAME_TIME), 0.0), LATE_EDGES[-1] - 1e-9)
        self.late[np.searchsorted(LATE_EDGES, late, "right") - 1] += 1
        self._recent.append((passed, due))
        return due

    def rest(self) -> None:
        """Lets time pass that is not made up for: a pause."""
        self._then, self._owed = None, 0.0

    @property
    def factor(self) -> float:
        """Simulated over real time, over the last frames."""
        real, simulated = (
            (sum(x) for x in zip(*self._recent, strict=True)) if self._recent else (1.0, 1.0)
        )
        return simulated / real


class Listener(Protocol):
    """Takes each slice of a session or a replay, as a `UdpStream` does."""

    def send(self, play: Any) -> None:
        """Takes a slice.

        Args:
            play: the session or replay that has played it.
        """


class Frame(NamedTuple):
    """State at the end of a slice, for plots that run along.

    Attributes:
        t: time [s].
        p: position of the handle [m], (2,).
        v: velocity of the handle [m/s], (2,).
        fe: force of the clay [N], (2,).
        fh: force of the hand [N], (2,).
        held: whether clay that yields holds the handle still, along x and along y.
    """

    t: float
    p: tuple[float, float]
    v: tuple[float, float]
    fe: tuple[float, float]
    fh: tuple[float, float]
    held: tuple[bool, bool] = (False, False)


class Session:
    """A person, the arm and the clay.

    Attributes:
        tool: at the handle.
        stiffness: of the hand's spring, as a multiple of Th's.
        every: samples per sample kept.
        given: scenario as it was given.
        scenario: scenario that runs, with the present gain and damping.
        run: that steps it.
        paused: whether simulated time stands still.
        recording: whether samples are kept.
        clock: of real time.
        point: that the hand pulls to [m]; None if it does not.
        frames: end of each slice so far.
        stream: that a player tells of each slice; None for none.
    """

    stream: Listener | None = None

    def __init__(
        self, scenario: Scenario, stiffness: float = 1.0, tool: Tool = TOOL, every: int = 1
    ):
        """Begins at the start of a scenario; its force, length and t_max do not count.

        Args:
            scenario: clay, gain and arm.
            stiffness: factor on the spring of Th; its damper takes the square root.
            tool: at the handle.
            every: keep each every-th sample.

        Raises:
            ParameterError: a value is out of its bounds, or the scenario is sampled or accurate.
        """
        self.tool, self.stiffness = tool, stiffness
        self.every = integer("every", every, 1, 1_000_000)
        self.start(scenario)

    def start(self, scenario: Scenario) -> None:
        """Begins a scenario: the clay whole, the record empty.

        Args:
            scenario: clay, gain and arm.
        """
        for field, value in (("control", "continuous"), ("integrator", "fast")):
            if getattr(scenario, field) != value:
                raise ParameterError(
                    field, getattr(scenario, field), f"must be {value!r} in a session"
                )
        self.given = scenario
        self.scenario = played(scenario, self.stiffness)
        self.run = LiveRun(self.scenario, self.every, live_kernel(self.scenario))
        self.paused, self.recording = False, True
        self.clock = Clock()
        self.point: tuple[float, float] | None = None
        self._damping = 1.0
        self.frames: list[Frame] = []
        self._carry = 0.0
        self._swung = -math.inf  # time of the last growing swing [s]
        self._look()

    def restart(self) -> None:
        """Begins the same scenario again, with the present gain, damping and recording switch."""
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
        """Whether anything was recorded."""
        return bool(self.run.kept)

    @property
    def b(self) -> tuple[float, float]:
        """Damping of the clay at the handle [N.s/m]."""
        return self.run.b()

    @property
    def gain(self) -> tuple[float, float]:
        """K [1/kg] at present."""
        return self.scenario.gain

    def verdict(self) -> LiveVerdict:
        """Says whether the loop is stable, by the monitor of the run and its gain limit."""
        s, onset = self.scenario, self.run.watch.onset
        limit = live_gain_limits(s, self.b) if is_viscous(s, self.frames[-1].p) else None
        return live_verdict(self.gain, limit, onset, self.t - self._swung < CALM_TIME)

    def pull(self, point: tuple[float, float] | None) -> None:
        """Makes the hand pull to a point, as far as the arm reaches.

        Args:
            point: where to [m]; None lets go.
        """
        self.point = None if point is None else self._within_reach(point)

    def push(self, force: tuple[float, float]) -> None:
        """Makes the hand press with a steady force, beside any pull.

        Args:
            force: along x and y [N].
        """
        self.run.pull.force = tuple(number("force", f, -1e3, 1e3, unit="N") for f in force)

    def change(self, gain: tuple[float, float] | None = None, b: float | None = None) -> None:
        """Changes the gain or the damping.

        Args:
            gain: K [1/kg]; None keeps it.
            b: damping, yield force and consistency of all clay as a multiple of the given
                scenario's; None keeps them.
        """
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
        """Damping, yield force and consistency of all clay as a multiple of the given ones."""
        return self._damping

    def advance(self, seconds: float) -> np.ndarray:
        """Makes a slice of simulated time; none while paused.

        Args:
            seconds: length of the slice [s].

        Returns:
            Positions of the handle before and after [m], shape (2, 2), or (0, 2) without a step.
        """
        run, dt = self.run, self.scenario.dt
        if self.paused or run.outcome:
            return np.empty((0, 2))
        steps = math.floor((seconds + self._carry) / dt + 1e-9)
        self._carry += seconds - steps * dt
        if not steps:
            return np.empty((0, 2))
        if self.point is None:
            run.pull.jump(run.t, *self._state())
        else:
            run.pull.lead(run.t, self.point, steps * dt)
        run.keeping = self.recording
        run.slice(steps)
        self._look()
        return np.array([self.frames[-2].p, self.frames[-1].p])

    def record(self) -> Record:
        """Ends the run and returns its record, with removed volume, hand's point and gain.

        Raises:
            ParameterError: nothing was recorded.
        """
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
        """As `removed`, along the true path where recording was off."""
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
        p, behind = self.run.position(), self.run.position(-self.scenario.dt)
        vx, vy = ((a - b) / self.scenario.dt for a, b in zip(p, behind, strict=True))
        return p, (vx, vy)

    def _look(self) -> None:
        watch = self.run.watch
        if watch.onset and max(map(len, watch.swings)) >= monitor.SWINGS:
            self._swung = self.t
        p, v = self._state()
        b = self.b
        hands = [th or NO_HAND for th in self.scenario.operators]
        spring, damper = np.array([(th.spring, th.damper) for th in hands]).T
        hand = self.run.pull.mean(self.t, 0.0) - spring * np.array(p) - damper * np.array(v)
        fe = b[0] * v[0], b[1] * v[1]
        if self.run.last_rendered:  # of clay that yields, at the last sample
            fe = tuple(self.run.last_rendered)
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


def live_kernel(scenario: Scenario) -> Kernel:
    """How the steps of a session are made: compiled where Python could not keep up with real time.

    Args:
        scenario: that is played.
    """
    if saved_in_a_step(scenario) < KEEPS_UP * scenario.dt or not has_numba():
        return PLAIN
    compiled = load_compiled()
    if compiled is None:
        return PLAIN
    compiled.warm(scenario)
    return compiled.KERNEL


def played(scenario: Scenario, stiffness: float = 1.0) -> Scenario:
    """Returns the scenario as a session runs it: a person as the muscle, and no end of the path.

    Args:
        scenario: clay, gain and arm.
        stiffness: factor on the spring of Th; its damper takes the square root.
    """
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


def is_viscous(scenario: Scenario, p: tuple[float, float]) -> bool:
    """Whether the clay at a place is viscous: elsewhere the linear loop's limit of K does not hold.

    Args:
        scenario: of the run.
        p: the place [m].
    """
    return scenario.clay is None or scenario.clay.viscous_at(p)


def clay_here(scenario: Scenario, p: tuple[float, float], b: tuple[float, float]) -> str:
    """What the clay at a place resists with, in a window.

    Args:
        scenario: of the run.
        p: the place [m].
        b: damping there [N.s/m].
    """
    told = scenario.clay.here(p, b) if scenario.clay else ()
    return f"{', '.join(x.text() for x in told) or 'none'} here"


class Replay:
    """A record, played as if it were a session.

    Attributes:
        source: the record.
        scenario: of the record.
        tool: at the handle, as in the session that was recorded.
        paused: whether it stands still.
        clock: of real time.
        t: time reached [s].
        n: sample reached.
        frames: states shown so far.
        stream: as of a session.
    """

    stream: Listener | None = None

    def __init__(self, record: Record, tool: Tool = TOOL):
        """Begins at the first sample.

        Args:
            record: to be played.
            tool: at the handle, if the record names none.
        """
        self.source, self.scenario = record, record.scenario
        self._held = record.held()
        self.tool = Tool(**record.notes["tool"]) if "tool" in record.notes else tool
        self.restart()

    def restart(self) -> None:
        """Begins again at the first sample."""
        self.paused, self.clock, self.t, self.n = False, Clock(), 0.0, 0
        self.frames = [self._frame(0)]

    @property
    def ended(self) -> str:
        """How the record ended, once its end is reached; empty before."""
        return self.source.status if self.n >= len(self.source.t) - 1 else ""

    def advance(self, seconds: float) -> np.ndarray:
        """Plays on; not while paused.

        Args:
            seconds: simulated time to play [s].

        Returns:
            Positions of the handle [m], shape (n, 2).
        """
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
        """K [1/kg] at present."""
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
        """As of a session; the monitor's finding is the outcome of the record."""
        r, n, s = self.source, self.n, self.scenario
        found = r.outcome.code in ("diverged", "limit cycle") and r.t[n] >= r.outcome.time
        known = s.control == "continuous" and is_viscous(s, self.frames[-1].p)
        limit = live_gain_limits(s, self.b) if known else None
        return live_verdict(self.gain, limit, r.outcome if found else None, True)

    def _frame(self, n: int) -> Frame:
        r = self.source
        p, v, fe, fh, held = (tuple(x[n].tolist()) for x in (r.p, r.v, r.fe, r.fh, self._held))
        return Frame(float(r.t[n]), p, v, fe, fh, held)


@contextlib.contextmanager
def stoppable() -> Iterator[threading.Event]:
    """Yields an event that Ctrl-C sets in place of raising; a second Ctrl-C raises."""
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
    """A thread that advances a session or a replay in real time.

    Attributes:
        play: what is played.
        lock: to be held by any other thread that reads or changes it.
        error: that ended the thread, None if none did.
    """

    def __init__(self, play: Session | Replay):
        """Does not play yet: call `start`.

        Args:
            play: what to play.
        """
        super().__init__(name="player", daemon=True)
        self.play = play
        self.lock = threading.RLock()  # a change of the page's controls calls back at once
        self.error: Exception | None = None
        self._stop_now = threading.Event()

    def run(self) -> None:
        """Plays until `stop`."""
        at = time.perf_counter()
        try:
            while not self._stop_now.is_set():
                with self.lock:
                    play = self.play
                    if play.paused or play.ended:
                        play.clock.rest()
                    else:
                        play.advance(play.clock.due(time.perf_counter()))
                        if play.stream is not None:
                            play.stream.send(play)
                at = max(at + FRAME_TIME, time.perf_counter())
                self._stop_now.wait(max(at - time.perf_counter(), 0.0005))
        except Exception as error:  # raised again by stop()
            self.error = error

    def stop(self) -> None:
        """Ends the thread; raises the error that ended it before, if any."""
        self._stop_now.set()
        self.join()
        if self.error is not None:
            raise self.error


@dataclass(frozen=True)
class LiveVerdict:
    """A verdict on the loop at present.

    Attributes:
        text: one line.
        unstable: whether the arm swings with growing amplitude.
    """

    text: str
    unstable: bool


def live_verdict(
    gain: tuple[float, float],
    limit: tuple[float, float] | None,
    onset: Outcome | None,
    swings: bool,
) -> LiveVerdict:
    """Combines the finding of the stability monitor with the gain's distance to its limit.

    Args:
        gain: K [1/kg].
        limit: of K in the clay at the handle; None if unknown.
        onset: instability that the monitor has found; None for none.
        swings: whether the arm still swings.
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


def live_gain_limits(scenario: Scenario, b: tuple[float, float]) -> tuple[float, float]:
    """Returns the gain limit of the linear loop on each axis [1/kg], inf for none.

    It is that of continuous time at the nominal pose.

    Args:
        scenario: the run.
        b: damping of the clay at the handle [N.s/m].
    """
    x, y = map(functools.partial(gain_limits.continuous_limit, scenario), AXES, b)
    return x, y
