"""Clay that stays cut: what a tool removes from a grid, and its resistance."""

import math

from . import numbers

TOUCHING = 1e-6  # share of a cell: a gap this small ends the contact
SOFT = 2.0  # cells on each side of the tool's edge that are cut in part
STRIDE = 0.5  # largest motion between two cuts, in cells
# the front of the tool in sectors: by the share of |y| in |x| + |y| of their normals, in each
# quadrant; half of the angle of each [rad]
SECTORS = 16
HALF = tuple(
    0.5 * (math.atan2(k + 1.0, SECTORS - k - 1.0) - math.atan2(k, SECTORS - k))
    for k in range(SECTORS)
)
RIM = 4 * 4 * SECTORS  # numbers of the rim: four per sector, see `cut`


def outside(u):
    """Share of a cell that the tool leaves, 0 inside the tool and 1 outside, and its slope.

    u: distance of the cell's centre from the edge of the tool, in cells, positive outside. The
    slope is the cubic B-spline over the cells, which sums to 1 over any row of cells.
    """
    t = abs(u)
    if t >= SOFT:
        share, slope = 0.5, 0.0
    elif t > 1.0:
        t = 2.0 - t
        slope = t * t * t / 6.0
        share = 0.5 - 0.25 * t * slope
    else:
        slope = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t)
        share = t * (2.0 / 3.0 - t * t * (1.0 / 3.0 - 0.125 * t))
    return 0.5 + (share if u > 0.0 else -share), slope


def cut(grid, left, relief, x, y, disc, rim, removed):
    """Removes the clay under the tool at (x, y) [m], and records the clay that touches it.

    grid: Groove.numbers; left: remaining share, relief: height before the first cut [m] of each
    cell, row by row; disc: 1 to cut the whole disc, 0 for its edge only, after a motion of less
    than a cell. rim receives the clay in contact, four numbers per sector: sum of area x normal, x
    and y; area [m^2]; area x pressure [N]. removed: volume so far, and its rounding error [m^3].
    """
    x0, y0, wx, wy, nx, ny = grid[0], grid[1], grid[2], grid[3], grid[4], grid[5]
    r, cell, pressure, gradient, m = grid[6], grid[7], grid[8], grid[9], numbers.whole(grid[5])
    for j in range(RIM):
        rim[j] = 0.0
    outer, inner = r + SOFT * cell, r - SOFT * cell
    i0, i1 = (
        numbers.whole(max((x - outer - x0) / wx, 0.0)),
        numbers.whole(min((x + outer - x0) / wx, nx - 1.0)),
    )
    for i in range(i0, i1 + 1):
        dx = x0 + (i + 0.5) * wx - x
        far = outer * outer - dx * dx
        if far <= 0.0:
            continue
        far, near = math.sqrt(far), inner * inner - dx * dx
        near = 0.0 if disc or near <= 0.0 else math.sqrt(near)
        seen = -1
        for side in range(1 if near == 0.0 else 2):
            low, high = y - y0 + (near if side else -far), y - y0 + (far if side else -near)
            if near == 0.0:
                high = y - y0 + far
            j0, j1 = (
                max(numbers.whole(max(low / wy - 0.5, 0.0)), seen + 1),
                numbers.whole(min(high / wy, ny - 1.0)),
            )
            seen = j1
            for j in range(j0, j1 + 1):
                share = left[i * m + j]
                if share <= 0.0:
                    continue
                dy = y0 + (j + 0.5) * wy - y
                d = math.sqrt(dx * dx + dy * dy)
                stays, slope = outside((d - r) / cell)
                if stays >= 1.0:
                    continue
                height = relief[i * m + j]
                if stays < share:
                    left[i * m + j] = stays
                    add(removed, height * wx * wy * (share - stays))
                    share = stays
                engaged = slope * (1.0 - (stays - share) / TOUCHING)
                if engaged > 0.0 and height > 0.0:
                    area = engaged * height * wx * wy / cell
                    k = 4 * sector(dx, dy)
                    rim[k] += area * dx / d
                    rim[k + 1] += area * dy / d
                    rim[k + 2] += area
                    rim[k + 3] += area * (pressure + 0.5 * gradient * height)


def add(removed, volume):
    """Adds a volume >= 0 to a compensated sum and its rounding error (Neumaier)."""
    total = removed[0] + volume
    if removed[0] >= volume:
        removed[1] += removed[0] - total + volume
    else:
        removed[1] += volume - total + removed[0]
    removed[0] = total


def sector(x, y):
    """Number of the sector in which a direction other than (0, 0) lies."""
    ax, ay = abs(x), abs(y)
    k = min(numbers.whole(SECTORS * ay / (ax + ay)), SECTORS - 1)
    return k + (2 * SECTORS if x < 0.0 else 0) + (SECTORS if y < 0.0 else 0)


def resistance(rim, x, y):
    """Resistance to a motion in a direction of any length: force [N], engaged cross-section [m^2].

    It is that of the clay in front of the tool, projected on the direction; rim: from `cut`.
    """
    length = math.sqrt(x * x + y * y)
    force, area = 0.0, 0.0
    if length > 0.0:
        x, y = x / length, y / length
        for k in range(4 * SECTORS):
            whole = rim[4 * k + 2]
            if whole > 0.0:
                part = rim[4 * k] * x + rim[4 * k + 1] * y
                some = HALF[k % SECTORS] * whole
                if part < some:  # part of the sector faces away
                    part = (part + some) * (part + some) / (4.0 * some) if part > -some else 0.0
                area += part
                force += part * rim[4 * k + 3] / whole
    return force, area
