"""Removed clay by points scattered over it."""

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree


class Volumes(NamedTuple):
    """Removed volumes [m^3]."""

    volume: list[float]


def volumes(path, cases, depth):
    """Volumes that a path takes, for each (profiles of x and y, width)."""
    return Volumes([raster(profiles, path, width, depth) for profiles, width in cases])


def raster(profiles, path, width, depth):
    """Volume by a million points or fewer, one anywhere in each square.

    Those in clay and within reach of the path count. Where an edge passes through n of the squares,
    it errs by some 0.3 sqrt(n) of them: 0.05 % here.
    """
    way = np.concatenate(((0.0,), np.cumsum(np.hypot(*np.diff(path, axis=0).T))))
    fine = np.union1d(way, np.linspace(0.0, way[-1], 2 + int(way[-1] / (0.01 * width))))
    points = np.column_stack([np.interp(fine, way, path[:, i]) for i in (0, 1)])
    low, high = path.min(axis=0) - 0.5 * width, path.max(axis=0) + 0.5 * width
    step = max(width / 200, np.sqrt(np.prod(high - low) / 1e6))
    x, y = (np.arange(low[i], high[i], step) for i in (0, 1))
    corners = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    here = corners + step * np.random.default_rng(1).uniform(size=corners.shape)
    at = [
        np.array(f.values)[np.searchsorted(f.edges, here[:, "xy".index(f.along)])] for f in profiles
    ]
    here = here[(at[0] > 0.0) | (at[1] > 0.0)]
    near = cKDTree(points).query(here, distance_upper_bound=0.5 * width)[0] <= 0.5 * width
    return near.sum() * step**2 * depth
