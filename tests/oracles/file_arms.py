"""Random arms in MJCF, with all that is passive in files, and their motion by plain MuJoCo."""

import mujoco
import numpy as np

FINE = 20  # Runge-Kutta steps of the engine a sample: their error is below 1e-9 of the motion


def random_arm(random):
    """Text of an arm of one to three joints with passive forces of a few kinds."""
    n, maybe = int(random.integers(1, 4)), lambda share: random.uniform() < share
    kinds = ["slide" if maybe(0.25) else "hinge" for _ in range(n)]
    bodies, tail = "", ""
    for i, kind in enumerate(kinds):
        axis = random.normal(size=3)
        bodies += (
            f'<body pos="{random.uniform(0.1, 0.4)} 0 0" gravcomp="{_share(random)}">'
            f'<joint name="j{i}" type="{kind}" axis="{_row(axis)}" {_joint(random, kind)}/>'
            f'<inertial pos="{_row(random.uniform(-0.15, 0.15, 3))}" '
            f'mass="{random.uniform(0.3, 2.0)}" diaginertia="0.02 0.025 0.03"/>'
            f"{_geom(random)}"
        )
        tail += "</body>"
    bodies += '<site name="h" pos="0.2 0 0.1"/>' + tail
    actuators = "".join(
        f'<motor joint="j{i}" gear="{random.uniform(-4, 4)}" armature="{random.uniform(0, 0.01)}" '
        f'damping="{_row(random.uniform(0, 0.02, 3))}"/>'
        for i in range(n)
        if maybe(0.4)
    )
    return (
        f"<mujoco>{_option(random)}<worldbody>{bodies}</worldbody>{_tendon(random, n)}"
        f"<actuator>{actuators}</actuator></mujoco>"
    )


def _row(numbers):
    return " ".join(f"{x:.6g}" for x in numbers)


def _share(random):
    return random.choice([0, 0, 0, 1, 0.5])


def _joint(random, kind):
    out = f'armature="{random.uniform(0, 0.05)}"'
    if random.uniform() < 0.6:
        a, b, c = random.uniform(0, 2), random.uniform(-0.5, 2), random.uniform(0, 2)
        b = max(b, -1.9 * np.sqrt(a * c))
        out += f' damping="{a} {b} {c}"' if random.uniform() < 0.6 else f' damping="{a}"'
    if random.uniform() < 0.5:
        rest = random.normal(0, 0.2 if kind == "slide" else 10.0)  # [m], [deg]
        out += f' stiffness="{_row(random.uniform(0, 10, 3))}" springref="{rest}"'
    return out


def _geom(random):
    kind = ' fluidshape="ellipsoid"' if random.uniform() < 0.4 else ""
    size = _row(random.uniform(0.02, 0.1, 3))
    return f'<geom type="ellipsoid" size="{size}" mass="0"{kind}/>'


def _option(random):
    method = random.choice(["Euler", "RK4", "implicit", "implicitfast", "discrete"])
    fluid = ""
    if random.uniform() < 0.4:
        wind = random.normal(0, 1, 3) if random.uniform() < 0.5 else np.zeros(3)
        fluid = f'density="{random.uniform(0, 500)}" viscosity="{random.uniform(0, 5)}"'
        fluid += f' wind="{_row(wind)}"'
    flags = "".join(
        f' {name}="disable"' for name in ("spring", "damper", "gravity") if random.uniform() < 0.1
    )
    return f'<option integrator="{method}" {fluid}><flag{flags}/></option>'


def _tendon(random, n):
    if random.uniform() < 0.6:
        return ""
    joints = "".join(f'<joint joint="j{i}" coef="{random.uniform(-2, 2)}"/>' for i in range(n))
    return (
        f'<tendon><fixed name="t" springlength="{random.normal(0, 0.3)}" armature="0.01" '
        f'stiffness="{_row(random.uniform(0, 10, 3))}" damping="{_row(random.uniform(0, 1, 3))}">'
        f"{joints}</fixed></tendon>"
    )


def plain_motion(text, start, Kp, Kd, Ts, samples):
    """Joint positions at the end under torques held from sample to sample, by RK4 of the engine.

    The law is -Kp q - Kd q' and the torque that holds the weight.
    """
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, Ts / FINE
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data, still = mujoco.MjData(model), mujoco.MjData(model)
    data.qpos[:] = start
    for _ in range(samples):
        still.qpos[:] = data.qpos
        mujoco.mj_forward(model, still)
        held = still.qfrc_bias - still.qfrc_gravcomp
        data.qfrc_applied[:] = -Kp * data.qpos - Kd * data.qvel + held
        for _ in range(FINE):
            mujoco.mj_step(model, data)
    return data.qpos.copy()
