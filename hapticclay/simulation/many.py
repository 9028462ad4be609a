"""Many short runs that differ in numbers: rows of one model, made in one call."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import fields
from typing import Any, NamedTuple

import numpy as np

from ..formulas import regions
from ..kernel import hardware, layout, native, records, scene, user_laws
from ..kernel.row import CHUNK, NativeRow, bytes_of
from ..model import controller
from ..model.cells import Profile
from ..model.hardware import Hardware
from ..model.operator import NO_HAND, mobility_with
from ..scene.scenario import Scenario
from .run import Workspace
from .summaries import of_rows

LONGEST = 10_000  # most steps of such a run: a call ends soon, so Ctrl-C takes effect soon
FEWEST = 4  # runs of a kind that repay its pattern
PATTERNS = 64  # kinds that are kept
# fields of the hardware, but the delay, and the seed, which has no effect without noise
SHARED = tuple(x.name for x in fields(Hardware) if x.name not in ("delay", "seed"))
_scene = operator.attrgetter(
    "control", "inertia_shaping", "dt", "t_max", "length", "Ts", "render", "torque_limit"
)
_shared, _hand_parts = operator.attrgetter(*SHARED), operator.attrgetter("mass", "damper", "spring")


def kind_key(s: Scenario) -> tuple[Any, ...] | None:
    """Key of runs of one kind; None for a run that is made alone.

    Runs of one kind differ in numbers: gain, force, operator, servo, start, velocity, origin, clay
    and delay.
    """
    clay, wires, hand = s.clay, s.hardware, s.operator
    if (
        s.muscle is not None
        or s.command is not None
        or s.controller is not None
        or s.integrator != "fast"
        or not s.stop_when_unstable
        or s.t_max > LONGEST * s.dt
        or (user_laws.TABLE and user_laws.of_scene(s))
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
    """Whether the clay of an axis damps only, as a function of one coordinate."""
    return type(law) is Profile and not (law.growth or law.Fy or law.K or law.springs)


class Pattern:
    """A scene whose model is that of all runs of its kind, except for some numbers."""

    def __init__(self, scenario: Scenario, workspace: Workspace):
        self.scenario = scenario  # kept: the identity of its parts is in the key
        self.row = NativeRow(scenario, workspace.movers.of(scenario), workspace.buffers)
        self.is_made = not self.row.m.formed

    def models(self, d: Differences) -> tuple[np.ndarray, list[np.ndarray]]:
        """The models of runs, and the arrays that they name."""
        model = self.row.models.view(layout.dtype_of(records.Model))
        out, kept = np.repeat(model, len(d.gain)), []
        out["ox"], out["oy"] = d.origin.T
        axis = out["axis"][:, :2]
        axis["K"], axis["push"] = d.gain, d.force
        for i in (0, 1):
            for servo, runs in d.servo[i].items():
                axis["servo"][np.array(runs), i] = servo.numbers
        if self.row.m.hand:
            self._put_hands(out, d.hands)
        if self.row.m.ratio:
            for i in (0, 1):
                axis["memory"][:, i, :20] = self._memory(d, i)
        if self.row.m.delay > 0.0:
            kept.append(self._put_delays(out, d.delays))
        if d.values is not None:
            kept.append(self._put_tables(out, d))
        return out, kept

    def _put_hands(self, out: np.ndarray, hands: np.ndarray) -> None:
        """Puts the operators' arms into models, and the mobility with them."""
        for j, name in enumerate(("mass", "damper", "spring")):
            out["axis"][name][:, :2] = hands[:, :, j]
        if self.row.m.stiff:
            mass = np.minimum(hands[:, 0, 0], hands[:, 1, 0])
            out["mobility"] = mobility_with(self.scenario.arm.links[4], mass)

    def _put_delays(self, out: np.ndarray, delays: Sequence[float]) -> np.ndarray:
        """Puts delays of the torques into models; the ring that all use, one after the other."""
        whole, share = np.array([scene.delay_in_samples(x, self.row.m.Ts) for x in delays]).T
        out["delay"], out["queue_rows"] = delays, whole + scene.QUEUE
        ring = np.zeros(int((hardware.QUEUED + 2) * (whole.max() + scene.QUEUE)))
        out["queue"] = ring.ctypes.data
        if not self.row.m.guard:
            return ring
        out["guard_whole"], out["guard_share"] = whole, share
        both = np.zeros(len(ring) + int(2 * (whole.max() + 2)))
        out["queue"], out["forces"] = both.ctypes.data, both[len(ring) :].ctypes.data
        return both

    def _put_tables(self, out: np.ndarray, d: Differences) -> np.ndarray:
        """Puts the values of the clay into tables of their own."""
        table = self.row.arrays["table"]
        tables = np.tile(table, (len(out), 1))
        at = [int(table[regions.VALUES + i]) for i in (0, 1)]
        for i in range(2 if at[0] != at[1] else 1):
            tables[:, at[i] : at[i] + d.values[i].shape[1]] = d.values[i]
        out["table"] = tables.ctypes.data + tables.strides[0] * np.arange(len(out))
        return tables

    def _memory(self, d: Differences, i: int) -> np.ndarray:
        """Rows of controller.held_compensator of an axis, shape (n, 20)."""
        Ts, shape = self.row.m.Ts, self.scenario.compensators[i]
        out = np.empty((len(d.gain), 20))
        for servo, runs in d.servo[i].items():
            at = np.array(runs)
            gains, which = np.unique(d.gain[at, i], return_inverse=True)
            A, B = controller.held_compensator(servo, shape, gains, Ts)
            out[at] = np.concatenate((A, B[:, :, None]), axis=2).reshape(len(gains), -1)[which]
        return out


