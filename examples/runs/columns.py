"""
Final values of many runs
=========================

``hc.simulate_columns`` runs a scene once for each row of some columns of numbers, and keeps the
final values. Here the gain and the damping of the clay are random. The final speed over the force
tends to that of the linear loop, K/(10 + K b).
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

rng = np.random.default_rng(0)
K, b = rng.uniform(0.1, 0.8, 120), rng.uniform(20.0, 200.0, 120)  # 1/kg, N.s/m
scene = hc.constant_cut(start=(0.06, 0.0), t_max=0.8)
ends = hc.simulate_columns(scene, {"gain.x": K, "clay.x.values.1": b})
admittance = 1e3 * ends["v"][:, 0] / ends["fh"][:, 0]  # mm/s a newton

fig, ax = plt.subplots()
line = np.array([0.0, 1.05 * admittance.max()])
ax.plot(line, line, "--", color="0.3", lw=1, label="equal")
dots = ax.scatter(1e3 * K / (10.0 + K * b), admittance, c=b, s=12, zorder=3)
ax.set(xlabel="K/(10 + K b) [mm/(s·N)]", ylabel="speed over force [mm/(s·N)]")
fig.colorbar(dots, label="damping of the clay b [N·s/m]")
ax.legend()
plt.show()
