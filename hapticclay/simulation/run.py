"""A run from start to end: it advances, stores the record and calls the monitor."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import numpy as np

from ..arguments import named
from ..errors import ParameterError
from ..kernel import arm, energy, joints, modes, mover, path, rows, scene, viscous
from ..kernel.movers import Movers
from ..kernel.row import CHUNK, Buffers, NativeRow, Row, Saved
from ..kernel.scene import NOISE_AHEAD
from ..model import hardware
from ..model.constants import AXES
from ..model.sampled_controller import Controller
from ..scene.scenario import Scenario
from . import monitor

JUDGED = (  # what a check of the monitor changes, beside the state and the samples kept
    "steps", "watch", "judged", "last", "crossings", "stops", "outcome", "end_time", "is_quiet",
)  # fmt: skip
Progress = Callable[[float, float], bool | None]
SETTLE = ("settle",)
OTHER = "must be of a simulation of the same scenario"
LEDGER = ("muscle", "motors", "clay", "hand", "through")  # fields of records.Work
# where the pairs of a sample lie, (x, y) or (shoulder, elbow): its row, then the force of the clay
COLUMNS = {"q": 0, "p": 2, "v": 4, "fh": 6, "tau": 8, "delta": 10, "b": 12, "qd": 14, "fe": 16}


@named
@dataclass(frozen=True)
class Crossing:
    """A crossing of a border by the handle.

    Attributes:
        axis: coordinate of the border, "x" or "y".
        border: where it lies [m].
        time: when it was crossed [s].
        speed: velocity along the axis [m/s].
    """

    axis: str
    border: float
    time: float
    speed: float


@dataclass(frozen=True)
class Stop:
    """An interval in which the clay held the handle still.

    Attributes:
        axis: "x" or "y" where that axis alone was held by its own law, "xy" for the handle as a
            whole.
        start: when it came to rest [s].
        end: when it moved on [s]; None if it still rested at the end of the run.
    """

    axis: str
    start: float
    end: float | None = None


class SamplesNeeded(Exception):
    """The monitor needs samples that were not kept: rerun, keeping them."""


class Workspace:
    """Engines that move the arms of successive runs, and buffers that their rows fill.

    Once `stop` is set, a run ends by CancelledError when it looks at its rows.
    """

    def __init__(self, movers: Movers | None = None, stop: threading.Event | None = None):
        self.movers, self.buffers, self.stop = movers or Movers(), Buffers(), stop


_idle: list[Workspace] = []  # workspaces that no run uses


@contextlib.contextmanager
def borrowed_workspace() -> Iterator[Workspace]:
    """A workspace for one run, new only while all others are in use."""
    try:
        found = _idle.pop()
    except IndexError:
        found = Workspace()
    yield found
    _idle.append(found)  # but not after an exception


class Snapshot(NamedTuple):
    """A run with its record, to return to; it can be pickled.

    `given` is the scenario that it began with, `kept` says what it keeps; `before` is the run at
    the last check of the monitor; `rows` and `forces` have not been judged.
    """

    given: Scenario
    kept: dict[str, Any]
    scenario: Scenario
    saved: Saved
    before: Saved
    rows: np.ndarray
    forces: np.ndarray
    extra: np.ndarray
    record: dict[str, Any]


class Kept(NamedTuple):
    """Samples that are kept: their indices, rows, and forces of the clay where it is not b v.

    And what an arm from a file adds to rows, see `joint_rows`.
    """

    indices: np.ndarray
    rows: np.ndarray
    forces: np.ndarray
    extra: np.ndarray


class Books(NamedTuple):
    """A run before a check of the monitor, to return to where the check is interrupted.

    `fields` are those of JUDGED, `kept` and `filled` the number of samples kept and of rows not
    judged; `saved` is None while the check has left the state as it was.
    """

    fields: dict[str, Any]
    kept: int
    filled: int
    saved: Saved | None


class Run:
    """One run of a scenario: makes its steps, judges them and keeps their samples.

    Ctrl-C may end a call between any two of its lines. What the call was about to do is then
    `pending`, and `mend` completes it, or returns to where it began: so neither sample, step nor
    event is lost or counted twice.

    It keeps each `every`-th sample, and the last; without `recorded` only `last`. As long as a
    quick test finds nothing, the monitor judges no row; later it may need them all, and
    SamplesNeeded is raised if they were not kept. With `keep_for_monitor` it judges all rows as
    they are made. Without `monitored` it does not judge stability. `at`: arrays in which a compiled
    row lies.

    Attributes:
        row: its row.
        given: the scenario that it began with; `scenario` has the force, gain, ... now in effect.
        pause: index of the sample to pause at.
        judged: number of samples judged so far.
        is_quiet: whether the quick test has found nothing so far.
        pending: the method that completes an interrupted call, and its arguments; empty where
            nothing is left half done.
        last: the last good row, and the force of the clay in it; None before the first check.
    """

    def __init__(
        self,
        scenario: Scenario,
        every: int,
        engine: str = "python",
        workspace: Workspace | None = None,
        at: Any = None,
        keep_for_monitor: bool = False,
        recorded: bool = True,
        monitored: bool = True,
    ):
        mover.refuse_callbacks()
        self.workspace = workspace or Workspace()
        self.buffers = self.workspace.buffers
        arms = self.workspace.movers.of(scenario), self.buffers
        self.row = NativeRow(scenario, *arms, at) if engine == "native" else Row(scenario, *arms)
        self.row.drop_events(not recorded)
        self.scenario, self.every, self.recorded = scenario, every, recorded
        self.given = scenario
        self.pending: tuple[Any, ...] = ()
        self.controller: Controller | None = None  # in place of the scenario's: it gives `torque`
        self.torque: tuple[float, ...] = ()
        self.drives = _drives(scenario)
        self._noise: hardware.SampleNoise | None = None
        self.monitored = monitored
        self.watch = _monitor(scenario, monitored)
        self.pause, self.judged = math.inf, 0
        self._steps_before = 0
        self.kept: list[Kept] = []
        self.last: np.ndarray | None = None
        self.crossings: list[Crossing] = []
        self.stops: list[Stop] = []
        self.outcome: monitor.Outcome | None = None
        self.end_time: float | None = None
        native = self.row.engine == "native"
        self.is_quiet = native and scenario.stop_when_unstable and not keep_for_monitor
        self.is_quiet = self.is_quiet and scenario.is_closed_form
        self.initial_energy = self._stored()
        self._saved = self.row.saved()
        self._ahead: list[float] | None = None

    @property
    def t(self) -> float:
        """Present time [s]."""
        return self.row.s.t

    @property
    def i(self) -> int:
        """Index of the sample at or before now."""
        return self.row.s.i

    @property
    def steps(self) -> int:
        """Number of steps made."""
        return self._steps_before + self.row.s.steps

    @steps.setter
    def steps(self, steps: int) -> None:
        self._steps_before = steps - self.row.s.steps

    @property
    def q(self) -> tuple[float, ...]:
        """Present angles of the joints [rad]."""
        return tuple(self.row.s.q[: self.row.m.joints])

    @property
    def filled(self) -> int:
        """Number of samples not judged yet."""
        return self.row.s.row

    @property
    def records_force(self) -> bool:
        """Whether the force of the clay is recorded, since it is not b v."""
        return bool(self.row.m.records_clay_force)

    @property
    def prepares(self) -> bool:
        """Whether signals are prepared before steps, or functions of the user checked after."""
        return self.drives is not None or self.row.is_called

    def sample_time(self) -> float:
        """Time of the present sample [s]; of the last good one after the end."""
        if self.end_time is not None:
            return self.end_time
        return (self.i if self.outcome is None else self.judged - 1) * self.scenario.dt

    def b(self) -> tuple[float, float]:
        """Damping of the clay in the present region, (x, y) [N.s/m]."""
        m, s = self.row.m, self.row.s
        return viscous.damping(m, s, 0, 0), viscous.damping(m, s, 1, 0)

    def position(self, h: float = 0.0) -> tuple[float, float]:
        """Handle position after the joints have turned at their present rates, (x, y) [m]."""
        s, m = self.row.s, self.row.m
        if m.general:
            q = np.array(s.q[: m.joints]) + h * np.array(s.w[: m.joints])
            x, y = self.scenario.file_arm.handle(q)[list(m.row[:2])] - np.array(m.at[:2])
            return float(x), float(y)
        return arm.place(self.row.m, s.q[0] + h * s.w[0], s.q[1] + h * s.w[1])

    # ---- interruptions

    def mend(self) -> None:
        """Completes what an interruption left half done, or returns to where it began.

        Raises:
            RuntimeError: a step itself was interrupted: there is no state to go on from.
        """
        if self.pending:
            name, *arguments = self.pending
            getattr(self, name)(*arguments)
        self.pending = ()

    def settle(self) -> None:
        """Stores what steps have left: events, the outcome, and rows that are full or the last."""
        if self.row.is_torn:
            raise RuntimeError("Ctrl-C came within a step: reset it, or restore a snapshot")
        self._take_events()
        self.note_end()
        if self.filled >= CHUNK - 1 or self.outcome is not None:
            self.flush()

    def _books(self) -> Books:
        fields = {name: getattr(self, name) for name in JUDGED} | {"watch": self.watch.copied()}
        saved = self.row.saved() if self.is_quiet else None  # the quick test counts in the state
        return Books(fields, len(self.kept), self.filled, saved)

    def _judge_again(self, books: Books) -> None:
        """Returns to before a check, and makes it."""
        if books.saved is not None:
            self.restore(books.saved)
        for name, value in books.fields.items():
            setattr(self, name, value)
        self.watch = books.fields["watch"].copied()
        del self.kept[books.kept :]
        self.row.s.row = books.filled
        self.flush()

    # ---- steps

    def go(self, progress: Progress | None) -> None:
        """Runs to the end, or until sample `pause`."""
        stop = self.workspace.stop
        while self.outcome is None and self.i < self.pause:
            self.advance(int(min(CHUNK - 1, self.pause - self.judged)))
            if self.filled >= CHUNK - 1 or self.outcome:
                if stop is not None and stop.is_set():
                    raise CancelledError
                if progress and progress(self.t, self.position()[0]) and self.outcome is None:
                    self.outcome = monitor.Outcome("interrupted", self.t, self.i)
                self.flush()
            self.pending = ()

    def advance(self, room: int = CHUNK - 1) -> None:
        """Makes steps until rows are filled, or the run is over."""
        if self.recorded and not self.filled:
            self._saved = self.row.saved()
        room, self.pending = self._prepared(room), SETTLE
        self._make(room)
        self._take_events()
        self.note_end()

    def advance_unprepared(self, n: int) -> bool:
        """Makes n steps if nothing is to be prepared or checked; returns whether it did."""
        row, s = self.row, self.row.s
        filled = s.row
        if not filled or filled + n >= CHUNK - 1 or self.prepares:
            return False
        self.draw(n)
        self._ahead, self.pending = None, SETTLE
        row.advance(filled + n)
        self._take_events()
        if s.code != path.OPEN:
            self.note_end()
            self.flush()
            return True
        self.pending = ()
        return s.row == filled + n

    def _make(self, room: int) -> None:
        self.row.advance(room)
        try:
            self.row.check()
        except Exception:  # of a function of the user: the run stays where it failed
            self.pending = ()
            raise

    def _prepared(self, room: int) -> int:
        """Prepares random effects and signals for rows to fill; returns to how many."""
        s, self._ahead = self.row.s, None
        ready = max(min(room - s.row, self.row.m.last - s.i), 0) + 1
        self.draw(ready)
        if self.drives is None:
            return room
        made = self.drives.prepare(self.row, ready)
        return room if made == ready else min(room, s.row + made)

    def draw(self, n: int) -> None:
        """Draws the random effects on the next control samples."""
        m, k = self.row.m, self.row.s.now.k
        if not m.chance:
            return
        most = n // m.ratio + 8  # and a look ahead
        if m.chance_first <= k <= m.chance_first + len(self.row.arrays["chances"]) // 4 - most:
            return
        noise, self._noise = self._noise, None  # it begins anew where this is interrupted
        if noise is None or k < noise.first:
            assert self.scenario.hardware is not None
            noise = hardware.SampleNoise(self.scenario.hardware)
        m.chance_first = scene.NEVER
        self.row.replace({"chances": noise.table(k, most + NOISE_AHEAD).ravel()})
        m.chance_first = k
        noise.forget(k)
        self._noise = noise

    def _take_events(self) -> None:
        """Stores the crossings and stops of the steps just made."""
        s, buffers = self.row.s, self.buffers
        if not (s.crossing or s.stopped):
            return
        stops = list(self.stops)
        crossings = [
            Crossing(AXES[int(axis)], *crossing)
            for axis, *crossing in buffers.crossings[: s.crossing].tolist()
        ]
        for axis, begins, t in buffers.stops[: s.stopped].tolist():
            _note_stop(stops, ("x", "y", "xy")[int(axis)], begins > 0.0, t)
        events = (len(self.crossings), crossings, stops) if self.recorded else (0, [], [])
        self.pending = "_settle_after", *events
        self._put_events(*events)
        self.pending = SETTLE

    def _settle_after(self, *events: Any) -> None:
        self._put_events(*events)
        self.settle()

    def _put_events(self, n: int, crossings: list[Crossing], stops: list[Stop]) -> None:
        """Puts crossings behind the first n, and the stops, into the record."""
        s, self.crossings[n:], self.stops = self.row.s, crossings, stops
        s.crossing = s.stopped = 0

    # ---- the end

    def note_end(self) -> None:
        """Notes the outcome of a run that is over."""
        code = self.row.s.code
        if code == path.UNRESOLVED:
            self._give_up()
        elif code == path.NOT_FINITE:
            self._end("out of reach", cause=self._cause())
        elif code != path.OPEN:
            self.end_time = self.t
            self._end("finished" if code == path.FINISHED else "time limit")

    def interrupt(self) -> None:
        """Ends the run at its last sample."""
        self.pending = ("interrupt",)
        self.outcome = monitor.Outcome("interrupted", self.t, self.i)
        self.flush()

    def _end(self, code: str, cause: str = "") -> None:
        self.outcome = self.outcome or monitor.Outcome(code, self.t, self.i, cause=cause)

    def _cause(self) -> str:
        """Why no further step is possible."""
        if self.row.caller is not None and not self.row.caller.finite():
            return "the torques of the controller are not finite"
        return "the arm is stretched or folded"

    def _give_up(self) -> None:
        """Ends the run at its last sample, because the steps after it become too short."""
        cut_short = self.row.s.checked_steps >= path.MOST_STEPS  # else divided by too many
        most = path.MOST_STEPS if cut_short else modes.SUBSTEPS
        cause = f"more than {most} steps in one sample"
        other = "fast" if self.scenario.integrator == "accurate" else "accurate"
        advice = f"change dt, or choose integrator {other!r}"
        step = max(self.judged + self.filled - 1, 0)
        at = step * self.scenario.dt
        self.outcome = monitor.Outcome("unresolved", at, step, cause=cause, advice=advice)
        self._cut_events(at)

    # ---- changes

    def take_over(self) -> None:
        """Lets a controller give `torque`, from before the first step of a sampled run on."""
        self.pending = ("take_over",)
        self.controller = Controller(lambda *measured: (self.torque, ()))
        self.row.take(self.scenario, self.controller)
        self.row.begin(self.scenario)
        self._saved, self._ahead = self.row.saved(), None
        self.pending = ()

    def change(self, scenario: Scenario) -> None:
        """Continues in another scene."""
        self.pending = "_change_back", self.row.checkpoint()
        try:
            self.row.change(scenario, self.controller)
        except Exception:  # of a scene that is refused
            self.mend()
            raise
        self._put_scenario(scenario)

    def _change_back(self, before: Any) -> None:
        """Returns to the scene before an interrupted change."""
        self.row.change_back(before)
        self._ahead = None

    def _put_scenario(self, scenario: Scenario) -> None:
        """Notes the scene in which the run continues."""
        self.pending = "_put_scenario", scenario
        self.scenario, self.watch.scenario = scenario, self.watched(scenario)
        self._ahead, self.pending = None, ()

    def watched(self, scenario: Scenario) -> Scenario:
        """The scenario as its monitor sees it."""
        return scenario

    def change_force(self, force: tuple[float, ...]) -> None:
        """Continues under another constant muscle force."""
        self._put_force(with_checked(self.scenario, force=force))

    def _put_force(self, scenario: Scenario) -> None:
        self.pending = "_put_force", scenario
        self.scenario = scenario
        self.push_steadily()
        self.pending = ()

    def change_gain(self, gain: tuple[float, float]) -> None:
        """Continues with another gain."""
        changed = with_checked(self.scenario, gain=gain)
        if scene.takes_gain(self.row.m):
            self._put_gain(changed)
        else:
            self.change(changed)

    def _put_gain(self, scenario: Scenario) -> None:
        self.pending = "_put_gain", scenario
        self.scenario = self.watch.scenario = scenario
        self.put_gain(scenario.gain)
        self.pending = ()

    def put_gain(self, gain: tuple[float, float]) -> None:
        """Continues with other numbers K, where they are all that a gain changes."""
        axis = self.row.m.axis
        axis[0].K, axis[1].K = gain
        self._ahead = None

    def push_steadily(self) -> None:
        """Continues under the constant muscle force of the scenario."""
        x, y, *more = self.scenario.steady_force
        self.push_evenly((0.0, x, y, 0.0, 0.0))
        for z in more:
            self.row.m.z.push = z

    def push_evenly(self, steady: tuple[float, ...]) -> None:
        """Continues under a muscle force that changes evenly: since [s], (x, y) [N], rate [N/s]."""
        m = self.row.m
        m.push_since, m.axis[0].push, m.axis[1].push, x_rate, y_rate = steady
        m.axis[0].push_rate, m.axis[1].push_rate = x_rate, y_rate
        self._ahead = None

    # ---- to return to

    def restore(self, saved: Saved) -> None:
        """Returns to a sample; the record is not changed."""
        self.row.restore(saved)
        self._ahead = None

    def restart(self) -> None:
        """Restarts without a record; not after `change`, or where signals are prepared ahead."""
        self.pending = ("restart",)
        self.restore(self._saved)
        self.steps = self.judged = 0
        self.watch = _monitor(self.scenario, self.monitored)
        self.outcome = self.end_time = self.last = None
        self.pending = ()

    def snapshot(self) -> Snapshot:
        """The run with its record, to return to."""
        n, buffers = self.filled, self.buffers
        made = buffers.rows[:n].copy(), buffers.rendered[:n].copy(), self.extra(n).copy()
        states = self.row.saved(), self._saved
        return Snapshot(self.given, self.kind, self.scenario, *states, *made, self._record())

    @property
    def kind(self) -> dict[str, Any]:
        """What a run must have in common with one whose snapshot it returns to."""
        kept = {name: getattr(self, name) for name in ("every", "recorded", "monitored")}
        return kept | {"torque": self.controller is not None}

    def _record(self) -> dict[str, Any]:
        """What a snapshot keeps of the record, which the run goes on changing."""
        fields = {name: getattr(self, name) for name in (*JUDGED, "initial_energy", "torque")}
        fields |= {name: list(getattr(self, name)) for name in ("kept", "crossings", "stops")}
        return fields | {"watch": self.watch.copied()}

    def return_to(self, x: Snapshot) -> None:
        """Returns to a snapshot.

        Raises:
            ParameterError: it is of another scenario, or was kept otherwise.
        """
        check_same_run(self, x)
        self.pending = "return_to", x
        if x.scenario != self.scenario:
            self.scenario = x.scenario
            self.row.take(x.scenario, self.controller)
        self.restore(x.saved)
        self._saved = x.before
        self.buffers.rows[: len(x.rows)] = x.rows
        self.buffers.rendered[: len(x.forces)] = x.forces
        self.buffers.extra[: len(x.extra)] = x.extra
        for name, value in x.record.items():
            setattr(self, name, list(value) if isinstance(value, list) else value)
        self.watch = x.record["watch"].copied()
        self.pending = ()

    # ---- the present sample

    def ahead(self) -> np.ndarray:
        """The row that a step would write now, and the force of the clay in it [N]."""
        self._prepared(self.filled + 1)
        self.pending = SETTLE
        found = self.row.peek()
        self.row.check()
        self.pending = ()
        return found

    def numbers_ahead(self) -> list[float]:
        """As `ahead`; the last good row if the run has ended, NaN for none."""
        if self.outcome is not None:
            return self.ending().tolist()
        found = self._ahead
        if found is None:
            found = self._ahead = self.ahead().tolist()
        return list(found)

    def ending(self) -> np.ndarray:
        """The last good row, and the force of the clay in it; NaN for none."""
        more = joints.width(self.row.m) if self.row.m.general else 0
        return np.full(rows.ROW + 2 + more, np.nan) if self.last is None else self.last

    def _force(self, b: Any, v: Any) -> tuple[Any, Any]:
        """Force of the clay's damping, (x, y) [N]."""
        return viscous.force(self.row.m, *b, *v)

    def torque_reached(self, n: int, k: int) -> np.ndarray:
        """|tau| of shoulder and elbow that at least k of the last n rows not judged reach [N.m]."""
        first = max(self.filled - n, 0)
        made, m = self.buffers.rows[first : self.filled, 8:10], self.row.m
        if m.general:
            made = self.extra(self.filled)[first:, 2 * m.joints : 3 * m.joints]
        return np.sort(np.abs(made), axis=0)[-k] if len(made) >= k else np.zeros(m.joints)

    def extra(self, n: int) -> np.ndarray:
        """What an arm from a file adds to the first n rows since the last check."""
        return self.buffers.extra[: n if self.row.m.general else 0]

    def _for_monitor(self, made: np.ndarray, extra: np.ndarray) -> np.ndarray:
        """Rows as the monitor takes them, shape (12, n), or joint positions, rates and torques."""
        return np.ascontiguousarray((extra if self.row.m.general else made[:, :12]).T)

    def strained(self, n: int, limits: Sequence[float]) -> list[int]:
        """How many of the last n rows not judged have |tau| of each motor at its limit or above."""
        return self.row.strained(n, limits)

    def is_diverging(self) -> bool:
        """Whether the monitor would find the run unstable by now."""
        watch, n = self.watch.copied(), self.filled
        _, found = (
            watch.look(self._for_monitor(self.buffers.rows[:n], self.extra(n)), self.judged)
            if n
            else (0, None)
        )
        return found is not None or watch.onset is not None

    # ---- the record

    def flush(self) -> None:
        """Judges the rows since the last check."""
        n, books = self.filled, self._books()
        self.pending = "_judge_again", books
        self.row.s.row = 0
        good = self.judge(self.buffers.rows[:n])
        if self.recorded and self.outcome is not None and self.end_time is None and good < n:
            self.pending = "_judge_again", books._replace(saved=self.row.saved())
            self._repeat(good)
        self.pending = ()

    def _repeat(self, good: int) -> None:
        """Makes the good rows since the last check again: the ledger ends with them."""
        steps, s = self.steps, self.row.s
        self.restore(self._saved)
        while self.filled < good:  # in parts, where borders are many
            room = self._prepared(good)
            self._make(room)
            s.crossing = s.stopped = 0  # they are known
        s.row = 0
        self.steps = steps

    def judge(self, made: np.ndarray) -> int:
        """Adds samples to the record, up to the end of the good part of the run."""
        good, found = self._look(made)
        if found is not None:
            self.outcome, self.end_time = found, None
            self._cut_events(found.time)
        elif self.outcome is not None:
            if self.outcome.code == "interrupted":  # anywhere: the record ends with its last sample
                step = self.judged + good - 1
                self.outcome = replace(self.outcome, time=step * self.scenario.dt, step=step)
                self._cut_events(self.outcome.time)
            self.outcome = self.watch.end(self.outcome)
        if good:
            self._keep(made, good)
        self.judged += good
        return good

    def _look(self, made: np.ndarray) -> tuple[int, monitor.Outcome | None]:
        """Judges the next rows, as StabilityMonitor.look."""
        if self.is_quiet and self.row.is_quiet(0, len(made)):
            if self.outcome is not None:
                w = self.watch
                w.seen, w.moved, w.unbound, w.often = list(self.row.s.watch.seen)
            return len(made), None
        if self.is_quiet:
            if self.judged and self.every != 1:
                raise SamplesNeeded
            self.is_quiet = False
            for x in self.kept:
                self.watch.look(self._for_monitor(x.rows, x.extra), int(x.indices[0]))
        return self.watch.look(self._for_monitor(made, self.extra(len(made))), self.judged)

    def _keep(self, made: np.ndarray, good: int) -> None:
        """Keeps good rows."""
        forces, end = self.buffers.rendered, made[good - 1]
        force: Any = (
            forces[good - 1, :2] if self.records_force else self._force(end[12:14], end[4:6])
        )
        extra = self.extra(len(made))
        self.last = np.concatenate((end, force, extra[good - 1] if len(extra) else ()))
        if not self.recorded:
            return
        keep = np.arange(-self.judged % self.every, good, self.every)
        if self.outcome is not None and (not len(keep) or keep[-1] != good - 1):
            keep = np.append(keep, good - 1)
        row = made.copy() if len(keep) == len(made) else made[keep]
        force = forces[keep] if self.records_force else forces[:0]
        more = extra[keep] if len(extra) else np.zeros((len(keep), 0))
        self.kept.append(Kept(self.judged + keep, row, force, more))

    def _cut_events(self, t: float) -> None:
        """Removes events after the end of the record."""
        self.crossings = [c for c in self.crossings if c.time <= t]
        self.stops = [
            replace(x, end=None) if x.end is not None and x.end > t else x
            for x in self.stops
            if x.start <= t
        ]

    def arrays(self) -> dict[str, np.ndarray]:
        """The samples kept, by the names of Record's arrays."""
        more = joints.width(self.row.m) if self.row.m.general else 0
        nothing = Kept(np.zeros(0, int), *(np.zeros((0, n)) for n in (rows.ROW, 3, more)))
        indices, made, forces, extra = zip(*(self.kept or [nothing]), strict=True)
        t = np.concatenate(indices) * self.scenario.dt
        if self.end_time is not None and len(t):
            t[-1] = self.end_time
        out = {
            name: np.concatenate([x[:, j : j + 2] for x in made])
            for name, j in COLUMNS.items()
            if name != "fe"
        }
        if self.records_force:
            force = np.concatenate(forces)
            out |= {"removed": force[:, 2]} if self.row.m.groove else {}
            out["fe"] = force[:, :2]
        else:
            out["fe"] = np.column_stack(self._force(out["b"].T, out["v"].T))
        if self.row.m.general:
            out |= joint_arrays(self.row.m, out, np.concatenate(extra))
        return out | {"t": t}

    def left_ground(self) -> np.ndarray | None:
        """As Record.ground."""
        x = self.row.arrays
        return x["relief"] * x["ground"] if self.row.m.groove else None

    def _stored(self) -> tuple[float, float]:
        """Energy of the arm, and that stored in the operator's arm, after the last kick [J].

        Energy of an arm from a file includes that of its weight and springs.
        """
        m, s = self.row.m, self.row.s
        if m.general:
            from .joint_energy import stored  # imported only for an arm from a file

            return stored(self.scenario, m, s)
        return energy.kinetic(m, s), energy.of_hand(m, s)

    def balance(self) -> dict[str, float]:
        """The energy balance, as Record.energy; friction is not part of the motors' share."""
        m, s, w, last = self.row.m, self.row.s, self.row.s.work, self._stored()
        work = [getattr(w, name) for name in LEDGER]
        out = balance(work, self.initial_energy if self.judged else last, last)
        parts = {
            "springs_stored": (s.springs_stored, m.springs),
            "springs_dissipated": (s.springs_dissipated, m.springs),
            "friction": (w.friction, m.friction),
            "passivity_controller": (w.guard, m.guard),
            "coupling": (w.coupling, m.coupling),
            "rendered_clay": (w.rendered, m.renders),
            "joint_dampers": (w.joints, m.general),
        }
        out |= {name: float(x) for name, (x, is_there) in parts.items() if is_there}
        out["residual"] -= out.get("friction", 0.0) + out.get("joint_dampers", 0.0)
        if m.general:  # it starts at rest; its weight has no zero of energy
            out["throughput"] = float(w.through)
        return out


