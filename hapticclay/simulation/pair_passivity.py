"""Passivity in the time domain: an observer and a controller of energy at each end of a pair.

An end may let out what came in at the other one, as the newest packet tells, and a reserve E0:

    out_i <= in_j + E0, so that all that both ends have taken stays >= -2 E0

A torque that would let out more in the next sample is reduced, and a damper takes back what came
out before it was seen. Observer and controller: Ryu, Kwon and Hannaford, Stable Teleoperation with
Time-Domain Passivity Control, IEEE Trans. Robotics and Automation 20(2), 2004; energy that came in
sent over a late link: Ryu, Artigas and Preusche, Mechatronics 20(7), 2010.
"""

from __future__ import annotations

import math

import numpy as np

MOST = 0.5  # share of the speed that a damper takes within a sample


class Port:
    """Energy at one end, from sample to sample.

    Attributes:
        taken: that link and controllers have taken from the arm [J].
        into: sum of what came in, sample by sample [J].
        out: sum of what came out [J].
        sent: what came in at the other end, by the newest packet [J].
    """

    def __init__(self, inertia: np.ndarray, Ts: float, reserve: float):
        self.inertia, self.Ts, self.reserve = inertia, Ts, reserve
        self.taken = self.into = self.out = self.sent = self._seen = 0.0

    def observe(self) -> None:
        """Counts what came in or out over the last sample."""
        come = self.taken - self._seen
        self._seen = self.taken
        self.into += max(come, 0.0)
        self.out += max(-come, 0.0)

    def guarded(self, torque: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The torque that the energy allows for a sample, at rates v."""
        room = self.sent + self.reserve - self.out
        torque = self._share(torque, v, max(room, 0.0)) * torque
        moving = self.Ts * float(v @ self.inertia @ v)
        if room >= 0.0 or moving == 0.0:
            return torque
        return torque - min(-room / moving, MOST / self.Ts) * (self.inertia @ v)

    def _share(self, torque: np.ndarray, v: np.ndarray, room: float) -> float:
        """Largest share of a torque, at most 1, whose work over a sample stays within a room.

        A share s does the work s Ts t v + s^2 Ts^2 t W t/2, W the mobility.
        """
        power = self.Ts * float(torque @ v)
        speeds = 0.5 * self.Ts**2 * float(torque @ np.linalg.solve(self.inertia, torque))
        if power + speeds <= room:
            return 1.0
        root = math.sqrt(power * power + 4.0 * speeds * room)
        if power > 0.0:
            return 2.0 * room / (root + power)
        return (root - power) / (2.0 * speeds)
