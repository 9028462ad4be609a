"""Verdicts on held joint loops, of another map, by what its samples do: rates grow or die out.

The map over a sample runs all unit states at once, piece by piece between switches of the torque.
Its powers say whether the rates of the joints grow: rest anywhere has none, so no eigenvalue near
1 has to be told from another.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

SQUARINGS = 32  # 2^32 samples: growth of 1e-8 a sample is seen
GROWN, GONE = 1e9, 1e-9  # of the rates' size
DIGITS, REST = 50, 1e-15  # of exact eigenvalues, and how near to 1 those of rest are


@dataclass(frozen=True)
class Held:
    """Joints under a held law: M, D, S of all that acts between samples, P and R of the host."""

    M: np.ndarray
    D: np.ndarray
    S: np.ndarray
    P: np.ndarray
    R: np.ndarray
    Ts: float
    delay: float
    velocity: str = "exact"
    cutoff: float | None = None

    def map(self):
        """The map over a sample: positions, rates, last positions, last filtered rates, torques."""
        n, Ts = len(self.M), self.Ts
        late = self.delay / Ts
        late = round(late) if abs(late - round(late)) < 1e-9 else late
        queue = int(np.ceil(late))
        size = (4 + queue) * n
        rows = np.eye(size).reshape(-1, n, size)
        q, w, last, rate, *past = rows
        if self.velocity == "exact":
            v = w
        elif self.velocity == "difference":
            v = (q - last) / Ts
        else:
            v = (rate + self.cutoff * (q - last)) / (1.0 + self.cutoff * Ts)
        torques = [-(self.P @ q + self.R @ v), *past]
        after = (late - (queue - 1)) * Ts if queue else 0.0  # until the newer one of two acts
        pieces = [(queue, after), (queue - 1, Ts - after)] if queue else [(0, Ts)]
        for k, t in pieces:
            if t > 0.0:
                q, w = self._moved(q, w, torques[k], t)
        return np.vstack([q, w, rows[0], v, *torques[:queue]])

    def grows_exactly(self):
        """The same from eigenvalues of 50 digits, where those of rest are 1 to 25."""
        import mpmath

        with mpmath.workdps(DIGITS):
            z = mpmath.eig(self._exact_map(mpmath), left=False, right=False)
            size = max(abs(x) for x in z if abs(x - 1) > REST)
            return bool(size > 1) if abs(size - 1) > REST else None

    def _exact_map(self, mp):
        n, Ts = len(self.M), mp.mpf(self.Ts)
        M, D, S, P, R = (mp.matrix(x.tolist()) for x in (self.M, self.D, self.S, self.P, self.R))
        late = self.delay / self.Ts
        exact = abs(late - round(late)) < 1e-9
        queue = round(late) if exact else int(np.ceil(late))
        after = (Ts if exact else mp.mpf(self.delay) - (queue - 1) * Ts) if queue else mp.mpf(0)
        a = mp.zeros(3 * n)
        inverse = M**-1
        solved = [-inverse * S, -inverse * D, inverse]
        a[:n, n : 2 * n] = mp.eye(n)
        for i, block in enumerate(solved):
            a[n : 2 * n, i * n : (i + 1) * n] = block
        size = (4 + queue) * n
        unit = [mp.zeros(n, size) for _ in range(4 + queue)]
        for i, rows in enumerate(unit):
            rows[:, i * n : (i + 1) * n] = mp.eye(n)
        q, w, last, rate, *past = unit
        v = {"exact": w, "difference": (q - last) / Ts}.get(self.velocity)
        if v is None:
            wc = mp.mpf(self.cutoff)
            v = (rate + wc * (q - last)) / (1 + wc * Ts)
        torques = [-(P * q + R * v), *past]
        q0 = q
        for k, t in [(queue, after), (queue - 1, Ts - after)] if queue else [(0, Ts)]:
            if t > 0:
                e = mp.expm(a * t)[: 2 * n, :]
                x = e[:, :n] * q + e[:, n : 2 * n] * w + e[:, 2 * n :] * torques[k]
                q, w = x[:n, :], x[n:, :]
        rows = [q, w, q0, v, *torques[:queue]]
        out = mp.zeros(size)
        for i, block in enumerate(rows):
            out[i * n : (i + 1) * n, :] = block
        return out

    def _moved(self, q, w, torque, t):
        """After a time under a constant torque: one exponential of (q, w, torque)."""
        n = len(self.M)
        a = np.zeros((3 * n, 3 * n))
        a[:n, n : 2 * n] = np.eye(n)
        a[n : 2 * n] = np.linalg.solve(self.M, np.hstack([-self.S, -self.D, np.eye(n)]))
        x = expm(a * t)[: 2 * n] @ np.vstack([q, w, torque])
        return x[:n], x[n:]

    def grows(self):
        """Whether rates grow without end; None where they neither grow nor die out."""
        a, n = self.map(), len(self.M)
        speed = slice(n, 2 * n)
        unit = np.ones(len(a))
        unit[speed] = self.Ts  # so that rates count as steps
        unit[(3 * n) : (4 * n)] = self.Ts
        a = a * unit[:, None] / unit
        sizes = [np.abs(a[speed]).max()]
        for _ in range(SQUARINGS):
            a = a @ a
            sizes.append(np.abs(a[speed]).max())
            if not np.isfinite(sizes[-1]) or sizes[-1] > GROWN:
                return True
            if sizes[-1] < GONE:
                return False
        return None
