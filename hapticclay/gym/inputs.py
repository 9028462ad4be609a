"""Checks of what a caller gives: actions, seeds, options of a reset, arguments of a constructor."""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from ..arguments import UnknownArgument, known_names
from ..errors import ParameterError, integer
from .task import Task

SEEDS = 2**128 - 1  # the largest seed; Gymnasium itself draws seeds of 128 bits
T = TypeVar("T", bound=Task)


def action_of(field: str, given: Any, shape: tuple[int, ...]) -> np.ndarray:
    """An action as numbers, float64; they may lie outside of the action space."""
    try:
        action = np.asarray(given)
    except (TypeError, ValueError):  # rows of unequal length
        raise ParameterError(field, given, f"must be numbers of shape {shape}") from None
    if action.shape != shape:
        raise ParameterError(field, given, f"must have shape {shape}, has {action.shape}")
    if action.dtype.kind not in "fiu":
        bound = f"must be real numbers, as float32, not of dtype {action.dtype}"
        raise ParameterError(field, given, bound)
    numbers = action.astype(np.float64)
    if not math.isfinite(np.vdot(numbers, numbers)):  # a quick look: large numbers overflow, too
        bad = np.argwhere(~np.isfinite(numbers))
        for place in map(tuple, bad[:1].tolist()):
            at = ", ".join(map(str, place))
            raise ParameterError(f"{field}[{at}]", action[place].item(), "must be a finite number")
    return numbers


def seed_of(field: str, given: Any) -> int | None:
    """A seed, a whole number of at most 128 bits; None for none."""
    if given is None:
        return None
    try:
        return integer(field, given, 0, SEEDS)
    except ParameterError:
        bound = "must be a whole number from 0 to 2**128 - 1, or None"
        raise ParameterError(field, given, bound) from None


def seeds_of(given: Any, n: int) -> list[int | None]:
    """The seed of each copy."""
    if given is None:
        return [None] * n
    if isinstance(given, np.ndarray):
        given = given.tolist()
    if isinstance(given, Sequence) and not isinstance(given, str | bytes):
        seeds = list(given)
        if len(seeds) != n:
            raise ParameterError("seed", given, f"must be a number, or {n} of them")
        return [seed_of(f"seed[{i}]", x) for i, x in enumerate(seeds)]
    first = seed_of("seed", given)
    assert first is not None
    seed_of("seed of the last copy", first + n - 1)
    return [first + i for i in range(n)]


def options_of(given: Any) -> dict[str, Any]:
    """Options of a reset, by name."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        bound = "must be a dictionary of values by name, as {'mass': 0.3}, or None"
        raise ParameterError("options", given, bound)
    return dict(given)


def task_of(kind: type[T], ranges: Any, options: Mapping[str, Any], owner: Any) -> T:
    own = [f.name for f in dataclasses.fields(kind) if f.init and f.name != "given"]
    parameters = inspect.signature(owner.__init__).parameters.values()
    others = [p.name for p in parameters if p.kind is not p.VAR_KEYWORD]
    try:
        known_names(type(owner).__name__, options, own + others)
    except UnknownArgument as error:  # Gymnasium makes each TypeError again, of its text alone
        raise ParameterError(error.field, error.value, error.bound) from None
    return kind(ranges, **options)
