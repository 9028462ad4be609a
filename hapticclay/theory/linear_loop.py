"""The linear loop (Fig. 2): its parts, closed-loop polynomials, state space and sampled map.

`theory` and `studies` model a loop as one axis at the nominal pose. Polynomials describe one axis;
state spaces describe one axis, or both where a pose couples them.
"""

from __future__ import annotations

import cmath
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from ..arguments import named
from ..errors import Bound, ParameterError, Real, choice, number
from ..fields import check_fields
from ..formulas import arm as arm_law
from ..formulas.constants import B_MAX
from ..model import controller
from ..model.arm import Arm
from ..model.compensator import PRINTED, Compensator
from ..model.constants import AXES
from ..model.controller import SERVO, Servo
from ..model.operator import NO_HAND, Operator
from ..model.spring import STIFFNESS_MAX
from ..scene.scenario import Render
from . import roots
from .exact_roots import rational

FASTEST = 1e9  # [m/s] of a steady velocity


@named
@dataclass(frozen=True)
class LinearLoop:
    """One axis of the loop at the nominal pose, by its parts.

    Attributes:
        axis: "x" or "y".
        b: clay [N.s/m], 0 to 1e9.
        operator: Th, the arm at the handle; None for no hand (Th = 0).
        servo: G and Sh; None for the printed ones of the axis. The gain of Sh is the mobility of
            the handle in the loop, the arm's own or a shaped one.
        compensator: shape of C. Systems of python-control and scipy.signal are accepted too.
        K: gain of the compensator, >= 0; None where the analysis needs none.
        Ts: control sample [s], 1e-6 to 1; None for continuous time.
        delay: from a measurement to the torque computed from it [s], 0 to 1, at most 100 Ts. It
            delays every action of the motors: the servo's feedback, the compensator's command, and
            held clay.
        render: the clay is "held" (a force of the motors) or "physical" (never delayed).
        mobility: mobility of the bare handle where the servo shapes its inertia [1/kg], needed with
            sampling or delay; None for the gain of Sh.
        k: stiffness of the clay, an elastic wall with its rest at p = 0, Te = b s + k [N/m], 0 to
            1e9; held, physical or delayed like b.
    """

    axis: Literal["x", "y"] = "x"
    b: Annotated[Real, Bound(0.0, B_MAX, "N.s/m")] = 0.0
    operator: Operator | None = None
    servo: Servo = None  # type: ignore[assignment]  # __post_init__ puts the axis's own there
    compensator: Compensator = PRINTED
    K: Annotated[float | None, Bound(0.0)] = None
    Ts: Annotated[Real | None, Bound(1e-6, 1.0, "s")] = None
    delay: Annotated[Real, Bound(0.0, 1.0, "s")] = 0.0
    render: Render = "held"
    mobility: Annotated[Real | None, Bound(0.0, 1e12, "1/kg", above=True)] = None
    k: Annotated[Real, Bound(0.0, STIFFNESS_MAX, "N/m")] = 0.0

    def __post_init__(self):
        axis = AXES.index(choice("axis", self.axis, AXES))
        if self.servo is None:
            object.__setattr__(self, "servo", SERVO[axis])
        if not isinstance(self.compensator, Compensator):
            object.__setattr__(self, "compensator", Compensator.of(self.compensator))
        check_fields(self)
        if self.Ts is not None:
            number("delay", self.delay, 0.0, 100.0 * self.Ts, unit="s")

    @property
    def gain(self) -> float:
        """K.

        Raises:
            ParameterError: it is None.
        """
        if self.K is None:
            raise ParameterError("K", None, "must be given: the analysis is of a loop with a gain")
        return self.K

    @property
    def hand(self) -> Operator:
        """The operator's arm, or one of zeros for None."""
        return self.operator or NO_HAND

    @property
    def environment(self) -> Polynomial:
        """Te + Th, clay and the operator's arm (Eqs. 4, 19), as a polynomial in s."""
        th = self.hand
        return Polynomial([th.spring + self.k, th.damper + self.b, th.mass])


