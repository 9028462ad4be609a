"""Many short runs in one call of compiled code: what runs share is set up once.

A run of a hundred steps takes the engine 0.3 ms, and Python as long to set up. Runs of one kind
(see `kind_key`) have the same parts and differ only in numbers. Each run is a row of the numbers of
its parts, written column by column. `carry` reads a row, makes the steps of its run and stores its
end. Runs that it cannot judge, such as unstable ones, are repeated by `run`.
"""

from __future__ import annotations

import itertools
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from ..model import controller, regions
from ..model.cells import Profile
from ..model.hardware import Hardware
from ..model.operator import NO_HAND, mobility_with
from ..scene.scenario import Scenario
from . import begin, energy, laws, monitor, path, rows, scene, viscous
from .engine_step import put
from .machine_code import CARRY, kind_of
from .memories import delay_in_samples
from .parts import Parts
from .run import EngineStore, Kernel
from .state import FINISHED, NOT_FINITE, OPEN, UNRESOLVED, Filled, State

WORKS = 10  # numbers of Runs.work
SUMMARY_CROSSINGS = 8  # crossings per summary
LONGEST = 10_000  # most steps of such a run: a call ends soon, so Ctrl-C takes effect soon
FEWEST = 4  # runs of a kind that repay its pattern
PATTERNS = 64  # kinds that are kept
# of the hardware, all but its delay; without noise its seed has no effect
SHARED = tuple(x.name for x in fields(Hardware) if x.name not in ("delay", "seed"))
_scene = operator.attrgetter(
    "control", "inertia_shaping", "dt", "t_max", "length", "Ts", "render", "torque_limit"
)
_shared, _hand_parts = operator.attrgetter(*SHARED), operator.attrgetter("mass", "damper", "spring")


# ---- compiled ------------------------------------------------------------------------------------


class Runs(NamedTuple):
    """Runs that `carry` makes, and their results.

    Attributes:
        numbers: of their parts, see `numbers_of`, shape (n, m).
        tables: of their clay, shape (n, len(parts.table)).
        memory: of their samplers, shape (n, len(sampler.memory)).
        starts: position [m] and velocity [m/s] of the handle, (x, y) each, shape (n, 4).
        limits: of the engine's motors, shape (2, 2).
        reset: mj_resetData.
        rows: of the record, one more than are filled between checks, shape (m, rows.ROW).
        crossings: noted by steps, shape (m, 4).
        rendered: force of the clay [N] where b v does not give it, shape (m, 3).
        good: 1 for a run that has nothing for the monitor, else 0, shape (n,).
        last: its last row, shape (n, rows.ROW).
        force: of the clay there [N], where b v does not give it, shape (n, 2).
        crossed: the first ones: coordinate, time [s], speed [m/s], shape (n, SUMMARY_CROSSINGS, 3).
        counts: number of all crossings, engine steps, last sample, code, shape (n, 4).
        times: end of the run [s], shape (n,).
        seen: counts of the monitor, see monitor.is_quiet, shape (n, 4).
        work: ledger, energies stored at the start and at the end, taken by friction [J], shape
            (n, WORKS).
        swings: workspace of monitor.is_quiet.
    """

    numbers: Any
    tables: Any
    memory: Any
    starts: Any
    limits: Any
    reset: Any
    rows: Any
    crossings: Any
    rendered: Any
    good: Any
    last: Any
    force: Any
    crossed: Any
    counts: Any
    times: Any
    seen: Any
    work: Any
    swings: Any


def filled(like, numbers, k):
    """The parts of run k, which differ from those of `like` in numbers alone; compiled only."""
    raise NotImplementedError


def readied(parts, e, runs, k):
    """Prepares the engine, the clay and the workspace for run k."""
    for j in range(len(parts.table)):
        parts.table[j] = runs.tables[k, j]
    for j in range(2):
        runs.limits[j, 0], runs.limits[j, 1] = -parts.limits[j], parts.limits[j]
        for i in range(monitor.QUIET):
            runs.swings[j, i] = 0.0
    runs.reset(e.model, e.data)
    put(e.timestep, 0, (parts.time.dt,))
    remember(parts.sampler, runs, k)


