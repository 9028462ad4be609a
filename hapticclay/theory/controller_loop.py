"""Stability of a loop with a sampled controller of one's own, from its linear law around rest.

Between samples the arm, the hand and physical clay move under held torques: small motions around
rest are exactly linear, also at poses where the axes are coupled. With the law as matrices the loop
over a control sample is a matrix too, and its eigenvalues decide.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from .. import matrices
from ..arguments import checked, named
from ..errors import Bound, ParameterError, Real, array_of, integer, number
from ..formulas.constants import B_MAX
from ..model import support
from ..model.controller import matrix_exponential
from ..model.hardware import Hardware, butterworth
from ..model.sampled_controller import Controller, LawCaller
from ..model.traits import LEFT_OUT, present
from ..results import Result
from ..scene.scenario import Scenario
from .linear_loop import whole_samples
from .loops import dampings_of
from .resting_arms import resting_arm

COVERED = ("velocity by difference", "force filter")  # left out by the theory of the paper's loop
GAINS = np.geomspace(1e-3, 1e3, 601)  # of the search, as shares of the controller's own, 1 included
RUNGS = 10.0 ** np.arange(
    0.0, -4.0, -1.0
)  # shares of the size of motions at which slopes are taken
BENT = 0.1  # share of itself by which a slope may differ at that size
SMALL = 1e-3  # share of the largest slope of an answer below which another counts as nothing
ROUNDED = 1e-12  # rounding of an answer, as a share of the largest
AT_REST = 1e-9  # torque [N.m] and change of a state that count as rest
LATER = 1000.0  # [s] time at which a law must answer as at first
STRAIGHT = 1e-9  # of the largest entry: loops that differ by less from a straight line are on it
FREE = 1e-11  # singular values below this share of the largest are those of free motion


@named
@dataclass(frozen=True, eq=False)
class LinearLaw:
    """A sampled controller around rest: s(k+1) = A s(k) + B y(k), torques = C s(k) + D y(k).

    Of j joints and a handle that moves along a axes; 2 and 2 for the two-link arm.

    Attributes:
        A: state matrix, of n states, shape (n, n).
        B: input matrix, shape (n, 2 j + a). The inputs y are the measured positions of the joints
            [rad], their rates [rad/s], and the hand force along each axis [N].
        C: output matrix, shape (j, n). The outputs are the torques of the joints [N.m].
        D: feedthrough, shape (j, 2 j + a).
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    def __post_init__(self):
        A = array_of("A", self.A)
        n = len(A) if A.ndim == 2 else 0
        D = array_of("D", self.D)
        j, y = D.shape if D.ndim == 2 else (2, 6)
        if not 2 * j < y <= 2 * j + 3:
            bound = "must be finite numbers of the shape (j, 2 j + a), of j joints and a axes"
            raise ParameterError("D", self.D, bound)
        for name, shape in {"A": (n, n), "B": (n, y), "C": (j, n), "D": (j, y)}.items():
            given = array_of(name, getattr(self, name))
            empty = not given.size and not math.prod(shape)  # [] for a controller without states
            if (given.shape != shape and not empty) or not np.isfinite(given).all():
                bound = f"must be finite numbers of the shape {shape}, A square"
                raise ParameterError(name, getattr(self, name), bound)
            object.__setattr__(self, name, given.reshape(shape))

    def scaled(self, gain: float) -> LinearLaw:
        """The controller with its torques multiplied.

        Args:
            gain: factor of the torques.
        """
        return replace(self, C=gain * self.C, D=gain * self.D)


