"""One end of a running pair: its arm, its host's law, and what it has received."""

from __future__ import annotations

import numpy as np

from ..arms.joint_law import compensated, fed_friction, rate_filter
from ..scene import pair as pairs
from ..scene.pair import Pair
from ..theory.architectures import ARCHITECTURES
from ..theory.architectures.control import Control
from .pair_passivity import Port
from .pair_places import Places
from .pair_sensors import Sensors
from .stepwise import Simulation


class Host:
    """One end: its run, its law, and what it has received."""

    def __init__(self, pair: Pair, i: int, control: Control, run: Simulation):
        self.pair, self.i, self.control, self.run = pair, i, control, run
        self.law = pair.laws[i]
        self.Kp, self.Kd = np.array(self.law.Kp), np.array(self.law.Kd)
        self.start = run.state.q.copy()
        self.own, self.other = np.zeros(pair.n), np.zeros(pair.n)
        self.arrived = np.zeros(len(control.message))  # waves; others pull as they arrive
        self.newest, self.x = -1, np.zeros(control.states)
        self.last_q, self.rate = np.zeros(pair.n), np.zeros(pair.n)
        held = compensated(pair.arms[i], self.law)
        self.places = Places(run.scenario, pair.arms[i], held)
        self.sensors = Sensors(pair, i, len(self.places.axes))
        self.zero = self.sensors.positions(self.start)
        self.acts = i == 1 or ARCHITECTURES[pair.link.kind].leader_law
        self.weight = self.places.weight(self.start)
        self.port = Port(pairs.linear_arm(pair.arms[i]).inertia, pair.Ts, pair.link.reserve)
        self.pull = np.zeros(pair.n)  # as it arrived, with passivity controllers

    def sampled(self) -> tuple[np.ndarray, np.ndarray]:
        """Measures, and returns the own torque and the message."""
        state = self.run.state
        seen = self.sensors.positions(state.q)
        q = seen - self.zero
        v = self._rate(q, state.qd)
        F = self._felt(seen) if self.control.feels else np.zeros(len(q))
        y = np.concatenate([q, v, F])
        signals = np.concatenate([y, self.arrived, self.x])
        own = self.control.torque @ signals
        message = self.control.message @ signals
        self.x = self.control.state @ signals
        own = own + self._law(q, v)
        if self.pair.link.passivity:
            self.port.observe()
            own = self.port.guarded(own + self.pull, v)
        self.weight = self.places.weight(seen)
        return own + self.weight, message

    @property
    def pressed(self) -> np.ndarray:
        """Force of the handle on what it carries and touches, along the axes of its run [N]."""
        state, n = self.run.state, len(self.places.axes)
        return state.fe[:n] - state.fh[:n]

    def _felt(self, seen: np.ndarray) -> np.ndarray:
        """Torques of the joints against the force at the handle, as measured [N.m]."""
        return self.places.jacobian(seen).T @ self.sensors.forces(self.pressed)

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
            out -= self.Kp * q + self.Kd * v
        if self.law.friction is not None:
            out += fed_friction(self.law, v)
        return out

    @property
    def drives(self) -> bool:
        """Whether its drives run the law: their work is counted step by step."""
        return self.acts and self.law.runs == "drive"

    @property
    def torque(self) -> np.ndarray:
        """The held torque."""
        return self.own + self.other

    def taken(self, before: np.ndarray, after: np.ndarray, weight: np.ndarray) -> float:
        """Energy that law and link took from the arm, of drives in one step [J]."""
        moved = after - before
        out = -(self.torque - weight) @ moved
        if self.drives:
            middle = 0.5 * (before + after) - self.start
            rate = moved / self.run.scenario.dt
            out += (self.Kp * middle + self.Kd * rate) @ moved
        return float(out)
