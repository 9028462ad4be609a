"""The linear map of small motions over one period, from the steps of a run.

The handle is at rest. Each coordinate of the state is kicked in a copy of the run, and all copies
make the steps of one period: of a control sample, or of one step where control is continuous.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..model import arm
from ..scene.scenario import Scenario
from ..stepping import many, scene
from ..stepping.hardware import QUEUED
from ..stepping.machine_code import kind_of, leaves
from ..stepping.memories import delay_in_samples
from ..stepping.parts import Parts
from ..stepping.run import PLAIN, EngineStore, with_checked
from ..stepping.state import OPEN, State
from ..stepping.vector import kind_of_steps
from . import engines
from .copies import Copies, PlainSteps, compiled_steps, leaves_of, ring_of

KICK = 1e-6  # in SI units: the squares of angles are 1e-6 of it, their rounding is 1e-10 of it
LINEAR = 1e-4  # share of the ends by which that of all kicks may miss the sum of those of each
ROUNDED = 1e-8  # of an end, per kick
MOST = 100  # coordinates of a scene
SETTLED = 1  # periods after which each step follows a whole one
KINDS = 8  # of scenes, kept ready


class PeriodMap(NamedTuple):
    """The linear map of small motions over one period: z(k+1) = matrix z(k).

    It has the coordinates of one axis, or of both where the other one acts on it.

    Attributes:
        matrix: shape (n, n).
        period: its length [s].
        pushed: z for a unit velocity of the handle along the axis, shape (n,).
        seen: velocity of the handle along the axis per unit of z, shape (n,).
    """

    matrix: np.ndarray
    period: float
    pushed: np.ndarray
    seen: np.ndarray


class PeriodMaps:
    """The maps of scenes.

    Args:
        expected: about how many; many of a kind repay machine code.
    """

    def __init__(self, expected: int):
        self.expected, self.kinds = expected, dict[Any, MapsOfKind]()

    def of(self, s: Scenario, i: int) -> PeriodMap | None:
        """The map of a scene around its start, at rest.

        Args:
            s: the scene; its velocity and constant force are ignored.
            i: index of the axis, 0 or 1.

        Returns:
            The map; None where small motions are not linear or differ between periods, and for
            more than MOST coordinates.
        """
        end = (MOST + SETTLED) * (s.Ts or s.dt)  # longer than any map takes
        s = with_checked(s, velocity=(0.0, 0.0), force=(0.0, 0.0), t_max=end, length=None)
        parts = scene.parts_of(s)
        warm = warm_periods(parts)
        if not has_map(s, parts) or warm + 1 > MOST:
            return None
        key = kind_of(parts), s.arm, s.clay and s.clay.angle, s.hardware is None
        if key not in self.kinds:
            if len(self.kinds) >= KINDS:
                del self.kinds[next(iter(self.kinds))]
            self.kinds[key] = MapsOfKind(s, parts, self.expected)
        return self.kinds[key].of(s, parts, i, warm)


# ---- which scenes have a map ---------------------------------------------------------------------


def has_map(s: Scenario, parts: Parts) -> bool:
    """Whether small motions of a scene are linear, and alike in each period.

    Args:
        s: the scene.
        parts: of the scene.
    """
    x, special, clay = parts.sampler, parts.special, parts.clay
    if s.driven or parts.accurate is not None or (clay is not None and clay.growth is not None):
        return False
    if special is not None and any((special.smooth, special.flow, special.groove, special.more)):
        return False
    uneven = () if x is None else (x.encoder, x.chance, x.adc, x.dac, x.friction, x.passivity)
    return all(part is None for part in uneven)


def warm_periods(parts: Parts) -> int:
    """Periods after which the rings of the hardware are full.

    Args:
        parts: of the scene.
    """
    x = parts.sampler
    if x is None:
        return SETTLED
    window = 0 if x.difference is None else x.difference.velocity_window
    late = -1 if x.delay is None else delay_in_samples(x.delay.delay, x.Ts)[0]
    return max(SETTLED, window, late + 1)


# ---- coordinates ---------------------------------------------------------------------------------


class Ring(NamedTuple):
    """Numbers of past samples on which the next ones depend.

    Attributes:
        part: of the sampler, which has it.
        first: which number of the state gives its first row.
        filled: which number of the state gives the number of its rows; None where all count.
        width: numbers of a row.
        columns: those of them that are coordinates of x, and of y.
    """

    part: str
    first: int
    filled: int | None
    width: int
    columns: tuple[tuple[int, ...], tuple[int, ...]]

    def places(self, state: np.ndarray, size: int, i: int) -> np.ndarray:
        """Where the coordinates of an axis lie.

        Args:
            state: numbers of a state.
            size: of the ring.
            i: index of the axis.
        """
        rows = size // self.width
        count = rows if self.filled is None else int(state[self.filled])
        row = (int(state[self.first]) + np.arange(count)) % rows
        return (row[:, None] * self.width + np.array(self.columns[i])).ravel()


def coordinates(at: State, i: int) -> list[int]:
    """The numbers of a state that change in small motions along an axis.

    Link i moves the handle along axis i at the nominal pose. Angle and rate of its joint come
    first.

    Args:
        at: the state with the index in `many.numbers_of` in place of each number.
        i: index of the axis.
    """
    x = at.clay.laws and at.clay.laws.elastic
    springs = x and (x.rest[i], x.stretch[i], x.at[i], x.force[i], x.before[i])
    owed = at.clay.reaction and at.clay.reaction.owed
    loop = controller_of(at.loop, i)
    found = leaves((at.body.q[i], at.body.w[i], loop, owed and owed[i], springs))
    return [x for x in found if x is not None]


def controller_of(loop: Any, i: int) -> Any:
    """The part of `coordinates` in controller and hardware.

    Args:
        loop: of a state.
        i: index of the axis.
    """
    if not hasattr(loop, "machine"):
        return (loop.x, loop.y)[i], loop.form and loop.form[i]
    m = loop.machine
    wires = m.hold.tau[i], m.rates and m.rates.w[i], m.filtered and m.filtered[2 * i : 2 * i + 2]
    if m.own is not None:
        return wires, m.own if i == 0 else None
    pull = m.hold.pull and (m.hold.pull.f[i], m.hold.pull.u[i])
    form = m.form and (m.form.x, m.form.y)[i]
    return wires, (m.x, m.y)[i], form, pull, m.tool and m.tool[i]


def rings_of(parts: Parts, at: State) -> list[Ring]:
    """The rings of the hardware.

    Args:
        parts: of the scene.
        at: as in `coordinates`.
    """
    x, found = parts.sampler, []
    if x is not None and x.difference is not None:
        found.append(Ring("difference", at.loop.machine.rates.oldest, None, 3, ((1,), (2,))))
    if x is not None and x.delay is not None:
        queue = at.loop.machine.queue
        columns = ((1,), (2,)) if x.coupling is None else ((1, 7, 9), (2, 8, 10))
        found.append(Ring("delay", queue.first, queue.n, QUEUED, columns))
    return found


# ---- the map -------------------------------------------------------------------------------------


class MapsOfKind:
    """The maps of scenes of one kind.

    Args:
        s: one of them.
        parts: of it.
        expected: number of maps.
    """

    def __init__(self, s: Scenario, parts: Parts, expected: int):
        self.store = EngineStore()
        self.e = self.store.arrays(parts, *self.store.engine(s), PLAIN)
        state = self._start(s, parts)
        at, self.numbers = many.places(state), leaves_of(state, float | int)
        self.own, self.rings = [np.array(coordinates(at, i)) for i in (0, 1)], rings_of(parts, at)
        self.moving = np.array([*leaves((at.body.q, at.body.w))])
        machine = getattr(at.loop, "machine", None)
        self.torques = None if machine is None else machine.hold.tau
        self.filled, self.code = at.filled.rows, at.status.code
        self.coupled = False  # whether one axis has acted on the other
        names = [x.part for x in self.rings]
        steps = expected * len(self.own[0]) * steps_of_period(parts)
        self.steps: Any = None
        if repays(s, parts, state, steps):
            self.steps = compiled_steps(self.store, s, parts, state, names, MOST + 1)
        if self.steps is None:
            self.steps = PlainSteps(self.store, s, parts, state, names)

    def _start(self, s: Scenario, parts: Parts) -> State:
        return scene.start(parts, s, self.e)

    def of(self, s: Scenario, parts: Parts, i: int, warm: int) -> PeriodMap | None:
        """The map of a scene.

        Args:
            s: the scene, at rest.
            parts: of the scene.
            i: index of the axis.
            warm: periods before the one of the map.
        """
        state, n = self._start(s, parts), steps_of_period(parts)
        self.steps.take(parts)
        rest = self._at_rest(parts, state, warm * n)
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
            pushed[first + 1], seen[first + 1] = push_of(s, state, i, j)
            first += sum(map(len, self._places(rest, j)))
        return PeriodMap(matrix, n * s.dt, pushed, seen)

    def _at_rest(self, parts: Parts, state: State, n: int) -> Copies | None:
        """The run after n steps; None where it moves."""
        rings = [ring_of(parts, x.part)[None] for x in self.rings]
        x = Copies(np.array([self.numbers(state)], float), rings)
        before = x.states[0, self.moving]
        self._advance(x, n)
        moves = np.abs(x.states[0, self.moving] - before) > LINEAR * KICK
        return None if moves.any() or x.states[0, self.code] != OPEN else x

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
        if (x.states[:, self.code] != OPEN).any():
            return None
        if any(a.shape[1] != b.shape[1] for a, b in zip(before, after, strict=True)):
            return None
        pairs = zip(before, after, strict=True)
        return linear_map(np.concatenate([b - a for a, b in pairs], axis=1) / KICK)

    def _advance(self, x: Copies, n: int) -> None:
        x.states[:, self.filled] = 0.0
        self._add_elbow(x, 1.0)
        self.steps.advance(x, n)
        self._add_elbow(x, -1.0)

    def _add_elbow(self, x: Copies, sign: float) -> None:
        """Adds the elbow's torque to the shoulder's, or takes it off: then both act on a link."""
        if self.torques is not None:
            x.states[:, self.torques[0]] += sign * x.states[:, self.torques[1]]
        for ring, array in zip(self.rings, x.rings, strict=True):
            if ring.part == "delay":
                entries = array.reshape(len(array), -1, ring.width)
                entries[:, :, 1] += sign * entries[:, :, 2]

    def _places(self, x: Copies, i: int) -> list[np.ndarray]:
        """Where the coordinates of an axis lie in the arrays of copies."""
        pairs = zip(self.rings, x.rings, strict=True)
        return [self.own[i], *(ring.places(x.states[0], a.shape[1], i) for ring, a in pairs)]


def steps_of_period(parts: Parts) -> int:
    """Engine steps of a period.

    Args:
        parts: of the scene.
    """
    return 1 if parts.sampler is None else parts.sampler.ratio


def push_of(s: Scenario, state: State, i: int, j: int) -> tuple[float, float]:
    """Rate of joint j per velocity of the handle along axis i, and the reverse.

    Args:
        s: the scene.
        state: at its start.
        i: index of the axis.
        j: index of the joint.
    """
    q1, q2 = state.body.q
    u = arm.jacobian(q1, q2, s.arm.links)
    r1, r2 = arm.joint_velocity(float(i == 0), float(i == 1), u, 1.0)
    # the rate of joint 2 is that of link 2 less that of link 1
    return (r1, r2 - r1)[j], (u[i] + u[2 + i], u[2 + i])[j]


def repays(s: Scenario, parts: Parts, state: State, steps: float) -> bool:
    """Whether machine code repays itself, and can be had.

    Args:
        s: a scene.
        parts: of it.
        state: of it.
        steps: that are about to be made.
    """
    kind, more = kind_of_steps(kind_of(parts), state), engines.saved_in_a_step(s) * steps
    return engines.repays_with(kind, more) and engines.load_compiled() is not None


def coordinates_at(x: Copies, places: list[np.ndarray]) -> np.ndarray:
    """Coordinates of copies, shape (copies, n).

    Args:
        x: the copies.
        places: where they lie, in each array.
    """
    return np.concatenate([a[:, at] for a, at in zip(x.arrays, places, strict=True)], axis=1)


def kick(x: Copies, places: list[list[np.ndarray]], others: list[list[np.ndarray]]) -> None:
    """Kicks copy j in the j-th of some coordinates, and the last copy in all.

    Args:
        x: the copies.
        places: of these coordinates: by axis, in each array.
        others: of those that are kicked in the last copy alone.
    """
    j = 0
    for axis in places:
        for array, at in zip(x.arrays, axis, strict=True):
            array[np.arange(j, j + len(at)), at] += KICK
            j += len(at)
    for axis in (*places, *others):
        for array, at in zip(x.arrays, axis, strict=True):
            array[-1, at] += KICK


def linear_map(ends: np.ndarray) -> np.ndarray | None:
    """The map of copies that were kicked, shape (n, n); None where it is not linear.

    Args:
        ends: coordinates a period later, less those at rest, per kick: of the copies that were
            kicked in one coordinate, and of the one kicked in all, shape (n + 1, n).
    """
    each, missed = ends[:-1], np.abs(ends[:-1].sum(axis=0) - ends[-1])
    return each.T if (missed <= LINEAR * np.abs(each).sum(axis=0) + ROUNDED).all() else None