@named
@dataclass(frozen=True, eq=False, repr=False)
class ControllerStability(Result):
    """Stability of a loop with a sampled controller of one's own.

    Attributes:
        gain: the controller's own gain: a parameter of it, or 1 for its torques as they are.
        low: least gain of the stable band [unit of the gain]: around the own gain, or else the
            nearest; 0 if every lower gain that was tried is stable.
        high: largest gain of that band; inf if every higher one is stable, 0 for no band.
        omega: angular frequency of the oscillation at `high` [rad/s]; NaN for none.
        poles: eigenvalues z of the loop over a sample at the own gain, largest first, without free
            motion, shape (n,).
        gains: gains of the search, shape (m,).
        rates: growth rate of the least damped mode at each [1/s], shape (m,).
        law: the controller around rest.
        rest: joint positions at rest [rad], [m] of joints that slide.
        Ts: control sample [s].
        b: physical clay [N.s/m].
        left_out: parts of the scenario that the analysis neglects.
    """

    drawn_by = "hapticclay.views.theory_plots:growth_plot"

    gain: float
    low: float
    high: float
    omega: float
    poles: np.ndarray
    gains: np.ndarray
    rates: np.ndarray
    law: LinearLaw
    rest: tuple[float, ...]
    Ts: float
    b: float
    left_out: tuple[str, ...] = ()

    @property
    def stable(self) -> bool:
        """Whether the loop is stable at the controller's own gain."""
        return self.low < self.gain < self.high

    def headline(self) -> str:
        """Verdict, largest stable gain and frequency, in one line."""
        verdict = "stable" if self.stable else "unstable"
        if not self.high:
            return f"{verdict} at every gain from {self.gains[0]:.4g} to {self.gains[-1]:.4g}"
        band = f"{verdict} at gain {self.gain:.4g}; stable from {self.low:.4g} to {self.high:.4g}"
        return band + (
            f", where it oscillates at {self.omega / math.tau:.4g} Hz" if self.omega > 0.0 else ""
        )

    def tables(self) -> dict[str, dict[str, list[float]]]:
        """The band of stable gains; the poles; growth rate over gain."""
        with np.errstate(divide="ignore"):  # a pole at z = 0 decays at once
            rates = np.log(np.abs(self.poles)) / self.Ts
        return {
            "gain": {
                "own": [self.gain],
                "least stable": [self.low],
                "largest stable": [self.high],
                "oscillates at [Hz]": [self.omega / math.tau],
            },
            "poles": {
                "Re z": self.poles.real.tolist(),
                "Im z": self.poles.imag.tolist(),
                "frequency [Hz]": (np.abs(np.angle(self.poles)) / (math.tau * self.Ts)).tolist(),
                "growth rate [1/s]": rates.tolist(),
            },
            "search": {"gain": self.gains.tolist(), "growth rate [1/s]": self.rates.tolist()},
        }


