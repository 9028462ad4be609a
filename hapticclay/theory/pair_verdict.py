"""How much delay, gain and friction feed-forward a leader and a follower carry."""

from __future__ import annotations

import cmath
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from .. import matrices
from ..arguments import checked, named
from ..arms.joint_units import Joints, table_of
from ..display import time_words
from ..results import Result, Tables
from ..scene.pair import Pair
from ..scene.pair_hardware import slides_of
from . import joint_crossings, pair_advice, pair_branches, pair_roots, roots
from .held_words import pair_words
from .joint_families import NEAR
from .joint_loop import ROUNDING, grid, is_stable
from .pair_build import Build
from .pair_loop import PairLoop
from .pair_onset import LATEST, Onset, onset
from .rest import FREE

LARGE = 200  # states of a map whose eigenvalues are not worth their time
HIGHEST = 64.0  # factor of all Kp up to which gains are tried ...
OCTAVE = 5  # ... so many from one to its double
EXACT = 1e-4  # relative width within which that factor is found
COARSE = 1e-2  # the same for a map that is LARGE
SLOW = 1e-4  # [rad] of an angle below which rounding may hide the imaginary part of a response
STEADY = 1e-6  # [Hz] of a motion that does not oscillate
OPPOSED, COMMON, NONE = "arms opposed", "common motion", "rest alone"
GONE = 1e-3  # size of an eigenvalue whose motion is over at the next sample


@named
@dataclass(frozen=True, repr=False, eq=False)
class PairLimits(Joints, Result):
    """What a pair of arms carries at its pose, all joints of both arms coupled.

    Attributes:
        kind: kind of the link.
        names: joints of the leader, shape (n,).
        stable: whether the pair is stable as it is.
        radius: largest eigenvalue of the map over a sample, without those of rest: below 1 if
            stable.
        structural: directions in which the free pair rests anywhere, whose eigenvalues are 1.
        delay: least one-way delay of the link, both ways alike, at which the pair is unstable [s]:
            below it all are stable; 0 if it is unstable without delay; inf for more than 2 s. Waves
            are read at samples: the largest whole one that is stable.
        present: one-way delay of the link, the mean of both ways, with jitter and loss [s].
        frequency: of the motion that turns unstable first, or is unstable now; of the least damped
            one if no delay that was looked at is unstable [Hz].
        joint: joint that moves most in it.
        mode: that motion in words.
        gain: largest factor of all Kp of both arms, from the present ones on: with each less the
            pair is stable; inf for more than 64; 0 if the pair is unstable.
        slope: largest slope of a friction fed forward at one joint of both arms, Fc k + Fv, with
            none at the others [N.m.s/rad], shape (n,).
        law_slope: slopes of the leader's law [N.m.s/rad], shape (n,).
        friction_fraction: largest share of the law's friction that may be fed forward; inf if it
            feeds none, or any.
        budget: what the torque from the other arm is late by, cause by cause, one way [s].
        Ts: control sample [s].
        assumed: what the verdict rests on, and what it leaves out, a sentence each.
        slides: whether each joint slides; then its units are those of forces and lengths.
        remedy: changes of an unstable pair, each of which alone makes it stable by the exact map.
    """

    drawn_by = "hapticclay.views.pair_plots:limits_plot"
    written_as = "pair"
    printed = {"joints": (), "budget": ()}
    formats = {"radius": ".8g"}

    kind: str
    names: tuple[str, ...]
    stable: bool
    radius: float
    structural: int
    delay: float
    present: float
    frequency: float
    joint: str
    mode: str
    gain: float
    slope: np.ndarray
    law_slope: np.ndarray
    friction_fraction: float
    budget: Mapping[str, float]
    Ts: float
    assumed: tuple[str, ...] = ()
    slides: tuple[bool, ...] = ()
    remedy: str = ""

    @property
    def delay_left(self) -> float:
        """Delay that the link may have besides the present one [s]; 0 if the pair is unstable."""
        return max(0.0, self.delay - self.present) if self.stable else 0.0

    def headline(self) -> str:
        """The verdict in one line."""
        at = f"{self.kind}, {1.0 / self.Ts:.4g} Hz, link {time_words(self.present)}"
        verdict = "stable" if self.stable else f"unstable (radius {self.radius:.6g})"
        least = "" if self.has_onset else "least damped: "
        return f"{verdict} at {at}: {self._delay_words()}; {least}{self.mode}"

    @property
    def has_onset(self) -> bool:
        """Whether the pair is unstable, or is at a delay that was looked at."""
        return not (self.stable and math.isinf(self.delay))

    def _delay_words(self) -> str:
        if math.isinf(self.delay):
            return f"any delay of the link up to {LATEST:g} s"
        if self.delay == 0.0:
            return "unstable without any delay of the link"
        again = ", and again here" if self.stable and self.delay < self.present else ""
        return f"one-way delay up to {time_words(self.delay)}{again}"

    def remarks(self) -> Sequence[str]:
        """What to change first, and what the verdict rests on."""
        return [self.headline(), f"first to change: {self.advice()}", *self.assumed]

    def advice(self) -> str:
        """The change that gains most, or that brings an unstable pair back."""
        if not self.stable:
            return self.remedy
        if math.isinf(self.delay):
            return f"nothing: no delay of the link up to {LATEST:g} s is too long"
        cause, late = max(self.budget.items(), key=lambda x: x[1])
        lateness = f"{cause} ({time_words(late)} each way"
        if self.delay < self.present:
            return f"{lateness}, and no less: some shorter delays are unstable)"
        return f"{lateness}; {time_words(self.delay_left)} are left)"

    def tables(self) -> Tables:
        """Friction of each joint, lateness by cause, and the whole pair."""
        joints: dict[str, Any] = {
            "joint": self.names,
            "friction slope [N.m.s/rad]": self.law_slope,
            "largest slope [N.m.s/rad]": self.slope,
        }
        budget: dict[str, Any] = {
            "cause": [*self.budget, "all"],
            "late [ms]": [1e3 * x for x in (*self.budget.values(), sum(self.budget.values()))],
        }
        pair: dict[str, Any] = {
            "stable": self.stable,
            "radius": self.radius,
            "structural": self.structural,
            "delay [s]": self.delay,
            "delay left [s]": self.delay_left,
            "frequency [Hz]": self.frequency,
            "joint": self.joint,
            "mode": self.mode,
            "largest factor of all Kp": self.gain,
            "largest share of friction": self.friction_fraction,
        }
        joints = table_of(joints, self.turning)
        return {"joints": joints, "budget": budget, "pair": {k: [v] for k, v in pair.items()}}


