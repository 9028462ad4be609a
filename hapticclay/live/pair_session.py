"""A leader and a follower in real time: a person is the hand at the leader's handle."""

from __future__ import annotations

import math
import threading
from collections import deque
from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from ..arguments import checked
from ..arms.joint_law import JointPD
from ..errors import Bound, Real
from ..model.operator import Operator
from ..scene.pair import Pair
from ..simulation.pair_record import PairRecord
from ..simulation.pair_run import PairRun
from ..theory.pair_verdict import PairLimits, pair_limits
from .clock import Clock
from .frame import Listener, Partner
from .run import LONGEST_SESSION
from .verdict import LiveVerdict

SHOWN = 10.0  # [s] of the plots
STIFFNESS = 50.0  # of a session's own hand, as a multiple of the spring of Th


class PairFrame(NamedTuple):
    """State of a pair at the end of a slice."""

    t: float  # [s]
    off: float  # largest of the follower's joints from where the link asks it to be [rad]
    hand: float  # force of the hand [N]
    contact: float  # force of the follower on what it touches [N]
    energy: tuple[float, float]  # taken at leader and follower [J]


class PairSession:
    """A leader that a person pulls, and its follower.

    `given` is the pair as given, `pair` the running one, with the present delay and gains, and with
    a hand of the session where it has none with a spring. `point` is how far from its start the
    hand pulls the handle, along the axes of its forces [m]; None if it does not pull.
    """

    stream: Listener | None = None

    @checked
    def __init__(self, pair: Pair, every: Annotated[int, Bound(1, 1_000_000)] = 10):
        """Begins at rest; muscle and t_max of the pair are ignored, every every-th sample kept."""
        self.given, self.every = pair, every
        self.partner, self.theory = Partner(), Theory()
        self.delay, self.gain = max(pair.link.delays), 1.0
        self.restart()

    def restart(self) -> None:
        """Starts again with the present delay and gains, and an empty record."""
        given = self.given
        link = given.link
        if self.delay != max(link.delays):
            link = replace(link, delay=self.delay)
        laws = [law and _stiffer(law, self.gain) for law in (given.law, given.follower_law)]
        hand = {"leader_operator": _hand(given), "muscle": None, "t_max": LONGEST_SESSION}
        pair = replace(given, link=link, law=laws[0], follower_law=laws[1], **hand)
        self.run = PairRun(pair, every=self.every)
        self.pair, self.paused = pair, False
        self.clock = Clock(self.partner.span)
        self.point: np.ndarray | None = None
        self.frames: deque[PairFrame] = deque(maxlen=round(SHOWN / self.partner.span))
        self._time_left = 0.0
        self.theory.ask(pair)

    @checked
    def change(
        self,
        delay: Annotated[Real | None, Bound(0.0, 10.0, "s")] = None,
        gain: Annotated[float | None, Bound(0.0, 1e3, above=True)] = None,
    ) -> None:
        """Restarts with another one-way delay, both ways alike, or factor of all gains Kp.

        Raises:
            ParameterError: no part of the control sample divides the delay; nothing is changed.
        """
        before = self.delay, self.gain
        self.delay = self.delay if delay is None else delay
        self.gain = self.gain if gain is None else gain
        try:
            self.restart()
        except Exception:
            self.delay, self.gain = before
            raise

    def pull(self, point: np.ndarray | None) -> None:
        """Makes the hand pull the handle to a place, given from its start."""
        self.point = None if point is None else np.asarray(point, dtype=float)

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self.run.t

    @property
    def ended(self) -> str:
        """Why the run cannot continue; empty if it can."""
        return self.run.ended

    @property
    def recorded(self) -> bool:
        """Whether anything was recorded."""
        return bool(self.run.rows)

    def advance(self, seconds: float) -> None:
        """Advances by a slice of simulated time, unless paused."""
        run, Ts = self.run, self.pair.Ts
        if self.paused or run.ended:
            return
        samples = math.floor((seconds + self._time_left) / Ts + 1e-9)
        self._time_left += seconds - samples * Ts
        for _ in range(samples):
            run.forces[0] = self._force()
            run.advance()
        if samples:
            self._observe()

    def _force(self) -> list[float]:
        """With the spring of the hand, the force to the point; released, its spring alone."""
        hand, host = self.pair.leader_operator, self.run.hosts[0]
        place = np.array(host.run.state.p)
        if self.point is not None:
            place[host.places.shown] = self.point
        return (hand.spring * place).tolist() if hand else [0.0] * len(place)

    def _observe(self) -> None:
        t, leader, follower, *_, hand, contact, _, ports = self.run.newest
        starts = [host.start for host in self.run.hosts]
        asked = self.pair.follows @ (leader - starts[0])
        off = float(np.abs(follower - starts[1] - asked).max())
        pressed, touched = (float(np.linalg.norm(x)) for x in (hand, contact))
        self.frames.append(PairFrame(t, off, pressed, touched, (ports[0], ports[1])))

    def verdict(self) -> LiveVerdict:
        """What theory says of the pair, or how it ended."""
        if self.ended:
            return LiveVerdict(self.ended, True)
        found = self.theory.found
        if found is None:
            return LiveVerdict(self.theory.error or "theory is being computed", False)
        return LiveVerdict(found.headline(), not found.stable)

    def record(self) -> PairRecord:
        """What has happened since the last restart."""
        return self.run.record()


class Theory:
    """Limits of the newest pair that was asked about, computed in a thread of their own.

    `found` is None, and `error` "", until they are there.
    """

    def __init__(self) -> None:
        self.found: PairLimits | None = None
        self.error = ""
        self._asked: Pair | None = None
        self._lock, self._busy = threading.Lock(), False

    def ask(self, pair: Pair) -> None:
        """Begins to compute; an answer about an earlier pair is dropped."""
        with self._lock:
            self._asked, self.found, self.error = pair, None, ""
            if self._busy:
                return
            self._busy = True
        threading.Thread(target=self._answer, name="theory", daemon=True).start()

    def _answer(self) -> None:
        while True:
            with self._lock:
                pair = self._asked
            assert pair is not None
            try:
                found, error = pair_limits(pair), ""
            except Exception as fault:  # shown in place of the verdict
                found, error = None, " ".join(str(fault).split())
            with self._lock:
                if pair is self._asked:
                    self.found, self.error, self._busy = found, error, False
                    return


def _stiffer(law: JointPD, factor: float) -> JointPD:
    return replace(law, Kp=tuple(factor * x for x in law.Kp))


def _hand(pair: Pair) -> Operator:
    """The hand of a pair, or of the session if that cannot pull: without a spring."""
    given = pair.leader_operator
    if given is not None and given.spring:
        return given
    th = Operator()
    return Operator(th.mass, th.damper * math.sqrt(STIFFNESS), th.spring * STIFFNESS)
