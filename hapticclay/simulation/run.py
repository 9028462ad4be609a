"""A run from start to end: it advances, stores the record and calls the monitor."""

from __future__ import annotations

import contextlib
import copy
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..arguments import named
from ..kernel import arm, energy, modes, mover, path, rows, scene, viscous
from ..kernel.row import CHUNK, Buffers, NativeRow, Row, Saved
from ..kernel.scene import NOISE_AHEAD
from ..model import hardware
from ..model.constants import AXES
from ..model.sampled_controller import Controller
from ..scene.scenario import Scenario
from . import monitor

RECORDED = (  # of a run
    "steps", "watch", "looked", "kept", "rendered_kept", "last_rendered", "crossings", "stops",
    "outcome", "end_time", "calm", "first",
)  # fmt: skip
ROWS = {"python": Row, "native": NativeRow}


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


class NeedsMonitor(Exception):
    """A run without samples that is to be repeated with them, for the monitor."""


class Place:
    """Where successive runs are made: the engines that move their arms, and what they fill.

    Args:
        movers: the engines; its own if None.
    """

    def __init__(self, movers: mover.Movers | None = None):
        self.movers, self.buffers = movers or mover.Movers(), Buffers()


_idle: list[Place] = []  # places that no run uses


@contextlib.contextmanager
def borrowed_place() -> Iterator[Place]:
    """A place for one run, made new only while others are in use."""
    try:
        place = _idle.pop()
    except IndexError:
        place = Place()
    yield place
    _idle.append(place)  # but not after an exception


class Snapshot(NamedTuple):
    """A run with its record, to return to; it can be pickled.

    Attributes:
        scenario: of the run.
        saved: the run, Saved.
        before: the run at the last check of the monitor, Saved.
        rows: not judged yet.
        rendered: force of the clay in them [N].
        record: what the run keeps of those judged.
    """

    scenario: Scenario
    saved: Any
    before: Any
    rows: np.ndarray
    rendered: np.ndarray
    record: dict[str, Any]


