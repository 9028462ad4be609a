"""A controller for runs: drives that sample at a rate of their own, under a host."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..arms.joint_law import JointPD, compensated, fed_friction, rate_filter
from ..arms.mjcf_arm import MjcfArm
from ..model.sampled_controller import Controller

SLACK = 1e-9  # of a sample


class SampledDrive:
    """Torques of the drives at each of their samples: their gains, and what the host has sent.

    The host measures at every `samples`-th sample of the drives, the first one included; what it
    feeds forward, of gravity and of friction, arrives `late` samples of the drives after that.
    The state of the controller is the number of the sample, what the host has sent, newest first,
    and its last positions and rates.
    """

    def __init__(self, arm: MjcfArm, law: JointPD, reference: np.ndarray, Ts: float, delay: float):
        self.samples = law.drive_samples(Ts) or 1
        self.late = math.ceil(delay * self.samples / Ts - SLACK)
        self.arm, self.law, self.mechanism, self.n = arm, law, arm.mechanism, len(arm.names)
        self.weighs = compensated(arm, law)
        self.Kp, self.Kd, self.reference = np.array(law.Kp), np.array(law.Kd), reference
        self.kept = self.late // self.samples + 2
        self.estimate = rate_filter(law.cutoff, Ts)

    def controller(self, q: np.ndarray) -> Controller:
        """The controller, from rest at joint positions."""
        sent = np.tile(self._weights(q), (self.kept, 1))
        return Controller(self, state=(0.0, *sent.ravel().tolist(), *q.tolist(), *(0.0,) * self.n))

    def __call__(
        self, t: float, q: Any, qd: Any, fh: Any, state: Any, params: Any
    ) -> tuple[list[float], list[float]]:
        q, qd, k, n = np.array(q), np.array(qd), round(state[0]), self.n
        sent = np.array(state[1 : 1 + self.kept * n]).reshape(-1, n)
        past, rate = np.array(state[-2 * n : -n]), np.array(state[-n:])
        host, turn = divmod(k, self.samples)
        if not turn:
            keep, gain = self.estimate
            rate = qd if self.law.velocity == "exact" else keep * rate + gain * (q - past)
            past = q
            fed = self._weights(q) + fed_friction(self.law, rate)
            sent = np.vstack([fed, sent[:-1]])
        arrived = host - (k - self.late) // self.samples
        torque = self.Kp * (self.reference - q) - self.Kd * qd + sent[min(arrived, self.kept - 1)]
        return torque.tolist(), [k + 1.0, *sent.ravel(), *past, *rate]

    def _weights(self, q: np.ndarray) -> np.ndarray:
        """Torques that hold the arm against gravity, where the host feeds them."""
        if not self.weighs:
            return np.zeros(self.n)
        self.mechanism.at(q)
        return self.mechanism.weights()
