"""The exact symmetric oscillation of the linear loop in Coulomb and Bingham clay.

The loop is linear while sliding and while stuck, so matrix exponentials advance it. Half a period
consists of a slide and possibly a stuck phase; the other half is its mirror image. Given both
durations, one linear system yields the initial state. Two conditions determine the durations: the
velocity is 0 at the end of the slide, and the held force equals the yield force at the end of the
stuck phase (for a relay without a stuck phase: Tsypkin, Relay Control Systems, 1984).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from .. import matrices
from ..arguments import named
from ..errors import ParameterError
from ..model.compensator import moving_states
from ..model.controller import matrix_exponential
from ..model.flow import Flow
from . import linear_loop, roots
from .describing import is_flow, limit_cycles, push_outcomes, without_spring
from .loops import Loop, of_loop
from .roots import first_failure

SPAN = np.geomspace(0.5, 2.0, 61)  # half periods tried, as shares of the predicted one
SLIDING_SHARES = (0.9, 0.75, 0.5)  # of half a period: initial guesses for a cycle that sticks
STEPS, PERIODS = 60, 14  # steps per period, periods: a run that tests whether a push sticks
SAMPLES = 400  # of half a period at which a solution is checked
CYCLE_TOLERANCE = 1e-9  # of the largest velocity, or of the yield force


@named
@dataclass(frozen=True)
class ExactCycle:
    """A symmetric oscillation, exact for the linear loop.

    Attributes:
        speed: largest velocity [m/s].
        amplitude: half the distance between its ends [m].
        omega: frequency [rad/s].
        stuck: share of the time at which the handle rests.
        multiplier: growth of the least stable deviation in half a period; below 1 the cycle is
            stable.
    """

    speed: float
    amplitude: float
    omega: float
    stuck: float
    multiplier: float

    @property
    def stable(self) -> bool:
        """Whether nearby motions converge to it."""
        return self.multiplier < 1.0

    @property
    def frequency(self) -> float:
        """In Hz."""
        return self.omega / (2.0 * math.pi)


@dataclass(frozen=True)
class _Pieces:
    """The loop under a yield force of 1 N: z' = A z - B while it slides forward."""

    A: np.ndarray
    B: np.ndarray
    neutral: int  # motions without a restoring force: the rest position of the handle

    @property
    def held(self) -> np.ndarray:
        """Row over z of the clay force that keeps the velocity constant [N]."""
        return self.A[1] / self.B[1]

    @property
    def stuck(self) -> np.ndarray:
        return self.A - np.outer(self.B, self.held)

    def slide(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """E and g of z(t) = E z(0) - g."""
        n = len(self.A)
        whole = np.zeros((n + 1, n + 1))
        whole[:n, :n], whole[:n, n] = self.A, self.B
        moved = matrix_exponential(t * whole)
        return moved[:n, :n], moved[:n, n]

    def ends(self, slide: float, stuck: float) -> tuple[np.ndarray, np.ndarray]:
        """z at the start of a slide of half a period that ends in its mirror image, and its end."""
        E, g = self.slide(slide)
        S = matrix_exponential(stuck * self.stuck) if stuck else np.eye(len(g))
        start = np.linalg.solve(np.eye(len(g)) + S @ E, S @ g)
        return start, E @ start - g

    def valid(self, slide: float, stuck: float) -> bool:
        """Whether it slides forward throughout, and stays stuck throughout the stuck phase."""
        start, end = self.ends(slide, stuck)
        v = self.path(slide, start)[:, 1]
        if v.min() < -CYCLE_TOLERANCE * v.max() or v.max() <= 0.0:
            return False
        if not stuck:
            return bool(self.held @ end < -1.0)  # the clay cannot hold it
        step = matrix_exponential(stuck / SAMPLES * self.stuck)
        held = []
        for _ in range(SAMPLES):
            held.append(self.held @ end)
            end = step @ end
        return bool(np.max(np.abs(held)) <= 1.0 + CYCLE_TOLERANCE)

    def path(self, slide: float, start: np.ndarray) -> np.ndarray:
        """States during a slide, shape (SAMPLES + 1, n)."""
        E, g = self.slide(slide / SAMPLES)
        out = [start]
        for _ in range(SAMPLES):
            out.append(E @ out[-1] - g)
        return np.array(out)

    def sticks(self, z: np.ndarray, step: float, t_max: float) -> bool:
        """Whether a motion that starts at z, sliding forward, ends stuck."""
        E, g = self.slide(step)
        S = matrix_exponential(step * self.stuck)
        t, sign, rest = 0.0, 1.0, False
        while t < t_max:
            ahead, t = (S @ z if rest else E @ z - sign * g), t + step
            if rest:
                before, held = float(self.held @ z), float(self.held @ ahead)
                if abs(held) > 1.0:  # it breaks away within the step
                    rest, sign = False, math.copysign(1.0, held)
                    late = (held - sign) / (held - before) * step
                    own, moved = self.slide(late)
                    ahead = own @ matrix_exponential((step - late) * self.stuck) @ z - sign * moved
            elif sign * ahead[1] < 0.0:
                ahead, early = self._stop(z, sign, step)
                t -= early
                rest = bool(abs(self.held @ ahead) <= 1.0)
                sign = math.copysign(1.0, self.held @ ahead)
            z = ahead
        return rest

    def _stop(self, z: np.ndarray, sign: float, step: float) -> tuple[np.ndarray, float]:
        """z at the end of a slide within a step, and the time from there to the end of the step."""
        from scipy.optimize import brentq

        def moved(t: float) -> np.ndarray:
            E, g = self.slide(t)
            return E @ z - sign * g

        # a slide that has just begun starts at v = 0, up to rounding
        t = 1e-6 * step
        if sign * moved(t)[1] > 0.0:
            t = float(brentq(lambda t: moved(t)[1], t, step, xtol=1e-12))  # type: ignore[arg-type]
        out = moved(t)
        out[1] = 0.0
        return out, step - t

    def multiplier(self, slide: float, stuck: float) -> float:
        """Growth of deviations over half a period: the saltation matrices of both events."""
        _, end = self.ends(slide, stuck)
        n = len(end)
        stopping = self.A @ end - self.B
        change = _onto(stopping, np.eye(n)[1]) @ self.slide(slide)[0]
        if stuck:
            S = matrix_exponential(stuck * self.stuck)
            change = _onto(self.stuck @ S @ end, self.held) @ S @ change
        z = matrices.eigenvalues(change)
        z = z[np.argsort(np.abs(z - 1.0))][self.neutral :]
        return float(np.max(np.abs(z)))


def _onto(flow: np.ndarray, event: np.ndarray) -> np.ndarray:
    """Change of a deviation carried along the flow to the event."""
    return np.eye(len(flow)) - np.outer(flow, event) / (event @ flow)


@of_loop("flow", "K", "operator")
def critical_push(loop: Loop, *, flow: Flow) -> float:
    """Least velocity of a push after which the handle does not end stuck.

    The push is that of `Scenario.velocity`: compensator and servo move with the handle. Matrix
    exponentials advance the loop. Bisection finds the velocity and assumes that every stronger push
    keeps sliding, too. The result differs from the speed of the threshold, to which a motion at the
    limit converges.
    """
    pieces, moving = _pieces(loop, flow), _moving_state(loop)
    cycles = [x for x in limit_cycles(loop, flow=flow) if x.kind == "threshold"]
    small, large = push_outcomes(loop, flow=flow)
    if small != "sticks":
        return 0.0
    if not cycles or not (large == "grows" or exact_cycles(loop, flow=flow)):
        return math.inf
    period = 2.0 * math.pi / cycles[0].omega

    def rests(v: float) -> bool:
        return pieces.sticks(v * moving, period / STEPS, PERIODS * period)

    start = cycles[0].speed / flow.Fy
    low, high = first_failure(rests, (start * 2.0 ** np.arange(-4.0, 30.0)).tolist(), rtol=2e-3)
    return flow.Fy * high


@of_loop("flow", "K", "operator")
def exact_cycles(loop: Loop, *, flow: Flow) -> tuple[ExactCycle, ...]:
    """Symmetric oscillations of the loop in Coulomb or Bingham clay, exact to rounding.

    The search covers half to twice each frequency predicted by `limit_cycles`. Every cycle found is
    exact, but the search may miss a cycle.

    Args:
        loop: the loop with its K, its b ignored; or axis, flow, K, operator, and other parts by
            name; or a Scenario and an axis.
        flow: the law of the clay: a yield force and optionally a damper.

    Returns:
        The cycles, speed ascending.

    Raises:
        ParameterError: the clay has no yield force, or a consistency with n other than 1.
    """
    pieces = _pieces(loop, flow)
    times: list[tuple[float, float]] = []
    for cycle in limit_cycles(loop, flow=flow):
        for found in _times(pieces, math.pi / cycle.omega):
            if not any(np.allclose(found, known, rtol=1e-6, atol=0.0) for known in times):
                times.append(found)
    out = []
    for slide, stuck in times:
        path = pieces.path(slide, pieces.ends(slide, stuck)[0])
        out.append(
            ExactCycle(
                speed=flow.Fy * float(path[:, 1].max()),
                amplitude=0.5 * flow.Fy * float(path[-1, 0] - path[0, 0]),
                omega=math.pi / (slide + stuck),
                stuck=stuck / (slide + stuck),
                multiplier=pieces.multiplier(slide, stuck),
            )
        )
    return tuple(sorted(out, key=lambda x: x.speed))


def _pieces(loop: Loop, flow: Flow) -> _Pieces:
    """The loop in clay with a yield force of 1 N and the flow's dampers: motions scale with Fy."""
    is_flow(flow)
    without_spring(loop)
    if not flow.Fy or (flow.K and flow.n != 1.0):
        raise ParameterError(
            "flow", flow, "must be Coulomb or Bingham clay: Fy > 0, K = 0 or n = 1"
        )
    loop = replace(loop, b=flow.b + flow.K)
    A, B = linear_loop.state_space(loop)
    return _Pieces(A, B[:, 0], roots.multiplicity_of_zero(linear_loop.characteristic(loop)))


def _moving_state(loop: Loop) -> np.ndarray:
    """Steady state of a loop moving at 1 m/s with the handle at 0, as at the start of a run."""
    shape, n = loop.compensator, loop.compensator.order
    gain, damping, stiffness = loop.servo.numbers[:3]
    A, _, C, _ = shape.state_space()
    ahead = damping / stiffness / gain  # the compensator leads by the lag of G
    rest = matrices.least_squares(np.vstack((A, C)), np.append(np.zeros(n), 1.0))
    inner = np.array(moving_states(shape, 1.0 / gain)[:n]) + ahead * rest
    return np.concatenate(((0.0, 1.0), inner, (0.0, 1.0)))


def _times(pieces: _Pieces, half: float) -> list[tuple[float, float]]:
    """Sliding and sticking times of the oscillations near a given half period [s]."""
    from scipy.optimize import brentq, root

    def speed(h: float) -> float:
        return float(pieces.ends(h, 0.0)[0][1])

    def misses(times: np.ndarray) -> list[float]:
        start, end = pieces.ends(*np.abs(times).tolist())
        return [float(end[1] / (pieces.B[1] * half)), float(pieces.held @ start) - 1.0]

    tried = (half * SPAN).tolist()
    v = [speed(h) for h in tried]
    found = [
        (float(brentq(speed, a, b, xtol=1e-15)), 0.0)  # type: ignore[arg-type]
        for a, b, v_a, v_b in zip(tried[:-1], tried[1:], v[:-1], v[1:], strict=True)
        if v_a * v_b < 0.0
    ]
    found = [x for x in found if pieces.valid(*x)]
    for share in SLIDING_SHARES:
        solution = root(misses, [share * half, (1.0 - share) * half], tol=1e-12)
        slide, stuck = np.abs(solution.x).tolist()
        solved = np.max(np.abs(solution.fun)) < CYCLE_TOLERANCE < stuck / slide
        if solved and SPAN[0] < (slide + stuck) / half < SPAN[-1] and pieces.valid(slide, stuck):
            return [*found, (slide, stuck)]
    return found
