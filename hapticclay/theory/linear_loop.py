"""The linear loop (Fig. 2): its closed-loop polynomials, its state space and its sampled map.

Everything that `theory` and `studies` say of a loop starts from one of these. Polynomials treat one
axis at the nominal pose; state spaces one axis, or both where a pose couples them.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial

from ..errors import ParameterError, choice, number
from ..model import controller
from ..model.constants import AXES, G, S
from ..model.controller import PRINTED, Compensator
from ..model.operator import NO_HAND, Operator
from ..model.scenario import RENDERS
from . import roots


def steady_speed(K: float, f: float, b: Any) -> Any:
    """Speed under a constant hand force, K f/(10 + K b) with the printed compensator [m/s].

    The compensator's damper and the clay share the force: f = (10/K + b) v (Eqs. 20, 21).

    Args:
        K: compensator gain.
        f: hand force [N].
        b: clay [N.s/m], a float or an array.
    """
    return K * f / (PRINTED.pole + K * b)


def hand_or_none(operator: Operator | None) -> Operator:
    """The operator's arm, or one of zeros for None.

    Args:
        operator: Th; None for Th = 0.

    Raises:
        ParameterError: operator is of another type.
    """
    if operator is None:
        return NO_HAND
    if not isinstance(operator, Operator):
        raise ParameterError("operator", operator, "must be an Operator or None")
    return operator


# ---- polynomials ---------------------------------------------------------------------------------


def loop_polynomials(
    axis: str, b: float, operator: Operator | None = None, compensator: Compensator = PRINTED
) -> tuple[Polynomial, Polynomial, Polynomial]:
    """Parts of the closed-loop polynomial: denominator + passive + K driven.

    The first is the common denominator of G, C and Sh, so the loop's transfer function
    (G C + Sh)(Te + Th) is (passive + K driven)/denominator.

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
        compensator: shape of C.

    Returns:
        (denominator, passive, driven).

    Raises:
        ParameterError: unknown axis, or b not finite and >= 0.
    """
    s, cg = S[AXES.index(choice("axis", axis, AXES))], _forward_denominator(axis, compensator)
    servo, t = Polynomial([s.stiffness, s.damping, 1.0]), environment_polynomial(b, operator)
    forward = G[AXES.index(axis)].gain * (compensator.fraction[0] * servo * t)
    return cg * servo, s.gain * (cg * t), forward


def delayed_polynomials(
    axis: str, b: float, operator: Operator | None, render: str, compensator: Compensator = PRINTED
) -> tuple[Polynomial, Polynomial, Polynomial]:
    """Parts of the closed-loop polynomial with late motors: physical + late (motors + K driven).

    With late = exp(-s delay), W = 1/mass of the handle (the gain of Sh) and T = Te + Th,

        0 = s^2 + W (Th + [implicit] b s) + late (kd s + kp + [held] W b s + (s^2 + kd s + kp) G C
        T)

    times the denominator of G C.

    Args:
        axis: "x" or "y".
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
        render: the clay is "held" (a force of the motors) or "implicit" (physical).
        compensator: shape of C.

    Returns:
        (physical, motors, driven).
    """
    implicit = choice("render", render, RENDERS) == "implicit"
    s, th, cg = S[AXES.index(axis)], hand_or_none(operator), _forward_denominator(axis, compensator)
    damper, held = (th.damper + b, 0.0) if implicit else (th.damper, b)
    physical = cg * Polynomial([s.gain * th.spring, s.gain * damper, 1.0 + s.gain * th.mass])
    motors = cg * Polynomial([s.stiffness, s.damping + s.gain * held])
    return physical, motors, loop_polynomials(axis, b, operator, compensator)[2]


def _forward_denominator(axis: str, compensator: Compensator) -> Polynomial:
    """Denominator of G C."""
    g = G[AXES.index(choice("axis", axis, AXES))]
    return compensator.fraction[1] * Polynomial([g.stiffness, g.damping, 1.0])


def environment_polynomial(b: float, operator: Operator | None = None) -> Polynomial:
    """Te + Th, clay and the operator's arm (Eqs. 4, 19), as a polynomial in s.

    Args:
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
    """
    b, th = number("b", b, 0.0, unit="N.s/m"), hand_or_none(operator)
    return Polynomial([th.spring, th.damper + b, th.mass])


def characteristic(
    axis: str,
    K: float,
    b: float,
    operator: Operator | None = None,
    compensator: Compensator = PRINTED,
) -> Polynomial:
    """Closed-loop polynomial of 1 + (G C + Sh)(Te + Th), the denominator of Eq. 8.

    Args:
        axis: "x" or "y".
        K: compensator gain.
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
        compensator: shape of C.

    Returns:
        Polynomial in s, of degree 6 with the printed compensator.

    Raises:
        ParameterError: unknown axis, or K or b not finite and >= 0.
    """
    denominator, passive, driven = loop_polynomials(axis, b, operator, compensator)
    return denominator + passive + number("K", K, 0.0) * driven


def device_admittance(
    axis: str, K: float, compensator: Compensator = PRINTED
) -> tuple[Polynomial, Polynomial]:
    """G C + Sh, handle position over net force, as (numerator, denominator).

    Args:
        axis: "x" or "y".
        K: compensator gain.
        compensator: shape of C.
    """
    unit_spring = Operator(0.0, 0.0, 1.0)
    denominator, passive, driven = loop_polynomials(axis, 0.0, unit_spring, compensator)
    return passive + number("K", K, 0.0) * driven, denominator


def closed_loop_poles(
    axis: str, K: float, b: float, operator: Operator | None = None
) -> np.ndarray:
    """Poles of the loop at the nominal pose [rad/s], shape (6,).

    Without a spring in Th one of them is the integrator that moves the handle (s = 0).

    Args:
        axis: "x" or "y".
        K: compensator gain.
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
    """
    return roots.roots(characteristic(axis, K, b, operator))


def stable(
    axis: str,
    K: float,
    b: float,
    operator: Operator | None = None,
    compensator: Compensator = PRINTED,
) -> bool:
    """Return True if no closed-loop pole lies right of the imaginary axis.

    Args:
        axis: "x" or "y".
        K: compensator gain.
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
        compensator: shape of C.
    """
    return roots.hurwitz(characteristic(axis, K, b, operator, compensator))


# ---- state spaces --------------------------------------------------------------------------------


def state_space(
    axes: str,
    K: float | Sequence[float] | np.ndarray,
    b: float,
    operator: Operator | None = None,
    mobility: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The loop in continuous time: z' = A z + B uh, with y = G delta.

    The servo's law is that of docs/equations.md, section 3.

    Args:
        axes: "x", "y", or "xy" for both, n of them.
        K: compensator gain of each axis.
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
        mobility: W = Lambda^-1 of the arm [1/kg], shape (n, n); None for the gains of Sh.

    Returns:
        A, shape (6 n, 6 n), and B, shape (6 n, n); z holds (p, p', delta, delta', y, y') of each
        axis.
    """
    th, n, gains = hand_or_none(operator), len(axes), np.broadcast_to(K, len(axes))
    W = _nominal_mobility(axes) if mobility is None else mobility
    # Hand and clay without the hand's mass; p'' appears in the hand's force too.
    force = np.hstack((_over_states(axes, [-th.spring, -th.damper - b]), np.eye(n)))
    law = np.hstack((_feedback(axes), np.zeros((n, n)))) + W @ force
    acceleration = np.linalg.solve(np.eye(n) + th.mass * W, law)
    net = force - th.mass * acceleration
    AB = np.zeros((6 * n, 7 * n))
    for j, axis in enumerate(axes):
        k = 6 * j
        own, drive = controller.controller_matrices(axis, gains[j])
        AB[k, k + 1] = 1.0
        AB[k + 1] = acceleration[j]
        AB[k + 2 : k + 6] = np.outer(drive, net[j])
        AB[k + 2 : k + 6, k + 2 : k + 6] += own
    return AB[:, : 6 * n], AB[:, 6 * n :]


