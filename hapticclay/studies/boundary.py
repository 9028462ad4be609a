"""The boundary of stability found by running the arm, beside the analytic ones; why they differ where they do."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ..errors import choice, flag, number, pair
from ..model import arm, controller
from ..model.clay import Clay, Profile
from ..model.constants import AXES, B_MAX, C_POLE, NOMINAL, TORQUE_LIMIT, TS, G, S
from ..model.hardware import Interface
from ..model.operator import NO_HAND, Operator
from ..model.scenario import Scenario
from ..simulation.record import Record
from ..simulation.simulate import simulate
from ..theory import gain_limit

SMALL_PUSH = 1e-4  # [m/s] a push that leaves the arm linear
LARGE_PUSH = 0.05  # [m/s] one that a hand gives
SPAN = 1.2  # [s] a run that is to be judged by its growth ...
LONG = (
    2.0,
    8.0,
    32.0,
)  # ... and one that is to be told apart, longer while its motors are in their limits
FIT = 0.7  # share of a run, its end, that growth is read from
POSE_STEP = 4e-3  # [s] between the samples that it is read from
RANK = 1e-7  # singular values below this share of the largest are rounding
FAINT = 1e-4  # so are modes below this share of the strongest
SLOW = 1.0  # [rad/s, 1/s] the hand's spring drags the handle back slower than this: no oscillation
CLOSE = 2e-3  # boundaries are found to this share


@dataclass(frozen=True)
class Loop:
    """One loop to be tried: the handle pushed along one axis, in clay all around it.

    Attributes:
        axis: "x" or "y"; the other axis has no compensator. K: gain. b: clay on both axes [N.s/m].
        operator: arm at the handle; None for Th = 0.
        Ts: control sample [s]; None for continuous time. delay: of the motors, a sampled loop's [s].
        shaping: as in Scenario. pose: where the handle is, from its nominal position [m].
        push: its velocity at the start [m/s]. torque_limit: [N.m].
    """

    axis: str = "x"
    K: float = 1.0
    b: float = 90.0
    operator: Operator | None = Operator()
    Ts: float | None = None
    delay: float = 0.0
    shaping: bool = True
    pose: tuple[float, float] = (0.0, 0.0)
    push: float = SMALL_PUSH
    torque_limit: tuple[float, float] = TORQUE_LIMIT

    def __post_init__(self):
        choice("axis", self.axis, AXES)
        flag("shaping", self.shaping)
        object.__setattr__(self, "K", number("K", self.K, 0.0, 1e6, above=True))
        object.__setattr__(self, "b", number("b", self.b, 0.0, B_MAX, unit="N.s/m"))
        object.__setattr__(self, "push", number("push", self.push, -10.0, 10.0, unit="m/s"))
        object.__setattr__(self, "pose", pair("pose", self.pose, unit="m"))
        number("delay", self.delay, 0.0, 1.0 if self.Ts else 0.0, unit="s")

    def scenario(self, t_max: float = SPAN, stop: bool = True) -> Scenario:
        """The run that tries it."""
        i, everywhere = AXES.index(self.axis), Profile((), (self.b,))
        along = (lambda x: (x, 0.0)) if i == 0 else (lambda x: (0.0, x))
        return Scenario(
            name="boundary",
            clay=Clay(everywhere, everywhere),
            gain=along(self.K),
            force=(0.0, 0.0),
            velocity=along(self.push),
            operator=self.operator,
            shaping=self.shaping,
            dt=self.Ts or TS,
            control="sampled" if self.Ts else "continuous",
            interface=Interface(delay=self.delay) if self.delay else None,
            origin=(NOMINAL[0] + self.pose[0], NOMINAL[1] + self.pose[1]),
            torque_limit=self.torque_limit,
            length=None,
            t_max=t_max,
            stop=stop,
        )


def growth_rate(record: Record, axis: str) -> float:
    """Rate at which the oscillation of a free motion grows [1/s]: that of its least damped mode; negative if it decays.

    The modes of the velocity are those of a linear prediction of low rank (ESPRIT: Roy, Kailath, IEEE Trans. ASSP 37,
    1989), exact for a linear loop, whatever the sampling. Modes slower than SLOW do not count.

    Returns:
        inf for a run that ended before it could be read.
    """
    v, dt = (
        record.v[:-1, AXES.index(choice("axis", axis, AXES))],
        record.scenario.dt,
    )  # the last step may be short
    v = v[int((1.0 - FIT) * len(v)) :]
    skip = (
        2 * round(0.5 * POSE_STEP / dt) + 1
    )  # odd: half the sampling frequency must not fold onto zero; nor both ways
    found = [_least_damped(v[::n], n * dt) for n in (skip, skip + 2) if len(v) >= 32 * n]
    if not found:
        return math.inf if record.outcome.code != "time limit" else -math.inf
    return max(found)


def _least_damped(v: np.ndarray, dt: float) -> float:
    rows = min(len(v) // 2, 700)  # of a long run: all its modes, at a fraction of the cost
    u, s, _ = np.linalg.svd(
        np.lib.stride_tricks.sliding_window_view(v, rows).T, full_matrices=False
    )
    r = max(1, min(int(np.sum(s > RANK * s[0])), rows // 3))
    z = np.linalg.eigvals(np.linalg.lstsq(u[:-1, :r], u[1:, :r])[0])
    z = z[np.abs(z) > 1e-6]
    powers = np.exp(np.multiply.outer(np.arange(len(v)), np.log(z.astype(complex))))
    weight = np.abs(np.linalg.lstsq(powers, v.astype(complex))[0]) * np.maximum(
        np.abs(z) ** (len(v) - 1), 1.0
    )
    rate, turn = np.log(np.abs(z)) / dt, np.abs(np.angle(z)) / dt
    counts = (weight > FAINT * weight.max(initial=0.0)) & ((turn > SLOW) | (rate > SLOW))
    return float(rate[counts].max()) if counts.any() else -math.inf


def classify_run(loop: Loop) -> str:
    """What a run of it does: "stable", "limit cycle" (bounded by the motors' torque) or "diverges".

    Growth is that of a linear motion, so a run whose motors were in their limits at its end goes on for longer.
    """
    limit = (1.0 - 1e-9) * np.array(loop.torque_limit)
    for t_max in LONG:
        record = simulate(loop.scenario(t_max, stop=False))
        code = record.outcome.code
        if code in ("diverged", "out of reach", "singular"):
            return "diverges"
        if code in ("limit cycle", "saturated"):
            break
        if not np.any(np.abs(record.tau[int((1.0 - FIT) * len(record.tau)) :]) >= limit):
            return "diverges" if growth_rate(record, loop.axis) > 0.0 else "stable"
    return "limit cycle"


def find_crossing(rate: Callable[[float], float], guess: float, most: float) -> float:
    """Where a growth rate changes from negative to positive, near guess or beyond: bisection on a ratio, sped up.

    Args:
        rate: of a positive parameter. guess: where to begin. most: how far to look.

    Returns:
        The parameter, within CLOSE of it; inf if the rate stays negative, 0 if it stays positive.
    """
    step = 1.05
    low, high = guess / step, guess * step
    a, b = rate(low), rate(high)
    while a > 0.0:
        if low < 1e-3 * guess:
            return 0.0
        step = min(2.0, step * step)
        high, b, low = low, a, low / step
        a = rate(low)
    while b <= 0.0:
        if high > most:
            return math.inf
        step = min(2.0, step * step)
        low, a, high = high, b, high * step
        b = rate(high)
    while high / low > 1.0 + CLOSE:
        share = a / (a - b) if math.isfinite(a - b) else 0.5
        share = min(max(share, 0.02), 0.98) if high / low < 1.5 else 0.5
        middle = low * (high / low) ** share
        # on both sides of the straight line's guess: two runs close the bracket where the rate is nearly straight
        for x in (middle * (1.0 - 0.4 * CLOSE), middle * (1.0 + 0.4 * CLOSE)):
            if low < x < high:
                y = rate(x)
                if y > 0.0:
                    high, b = x, y
                    break
                low, a = x, y
    return math.sqrt(low * high)


def simulated_gain(loop: Loop, guess: float | None = None, most: float = 200.0) -> float:
    """The gain K from which a run oscillates more and more; the loop's own K does not matter.

    Args:
        loop: all but K. guess: where to begin; by default the limit of the linear loop. most: how far to look.
    """
    if guess is None:
        guess = gain_limit.gain_limit(
            loop.axis,
            loop.b,
            impedance=loop.operator is not None,
            operator=loop.operator,
            Ts=loop.Ts,
            delay=loop.delay,
        )
    guess = min(guess, most) if guess > 0.0 else 1.0
    return find_crossing(
        lambda K: growth_rate(simulate(replace(loop, K=K).scenario()), loop.axis), guess, most
    )


def simulated_damping(loop: Loop, guess: float, most: float = 1e5) -> float:
    """The clay b [N.s/m] from which a run oscillates more and more; arguments as `simulated_gain`."""
    return find_crossing(
        lambda b: growth_rate(simulate(replace(loop, b=b).scenario()), loop.axis), guess, most
    )


def _pose_mobility(loop: Loop) -> np.ndarray:
    """W = Lambda^-1 at the handle's pose [1/kg], shape (2, 2)."""
    q1, q2 = arm.inverse_kinematics(NOMINAL[0] + loop.pose[0], NOMINAL[1] + loop.pose[1])
    xx, xy, yy = arm.mobility(
        *arm.jacobian(math.sin(q1), math.cos(q1), math.sin(q1 + q2), math.cos(q1 + q2))
    )
    return np.array([[xx, xy], [xy, yy]])


def _wanted() -> np.ndarray:
    """The servo's acceleration from (p, v, delta, delta', y, y') of each axis, shape (2, 12)."""
    out = np.zeros((2, 12))
    for j, (g, s) in enumerate(zip(G, S, strict=True)):
        feedback = [
            -s.stiffness,
            -s.damping,
            g.stiffness,
            0.0,
            s.stiffness - g.stiffness,
            s.damping - g.damping,
        ]
        out[j, 6 * j : 6 * j + 6] = feedback
    return out


def pose_matrix(loop: Loop) -> np.ndarray:
    """The loop at the handle's pose in continuous time: z' = A z, shape (12, 12).

    z: (p, v, delta, delta', y, y') of each axis. Without shaping W = Lambda^-1 of that pose takes the place of the
    gains of Sh, and couples the axes (docs/equations.md, section 3).
    """
    th, i, force = loop.operator or NO_HAND, AXES.index(loop.axis), np.zeros((2, 12))
    W = np.diag([S[0].gain, S[1].gain]) if loop.shaping else _pose_mobility(loop)
    for j in (0, 1):  # hand and clay without the hand's mass
        force[j, 6 * j : 6 * j + 2] = -th.spring, -th.damper - loop.b
    acceleration = np.linalg.solve(np.eye(2) + th.mass * W, _wanted() + W @ force)
    A = np.zeros((12, 12))
    for j, g in enumerate(G):
        k = 6 * j
        A[k, k + 1] = A[k + 2, k + 3] = A[k + 4, k + 5] = 1.0
        A[k + 1] = acceleration[j]
        A[k + 3] = (loop.K if j == i else 0.0) * (force[j] - th.mass * acceleration[j])
        A[k + 3, k + 3] -= C_POLE
        A[k + 5, [k + 2, k + 4, k + 5]] = g.stiffness, -g.stiffness, -g.damping
    return A


def pose_step(loop: Loop) -> np.ndarray:
    """The sampled loop at the handle's pose: x(k+1) = M x(k), shape (m, m); limits.matrices for both axes at once.

    x: z of `pose_matrix` and the motors' force on the handle, (x, y) for each of the last 1 + n samples, the newest
    first; n whole samples of delay, m = 14 + 2 n.
    """
    assert loop.Ts
    th, n = loop.operator or NO_HAND, math.floor(loop.delay / loop.Ts + 1e-9)
    part, m = max(loop.delay - n * loop.Ts, 0.0), 14 + 2 * n
    where, rate = [0, 6, 1, 7], np.zeros((6, 6))
    inertia = np.linalg.inv(_pose_mobility(loop))
    rate[:2, 2:4] = np.eye(2)
    rate[2:4] = np.linalg.solve(
        inertia + th.mass * np.eye(2),
        np.hstack([-x * np.eye(2) for x in (th.spring, th.damper, -1.0)]),
    )
    head, rest = (controller.matrix_exponential(span * rate) for span in (part, loop.Ts - part))
    x = np.eye(m)
    old, v = x[-2:], x[[1, 7]]
    acceleration = rate[2:4] @ np.vstack(
        (x[where], old)
    )  # under the force before the sample, which the sensor feels
    f = -th.spring * x[[0, 6]] - (th.damper + loop.b) * v - th.mass * acceleration
    u = inertia @ np.pad(_wanted(), ((0, 0), (0, m - 12))) - loop.b * v
    if loop.shaping:
        u += (inertia @ np.diag([S[0].gain, S[1].gain]) - np.eye(2)) @ f
    M = np.zeros((m, m))
    half = head[:4] @ np.vstack((x[where], old))
    M[where] = rest[:4] @ np.vstack((half, x[10 + 2 * n : 12 + 2 * n] if n else u))
    for j, axis in enumerate(AXES):
        A, B = controller.held_compensator(axis, loop.K if axis == loop.axis else 0.0, loop.Ts)
        M[6 * j + 2 : 6 * j + 6] = A @ x[6 * j + 2 : 6 * j + 6] + np.outer(B, f[j])
    M[12:14] = u
    M[14:] = x[12 : m - 2]
    return M


def pose_limit(loop: Loop, most: float = 200.0) -> float:
    """Smallest K at which the linear loop at the handle's pose is unstable; inf if there is none up to `most`."""

    matrix = pose_step if loop.Ts else pose_matrix
    first, second = (matrix(replace(loop, K=K)) for K in (1.0, 2.0))  # it is linear in K

    def unstable(K: np.ndarray) -> np.ndarray:
        z = np.linalg.eigvals(first + np.multiply.outer(K - 1.0, second - first))
        if loop.Ts:
            return np.max(np.where(np.abs(z - 1.0) > 1e-4 * loop.Ts, np.abs(z), 0.0), axis=-1) > 1.0
        return np.max(np.where(np.abs(z) > 1e-4, z.real, -np.inf), axis=-1) > 0.0

    grid = np.geomspace(1e-3, most, 200)
    bad = np.flatnonzero(unstable(grid))
    if not len(bad):
        return math.inf
    if bad[0] == 0:
        return 0.0
    low, high = float(grid[bad[0] - 1]), float(grid[bad[0]])
    while high / low > 1.0 + 1e-10:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if unstable(np.array([middle]))[0] else (middle, high)
    return high


def linear_rate(loop: Loop) -> bool:
    """Whether the linear loop at the nominal pose is stable in continuous time."""
    return gain_limit.is_stable(loop.axis, loop.K, loop.b, loop.operator)


def explain_disagreement(loop: Loop, stable: bool) -> str:
    """Why a run does (stable) or does not (not stable) settle, against what continuous time at the nominal pose says.

    One thing is changed in the run at a time, and two if none will do alone, until it does what theory says.
    """
    changes: list[tuple[str, dict]] = [
        ("delay", dict(delay=0.0)) if loop.delay else ("", {}),
        ("sampling", dict(Ts=None, delay=0.0)) if loop.Ts else ("", {}),
        ("pose-dependent Lambda", dict(shaping=True)) if not loop.shaping else ("", {}),
        ("saturation", dict(torque_limit=(1e6, 1e6))),
        ("size of the motion", dict(push=SMALL_PUSH)),
    ]
    for n in (1, 2):
        for some in combinations([c for c in changes if c[0]], n):
            change = {field: value for _, fields in some for field, value in fields.items()}
            if (classify_run(replace(loop, **change)) == "stable") != stable:
                return " and ".join(name for name, _ in some)
    return "not found"
