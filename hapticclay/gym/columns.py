"""Operations on the numbers of one copy, or on columns with one value per copy.

The formulas of a task are written with these functions and with +, -, * and /. They give each copy
the same bits, alone or among others: NumPy is used for exact operations only, and `math`, value by
value, for all others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

Value = Any  # number or bool of one copy, or an array over copies, shape (n,)
Pair = tuple[Value, Value]  # (x, y)


def where(condition: Value, a: Value, b: Value) -> Value:
    """a where the condition holds, else b."""
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b)
    return a if condition else b


def negated(condition: Value) -> Value:
    """Whether a condition does not hold."""
    return ~condition if isinstance(condition, np.ndarray) else not condition


def clipped(x: Value, low: Value, high: Value) -> Value:
    """x, at least low and at most high; NaN stays NaN."""
    if isinstance(x, np.ndarray):
        return np.where(x < low, low, np.where(x > high, high, x))
    return low if x < low else high if x > high else x


def observed(x: Value, low: Value, high: Value) -> Value:
    """x, at least low and at most high; 0 in place of NaN."""
    return where(x == x, clipped(x, low, high), 0.0)


def root(x: Value) -> Value:
    """Square root."""
    return np.sqrt(x) if isinstance(x, np.ndarray) else math.sqrt(x)


def each(f: Callable[[float], float], x: Value) -> Value:
    """f(x), value by value."""
    return np.array([f(value) for value in x.tolist()]) if isinstance(x, np.ndarray) else f(x)


def entry(table: Any, i: Value) -> Value:
    """Entry i of each copy's table."""
    return table[np.arange(len(i)), i] if isinstance(i, np.ndarray) else table[i]


def columns_of(rows: Sequence[Any]) -> Any:
    """The values of several copies as columns; tuples stay tuples, and None stays None."""
    first = rows[0]
    if isinstance(first, tuple):
        return tuple(columns_of(x) for x in zip(*rows, strict=True))
    return None if first is None else np.array(rows)


def replaced(columns: Any, which: Sequence[int], new: Any) -> Any:
    """Columns with the values of some copies replaced."""
    if isinstance(new, tuple):
        return tuple(replaced(x, which, y) for x, y in zip(columns, new, strict=True))
    if new is None:
        return None
    made = columns.copy()
    made[which] = new
    return made


def value_of(columns: Any, i: int) -> Any:
    """The values of one copy."""
    if isinstance(columns, tuple):
        return tuple(value_of(x, i) for x in columns)
    return None if columns is None else columns[i]