def sampled_differences(
    axes: str,
    b: float,
    operator: Operator | None,
    Ts: float,
    delay: float = 0.0,
    render: str = "held",
    pose: tuple[np.ndarray, bool] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The sampled loop x(k+1) = (M + beta K gamma) x(k), x at the sample before it acts.

    x holds (p, v, delta, delta', y, y') of each of the n axes, then the motors' force on the handle
    u(k-1), ..., u(k-1-N) [N] on each axis, with N the whole samples in the delay. Between samples
    handle and hand move under held u (matrix exponential); a fraction of a sample in the delay
    splits the hold in two (Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed., 3.2). As in
    `Sampled`, the net force f = gamma x that drives the compensator is measured before u changes,
    so it holds the share of the hand's mass under the u that acted until then.

    Args:
        axes: "x", "y", or "xy" for both.
        b: clay [N.s/m].
        operator: Th; None for Th = 0.
        Ts: control sample [s].
        delay: from the sample to the change of u that it causes [s].
        render: the clay is "held" by the motors or "implicit".
        pose: mobility of the arm [1/kg], shape (n, n), and whether the servo shapes the inertia;
            None for the gains of Sh.

    Returns:
        M - 1, shape (m, m), without the loss of digits of the difference; beta, shape (m, n);
        gamma, shape (n, m). m = n (7 + N). K is the diagonal matrix of the gains.
    """
    implicit = choice("render", render, RENDERS) == "implicit"
    th, n, nominal = hand_or_none(operator), len(axes), _nominal_mobility(axes)
    W, shaping = (nominal, False) if pose is None else pose
    whole = math.floor(delay / Ts + 1e-9)
    part = max(delay / Ts - whole, 0.0) if delay / Ts - whole > 1e-9 else 0.0
    m, newest = n * (7 + whole), 6 * n
    inertia = np.linalg.inv(W)
    # Hand and handle in the directions in which they have one mass: there the axes are decoupled.
    masses, directions = np.linalg.eigh(inertia + th.mass * np.eye(n))
    w = (directions / masses) @ directions.T
    damper = th.damper + b if implicit else th.damper

    def moved(t: float) -> tuple[np.ndarray, np.ndarray]:
        """Change of (p of each axis, v of each axis) over t [s], and that for a held u."""
        change, drive = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n))
        for mass, direction in zip(masses.tolist(), directions.T, strict=True):
            own, held = _moved(np.array([-th.spring, -damper]) / mass, 1.0 / mass, t)
            share = np.outer(direction, direction)
            change += np.kron(own, share)
            drive += np.kron(held[:, None], share)
        return change, drive

    (rest, new), (head, old) = (moved(x * Ts) for x in (1.0 - part, part))
    queue = np.zeros((n, n * (1 + whole)))
    force = np.hstack((_over_states(axes, [-th.spring, -th.damper - b]), queue))
    before = np.hstack((w @ _over_states(axes, [-th.spring, -damper]), queue))
    before[:, -n:] += w
    gamma = force - th.mass * before
    u = np.hstack((inertia @ _feedback(axes), queue))
    if not implicit:
        u += np.hstack((_over_states(axes, [0.0, -b]), queue))
    if shaping:
        u += (inertia @ nominal - np.eye(n)) @ gamma

    less, beta = np.zeros((m, m)), np.zeros((m, n))
    place = [6 * j + k for k in (0, 1) for j in range(n)]
    less[np.ix_(place, place)] = rest + head + rest @ head
    less[place, m - n :] = old + rest @ old
    if whole:
        late = newest + n * (whole - 1)
        less[place, late : late + n] += new
    else:
        less[place] += new @ u
    for j, axis in enumerate(axes):
        own = slice(6 * j + 2, 6 * j + 6)
        A, B = controller.held_compensator(axis, 1.0, Ts)
        less[own, own], beta[own, j] = A - np.eye(4), B
    less[newest : newest + n] = u
    less[np.arange(newest + n, m), np.arange(newest, m - n)] = 1.0
    less[np.arange(newest, m), np.arange(newest, m)] -= 1.0
    return less, beta, gamma


def _nominal_mobility(axes: str) -> np.ndarray:
    return np.diag([S[AXES.index(choice("axis", axis, AXES))].gain for axis in axes])


def _feedback(axes: str) -> np.ndarray:
    """The servo's law over the states of all axes, shape (n, 6 n)."""
    out = np.zeros((len(axes), 6 * len(axes)))
    for j, axis in enumerate(axes):
        out[j, 6 * j : 6 * j + 6] = controller.feedback_vector(axis)
    return out


def _over_states(axes: str, row: list[float]) -> np.ndarray:
    """The same row over (p, p') of each axis, shape (n, 6 n)."""
    return np.kron(np.eye(len(axes)), np.array([*row, 0.0, 0.0, 0.0, 0.0]))


def _moved(own: np.ndarray, w: float, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Change of (p, v) over t [s] under p'' = own @ (p, v) + w u.

    The response to a pulse, and its integral, are divided differences of exp(s t) at the roots 0,
    slow and fast, written so that nothing cancels however stiff the clay.

    Returns:
        The change for p and v before, shape (2, 2), and for a held u, shape (2,).
    """
    fast = 0.5 * (own[1] - cmath.sqrt(own[1] * own[1] + 4.0 * own[0]))
    slow = -own[0] / fast if fast else 0.0

    def mean(x: complex) -> complex:  # of exp(x u) over u from 0 to 1
        return np.expm1(x) / x if x else 1.0

    pulse = cmath.exp(slow * t) * mean((fast - slow) * t) * t
    if abs(fast) * t > 1.0:
        sums = (pulse - mean(slow * t) * t) / fast
    else:
        chain = np.array([[0.0, 1.0, 0.0], [0.0, slow, 1.0], [0.0, 0.0, fast]])
        sums = controller.matrix_exponential(t * chain)[0, 2]
    pulse, sums = pulse.real, sums.real
    change = [[own[0] * sums, pulse], [own[0] * pulse, own[1] * pulse + own[0] * sums]]
    return np.array(change), w * np.array([sums, pulse])


def crossing_times(
    axis: str, K: float, uh: float, edges: Sequence[float], b: Sequence[float], t_max: float = 100.0
) -> list[float]:
    """Times at which a handle that starts at rest under a constant force passes each border.

    Without a hand, exact: between borders the loop is linear, so a matrix exponential moves it, and
    the times are found by bisection to rounding (Brent 1973).

    Args:
        axis: "x" or "y".
        K: compensator gain.
        uh: muscle force [N].
        edges: borders, ascending [m].
        b: clay before each border [N.s/m].
        t_max: end of the search [s].

    Returns:
        One time for each border that is passed before t_max [s].
    """
    from scipy.optimize import brentq

    z, t, out = np.zeros(7), 0.0, []
    z[6] = uh
    for edge, here in zip(edges, b, strict=True):
        A = np.zeros((7, 7))
        A[:6] = np.hstack(state_space(axis, K, here))
        step = 1e-3
        E = controller.matrix_exponential(A * step)
        while (ahead := E @ z)[0] < edge and t < t_max:
            z, t = ahead, t + step
        if t >= t_max:
            break

        def beyond(h: float, A=A, z=z, edge=edge) -> float:
            return float((controller.matrix_exponential(A * h) @ z)[0]) - edge

        h: Any = brentq(beyond, 0.0, step, xtol=1e-15)
        z, t = controller.matrix_exponential(A * h) @ z, t + h
        out.append(t)
    return out