@checked
def pair_limits(pair: Pair) -> PairLimits:
    """Whether a leader and a follower are stable, and how much delay, gain and friction they carry.

    Both arms are linear about their poses, with hand and contact; torques are held between samples.
    With messages on their way as states the map over a sample is exact; where they are many, its
    largest eigenvalue is sought without them, and a count beyond it says that there is no larger
    one. Eigenvalues of rest (z = 1), which a free
    pair has by its structure, are no verdict.

    Args:
        pair: two arms, their laws and the link between them.

    Raises:
        ParameterError: an arm has no handle for its hand or contact.
    """
    study = Study(pair)
    z, joint, mode = study.motion()
    frequency = abs(cmath.phase(z)) / (2.0 * math.pi * pair.Ts)
    slope, fraction = study.friction()
    return PairLimits(
        pair.link.kind,
        study.build.names[: pair.n],
        study.stable,
        study.radius,
        study.loop.structural,
        study.delay(),
        study.present,
        frequency,
        joint,
        ", ".join([mode, *([f"{frequency:.3g} Hz"] if frequency > STEADY else []), joint]),
        study.gain(),
        slope,
        np.array(pair.law.slopes),
        fraction,
        study.budget(),
        pair.Ts,
        (pair_words(pair), *study.build.assumed()),
        slides_of(pair.leader),
        "" if study.stable else pair_advice.remedy(study, fraction),
    )