class Differences(NamedTuple):
    """Differences between runs of one kind, as columns over n runs."""

    gain: np.ndarray  # [1/kg], shape (n, 2)
    force: np.ndarray  # constant muscle force [N], shape (n, 2)
    origin: np.ndarray  # world position of p = 0 [m], shape (n, 2)
    starts: np.ndarray  # position [m] and velocity [m/s] of the handle, (x, y) each, shape (n, 4)
    servo: Any  # of x and of y: the servos, and the runs that have them
    hands: Any  # mass, damper, spring of x and of y, shape (n, 2, 3); None without operators
    delays: Any  # of the torques [s]; empty without hardware
    values: Any  # dampings of the regions, x and y, shape (n, regions) [N.s/m]; None without clay

    def repeated(self, n: int) -> Differences:
        """Those of a single run, n times."""
        columns = self.gain, self.force, self.origin, self.starts
        gain, force, origin, starts = (np.repeat(x, n, axis=0) for x in columns)
        servo = [dict.fromkeys(each, range(n)) for each in self.servo]
        hands = None if self.hands is None else np.repeat(self.hands, n, axis=0)
        delays = np.repeat(np.array(self.delays, float), n)
        values = self.values and [np.repeat(x, n, axis=0) for x in self.values]
        return Differences(gain, force, origin, starts, servo, hands, delays, values)


def differences_of(jobs: Sequence[Scenario]) -> Differences:
    """Differences between scenarios of one kind."""
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
    return Differences(gain, force, origin, starts, servo, hands, delays, values)


class Lane:
    """Makes many runs in one thread, those of one kind together."""

    def __init__(self, workspace: Workspace):
        self.workspace, self.known = workspace, dict[Any, Pattern]()

    def pattern(self, key: Any, scenario: Scenario) -> Pattern:
        """The pattern of a kind."""
        if key not in self.known:
            if len(self.known) >= PATTERNS:
                del self.known[next(iter(self.known))]
            self.known[key] = Pattern(scenario, self.workspace)
        return self.known[key]

    def make(
        self, jobs: Sequence[Scenario], keys: Sequence[Any]
    ) -> tuple[list[tuple[np.ndarray, dict[str, Any]]], list[int]]:
        """Makes runs by their keys: fields of summaries by runs, and which runs are left."""
        kinds: dict[Any, list[int]] = {}
        for i, key in enumerate(keys):
            kinds.setdefault(key, []).append(i)
        done, left = [], kinds.pop(None, [])
        for key, found in kinds.items():
            if len(found) < FEWEST or not (p := self.pattern(key, jobs[found[0]])).is_made:
                left += found
                continue
            summaries, good = self.group(p, differences_of([jobs[i] for i in found]))
            at = np.array(found)
            done.append((at[good], summaries))
            left += at[~good].tolist()
        return done, sorted(left)

    def group(self, p: Pattern, d: Differences) -> tuple[dict[str, Any], np.ndarray]:
        """Makes runs of one kind: fields of the good ones' summaries, and which are good."""
        models, kept = p.models(d)
        n = len(models)
        states: Any = np.zeros(n, layout.dtype_of(records.State))
        outs = np.zeros(n, layout.dtype_of(records.Summary))
        starts = np.ascontiguousarray(d.starts, float)
        models["engine"] = self.workspace.movers.of(p.scenario).row.ctypes.data
        places = (x.ctypes.data for x in (models, states, outs))
        native.machine().finish(*places, n, starts.ctypes.data, CHUNK - 1)
        del kept  # the arrays that the models name
        good = states["watch"]["quiet"] > 0
        return of_rows(p.scenario, p.row.m, _chosen(states, good), _chosen(outs, good)), good


def _chosen(rows: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Records by a mask, copied as bytes: by fields it takes as long as ten steps of a run."""
    if which.all():
        return rows
    return bytes_of(rows).reshape(len(rows), -1)[which].view(rows.dtype)[:, 0]
