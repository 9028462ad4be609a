"""What regularised laws cost where clay yields: they creep below the yield force, and are stiff.

    python -m benchmarks.regularised

A slider of 1.25 kg in Bingham clay, pushed with nine tenths of the yield force after it was thrown
in. The exact law is the package's; the two usual substitutes, bi-viscous and Papanastasiou's
(J. Rheology 31, 1987), are solved here, for this comparison alone: SciPy's implicit Radau method
without the package, at the largest damping b_max that they have at rest.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable

import numpy as np
from scipy.integrate import solve_ivp
from tabulate import tabulate

import hapticclay as hc

M, FY, B, V0, PUSH = 1.25, 2.0, 5.0, 0.2, 1.8  # kg, N, N.s/m, m/s, N
HOLD = 10.0  # [s]
B_MAX = (1e3, 1e4, 1e5, 1e6, 1e7)  # [N.s/m]


def biviscous(v: float, most: float) -> float:
    """Bi-viscous law: a damper of b_max up to where the Bingham law takes over [N].

    Args:
        v: velocity [m/s].
        most: b_max [N.s/m].
    """
    return math.copysign(min(most * abs(v), FY + B * abs(v)), v)


def papanastasiou(v: float, most: float) -> float:
    """Papanastasiou's law, f = Fy (1 - exp(-|v|/u)) sign v + b v [N].

    Args:
        v: velocity [m/s].
        most: b_max [N.s/m], Fy/u + b.
    """
    return math.copysign(-FY * math.expm1(-abs(v) * (most - B) / FY), v) + B * v


def substitute(
    law: Callable[[float, float], float], most: float
) -> tuple[float, float, int, float]:
    """A run with a regularised law.

    Args:
        law: force of (v, b_max).
        most: b_max [N.s/m].

    Returns:
        (place after HOLD [m], speed there [m/s], evaluations of the law, wall time [s]).
    """
    begin = time.perf_counter()
    out = solve_ivp(
        lambda t, y: [y[1], (PUSH - law(y[1], most)) / M],
        (0.0, HOLD), [0.0, V0], "Radau", rtol=1e-9, atol=1e-13,
    )  # fmt: skip
    return out.y[0, -1], out.y[1, -1], out.nfev, time.perf_counter() - begin


def exact(dt: float) -> tuple[float, float, int, float]:
    """As `substitute`, by the package.

    Args:
        dt: step [s].
    """
    free = hc.free()
    servo = tuple(hc.Servo(x.G, hc.SecondOrder(1.0 / M, 1e-9, 1e-9)) for x in free.servo)
    scene = hc.Scenario(
        clay=hc.slab(hc.Flow(Fy=FY, b=B)), gain=(0.0, 0.0), inertia_shaping=True, force=(PUSH, 0.0),
        servo=(servo[0], servo[1]), velocity=(V0, 0.0), start=(0.02, 0.0), dt=dt, t_max=HOLD,
        compensator=hc.Compensator((1.0,), (1.0, 0.0, 0.0)), length=None, stop_when_unstable=False,
    )  # fmt: skip
    begin = time.perf_counter()
    r = hc.simulate(scene)
    return r.p[-1, 0] - 0.02, r.v[-1, 0], r.steps, time.perf_counter() - begin


def way() -> float:
    """The way to the stop in closed form, under PUSH [m]."""
    net = FY - PUSH
    return M * V0 / B - M * net / B**2 * math.log(1.0 + B * V0 / net)


def rows() -> Iterable[list[object]]:
    """A row a law: name, b_max, creep at the end, error of the place, work, time."""
    hc.simulate_batch([hc.free()])
    for dt in (1e-2, 1e-3):
        x, v, n, wall = exact(dt)
        yield [f"exact, dt = {dt:g} s", "", v, x - way(), n, wall]
    for law in (biviscous, papanastasiou):
        for most in B_MAX:
            x, v, n, wall = substitute(law, most)
            yield [law.__name__, most, v, x - way(), n, wall]


def main() -> None:
    """Prints the table."""
    head = ["law", "b_max [N.s/m]", "creep [m/s]", "error of the place [m]", "steps", "time [s]"]
    print(tabulate(rows(), head, floatfmt=".2g"))
    slow = (PUSH / np.array(B_MAX)).tolist()
    print("\nexpected creep of the bi-viscous law, F/b_max:", *(f"{x:.2g}" for x in slow))


if __name__ == "__main__":
    main()
