"""The stability boundary found by simulation, and why it differs from the analytic ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated, TypeVar

import numpy as np

from .. import matrices
from ..arguments import checked, named
from ..errors import Bound, ParameterError, Real, number
from ..formulas.constants import B_MAX
from ..model.arm import Arm
from ..model.cells import Profile
from ..model.clay import Clay
from ..model.constants import AXES, TORQUE_LIMIT, TS
from ..model.controller import SERVO
from ..model.hardware import Hardware
from ..model.spring import Spring
from ..scene.scenario import Position, Scenario, TorqueLimit
from ..simulation.period_map import PeriodMaps
from ..simulation.simulate import simulate
from ..theory import gain_crossings, gain_limits, linear_loop
from ..theory.loops import TIMING, Loop
from ..theory.roots import first_failure
from . import growth

SMALL_PUSH = 1e-4  # [m/s] initial velocity that leaves the arm linear
LARGE_PUSH = 0.05  # [m/s] initial velocity of a push by hand
PUSH_TIME = 0.01  # [s] duration of a force that replaces such a velocity
GROWTH_SPAN = 1.2  # [s] length of a run whose growth rate is read
CLASSIFIED_SPANS = (2.0, 8.0, 32.0)  # [s] longer runs while the motors are saturated
BRACKET = 2e-3  # relative accuracy of boundaries

Subject = TypeVar("Subject")


@named
@dataclass(frozen=True)
class PushedLoop(Loop):
    """A loop to simulate: the handle is pushed along its axis in uniform clay.

    The other axis has the printed servo and no compensator.

    Attributes:
        b: clay on both axes [N.s/m].
        k: stiffness of the clay on both axes, at rest at the initial position of the handle [N/m].
        K: compensator gain, > 0, at most 1e6 [1/kg] for the printed compensator.
        inertia_shaping: as in Scenario; without it the arm's mobility replaces the gain of Sh.
        pose: position of the handle relative to its nominal position [m].
        push: velocity of the handle at the start [m/s]. If C has no integrator, no state of C
            matches a velocity; a constant force then replaces the push, one that gives a free
            handle this velocity in PUSH_TIME.
        torque_limit: largest torques of the motors [N.m].
        arm: the two-link arm.
    """

    b: Annotated[Real, Bound(0.0, B_MAX, "N.s/m")] = 90.0
    K: Annotated[Real, Bound(0.0, 1e6, "1/kg", above=True)] = 1.0
    inertia_shaping: bool = True
    pose: Position = (0.0, 0.0)
    push: Annotated[Real, Bound(-10.0, 10.0, "m/s")] = SMALL_PUSH
    torque_limit: TorqueLimit = TORQUE_LIMIT
    arm: Arm = Arm()

    def __post_init__(self):
        super().__post_init__()
        number("delay", self.delay, 0.0, 1.0 if self.Ts else 0.0, unit="s")

    @classmethod
    @checked
    def of(cls, scenario: Scenario, axis: str = "x", b: float | None = None) -> PushedLoop:
        """A runnable loop of one axis of a scenario, in uniform clay.

        Args:
            scenario: source of arm, servo, compensator, hand and control.
            axis: "x" or "y".
            b: clay [N.s/m]; None for the damping of the scenario with the least gain limit.

        Raises:
            ParameterError: as `Loop.of`; or the gain is 0, or hardware other than a delay is given.
        """
        loop = Loop.of(scenario, axis, b)
        given = scenario.hardware
        if given and replace(given, delay=0.0, seed=0) != type(given)():
            bound = "must have no hardware but a delay: the impedance is that of a linear loop"
            raise ParameterError("hardware", given, bound)
        return cls(
            loop.axis,
            b=loop.b,
            operator=loop.operator,
            servo=scenario.servo[AXES.index(loop.axis)],
            compensator=loop.compensator,
            K=loop.gain,
            Ts=loop.Ts,
            delay=loop.delay,
            render=loop.render,
            inertia_shaping=scenario.inertia_shaping,
            torque_limit=scenario.torque_limit,
            arm=scenario.planar_arm,
            k=loop.k,
        )

    def scenario(self, t_max: float = GROWTH_SPAN, stop_when_unstable: bool = True) -> Scenario:
        """Build the scenario of a run of the loop.

        Args:
            t_max: length of the run [s].
            stop_when_unstable: as in Scenario.
        """
        i, everywhere = AXES.index(self.axis), Profile((), (self.b,), springs=(Spring(self.k),))
        x, y = self._nominal
        moves = linear_loop.reduced(self.compensator).den[-1] == 0.0
        along = (lambda x: (x, 0.0)) if i == 0 else (lambda x: (0.0, x))
        return Scenario(
            name="boundary",
            clay=Clay(everywhere, everywhere),
            gain=along(self.K),
            force=(0.0, 0.0) if moves else along(self.push / (self.servo.S.gain * PUSH_TIME)),
            velocity=along(self.push) if moves else (0.0, 0.0),
            operator=self.operator,
            inertia_shaping=self.inertia_shaping,
            dt=self.Ts or TS,
            control="sampled" if self.Ts else "continuous",
            render=self.render if self.Ts else "held",
            hardware=Hardware(delay=self.delay) if self.delay else None,
            origin=(x + self.pose[0], y + self.pose[1]),
            torque_limit=self.torque_limit,
            length=None,
            t_max=t_max,
            stop_when_unstable=stop_when_unstable,
            arm=self.arm,
            servo=(self.servo, SERVO[1]) if i == 0 else (SERVO[0], self.servo),
            compensator=self.compensator,
        )

    @property
    def linear(self) -> Loop:
        """The linear loop at the nominal pose."""
        return replace(Loop.of(self.scenario(), self.axis, self.b), k=self.k)

    @property
    def _nominal(self) -> tuple[float, float]:
        """Handle at the nominal pose [m]: link 1 along y, link 2 along x."""
        return self.arm.l2, self.arm.l1


def of_scenario(subject: Subject | Scenario, axis: str) -> Subject | PushedLoop:
    """Converts a scenario to the loop of an axis that a study runs; other subjects stay."""
    return PushedLoop.of(subject, axis) if isinstance(subject, Scenario) else subject


def classify_run(loop: PushedLoop) -> str:
    """Class of a run of the loop: "stable", "limit cycle" (bounded by the motors) or "diverges".

    The growth rate assumes linear motion, so a run that ends with saturated motors is repeated for
    longer.
    """
    limit = (1.0 - 1e-9) * np.array(loop.torque_limit)
    for t_max in CLASSIFIED_SPANS:
        record = simulate(loop.scenario(t_max, stop_when_unstable=False))
        code = record.outcome.code
        if code in ("diverged", "out of reach", "singular"):
            return "diverges"
        if code in ("limit cycle", "saturated"):
            break
        end = record.tau[int((1.0 - growth.FITTED_SHARE) * len(record.tau)) :]
        if not np.any(np.abs(end) >= limit):
            return "diverges" if growth.growth_rate(record, loop.axis) > 0.0 else "stable"
    return "limit cycle"


def find_crossing(rate: Callable[[float], float], guess: float, most: float) -> float:
    """Parameter at which a growth rate changes from negative to positive."""
    search = crossing_search(guess, most)
    try:
        x = next(search)
        while True:
            x = search.send(rate(x))
    except StopIteration as end:
        return end.value


def crossing_search(guess: float, most: float) -> Generator[float, float, float]:
    """The search of `find_crossing` as a generator, to batch searches: yields x, receives its rate.

    Each rate needs a run and may be infinite. Hence a bracketed secant method on a ratio, two runs
    per step, instead of `brentq`.
    """
    step = 1.05
    low, high = guess / step, guess * step
    a = yield low
    b = yield high
    while a > 0.0:
        if low < 1e-3 * guess:
            return 0.0
        step = min(2.0, step * step)
        high, b, low = low, a, low / step
        a = yield low
    while b <= 0.0:
        if high > most:
            return math.inf
        step = min(2.0, step * step)
        low, a, high = high, b, high * step
        b = yield high
    while high / low > 1.0 + BRACKET:
        share = a / (a - b) if math.isfinite(a - b) else 0.5
        share = min(max(share, 0.02), 0.98) if high / low < 1.5 else 0.5
        middle = low * (high / low) ** share
        # On both sides of the secant's guess: two runs close the bracket where the rate is nearly
        # straight.
        for x in (middle * (1.0 - 0.4 * BRACKET), middle * (1.0 + 0.4 * BRACKET)):
            if low < x < high:
                y = yield x
                if y > 0.0:
                    high, b = x, y
                    break
                low, a = x, y
    return math.sqrt(low * high)


def simulated_gain(loop: PushedLoop, guess: float | None = None, most: float = 200.0) -> float:
    """Gain K above which the oscillation grows in a run's steps; the loop's own K is ignored."""
    guess = nominal_limit(loop) if guess is None else guess
    guess = min(guess, most) if guess > 0.0 else 1.0
    return _simulated(loop, "K", guess, most)


def simulated_damping(loop: PushedLoop, guess: float, most: float = 1e5) -> float:
    """Clay b [N.s/m] above which the oscillation grows likewise; the loop's own b is ignored."""
    return _simulated(loop, "b", guess, most)


