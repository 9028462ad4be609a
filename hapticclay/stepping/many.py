"""Many short runs in one call of compiled code: what runs share is set up once.

A run of a hundred steps takes the engine 0.1 ms, and Python as long to set it up. Runs whose scenes
are of one kind (see `kind_key`) differ in numbers alone. The first of them is set up as any other
run, and its state is the pattern of the rest: the numbers that differ are put into copies of it,
column by column, and `carry` makes all these runs without a return to Python. What it cannot judge,
as an unstable run, is made again by `run`.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from ..model import controller, regions
from ..model.clay import Profile
from ..model.controller import Servo
from ..model.operator import NO_HAND, mobility_with
from ..model.scenario import Scenario
from . import energy, monitor, path, run, sampled

SUMMARY_CROSSINGS = 8  # crossings that a summary has room for
LONGEST = 10_000  # steps of a run that is worth while: a call ends soon, and so does Ctrl-C
FEWEST = 4  # runs of a kind that repay its pattern
PATTERNS = 64  # kinds that are kept
SHARED = (
    "jitter", "lost", "encoder", "velocity", "window", "velocity_filter", "adc_bits", "adc_range",
    "force_noise", "force_filter", "filter_order", "dac_bits", "dac_range", "friction", "passivity",
    "coupling",
)  # fmt: skip  # of an interface, all but its delay; without noise its seed has no effect
_scene = operator.attrgetter(
    "control", "shaping", "dt", "t_max", "length", "Ts", "render", "torque_limit"
)
_shared, _hand_parts = operator.attrgetter(*SHARED), operator.attrgetter("mass", "damper", "spring")


class ManyRuns(NamedTuple):
    """Runs that `carry` makes, what it keeps of each, and its workspace.

    Attributes:
        states: of the runs, with the numbers of their scenarios; become final, shape (n,).
        tables: from regions.region_table, shape (n, len(Engine.table)).
        starts: position [m] and velocity [m/s] of the handle, (x, y) each, shape (n, 4).
        limits: of the engine's motors, shape (m, 2).
        reset: mj_resetData.
        good: 1 for a run that has nothing for the monitor, else 0, shape (n,).
        last: its last row, shape (n, path.ROW).
        force: of the clay there [N], shape (n, 2).
        crossings: the first ones: coordinate, time [s], speed [m/s], shape (n, SUMMARY_CROSSINGS,
            3).
        crossed: number of all, shape (n,).
        seen: counts of the monitor, see monitor.is_quiet, shape (n, 4).
        stored: energy of arm and hand at the start, then at the end [J], shape (n, 4).
        swings: workspace of monitor.is_quiet.
    """

    states: Any
    tables: Any
    starts: Any
    limits: Any
    reset: Any
    good: Any
    last: Any
    force: Any
    crossings: Any
    crossed: Any
    seen: Any
    stored: Any
    swings: Any

    @classmethod
    def of(cls, states: Any, tables: Any, starts: Any, limits: Any, reset: Any) -> ManyRuns:  # noqa: PLR0913
        """Runs that are to be made.

        Args:
            states: as the attribute.
            tables: as the attribute.
            starts: as the attribute.
            limits: as the attribute.
            reset: as the attribute.
        """
        n = len(states)
        crossings = np.full((n, SUMMARY_CROSSINGS, 3), np.nan)
        crossings[:, :, 0] = -1.0
        counts = np.zeros(n, np.int64), np.zeros(n, np.int64)
        seen = np.tile(np.array([0, -1, -1, 0]), (n, 1))
        rows = np.empty((n, path.ROW)), np.empty((n, 2))
        return cls(
            states, tables, starts, limits, reset, counts[0], *rows, crossings, counts[1], seen,
            np.empty((n, 4)), np.zeros((2, monitor.QUIET)),
        )  # fmt: skip


def advance_or_carry(m, s, e, room, runs):
    """One run, as path.advance, or many: what is compiled once need not be compiled for both.

    Args:
        m: the method.
        s: state of the run.
        e: arrays of the run, or of the runs, which all use.
        room: largest number of rows to fill; 0 makes the many runs.
        runs: as ManyRuns.
    """
    if room > 0:
        path.advance(m, s, e, room)
    else:
        carry(m, e, runs)


def carry(m, e, runs):
    """Makes runs one after the other.

    Args:
        m: the method.
        e: arrays of a run, which all use.
        runs: as ManyRuns.
    """
    room, kept, starts, limits = len(e.rows), runs, runs.starts, runs.limits
    for k in range(len(runs.states)):
        s = runs.states[k]
        for j in range(len(e.table)):
            e.table[j] = runs.tables[k, j]
        for i in range(len(e.ring)):
            for j in range(sampled.HOLD + 1):
                e.ring[i, j] = 0.0
        for j in range(2):
            limits[j, 0], limits[j, 1] = -s["torque_limit"][j], s["torque_limit"][j]
            for i in range(monitor.QUIET):
                kept.swings[j, i] = 0.0
        runs.reset(e.model, e.data)
        x, y, vx, vy = starts[k, 0], starts[k, 1], starts[k, 2], starts[k, 3]
        path.put_handle(s, e, x, y, vx, vy)
        path.settle(s, e.table, -1)
        for j in range(2):
            s["old"][j], s["old"][2 + j] = s["base"][j], s["rate"][j]
        w1, w2 = s["w"][0], s["w"][1]
        stored, crossings = kept.stored[k], kept.crossings[k]
        stored[0], stored[1] = energy.stored_energy(s, w1, w1 + w2, (x, y), (vx, vy))
        m.begin(s, e, x, y)
        kept.good[k] = 1
        while s["code"] == path.OPEN and kept.good[k]:
            s["crossed"], s["stopped"] = 0, 0
            path.advance(m, s, e, room)
            for j in range(s["crossed"]):
                i = kept.crossed[k]
                if i < SUMMARY_CROSSINGS:
                    row = e.crossings[j]
                    crossings[i, 0], crossings[i, 1], crossings[i, 2] = row[0], row[2], row[3]
                kept.crossed[k] = i + 1
            n, limit = s["filled"], s["torque_limit"]
            if s["code"] in (path.NOT_FINITE, path.UNRESOLVED):
                kept.good[k] = 0
            elif n >= room or s["code"] != path.OPEN:
                if n > 0 and not monitor.is_quiet(
                    e.rows, n, limit[0], limit[1], kept.swings, kept.seen[k]
                ):
                    kept.good[k] = 0
                elif n > 0:
                    keep_last(s, e, n - 1, kept.last[k], kept.force[k])
                s["filled"] = 0
        f = s["final"]
        stored[2], stored[3] = energy.stored_energy(
            s, f[4], f[4] + f[5], (f[0], f[1]), (f[2], f[3])
        )


def keep_last(s, e, i, last, force):
    """Keeps a row, and the force of the clay there.

    Args:
        s: state of the run.
        e: its arrays.
        i: the row.
        last: gets it, shape (path.ROW,).
        force: gets the force, shape (2,) [N].
    """
    for j in range(path.ROW):
        last[j] = e.rows[i, j]
    if len(e.rendered) > 0:
        force[0], force[1] = e.rendered[i, 0], e.rendered[i, 1]
    else:
        force[0], force[1] = path.viscous_parts(s, last[12], last[13], last[4], last[5])


def kind_key(s: Scenario) -> tuple[Any, ...] | None:
    """What runs of one kind have in common; None for a run that `carry` does not make.

    Beside that they differ in numbers: gain, force, operator, servo, start, velocity, origin, clay
    and delay.

    Args:
        s: the scenario.
    """
    clay, wires, hand = s.clay, s.interface, s.operator
    if (
        s.muscle is not None
        or s.command is not None
        or s.controller is not None
        or s.integrator != "fast"
        or not s.stop
        or s.t_max > LONGEST * s.dt
    ):
        return None
    law: Any = None
    if clay is not None:
        x, y = clay.x, clay.y
        if clay.angle or clay.groove is not None or not (is_plain(x) and (y is x or is_plain(y))):
            return None
        law = x.edges, x.along, y.edges, y.along, y is x or y == x
    parts: Any = None
    if wires is not None:
        if wires.jitter or wires.lost or wires.force_noise:
            return None
        parts = _shared(wires), wires.delay > 0.0
    held = hand is not None and (not isinstance(hand, tuple) or any(hand))
    # parts whose equality would cost more than it is worth are told by their identity
    return *_scene(s), held, law, parts, id(s.arm), id(s.compensator)


def is_plain(law: Any) -> bool:
    """Whether clay of an axis damps alone, by the place along one coordinate.

    Args:
        law: of the axis.
    """
    return type(law) is Profile and not (law.growth or law.Fy or law.K or law.springs)


class Pattern:
    """A run set up, whose state is that of all runs of its kind but for some numbers.

    Args:
        scenario: of the run.
        kernel: how the loops are run.
        store: engines to use.
    """

    def __init__(self, scenario: Scenario, kernel: run.Kernel, store: run.EngineStore):
        self.scenario, self.store = scenario, store  # kept: their identity is part of the key
        self.kind = run.kind_of(scenario)
        made = self.kind(scenario, 1, kernel, store, True)
        made.s.push()
        self.formed = bool(made.s["formed"])
        self.state, self.native = made.s.record.copy(), cast(Any, made.native)
        self.method, self.model = made.method, made.model
        self.table: Any = made.table
        self.ring = np.zeros((0, 1 + sampled.HOLD))

    def states(self, jobs: Sequence[Scenario]) -> np.ndarray:
        """The states of runs before they begin.

        Args:
            jobs: their scenarios.

        Returns:
            Shape (n,).
        """
        out: Any = np.empty(len(jobs), self.state.dtype)
        out[:] = self.state
        out["gain"], out["origin"] = [s.gain for s in jobs], [s.origin for s in jobs]
        out["force"] = [s.force for s in jobs]  # without a muscle
        self._put_hands(out, jobs)
        self._put_servos(out, jobs)
        if self.scenario.interface is not None:
            Ts = float(self.state["Ts"])
            delays = [s.interface.delay for s in jobs if s.interface]
            parts = [sampled.delay_in_samples(d, Ts) for d in delays]
            out["delay"], out["whole_delay"] = delays, [whole for whole, _ in parts]
            out["part_delay"] = [part for _, part in parts]
        return out

    def _put_hands(self, out: Any, jobs: Sequence[Scenario]) -> None:
        """Puts the operators' arms into states."""
        hands = np.array([[_hand_parts(th or NO_HAND) for th in s.operators] for s in jobs])
        out["handx"], out["handy"] = hands[:, 0], hands[:, 1]
        mass = np.minimum(hands[:, 0, 0], hands[:, 1, 0])
        out["mobility"] = mobility_with(float(self.state["arm"][4]), mass)

    def _put_servos(self, out: Any, jobs: Sequence[Scenario]) -> None:
        """Puts servos and the loop at the start into states."""
        servo, first = jobs[0].servo, self.kind.first_loop
        if all(s.servo is servo for s in jobs):
            starts = np.array([(*s.start, *s.velocity) for s in jobs]).T
            for j, x in enumerate(first(starts[:2], starts[2:], servo)):
                out["loop"][:, j] = x
            out["servox"], out["servoy"] = servo[0].numbers, servo[1].numbers
        else:
            out["loop"] = [first(s.start, s.velocity, s.servo) for s in jobs]
            for i, name in enumerate(("servox", "servoy")):
                out[name] = [s.servo[i].numbers for s in jobs]
        if "memory" in out.dtype.names:
            out["memory"] = np.concatenate([self._memory(jobs, i) for i in (0, 1)], axis=1)

    def _memory(self, jobs: Sequence[Scenario], i: int) -> np.ndarray:
        """Rows of controller.held_compensator of an axis, shape (n, 20)."""
        Ts, shape = float(self.state["Ts"]), jobs[0].compensators[i]
        out, places = np.empty((len(jobs), 20)), dict[Servo, list[int]]()
        for k, s in enumerate(jobs):
            places.setdefault(s.servo[i], []).append(k)
        for servo, at in places.items():
            gains, which = np.unique([jobs[k].gain[i] for k in at], return_inverse=True)
            A, B = controller.held_compensator(servo, shape, gains, Ts)
            out[at] = np.concatenate((A, B[:, :, None]), axis=2).reshape(len(gains), -1)[which]
        return out

    def tables(self, jobs: Sequence[Scenario]) -> np.ndarray:
        """Their tables of the clay, shape (n, len(table)).

        Args:
            jobs: scenarios.
        """
        out = np.tile(self.table, (len(jobs), 1))
        if self.scenario.clay is not None:
            at = [int(self.table[regions.VALUES + i]) for i in (0, 1)]
            for i in range(2 if at[0] != at[1] else 1):
                values = [s.clay.laws[i].values for s in jobs if s.clay]
                out[:, at[i] : at[i] + len(values[0])] = values
        return out

    def arrays(self, states: Any) -> Any:
        """Engine for these runs.

        Args:
            states: of the runs.
        """
        native = self.native
        if self.scenario.interface is not None:
            rows = sampled.ring_rows(int(self.state["window"]), int(states["whole_delay"].max()))
            if len(self.ring) < rows:
                self.ring = np.zeros((rows, 1 + sampled.HOLD))
            native = native._replace(ring=self.ring)
        return native


