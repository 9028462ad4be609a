"""A run of a leader and a follower: two runs in step that exchange messages as they arrive."""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..arguments import checked, named
from ..arms.joint_law import compensated, rate_filter
from ..errors import Bound, ParameterError
from ..model.shapes import Pulse
from ..model.signals import Signal
from ..results import Result, Tables
from ..scene import pair as pairs
from ..scene.pair import Pair
from ..theory.architectures import ARCHITECTURES
from ..theory.architectures.control import Control
from . import stepwise
from .pair_arms import run_arm, run_scene
from .pair_passivity import Port
from .stepwise import Simulation

PUSH = Pulse((1.0, 0.0), 0.0, 0.05)  # [N] for 50 ms: a hand's touch
MOST_PARTS = 40  # engine steps of a control sample that are tried
WHOLE = 1e-6  # of an engine step that a delay may be off
ARRIVE, ACT = 0, 1  # order of events at the same step
RELATIVE = 1e-9  # growth of an amplitude that is none


@named
@dataclass(frozen=True, repr=False, eq=False)
class PairRecord(Result):
    """What a leader and a follower did, m control samples of n joints.

    Attributes:
        kind: kind of the link.
        names: joints of the leader.
        t: times [s], shape (m,).
        leader: positions of the leader's joints [rad], shape (m, n).
        follower: positions of the follower's joints [rad], shape (m, n).
        leader_torque: torques that its host has held [N.m], shape (m, n).
        follower_torque: likewise, of the follower.
        hand: force of the hand on the leader [N], shape (m, 2) or (m, 3).
        contact: force of the follower on what it touches [N], likewise.
        energy: energy that controllers and link have taken from both arms [J], shape (m,): where
            it falls without bound, they feed the motion.
        port_energy: the same at leader and follower [J], shape (m, 2).
        ended: how the run ended: "" at its time, else what ended it.
    """

    drawn_by = "hapticclay.views.pair_run_plots:run_plot"
    written_as = "pair_run"
    printed = {"end": ()}

    kind: str
    names: tuple[str, ...]
    t: np.ndarray
    leader: np.ndarray
    follower: np.ndarray
    leader_torque: np.ndarray
    follower_torque: np.ndarray
    hand: np.ndarray
    contact: np.ndarray
    energy: np.ndarray
    port_energy: np.ndarray
    ended: str

    @property
    def motion(self) -> np.ndarray:
        """Largest motion of a joint of either arm from its pose [rad], shape (m,)."""
        both = np.hstack([self.leader - self.leader[0], self.follower - self.follower[0]])
        return np.abs(both).max(axis=1)

    @property
    def grows(self) -> bool:
        """Whether rates in the last quarter are larger than in the one before, or it ended."""
        if self.ended:
            return True
        both = np.diff(np.hstack([self.leader, self.follower]), axis=0)
        third, last = np.array_split(np.abs(both).max(axis=1), 4)[2:]
        return bool(last.max() > (1.0 + RELATIVE) * third.max())

    @property
    def error(self) -> float:
        """Root mean square of follower less leader, all joints [rad]."""
        return float(np.sqrt(np.mean((self.follower - self.leader) ** 2)))

    def headline(self) -> str:
        """The run in one line."""
        how = f"ended at {self.t[-1]:.4g} s: {self.ended}" if self.ended else "to its end"
        grows = "motion grows" if self.grows else "motion decays"
        return (
            f"{self.kind}, {how}; {grows}; follower off by {1e3 * self.error:.3g} mrad rms; "
            f"controllers and link took {self.energy[-1]:.3g} J, at least {self.energy.min():.3g} J"
        )

    def tables(self) -> Tables:
        """How it ended, and every sample."""
        end: dict[str, Any] = {
            "t [s]": [float(self.t[-1])],
            "grows": [self.grows],
            "error [rad]": [self.error],
            "energy [J]": [float(self.energy[-1])],
        }
        samples: dict[str, Any] = {"t [s]": self.t, "energy [J]": self.energy}
        for i, name in enumerate(("leader", "follower")):
            samples[f"energy at {name} [J]"] = self.port_energy[:, i]
        for j, name in enumerate(self.names):
            samples[f"leader {name} [rad]"] = self.leader[:, j]
            samples[f"follower {name} [rad]"] = self.follower[:, j]
        return {"end": end, "samples": samples}