def remember(sampler, runs, k):
    """Prepares the compensators of sampled control for run k."""
    if sampler is None:
        return
    for j in range(len(sampler.memory)):
        sampler.memory[j] = runs.memory[k, j]


def noted(runs, k, n):
    """Stores the crossings of the steps just made."""
    for j in range(n):
        i = runs.counts[k, 0]
        if i < SUMMARY_CROSSINGS:
            found = runs.crossings[j]
            runs.crossed[k, i, 0], runs.crossed[k, i, 1] = found[0], found[2]
            runs.crossed[k, i, 2] = found[3]
        runs.counts[k, 0] = i + 1


def judged(parts, runs, k, s):
    """Judges the rows made; returns whether the run may continue without the monitor."""
    n, limit = s.filled.rows, parts.limits
    if s.status.code == NOT_FINITE or s.status.code == UNRESOLVED:
        return False
    if n == 0:
        return True
    if not monitor.is_quiet(runs.rows, n, limit[0], limit[1], runs.swings, runs.seen[k]):
        return False
    for j in range(rows.ROW):
        runs.last[k, j] = runs.rows[n - 1, j]
    for j in range(2):
        runs.force[k, j] = runs.rendered[n - 1, j] if len(runs.rendered) else 0.0
    return True


def ended(parts, runs, k, s, first):
    """Stores the end of a run."""
    last, w, out = energy.stored(parts, s), s.work, runs.work[k]
    out[0], out[1], out[2], out[3], out[4] = w.muscle, w.motors, w.clay, w.hand, w.through
    out[5], out[6], out[7], out[8] = first[0], first[1], last[0], last[1]
    out[9] = friction_of(w.hardware)
    runs.counts[k, 2], runs.counts[k, 3] = s.clock.i, s.status.code
    runs.times[k] = s.clock.t


def friction_of(work):
    """Energy that friction has taken [J]."""
    if work is None:
        return 0.0
    return work.friction


def carry(like, blocks, e, runs):
    """Makes runs one after the other.

    Args:
        like: parts of their kind. All runs use its table and all other arrays that steps fill;
            its rings are long enough for each run.
        blocks: from scene.blocks.
        e: the engine.
        runs: what to run.
    """
    room = len(runs.rows) - 1
    for k in range(len(runs.starts)):
        parts, x = filled(like, runs.numbers, k), runs.starts[k]
        readied(parts, e, runs, k)
        s = begin.begun(parts, blocks, e, (x[0], x[1]), (x[2], x[3]))
        first, good = energy.stored(parts, s), True
        while s.status.code == OPEN and good:
            s = path.advance(parts, s, e, room)
            made = s.filled
            noted(runs, k, made.crossings)
            if made.rows >= room or s.status.code != OPEN:
                good = judged(parts, runs, k, s)
                made = Filled(made.steps, 0, 0, 0)
            s = path.with_filled(s, Filled(0, made.rows, 0, 0))
            runs.counts[k, 1] += made.steps
        runs.good[k] = 1 if good else 0
        ended(parts, runs, k, s, first)


# ---- which runs, and their numbers ---------------------------------------------------------------


def kind_key(s: Scenario) -> tuple[Any, ...] | None:
    """Key of runs of one kind; None for a run that `carry` does not make.

    Runs of one kind differ in numbers: gain, force, operator, servo, start, velocity, origin, clay
    and delay.

    Args:
        s: the scenario.
    """
    clay, wires, hand = s.clay, s.hardware, s.operator
    if (
        s.muscle is not None
        or s.command is not None
        or s.controller is not None
        or s.integrator != "fast"
        or not s.stop_when_unstable
        or s.t_max > LONGEST * s.dt
        or (laws.TABLE and laws.parts_of(s) is not None)
    ):
        return None
    law: Any = None
    if clay is not None:
        x: Any = clay.x
        y: Any = clay.y
        if clay.angle or clay.groove is not None or not (is_plain(x) and (y is x or is_plain(y))):
            return None
        hard = scene.hardness(s, max(max(x.values), max(y.values)))
        law = x.edges, x.along, y.edges, y.along, y is x or y == x, hard
    parts: Any = None
    if wires is not None:
        if wires.jitter or wires.dropout_probability or wires.force_noise:
            return None
        parts = _shared(wires), wires.delay > 0.0
    held = hand is not None and (not isinstance(hand, tuple) or any(hand))
    # parts that are expensive to compare are distinguished by identity
    return *_scene(s), held, law, parts, id(s.arm), id(s.compensator)