def check_same_run(run: Run, x: Snapshot) -> None:
    """Refuses a snapshot of another scenario than that of a run, but for what `set` can change."""
    for field in fields(Scenario):
        now, then = getattr(run.given, field.name), getattr(x.given, field.name)
        if field.name == "operator":
            now, then = any(run.given.operators), any(x.given.operators)
        if field.name not in ("name", "force", "gain") and now is not then and now != then:
            raise ParameterError("snapshot", x, f"{OTHER}: {field.name} differs")
    for name, now in run.kind.items():
        if x.kept[name] != now:
            raise ParameterError("snapshot", x, f"{OTHER}: {name} is {x.kept[name]!r}, not {now!r}")
    sizes = _sizes(run.row.saved())
    if any(_sizes(y) != sizes for y in (x.saved, x.before)) or len(x.rows) >= CHUNK:
        raise ParameterError("snapshot", x, "must be as it was taken, by this release")


def _sizes(saved: Saved) -> list[int]:
    return [len(x) for x in (saved.state, *saved.arrays)]


def _note_stop(stops: list[Stop], axis: str, begins: bool, t: float) -> None:
    """Adds a stop that begins, or the end of the newest one of an axis."""
    if begins:
        stops.append(Stop(axis, t))
        return
    for i in reversed(range(len(stops))):
        if stops[i].axis == axis:
            stops[i] = replace(stops[i], end=t)
            break


