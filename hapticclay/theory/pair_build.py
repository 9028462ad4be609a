"""From a pair to the linear loop of its theory."""

from __future__ import annotations

import copy
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arms.joint_law import JointPD, compensated
from ..arms.mechanism import Linear
from ..arms.mjcf_arm import MjcfArm
from ..model.operator import NO_HAND
from ..scene import contact, pair_hardware
from ..scene import pair as pairs
from ..scene.link import ENDS
from ..scene.pair import Pair
from .architectures import ARCHITECTURES
from .client_loop import with_hand
from .joint_gains import IGNORED, SMALL, joint_loop
from .joint_loop import JointLoop
from .linear_loop import whole_samples
from .pair_end import End, Load
from .pair_loop import PairLoop


class Build:
    """A pair as linear ends, remade with other delays, gains and friction.

    Attributes:
        pair: the pair.
        architecture: what its link makes of it.
    """

    def __init__(self, pair: Pair):
        self.pair, self.architecture = pair, ARCHITECTURES[pair.link.kind]
        self._arms = _carried(pair, 0), _carried(pair, 1)

    @cached_property
    def delays(self) -> tuple[float, float]:
        """Delays of the link there and back, with jitter and loss [s]."""
        link, Ts = self.pair.link, self.pair.Ts
        more = sum(link.further_delay(Ts).values())
        there, back = link.delays
        return there + more, back + more

    def loop(
        self,
        delays: tuple[float, float] | None = None,
        gain: float = 1.0,
        friction: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> PairLoop:
        """The loop with delays of the link [s], a factor of all Kp, and slopes of the friction.

        None stands for the pair's own.
        """
        pair = _scaled(self.pair, gain) if gain != 1.0 else self.pair
        controls = self.architecture.controls(pair)
        late = [self.samples(x) for x in (self.delays if delays is None else delays)]
        shares = late[1][1], late[0][1]  # what arrives at the leader comes by the way back
        ends = []
        for i, (linear, load) in enumerate(self._arms):
            loop = self._joint_loop(pair, i, linear, None if friction is None else friction[i])
            ends.append(End(loop, load, controls[i], shares[i] * pair.Ts))
        return PairLoop(ends[0], ends[1], late[0][0], late[1][0])

    def samples(self, delay: float) -> tuple[int, float]:
        """Whole samples of a delay of the link, and the share of one."""
        whole, share = whole_samples(delay, self.pair.Ts)
        if not self.architecture.whole:
            return whole, share
        return max(1, whole + (share > 0.0)), 0.0

    def _joint_loop(
        self, pair: Pair, i: int, linear: Linear, slopes: np.ndarray | None
    ) -> JointLoop:
        law, arm = pair.laws[i], pair.arms[i]
        none = np.zeros(pair.n)
        gains = (none, none) if i == 0 and not self.architecture.leader_law else None
        known = compensated(arm, law)
        loop = joint_loop(linear, law, pair.Ts, pair.delay, known, gains)
        if slopes is None:
            return loop
        return loop.feeding(np.diag(none), np.diag(np.array(law.slopes) - slopes))

    @property
    def names(self) -> tuple[str, ...]:
        """Joints of leader and follower."""
        leader, follower = map(pairs.joint_names, self.pair.arms)
        return (*leader, *follower)

    def assumed(self) -> tuple[str, ...]:
        """What the verdict rests on, a sentence each."""
        pair, out = self.pair, []
        for name, arm in zip(ENDS, pair.arms, strict=True):
            out += [f"{name}: {note}" for note in pairs.notes_of(arm)]
        if pair.leader is pair.follower:
            out = [f"both arms: {note}" for note in pairs.notes_of(pair.leader)]
        out += self._law_words()
        for i, name in enumerate(ENDS):
            words = contact.left_out(pair.touched[i]), pair_hardware.left_out(pair, i)
            out += [f"{name}: {x}" for x in words if x]
        if pair.link.jitter or pair.link.loss:
            out.append("jitter and loss: as the constant delay that they come to")
        if pair.link.passivity:
            out.append("passivity controllers: left out, they are not linear; runs have them")
        return (*out, f"{SMALL}s", IGNORED)

    def _law_words(self) -> list[str]:
        leader, follower = self.pair.laws
        if not self.architecture.leader_law:
            return [f"law of the follower: {follower.words}; the leader's gains take no part"]
        if leader is follower:
            return [f"both laws: {leader.words}"]
        return [f"law of the leader: {leader.words}", f"law of the follower: {follower.words}"]


def _scaled(pair: Pair, gain: float) -> Pair:
    """The pair with a factor on Kp of both laws."""

    def stiffer(law: JointPD) -> JointPD:
        made = copy.copy(law)  # a factor that is tried may be beyond the bound of what is given
        object.__setattr__(made, "Kp", tuple(gain * x for x in law.Kp))
        return made

    laws = [stiffer(law) for law in pair.laws]
    return replace(pair, law=laws[0], follower_law=laws[1])


def _carried(pair: Pair, i: int) -> tuple[Linear, Load]:
    """An arm with the hand and what it touches at its handle, and that load."""
    arm, hand, touched = pair.arms[i], pair.operators[i], pair.touched[i]
    linear = pairs.linear_arm(arm)
    none = np.zeros((pair.n, pair.n))
    if hand is None and touched is None:
        return linear, Load(none, none, none)
    _check_handle(arm)
    J, hand = linear.jacobian, hand or NO_HAND
    square = J.T @ J
    met = [J.T @ x @ J for x in pairs.touched_load(pair, i)]
    held = with_hand(linear, hand)
    load = Load(
        hand.mass * square + met[0], hand.damper * square + met[1], hand.spring * square + met[2]
    )
    return held._replace(
        inertia=held.inertia + met[0],
        damping=held.damping + met[1],
        stiffness=held.stiffness + met[2],
    ), load


def _check_handle(arm: Any) -> None:
    if isinstance(arm, MjcfArm):
        arm.check_handle()