class Study:
    """A pair, its loop, and what is asked of it."""

    def __init__(self, pair: Pair):
        self.pair, self.build = pair, Build(pair)
        self.loop = self.build.loop()
        self.present = 0.5 * sum(self.build.delays)

    # ---- the verdict

    @cached_property
    def worst(self) -> complex:
        """The largest eigenvalue."""
        if self.loop.states <= LARGE:
            return complex(self.loop.eigenvalues[0])
        return pair_roots.largest(self.loop, self.loop.there + self.loop.back)

    @cached_property
    def radius(self) -> float:
        """Its size."""
        return abs(self.worst)

    @cached_property
    def stable(self) -> bool:
        """Whether the pair is stable."""
        return is_stable(self.radius)

    def holds(self, gain: float, friction: tuple[np.ndarray, np.ndarray] | None = None) -> bool:
        """Whether it is stable with a factor of all Kp, and slopes of the friction."""
        return _holds(self.build.loop(gain=gain, friction=friction))

    def at(self, late: float) -> bool:
        """Whether it is stable with a one-way delay of the link [s]."""
        return _holds(self.build.loop((late, late)))

    def gain(self) -> float:
        """Largest factor of all Kp: up to it, no eigenvalue reaches the circle between factors."""
        if not self.stable:
            return 0.0
        low = 1.0
        while low < HIGHEST:
            factors = self._followed(np.geomspace(low, 2.0 * low, OCTAVE))
            held = [self.holds(x) for x in factors]
            if not all(held):
                i = held.index(False)
                exact = EXACT if self.loop.states <= LARGE else COARSE
                return roots.bisect(self.holds, factors[i - 1], factors[i], exact)[0]
            low *= 2.0
        return math.inf

    def _followed(self, factors: np.ndarray) -> list[float]:
        """Factors of all Kp, with more where an eigenvalue may pass the circle between two."""
        if self.loop.states > LARGE:
            return factors.tolist()

        def values(log: np.ndarray) -> np.ndarray:
            loops = (self.build.loop(gain=x) for x in np.exp(log).tolist())
            return np.array([loop.eigenvalues for loop in loops])

        return np.exp(pair_branches.followed(values, np.log(factors), ROUNDING)[0]).tolist()

    # ---- delay

    @cached_property
    def onset(self) -> Onset | None:
        """The least delay at which the pair is unstable; None for more than 2 s."""
        return onset(self.build)

    def delay(self) -> float:
        """Largest one-way delay [s]."""
        return math.inf if self.onset is None else self.onset.delay

    # ---- the motion that turns unstable

    def motion(self) -> tuple[complex, str, str]:
        """An eigenvalue, the joint that moves most, and how both arms move in it."""
        if self.stable and self.onset is not None:
            _, loop, z = self.onset
        else:
            loop, z = self.loop, self.worst
        if abs(z) < GONE:  # as without gains
            return z, self.build.names[0], NONE
        leader, follower = loop.shape(z)
        n, T = self.pair.n, self.pair.mapping
        energy = [
            np.abs(q) * np.sqrt(np.diag(end.loop.inertia))
            for q, end in zip((leader, follower), loop.ends, strict=True)
        ]
        most = int(np.concatenate(energy).argmax())
        i = most - n if most >= n else int(np.abs(T[:, most]).argmax())
        along = (np.conj((T @ leader)[i]) * follower[i]).real
        return z, self.build.names[most], COMMON if along > 0.0 else OPPOSED

    # ---- friction that is fed forward

    def friction(self) -> tuple[np.ndarray, float]:
        """Largest slope at each joint of both arms, and largest share of the laws' friction."""
        n, none = self.pair.n, np.zeros(self.pair.n)
        loop = self.build.loop(friction=(none, none))
        if not _holds(loop):
            return none, 0.0
        angles = grid(loop)
        rates, steady = loop.responses(angles)[1], loop.drift()
        free = np.abs(loop.unresisted()).max(1, initial=0.0)
        runs_away = free > FREE * free.max()  # under any friction that is fed forward there
        partner = np.abs(self.pair.mapping).argmax(0)

        def largest(weights: np.ndarray) -> float:
            """Largest factor of slopes at some joints of both arms."""
            used = np.flatnonzero(weights)
            if not len(used):
                return math.inf
            if runs_away[used].any():
                return 0.0
            at, gains = np.ix_(used, used), weights[used][:, None]

            def response(theta: np.ndarray) -> np.ndarray:
                found = rates if theta is angles else loop.responses(theta)[1]
                return gains * found[:, at[0], at[1]]

            crossed = joint_crossings.crossings(response, angles)
            every = [(-x.change, x.theta) for x in crossed]
            every += [(x, 0.0) for x in _steady(gains * steady[at])]
            ahead = sorted(x for x in every if x[0] > 0.0)
            for (factor, theta), after in itertools.zip_longest(ahead, ahead[1:]):
                beyond = min(0.5 * (factor + after[0]) if after else math.inf, 2.0 * factor)
                slopes = beyond * weights
                if not 0.0 < theta < SLOW or not _holds(
                    self.build.loop(friction=(slopes[:n], slopes[n:]))
                ):
                    return factor
            return math.inf

        unit = np.eye(2 * n)
        slope = np.array([largest(unit[j] + unit[n + partner[j]]) for j in range(n)])
        return slope, largest(np.concatenate([law.slopes for law in self.pair.laws]))

    # ---- where the time goes

    def budget(self) -> dict[str, float]:
        """What the torque from the other arm is late by, one way, by cause [s]."""
        pair, link = self.pair, self.pair.link
        causes = {
            "hold (Ts/2)": 0.5 * pair.Ts,
            "computation": pair.delay,
            "network": 0.5 * sum(link.delays),
            **link.further_delay(pair.Ts),
        }
        if self.build.architecture.whole:
            read = [self.build.samples(x)[0] * pair.Ts - x for x in self.build.delays]
            causes["wait for a sample"] = 0.5 * sum(read)
        return {cause: late for cause, late in causes.items() if late > 0.0}


def _holds(loop: PairLoop) -> bool:
    """Whether a pair is stable."""
    if loop.states <= LARGE:
        return loop.stable()
    return pair_roots.beyond(loop, loop.there + loop.back) <= 0


def _steady(matrix: np.ndarray) -> list[float]:
    """Factors at which steady motion has no resistance."""
    values = matrices.eigenvalues(matrix)
    real = values[(np.abs(values.imag) <= NEAR * np.abs(values)) & (values.real > 0.0)]
    return (1.0 / real.real).tolist()
