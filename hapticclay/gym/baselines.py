"""Baselines without learning: random actions, a simple controller, and the best by theory."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from ..errors import choice
from ..model.constants import C_POLE, GAIN
from ..model.operator import Operator
from ..theory.gain_limits import gain_limit
from . import adaptive_gain, probe_clay
from .draws import HAND, Truth
from .follow import MOTION, SPEED
from .registry import ENTRIES, NAMESPACE
from .task import FORCE, Task

MARGIN = 0.9  # theoretical gains are this share of the gain limit
# Shares with the largest mean return, found by benchmarks/gym_scores.py: docs/gym_scores.json.
FIXED_SHARE, ORACLE_SHARE = 1.08, 0.84
PD, PD_IN_GROOVE = (1.0, 0.1), (0.5, 0.3)  # [N/mm], [N/(cm/s)]
PROBED = 150  # control periods after which the hand is identified
Policy = Callable[[np.ndarray], np.ndarray]  # observations (n, m) -> actions (n, k)
Maker = Callable[[Any, list[Truth], int], Policy]


class Scores(NamedTuple):
    """Scores of a policy, one episode per seed; arrays of shape (n,)."""

    total: np.ndarray  # sum of rewards
    length: np.ndarray  # number of control periods
    info: dict[str, np.ndarray]  # info of the last step, by name


def at_random(task: Task, truths: list[Truth], seed: int) -> Policy:
    """Uniformly distributed random actions."""
    rng, shape = np.random.default_rng(seed), (len(truths), len(task.actions))
    return lambda observations: rng.uniform(-1.0, 1.0, shape)


def pd_along_line(task: Any, truths: list[Truth], seed: int) -> Policy:
    """PD control across the line, and integral control of the speed along it.

    The integral is the last action, which is part of the observation.
    """
    names = [q.name for q in task.observations]
    first, last = names.index(MOTION[0].name), names.index(MOTION[4].name)
    stiff, damper = PD if names[0].startswith("distance") else PD_IN_GROOVE

    def act(x: np.ndarray) -> np.ndarray:
        offset = x[:, 0] if first == 1 else x[:, 1] - x[:, 0]  # or too little depth [mm]
        v, w = x[:, first], x[:, first + 1]
        along = x[:, last] + 0.2 * (100.0 * SPEED - v) / task.most
        across = -(stiff * offset + damper * w) / task.most
        return np.clip(np.stack((along, across), axis=1), -1.0, 1.0)

    return act


# ---- the gain --------------------------------------------------------------------------------


def _set_gain(gains: np.ndarray) -> Policy:
    """Moves the gains to values and keeps them there."""

    def act(x: np.ndarray) -> np.ndarray:
        octaves = (np.log10(gains) - x[:, -2]) / math.log10(2.0)
        return np.clip(octaves / adaptive_gain.RATE, -1.0, 1.0)[:, None]

    return act


def oracle_gain(b: float, hand: Operator, share: float = MARGIN) -> float:
    """A share of the gain limit along x with this hand, at most the task's largest gain [1/kg]."""
    return min(share * gain_limit("x", b, hand), adaptive_gain.MOST)


@functools.cache
def least_limit(b: float) -> float:
    """The least gain limit along x over the corners of the published hands [1/kg]."""
    ends = ((HAND[name].low, HAND[name].high) for name in ("mass", "damper", "spring"))
    return min(gain_limit("x", b, Operator(*hand)) for hand in itertools.product(*ends))


def robust_gain(b: float, share: float = MARGIN) -> float:
    """A share of `least_limit`, at most the task's largest gain [1/kg]."""
    return min(share * least_limit(b), adaptive_gain.MOST)


class Oracle(NamedTuple):
    """Policy: a share of the gain limit of the hand of the episode, which an agent does not see."""

    share: float = MARGIN

    def __call__(self, task: Task, truths: list[Truth], seed: int) -> Policy:
        """The policy of these episodes."""
        hands = (Operator(t["mass"], t["damper"], t["spring"]) for t in truths)
        drawn = zip(truths, hands, strict=True)
        return _set_gain(np.array([oracle_gain(t["b"], hand, self.share) for t, hand in drawn]))


class Fixed(NamedTuple):
    """Policy: a fixed gain, the same for all hands: a share of the limit of the worst one."""

    share: float = MARGIN

    def __call__(self, task: Task, truths: list[Truth], seed: int) -> Policy:
        """The policy of these episodes."""
        return _set_gain(np.array([robust_gain(t["b"], self.share) for t in truths]))


def passivity_observer(task: Task, truths: list[Truth], seed: int) -> Policy:
    """Raises the gain slowly, and lowers it when the device returns more energy than it received.

    The energy is that at the port over the samples, less the energy of the virtual mass 1/K.
    """
    n, dt = adaptive_gain.SAMPLES, task.period

    def act(x: np.ndarray) -> np.ndarray:
        v, f = 0.01 * x[:, :n], x[:, n : 2 * n]
        taken = dt * (v[:, :-1] * f[:, :-1]).sum(axis=1)
        stored = 0.5 * (v[:, 0] ** 2 - v[:, -1] ** 2) / 10.0 ** x[:, -2]
        return np.where(taken - stored < 0.0, -1.0, 0.02)[:, None]

    return act


