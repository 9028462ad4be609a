"""Copies of a run that differ in their states alone, and their steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..scene.scenario import Scenario
from ..stepping import many, path, scene, vector
from ..stepping.machine_code import kind_of
from ..stepping.parts import Parts
from ..stepping.run import PLAIN, EngineStore
from ..stepping.state import OPEN, State


class Copies(NamedTuple):
    """Copies of a run.

    Attributes:
        states: numbers of their states, see many.numbers_of, shape (copies, m).
        rings: numbers of each ring of the hardware, shape (copies, size) each.
    """

    states: np.ndarray
    rings: list[np.ndarray]

    def repeated(self, n: int) -> Copies:
        """Each copy n times.

        Args:
            n: how often.
        """
        states, *rings = (np.repeat(x, n, axis=0) for x in self.arrays)
        return Copies(states, rings)

    @property
    def arrays(self) -> list[np.ndarray]:
        """All numbers in which the copies may differ, shape (copies, size) each."""
        return [self.states, *self.rings]


def ring_of(parts: Parts, name: str) -> np.ndarray:
    """The ring of a part of the hardware.

    Args:
        parts: of a scene.
        name: of the part, a field of Sampler.
    """
    return getattr(parts.sampler, name).ring


def with_ring(parts: Parts, name: str, ring: np.ndarray) -> Parts:
    """The parts with another ring.

    Args:
        parts: of a scene.
        name: as in `ring_of`.
        ring: the other one.
    """
    part = getattr(parts.sampler, name)._replace(ring=ring)
    return parts._replace(sampler=parts.sampler._replace(**{name: part}))


def leaves_of(like: Any, kind: Any) -> Callable[[Any], list[Any]]:
    """A function that lists the leaves of nested tuples, five times as fast as a recursion.

    Args:
        like: tuples of the same shape.
        kind: type of the leaves, or types.
    """
    paths = ("x" + "".join(f"[{i}]" for i in path) for path in _paths(like, kind))
    return eval(f"lambda x: [{', '.join(paths)}]")


def _paths(part: Any, kind: Any) -> Iterator[tuple[int, ...]]:
    """Indices that lead to each leaf."""
    if isinstance(part, kind):
        yield ()
    elif isinstance(part, tuple):
        for i, x in enumerate(part):
            yield from ((i, *path) for path in _paths(x, kind))


class PlainSteps:
    """Makes steps of copies in CPython.

    Args:
        store: engines to use.
        s: a scene of their kind.
        parts: of the scene.
        state: of their kind.
        rings: names of the parts that have a ring.
    """

    def __init__(
        self, store: EngineStore, s: Scenario, parts: Parts, state: State, rings: Sequence[str]
    ):
        self.state, self.rings, self.parts = state, rings, parts
        model, data = store.engine(s)
        self.limits, self.e = model.actuator_ctrlrange, store.arrays(parts, model, data, PLAIN)

    def take(self, parts: Parts) -> None:
        """Takes another scene.

        Args:
            parts: of the scene.
        """
        self.parts = parts

    def advance(self, x: Copies, n: int) -> None:
        """Makes n steps of each copy.

        Args:
            x: copies of a run of the scene.
            n: number of steps.
        """
        for k, row in enumerate(x.states):
            parts = self.parts
            for name, ring in zip(self.rings, x.rings, strict=True):
                parts = with_ring(parts, name, ring[k])
            parts, s = scene.viewed(parts), vector.unpacked(self.state, iter(row.tolist()))
            vector.readied(parts, s, self.e, self.limits)
            while s.status.code == OPEN and path.has_room(parts.time, s, self.e, n):
                s = path.advance(parts, s, self.e, n)
            row[:] = many.numbers_of(s)


class CompiledSteps:
    """As PlainSteps, by machine code, with the same bits.

    Args:
        store: engines to use.
        s: a scene of their kind.
        parts: of the scene.
        state: of their kind.
        rings: names of the parts that have a ring.
        most: copies that are advanced together.
    """

    def __init__(
        self, store: EngineStore, s: Scenario, parts: Parts, state: State, rings: Sequence[str],
        most: int,
    ):  # fmt: skip
        from ..stepping import compiled, own_law

        self.called, self.rings, self.store = own_law.called, rings, store
        model, data = store.engine(s)
        engine, like = store.arrays(parts, model, data, compiled.KERNEL), self.called(parts)
        c = vector.Common(most)
        c.kept[:, :2] = self.store.rows.ctypes.data, self.store.rendered.ctypes.data
        self.numbers, self.arrays = leaves_of(like, float | int), leaves_of(like, np.ndarray)
        arrays = self.arrays(parts)
        self.at = [
            3 * next(j for j, a in enumerate(arrays) if a is ring_of(parts, x)) for x in rings
        ]
        addresses = 3 * len(arrays)
        self.x = vector.Vector(
            np.zeros((most, len(self.numbers(like)))), np.zeros((most, addresses), np.int64),
            np.zeros((most, len(many.numbers_of(state)))), np.zeros((most, 0), np.int64), c.kept,
            c.until, c.looked, c.marks, c.times, c.quiet, c.swings, c.seen, c.shown,
        )  # fmt: skip
        self.which = np.arange(most)
        place = vector.Place(engine, model.actuator_ctrlrange, np.empty(1))
        self.arguments = like, state, place, self.x
        kind = vector.kind_of_steps(kind_of(parts), state)
        self.make = compiled.advancing(kind, *self.arguments, self.which[:0], vector.STEPS)

    def take(self, parts: Parts) -> None:
        """Takes another scene.

        Args:
            parts: of the scene.
        """
        parts = self.called(parts)
        self.x.numbers[:] = self.numbers(parts)
        self.x.arrays[:] = vector.addresses_of(self.arrays(parts))
        self.parts = parts  # whose arrays the rows point at

    def advance(self, x: Copies, n: int) -> None:
        """Makes n steps of each copy.

        Args:
            x: copies of a run of the scene.
            n: number of steps.
        """
        rows, count = self.x, len(x.states)
        which = self.which[:count]
        for at, ring in zip(self.at, x.rings, strict=True):
            rows.arrays[:count, at] = ring.ctypes.data + ring.strides[0] * which
        rows.states[:count], rows.until[:count] = x.states, n
        self.make(*self.arguments, which, vector.STEPS)
        x.states[:] = rows.states[:count]


def compiled_steps(*arguments: Any) -> CompiledSteps | None:
    """Steps by machine code; None where it cannot be had.

    Args:
        *arguments: of `CompiledSteps`.
    """
    from ..stepping.compiled import Unavailable

    try:
        return CompiledSteps(*arguments)
    except Unavailable:
        return None
