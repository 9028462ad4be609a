"""Clay that yields in the linear loop: describing functions, limit cycles and thresholds.

For a sinusoidal velocity of amplitude V, clay with a `Flow` acts as a damper N(V) at that
frequency. The loop sustains an oscillation where N(V) equals a damping b at which its poles lie on
the imaginary axis. The method neglects the harmonics of the clay's force that return through the
loop (Gelb, Vander Velde, Multiple-Input Describing Functions and Nonlinear System Design, 1968).
Their first-order effect is computed here and limits the range of the prediction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.polynomial import Polynomial

from ..arguments import checked, named
from ..errors import ParameterError, array_of
from ..model.flow import Flow
from . import linear_loop, roots
from .loops import Loop, of_loop

EXTREME = 300.0  # the search for amplitudes ends at exp(+-300) m/s
HARMONICS = 199  # highest harmonic included: the effect falls as its square
# A prediction is trusted to 10 % in amplitude and 5 % in frequency while the harmonics move them by
# less than this, to first order; the rest is for higher orders.
AMPLITUDE_TRUST = 0.08
FREQUENCY_TRUST = 0.04

Kind = Literal["limit cycle", "threshold", "unstable"]
PushOutcome = Literal["sticks", "comes to rest", "limit cycle", "grows"]


@checked
def describing_function(flow: Flow, V: Any) -> Any:
    """Equivalent damper of clay for a sinusoidal velocity, b + 4 Fy/(pi V) + K c(n) V^(n-1).

    N(V) is the fundamental of the clay's force over that of the velocity, with c(n) = (2/sqrt(pi))
    Gamma(n/2 + 1)/Gamma((n + 3)/2). It is real because clay stores no energy.

    Args:
        flow: the law of the clay.
        V: amplitude of the velocity [m/s], > 0, a float or an array.

    Returns:
        N [N.s/m], of the shape of V.

    Raises:
        ParameterError: V is not positive.
    """
    V = array_of("V", V)
    if not np.all(V > 0.0):
        raise ParameterError("V", V.tolist(), "must be > 0 [m/s]")
    N = flow.b + sum(term for term, _ in _flow_terms(flow, V))
    return float(N) if N.ndim == 0 else N


def _flow_terms(flow: Flow, V: Any) -> list[tuple[Any, float]]:
    """Parts of N(V) without b, and the power of |v| in the force of each."""
    c = 2.0 / math.sqrt(math.pi) * math.gamma(0.5 * flow.n + 1.0) / math.gamma(0.5 * flow.n + 1.5)
    return [(4.0 * flow.Fy / (math.pi * V), 0.0), (flow.K * c * V ** (flow.n - 1.0), flow.n)]


def amplitudes(flow: Flow, N: float) -> tuple[float, ...]:
    """Velocity amplitudes at which clay acts as a damper N: the solutions of N(V) = N.

    For n <= 1, N(V) falls, so there is at most one solution. For n > 1, N(V) falls to a minimum and
    rises again, so there are up to two, or one without a yield force.
    """
    from scipy.optimize import brentq

    n, rest = flow.n, N - flow.b - (flow.K if flow.n == 1.0 else 0.0)
    if rest <= 0.0:
        return ()
    yields = 4.0 * flow.Fy / (math.pi * rest)  # V at which the yield force alone gives N - b
    if n == 1.0 or not flow.K:
        return (yields,) if yields else ()
    (_, (k, _)) = _flow_terms(flow, 1.0)
    flows = math.log(rest / k) / (n - 1.0)  # log V at which the consistency alone gives N - b
    if not flow.Fy:
        return (math.exp(flows),) if abs(flows) < EXTREME else ()

    low = math.log(yields)

    def excess(x: float) -> float:  # log of (N(V) - b)/(N - b) at V = exp(x)
        return float(np.logaddexp(low - x, (n - 1.0) * (x - flows)))

    if n < 1.0:  # both terms fall: from where one suffices to where each is at most a half
        half = math.log(2.0)
        spans = [(max(low, flows), max(low + half, flows + half / (1.0 - n)))]
    else:
        least = math.log(4.0 * flow.Fy / (math.pi * k * (n - 1.0))) / n
        spans = [(low, least), (least, flows)] if excess(least) < 0.0 else []
    spans = [(max(x, -EXTREME), min(y, EXTREME)) for x, y in spans]
    return tuple(
        math.exp(brentq(excess, x, y, xtol=1e-15))  # type: ignore[arg-type]
        for x, y in spans
        if x <= y and excess(x) * excess(y) <= 0.0
    )


# ---- the loop over its damping -------------------------------------------------------------------


@dataclass(frozen=True)
class DampingCrossing:
    """A damping of the clay at which poles of the loop lie on the imaginary axis.

    Attributes:
        b: the damping [N.s/m].
        omega: frequency of these poles [rad/s]; 0 or inf for a single pole.
        below: number of unstable poles just below b.
        above: number of unstable poles just above b.
    """

    b: float
    omega: float
    below: int
    above: int


def _over_damping(loop: Loop) -> tuple[Polynomial, Polynomial]:
    """Closed-loop polynomial A + b B over the damping b; B/(A + b B) is v over a force."""
    e, _ = linear_loop.device_admittance(loop)
    return linear_loop.characteristic(replace(loop, b=0.0)), roots.VARIABLE * e


def _unstable_poles(loop: Loop, b: float) -> int:
    return int(np.sum(roots.nonzero_roots(linear_loop.characteristic(replace(loop, b=b))).real > 0))


def damping_crossings(loop: Loop) -> tuple[DampingCrossing, ...]:
    """Every damping of the clay at which the linear loop gains or loses a stable pole."""
    found = roots.crossings(*_over_damping(loop))
    b = [x for x, _ in found]
    between = [math.sqrt(x * y) for x, y in zip(b[:-1], b[1:], strict=True)]
    counts = [_unstable_poles(loop, x) for x in (0.5 * b[0], *between, 2.0 * b[-1])] if b else []
    return tuple(
        DampingCrossing(*at, *counts[i : i + 2])
        for i, at in enumerate(found)
        if counts[i] != counts[i + 1]
    )


@of_loop("K", "operator")
def unstable_dampings(loop: Loop) -> tuple[tuple[float, float], ...]:
    """Bands of the clay's damping b in which the linear loop is unstable.

    The bands are exact: they follow from roots of polynomials.

    Args:
        loop: the loop with its K, its b ignored; or axis, K, operator, and other parts by name.

    Returns:
        (low, high) of each band [N.s/m], ascending; high may be inf.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    found = damping_crossings(loop)
    if not found:
        return ((0.0, math.inf),) if _unstable_poles(loop, 1.0) else ()
    edges = [0.0] if found[0].below else []
    edges += [x.b for x in found if (x.below == 0) != (x.above == 0)]
    edges += [math.inf] if found[-1].above else []
    return tuple(zip(edges[::2], edges[1::2], strict=True))