def balance(work: Sequence[Any], first: Sequence[Any], last: Sequence[Any]) -> dict[str, Any]:
    """muscle + motors = clay + hand_damper + kinetic + hand_stored + residual [J].

    Floats, or arrays over runs.
    """
    muscle, motors, clay, damper, through = work
    kinetic, at_hand = last[0] - first[0], last[1] - first[1]
    return {
        "muscle": muscle,
        "motors": motors,
        "clay": clay,
        "hand_damper": damper,
        "kinetic": kinetic,
        "hand_stored": at_hand,
        "residual": muscle + motors - clay - damper - kinetic - at_hand,
        "throughput": through + first[0] + first[1],
    }


def joint_arrays(m: Any, pairs: dict[str, np.ndarray], extra: np.ndarray) -> dict[str, np.ndarray]:
    """Arrays of an arm from a file: of its joints, and along z where its handle moves there.

    pairs: those of x and y; extra: what such an arm adds to rows.
    """
    n = m.joints
    out = {"q": extra[:, :n], "qd": extra[:, n : 2 * n], "tau": extra[:, 2 * n : 3 * n]}
    if m.axes > 2:
        z = {name: extra[:, 3 * n + i] for i, name in enumerate(("p", "v", "fh"))}
        nothing = np.zeros(len(extra))
        for name in ("p", "v", "fh", "fe", "b", "delta"):
            out[name] = np.column_stack((pairs[name], z.get(name, nothing)))
    return out


