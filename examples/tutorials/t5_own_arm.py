"""
5. From a file of an arm to the gain it carries
===============================================

An arm of your own has an MJCF or URDF file, gains, a rate and a delay. You load it, complete what
the file lacks, compute which gains it carries, and run it on both sides of the limit.
"""

# %%
# The file has bodies, joints and a site at the handle. Here it is text; ``hc.MjcfArm("arm.xml")``
# takes a file.

import dataclasses

import matplotlib.pyplot as plt
import mujoco
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

XML = """
<mujoco model="two_links">
  <compiler angle="radian"/>
  <worldbody>
    <body name="upper" pos="0 0 0.3">
      <joint name="shoulder" axis="0 1 0" range="-2 2" damping="0.02"/>
      <inertial pos="0.1 0 0" mass="0.6" diaginertia="1e-3 2e-3 2e-3"/>
      <body name="fore" pos="0.2 0 0">
        <joint name="elbow" axis="0 1 0" range="0 2.6" damping="0.02"/>
        <inertial pos="0.08 0 0" mass="0.4" diaginertia="5e-4 1e-3 1e-3"/>
        <site name="handle" pos="0.2 0 0"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

spec = mujoco.MjSpec.from_string(XML)
arm = hc.MjcfArm(spec, pose={"shoulder": -0.6, "elbow": 1.2})
for note in arm.notes:
    print(note)

# %%
# The notes say what the file leaves open: rotors. Behind a gear they may carry more inertia than
# the links, so no verdict is worth much without them. Their inertia is that of the rotor times the
# gear ratio squared:

rotor, gear = 2e-6, (50.0, 30.0)  # kg.m^2
arm = dataclasses.replace(arm, armature=tuple(rotor * n**2 for n in gear))
print(np.round(np.diag(arm.mass_matrix()), 4), "kg.m^2")

# %%
# Which gains does it carry?
# --------------------------
# The controller runs at 500 Hz, takes rates by difference, and its torques are 2 ms late.
# ``hc.theory.joint_limits`` is exact for small motion about the pose, all joints coupled.

law = hc.JointPD(Kp=(40.0, 20.0), Kd=(0.6, 0.3), velocity="difference")
timing = {"Ts": 2e-3, "delay": 2e-3}
limits = hc.theory.joint_limits(arm, law, **timing)
print(limits.text())

# %%
# The table has the limit of each gain alone. All Kp may rise together by ``limits.scale``, and
# ``limits.delay_left`` is the delay that may still be added. A result says how much it moves with a
# guessed rotor:

fewer, more = (
    hc.theory.joint_limits(
        dataclasses.replace(arm, armature=tuple(x * s for x in arm.armature)), law, **timing
    ).scale
    for s in (0.8, 1.2)
)
print(f"all Kp times {limits.scale:.3f}; with rotors of 80 %: {fewer:.3f}, of 120 %: {more:.3f}")

# %%
# Does a run agree?
# -----------------
# ``hc.studies.joint_runs`` runs the arm as it is and at 0.5 % to either side of the limit. From
# each run it reads which joint swings, and how fast the swings grow.

runs = hc.studies.joint_runs(arm, law, **timing)
print(runs.text())

fig, axes = plt.subplots(len(runs.factor), 1, figsize=(6.4, 5.4))
for ax, factor, joint, t, motion in zip(
    axes, runs.factor, runs.joint, runs.times, runs.motion, strict=True
):
    ax.plot(t, 1e3 * motion, lw=1)
    ax.set_ylabel(f"{joint} [mrad]")
    ax.set_title(f"all Kp times {factor:.3f}", loc="left", fontsize=9)
ax.set_xlabel("time [s]")
plt.show()

# %%
# A run of your own
# -----------------
# A scenario takes the arm and its law in place of the paper's: with a hand at the handle, a delay,
# an encoder. The reference is where the law pulls the joints. Gravity is fed forward unless
# ``gravity="acts"``.

pulled = dataclasses.replace(law, reference=(-0.5, 1.1))
scenario = hc.Scenario(
    name="two links",
    arm=arm,
    controller=pulled,
    Ts=timing["Ts"],
    hardware=hc.Hardware(delay=timing["delay"], encoder=16384),
    operator=hc.Operator(),
    t_max=1.0,
)
record = hc.simulate(scenario)
print(record.status, record.q.shape, record.p.shape)

fig, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.4))
for j, name in enumerate(arm.names):
    left.plot(record.t, record.q[:, j] - pulled.reference[j], label=name)
    right.plot(record.t, record.tau[:, j], label=name)
left.set(xlabel="time [s]", ylabel="joint less its reference [rad]")
right.set(xlabel="time [s]", ylabel="torque [N·m]")
left.legend()
plt.show()

# %%
# ``record.plot()`` draws all joints, ``record.plot.path()`` the handle. With twice the limit the
# run is unstable, and its status names the joint:

buzzing = dataclasses.replace(pulled, Kp=tuple(2.0 * limits.scale * k for k in law.Kp))
print(hc.simulate(dataclasses.replace(scenario, controller=buzzing, operator=None)).status)

# %%
# More: :doc:`/arm`, :doc:`/own_arm`, :doc:`/gallery/symptoms/index`. On the command line:
# ``hapticclay arm arm.xml --gains gains.toml --rate 500 --delay 2ms --run --film buzz.webp``.