# ---- limit cycles --------------------------------------------------------------------------------


@named
@dataclass(frozen=True)
class LimitCycle:
    """A predicted oscillation of constant amplitude in clay.

    Attributes:
        speed: V, amplitude of the velocity [m/s].
        omega: frequency [rad/s].
        damping: N(V), the clay's damping at that amplitude [N.s/m].
        kind: "limit cycle" if nearby motions converge to it, "threshold" if smaller motions decay
            and larger ones grow, "unstable" if the loop has further unstable poles, so that neither
            can be concluded.
        third: third harmonic of the velocity over the fundamental.
        speed_shift: share of V by which the harmonics move the true amplitude, to first order.
        omega_shift: the same for omega.
    """

    speed: float
    omega: float
    damping: float
    kind: Kind
    third: float
    speed_shift: float
    omega_shift: float

    @property
    def amplitude(self) -> float:
        """Amplitude of the position [m]."""
        return self.speed / self.omega

    @property
    def frequency(self) -> float:
        """Frequency in Hz."""
        return self.omega / (2.0 * math.pi)

    @property
    def trusted(self) -> bool:
        """Whether the loop filters the harmonics enough to trust V to 10 % and omega to 5 %."""
        return abs(self.speed_shift) < AMPLITUDE_TRUST and abs(self.omega_shift) < FREQUENCY_TRUST


