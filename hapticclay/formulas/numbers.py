"""Whole numbers of floats, the same in CPython and in C."""

MOST = 9.0e15  # below 2^53: floats of this size still are whole numbers of their own


def whole(x):
    """The whole number of a float, towards zero; 0 for what has none."""
    return int(x) if -MOST < x < MOST else 0


def nearest(x):
    """The whole number nearest to x, as a float; of two equally near, the even one.

    A float without a fraction, an infinity and a NaN are returned as they are.
    """
    return float(round(x)) if -MOST < x < MOST else x