def steady_speed(
    K: float, f: float, b: Any, compensator: Compensator = PRINTED, servo: Servo = SERVO[0]
) -> Any:
    """Speed under a constant hand force, K f/(10 + K b) with the printed parts [m/s].

    The compensator's damper and the clay share the force: f = (1/(K c) + b) v, c the limit of s C
    G/K as s goes to 0 (Eqs. 20, 21). Without an integrator in C the handle comes to rest. With two
    it speeds up until the clay carries all of the force; without clay its speed grows without
    bound.
    """
    num, den = (p.coef for p in reduced(compensator).fraction)
    n = np.count_nonzero(np.cumsum(den != 0.0) == 0)  # integrators
    if n == 0 or K == 0.0 or f == 0.0:
        return 0.0 * b
    if n > 1:
        with np.errstate(divide="ignore"):
            speed = np.divide(f, b)
        return speed if isinstance(b, np.ndarray) else float(speed)
    c = num[0] * (servo.G.gain / servo.G.stiffness)
    return K * c * f / (den[1] + K * c * b)


def steady_damper(K: float, compensator: Compensator = PRINTED, servo: Servo = SERVO[0]) -> float:
    """Equivalent damper of the handle in steady motion, 10/K with the printed parts [N.s/m]."""
    num, den = (p.coef for p in reduced(compensator).fraction)
    if den[0] != 0.0 or K == 0.0:
        return math.inf
    return float(den[1] / (K * num[0] * (servo.G.gain / servo.G.stiffness)))


def steady_velocity(f: Any, damper: Any, Fy: float, K: float, n: float) -> np.ndarray:
    """Velocity in clay that yields under a constant force: f = damper v + (Fy + K |v|^n) v/|v|."""
    f, damper = np.asarray(f, dtype=float), np.asarray(damper, dtype=float)
    size = math.hypot(*f)
    if size <= Fy:
        return np.zeros(f.shape)

    def resistance(m: float) -> np.ndarray:
        return damper * m + Fy + K * m**n

    # |v| = m where the length of f/resistance(m), which falls with m, is 1
    low, high = 0.0, 1.0
    while math.hypot(*(f / resistance(high))) > 1.0:
        low, high = high, 2.0 * high
        if high > FASTEST:
            return np.where(f != 0.0, np.copysign(math.inf, f), 0.0)
    while low < (m := 0.5 * (low + high)) < high:
        if math.hypot(*(f / resistance(m))) > 1.0:
            low = m
        else:
            high = m
    return high * f / resistance(high)


def reduced(compensator: Compensator) -> Compensator:
    """A compensator with the common factors s of numerator and denominator cancelled."""
    num, den = compensator.num, compensator.den
    while num[-1] == den[-1] == 0.0:
        num, den = num[:-1], den[:-1]
    return compensator if den == compensator.den else Compensator(num, den)


# ---- polynomials ---------------------------------------------------------------------------------


def loop_polynomials(
    loop: LinearLoop, polynomial: Callable[[Any], Polynomial] = Polynomial
) -> tuple[Polynomial, Polynomial, Polynomial]:
    """Parts of the closed-loop polynomial: denominator + passive + K driven.

    The first is the common denominator of G, C and Sh, so the loop's transfer function
    (G C + Sh)(Te + Th) is (passive + K driven)/denominator.
    """
    s, cg = loop.servo.S, _forward_denominator(loop, polynomial)
    t = polynomial(loop.environment.coef)
    servo = polynomial([s.stiffness, s.damping, 1.0])
    num = polynomial(loop.compensator.fraction[0].coef)
    forward = polynomial([loop.servo.G.gain]) * (num * servo * t)
    return cg * servo, polynomial([s.gain]) * (cg * t), forward


def delayed_polynomials(
    loop: LinearLoop, polynomial: Callable[[Any], Polynomial] = Polynomial
) -> tuple[Polynomial, Polynomial, Polynomial]:
    """Parts of the closed-loop polynomial with delayed motors: physical + late (motors + K driven).

    With late = exp(-s delay), W the mobility of the bare handle, Wn the gain of Sh (the same
    without shaping) and T = Te + Th,

        0 = s^2 + W (Th + [physical] Te) + late (kd s + kp + [held] W Te + (Wn - W) T
            + (s^2 + kd s + kp) G C T)

    times the denominator of G C.
    """
    physical, motors = delayed_servo(loop, polynomial)
    cg = _forward_denominator(loop, polynomial)
    return cg * physical, cg * motors, loop_polynomials(loop, polynomial)[2]