@of_loop("flow", "K", "operator")
def limit_cycles(loop: Loop, *, flow: Flow) -> tuple[LimitCycle, ...]:
    """Limit cycles and thresholds of the loop in clay that yields, by the describing function.

    Each damping b* at which the linear loop has poles at j omega gives the cycles with N(V) = b*.
    The cycles are around rest: once a steady force makes the handle slide, only b acts on the
    motion.

    Args:
        loop: the loop with its K, its b ignored; or axis, flow, K, operator, and other parts by
            name; or a Scenario and an axis.
        flow: the law of the clay.

    Returns:
        The cycles, speed ascending.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    is_flow(flow)
    without_spring(loop)
    A, B = _over_damping(loop)
    found = sorted(
        (V, crossing)
        for crossing in damping_crossings(loop)
        if 0.0 < crossing.omega < math.inf
        for V in amplitudes(flow, crossing.b)
    )
    counts = _counts(loop, flow, [V for V, _ in found])
    return tuple(
        LimitCycle(V, at.omega, at.b, _kind(*counts[i : i + 2]), *_harmonics(A, B, flow, V, at))
        for i, (V, at) in enumerate(found)
    )


@of_loop("flow", "K", "operator")
def push_outcomes(loop: Loop, *, flow: Flow) -> tuple[PushOutcome, PushOutcome]:
    """Outcome of a small and of a large push, by the describing function.

    Args:
        loop: the loop with its K, its b ignored; or axis, flow, K, operator, and other parts by
            name; or a Scenario and an axis.
        flow: the law of the clay.

    Returns:
        (after a small push, after a large push): "sticks", "comes to rest" (clay without a yield
        force), "limit cycle", or "grows", until the motors reach their limits.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    cycles = limit_cycles(loop, flow=flow)
    counts = _counts(loop, flow, [x.speed for x in cycles])
    bounded = any(x.kind == "limit cycle" for x in cycles)
    rest: PushOutcome = "sticks" if flow.Fy else "comes to rest"
    kept: PushOutcome = "limit cycle" if bounded else rest
    # A motion between two cycles tends to the stable one of them.
    small: PushOutcome = rest if not counts[0] else "limit cycle" if bounded else "grows"
    return small, "grows" if counts[-1] else kept


def is_flow(flow: Flow) -> None:
    """Refuses anything but a Flow."""
    if not isinstance(flow, Flow):
        raise ParameterError("flow", flow, "must be a Flow")


def without_spring(loop: Loop) -> None:
    """Refuses a loop in elastic clay, where yielding clay would come to rest elsewhere."""
    if loop.k:
        raise ParameterError("k", loop.k, "must be 0 here: the analysis is of clay that yields")


def _counts(loop: Loop, flow: Flow, speeds: list[float]) -> list[int]:
    """Number of unstable poles of the linear loop with N(V): below, between and above some V."""
    V = [0.5 * speeds[0], *speeds, 2.0 * speeds[-1]] if speeds else [1.0, 1.0]
    middles = [math.sqrt(x * y) for x, y in zip(V[:-1], V[1:], strict=True)]
    return [_unstable_poles(loop, describing_function(flow, x)) for x in middles]


def _kind(inside: int, outside: int) -> Kind:
    if inside and not outside:
        return "limit cycle"
    return "threshold" if outside and not inside else "unstable"


def _harmonics(
    A: Polynomial, B: Polynomial, flow: Flow, V: float, at: DampingCrossing
) -> tuple[float, float, float]:
    """Third harmonic of the velocity over V, and the shares by which harmonics move V and omega.

    The harmonic k of a term K|v|^n of the force is a_k times its fundamental, with a_1 = 1 and
    a_(k+2) = a_k (k - n)/(k + 2 + n). The harmonics of all terms return as velocities V Im(r_k
    exp(k j omega t)). Each changes the fundamental of a term, N_n V, and so changes N by N_n a_k (n
    Re r_k + k j Im r_k). The balance A + N B = 0, linear in the changes of omega and V, gives both.
    """
    s, terms = 1j * at.omega, _flow_terms(flow, V)
    k = np.arange(3, HARMONICS + 1, 2)
    shares = [N * np.cumprod((k - 2.0 - n) / (k + n)) for N, n in terms]
    r = -B(k * s) / (A(k * s) + flow.b * B(k * s)) * sum(shares)
    change = sum(
        np.sum(x * (n * r.real + 1j * k * r.imag)) for x, (_, n) in zip(shares, terms, strict=True)
    )
    per_speed = sum(N * (n - 1.0) for N, n in terms) * B(s)  # dN/dlog V
    per_omega = s * (A.deriv()(s) + at.b * B.deriv()(s))
    matrix = np.array([[per_speed.real, per_omega.real], [per_speed.imag, per_omega.imag]])
    moved = -change * B(s)
    speed, omega = np.linalg.solve(matrix, [moved.real, moved.imag]).tolist()
    return float(abs(r[0])), speed, omega
