"""Signals as tables of numbers: rows of cosines, and rows of cubics in time."""

import math

from . import numbers

PIECE = 9  # numbers of a row


def mean_of_lines(table, t, h):
    """Mean of the multisines of a table over [t - h, t + h], (x, y), line by line."""
    x, y = 0.0, 0.0
    for j in range(1, 1 + numbers.whole(table[0])):
        a = table[PIECE * j] * h
        share = math.sin(a) / a if a else 1.0
        x += table[PIECE * j + 3] * (share * math.cos(table[PIECE * j] * t + table[PIECE * j + 1]))
        y += table[PIECE * j + 4] * (share * math.cos(table[PIECE * j] * t + table[PIECE * j + 2]))
    return x, y


def has_pieces(table):
    """Whether a table has pieces."""
    return numbers.whole(table[2]) > 1 + numbers.whole(table[0])


def piece_at(table, t):
    """Row of the piece that is valid at a time."""
    low, high = 1 + numbers.whole(table[0]), numbers.whole(table[2])
    while high - low > 1:
        middle = (low + high) // 2
        if table[PIECE * middle] <= t:
            low = middle
        else:
            high = middle
    return low


def mean_of_piece(table, j, t, h):
    """Mean of the cubic in row j over [t - h, t + h], (x, y)."""
    u, k = t - table[PIECE * j], h * h
    x = table[PIECE * j + 1] + u * (
        table[PIECE * j + 2] + u * (table[PIECE * j + 3] + u * table[PIECE * j + 4])
    )
    y = table[PIECE * j + 5] + u * (
        table[PIECE * j + 6] + u * (table[PIECE * j + 7] + u * table[PIECE * j + 8])
    )
    x += k * (table[PIECE * j + 3] / 3.0 + table[PIECE * j + 4] * u)
    y += k * (table[PIECE * j + 7] / 3.0 + table[PIECE * j + 8] * u)
    return x, y


def value_of_pieces(table, t, near):
    """Value of the pieces of a table at a time, (x, y), by the piece valid at a time near it."""
    return mean_of_piece(table, piece_at(table, near), t, 0.0)


def mean_of_pieces(table, t, h):
    """Mean of the pieces of a table over [t - h, t + h], (x, y); for h = 0 the value from t on."""
    if h == 0.0:
        return value_of_pieces(table, t, t + table[1])
    begin, end, n = t - h, t + h, numbers.whole(table[2])
    j = piece_at(table, begin)
    if j + 1 == n or table[PIECE * (j + 1)] >= end:
        return mean_of_piece(table, j, t, h)
    x, y = 0.0, 0.0
    while begin < end:
        stop = end if j + 1 == n else min(end, table[PIECE * (j + 1)])
        ax, ay = mean_of_piece(table, j, 0.5 * (begin + stop), 0.5 * (stop - begin))
        share = 0.5 * (stop - begin) / h
        x += share * ax
        y += share * ay
        begin = stop
        j += 1
    return x, y


def mean_of_table(table, t, h):
    """Mean of a signal over [t - h, t + h], (x, y); for h = 0 the value from t on."""
    x, y = mean_of_lines(table, t, h)
    if has_pieces(table):
        ax, ay = mean_of_pieces(table, t, h)
        x += ax
        y += ay
    return x, y


def value_of_table(table, t, near):
    """Value of a signal at a time, (x, y); at a jump, the limit from the side of `near`."""
    x, y = mean_of_lines(table, t, 0.0)
    if has_pieces(table):
        ax, ay = value_of_pieces(table, t, near)
        x += ax
        y += ay
    return x, y
