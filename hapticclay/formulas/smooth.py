"""Damping that varies smoothly in space, by a cubic B-spline."""

from . import numbers


def smooth_damping(table, at, x, y):
    """Damping at a place by a cubic B-spline in each coordinate [N.s/m]; its slope is continuous.

    The value stays between the least and the largest control point. table: from
    `regions.region_table`; holds `Smooth.numbers` at index `at`.
    """
    most, rows = table[at + 2], table[at + 5]
    u = (x - table[at]) * table[at + 1]
    v = (y - table[at + 3]) * table[at + 4]
    # beyond, all four control points are equal; NaN also ends up here
    u = 0.0 if not u > 0.0 else most if u > most else u
    v = 0.0 if not v > 0.0 else rows if v > rows else v
    i, j = numbers.whole(u), numbers.whole(v)
    u, v = u - i, v - j
    n = numbers.whole(rows) + 4
    a = at + 6 + i * n + j
    b = a + n
    c = b + n
    d = c + n
    w = 1.0 - v
    k0, k3 = w * w * w, v * v * v
    k1 = 4.0 - 6.0 * v * v + 3.0 * k3
    k2 = 6.0 - k0 - k1 - k3
    w = 1.0 - u
    h0, h3 = w * w * w, u * u * u
    h1 = 4.0 - 6.0 * u * u + 3.0 * h3
    h2 = 6.0 - h0 - h1 - h3
    return (
        h0 * (k0 * table[a] + k1 * table[a + 1] + k2 * table[a + 2] + k3 * table[a + 3])
        + h1 * (k0 * table[b] + k1 * table[b + 1] + k2 * table[b + 2] + k3 * table[b + 3])
        + h2 * (k0 * table[c] + k1 * table[c + 1] + k2 * table[c + 2] + k3 * table[c + 3])
        + h3 * (k0 * table[d] + k1 * table[d + 1] + k2 * table[d + 2] + k3 * table[d + 3])
    ) / 36.0
