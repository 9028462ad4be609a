"""
An arm that vibrates in teleoperation
=====================================

A leader of seven joints, its gains, 500 Hz and 2 ms of latency: the gains that each joint carries,
all coupled; the delay left; the limits over the workspace; and the stiffest wall at the handle.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

arm = hc.MjcfArm("leader_7")
law = hc.JointPD(
    Kp=(240, 240, 240, 240, 24, 31, 25),  # N.m/rad
    Kd=(3, 3, 3, 3, 0.2, 0.2, 0.2),  # N.m.s/rad
    velocity="filter",
    cutoff=90.0,  # rad/s
)
limits = hc.theory.joint_limits(arm, law, Ts="2 ms", delay="2 ms")
print(limits.text())

# %%
# Faster, or with less delay, all gains may rise:
for Ts, delay in ((2e-3, 2e-3), (1e-3, 1e-3), (1e-3, 0.0)):
    found = hc.theory.joint_limits(arm, law, Ts, delay)
    print(f"{1 / Ts:.0f} Hz, {1e3 * delay:.0f} ms late: all Kp up to {found.scale:.2f} times")

# %%
# The worst of some poses, and a wall along z:
poses = hc.theory.over_poses(arm, law, 2e-3, 2e-3, poses=20)
print(poses.headline())
wall = hc.theory.wall_limit(arm, "z", 5.0, hc.Operator(), Ts=1e-3, delay=1e-3)
print(wall.headline())

# %%
# Friction fed forward in excess makes a limit cycle; few encoder counts hide it:
haptic = hc.MjcfArm("haptic_3")
rubbed = hc.JointPD(
    (1.0,) * 3, (0.01,) * 3, velocity="difference", friction=[(0.02, 50.0, 0.0)] * 3
)
for counts in (None, 4000):
    print(hc.theory.friction_cycle(haptic, rubbed, 1e-3, 1e-3, counts=counts).headline())

fig, ax = plt.subplots()
ax.barh(limits.names, limits.Kp[:, 1], height=0.5, alpha=0.4, label="stable")
ax.plot(law.Kp, limits.names, "ko", label="present")
ax.set(xscale="log", xlim=(10.0, 3e3), xlabel="Kp [N·m/rad]")
ax.invert_yaxis()
fig.legend(loc="outside upper center", ncols=2)
plt.show()