def identify_then_set(task: Task, truths: list[Truth], seed: int) -> Policy:
    """Holds the robust gain, identifies the hand by least squares, then uses its gain.

    The force of the hand is uh - Th p. Its muscle force uh has three tones of known frequency. The
    equation is integrated once, so that no velocity is differentiated.
    """
    gains = np.array([robust_gain(t["b"]) for t in truths])
    samples: list[np.ndarray] = []

    def act(x: np.ndarray) -> np.ndarray:
        n = adaptive_gain.SAMPLES
        samples.append(np.stack((0.01 * x[:, 0], x[:, n]), axis=1).astype(float))
        if len(samples) == PROBED:
            v, fh = np.stack(samples).T  # shape (copies, samples) each
            for i, t in enumerate(truths):
                hand = hand_from(v[i], fh[i], task.period)
                gains[i] = max(gains[i], oracle_gain(t["b"], hand))
        return _set_gain(gains)(x)

    return act


def hand_from(v: np.ndarray, fh: np.ndarray, dt: float) -> Operator:
    """Identifies the hand from its forces by least squares, within the published hands."""

    def integral(y: np.ndarray) -> np.ndarray:
        return np.concatenate(([0.0], np.cumsum(0.5 * dt * (y[1:] + y[:-1]))))

    x = integral(v)
    t = np.arange(len(v)) * dt
    waves = [g(2.0 * math.pi * f * t) for f in adaptive_gain.TONES for g in (np.sin, np.cos)]
    columns = np.stack((-v, -x, -integral(x), np.ones_like(t), *waves), axis=1)
    after = slice(adaptive_gain.RAMP + 1, None)
    found = np.linalg.lstsq(columns[after], integral(fh)[after], rcond=None)[0][:3]
    ends = (HAND[name] for name in ("mass", "damper", "spring"))
    mass, damper, spring = (
        min(max(value, r.low), r.high) for value, r in zip(found.tolist(), ends, strict=True)
    )
    return Operator(mass, damper, spring)


# ---- the clay --------------------------------------------------------------------------------


SPEEDS = (4.0, 12.0, -12.0, -4.0)  # [cm/s] along x, in this order


def least_squares(task: Task, truths: list[Truth], seed: int) -> Policy:
    """Moves back and forth at two speeds, then fits Fy + b |v| to the force of the clay.

    That force is the hand's force less the inertial and damping force of the device, (a + 10 v)/K.
    """
    samples: list[np.ndarray] = []

    def act(x: np.ndarray) -> np.ndarray:
        samples.append(np.stack((0.01 * x[:, 2], x[:, 4]), axis=1).astype(float))
        i = min(len(samples) - 1, task.limit - 1) * len(SPEEDS) // task.limit
        action = np.zeros((len(x), 4))
        action[:, 0] = np.clip(x[:, 6] + 0.2 * (SPEEDS[i] - x[:, 2]) / FORCE, -1.0, 1.0)
        if len(samples) == task.limit:
            for k, (v, f) in enumerate(zip(*np.stack(samples).T, strict=True)):
                action[k, 2:] = probe_clay.answer_of(*_clay_from(v, f, task.period))
        return action

    return act


def _clay_from(v: np.ndarray, f: np.ndarray, dt: float) -> tuple[float, float]:
    """Identifies b [N.s/m] and Fy [N] from velocities and forces."""
    a = np.gradient(v, dt)
    steady = (np.abs(a) < 0.2) & (np.abs(v) > 1e-3)
    if steady.sum() < 3:
        return probe_clay.MIDDLE
    v, f, a = v[steady], f[steady], a[steady]
    clay = np.sign(v) * (f - (a + C_POLE * v) / GAIN[0])
    columns = np.stack((np.abs(v), np.ones_like(v)), axis=1)
    b, Fy = np.linalg.lstsq(columns, clay, rcond=None)[0].tolist()
    return b, Fy


BASELINES: dict[str, dict[str, Maker]] = {
    "CutLine-v0": {"random": at_random, "PD along the line": pd_along_line},
    "PareEdge-v0": {"random": at_random, "PD along the line": pd_along_line},
    "AdaptiveGain-v0": {
        "random": at_random, "passivity observer": passivity_observer, "robust gain": Fixed(),
        "best fixed gain": Fixed(FIXED_SHARE), "identify, then set": identify_then_set,
        "oracle": Oracle(), "best oracle": Oracle(ORACLE_SHARE),
    },
    "ProbeClay-v0": {"random": at_random, "least squares": least_squares},
}  # fmt: skip


def returns(id: str, make: Maker, seeds: Sequence[int], **options: Any) -> Scores:
    """Runs a policy for one episode per seed."""
    name = f"{NAMESPACE}/{choice('id', id, tuple(ENTRIES))}"
    env: Any = gymnasium.make_vec(name, num_envs=len(seeds), **options).unwrapped
    observations, info = env.reset(seed=list(seeds))
    truths = [env.info_of(i) for i in range(len(seeds))]
    policy = make(env.task, truths, 0)
    total, length = np.zeros((2, len(seeds)))
    live = np.ones(len(seeds), bool)
    last: dict[str, np.ndarray] = {}
    while live.any():
        observations, rewards, ended, cut_off, info = env.step(policy(observations))
        total += np.where(live, rewards, 0.0)
        length += live
        for key in (k for k in info if f"_{k}" in info and not k.startswith("_")):
            found = np.asarray(info[key])
            last[key] = np.asarray(np.where(live, found, last.get(key, found)))
        live &= ~(ended | cut_off)
    env.close()
    return Scores(total, length, last)


def mean_of(x: np.ndarray) -> tuple[float, float]:
    """Mean, and half of its 95 % confidence interval by the normal distribution."""
    return float(x.mean()), 1.96 * float(x.std(ddof=1)) / math.sqrt(len(x))
