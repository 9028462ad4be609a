"""The sampled loop of a leader and a follower: a map from sample to sample, and equations in z.

Between samples both arms are linear about their poses; torques are held. A message of one end
reaches the other whole samples and a share of one later: whole samples are a queue of the map, and
z^-N on the circle; the share delays the torque that comes from it. Friction of the joints, torque
limits and elastic links are left out, as in `joint_loop`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import matrices
from ..errors import ParameterError
from .joint_loop import MOST_STATES, is_stable
from .pair_end import End
from .rest import FREE, Rest, Resting, balanced

BESIDE, SINGULAR = 1e-4, 1e-5  # of an eigenvalue: a distance, and the size of equations there


@dataclass(frozen=True, eq=False)
class PairLoop(Resting):
    """Two ends and whole samples between them.

    Attributes:
        leader: the leader's end.
        follower: the follower's end.
        there: samples from leader to follower.
        back: samples from follower to leader.
    """

    leader: End
    follower: End
    there: float = 0
    back: float = 0

    @property
    def ends(self) -> tuple[End, End]:
        """Leader and follower."""
        return self.leader, self.follower

    @property
    def n(self) -> int:
        """Number of joints of both arms."""
        return self.leader.n + self.follower.n

    @property
    def Ts(self) -> float:
        """Control sample [s]."""
        return self.leader.loop.Ts

    @property
    def samples_late(self) -> int:
        """Whole samples around the loop."""
        return int(self.there + self.back) + self.leader.received.late[0]

    @property
    def states(self) -> int:
        """Order of the map."""
        on_the_way = int(self.there + self.back) * self.leader.messages
        return sum(end.states for end in self.ends) + on_the_way

    # ---- the map

    def map(self) -> np.ndarray:
        """State matrix x(k+1) = A x(k): both ends, then messages on their way.

        Raises:
            ParameterError: the delay makes it larger than 1,200 states.
        """
        if self.states > MOST_STATES:
            bound = f"must be shorter at this rate: {self.states} states"
            raise ParameterError("delay", self.there * self.Ts, bound)
        unit, m = np.eye(self.states), self.leader.messages
        sides, at = [], 0
        for end in self.ends:
            sides.append(_Side(end, unit[at : at + end.states]))
            at += end.states
        going, coming = int(self.there), int(self.back)
        there = unit[at : at + going * m].reshape(going, m, self.states)
        back = unit[at + going * m :].reshape(coming, m, self.states)
        arrived = self._arrived(sides, there, back)
        sent = [side.message(r) for side, r in zip(sides, arrived, strict=True)]
        rows = [side.next(r) for side, r in zip(sides, arrived, strict=True)]
        for message, queue in zip(sent, (there, back), strict=True):
            rows += [message, *queue[:-1]] if len(queue) else []
        return np.vstack(rows)

    def _arrived(self, sides: list[_Side], there: np.ndarray, back: np.ndarray):
        """What arrives at leader and follower, of this sample where nothing is between."""
        none = np.zeros((self.leader.messages, self.states))
        if not self.there and not self.back and self.leader.control.echoes:
            raise ValueError("an algebraic loop: both ends echo at the same sample")
        leader = back[-1] if len(back) else None
        follower = there[-1] if len(there) else None
        if leader is None:
            leader = sides[1].message(none if follower is None else follower)
        if follower is None:
            follower = sides[0].message(leader)
        return leader, follower

    def open_poles(self) -> np.ndarray:
        """Eigenvalues of both ends if nothing arrived."""
        found = []
        for end in self.ends:
            side = _Side(end, np.eye(end.states))
            found.append(matrices.eigenvalues(side.next(np.zeros((end.messages, end.states)))))
        return np.concatenate(found)

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """Eigenvalues of the map, largest first, without those of rest anywhere (z = 1)."""
        z = matrices.eigenvalues(self.map())
        nearest = np.argsort(np.abs(z - 1.0), kind="stable")
        z = np.delete(z, nearest[: self.structural + self.free])
        return z[np.argsort(-np.abs(z), kind="stable")]

    def radius(self) -> float:
        """Largest size of an eigenvalue: below 1 the loop is stable."""
        return float(np.abs(self.eigenvalues).max(initial=0.0))

    def stable(self) -> bool:
        """Whether all motion but rest decays."""
        return bool(is_stable(self.radius()))

    # ---- rest, and steady motion

    @cached_property
    def structural(self) -> int:
        """Directions in which the pair rests anywhere: eigenvalues at 1 that are no verdict."""
        size = matrices.singular_values(balanced(self._at_rest)[0])
        return int(np.sum(size <= FREE * size[0]))

    @cached_property
    def _at_rest(self) -> np.ndarray:
        """Forces at rest per positions, states and messages of both ends."""
        sizes = [end.n + end.control.states + end.messages for end in self.ends]
        out = np.zeros((sum(sizes), sum(sizes)))
        at = [slice(0, sizes[0]), slice(sizes[0], sum(sizes))]
        for i, end in enumerate(self.ends):
            own, message = _resting(end)
            out[at[i], at[i]] = own
            out[at[1 - i], at[i]] -= np.vstack(
                [np.zeros((sizes[1 - i] - end.messages, sizes[i])), message]
            )
        return out

    def equations(self, z: complex, ahead: bool = False) -> np.ndarray:
        """T(z) of both ends and of what arrives at leader and follower.

        Args:
            z: a number.
            ahead: whether what arrives is counted at its sample, times z^N, which stays finite for
                small z, or at that of its sending.
        """
        sizes, m = [end.size for end in self.ends], self.leader.messages
        out = np.zeros((sum(sizes) + 2 * m,) * 2, complex)
        starts = (0, sizes[0])
        samples = self.back, self.there
        late = [1.0 if ahead else z**-n for n in samples]
        arrived = [z**n if ahead else 1.0 for n in samples]
        for i, end in enumerate(self.ends):
            own = slice(starts[i], starts[i] + sizes[i])
            mine = slice(sum(sizes) + i * m, sum(sizes) + (i + 1) * m)
            other = slice(sum(sizes) + (1 - i) * m, sum(sizes) + (2 - i) * m)
            out[own, own] = end.equations(np.array([z]))[0]
            out[own, mine] = -end.inputs[:, end.n :]
            sent, echo = end.message
            out[mine, mine] += arrived[i] * np.eye(m)
            out[other, own] -= late[1 - i] * sent
            out[other, mine] -= late[1 - i] * echo
        return out

    @cached_property
    def _rest(self) -> Rest:
        return Rest(self.equations, self.structural)

    @cached_property
    def _inputs(self) -> np.ndarray:
        size = sum(end.size for end in self.ends) + 2 * self.leader.messages
        out, n = np.zeros((size, self.n)), self.leader.n
        for i, end in enumerate(self.ends):
            at = i * self.leader.size
            out[at : at + end.size, i * n : i * n + end.n] = end.inputs[:, : end.n]
        return out

    def shape(self, z: complex) -> tuple[np.ndarray, np.ndarray]:
        """Motion of leader and follower at an eigenvalue, shape (n,) each."""
        whole, _, columns = balanced(self.equations(z, abs(z) < 1.0))
        X = columns * matrices.svd(whole)[2][-1].conj()
        start = self.leader.size
        return X[: self.leader.n], X[start : start + self.follower.n]

    def singular(self, z: complex) -> bool:
        """Whether z is an eigenvalue, rather than a little beside one."""
        beside = [balanced(self.equations(x, abs(z) < 1.0))[0] for x in (z, z * (1.0 + BESIDE))]
        sizes = matrices.singular_values(np.array(beside))[:, -1]
        return bool(sizes[0] < SINGULAR * sizes[1])

    def drift(self) -> np.ndarray:
        """Measured rates per constant torque in steady motion [rad/(N.m.s)], shape (n, n).

        Between samples the rate is another one where drives pull on: by the ripple of the held
        torque.
        """
        if not self.structural:
            return np.zeros((self.n, self.n))
        return self._rates(self._rest.drift(self._inputs)[1])

    def unresisted(self) -> np.ndarray:
        """Measured rates of steady motions that nothing resists, shape (n, free)."""
        return self._rates(self._rest.unresisted()) if self.free else np.zeros((self.n, 0))

    def _rates(self, X: np.ndarray) -> np.ndarray:
        """Measured rates of leader and follower in unknowns of the equations."""
        v = self.leader.columns["v"], self.follower.columns["v"]
        return np.vstack([X[v[0]], X[self.leader.size :][v[1]]])

    # ---- on the unit circle

    def responses(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and measured rates per torque added to the hosts', both (m, n, n).

        At z = exp(i theta), theta of shape (m,), > 0 and <= pi.
        """
        z = np.exp(1j * np.asarray(theta))
        (ql, vl, sl), (qf, vf, sf) = (end.responses(z) for end in self.ends)
        n, m = self.leader.n, self.leader.messages
        there, back = (z[:, None, None] ** -k for k in (self.there, self.back))
        none = np.zeros((len(z), m, m))
        own = np.block([[none, back * sf[:, :, n:]], [there * sl[:, :, n:], none]])
        none = np.zeros((len(z), m, n))
        pushed = np.block([[none, back * sf[:, :, :n]], [there * sl[:, :, :n], none]])
        arrived = np.linalg.solve(np.eye(2 * m) - own, pushed)
        return _joined(ql, qf, arrived, n), _joined(vl, vf, arrived, n)

    def admittance(self, omega: np.ndarray, along: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Rates of both handles per sine on either, at omega [rad/s] of shape (m,), (m, 2, 2).

        along: joint torques of a unit force on the leader's and on the follower's handle.
        """
        z = np.exp(1j * omega * self.Ts)
        T = np.array([self.equations(each) for each in z])
        starts, pushed = (0, self.leader.size), np.zeros((len(z), T.shape[1], 2), complex)
        for i, end in enumerate(self.ends):
            pushed[:, starts[i] : starts[i] + end.size, i] = end.pushed(omega, along[i])
        X = np.linalg.solve(T, pushed)
        out = np.zeros((len(z), 2, 2), complex)
        for i, end in enumerate(self.ends):
            for j in range(2):
                own = X[:, starts[i] : starts[i] + end.size, j]
                torque = end.between(omega, own) + (along[i] if i == j else 0.0)
                moved = (end.alone(omega) @ torque[:, :, None])[:, :, 0]
                out[:, i, j] = 1j * omega * (moved @ along[i])
        return out

    def around(self, theta: np.ndarray) -> np.ndarray:
        """What comes back per message, without the whole samples: H_l H_f, shape (m, k, k)."""
        z = np.exp(1j * np.asarray(theta))
        of_leader, of_follower = (end.responses(z)[2][:, :, end.n :] for end in self.ends)
        return of_leader @ of_follower

    def at_rest(self) -> np.ndarray:
        """Positions per constant torque: none is needed of a pair."""
        return np.zeros((self.n, self.n))

    def between(self, there: float, back: float) -> PairLoop:
        """The same ends with other whole samples between them."""
        return replace(self, there=there, back=back)


class _Side:
    """Rows of an end's signals over the states of the map."""

    def __init__(self, end: End, unit: np.ndarray):
        self.end, n = end, end.n
        self.x = unit[len(unit) - end.control.states :]
        groups = unit[: len(unit) - end.control.states].reshape(-1, n, unit.shape[1])
        own, queued = 2 + end.measured, end.queues[0]
        self.q, self.w, self.memory = groups[0], groups[1], groups[2:own]
        self.own, self.other = groups[own : own + queued], groups[own + queued :]
        self.v = self._rate()
        self.y = np.vstack([self.q, self.v, self._felt()])

    def _rate(self) -> np.ndarray:
        if not len(self.memory):
            return self.w
        keep, gain = self.end.loop.rate_filter
        return gain * (self.q - self.memory[0]) + (keep * self.memory[1] if keep else 0.0)

    def _felt(self) -> np.ndarray:
        """The torque on the load, by the acceleration just before the sample."""
        end, loop, load = self.end, self.end.loop, self.end.load
        if not end.control.feels:
            return 0.0 * self.q
        acting = self.own[loop.late[0]] + self.other[end.received.late[0]]
        pushed = acting - loop.damping @ self.w - loop.stiffness @ self.q
        moved = load.inertia @ np.linalg.solve(loop.inertia, pushed)
        return moved + load.damping @ self.w + load.stiffness @ self.q

    def _sum(self, matrix: np.ndarray, arrived: np.ndarray) -> np.ndarray:
        return matrix @ np.vstack([self.y, arrived, self.x])

    def message(self, arrived: np.ndarray) -> np.ndarray:
        """What is sent."""
        return self._sum(self.end.control.message, arrived)

    def next(self, arrived: np.ndarray) -> np.ndarray:
        """The states a sample later."""
        end, loop = self.end, self.end.loop
        step = loop.hold[0] @ np.vstack([self.q, self.w])
        of_own = self._sum(end.control.torque, 0.0 * arrived)
        torque = of_own - loop.position @ self.q - loop.rate @ self.v
        other = self._sum(end.control.torque, arrived) - of_own
        rows = []
        streams = (loop, torque, self.own), (end.received, other, self.other)
        for held, fresh, queue in streams:
            every, (whole, share), (_, now, before) = [fresh, *queue], held.late, held.hold
            step = step + now @ every[whole]
            if share > 0.0:
                step = step + before @ every[whole + 1]
            rows += every[: len(queue)]
        memory = [self.q, self.v][: len(self.memory)]
        return np.vstack([step, *memory, *rows, self._sum(end.control.state, arrived)])


def _resting(end: End) -> tuple[np.ndarray, np.ndarray]:
    """Equations of an end at rest in (q, x, r), shape (n + k + m, ...), and its message of them."""
    n, k, m = end.n, end.control.states, end.messages

    def of(matrix: np.ndarray) -> np.ndarray:
        q, _, F, r, x = np.split(matrix, [n, 2 * n, 3 * n, 3 * n + m], axis=1)
        return np.hstack([q + F @ end.load.stiffness, x, r])

    loop, out = end.loop, np.zeros((n + k + m,) * 2)
    out[:n] = -of(end.control.torque)
    out[:n, :n] += loop.stiffness + loop.position
    out[n : n + k] = -of(end.control.state)
    out[n : n + k, n : n + k] += np.eye(k)
    out[n + k :, n + k :] = np.eye(m)
    return out, of(end.control.message)


def _joined(leader: np.ndarray, follower: np.ndarray, arrived: np.ndarray, n: int) -> np.ndarray:
    """Signals of both arms per torque on both, from those per own torque and what arrives."""
    m = arrived.shape[1] // 2
    upper = leader[:, :, n:] @ arrived[:, :m]
    lower = follower[:, :, n:] @ arrived[:, m:]
    upper[:, :, :n] += leader[:, :, :n]
    lower[:, :, n:] += follower[:, :, :n]
    return np.concatenate([upper, lower], axis=1)