def simulated_stiffness(loop: PushedLoop, guess: float | None = None, most: float = 1e7) -> float:
    """Clay's k [N/m] above which the oscillation grows likewise; the loop's own k is ignored."""
    guess = gain_limits.stiffness_limit(loop.linear) if guess is None else guess
    return _simulated(loop, "k", min(guess, most) if guess > 0.0 else 1.0, most)


def _simulated(loop: PushedLoop, field: str, guess: float, most: float) -> float:
    maps, small = PeriodMaps(), abs(loop.push) <= SMALL_PUSH

    def rate(value: float) -> float:
        s = replace(loop, **{field: value}).scenario()
        found = growth.mapped_growth(s, loop.axis, maps) if small else math.nan
        return growth.growth_rate(simulate(s), loop.axis) if math.isnan(found) else found

    return find_crossing(rate, guess, most)


def nominal_limit(loop: PushedLoop) -> float:
    """Largest stable K of the linear loop at the nominal pose; the loop's own K is ignored."""
    return gain_limits.gain_limit(loop.linear)


def pose_matrix(loop: PushedLoop) -> np.ndarray:
    """The linear loop of both axes at the handle's pose.

    Without shaping W = Lambda^-1 of that pose replaces the gains of Sh and couples the axes
    (docs/equations.md, section 3).
    """
    i = AXES.index(loop.axis)
    other = Loop(
        axis=AXES[1 - i],
        b=loop.b,
        operator=loop.operator,
        K=0.0,
        Ts=loop.Ts,
        delay=loop.delay,
        render=loop.render,
        k=loop.k,
    )
    loops = (loop, other) if i == 0 else (other, loop)
    x, y = loop._nominal
    W = linear_loop.mobility_at(loop.arm, x + loop.pose[0], y + loop.pose[1])
    if loop.Ts is None:
        return linear_loop.state_space(*loops, mobility=None if loop.inertia_shaping else W)[0]
    less, beta, gamma = linear_loop.sampled_differences(*loops, pose=(W, loop.inertia_shaping))
    return np.eye(len(less)) + less + beta @ np.diag([x.gain for x in loops]) @ gamma


