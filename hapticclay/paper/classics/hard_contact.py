"""An arm that meets a wall, under held forces: solved exactly from touch to touch."""

from __future__ import annotations

import cmath
import math

HALVINGS = 60  # of the time to a touch
TOUCHES = 8  # of a wall in a sample, at most
DOUBLE = 1e-9  # share: roots this near count as one


class WalledArm:
    """m x'' + b x' + k x = a held force, with a wall of stiffness K from x = 0 on.

    Attributes:
        x: position [m].
        v: rate [m/s].
        touch: force on the wall [N].
    """

    def __init__(self, m: float, b: float, k: float = 0.0, K: float = 0.0):
        self.m, self.b, self.k, self.K = m, b, k, K
        self.x = self.v = self.touch = 0.0

    def step(self, force: float, t: float) -> None:
        """Moves over a time under a force."""
        x, v, left = self.x, self.v, t
        for _ in range(TOUCHES):
            inside = x > 0.0 or (x == 0.0 and v > 0.0)
            k = self.k + self.K * inside
            found = moved(self.m, self.b, k, force, x, v, left)
            if self.K == 0.0 or (found[0] > 0.0) == inside:
                x, v = found
                break
            early, late = 0.0, left
            for _ in range(HALVINGS):
                middle = 0.5 * (early + late)
                if (moved(self.m, self.b, k, force, x, v, middle)[0] > 0.0) == inside:
                    early = middle
                else:
                    late = middle
            _, v = moved(self.m, self.b, k, force, x, v, late)
            x, left = 0.0, left - late
        self.x, self.v = x, v
        self.touch = self.K * max(x, 0.0)


def moved(
    m: float, b: float, k: float, f: float, x: float, v: float, t: float
) -> tuple[float, float]:
    """Position and rate of m x'' + b x' + k x = f after a time, in closed form."""
    if k == 0.0 and b == 0.0:
        return x + v * t + 0.5 * f / m * t * t, v + f / m * t
    if k == 0.0:
        end, fade = f / b, math.exp(-b / m * t)
        return x + end * t + (v - end) * m / b * (1.0 - fade), end + (v - end) * fade
    rest, half = f / k, 0.5 * b / m
    root = cmath.sqrt(half * half - k / m)
    away = x - rest
    if abs(root) < DOUBLE * half:
        fade, slope = math.exp(-half * t), v + half * away
        return rest + (away + slope * t) * fade, (v - half * slope * t) * fade
    p, q = -half + root, -half - root
    first = (v - q * away) / (p - q)
    last = away - first
    up, down = first * cmath.exp(p * t), last * cmath.exp(q * t)
    return rest + (up + down).real, (p * up + q * down).real
