"""One end of a pair as equations in z: an arm, its held torques, its control.

Unknown at a sample are X = (q, w, v, F, tau_o, tau_r, x): positions, rates, measured rates, the
torque on what the arm carries, the host's torque from its own arm and that from what arrives, and
the states of the control. T(z) X = B (e, r), e a torque added to the host's and r what arrives. The
two torques are as late as the host, and as the host and a share of a sample of the link.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .architectures.control import Control
from .joint_loop import JointLoop


class Load(NamedTuple):
    """What an arm carries at its handle, in its joints: M, D and S, part of those of its loop."""

    inertia: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray


@dataclass(frozen=True, eq=False)
class End:
    """An end of a pair.

    Attributes:
        loop: the arm with its load, the joint law and what is fed forward.
        load: what the arm carries.
        control: what it computes besides.
        share: time that the torque from what arrives is later than the host's [s], below Ts.
    """

    loop: JointLoop
    load: Load
    control: Control
    share: float = 0.0

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.loop.n

    @property
    def messages(self) -> int:
        """Numbers that it sends, and receives."""
        return len(self.control.message)

    @cached_property
    def received(self) -> JointLoop:
        """The loop with the lateness of the torque from what arrives."""
        return self.loop.with_delay(self.loop.delay + self.share)

    @property
    def measured(self) -> int:
        """Groups of n states of the estimate of rates."""
        return {"exact": 0, "difference": 1, "filter": 2}[self.loop.velocity]

    @property
    def queues(self) -> tuple[int, int]:
        """Torques kept of the host's own, and of those from what arrives."""
        (own, a), (other, b) = self.loop.late, self.received.late
        felt = self.control.feels
        return own + (a > 0.0 or felt), other + (b > 0.0 or felt)

    @property
    def states(self) -> int:
        """States of the end in a map: q, w, rates, torques to come, those of its control."""
        return self.n * (2 + self.measured + sum(self.queues)) + self.control.states

    @cached_property
    def columns(self) -> dict[str, slice]:
        """Where the unknowns stand in X."""
        sizes = dict.fromkeys(("q", "w", "v", "F", "own", "other"), self.n)
        out, at = {}, 0
        for name, size in (*sizes.items(), ("x", self.control.states)):
            out[name] = slice(at, at + size)
            at += size
        return out

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 6 * self.n + self.control.states

    def equations(self, z: np.ndarray) -> np.ndarray:
        """T(z) at numbers z of shape (m,), shape (m, size, size)."""
        n, at, z = self.n, self.columns, np.asarray(z)[:, None, None]
        out = np.zeros((len(z), self.size, self.size), complex)
        unit, moves = np.eye(n), slice(0, 2 * n)
        out[:, moves, moves] = z * np.eye(2 * n) - self.loop.hold[0]
        for name, loop in (("own", self.loop), ("other", self.received)):
            out[:, moves, at[name]] = -_given(loop, z)
            out[:, at["F"], at[name]] = -_before(loop, z) * self._on_load
        out[:, at["v"], at["v"]] = unit
        if self.loop.velocity == "exact":
            out[:, at["v"], at["w"]] = -unit
        else:
            keep, gain = self.loop.rate_filter
            out[:, at["v"], at["v"]] = (1.0 - keep / z) * unit
            out[:, at["v"], at["q"]] = -gain * (1.0 - 1.0 / z) * unit
        out[:, at["F"], at["F"]] = unit
        out[:, at["F"], at["q"]] = self._on_load @ self.loop.stiffness - self.load.stiffness
        out[:, at["F"], at["w"]] = self._on_load @ self.loop.damping - self.load.damping
        for name, rows in self._own_rows.items():
            for source, part in rows.items():
                out[:, at[name], at[source]] -= part
        out[:, at["own"], at["own"]] += unit
        out[:, at["other"], at["other"]] += unit
        out[:, at["x"], at["x"]] += z * np.eye(self.control.states)
        return out

    @cached_property
    def _on_load(self) -> np.ndarray:
        """Torque on the load's inertia per torque on the arm."""
        return self.load.inertia @ np.linalg.inv(self.loop.inertia)

    @cached_property
    def _own_rows(self) -> dict[str, dict[str, np.ndarray]]:
        """What the host's own torque and the states are made of, but for what arrives."""
        torque, state = _split(self.control, "torque"), _split(self.control, "state")
        torque["q"] = torque["q"] - self.loop.position
        torque["v"] = torque["v"] - self.loop.rate
        return {"own": torque, "x": state}

    @cached_property
    def inputs(self) -> np.ndarray:
        """B, shape (size, n + m)."""
        n, m, at = self.n, self.messages, self.columns
        out = np.zeros((self.size, n + m))
        out[at["own"], :n] = np.eye(n)
        arrived = slice(3 * n, 3 * n + m)
        out[at["other"], n:] = self.control.torque[:, arrived]
        out[at["x"], n:] = self.control.state[:, arrived]
        return out

    def pushed(self, omega: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Right side of T X for a force of a sine on the handle, shape (m, size).

        The force acts between samples, along joint torques of shape (n,), at omega [rad/s] of
        shape (m,); without held torques the arm would follow it by (M s^2 + D s + S)^-1. The
        measured torque on the load has the force in it, as a hand's push.
        """
        s = 1j * np.asarray(omega)[:, None]
        alone = self.alone(omega) @ along
        both = np.concatenate([alone, s * alone], axis=1)
        out = np.zeros((len(s), self.size), complex)
        z = np.exp(s * self.loop.Ts)
        out[:, : 2 * self.n] = z * both - both @ self.loop.hold[0].T
        out[:, self.columns["F"]] = self._on_load @ along - along
        return out

    def alone(self, omega: np.ndarray) -> np.ndarray:
        """Positions per torque of a sine between samples, of the arm alone, shape (m, n, n)."""
        s, loop = 1j * np.asarray(omega)[:, None, None], self.loop
        return np.linalg.inv(loop.inertia * s**2 + loop.damping * s + loop.stiffness)

    def between(self, omega: np.ndarray, X: np.ndarray) -> np.ndarray:
        """Torque of the hold at omega, of the unknowns at the samples, shape (m, n).

        A hold makes of samples at exp(s Ts) the sine (1 - exp(-s Ts))/(s Ts), as late as it is;
        sidebands beyond the Nyquist frequency are left out.
        """
        s, Ts = 1j * np.asarray(omega)[:, None], self.loop.Ts
        hold = (1.0 - np.exp(-s * Ts)) / (s * Ts)
        late = np.exp(-s * self.loop.delay), np.exp(-s * self.received.delay)
        own, other = X[:, self.columns["own"]], X[:, self.columns["other"]]
        return hold * (late[0] * own + late[1] * other)

    @cached_property
    def message(self) -> tuple[np.ndarray, np.ndarray]:
        """What is sent per X, shape (m, size), and per what arrives, shape (m, m)."""
        n, m = self.n, self.messages
        out = np.zeros((m, self.size))
        for source, part in _split(self.control, "message").items():
            out[:, self.columns[source]] = part
        return out, self.control.message[:, 3 * n : 3 * n + m]

    def responses(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, measured rates and message per (e, r), each of shape (m, ..., n + m)."""
        n, m, control = self.n, self.messages, self.control
        z = np.asarray(z)[:, None, None]
        own, other = self._motion(z)
        torque, state, sent = (
            np.split(x, [3 * n, 3 * n + m], axis=1)
            for x in (control.torque, control.state, control.message)
        )
        law = torque[0] - np.hstack([self.loop.position, self.loop.rate, np.zeros((n, n))])
        arrived, rows = other @ torque[1], np.vstack([law, state[0]])
        left = np.zeros((len(z), n + control.states, n + control.states), complex)
        left[:, :n, :n], left[:, :n, n:] = np.eye(n), -torque[2]
        left[:, n:, n:] = z * np.eye(control.states) - state[2]
        left[:, :, :n] -= rows @ own
        right = np.zeros((len(z), n + control.states, n + m), complex)
        right[:, :n, :n], right[:, n:, n:] = np.eye(n), state[1]
        right[:, :, n:] += rows @ arrived
        found = np.linalg.solve(left, right)
        moved = own @ found[:, :n]
        moved[:, :, n:] += arrived
        message = sent[0] @ moved + sent[2] @ found[:, n:]
        message[:, :, n:] += sent[1]
        return moved[:, :n], moved[:, n : 2 * n], message

    def _motion(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(q, v, F) per torque of the host's own and from what arrives, shape (m, 3n, n) each."""
        n, loop, load = self.n, self.loop, self.load
        streams = loop, self.received
        pushed = np.concatenate(
            [np.broadcast_to(_given(x, z), (len(z), 2 * n, n)) for x in streams], axis=2
        )
        moved = np.linalg.solve(z * np.eye(2 * n) - loop.hold[0], pushed)
        q, w = moved[:, :n], moved[:, n:]
        v = w
        if loop.velocity != "exact":
            keep, gain = loop.rate_filter
            v = gain * (1.0 - 1.0 / z) / (1.0 - keep / z) * q
        F = (load.stiffness - self._on_load @ loop.stiffness) @ q
        F = F + (load.damping - self._on_load @ loop.damping) @ w
        F += np.concatenate([_before(x, z) * self._on_load for x in streams], axis=2)
        signals = np.concatenate([q, v, F], axis=1)
        return signals[:, :, :n], signals[:, :, n:]


def _split(control: Control, name: str) -> dict[str, np.ndarray]:
    """The parts of a row of a control for q, v, F and its states."""
    matrix, n = getattr(control, name), len(control.torque)
    out = {x: matrix[:, i * n : (i + 1) * n] for i, x in enumerate(("q", "v", "F"))}
    return {**out, "x": matrix[:, matrix.shape[1] - control.states :]}


def _given(loop: JointLoop, z: np.ndarray) -> np.ndarray:
    """Change of (q, w) over a sample per torque of the sample, as late as the loop is."""
    _, now, before = loop.hold
    whole, share = loop.late
    return (now + before / z if share > 0.0 else now) * z**-whole


def _before(loop: JointLoop, z: np.ndarray) -> np.ndarray:
    """The torque that acts just before a sample, per torque of the sample."""
    return z ** -(loop.late[0] + 1)
