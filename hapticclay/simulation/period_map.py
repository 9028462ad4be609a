"""The linear map of small motions over one period, from the steps of a run.

The handle is at rest. Each coordinate of the state is kicked in a copy of the run, and all copies
make the steps of one period: of a control sample, or of one step where control is continuous.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..formulas import arm
from ..kernel import layout, movers, path, records, scene
from ..kernel.hardware import QUEUED
from ..kernel.row import ROWS, Buffers, Row, bytes_of
from ..model.sampled_controller import BUFFER
from ..scene.scenario import Scenario
from .engines import engine_for
from .run import with_checked

KICK = 1e-6  # in SI units: the squares of angles are 1e-6 of it, their rounding is 1e-10 of it
LINEAR = 1e-4  # share of the ends by which that of all kicks may miss the sum of those of each
ROUNDED = 1e-8  # of an end, per kick
MOST = 100  # coordinates of a scene
SETTLED = 1  # periods after which each step follows a whole one


class PeriodMap(NamedTuple):
    """The linear map of small motions over one period: z(k+1) = matrix z(k).

    It has the coordinates of one axis, or of both where the other one acts on it.
    """

    matrix: np.ndarray  # shape (n, n)
    period: float  # [s]
    pushed: np.ndarray  # z for a unit velocity of the handle along the axis, shape (n,)
    seen: np.ndarray  # velocity of the handle along the axis per unit of z, shape (n,)


class PeriodMaps:
    """The maps of scenes, which share engines and buffers."""

    def __init__(self):
        self.movers, self.buffers = movers.Movers(), Buffers()
        self.coupled: set[Any] = set()  # kinds of scene in which one axis has acted on the other

    def of(self, s: Scenario, i: int) -> PeriodMap | None:
        """The map of a scene around its start, at rest."""
        end = (MOST + SETTLED) * (s.Ts or s.dt)  # longer than any map takes
        s = with_checked(s, velocity=(0.0, 0.0), force=(0.0, 0.0), t_max=end, length=None)
        row = ROWS[engine_for("auto")](s, self.movers.of(s), self.buffers)
        warm = warm_periods(row.m)
        if not has_map(s, row.m) or warm + 1 > MOST:
            return None
        kind = s.arm, s.clay and s.clay.angle, s.hardware is None, s.control
        copies = Map(row, kind in self.coupled)
        found = copies.of(s, i, warm)
        if copies.coupled:
            self.coupled.add(kind)
        return found


# ---- which scenes have a map ---------------------------------------------------------------------


def has_map(s: Scenario, m: Any) -> bool:
    """Whether small motions of a scene are linear, and alike in each period."""
    uneven = m.grows, m.smooth, m.flow, m.modal, m.groove, m.laws
    wires = m.encoder, m.chance, m.adc_bits, m.dac_bits, m.friction, m.guard
    return not (
        s.driven or s.integrator != "fast" and s.control != "sampled" or any(uneven + wires)
    )


def warm_periods(m: Any) -> int:
    """Periods after which the rings of the hardware are full."""
    late = scene.delay_in_samples(m.delay, m.Ts)[0] if m.delay > 0.0 else -1
    return max(SETTLED, m.window, late + 1) if m.ratio else SETTLED


# ---- coordinates ---------------------------------------------------------------------------------


def number_of(*names: Any) -> int:
    """Index of a number of a state."""
    kind, at = layout.dtype_of(records.State), 0
    for name in names:
        if isinstance(name, int):
            kind = kind.base if kind.subdtype else kind
            at += name * kind.itemsize
        else:
            kind, first = kind.fields[name][:2]
            at += first
            kind = kind.subdtype[0] if kind.subdtype else kind
    return at // 8


class Ring(NamedTuple):
    """Numbers of past samples on which the next ones depend."""

    name: str  # of the array
    first: str  # field of the machine with its first row; "" for a fixed one
    filled: str  # field with the number of its rows; "" where all count
    width: int  # numbers of a row
    columns: tuple[tuple[int, ...], tuple[int, ...]]  # coordinates of x, and of y, among them

    def places(self, machine: Any, size: int, i: int) -> np.ndarray:
        """Where the coordinates of an axis lie."""
        if not self.first:
            return np.array(self.columns[i], int)
        rows = size // self.width
        count = int(machine[self.filled]) if self.filled else rows
        at = (int(machine[self.first]) + np.arange(count)) % rows
        return (at[:, None] * self.width + np.array(self.columns[i])).ravel()


def coordinates(m: Any, i: int) -> list[int]:
    """The numbers of a state that change in small motions along an axis.

    Link i moves the handle along axis i at the nominal pose. Angle and rate of its joint come
    first.
    """
    joint = [number_of("q", i), number_of("w", i)]
    names = ["owed"] if m.special and m.acts else []
    names += ["rest", "stretch", "at", "force", "force_before"] if m.springs else []
    loop = ["delta", "rate", "y", "yrate"]
    clay = [number_of("axis", i, name) for name in names]
    if not m.ratio:
        form = [number_of("axis", i, "z") + r for r in range(4)] if m.formed else []
        return [*joint, *(number_of("axis", i, name) for name in loop), *form, *clay]
    found = [number_of("now", name, i) for name in ["tau"] + ["w"] * bool(m.window)]
    if not m.own:
        held = loop + ["pull", "pull_rate", "tool"] * bool(m.coupling)
        found += [number_of("now", "axis", i, name) for name in held]
    if m.filtered:
        found += [number_of("now", "axis", i, "filter") + r for r in range(2)]
    if m.formed and not m.own:
        found += [number_of("now", "axis", i, "z") + r for r in range(4)]
    return [*joint, *found, *clay]


def rings_of(m: Any) -> list[Ring]:
    """The rings of the hardware, and the state of the user's own controller."""
    found = []
    if m.window:
        found.append(Ring("angles", "oldest", "", 3, ((1,), (2,))))
    if m.delay > 0.0:
        columns = ((1, 7, 9), (2, 8, 10)) if m.coupling else ((1,), (2,))
        found.append(Ring("queue", "first", "n", QUEUED + m.joints, columns))
    if m.own:
        state = tuple(range(BUFFER, BUFFER + m.buffer_size))
        found.append(Ring("buffer", "", "", 1, (state, ())))
    return found