class Lane:
    """Makes many runs; of one thread.

    Args:
        kernel: how the loops are run.
        store: engines to use.
        carry: the function, compiled.
        reset: mj_resetData as compiled code calls it.
    """

    def __init__(self, kernel: Any, store: run.EngineStore, carry: Callable[..., None], reset: Any):
        self.kernel, self.store, self.carry, self.reset = kernel, store, carry, reset
        self.patterns: dict[Any, Pattern] = {}

    def pattern(self, key: Any, scenario: Scenario) -> Pattern:
        """The pattern of a kind.

        Args:
            key: from `kind_key`.
            scenario: one of the kind.
        """
        if key not in self.patterns:
            if len(self.patterns) >= PATTERNS:
                del self.patterns[next(iter(self.patterns))]
            self.patterns[key] = Pattern(scenario, self.kernel, self.store)
        return self.patterns[key]

    def make(
        self, jobs: Sequence[Scenario]
    ) -> tuple[list[tuple[np.ndarray, dict[str, Any]]], list[int]]:
        """Makes those runs that it can.

        Args:
            jobs: scenarios.

        Returns:
            Groups of runs: their places among jobs, and the fields of a summary, arrays over them;
            and the places of all others.
        """
        kinds: dict[Any, list[int]] = {}
        for i, s in enumerate(jobs):
            kinds.setdefault(kind_key(s), []).append(i)
        done, left = [], kinds.pop(None, [])
        for key, places in kinds.items():
            if len(places) < FEWEST or self.pattern(key, jobs[places[0]]).formed:
                left += places
                continue
            fields, good = self._group(self.patterns[key], [jobs[i] for i in places])
            at = np.array(places)
            done.append((at[good], fields))
            left += at[~good].tolist()
        return done, sorted(left)

    def _group(self, p: Pattern, jobs: list[Scenario]) -> tuple[dict[str, Any], np.ndarray]:
        """Runs of one kind: fields of a summary of those that are good, and which are."""
        self.store.engine(p.scenario)
        p.native.timestep[0] = p.scenario.dt
        states, starts = p.states(jobs), np.array([(*s.start, *s.velocity) for s in jobs])
        native, limits = p.arrays(states)._replace(table=p.table.copy()), p.model.actuator_ctrlrange
        runs = ManyRuns.of(states, p.tables(jobs), starts, limits, self.reset)
        self.carry(p.method, p.state, native, 0, runs)
        good = runs.good > 0
        return {name: x[good] for name, x in summary_columns(p.scenario, runs).items()}, good