def delayed_servo(
    loop: LinearLoop, polynomial: Callable[[Any], Polynomial] = Polynomial
) -> tuple[Polynomial, Polynomial]:
    """Parts of the closed-loop polynomial without compensator: physical + late motors."""
    s, th = loop.servo.S, loop.hand
    k, b = (loop.k, loop.b) if loop.render == "physical" else (0.0, 0.0)  # physical
    W = s.gain if loop.mobility is None else loop.mobility
    physical = polynomial([W * (th.spring + k), W * (th.damper + b), 1.0 + W * th.mass])
    motors = polynomial([s.stiffness + W * (loop.k - k), s.damping + W * (loop.b - b)])
    if loop.mobility is not None:
        motors = motors + polynomial([s.gain - W]) * polynomial(loop.environment.coef)
    return physical, motors


def _forward_denominator(
    loop: LinearLoop, polynomial: Callable[[Any], Polynomial] = Polynomial
) -> Polynomial:
    """Denominator of G C."""
    g, den = loop.servo.G, loop.compensator.fraction[1]
    return polynomial(den.coef) * polynomial([g.stiffness, g.damping, 1.0])


def characteristic(loop: LinearLoop) -> Polynomial:
    """Closed-loop polynomial of 1 + (G C + Sh)(Te + Th), the denominator of Eq. 8."""
    denominator, passive, driven = loop_polynomials(loop)
    return denominator + passive + loop.gain * driven


def device_admittance(loop: LinearLoop) -> tuple[Polynomial, Polynomial]:
    """G C + Sh, handle position over net force, as (numerator, denominator)."""
    unit_spring = replace(loop, b=0.0, k=0.0, operator=Operator(0.0, 0.0, 1.0))
    denominator, passive, driven = loop_polynomials(unit_spring)
    return passive + loop.gain * driven, denominator


