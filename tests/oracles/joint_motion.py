"""Motion of an arm of the package under held torques: all joints, constraints solved as KKT rows.

The engine gives inertia, bias and Jacobians of all coordinates; SciPy integrates them.
"""

from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
from scipy.integrate import solve_ivp

CARDS = Path(__file__).parents[2] / "mjcf" / "arms"
TURN = 1e-6  # of the constraints' rows, by central differences: 1e-12 and rounding of 1e-10


class Positions(NamedTuple):
    """Of the joints at the samples."""

    q: np.ndarray


def positions(card, of_motion, of_run, _text):
    """As `Motion(card, *of_motion).run(*of_run)`; of a text that `store` tells apart."""
    return Positions(Motion(card, *of_motion).run(*of_run))


def text_of(card):
    """The model of an arm of the package."""
    return (CARDS / f"{card}.xml").read_text()


class Motion:
    """An arm with a hand (m, b, k) at its handle, held torques on joints of its own."""

    def __init__(self, card, joints, axes, pose, hand, force):
        self.model = mujoco.MjModel.from_xml_path(str(CARDS / f"{card}.xml"))
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
        self.data = mujoco.MjData(self.model)
        self.own = [self.model.joint(name).dofadr[0] for name in joints]
        self.rest = [i for i in range(self.model.nv) if i not in self.own]
        self.locked = self.rest if not self.model.neq else []
        self.axes = ["xyz".index(c) for c in axes]
        self.start = np.array([pose[self.model.joint(i).name] for i in range(self.model.njnt)])
        self.hand, self.force = hand, np.zeros(len(axes))
        self.force[: len(force)] = force
        self.put(self.start, 0.0 * self.start)
        self.origin = self.place()

    def put(self, q, w):
        self.data.qpos[:], self.data.qvel[:] = q, w
        mujoco.mj_fwdPosition(self.model, self.data)
        mujoco.mj_fwdVelocity(self.model, self.data)

    def place(self):
        return np.array(self.data.site("handle").xpos)[self.axes]

    def jacobian(self):
        J = np.zeros((3, self.model.nv))
        mujoco.mj_jacSite(self.model, self.data, J, None, self.model.site("handle").id)
        return J[self.axes]

    def rows(self):
        """Rows of what holds: equality constraints, and joints that are locked."""
        d, equal = self.data, int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
        is_equal = d.efc_type[: d.nefc] == equal
        found = np.array(d.efc_J).reshape(-1, self.model.nv)[: d.nefc][is_equal]
        return np.vstack((found, np.eye(self.model.nv)[self.locked]))

    def turning(self, q, w):
        """(d rows/dt) w and (d J/dt) w, by central differences along the motion."""
        sides = []
        for sign in (1.0, -1.0):
            self.put(q + sign * TURN * w, w)
            sides.append(np.concatenate((self.rows() @ w, self.jacobian() @ w)))
        turn = (sides[0] - sides[1]) / (2.0 * TURN)
        self.put(q, w)
        return turn[: -len(self.axes)], turn[-len(self.axes) :]

    def slope(self, q, w, tau):
        """Accelerations under torques of the arm's own joints."""
        turn, along = self.turning(q, w)
        model, data, n = self.model, self.data, self.model.nv
        m, c, k = self.hand
        M, J, G = np.zeros((n, n)), self.jacobian(), self.rows()
        mujoco.mj_fullM(model, data, M)
        F = self.force - c * (J @ w) - k * (self.place() - self.origin) - m * along
        F += m * self.gravity
        push = J.T @ F + data.qfrc_passive - data.qfrc_bias
        push[self.own] += tau
        whole = np.block([[M + m * J.T @ J, G.T], [G, np.zeros((len(G),) * 2)]])
        return np.linalg.lstsq(whole, np.concatenate((push, -turn)), rcond=1e-13)[0][:n]

    @property
    def gravity(self):
        return np.array(self.model.opt.gravity)[self.axes]

    def held(self, q):
        """Torques of the own joints that hold arm and hand against gravity."""
        self.put(q, 0.0 * q)
        G, n = self.rows(), self.model.nv
        load = self.data.qfrc_bias - self.jacobian().T @ (self.hand[0] * self.gravity)
        whole = np.hstack((np.eye(n)[:, self.own], G.T))
        return np.linalg.lstsq(whole, load, rcond=1e-13)[0][: len(self.own)]

    def run(self, law, Ts, samples, delay):
        """Joint positions at the samples, delay in whole samples.

        law: (kp, kd, reference) with rates by difference.
        """
        kp, kd, reference = map(np.array, law)
        n, x = self.model.nv, np.concatenate((self.start, 0.0 * self.start))
        past, queue, out = self.start[self.own], [self.held(self.start)] * delay, []
        for _ in range(samples):
            q = x[:n][self.own]
            out.append(q)
            queue.append(kp * (reference - q) - kd * (q - past) / Ts + self.held(x[:n]))
            past, tau = q, queue.pop(0)

            def f(t, x, tau=tau):
                return np.concatenate((x[n:], self.slope(x[:n], x[n:], tau)))

            x = solve_ivp(f, (0.0, Ts), x, rtol=1e-12, atol=1e-13, method="DOP853").y[:, -1]
        return np.array(out)