@checked
def controller_stability(
    scenario: Scenario,
    *,
    gain: int | None = None,
    b: Annotated[Real | None, Bound(0.0, B_MAX, "N.s/m")] = None,
    matrices: LinearLaw | None = None,
    size: Annotated[float, Bound(1e-9, 1.0)] = 1e-2,
) -> ControllerStability:
    """Stability and largest stable gain of a loop with a sampled controller of one's own.

    The law is linearised around rest; arm, hand and physical clay move exactly between samples,
    under torques that are held and delayed. An arm from a file may rest elsewhere than at its pose,
    where weights and springs are balanced. Velocity by difference, its filter and the force filter
    count; friction, converters, torque limits and the muscle force do not (`left_out`). Gains from
    1/1000 to 1000 times the own one are searched, 2 % apart, so a narrower window may be
    missed; the ends of the band are exact to rounding.

    Args:
        scenario: the run, with its controller; rest is sought from its start.
        gain: index of the parameter of the controller that is varied, > 0; None scales its torques.
        b: physical clay on both axes [N.s/m]; None for the damping of the scenario's clay with the
            least limit, 0 without physical clay.
        matrices: the law around rest at the start; None takes them from differences of the law.
        size: largest deviation from rest within which the law must be linear to 10 %, 1e-9 to 1:
            of angles [rad], rates [rad/s], forces [N] and states in their own units.

    Raises:
        ParameterError: the scenario has no controller, the law does not rest near the start,
            depends on the time, or is not linear around rest (quantized, saturating or
            discontinuous), or a value is out of its bounds.
        RuntimeError: the law failed (`LawFailed`).
    """
    made = scenario.controller
    if made is None:
        raise ParameterError("controller", None, "must be given: gain_limit is for the paper's own")
    if not isinstance(made, Controller):
        raise ParameterError("controller", made, "must be your own: joint_limits judges this law")
    if b is not None:
        dampings = [b]
    else:
        clay = scenario.clay if scenario.render == "physical" else None
        dampings = dampings_of(clay, (0, 1)) or [0.0]
    own = 1.0 if gain is None else _parameter(made, gain, matrices)
    rest = Rest(scenario, made if matrices is None else None)
    known = matrices or rest.linear_law(size)
    _check_shape(known, rest)

    def loop(K: float, b: float) -> np.ndarray:
        here, law = rest, known.scaled(K)
        if gain is not None:
            values = (*made.params[:gain], K, *made.params[gain + 1 :])
            here = Rest(scenario, replace(made, params=values), rest)
            law = here.linear_law(size)
        return Plant(scenario, here, b, len(known.A)).map(law)

    Ts, gains = scenario.Ts or scenario.dt, own * GAINS
    found = []
    for damping in dampings:
        at = by_gain(lambda K, b=damping: loop(K, b), own)
        rates = np.array([growth(at(K), Ts)[0] for K in gains.tolist()])
        low, high = stable_band(lambda K, at=at: growth(at(K), Ts)[0], gains, rates)
        omega = growth(at(high), Ts)[1] if 0.0 < high < math.inf else math.nan
        poles = moving_modes(at(own))
        poles = poles[np.argsort(-np.abs(poles))]
        found.append((own, low, high, omega, poles, gains, rates, known, rest.joints, Ts, damping))
    return ControllerStability(*min(found, key=lambda x: x[2]), left_out=_neglected(scenario))


def by_gain(loop: Callable[[float], np.ndarray], own: float) -> Callable[[float], np.ndarray]:
    """The loop over its gain: a line, if it is one at twice and four times the own gain."""
    one, two, four = (loop(x * own) for x in (1.0, 2.0, 4.0))
    change = two - one
    if np.abs(four - one - 3.0 * change).max() > STRAIGHT * np.abs(four).max():
        return loop
    return lambda K: one + (K / own - 1.0) * change


def _parameter(made: Controller, gain: int, matrices: LinearLaw | None) -> float:
    """The parameter that is the gain."""
    if matrices is not None:
        raise ParameterError("gain", gain, "must be None with matrices, which have one gain")
    if not made.params:
        raise ParameterError("gain", gain, "must be None: the controller has no parameters")
    i = integer("gain", gain, 0, len(made.params) - 1)
    return number(f"controller.params.{i}", made.params[i], 0.0, above=True)


def _check_shape(law: LinearLaw, rest: Rest) -> None:
    """Refuses matrices of an arm with another number of joints or axes."""
    n, y = len(rest.joints), rest.inputs
    if law.D.shape != (n, y):
        bound = f"must have D of the shape ({n}, {y}): {n} joints, {rest.arm.axes} axes"
        raise ParameterError("matrices", law.D.shape, bound)


def _neglected(s: Scenario) -> tuple[str, ...]:
    clay = [] if s.clay is None else present(s.clay, support.LAWS)
    parts = [*clay, *present(s, support.PARTS)]
    names = [x.name for x in parts if x.theory == LEFT_OUT and x.name not in COVERED]
    rubs = not s.is_closed_form and any(s.file_arm.friction)  # type: ignore[arg-type]
    return (*names, *(["joint friction"] if rubs else []))


# ---- the law around rest -------------------------------------------------------------------------


