"""
3. Your controller on your arm
==============================

You define an arm, run the paper's loop on it, then replace its controller with your own function,
on hardware with encoders and latency.
"""

# %%
# An arm
# ------
# Lengths and inertias define an arm; link 2 is balanced about the elbow. The MuJoCo model is
# generated from them. With ``inertia_shaping`` the servo hides the arm's inertia, so that
# the loop is the same on every arm.

import math

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

arm = hc.Arm(l1=0.3, l2=0.3, I1=0.08, I2=0.5)  # m, kg.m^2
cut = hc.with_fields(hc.constant_cut(b=40.0, inertia_shaping=True), {"arm": arm})
print(hc.simulate(cut).status)

# %%
# A law
# -----
# A controller is a function of measured values, called once per sample: time, joint angles ``q``
# and rates ``qd``, the force ``fh`` of the hand, a state that you keep, and parameters. It
# returns the torques of shoulder and elbow, and the next state. This one is an admittance
# controller. The hand's force moves a virtual mass with a damper; the joints follow it with PD
# control. With ``render="physical"`` the clay acts at all times. With ``render="held"`` the law
# would have to render it.


def admittance(t, q, qd, fh, state, params):
    """Torques [N.m]; the state is place and velocity of the virtual mass [m, m/s]."""
    x, y, vx, vy = state
    mass, damper, stiffness, rate, Ts, l1, l2 = params
    vx += Ts * (fh[0] - damper * vx) / mass
    vy += Ts * (fh[1] - damper * vy) / mass
    x += Ts * vx
    y += Ts * vy
    # joint angles of the virtual mass: the elbow bends as that of the paper's arm, q2 < 0
    r2 = x * x + y * y
    elbow = -math.acos((r2 - l1 * l1 - l2 * l2) / (2.0 * l1 * l2))
    shoulder = math.atan2(y, x) - math.atan2(l2 * math.sin(elbow), l1 + l2 * math.cos(elbow))
    tau1 = stiffness * (shoulder - q[0]) - rate * qd[0]
    tau2 = stiffness * (elbow - q[1]) - rate * qd[1]
    return (tau1, tau2), (x, y, vx, vy)


# %%
# The virtual mass starts where the handle is: ``Scenario.origin`` is the place of p = 0 in the
# world.

Ts, M, D = 0.72e-3, 2.0, 15.0  # s, kg, N.s/m
x0, y0 = hc.Scenario().origin
controller = hc.Controller(
    admittance,
    state=(x0, y0, 0.0, 0.0),
    params=(M, D, 400.0, 20.0, Ts, arm.l1, arm.l2),
)
scenario = hc.Scenario(
    arm=arm,
    clay=hc.slab(40.0, 0.05, 0.15),
    control="sampled",
    dt=Ts,
    render="physical",
    controller=controller,
    force=(1.0, 0.0),
    length=None,
    t_max=3.0,
)
record = hc.simulate(scenario)
print(record.status)

# %%
# Outside the clay the handle follows the virtual mass: v = f/D (1 - exp(-D t/M)). In the clay the
# stiff position loop keeps the handle moving, and the motors carry the force of the clay.
# A law that does not use the force of the clay cannot transmit it to the hand.

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.0))
above.plot(record.t, 100 * record.v[:, 0], label="handle")
expected = 100 / D * (1.0 - np.exp(-D * record.t / M))
above.plot(record.t, expected, "--", color="0.3", lw=1, label="virtual mass")
above.set(ylabel="velocity x [cm/s]")
above.legend()
below.plot(record.t, record.fh[:, 0], label="hand")
below.plot(record.t, record.fe[:, 0], label="clay")
below.set(xlabel="time [s]", ylabel="force x [N]")
below.legend()
plt.show()

# %%
# On hardware
# -----------
# :obj:`~hapticclay.Hardware` puts encoders, converters, a delay and friction around the same
# law. Angles come in counts, rates from their differences.

hardware = hc.Hardware(
    encoder=65_536,
    velocity="difference",
    velocity_window=4,
    delay=Ts,
    dac_bits=12,
    friction=(0.05, 0.02),
)
rough = hc.simulate(hc.with_fields(scenario, {"hardware": hardware}))
print(rough.status)

fig, ax = plt.subplots()
ax.plot(rough.t, rough.tau[:, 0], lw=0.8, label="with hardware")
ax.plot(record.t, record.tau[:, 0], label="ideal")
ax.set(xlabel="time [s]", ylabel="torque of the shoulder [N·m]")
ax.legend()
plt.show()

# %%
# Step by step
# ------------
# For a controller in another process, or a learned one, step the run yourself: ``hc.Simulation``
# takes the torque of each sample. For the same torques the results are bit-identical to those of
# ``simulate``.

stepped = hc.with_fields(scenario, {"controller": None, "t_max": 0.2})
with hc.Simulation(stepped) as sim:
    state = controller.state
    while sim.outcome is None:
        now = sim.state
        torque, state = admittance(now.t, now.q, now.qd, now.fh, state, controller.params)
        sim.step(torque=torque)
    short = sim.record()
n = len(short.t) - 1
print(f"largest difference of position: {np.abs(short.p[:n] - record.p[:n]).max():.1e} m")

# %%
# Next: :doc:`t4_sweep`. More: :doc:`/parts`, :doc:`/gallery/hardware/index`.