def summary_columns(like: Scenario, kept: ManyRuns) -> dict[str, Any]:
    """The fields of summaries, arrays over runs.

    Args:
        like: a scenario of their kind.
        kept: the runs, made.
    """
    states = kept.states
    seen, moved, unbound, _ = kept.seen.T
    saturated, stalled = monitor.at_rest(seen, moved, unbound, like.dt)
    ends = np.where(saturated, "saturated", np.where(stalled, "stalled", "time limit"))
    code = np.where(states["code"] == path.FINISHED, "finished", ends)
    work, stored = states["work"], kept.stored
    balance = energy.energy_balance(work[:, :5].T, stored[:, :2].T, stored[:, 2:].T)
    if like.interface is not None and any(like.interface.friction):
        balance["residual"] = balance["residual"] - work[:, path.SUMS - len(energy.HARDWARE_WORK)]
    last, crossings = kept.last, kept.crossings
    return dict(
        code=code, axis=np.zeros(len(code), "U1"), time=states["t"], step=states["i"],
        steps=states["steps"],
        crossings=kept.crossed, crossing_axis=crossings[:, :, 0].astype(np.int64),
        crossing_time=crossings[:, :, 1], crossing_speed=crossings[:, :, 2],
        p=last[:, 2:4], v=last[:, 4:6], fh=last[:, 6:8], fe=kept.force, b=last[:, 12:14], **balance,
    )  # fmt: skip