# ---- copies --------------------------------------------------------------------------------------


class Copies(NamedTuple):
    """Copies of a run."""

    states: np.ndarray
    rings: list[np.ndarray]  # shape (copies, size) each

    def repeated(self, n: int) -> Copies:
        """Each copy several times."""
        return Copies(np.repeat(self.states, n), [np.repeat(x, n, axis=0) for x in self.rings])

    @property
    def arrays(self) -> list[np.ndarray]:
        """All numbers in which the copies may differ, shape (copies, size) each."""
        return [self.states.view(float).reshape(len(self.states), -1), *self.rings]


# ---- the map -------------------------------------------------------------------------------------


class Map:
    """Makes the map of a scene; `coupled`: one axis acts on the other in such scenes."""

    def __init__(self, row: Row, coupled: bool):
        self.row, self.coupled, self.rings = row, coupled, rings_of(row.m)
        self.own = [np.array(coordinates(row.m, i)) for i in (0, 1)]
        self.moving = [number_of(name, i) for name in ("q", "w") for i in (0, 1)]
        self.torques = [number_of("now", "tau", i) for i in (0, 1)]

    def of(self, s: Scenario, i: int, warm: int) -> PeriodMap | None:
        """The map."""
        n, q = self.row.m.ratio or 1, (self.row.s.q[0], self.row.s.q[1])
        rest = self._at_rest(warm * n)
        if rest is None:
            return None
        axes, matrix = (i,), None if self.coupled else self._matrix(rest, (i,), n)
        if matrix is None:
            axes, matrix = (i, 1 - i), self._matrix(rest, (i, 1 - i), n)
            self.coupled = self.coupled or matrix is not None
        if matrix is None:
            return None
        pushed, seen = np.zeros((2, len(matrix)))
        first = 0
        for j in axes:  # the rate of a joint is the second coordinate of its axis
            pushed[first + 1], seen[first + 1] = push_of(s, q, i, j)
            first += sum(map(len, self._places(rest, j)))
        return PeriodMap(matrix, n * s.dt, pushed, seen)

    def _at_rest(self, n: int) -> Copies | None:
        """The run after n steps; None where it moves."""
        rings = [self.row.arrays[x.name].reshape(1, -1).copy() for x in self.rings]
        x = Copies(self.row.state().view(layout.dtype_of(records.State)), rings)
        before = x.arrays[0][0, self.moving]
        self._advance(x, n)
        moves = np.abs(x.arrays[0][0, self.moving] - before) > LINEAR * KICK
        return None if moves.any() or x.states["code"][0] != path.OPEN else x

    def _matrix(self, rest: Copies, axes: tuple[int, ...], n: int) -> np.ndarray | None:
        """The map of some axes over n steps; None where it is not linear, or others act on them."""
        kicked = [self._places(rest, i) for i in axes]
        others = [self._places(rest, i) for i in (0, 1) if i not in axes]
        count = sum(len(at) for places in kicked for at in places)
        if count > MOST:
            return None
        x = rest.repeated(count + 1)
        kick(x, kicked, others)
        self._advance(x, n)
        before = [coordinates_at(rest, places) for places in kicked]
        after = [coordinates_at(x, self._places(x, i)) for i in axes]
        pairs = list(zip(before, after, strict=True))
        is_over = (x.states["code"] != path.OPEN).any()
        if is_over or any(a.shape[1] != b.shape[1] for a, b in pairs):
            return None
        return linear_map(np.concatenate([b - a for a, b in pairs], axis=1) / KICK)

    def _advance(self, x: Copies, n: int) -> None:
        x.states["row"] = 0
        self._add_elbow(x, 1.0)
        arrays = [self.row.arrays[ring.name].reshape(-1) for ring in self.rings]
        for k in range(len(x.states)):
            self.row.put_state(bytes_of(x.states[k : k + 1]))
            for array, ring in zip(arrays, x.rings, strict=True):
                array[:] = ring[k]
            self.row.advance(n)
            bytes_of(x.states[k : k + 1])[:] = self.row.state()
            for array, ring in zip(arrays, x.rings, strict=True):
                ring[k] = array
        self._add_elbow(x, -1.0)

    def _add_elbow(self, x: Copies, sign: float) -> None:
        """Adds the elbow's torque to the shoulder's, or takes it off: then both act on a link."""
        if not self.row.m.ratio:
            return
        numbers = x.arrays[0]
        numbers[:, self.torques[0]] += sign * numbers[:, self.torques[1]]
        for ring, array in zip(self.rings, x.rings, strict=True):
            if ring.name == "queue":
                entries = array.reshape(len(array), -1, ring.width)
                entries[:, :, 1] += sign * entries[:, :, 2]

    def _places(self, x: Copies, i: int) -> list[np.ndarray]:
        """Where the coordinates of an axis lie in the arrays of copies."""
        pairs, machine = zip(self.rings, x.rings, strict=True), x.states["now"][0]
        return [self.own[i], *(ring.places(machine, a.shape[1], i) for ring, a in pairs)]


