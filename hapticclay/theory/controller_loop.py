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

from ..arguments import checked, named
from ..errors import Bound, ParameterError, Real, array_of, integer, number
from ..formulas import arm as arm_law
from ..formulas.constants import B_MAX
from ..model import support
from ..model.controller import matrix_exponential
from ..model.hardware import Hardware, butterworth
from ..model.sampled_controller import BUFFER, TORQUE, Controller, LawCaller
from ..model.traits import LEFT_OUT, present
from ..results import Result
from ..scene.scenario import Scenario
from .linear_loop import whole_samples
from .loops import dampings_of

MEASURED = ("q[0]", "q[1]", "qd[0]", "qd[1]", "fh[0]", "fh[1]")
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
JOINTS = np.array([[1.0, 0.0], [-1.0, 1.0]])  # angles of the joints from those of the links


@named
@dataclass(frozen=True, eq=False)
class LinearLaw:
    """A sampled controller around rest: s(k+1) = A s(k) + B y(k), torques = C s(k) + D y(k).

    Attributes:
        A: state matrix, of n states, shape (n, n).
        B: input matrix, shape (n, 6). The inputs y are the measured angles of shoulder and elbow
            [rad], their rates [rad/s], and the hand force x, y [N].
        C: output matrix, shape (2, n). The outputs are the torques of shoulder and elbow [N.m].
        D: feedthrough, shape (2, 6).
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    def __post_init__(self):
        A = array_of("A", self.A)
        n = len(A) if A.ndim == 2 else 0
        for name, shape in {"A": (n, n), "B": (n, 6), "C": (2, n), "D": (2, 6)}.items():
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
        rest: joint angles at rest, shoulder and elbow [rad].
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
    rest: tuple[float, float]
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

    The law is linearised around rest; handle, hand and physical clay move exactly between samples,
    under torques that are held and delayed. Velocity by difference, its filter and the force filter
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


def _neglected(s: Scenario) -> tuple[str, ...]:
    clay = [] if s.clay is None else present(s.clay, support.LAWS)
    parts = [*clay, *present(s, support.PARTS)]
    return tuple(x.name for x in parts if x.theory == LEFT_OUT and x.name not in COVERED)


# ---- the law around rest -------------------------------------------------------------------------


class Rest:
    """Where handle and controller rest.

    Args:
        scenario: the run.
        controller: its controller; None rests at the start.
        near: another rest, from which it is sought in place of the start.

    Attributes:
        links: absolute angles of the links [rad].
        state: state of the controller.
        force: hand force there (x, y) [N].
    """

    def __init__(self, scenario: Scenario, controller: Controller | None, near: Rest | None = None):
        self.scenario, self.hands = scenario, scenario.hands
        x, y = (a + c for a, c in zip(scenario.origin, scenario.start, strict=True))
        q1, q2 = arm_law.inverse_kinematics(x, y, scenario.arm.links)
        at = np.array([q1, q2])
        self.state = np.array([] if controller is None else controller.state)
        if controller is not None:
            self.controller = controller
            self.caller = LawCaller(controller)
            self.buffer = self.caller.numbers
            begin = (at, self.state) if near is None else (near.joints, near.state)
            at = self._sought(np.concatenate(begin))
            at, self.state = at[:2], at[2:]
        self.joints = float(at[0]), float(at[1])
        self.links, self.force = np.array([at[0], at[0] + at[1]]), self._force(at)

    def _jacobian(self, q: np.ndarray) -> np.ndarray:
        """Velocity of the handle from the rates of the links, one column a link."""
        u = arm_law.jacobian(float(q[0]), float(q[1]), self.scenario.arm.links)
        return np.array(u).reshape(2, 2).T

    @property
    def jacobian(self) -> np.ndarray:
        """The same at rest."""
        return self._jacobian(np.array(self.joints))

    def _force(self, q: np.ndarray) -> np.ndarray:
        """Force of the hand's spring at rest (x, y) [N]."""
        u = self._jacobian(q)
        p = np.array([u[1].sum(), -u[0].sum()]) - self.scenario.origin
        return -p * [hand.spring for hand in self.hands]

    def answer(self, x: np.ndarray, t: float = 0.0) -> np.ndarray:
        """Torques and next state under measurements and a state."""
        n = len(self.state)
        self.buffer[0], self.buffer[1:TORQUE] = t, x[:6]
        self.buffer[BUFFER : BUFFER + n] = x[6:]
        self.caller()
        self.caller.check()
        after = self.buffer[BUFFER + n : BUFFER + 2 * n]
        return np.concatenate((self.buffer[TORQUE:BUFFER], after))

    def _measured(self, at: np.ndarray) -> np.ndarray:
        return np.concatenate((at[:2], [0.0, 0.0], self._force(at[:2]), at[2:]))

    def _unrest(self, at: np.ndarray) -> np.ndarray:
        """Torques that nothing balances, and change of the state."""
        out = self.answer(self._measured(at))
        out[:2] += np.linalg.solve(JOINTS.T, self._jacobian(at[:2]).T @ self._force(at[:2]))
        out[2:] -= at[2:]
        return out

    def _sought(self, at: np.ndarray) -> np.ndarray:
        """Joint angles and state at rest, from those at the start."""
        from scipy.optimize import least_squares

        left = self._unrest(at)
        if np.abs(left).max(initial=0.0) > AT_REST:
            at = least_squares(self._unrest, at, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
            left = self._unrest(at)
        if np.abs(left).max(initial=0.0) > AT_REST:
            bound = (
                "must come to rest near the start; the nearest it comes leaves torques of "
                f"({left[0]:.3g}, {left[1]:.3g}) N.m"
            ) + (f" and moves its state by {np.abs(left[2:]).max():.3g}" if len(left) > 2 else "")
            raise ParameterError("controller.law", self.controller.law, bound)
        return at

    def linear_law(self, size: float) -> LinearLaw:
        """The law as matrices, from differences."""
        x = self._measured(np.concatenate((self.joints, self.state)))
        if not np.array_equal(self.answer(x), self.answer(x, LATER)):
            bound = "must not depend on the time t: its answer at rest changes"
            raise ParameterError("controller.law", self.controller.law, bound)
        names = (*MEASURED, *(f"state[{i}]" for i in range(len(self.state))))
        slopes = np.column_stack([self._slope(x, j, size, name) for j, name in enumerate(names)])
        return LinearLaw(slopes[2:, 6:], slopes[2:, :6], slopes[:2, 6:], slopes[:2, :6])

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
            what = f"torques[{out}]" if out < 2 else f"state[{out - 2}]"
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
        u, inertia = rest.jacobian, np.diag(scenario.arm.links[2:4])
        self.jacobian = u
        mass, self.damper, self.spring = (
            np.diag([getattr(hand, name) for hand in rest.hands])
            for name in ("mass", "damper", "spring")
        )
        self.mass = mass
        light = np.linalg.inv(inertia + u.T @ mass @ u)
        turned = np.array([-u[1], u[0]])  # change of each column as its link turns
        static = np.diag(rest.force @ turned)
        self.place = -light @ (u.T @ self.spring @ u - static)
        self.rate = -light @ (u.T @ (self.damper + b * np.eye(2)) @ u)
        self.push = light @ JOINTS.T  # by torques of the joints
        self.open = self._open_loop(states)

    def _moved(self, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Transition of (angles, rates) of the links over t [s], and response to held torques."""
        a = np.zeros((6, 6))
        a[:2, 2:4] = np.eye(2)
        a[2:4] = np.hstack((self.place, self.rate, self.push))
        e = matrix_exponential(t * a)
        return e[:4, :4], e[:4, 4:]

    def _open_loop(self, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The loop over a sample without the law of n states: x+ = F x + G (tau, s+), (s, y) = H x.

        x holds angles and rates of the links, the controller's state, the angles of the joints in
        the window, filtered rates, states of the force filter, then the torques of the last
        samples, newest first.
        """
        parts = self.parts
        whole, part = whole_samples(parts.delay, self.Ts)
        differs = parts.velocity == "difference"
        window = 2 * parts.velocity_window * differs
        cutoff, sieve_cutoff = parts.velocity_filter if differs else None, parts.force_filter
        smooth, filtered = 2 * (cutoff is not None), 4 * (sieve_cutoff is not None)
        at = np.cumsum([0, 2, 2, n, window, smooth, filtered, 2 * (1 + whole)])
        unit = np.eye(at[-1] + 2 + n)  # behind x, the torques and the state that the law returns
        angle, rate, state, past, slow, sieve, queue = (
            unit[i:j] for i, j in zip(at[:-1], at[1:], strict=True)
        )
        torques, after, oldest = unit[at[-1] : at[-1] + 2], unit[at[-1] + 2 :], queue[-2:]
        q, w = JOINTS @ angle, JOINTS @ rate
        if differs:
            w = (q - past[-2:]) / (parts.velocity_window * self.Ts)
        if cutoff is not None:
            keep = math.exp(-math.tau * cutoff * self.Ts)
            w = keep * slow + (1.0 - keep) * w
        turning = self.place @ angle + self.rate @ rate + self.push @ oldest
        u = self.jacobian
        force = -(self.damper @ u @ rate + self.spring @ u @ angle + self.mass @ u @ turning)
        sieved = sieve
        if sieve_cutoff is not None:
            f = np.array(butterworth(sieve_cutoff, parts.filter_order, self.Ts))
            sieved = np.kron(np.eye(2), f[:4].reshape(2, 2)) @ sieve + np.kron(force, f[4:, None])
            force = sieve[::2]
        due = np.vstack((torques, queue))[2 * whole : 2 * whole + 2]
        moved = np.vstack((angle, rate))
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
            queue[:-2],
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
        _, size, vectors = np.linalg.svd(loop - np.eye(len(loop)))
        moving = vectors[: np.count_nonzero(size > FREE * size[0])]
        if len(moving) == len(loop):
            break
        loop = moving @ loop @ moving.T
    return np.linalg.eigvals(loop)


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
