"""A run of a leader and a follower: two runs in step that exchange messages as they arrive.

An engine step is the largest part of the control sample of which all delays are whole multiples. A
packet is late by the link's delay and a random part of its jitter, or lost; the newest one that has
arrived is held; with passivity controllers it is read at samples.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import ParameterError
from ..physics import warnings_caught
from ..scene import pair as pairs
from ..scene.link import ENDS
from ..scene.pair import Pair
from ..theory.architectures import ARCHITECTURES
from . import stepwise
from .pair_arms import MOST_PARTS, least_parts, run_arm, run_scene
from .pair_host import Host
from .pair_record import PairRecord
from .stepwise import Simulation

WHOLE = 1e-6  # of an engine step that a delay may be off
FASTEST = 1e3  # [rad/s], of slides [m/s]: of no arm, and a chain so fast cannot be closed
ARRIVE, ACT = 0, 1  # order of events at the same step


class PairRun:
    """Both hosts, events between them, and what is recorded, sample by sample.

    `forces` are what presses the handles of leader and follower from now on [N], besides the
    muscle of the pair; None for nothing. Each `every`-th sample is kept, and the `newest`. `ended`
    says what ended the run, "" while nothing has.
    """

    def __init__(self, pair: Pair, engine: str = "auto", every: int = 1):
        self.pair, self.architecture = pair, ARCHITECTURES[pair.link.kind]
        self.parts, self.step = parts_of(pair), 0
        self.random = np.random.default_rng(pair.link.seed)
        self.events: list[Any] = []
        self.count, self.energy, self.ended = 0, 0.0, ""
        self.forces: list[Sequence[float] | None] = [None, None]
        self.every = every
        self.newest: list[Any] = []  # row of the last sample
        self._is_amid = False  # a step, or one was interrupted
        dt = pair.Ts / self.parts
        more = {"dt": dt, "t_max": (self.samples * self.parts + 2) * dt}
        self.hosts = []
        for i, control in enumerate(self.architecture.controls(pair)):
            acts = i == 1 or self.architecture.leader_law
            muscle = {"muscle": pair.muscle} if i == 0 else {}
            scene = run_scene(pair, i, run_arm(pair, i, acts), **more, **muscle)
            run = Simulation(scene, engine=engine, recorded=False, monitored=False)
            self.hosts.append(Host(pair, i, control, run))
        for host in self.hosts:
            host.own = host.weight.copy()
        self.rows: list[list[Any]] = []

    @property
    def samples(self) -> int:
        """Control samples of the whole run."""
        return max(1, round(self.pair.t_max / self.pair.Ts))

    @property
    def t(self) -> float:
        """Time [s]."""
        return self.pair.Ts * self.step / self.parts

    def advance(self) -> None:
        """Makes a control sample: measures, sends, and steps both arms; does nothing once ended.

        Raises:
            RuntimeError: an earlier call was interrupted; what it recorded remains.
        """
        if self._is_amid:
            raise RuntimeError("Ctrl-C came within a sample of the pair: start it again")
        end = (self.step // self.parts + 1) * self.parts
        with warnings_caught():  # of arms that diverge, which is an outcome
            while self.step < end and not self.ended:
                self._go_on(end)

    def _go_on(self, end: int) -> None:
        """Makes steps of both arms, to what is due next; at a sample hosts measure and send."""
        self._is_amid = True
        self._act(ARRIVE)
        if self.step % self.parts == 0:
            self._sample()
        self._act(ACT)
        self.ended = self._beyond()
        if not self.ended:
            due = min(self.events[0][0], end) if self.events else end
            n = 1 if any(host.drives for host in self.hosts) else due - self.step
            self.energy += sum(self._advanced(host, n) for host in self.hosts)
            self.ended = self._ended()
            self.step += n
        self._is_amid = False

    def to_end(self) -> PairRecord:
        """Runs for the time of the pair, or until something ends it."""
        while not self.ended and self.step < self.samples * self.parts:
            self.advance()
        return self.record()

    def record(self) -> PairRecord:
        """What has happened so far."""
        columns = [np.array(x) for x in zip(*self.rows, strict=True)]
        names = pairs.joint_names(self.pair.leader)
        fields: Any = self.pair.link.kind, names, *columns, self.ended, self.pair.follows, self.pair
        return PairRecord(*fields)

    def _sample(self) -> None:
        """Both hosts measure, compute and send."""
        pair, states = self.pair, [host.run.state for host in self.hosts]
        found = [host.sampled() for host in self.hosts]
        for i, (own, message) in enumerate(found):
            self._later(pair.delay, ACT, i, "own", own)
            self._send(i, (self.step, message, self.hosts[i].port.into))
        row = [self.t]
        row += [x.q for x in states] + [host.torque for host in self.hosts]
        ends = (states[0].fh, self.hosts[1].pressed)
        forces = [x[host.places.shown] for x, host in zip(ends, self.hosts, strict=True)]
        ports = [host.port.taken for host in self.hosts]
        self.newest = [*row, *forces, self.energy, ports]
        if self.step // self.parts % self.every == 0:
            self.rows.append(self.newest)

    def _send(self, i: int, packet: tuple[int, np.ndarray, float]) -> None:
        """A packet of an end, on its way to the other one."""
        link = self.pair.link
        if link.loss and self.random.random() < link.loss:
            return
        late = link.delays[i] + (link.jitter * self.random.random() if link.jitter else 0.0)
        kind = "message" if self.architecture.whole else "pull"
        self._later(late, ARRIVE, 1 - i, kind, packet)

    def _later(self, late: float, order: int, i: int, kind: str, value: Any) -> None:
        self.count += 1
        due = self.step + math.ceil(late * self.parts / self.pair.Ts - WHOLE)
        if kind == "message":
            due = max(due, self.step + 1)
        heapq.heappush(self.events, (due, order, self.count, i, kind, value))

    def _act(self, order: int) -> None:
        """What is due now: packets arrive before a sample, torques act after it."""
        while self.events and self.events[0][:2] <= (self.step, order):
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
            self._later(self.pair.delay, ACT, i, "other", pull)

    def _advanced(self, host: Host, n: int) -> float:
        """Makes steps of an arm; the energy that controllers took from it [J]."""
        before = host.run.state.q
        host.run.advance(n, force=self.forces[host.i], torque=host.torque.tolist())
        taken = host.taken(before, host.run.state.q, host.weight)
        host.port.taken += taken
        return taken

    def _beyond(self) -> str:
        """Which host asks for more torque than any motor has, "" for none."""
        for name, host in zip(ENDS, self.hosts, strict=True):
            if not np.abs(host.torque).max() <= stepwise.MOST:
                return f"{name} diverged: torques beyond {stepwise.MOST:g} N.m"
        return ""

    def _ended(self) -> str:
        for name, host in zip(ENDS, self.hosts, strict=True):
            if host.run.outcome is not None:
                return f"{name} {host.run.outcome}"
            if not np.abs(host.run.state.qd).max() <= FASTEST:
                return f"{name} diverged: a joint beyond {FASTEST:g} rad/s or m/s"
        return ""


def parts_of(pair: Pair) -> int:
    """Engine steps of a control sample: the fewest of which all delays are whole multiples.

    Raises:
        ParameterError: there are none up to 40, or clay is too stiff.
    """
    least = max(8 if pair.link.jitter > 0.0 else 2, least_parts(pair))
    for parts in range(least, MOST_PARTS + 1):
        late = [x * parts / pair.Ts for x in (*pair.link.delays, pair.delay)]
        if all(abs(x - round(x)) <= WHOLE * max(1.0, x) for x in late):
            return parts
    bound = f"must be whole parts of the control sample {pair.Ts:g} s, down to 1/{MOST_PARTS} of it"
    raise ParameterError("delay", (*pair.link.delays, pair.delay), bound)