def pose_limit(loop: PushedLoop, most: float = 200.0) -> float:
    """Smallest K at which the linear loop at the handle's pose is unstable."""
    first, second = (pose_matrix(replace(loop, K=K)) for K in (1.0, 2.0))
    # It is linear in K, unless direct feedthrough of C acts on the hand's mass.
    straight = len(loop.compensator.num) == len(loop.compensator.den) and loop.hand.mass > 0.0

    def stable(K: float) -> bool:
        if straight and not loop.Ts:
            z = matrices.eigenvalues(pose_matrix(replace(loop, K=K)))
        else:
            z = matrices.eigenvalues(first + (K - 1.0) * (second - first))
        if loop.Ts:
            return bool(np.all(np.abs(z[np.abs(z - 1.0) > 1e-4 * loop.Ts]) <= 1.0))
        return bool(np.all(z.real[np.abs(z) > 1e-4] <= 0.0))

    low, high = first_failure(stable, np.geomspace(1e-3, most, 200).tolist())
    return high if low else 0.0


def continuous_stable(loop: PushedLoop) -> bool:
    """Whether the linear loop at the nominal pose is stable in continuous time."""
    return gain_crossings.is_stable(replace(loop.linear, **TIMING))


def explain_disagreement(loop: PushedLoop, stable: bool) -> str:
    """Cause of a difference between a run and the continuous linear loop at the nominal pose.

    One property of the run is changed at a time, then two at a time, until the run agrees with
    theory.
    """
    changes: list[tuple[str, dict]] = [
        ("saturation", dict(torque_limit=(1e6, 1e6))),
        ("size of the motion", dict(push=SMALL_PUSH)),
    ]
    if not loop.inertia_shaping:
        changes.insert(0, ("pose-dependent Lambda", dict(inertia_shaping=True)))
    if loop.Ts:
        changes.insert(0, ("sampling", dict(Ts=None, delay=0.0)))
    if loop.delay:
        changes.insert(0, ("delay", dict(delay=0.0)))
    for n in (1, 2):
        for some in combinations(changes, n):
            change = {field: value for _, fields in some for field, value in fields.items()}
            if (classify_run(replace(loop, **change)) == "stable") != stable:
                return " and ".join(name for name, _ in some)
    return "not found"