def is_plain(law: Any) -> bool:
    """Whether the clay of an axis damps only, as a function of one coordinate.

    Args:
        law: of the axis.
    """
    return type(law) is Profile and not (law.growth or law.Fy or law.K or law.springs)


def numbers_of(part: Any) -> list[float]:
    """The numbers of parts, in the order in which `filled` takes them.

    Args:
        part: the parts of a scene.
    """
    if isinstance(part, tuple):
        return [x for each in part for x in numbers_of(each)]
    return [float(part)] if isinstance(part, float | int) else []


def places(part: Any, count: Iterator[int] | None = None) -> Any:
    """Parts with the index in `numbers_of` in place of each number; all else is None.

    Args:
        part: the parts of a scene.
        count: of the numbers before; None for none.
    """
    count = count or itertools.count()
    if isinstance(part, tuple):
        made = [places(x, count) for x in part]
        return type(part)._make(made) if hasattr(part, "_make") else tuple(made)
    return next(count) if isinstance(part, float | int) else None


class Pattern:
    """A scene whose parts are those of all runs of its kind, except some numbers.

    Args:
        scenario: the scene.

    Attributes:
        parts: of the scene.
        blocks: from scene.blocks.
        scene: what the machine code of its steps is compiled for.
        kind: what that of `carry` is compiled for.
        is_made: whether `carry` makes such runs: not with compensators of another shape.
    """

    def __init__(self, scenario: Scenario):
        self.scenario = scenario  # kept: the identity of its parts is in the key
        self.parts: Parts = scene.parts_of(scenario)
        self.blocks: State = scene.blocks(self.parts, scenario)
        self.scene = kind_of(self.parts)
        self.kind = CARRY, self.scene, kind_of(self.blocks)
        self.is_made = self.parts.form is None
        self.row, self.at = np.array(numbers_of(self.parts)), places(self.parts)

    def roomy(self, delays: Sequence[float]) -> Parts:
        """Parts whose arrays have room for each of some runs; those that they have are kept.

        Args:
            delays: of their torques [s].
        """
        longest = max(delays, default=0.0)
        held = self.parts.sampler
        if held and held.delay and longest > held.delay.delay:
            self.parts = scene.for_delays(self.parts, longest)
        return self.parts

    def numbers(self, d: Draws) -> np.ndarray:
        """The numbers of their parts, shape (n, m).

        Args:
            d: what the runs differ in.
        """
        at, out = self.at, np.tile(self.row, (len(d.gain), 1))
        out[:, at.arm.ox : at.arm.oy + 1] = d.origin
        out[:, [x.K for x in at.lag]] = d.gain
        out[:, at.push.steady[1:3]] = d.force
        for i in (0, 1):
            for servo, runs in d.servo[i].items():
                out[np.array(runs)[:, None], at.servo[i]] = servo.numbers
        if at.hand is not None:
            self._put_hands(out, d.hands)
        if at.sampler is not None and at.sampler.delay is not None:
            self._put_delays(out, d.delays)
        return out

    def _put_hands(self, out: np.ndarray, hands: np.ndarray) -> None:
        """Writes the operators' arms into numbers, and the mobility with them."""
        for i, x in enumerate(self.at.hand):
            out[:, [x.mass, x.damper, x.spring]] = hands[:, i]
        mass = np.minimum(hands[:, 0, 0], hands[:, 1, 0])
        for special in (self.at.special, self.at.sampler and self.at.sampler.special):
            if special is not None and special.stiff is not None:
                trace = self.scenario.arm.links[4]
                out[:, special.stiff.mobility] = mobility_with(trace, mass)

    def _put_delays(self, out: np.ndarray, delays: Sequence[float]) -> None:
        """Writes delays of the torques into numbers."""
        at, Ts = self.at.sampler, self.parts.sampler.Ts
        whole, share = np.array([delay_in_samples(x, Ts) for x in delays]).T
        out[:, at.delay.delay], out[:, at.delay.rows] = delays, whole + scene.QUEUE
        if at.passivity is not None:
            out[:, at.passivity.whole], out[:, at.passivity.share] = whole, share

    def tables(self, d: Draws) -> np.ndarray:
        """Their tables of the clay, shape (n, len(parts.table)).

        Args:
            d: what the runs differ in.
        """
        table = self.parts.table
        out = np.tile(table, (len(d.gain), 1))
        if d.values is not None:
            at = [int(table[regions.VALUES + i]) for i in (0, 1)]
            for i in range(2 if at[0] != at[1] else 1):
                out[:, at[i] : at[i] + d.values[i].shape[1]] = d.values[i]
        return out

    def memory(self, d: Draws) -> np.ndarray:
        """Rows of controller.held_compensator of their axes, shape (n, 40); (n, 0) for none.

        Args:
            d: what the runs differ in.
        """
        if self.parts.sampler is None:
            return np.empty((len(d.gain), 0))
        return np.concatenate([self._memory(d, i) for i in (0, 1)], axis=1)

    def _memory(self, d: Draws, i: int) -> np.ndarray:
        Ts, shape = self.parts.sampler.Ts, self.scenario.compensators[i]
        out = np.empty((len(d.gain), 20))
        for servo, runs in d.servo[i].items():
            at = np.array(runs)
            gains, which = np.unique(d.gain[at, i], return_inverse=True)
            A, B = controller.held_compensator(servo, shape, gains, Ts)
            out[at] = np.concatenate((A, B[:, :, None]), axis=2).reshape(len(gains), -1)[which]
        return out


