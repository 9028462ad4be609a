"""
The arm behind the handle
=========================

``hc.build`` returns the MuJoCo model of a run. At the recorded joint angles its kinematics give the
recorded position of the handle, within rounding.
"""

import matplotlib.pyplot as plt
import mujoco
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

scenario = hc.constant_cut()
record = hc.simulate(scenario)
model = hc.build(scenario)
data = mujoco.MjData(model)

fig, ax = plt.subplots(figsize=(5.6, 4.4))
x0, y0 = scenario.origin
ax.axvspan(x0 + 0.05, x0 + 0.15, color="0.92", lw=0)
ax.text(x0 + 0.1, 0.1, "clay", ha="center")
colors = plt.get_cmap("viridis")(np.linspace(0.0, 0.9, 5))
places = np.searchsorted(record.p[:, 0], np.linspace(0.0, 0.2, 5))
for i, color in zip(places, colors, strict=True):
    data.qpos[:] = record.q[i]
    mujoco.mj_kinematics(model, data)
    elbow, handle = data.body("link2").xpos[:2], record.p[i] + scenario.origin
    l2 = np.hypot(*(handle - elbow))
    print(f"{record.t[i]:7.3f} s: elbow to handle {l2:.15f} m")
    ax.plot(*np.array([(0.0, 0.0), elbow, handle]).T, "o-", color=color)
    ax.annotate(f"{record.t[i]:.1f} s", handle, (-4, 8), textcoords="offset points", fontsize=8)
ax.set(xlabel="world x [m]", ylabel="world y [m]", aspect="equal")
plt.show()
