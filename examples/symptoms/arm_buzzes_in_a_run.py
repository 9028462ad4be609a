"""
The buzz of an arm, in runs
===========================

The leader of seven joints at its gains, and at 0.5 % to either side of the gains that it carries:
each run swings up or dies out as fast as the exact map says.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

arm = hc.MjcfArm("leader_7")
law = hc.JointPD(
    Kp=(240, 240, 240, 240, 24, 31, 25),  # N.m/rad
    Kd=(3, 3, 3, 3, 0.2, 0.2, 0.2),  # N.m.s/rad
    velocity="filter",
    cutoff=90.0,  # rad/s
)
runs = hc.studies.joint_runs(arm, law, Ts=2e-3, delay=2e-3)
print(runs.text())

fig, axes = plt.subplots(3, 1, figsize=(6.4, 5.6))
for i, ax in enumerate(axes):
    t, x = runs.times[i], 1e3 * runs.motion[i]
    envelope = np.exp(runs.expected[i] * t)
    late = t > 0.5 * t[-1]
    envelope *= (np.abs(x[late]) / envelope[late]).max()
    ax.plot(t, x, lw=0.9, label="run")
    ax.plot(t, envelope, "C1--", lw=1.1, label="envelope by theory")
    ax.plot(t, -envelope, "C1--", lw=1.1)
    most = 1.15 * np.abs(x).max()
    ax.set(ylabel=f"{runs.joint[i]} [mrad]", ylim=(-most, most))
    rates = f"{runs.growth[i]:.4f} 1/s, by theory {runs.expected[i]:.4f} 1/s"
    ax.set_title(f"all Kp times {runs.factor[i]:.3f}: growth {rates}", loc="left", fontsize=9)
axes[-1].set_xlabel("time [s]")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
plt.show()