class Draws(NamedTuple):
    """Differences between runs of one kind, as columns over n runs.

    Attributes:
        gain: of x and y [1/kg], shape (n, 2).
        force: constant muscle force [N], shape (n, 2).
        origin: world position of p = 0 [m], shape (n, 2).
        starts: position [m] and velocity [m/s] of the handle, (x, y) each, shape (n, 4).
        servo: of x and of y: the servos, and the runs that have them.
        hands: mass, damper and spring of x and of y, shape (n, 2, 3); None without operators.
        delays: of the torques [s]; empty without hardware.
        values: dampings of the clay's regions [N.s/m], of x and of y, shape (n, regions) each; None
            without clay.
    """

    gain: np.ndarray
    force: np.ndarray
    origin: np.ndarray
    starts: np.ndarray
    servo: Any
    hands: Any
    delays: Any
    values: Any


def draws_of(jobs: Sequence[Scenario]) -> Draws:
    """Differences between scenarios of one kind.

    Args:
        jobs: the scenarios.
    """
    first, hands, values = jobs[0], None, None
    if any(first.operators):
        hands = np.array([[_hand_parts(th or NO_HAND) for th in s.operators] for s in jobs])
    if first.clay is not None:
        values = [np.array([s.clay.laws[i].values for s in jobs if s.clay]) for i in (0, 1)]
    servo: Any = [{x: range(len(jobs))} for x in first.servo]
    if not all(s.servo is first.servo for s in jobs):
        servo = {}, {}
        for i in (0, 1):
            for k, s in enumerate(jobs):
                servo[i].setdefault(s.servo[i], []).append(k)
    gain, force, origin = (
        np.array([getattr(s, name) for s in jobs], float) for name in ("gain", "force", "origin")
    )
    starts = np.array([(*s.start, *s.velocity) for s in jobs], float)
    delays = [s.hardware.delay for s in jobs if s.hardware]
    return Draws(gain, force, origin, starts, servo, hands, delays, values)


class Patterns:
    """The patterns of the most recent kinds of run."""

    def __init__(self):
        self.known: dict[Any, Pattern] = {}

    def of(self, key: Any, scenario: Scenario) -> Pattern:
        """The pattern of a kind.

        Args:
            key: from `kind_key`.
            scenario: one of the kind.
        """
        if key not in self.known:
            if len(self.known) >= PATTERNS:
                del self.known[next(iter(self.known))]
            self.known[key] = Pattern(scenario)
        return self.known[key]