class Rest:
    """Where handle and controller rest.

    Args:
        scenario: the run.
        controller: its controller; None rests at the start.
        near: another rest, from which it is sought in place of the start.

    Attributes:
        arm: the arm around it.
        joints: positions of the joints there.
        state: state of the controller.
        force: hand force there along each axis [N].
    """

    def __init__(self, scenario: Scenario, controller: Controller | None, near: Rest | None = None):
        self.hands, self.arm = scenario.hands, resting_arm(scenario)
        n = len(self.arm.start)
        at = self.arm.start
        self.state = np.array([] if controller is None else controller.state)
        if controller is not None:
            self.controller = controller
            self.caller = LawCaller(controller, n, self.arm.axes)
            self.buffer = self.caller.numbers
            begin = (at, self.state) if near is None else (near.joints, near.state)
            at = self._sought(np.concatenate(begin))
            at, self.state = at[:n], at[n:]
        self.joints = tuple(map(float, at))
        self.force = self.arm.force(at)

    @property
    def q(self) -> np.ndarray:
        """The joints at rest, shape (n,)."""
        return np.array(self.joints)

    @property
    def inputs(self) -> int:
        """Numbers that the law measures."""
        return 2 * len(self.arm.start) + self.arm.axes

    def answer(self, x: np.ndarray, t: float = 0.0) -> np.ndarray:
        """Torques and next state under measurements and a state."""
        n, first, y = len(self.state), self.caller.start, self.inputs
        self.buffer[0], self.buffer[1 : 1 + y] = t, x[:y]
        self.buffer[first : first + n] = x[y:]
        self.caller()
        self.caller.check()
        after = self.buffer[first + n : first + 2 * n]
        return np.concatenate((self.buffer[1 + y : first], after))

    def _measured(self, at: np.ndarray) -> np.ndarray:
        q, state = np.split(at, [len(self.arm.start)])
        return np.concatenate((q, np.zeros(len(q)), self.arm.force(q), state))

    def _unrest(self, at: np.ndarray) -> np.ndarray:
        """Torques that nothing balances, and change of the state."""
        out, n = self.answer(self._measured(at)), len(self.arm.start)
        out[:n] += self.arm.static(at[:n])
        out[n:] -= at[n:]
        return out

    def _sought(self, at: np.ndarray) -> np.ndarray:
        """Joint angles and state at rest, from those at the start."""
        from scipy.optimize import least_squares

        left = self._unrest(at)
        if np.abs(left).max(initial=0.0) > AT_REST:
            at = least_squares(self._unrest, at, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
            left = self._unrest(at)
        if np.abs(left).max(initial=0.0) > AT_REST:
            torques, change = np.split(left, [len(self.arm.start)])
            bound = (
                "must come to rest near the start; the nearest it comes leaves torques of "
                f"({', '.join(f'{x:.3g}' for x in torques)}) N.m"
            ) + (f" and moves its state by {np.abs(change).max():.3g}" if len(change) else "")
            raise ParameterError("controller.law", self.controller.law, bound)
        return at

    def linear_law(self, size: float) -> LinearLaw:
        """The law as matrices, from differences."""
        x = self._measured(np.concatenate((self.joints, self.state)))
        if not np.array_equal(self.answer(x), self.answer(x, LATER)):
            bound = "must not depend on the time t: its answer at rest changes"
            raise ParameterError("controller.law", self.controller.law, bound)
        n, y = len(self.joints), self.inputs
        sizes = {"q": n, "qd": n, "fh": self.arm.axes, "state": len(self.state)}
        names = [f"{name}[{i}]" for name, many in sizes.items() for i in range(many)]
        slopes = np.column_stack([self._slope(x, j, size, name) for j, name in enumerate(names)])
        return LinearLaw(slopes[n:, y:], slopes[n:, :y], slopes[:n, y:], slopes[:n, :y])

    def _slope(self, x: np.ndarray, j: int, size: float, name: str) -> np.ndarray:
        """Slope of each answer over one input, if differences converge to it.

        Slopes forwards and backwards are taken over four decades of steps. Of a smooth law they
        differ by a share of the step; of a quantized, saturating or broken one they do not.
        """
        here, unit = self.answer(x), np.eye(len(x))[j]
        steps = size * RUNGS
        ahead = np.array([(self.answer(x + h * unit) - here) / h for h in steps])
        behind = np.array([(here - self.answer(x - h * unit)) / h for h in steps])
        middle = 0.5 * (ahead + behind)
        largest = np.maximum(np.abs(ahead), np.abs(behind)).max(axis=0)
        rounding = ROUNDED * np.abs(here + size * largest).max(initial=1.0) / steps[:, None]
        room = RUNGS[:, None] * (largest + SMALL * largest.max())
        apart = np.abs(ahead - behind) > room + rounding
        changes = np.abs(middle - middle[-1]) > BENT * room + rounding + rounding[-1]
        if wrong := np.argwhere(apart | changes).tolist():
            row, out = wrong[0]
            n = len(self.joints)
            what = f"torques[{out}]" if out < n else f"state[{out - n}]"
            bound = (
                f"must be linear around rest: the slope of {what} over {name} is "
                f"{ahead[row, out]:.4g} forwards and {behind[row, out]:.4g} backwards at "
                f"{steps[row]:.0e}, {middle[-1, out]:.4g} at {steps[-1]:.0e}: quantized, "
                "saturating or discontinuous within size"
            )
            raise ParameterError("controller.law", self.controller.law, bound)
        return (100.0 * middle[2] - middle[1]) / 99.0  # without the square of the step


# ---- the loop over a sample ----------------------------------------------------------------------


class Plant:
    """Arm, hand and physical clay around rest, with hold, delay and measurement.

    Args:
        scenario: the run.
        rest: where it rests.
        b: physical clay [N.s/m].
        states: number of states of the controller.
    """

    def __init__(self, scenario: Scenario, rest: Rest, b: float, states: int):
        self.Ts, self.parts = scenario.Ts or scenario.dt, scenario.hardware or Hardware()
        arm, q = rest.arm, rest.q
        self.jacobian = u = arm.jacobian(q)
        self.mass, self.damper, self.spring = (
            np.diag([getattr(hand, name) for hand in rest.hands])
            for name in ("mass", "damper", "spring")
        )
        clay = b * np.diag([1.0, 1.0, 0.0][: arm.axes])  # along the axes of its plane
        self.push = np.linalg.inv(arm.inertia(q) + u.T @ self.mass @ u)  # by torques
        self.place = self.push @ arm.slope(q)
        self.rate = -self.push @ (arm.damping(q) + u.T @ (self.damper + clay) @ u)
        self.open = self._open_loop(states)

    def _moved(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Transition of positions and rates of the joints over t [s], response to held torques."""
        n = len(self.push)
        a = np.zeros((3 * n, 3 * n))
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n] = np.hstack((self.place, self.rate, self.push))
        e = matrix_exponential(t * a)
        return e[: 2 * n, : 2 * n], e[: 2 * n, 2 * n :]

    def _open_loop(self, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The loop over a sample without the law of n states: x+ = F x + G (tau, s+), (s, y) = H x.

        x holds positions and rates of the joints, the controller's state, the positions in the
        window, filtered rates, states of the force filter, then the torques of the last
        samples, newest first.
        """
        parts, (axes, j) = self.parts, self.jacobian.shape
        whole, part = whole_samples(parts.delay, self.Ts)
        differs = parts.velocity == "difference"
        window = j * parts.velocity_window * differs
        cutoff, sieve_cutoff = parts.velocity_filter if differs else None, parts.force_filter
        smooth, filtered = j * (cutoff is not None), 2 * axes * (sieve_cutoff is not None)
        at = np.cumsum([0, j, j, n, window, smooth, filtered, j * (1 + whole)])
        unit = np.eye(at[-1] + j + n)  # behind x, the torques and the state that the law returns
        q, rate, state, past, slow, sieve, queue = (
            unit[first:end] for first, end in zip(at[:-1], at[1:], strict=True)
        )
        torques, after, oldest = unit[at[-1] : at[-1] + j], unit[at[-1] + j :], queue[-j:]
        w = rate
        if differs:
            w = (q - past[-j:]) / (parts.velocity_window * self.Ts)
        if cutoff is not None:
            keep = math.exp(-math.tau * cutoff * self.Ts)
            w = keep * slow + (1.0 - keep) * w
        turning = self.place @ q + self.rate @ rate + self.push @ oldest
        u = self.jacobian
        force = -(self.damper @ u @ rate + self.spring @ u @ q + self.mass @ u @ turning)
        sieved = sieve
        if sieve_cutoff is not None:
            f = np.array(butterworth(sieve_cutoff, parts.filter_order, self.Ts))
            sieved = np.kron(np.eye(axes), f[:4].reshape(2, 2)) @ sieve + np.kron(
                force, f[4:, None]
            )
            force = sieve[::2]
        due = np.vstack((torques, queue))[j * whole : j * (whole + 1)]
        moved = np.vstack((q, rate))
        for t, held in ((part, oldest), (1.0 - part, due)):
            change, push = self._moved(t * self.Ts)
            moved = change @ moved + push @ held
        ahead = (
            moved,
            after,
            np.vstack((q, past))[:window],
            w[:smooth],
            sieved,
            torques,
            queue[:-j],
        )
        step, seen = np.vstack(ahead), np.vstack((state, q, w, force))
        return step[:, : at[-1]], step[:, at[-1] :], seen[:, : at[-1]]

    def map(self, law: LinearLaw) -> np.ndarray:
        """The loop over a sample, x(k+1) = map x(k), x at the sample before its control acts."""
        F, G, H = self.open
        return F + G @ np.block([[law.C, law.D], [law.A, law.B]]) @ H


# ---- stability -----------------------------------------------------------------------------------


def moving_modes(loop: np.ndarray) -> np.ndarray:
    """Eigenvalues of a loop, but for those of free motion: of places and speeds that just stay."""
    from scipy.linalg import matrix_balance

    loop = matrix_balance(loop, permute=False)[0]
    while len(loop):
        _, size, vectors = matrices.svd(loop - np.eye(len(loop)))
        moving = vectors[: np.count_nonzero(size > FREE * size[0])]
        if len(moving) == len(loop):
            break
        loop = moving @ loop @ moving.T
    return matrices.eigenvalues(loop)


def growth(loop: np.ndarray, Ts: float) -> tuple[float, float]:
    """Growth rate of the least damped mode [1/s], and its angular frequency [rad/s]."""
    z = moving_modes(loop)
    z = z[np.argmax(np.abs(z))]
    return math.log(max(abs(z), 1e-300)) / Ts, abs(float(np.angle(z))) / Ts


def stable_band(
    rate: Callable[[float], float], gains: np.ndarray, rates: np.ndarray
) -> tuple[float, float]:
    """Ends of the band of stable gains around the middle one, or nearest to it; (0, 0) for none."""
    from scipy.optimize import brentq

    stable, middle = np.flatnonzero(rates < 0.0), len(gains) // 2
    if not len(stable):
        return 0.0, 0.0
    inside = stable[np.argmin(np.abs(stable - middle))]

    def edge(step: int, end: float) -> float:
        for i in range(inside, 0 if step < 0 else len(gains) - 1, step):
            if rates[i + step] >= 0.0:
                low, high = sorted((gains[i], gains[i + step]))
                return float(brentq(rate, low, high, rtol=1e-13))  # type: ignore[arg-type]
        return end

    return edge(-1, 0.0), edge(1, math.inf)
