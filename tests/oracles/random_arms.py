"""Random arms of one to seven joints under random laws, and their held loops of another map."""

from dataclasses import dataclass

import mujoco
import numpy as np

import hapticclay as hc
from tests.oracles.joint_verdicts import Held

AXES = ("0 1 0", "0 0 1", "1 0 0", "0.3 0.8 0.5")
LATE = (0.0, 0.0, 0.4, 1.0, 1.0, 2.7, 8.3)  # samples


@dataclass(frozen=True)
class Case:
    """An arm, its law, a control sample and a delay [s]."""

    arm: hc.MjcfArm
    law: hc.JointPD
    Ts: float
    delay: float

    def held(self, **changes) -> Held:
        """The loop with other Kp, Kd, slopes, Ts or delay."""
        now = {"Kp": self.law.Kp, "Kd": self.law.Kd, "slopes": self.law.slopes}
        now |= {"Ts": self.Ts, "delay": self.delay} | changes
        Kp, Kd, slopes = (np.diag(now[name]) for name in ("Kp", "Kd", "slopes"))
        linear = self.arm.linear()
        gravity = linear.gravity_stiffness
        S, D = linear.stiffness + gravity, linear.damping
        P, R = 0.0 * S, -slopes
        if self.law.runs == "host":
            P, R = P + Kp, R + Kd
        else:
            S, D = S + Kp, D + Kd
        if self.arm.gravity == "compensated":
            P = P - gravity
        timing = now["Ts"], now["delay"]
        return Held(linear.inertia, D, S, P, R, *timing, self.law.velocity, self.law.cutoff)

    def limits(self) -> hc.theory.JointLimits:
        return hc.theory.joint_limits(self.arm, self.law, self.Ts, self.delay)


def drawn(seed: int, most: int = 7) -> Case:
    """A case with all that may stand in it, of up to so many joints."""
    rng = np.random.default_rng(seed)
    n = int(min(most, rng.choice([1, 1, 1, 2, 2, 3, 4, 5, 6, 7])))
    arm = _arm(rng, n)
    mass = np.diag(arm.mass_matrix())
    Ts = 10.0 ** rng.uniform(-3.3, -1.8)
    delay = Ts * float(rng.choice(LATE))
    speed = 10.0 ** rng.uniform(-2.0, 0.2) / (Ts + delay)
    Kp = mass * speed**2 * 10.0 ** rng.uniform(-0.5, 0.5, n)
    Kd = 2.0 * mass * speed * 10.0 ** rng.uniform(-1.3, 0.3, n)
    bare = rng.choice([0.0, 0.5, 1.0], p=[0.55, 0.2, 0.25])  # share of joints without stiffness
    Kp[rng.random(n) < bare] = 0.0
    Kd[rng.random(n) < rng.choice([0.0, 0.5, 1.0], p=[0.75, 0.15, 0.1])] = 0.0
    velocity = str(rng.choice(["exact", "difference", "filter"]))
    fed = (Kd + np.array(arm.damping)) * rng.uniform(0.0, 1.0, n) * (rng.random() < 0.3)
    law = hc.JointPD(
        tuple(Kp.tolist()),
        tuple(Kd.tolist()),
        velocity=velocity,
        cutoff=10.0 ** rng.uniform(1.0, 3.0) if velocity == "filter" else None,
        runs=str(rng.choice(["host", "host", "drive"])),
        friction=[(0.0, 1.0, x) for x in fed.tolist()] if fed.any() else None,
    )
    return Case(arm, law, Ts, delay)


def _arm(rng: np.random.Generator, n: int) -> hc.MjcfArm:
    """A chain of links up, down or aside; a part of them with dampers, springs and rotors."""
    text, place = "", "0 0 0"
    sprung, damped = rng.random() < 0.3, rng.random() < 0.8
    for j in range(n):
        length, mass = 10.0 ** rng.uniform(-1.3, -0.4), 10.0 ** rng.uniform(-1.5, 0.7)
        own = mass * length**2 * rng.uniform(0.02, 0.1)
        damping = 10.0 ** rng.uniform(-3.0, 0.0) * (damped and rng.random() < 0.9)
        spring = 10.0 ** rng.uniform(-1.0, 2.0) * (sprung and rng.random() < 0.5)
        rotor = 10.0 ** rng.uniform(-3.5, -0.7) * (rng.random() < 0.8)
        end = [float(rng.choice([1.0, -1.0])) * length, 0.0, 0.0]
        end = end if rng.random() < 0.5 else end[::-1]
        middle, next_place = (" ".join(str(s * x) for x in end) for s in (0.5, 1.0))
        text += (
            f'<body pos="{place}"><joint name="j{j}" axis="{rng.choice(AXES)}" '
            f'damping="{damping}" stiffness="{spring}" armature="{rotor}"/>'
            f'<inertial pos="{middle}" mass="{mass}" diaginertia="{own} {own} {own}"/>'
        )
        place = next_place
    weight = "" if rng.random() < 0.75 else '<option gravity="0 0 0"/>'
    text = f"<mujoco>{weight}<worldbody>{text}{'</body>' * n}</worldbody></mujoco>"
    gravity = str(rng.choice(["acts", "compensated"]))
    return hc.MjcfArm(mujoco.MjSpec.from_string(text), gravity=gravity)