def with_checked(scenario: Scenario, **fields: Any) -> Scenario:
    """A scenario with other fields, whose values have been checked, as has all else."""
    made = object.__new__(type(scenario))
    made.__dict__.update(scenario.__dict__, **fields)
    return made


def _drives(scenario: Scenario) -> Any:
    """The signals of a run; None where none varies."""
    if not scenario.driven:
        return None
    from ..kernel.signal_ahead import Drives  # imported only if a signal varies

    return Drives(scenario)


def _monitor(scenario: Scenario, monitored: bool) -> Any:
    """What judges a run."""
    if scenario.is_closed_form:
        judge = monitor.StabilityMonitor if monitored else monitor.RangeMonitor
        return judge(scenario)
    from .joint_monitor import JointMonitor  # imported only for an arm from a file

    return JointMonitor(scenario, monitored)


def completed(
    scenario: Scenario,
    every: int,
    engine: str,
    workspace: Workspace,
    progress: Progress | None = None,
) -> tuple[Run, float]:
    """Makes a run, and the time that it took [s]; repeats it if the monitor needs all samples."""
    keep = every > 1 and progress is not None  # progress must not start again
    while True:
        run = Run(scenario, every, engine, workspace, keep_for_monitor=keep)
        begin = time.perf_counter()
        try:
            run.go(progress)
            return run, time.perf_counter() - begin
        except SamplesNeeded:
            keep = True