class Run:
    """One run of a scenario; this class makes its steps and keeps their results.

    Args:
        scenario: what to run.
        every: keep each every-th sample, and the last.
        engine: who makes the steps, "python" or "native".
        place: where it is made; a place of its own if None.
        **kept: how it is made, and what is kept; of these
        brief: keep no samples, for `brief` alone.
        watched: let the monitor check all rows; else NeedsMonitor is raised where it must check
            rows that are not kept.
        recorded: whether judged rows are kept; else only the rows since then and, after the end,
            `last_row`.
        monitored: whether its stability is judged.
        at: arrays in which a compiled row lies; its own if None.

    Raises:
        ParameterError: a control callback is installed in the engine, which would interfere.

    Attributes:
        row: its row.
        pause: index of the sample to pause at.
    """

    def __init__(
        self,
        scenario: Scenario,
        every: int,
        engine: str = "python",
        place: Place | None = None,
        **kept: Any,
    ):
        mover.refuse_callbacks()
        self.place = place or Place()
        at = kept.pop("at", None)
        arms = self.place.movers.of(scenario), self.place.buffers
        self.row: Row = ROWS[engine](scenario, *arms, **({"at": at} if at else {}))
        self._begin(scenario, every, **kept)

    def _begin(
        self,
        scenario: Scenario,
        every: int,
        brief: bool = False,
        watched: bool = False,
        recorded: bool = True,
        monitored: bool = True,
    ) -> None:
        """Begins the record of a row that is at its start."""
        self.scenario, self.every = scenario, every
        self._controller: Controller | None = None  # in place of the scenario's
        self.drives = _drives(scenario)
        self._noise: hardware.SampleNoise | None = None
        self.steps, self.pause = 0, math.inf
        judge = monitor.StabilityMonitor if monitored else monitor.RangeMonitor
        self.watch = judge(scenario)
        self.looked = 0  # samples judged so far
        self.kept: list[tuple[np.ndarray, np.ndarray]] = []  # index, rows
        self.rendered_kept: list[np.ndarray] = []
        self.last_rendered: Any = None
        self.crossings: list[Crossing] = []
        self.stops: list[Stop] = []
        self.outcome: monitor.Outcome | None = None
        self.end_time: float | None = None
        self.without_samples, self.recorded = brief, recorded
        self.last_row: Any = None
        # nothing to report so far; later the monitor may need all rows again
        native = self.row.engine == "native"
        self.calm = native and scenario.stop_when_unstable and not watched
        self.first = self._stored()
        self._saved = self.row.saved()
        self._shown: list[float] | None = None

    @property
    def t(self) -> float:
        """Present time [s]."""
        return self.row.s.t

    @property
    def i(self) -> int:
        """Index of the sample at or before now."""
        return self.row.s.i

    @property
    def q(self) -> tuple[float, float]:
        """Present angles of shoulder and elbow [rad]."""
        return self.row.s.q1, self.row.s.q2

    @property
    def filled(self) -> int:
        """Number of samples not judged yet."""
        return self.row.s.row

    @property
    def rendered(self) -> bool:
        """Whether the force of the clay is recorded, because b v does not give it."""
        return bool(self.row.m.records_clay_force)

    def sample_time(self) -> float:
        """Time of the present sample [s]; of the last good one after the end."""
        if self.end_time is not None:
            return self.end_time
        return (self.i if self.outcome is None else self.looked - 1) * self.scenario.dt

    def b(self) -> tuple[float, float]:
        """Damping of the clay in the present region, (x, y) [N.s/m]."""
        m, s = self.row.m, self.row.s
        return viscous.damping(m, s, 0, 0), viscous.damping(m, s, 1, 0)

    # ---- steps

    def advance(self, room: int = CHUNK - 1) -> None:
        """Makes steps until rows are filled, or the run is over."""
        if self.recorded and not self.filled and not (self.without_samples and self.looked):
            self._saved = self.row.saved()  # of what has been judged
        self._make(room)
        self.note_end()

    def note_end(self) -> None:
        """Notes the outcome of a run that is over."""
        code = self.row.s.code
        if code == path.UNRESOLVED:
            self.give_up()
        elif code == path.NOT_FINITE:
            self._end(monitor.Outcome("out of reach", self.t, self.i, cause=self._cause()))
        elif code != path.OPEN:
            self.finish("finished" if code == path.FINISHED else "time limit")

    def _cause(self) -> str:
        """Why no further step is possible."""
        if self.row.caller is not None and not self.row.caller.finite():
            return "the torques of the controller are not finite"
        return "the arm is stretched or folded"

    def _make(self, room: int) -> None:
        self.row.advance(self._prepared(room))
        self.row.check()
        self._count()

    def _prepared(self, room: int) -> int:
        """Prepares random effects and signals for rows to fill; returns to how many."""
        s, self._shown = self.row.s, None
        ready = max(min(room - s.row, self.row.m.last - s.i), 0) + 1
        self.draw(ready)
        if self.drives is None:
            return room
        made = self.drives.prepare(self.row, ready)
        return room if made == ready else min(room, s.row + made)

    def _count(self) -> None:
        """Counts the steps just made, and stores their crossings and stops."""
        s = self.row.s
        if self.recorded and (s.crossing or s.stopped):
            self._note_events(s.crossing, s.stopped)
        self.steps += s.steps
        s.steps = s.crossing = s.stopped = 0

    def draw(self, n: int) -> None:
        """Draws the random effects on the next control samples."""
        m, k = self.row.m, self.row.s.now.k
        if not m.chance:
            return
        most = n // m.ratio + 8  # and a look ahead
        if m.chance_first <= k <= m.chance_first + len(self.row.arrays["chances"]) // 4 - most:
            return
        if self._noise is None or k < self._noise.first:
            assert self.scenario.hardware is not None
            self._noise = hardware.SampleNoise(self.scenario.hardware)
        self.row.replace({"chances": self._noise.table(k, most + NOISE_AHEAD).ravel()})
        m.chance_first = k
        self._noise.forget(k)

    def take_over(self, controller: Controller) -> None:
        """Lets the user's own controller act, before the first step of a sampled run."""
        self._controller = controller
        self.row.take(self.scenario, controller)
        self.row.begin(self.scenario)
        self._saved, self._shown = self.row.saved(), None

    def _note_events(self, crossings: int, stops: int) -> None:
        """Stores the crossings and stops of the steps just made."""
        for axis, *crossing in self.place.buffers.crossings[:crossings].tolist():
            self.crossings.append(Crossing(AXES[int(axis)], *crossing))
        for axis, begins, t in self.place.buffers.stops[:stops].tolist():
            self._note_stop(("x", "y", "xy")[int(axis)], begins > 0.0, t)

    def _note_stop(self, axis: str, begins: bool, t: float) -> None:
        if begins:
            self.stops.append(Stop(axis, t))
            return
        for i in reversed(range(len(self.stops))):
            if self.stops[i].axis == axis:
                self.stops[i] = replace(self.stops[i], end=t)
                break

    def restore(self, saved: Saved) -> None:
        """Returns to a sample; the record is not changed."""
        self.row.restore(saved)
        self._shown = None

    def restart(self) -> None:
        """Restarts without a record; not after `change`, or where signals are prepared ahead."""
        self.restore(self._saved)
        self.steps = self.looked = 0
        self.watch = type(self.watch)(self.scenario)
        self.outcome, self.end_time = None, None
        self.last_row = self.last_rendered = None

    def snapshot(self) -> Snapshot:
        """The run with its record, to return to."""
        n, buffers = self.filled, self.place.buffers
        kept = copy.deepcopy({name: getattr(self, name) for name in RECORDED})
        rendered = buffers.rendered[:n].copy()
        saved = self.row.saved()
        return Snapshot(self.scenario, saved, self._saved, buffers.rows[:n].copy(), rendered, kept)

    def return_to(self, x: Snapshot) -> None:
        """Returns to a snapshot."""
        if x.scenario != self.scenario:
            self.scenario = x.scenario
            self.row.take(x.scenario, self._controller)
        self.restore(x.saved)
        self._saved, n, buffers = x.before, len(x.rows), self.place.buffers
        buffers.rows[:n], buffers.rendered[: len(x.rendered)] = x.rows, x.rendered
        for name, value in copy.deepcopy(x.record).items():
            setattr(self, name, value)

    def change(self, scenario: Scenario) -> None:
        """Continues in another scene."""
        self.scenario = self.watch.scenario = scenario
        self.row.change(scenario, self._controller)
        self._shown = None

    def go(self, progress: Callable[[float, float], bool | None] | None) -> None:
        """Runs to the end, or until sample `pause`."""
        while self.outcome is None and self.i < self.pause:
            self.advance(int(min(CHUNK - 1, self.pause - self.looked)))
            if self.filled >= CHUNK - 1 or self.outcome:
                if progress and progress(self.t, self.position()[0]) and self.outcome is None:
                    self.outcome = monitor.Outcome("interrupted", self.t, self.i)
                self.flush()

    def hop(self, n: int) -> bool:
        """Makes steps where there is nothing to prepare, nor a check among them."""
        row, s = self.row, self.row.s
        filled = s.row
        if not filled or filled + n >= CHUNK - 1 or self._prepares:
            return False
        self.draw(n)
        row.advance(filled + n)
        self._shown = None
        self._count()
        if s.code != path.OPEN:
            self.note_end()
            self.flush()
            return True
        return s.row == filled + n

    @property
    def _prepares(self) -> bool:
        """Whether something but chance is to be prepared before steps, or looked at after them."""
        return self.drives is not None or self.row.is_called

    def interrupt(self) -> None:
        """Ends the run at its last sample."""
        self.outcome = monitor.Outcome("interrupted", self.t, self.i)
        self.flush()

    def change_force(self, force: tuple[float, float]) -> None:
        """Continues under another constant muscle force."""
        self.scenario = with_checked(self.scenario, force=force)
        self.push_evenly((0.0, *self.scenario.steady_force, 0.0, 0.0))

    def change_gain(self, gain: tuple[float, float]) -> None:
        """Continues with another gain."""
        changed = with_checked(self.scenario, gain=gain)
        if scene.takes_gain(self.row.m):
            self.scenario = self.watch.scenario = changed
            for a, K in zip(self.row.m.axis, gain, strict=True):
                a.K = float(K)
            self._shown = None
        else:
            self.change(changed)

    def push_evenly(self, steady: tuple[float, ...]) -> None:
        """Continues under a muscle force that changes evenly."""
        m = self.row.m
        m.push_since, x, y, x_rate, y_rate = steady
        m.axis[0].push, m.axis[1].push = x, y
        m.axis[0].push_rate, m.axis[1].push_rate = x_rate, y_rate
        self._shown = None

    def position(self, h: float = 0.0) -> tuple[float, float]:
        """Handle position after the joints have turned at their present rates, (x, y) [m]."""
        s = self.row.s
        return arm.place(self.row.m, s.q1 + h * s.w1, s.q2 + h * s.w2)

    def finish(self, code: str) -> None:
        """Ends the run now."""
        self.end_time = self.t
        self._end(monitor.Outcome(code, self.t, self.i))

    def _end(self, outcome: monitor.Outcome) -> None:
        self.outcome = self.outcome or outcome

    def give_up(self) -> None:
        """Ends the run at its last sample, because the steps after it become too short."""
        cut_short = self.row.s.checked_steps >= path.MOST_STEPS  # else divided by too many
        most = path.MOST_STEPS if cut_short else modes.SUBSTEPS
        cause = f"more than {most} steps in one sample"
        other = "fast" if self.scenario.integrator == "accurate" else "accurate"
        advice = f"change dt, or choose integrator {other!r}"
        step = max(self.looked + self.filled - 1, 0)
        at = step * self.scenario.dt
        self.outcome = monitor.Outcome("unresolved", at, step, cause=cause, advice=advice)
        self._cut_events(at)

    def ahead(self) -> np.ndarray:
        """The row that a step would write now, and the force of the clay in it [N]."""
        self._prepared(self.filled + 1)
        found = self.row.peek()
        self.row.check()
        return self._with_force(found)

    def numbers_ahead(self) -> list[float]:
        """As `ahead`; the numbers of the last row if the run has ended."""
        if self.outcome is not None:
            none = [math.nan] * (rows.ROW + 2)
            return none if self.last_row is None else [*self.last_row, *self.last_force()]
        if self._shown is None:
            self._shown = self.ahead().tolist()
        assert self._shown is not None
        return list(self._shown)

    def torque_reached(self, n: int, k: int) -> list[float]:
        """As `torque_reached`, in the last rows of those not judged yet."""
        end = self.filled
        return torque_reached(self.place.buffers.rows[max(end - n, 0) : end], k).tolist()

    def _with_force(self, row: np.ndarray) -> np.ndarray:
        """A row with the force of the clay appended; already there if b v does not give it."""
        if not self.rendered:
            vx, vy, bx, by = *row[4:6].tolist(), *row[12:14].tolist()
            row[rows.ROW], row[rows.ROW + 1] = self._force(bx, by, vx, vy)
        return row

    def is_diverging(self) -> bool:
        """Whether the monitor would find the run unstable by now."""
        watch, n = copy.deepcopy(self.watch), self.filled
        made = _columns(self.place.buffers.rows[:n])
        _, found = watch.look(made, self.looked) if n else (0, None)
        return found is not None or watch.onset is not None

    # ---- the record

    def flush(self) -> None:
        """Judges the rows since the last check."""
        n, buffers = self.filled, self.place.buffers
        self.row.s.row = 0
        if n and self.rendered and self.recorded:
            self.last_rendered = buffers.rendered[n - 1, :2].tolist()
        if self.without_samples and n and self._still_calm(n):
            if self.outcome is not None:
                self.outcome = self.watch.end(self.outcome)
                self.last_row = buffers.rows[n - 1].tolist()
            self.looked += n
            return
        if self.without_samples and self.looked:
            raise NeedsMonitor
        if self.without_samples:  # the monitor can have all rows so far
            self.without_samples = self.calm = False
        good = self.judge(buffers.rows[:n])
        if not self.recorded:
            self._keep_last(good)
        elif self.outcome is not None and self.end_time is None and good < n:
            self._repeat(good)

    def _repeat(self, good: int) -> None:
        """Makes the good rows since the last check again: the ledger ends with them."""
        made, crossings, stops = self.steps, list(self.crossings), list(self.stops)
        self.restore(self._saved)
        while self.filled < good:  # in parts, where borders are many
            self._make(good)
        self.row.s.row = 0
        self.steps, self.crossings, self.stops = made, crossings, stops

    def _keep_last(self, good: int) -> None:
        """Stores the last good row since the last check."""
        if good:
            self.last_row = self.place.buffers.rows[good - 1].tolist()
            if self.rendered:
                self.last_rendered = self.place.buffers.rendered[good - 1, :2].tolist()

    def look(self, made: np.ndarray) -> tuple[int, monitor.Outcome | None]:
        """Judges the next rows, as StabilityMonitor.look."""
        if self.calm:
            if self._still_calm(len(made)):
                return len(made), None
            if self.looked and self.every != 1:
                raise NeedsMonitor
            self.calm = False
            for index, earlier in self.kept:
                self.watch.look(_columns(earlier), int(index[0]))
        return self.watch.look(_columns(made), self.looked)

    def _still_calm(self, n: int) -> bool:
        """Whether n more rows give the monitor nothing to report; at the end it gets the counts."""
        watch = self.watch
        if self.row.engine != "native" or not self.row.is_quiet(0, n):
            return False
        if self.outcome is not None:
            watch.seen, watch.moved, watch.unbound, watch.often = list(self.row.s.watch.seen)
        return True

    def judge(self, made: np.ndarray) -> int:
        """Adds samples to the record, up to the end of the good part of the run."""
        good, found = self.look(made)
        if found is not None:
            self.outcome, self.end_time = found, None
            self._cut_events(found.time)
        elif self.outcome is not None:
            if self.outcome.code == "interrupted":  # anywhere: the record ends with its last sample
                step = self.looked + good - 1
                self.outcome = replace(self.outcome, time=step * self.scenario.dt, step=step)
                self._cut_events(self.outcome.time)
            self.outcome = self.watch.end(self.outcome)
        if good and self.recorded:
            keep = np.arange(-self.looked % self.every, good, self.every)
            if self.outcome is not None and (not len(keep) or keep[-1] != good - 1):
                keep = np.append(keep, good - 1)
            everything = len(keep) == len(made)
            self.kept.append((self.looked + keep, made.copy() if everything else made[keep]))
            if self.rendered:
                self.rendered_kept.append(self.place.buffers.rendered[keep])
        self.looked += good
        return good

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
        t = np.concatenate([index for index, _ in self.kept]) * self.scenario.dt
        if self.end_time is not None and len(t):
            t[-1] = self.end_time
        out = {"t": t} | self._columns([x for _, x in self.kept])
        if self.rendered_kept:
            kept = np.concatenate(self.rendered_kept)
            out["fe"] = kept[:, :2]
            if self.row.m.groove:
                out["removed"] = kept[:, 2]
        return out

    def left_ground(self) -> np.ndarray | None:
        """As Record.ground."""
        x = self.row.arrays
        return x["relief"] * x["ground"] if self.row.m.groove else None

    def _columns(self, parts: list[np.ndarray]) -> dict[str, np.ndarray]:
        columns = (np.concatenate([x[:, j : j + 2] for x in parts]) for j in range(0, rows.ROW, 2))
        q, p, v, fh, tau, delta, b, qd = columns
        fe = np.column_stack(self._force(*b.T, *v.T))
        return dict(p=p, v=v, fh=fh, fe=fe, b=b, q=q, qd=qd, tau=tau, delta=delta)

    def _force(self, bx: Any, by: Any, vx: Any, vy: Any) -> tuple[Any, Any]:
        """Force of the clay's damping, (x, y) [N]."""
        return viscous.force(self.row.m, bx, by, vx, vy)

    def brief(self) -> tuple[Any, ...]:
        """The end of the run: outcome, steps, crossings, the last p, v, fh, fe and b, energy."""
        if self.without_samples:
            px, py, vx, vy, fx, fy, _, _, _, _, bx, by = self.last_row[2:14]
            force = self.last_rendered or self._force(bx, by, vx, vy)
            last: Any = [(px, py), (vx, vy), (fx, fy), force, (bx, by)]
            return self.outcome, self.steps, tuple(self.crossings), last, self.balance()
        arrays = self.arrays()
        final = (arrays[name] for name in ("p", "v", "fh", "fe", "b"))
        last = [x[-1] if len(x) else (np.nan, np.nan) for x in final]
        return self.outcome, self.steps, tuple(self.crossings), last, self.balance()

    def last_force(self) -> tuple[float, float]:
        """Force of the clay in `last_row` [N]."""
        vx, vy, bx, by = *self.last_row[4:6], *self.last_row[12:14]
        return tuple(self.last_rendered or self._force(bx, by, vx, vy))

    def _stored(self) -> tuple[float, float]:
        """Energy of the arm, and that stored in the operator's arm, after the last kick [J]."""
        m, s = self.row.m, self.row.s
        return energy.kinetic(m, s), energy.of_hand(m, s)

    def balance(self) -> dict[str, float]:
        """The energy balance, as Record.energy."""
        m, s, last = self.row.m, self.row.s, self._stored()
        work = [getattr(s.work, name) for name in ("muscle", "motors", "clay", "hand", "through")]
        out = balance(work, self.first if self.looked else last, last)
        if m.springs:
            out |= {
                "springs_stored": float(s.springs_stored),
                "springs_dissipated": float(s.springs_dissipated),
            }
        return out | self._hardware(out)

    def _hardware(self, out: dict[str, float]) -> dict[str, float]:
        """Energy that hardware and held clay take; friction is not part of the motors' share."""
        w, m = self.row.s.work, self.row.m
        if not m.hardware:
            return {}
        used = {
            "friction": (w.friction, m.friction),
            "passivity_controller": (w.guard, m.guard),
            "coupling": (w.coupling, m.coupling),
            "rendered_clay": (w.rendered, m.renders),
        }
        found = {name: float(x) for name, (x, on) in used.items() if on}
        return found | {"residual": out["residual"] - found.get("friction", 0.0)}


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


def torque_reached(made: np.ndarray, k: int) -> np.ndarray:
    """|tau| of shoulder and elbow that at least k rows reach [N.m]; 0 if there are fewer rows."""
    return np.sort(np.abs(made[:, 8:10]), axis=0)[-k] if len(made) >= k else np.zeros(2)


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


def _columns(made: np.ndarray) -> np.ndarray:
    """Rows as the monitor takes them, shape (12, n)."""
    return np.ascontiguousarray(made[:, :12].T)


def completed(
    scenario: Scenario,
    every: int,
    engine: str,
    place: Place,
    progress: Callable[[float, float], bool | None] | None = None,
    brief: bool = False,
) -> tuple[Run, float]:
    """Makes a run; repeats it if the monitor must check rows that are not kept."""
    brief = brief and scenario.stop_when_unstable
    watched = every > 1 and progress is not None  # progress must not start again
    while True:
        run = Run(scenario, every, engine, place, brief=brief, watched=watched)
        begin = time.perf_counter()
        try:
            run.go(progress)
            return run, time.perf_counter() - begin
        except NeedsMonitor:
            brief, watched = False, True