@checked
def simulate_pair(
    pair: Pair,
    t_max: Annotated[float, Bound(0.0, 1e4, "s", above=True)] = 2.0,
    *,
    push: Signal | None = PUSH,
    seed: Annotated[int, Bound(0, 2**32 - 1)] = 0,
    engine: str = "auto",
) -> PairRecord:
    """Runs a leader and a follower: the full motion of both arms, messages as they arrive.

    Each arm runs as in `simulate`, its host's torques given step by step. An engine step is the
    largest part of the control sample of which all delays are whole multiples. A packet is late by
    the link's delay and a random part of its jitter, or lost; the newest one that has arrived is
    held; with passivity controllers it is read at samples. Joint friction, torque limits and joint
    stops act.

    Args:
        pair: two arms from files or devices of one axis, with a handle each.
        t_max: the run ends at this time [s], > 0, at most 1e4.
        push: muscle force of the hand at the leader [N]; None for none. By default 1 N for 50 ms.
        seed: seed of jitter and losses, 0 to 2^32 - 1.
        engine: as in `simulate`.

    Raises:
        ParameterError: an arm cannot run, or no part of the control sample down to 1/40 divides all
            delays.
    """
    return _Run(pair, t_max, push, seed, engine).record()


class _Host:
    """One end: its run, its law, and what it has received."""

    def __init__(self, pair: Pair, i: int, control: Control, run: Simulation):
        self.pair, self.i, self.control, self.run = pair, i, control, run
        self.arm, self.law = run.scenario.file_arm, pair.laws[i]
        self.axes = ["xyz".index(c) for c in self.arm.axes]
        self.start = run.state.q.copy()
        self.own, self.other = np.zeros(pair.n), np.zeros(pair.n)
        self.arrived = np.zeros(len(control.message))  # waves; others pull as they arrive
        self.newest, self.x = -1, np.zeros(control.states)
        self.last_q, self.rate = np.zeros(pair.n), np.zeros(pair.n)
        self.held = compensated(pair.arms[i], self.law)
        self.acts = i == 1 or ARCHITECTURES[pair.link.kind].leader_law
        self.weight = self._weight(self.start)
        self.port = Port(pairs.linear_arm(pair.arms[i]).inertia, pair.Ts, pair.link.reserve)
        self.pull = np.zeros(pair.n)  # as it arrived, with passivity controllers

    def _weight(self, q: np.ndarray) -> np.ndarray:
        """Torque against the arm's weight."""
        mechanism = self.arm.mechanism
        if not (self.held and mechanism.weighs):
            return np.zeros(len(q))
        mechanism.at(q)
        return mechanism.weights()

    def sampled(self) -> tuple[np.ndarray, np.ndarray]:
        """Measures, and returns the own torque and the message."""
        state = self.run.state
        q = state.q - self.start
        v = self._rate(q, state.qd)
        jacobian = self.arm.jacobian(state.q)[self.axes]  # type: ignore[union-attr]
        F = -jacobian.T @ state.fh[: len(self.axes)]
        y = np.concatenate([q, v, F])
        signals = np.concatenate([y, self.arrived, self.x])
        own = self.control.torque @ signals
        message = self.control.message @ signals
        self.x = self.control.state @ signals
        own = own + self._law(q, v)
        if self.pair.link.passivity:
            self.port.observe()
            own = self.port.guarded(own + self.pull, v)
        self.weight = self._weight(state.q)
        return own + self.weight, message

    def _rate(self, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """The measured rate, as the law estimates it."""
        if self.law.velocity == "exact":
            return qd
        keep, gain = rate_filter(self.law.cutoff, self.pair.Ts)
        self.rate = keep * self.rate + gain * (q - self.last_q)
        self.last_q = q
        return self.rate

    def _law(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The joint law where the host runs it, and the friction that it feeds forward."""
        out = np.zeros(len(q))
        if self.acts and self.law.runs == "host":
            out -= np.array(self.law.Kp) * q + np.array(self.law.Kd) * v
        if self.law.friction is not None:
            Fc, k, Fv = np.array(self.law.friction).T
            out += Fc * np.tanh(k * v) + Fv * v
        return out

    @property
    def torque(self) -> np.ndarray:
        """The held torque."""
        return self.own + self.other

    def taken(self, before: np.ndarray, after: np.ndarray, weight: np.ndarray) -> float:
        """Energy that law and link took from the arm in a step, drives included [J]."""
        moved = after - before
        out = -(self.torque - weight) @ moved
        if self.acts and self.law.runs == "drive":
            middle = 0.5 * (before + after) - self.start
            rate = moved / self.run.scenario.dt
            out += (np.array(self.law.Kp) * middle + np.array(self.law.Kd) * rate) @ moved
        return float(out)


class _Run:
    """Both hosts, events between them, and what is recorded."""

    def __init__(self, pair: Pair, t_max: float, push: Signal | None, seed: int, engine: str):
        self.pair, self.architecture = pair, ARCHITECTURES[pair.link.kind]
        self.parts = parts_of(pair)
        self.steps = max(1, round(t_max / pair.Ts)) * self.parts
        self.random = np.random.default_rng(seed)
        self.events: list[Any] = []
        self.count = 0
        controls = self.architecture.controls(pair)
        more = {"dt": pair.Ts / self.parts, "t_max": (self.steps + 2) * pair.Ts / self.parts}
        self.hosts = []
        for i, control in enumerate(controls):
            acts = i == 1 or self.architecture.leader_law
            muscle = {"muscle": push} if i == 0 and push is not None else {}
            scene = run_scene(pair, i, run_arm(pair, i, acts), **more, **muscle)
            run = Simulation(scene, engine=engine, recorded=False, monitored=False)
            self.hosts.append(_Host(pair, i, control, run))
        self.rows: list[list[Any]] = []

    def record(self) -> PairRecord:
        """Runs to the end."""
        energy, ended = 0.0, ""
        for host in self.hosts:
            host.own = host.weight.copy()
        for step in range(self.steps):
            self._act(step, ARRIVE)
            if step % self.parts == 0:
                self._sample(step, energy)
            self._act(step, ACT)
            ended = self._beyond()
            if not ended:
                energy += sum(map(self._advanced, self.hosts))
                ended = self._ended()
            if ended:
                break
        columns = [np.array(x) for x in zip(*self.rows, strict=True)]
        names = pairs.joint_names(self.pair.leader)
        fields: Any = self.pair.link.kind, names, *columns, ended
        return PairRecord(*fields)

    def _sample(self, step: int, energy: float) -> None:
        """Both hosts measure, compute and send."""
        pair, states = self.pair, [host.run.state for host in self.hosts]
        found = [host.sampled() for host in self.hosts]
        for i, (own, message) in enumerate(found):
            self._later(step, pair.delay, ACT, i, "own", own)
            self._send(step, i, (step, message, self.hosts[i].port.into))
        row = [pair.Ts * step / self.parts]
        row += [x.q for x in states] + [host.torque for host in self.hosts]
        self.rows.append([*row, states[0].fh, -states[1].fh, energy])
        self.rows[-1].append([host.port.taken for host in self.hosts])

    def _send(self, step: int, i: int, packet: tuple[int, np.ndarray, float]) -> None:
        """A packet of an end, on its way to the other one."""
        link = self.pair.link
        if link.loss and self.random.random() < link.loss:
            return
        late = link.delays[i] + (link.jitter * self.random.random() if link.jitter else 0.0)
        kind = "message" if self.architecture.whole else "pull"
        self._later(step, late, ARRIVE, 1 - i, kind, packet)

    def _later(self, step: int, late: float, order: int, i: int, kind: str, value: Any) -> None:
        self.count += 1
        due = step + math.ceil(late * self.parts / self.pair.Ts - WHOLE)
        if kind == "message":
            due = max(due, step + 1)
        heapq.heappush(self.events, (due, order, self.count, i, kind, value))

    def _act(self, step: int, order: int) -> None:
        """What is due at a step: packets arrive before a sample, torques act after it."""
        while self.events and self.events[0][:2] <= (step, order):
            _, _, _, i, kind, value = heapq.heappop(self.events)
            host = self.hosts[i]
            if kind in ("own", "other"):
                setattr(host, kind, value)
                continue
            sent, message, into = value
            if sent <= host.newest:
                continue  # an older packet that a newer one has overtaken
            host.newest, host.port.sent = sent, into
            if kind == "message":
                host.arrived = message
                continue
            n, m = self.pair.n, len(message)
            pull = host.control.torque[:, 3 * n : 3 * n + m] @ message
            if self.pair.link.passivity:
                host.pull = pull
                continue
            self._later(step, self.pair.delay, ACT, i, "other", pull)

    def _advanced(self, host: _Host) -> float:
        """Makes a step of an arm; the energy that controllers took from it [J]."""
        before = host.run.state.q
        host.run.step(torque=host.torque.tolist())
        taken = host.taken(before, host.run.state.q, host.weight)
        host.port.taken += taken
        return taken

    def _beyond(self) -> str:
        """Which host asks for more torque than any motor has, "" for none."""
        for name, host in zip(("leader", "follower"), self.hosts, strict=True):
            if not np.abs(host.torque).max() <= stepwise.MOST:
                return f"{name} diverged: torques beyond {stepwise.MOST:g} N.m"
        return ""

    def _ended(self) -> str:
        for name, host in zip(("leader", "follower"), self.hosts, strict=True):
            if host.run.outcome is not None:
                return f"{name} {host.run.outcome}"
        return ""


def parts_of(pair: Pair) -> int:
    """Engine steps of a control sample: the fewest of which all delays are whole multiples.

    Raises:
        ParameterError: there are none up to 40.
    """
    jitter = pair.link.jitter > 0.0
    for parts in range(8 if jitter else 2, MOST_PARTS + 1):
        late = [x * parts / pair.Ts for x in (*pair.link.delays, pair.delay)]
        if all(abs(x - round(x)) <= WHOLE * max(1.0, x) for x in late):
            return parts
    bound = f"must be whole parts of the control sample {pair.Ts:g} s, down to 1/{MOST_PARTS} of it"
    raise ParameterError("delay", (*pair.link.delays, pair.delay), bound)
