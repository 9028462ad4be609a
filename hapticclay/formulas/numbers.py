"""Operations on floats that CPython refuses, or makes otherwise than C: both give what C gives."""

import math

MOST = 9.0e15  # below 2^53: floats of this size still are whole numbers of their own


def whole(x):
    """The whole number of a float, towards zero; 0 for what has none."""
    return int(x) if -MOST < x < MOST else 0


def ratio(x, y):
    """x / y, also where y is 0: infinite, or NaN."""
    if y == 0.0:
        return math.copysign(math.inf, x) * math.copysign(1.0, y) if x == x and x else math.nan
    return x / y


def power(x, y):
    """x to the power y, also where it is beyond the floats, or not real: infinite, or NaN."""
    if x < 0.0 and y % 1.0:
        return math.nan
    if x == 0.0 and y < 0.0:
        return math.inf
    try:
        return x**y
    except OverflowError:
        return -math.inf if x < 0.0 and y % 2.0 else math.inf


def root(x):
    """Square root of x; NaN below 0."""
    return math.sqrt(x) if x >= 0.0 else math.nan


def nearest(x):
    """The whole number nearest to x, as a float; of two equally near, the even one.

    A float without a fraction, an infinity and a NaN are returned as they are.
    """
    return float(round(x)) if -MOST < x < MOST else x