def device_impedance(loop: LinearLoop) -> tuple[Polynomial, Polynomial]:
    """1/(s (G C + Sh)), net force over handle velocity, as (numerator, denominator)."""
    e, d = device_admittance(loop)
    return (d, roots.VARIABLE * e) if d.coef[0] else (d // roots.VARIABLE, e)


def stable(loop: LinearLoop) -> bool:
    """Return True if every closed-loop pole lies left of the imaginary axis, but free motion at 0.

    The answer is exact.
    """
    denominator, passive, driven = loop_polynomials(loop, rational)
    return roots.hurwitz(denominator + passive + rational([loop.gain]) * driven)


# ---- state spaces --------------------------------------------------------------------------------


def state_space(
    *loops: LinearLoop, mobility: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The loop in continuous time: z' = A z + B uh, with y = G delta.

    The servo's law is that of docs/equations.md, section 3.
    """
    n, at = len(loops), _places(loops)
    W = _shaped_mobility(loops) if mobility is None else mobility
    parts = [controller.controller_matrices(x.servo, x.compensator, x.gain) for x in loops]
    # Hand and clay without the hand's mass; p'' appears in the hand's force too.
    force = np.hstack((_over_states(loops, *_resistance(loops)), np.eye(n)))
    through = np.diag([drive[-1] for _, drive in parts])  # of C, in y'' at once
    mass = np.diag([x.hand.mass for x in loops])
    law = np.hstack((_feedback(loops), np.zeros((n, n)))) + (W + through) @ force
    acceleration = np.linalg.solve(np.eye(n) + (W + through) @ mass, law)
    net = force - mass @ acceleration
    AB = np.zeros((at[-1], at[-1] + n))
    for j, (own, drive) in enumerate(parts):
        k, inner = at[j], slice(at[j] + 2, at[j + 1])
        AB[k, k + 1] = 1.0
        AB[k + 1] = acceleration[j]
        AB[inner] = np.outer(drive, net[j])
        AB[inner, inner] += own
    return AB[:, : at[-1]], AB[:, at[-1] :]


def sampled_differences(
    *loops: LinearLoop, pose: tuple[np.ndarray, bool] | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The sampled loop x(k+1) = (M + beta K gamma) x(k), x at the sample before its control acts.

    x holds (p, v, states of the compensator, y, y') of each of the n axes, then the motors' force
    on the handle u(k-1), ..., u(k-1-N) [N] on each axis, with N the whole samples in the delay.
    Between samples handle and hand move under held u (matrix exponential); a fraction of a sample
    in the delay splits the hold in two (Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed.,
    3.2). As in `Sampled`, the net force f = gamma x that drives the compensator is measured before
    u changes, so its inertial part of the hand belongs to the previous u.
    """
    n, at, first = len(loops), _places(loops), loops[0]
    Ts, implicit = first.Ts, first.render == "physical"
    assert Ts is not None
    nominal = _shaped_mobility(loops)
    W, shaping = _nominal_pose(loops) if pose is None else pose
    whole, part = whole_samples(first.delay, Ts)
    newest = at[-1]
    m = newest + n * (1 + whole)
    inertia, mass = np.linalg.inv(W), np.diag([x.hand.mass for x in loops])
    places, rates = _resistance(loops)
    springs, dampers = _resistance(loops if implicit else [replace(x, b=0.0, k=0.0) for x in loops])
    masses, directions = np.linalg.eigh(inertia + mass)
    w = (directions / masses) @ directions.T
    (rest, new), (head, old) = (
        _moved(masses, directions, springs, dampers, x * Ts) for x in (1.0 - part, part)
    )
    queue = np.zeros((n, n * (1 + whole)))
    force = np.hstack((_over_states(loops, places, rates), queue))
    before = np.hstack((w @ _over_states(loops, springs, dampers), queue))
    before[:, -n:] += w
    gamma = force - mass @ before
    u = np.hstack((inertia @ _feedback(loops), queue))
    if not implicit:
        held = _over_states(loops, [-x.k for x in loops], [-x.b for x in loops])
        u += np.hstack((held, queue))
    if shaping:
        u += (inertia @ nominal - np.eye(n)) @ gamma

    less, beta = np.zeros((m, m)), np.zeros((m, n))
    place = [k + j for j in (0, 1) for k in at[:-1]]
    less[np.ix_(place, place)] = rest + head + rest @ head
    less[place, m - n :] = old + rest @ old
    if whole:
        late = newest + n * (whole - 1)
        less[place, late : late + n] += new
    else:
        less[place] += new @ u
    for j, loop in enumerate(loops):
        own = slice(at[j] + 2, at[j + 1])
        less[own, own], beta[own, j] = held_change(loop, 1.0)
        through = controller.controller_matrices(loop.servo, loop.compensator, 1.0)[1][-1]
        if through:  # of C, in y'' and so in u at once
            beta[newest : newest + n, j] = through * inertia[:, j]
            if not whole:
                beta[place, j] += new @ (through * inertia[:, j])
    less[newest : newest + n] = u
    less[np.arange(newest + n, m), np.arange(newest, m - n)] = 1.0
    less[np.arange(newest, m), np.arange(newest, m)] -= 1.0
    return less, beta, gamma


def whole_samples(delay: float, Ts: float) -> tuple[int, float]:
    """Whole samples in a delay, and the rest of it as a share of one; 0.0 within rounding."""
    whole = math.floor(delay / Ts + 1e-9)
    part = delay / Ts - whole
    return whole, part if part > 1e-9 else 0.0


def mobility_at(arm: Arm, x: float, y: float) -> np.ndarray:
    """Mobility of the bare handle with the handle at a world position [1/kg], shape (2, 2)."""
    u = arm_law.jacobian(*arm_law.inverse_kinematics(x, y, arm.links), arm.links)
    xx, xy, yy = arm_law.mobility(u, arm.links)
    return np.array([[xx, xy], [xy, yy]])


def _places(loops: Sequence[LinearLoop]) -> list[int]:
    """Index of the first state of each axis, and of the end of the last."""
    at = [0]
    for loop in loops:
        at.append(at[-1] + 4 + loop.compensator.order)
    return at


def _shaped_mobility(loops: Sequence[LinearLoop]) -> np.ndarray:
    return np.diag([x.servo.S.gain for x in loops])


def _nominal_pose(loops: Sequence[LinearLoop]) -> tuple[np.ndarray, bool]:
    """Mobility of the bare handle at the nominal pose, and whether the servo shapes it."""
    bare = [x.servo.S.gain if x.mobility is None else x.mobility for x in loops]
    return np.diag(bare), any(x.mobility is not None for x in loops)


def _resistance(loops: Sequence[LinearLoop]) -> tuple[np.ndarray, np.ndarray]:
    """Hand and clay without the hand's mass: force per place and per velocity of each axis."""
    hands = [x.hand for x in loops]
    dampers = np.array([-h.damper - x.b for h, x in zip(hands, loops, strict=True)])
    return np.array([-h.spring - x.k for h, x in zip(hands, loops, strict=True)]), dampers


def _feedback(loops: Sequence[LinearLoop]) -> np.ndarray:
    """The servo's law over the states of all axes, without the direct feedthrough of C."""
    at = _places(loops)
    out = np.zeros((len(loops), at[-1]))
    for j, loop in enumerate(loops):
        law, delta = controller.feedback_vector(loop.servo), loop.compensator.state_space()[2]
        out[j, at[j] : at[j + 1]] = [*law[:2], *(law[2] * delta), *law[4:]]
    return out


def _over_states(
    loops: Sequence[LinearLoop],
    place: Sequence[float] | np.ndarray,
    rate: Sequence[float] | np.ndarray,
) -> np.ndarray:
    """Rows over the states of all axes, with a factor on p and one on p' of each axis."""
    at = _places(loops)
    out = np.zeros((len(loops), at[-1]))
    for j, k in enumerate(at[:-1]):
        out[j, k : k + 2] = place[j], rate[j]
    return out


def _moved(
    masses: np.ndarray,
    directions: np.ndarray,
    springs: np.ndarray,
    dampers: np.ndarray,
    t: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Transition of (p of each axis, v of each axis) over t [s], and the response to held forces.

    In the directions (columns) hand and handle have one mass each, so the axes are decoupled there
    if all have the same hand.
    """
    n = len(masses)
    if np.ptp(springs) or np.ptp(dampers):
        w = (directions / masses) @ directions.T
        return _moved_together(np.hstack((np.diag(springs), np.diag(dampers))), w, t)
    change, drive = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, n))
    for size, direction in zip(masses.tolist(), directions.T, strict=True):
        own, held = held_motion(np.array([springs[0], dampers[0]]) / size, 1.0 / size, t)
        share = np.outer(direction, direction)
        change += np.kron(own, share)
        drive += np.kron(held[:, None], share)
    return change, drive


def _moved_together(force: np.ndarray, w: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """As `held_motion`, for axes that cannot be decoupled: p'' = w (force @ (p, v) + u)."""
    n = len(w)
    a = np.zeros((3 * n, 3 * n))
    a[:n, n : 2 * n] = np.eye(n)
    a[n : 2 * n] = np.hstack((w @ force, w))
    change = _exponential_less_one(t * a)
    return change[: 2 * n, : 2 * n], change[: 2 * n, 2 * n :]


def held_change(loop: LinearLoop, K: float) -> tuple[np.ndarray, np.ndarray]:
    """Compensator and reference model over a sample under held net force: z+ = z + D z + B f."""
    assert loop.Ts is not None
    A, B = controller.controller_matrices(loop.servo, loop.compensator, K)
    n = len(B)
    change = _exponential_less_one(loop.Ts * np.block([[A, B[:, None]], [np.zeros((1, n + 1))]]))
    return change[:n, :n], change[:n, n]


def _exponential_less_one(a: np.ndarray) -> np.ndarray:
    """exp(a) - 1; of a small matrix as a (1 + a/2 + ...), the second factor by an exponential."""
    n = len(a)
    if np.abs(a).sum(axis=1).max() > 1.0:  # the product would cancel, the difference does not
        return controller.matrix_exponential(a) - np.eye(n)
    larger = np.block([[a, np.eye(n)], [np.zeros((n, 2 * n))]])
    return a @ controller.matrix_exponential(larger)[:n, n:]


def held_motion(own: np.ndarray, w: float, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Change of position and velocity over a time under p'' = own @ (p, v) + w u.

    The response to a pulse, and its integral, are divided differences of exp(s t) at the roots 0,
    slow and fast, written without cancellation for clay of any stiffness.
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


class HeldArm(NamedTuple):
    """A mass, damper and spring under a sinusoidal and a held force, phasors of the fundamental.

    Each field has shape (n,), over the given frequencies. z = exp(j omega Ts).

    Attributes:
        place: position per unit of the sinusoidal force [m/N].
        speed: velocity per unit of the sinusoidal force [m/(N.s)].
        held_place: position at the samples, per unit of the force commanded at them [m/N].
        held_speed: velocity at the samples, likewise [m/(N.s)].
        before: force that acts up to a sample per unit of commanded force: z^-1 or a higher power
            of it.
        hold: fundamental of the held, delayed force per unit of commanded force.
    """

    place: np.ndarray
    speed: np.ndarray
    held_place: np.ndarray
    held_speed: np.ndarray
    before: np.ndarray
    hold: np.ndarray


def held_arm(
    mass: float, damper: float, spring: float, Ts: float, delay: float, omega: np.ndarray
) -> HeldArm:
    """Responses of a mass, damper and spring whose motor force is held from sample to sample."""
    change, new, old, whole = split_motion(mass, damper, spring, Ts, delay)
    s = 1j * omega
    before = np.exp(-s * Ts * (1 + whole))
    drive = np.multiply.outer(before, old) + np.multiply.outer(np.exp(-s * Ts * whole), new)
    ahead = np.expm1(s * Ts)[:, None, None] * np.eye(2) - change
    held = np.linalg.solve(ahead, drive[:, :, None])[:, :, 0]
    place = 1.0 / (mass * s * s + damper * s + spring)
    hold = -np.expm1(-s * Ts) / (s * Ts) * np.exp(-s * delay)
    return HeldArm(place, s * place, held[:, 0], held[:, 1], before, hold)


@functools.lru_cache(maxsize=256)  # a search for a limit asks for those of one arm again and again
def split_motion(
    mass: float, damper: float, spring: float, Ts: float, delay: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    """Change of (position, velocity) over a sample, and the responses to two held forces.

    The newer force is that of `whole` samples before; the older one, which it replaces within the
    sample, is that of one sample more.
    """
    whole, part = whole_samples(delay, Ts)
    own = np.array([-spring, -damper]) / mass
    head, old = held_motion(own, 1.0 / mass, part * Ts)
    rest, new = held_motion(own, 1.0 / mass, (1.0 - part) * Ts)
    return rest + head + rest @ head, new, old + rest @ old, whole


def crossing_times(
    loop: LinearLoop, uh: float, edges: Sequence[float], b: Sequence[float], t_max: float = 100.0
) -> list[float]:
    """Times at which a handle crosses each border, from rest under a constant force.

    The times are exact to rounding: between borders the loop is linear, so matrix exponentials
    advance it, and bisection locates the crossings (Brent 1973).
    """
    from scipy.optimize import brentq

    n = 4 + loop.compensator.order
    z, t, out = np.zeros(n + 1), 0.0, []
    z[n] = uh
    for edge, here in zip(edges, b, strict=True):
        A = np.zeros((n + 1, n + 1))
        A[:n] = np.hstack(state_space(replace(loop, b=here)))
        step = 1e-3
        E = controller.matrix_exponential(A * step)
        while (ahead := E @ z)[0] < edge and t < t_max:
            z, t = ahead, t + step
        if t >= t_max:
            break

        def gap(h: float, A=A, z=z, edge=edge) -> float:
            return float((controller.matrix_exponential(A * h) @ z)[0]) - edge

        h: Any = brentq(gap, 0.0, step, xtol=1e-15)
        z, t = controller.matrix_exponential(A * h) @ z, t + h
        out.append(t)
    return out