def push_of(s: Scenario, q: tuple[float, float], i: int, j: int) -> tuple[float, float]:
    """Rate of joint j per velocity of the handle along axis i, and the reverse."""
    u = arm.jacobian(*q, s.arm.links)
    r1, r2 = arm.joint_velocity(float(i == 0), float(i == 1), u, 1.0)
    # the rate of joint 2 is that of link 2 less that of link 1
    return (r1, r2 - r1)[j], (u[i] + u[2 + i], u[2 + i])[j]


def coordinates_at(x: Copies, places: list[np.ndarray]) -> np.ndarray:
    """Coordinates of copies, shape (copies, n)."""
    return np.concatenate([a[:, at] for a, at in zip(x.arrays, places, strict=True)], axis=1)


def kick(x: Copies, places: list[list[np.ndarray]], others: list[list[np.ndarray]]) -> None:
    """Kicks copy j in the j-th of some coordinates, and the last copy in all."""
    j = 0
    for axis in places:
        for array, at in zip(x.arrays, axis, strict=True):
            array[np.arange(j, j + len(at)), at] += KICK
            j += len(at)
    for axis in (*places, *others):
        for array, at in zip(x.arrays, axis, strict=True):
            array[-1, at] += KICK


def linear_map(ends: np.ndarray) -> np.ndarray | None:
    """The map of copies that were kicked, shape (n, n); None where it is not linear."""
    each, missed = ends[:-1], np.abs(ends[:-1].sum(axis=0) - ends[-1])
    return each.T if (missed <= LINEAR * np.abs(each).sum(axis=0) + ROUNDED).all() else None