class Lane:
    """Makes many runs in one thread.

    Args:
        kernel: how the steps are made, compiled.
        store: engines to use.
        carry: the function, compiled.
        reset: mj_resetData as compiled code calls it.
    """

    def __init__(self, kernel: Kernel, store: EngineStore, carry: Callable[..., None], reset: Any):
        self.kernel, self.store, self.carry, self.reset = kernel, store, carry, reset
        self.patterns = Patterns()

    def make(
        self, jobs: Sequence[Scenario], keys: Sequence[Any]
    ) -> tuple[list[tuple[np.ndarray, dict[str, Any]]], list[int]]:
        """Makes those runs that it can.

        Args:
            jobs: scenarios.
            keys: of each, from `kind_key`; None for one that is not to be made.

        Returns:
            Groups of runs: their indices in jobs, and the fields of a summary, arrays over them;
            and the indices of all other runs.
        """
        kinds: dict[Any, list[int]] = {}
        for i, key in enumerate(keys):
            kinds.setdefault(key, []).append(i)
        done, left = [], kinds.pop(None, [])
        for key, found in kinds.items():
            if len(found) < FEWEST or not (p := self.patterns.of(key, jobs[found[0]])).is_made:
                left += found
                continue
            fields, good = self.group(p, draws_of([jobs[i] for i in found]))
            at = np.array(found)
            done.append((at[good], fields))
            left += at[~good].tolist()
        return done, sorted(left)

    def group(self, p: Pattern, d: Draws) -> tuple[dict[str, Any], np.ndarray]:
        """Makes runs of one kind.

        Args:
            p: its pattern.
            d: what the runs differ in.

        Returns:
            Fields of a summary of those that are good, and which are.
        """
        parts, n = p.roomy(d.delays), len(d.gain)
        model, data = self.store.engine(p.scenario)
        e = self.store.arrays(parts, model, data, self.kernel)
        crossed = np.full((n, SUMMARY_CROSSINGS, 3), np.nan)
        crossed[:, :, 0] = -1.0
        runs = Runs(
            p.numbers(d), p.tables(d), p.memory(d), d.starts, model.actuator_ctrlrange,
            self.reset, self.store.rows, self.store.crossings,
            self.store.rendered if scene.tells(parts) else np.empty((0, 3)), np.zeros(n, np.int64),
            np.zeros((n, rows.ROW)), np.zeros((n, 2)), crossed, np.zeros((n, 4), np.int64),
            np.zeros(n), np.tile(np.array([0, -1, -1, 0]), (n, 1)), np.zeros((n, WORKS)),
            np.zeros((2, monitor.QUIET)),
        )  # fmt: skip
        self.carry(parts, p.blocks, e, runs)
        good = runs.good > 0
        return {name: x[good] for name, x in summary_columns(p.scenario, runs).items()}, good


def summary_columns(like: Scenario, made: Runs) -> dict[str, Any]:
    """The fields of summaries, arrays over runs.

    Args:
        like: a scenario of their kind.
        made: the runs.
    """
    crossings, steps, step, codes = made.counts.T
    seen, moved, unbound, _ = made.seen.T
    saturated, stalled = monitor.at_rest(seen, moved, unbound, like.dt)
    ends = np.where(saturated, "saturated", np.where(stalled, "stalled", "time limit"))
    work = made.work.T
    balance = energy.balance(work[:5], work[5:7], work[7:9])
    if like.hardware is not None and any(like.hardware.friction):
        balance["residual"] = balance["residual"] - work[9]
    last, crossed = made.last, made.crossed
    v, b, fe = last[:, 4:6], last[:, 12:14], made.force
    if not len(made.rendered):
        fe = np.column_stack(viscous.force(None, b.T, v.T))
    return dict(
        code=np.where(codes == FINISHED, "finished", ends), axis=np.zeros(len(codes), "U1"),
        time=made.times, step=step, steps=steps, crossings=crossings,
        crossing_axis=crossed[:, :, 0].astype(np.int64), crossing_time=crossed[:, :, 1],
        crossing_speed=crossed[:, :, 2], p=last[:, 2:4], v=v, fh=last[:, 6:8], fe=fe, b=b,
        **balance,
    )  # fmt: skip
