"""
A batch on all cores
====================

``hc.simulate_batch`` runs scenes in parallel, with results bit-identical to those of
``hc.simulate``. The scenes may differ in anything; here in the clay. The steady speed is K f/(10 +
K b).
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

dampings = np.geomspace(1.0, 1000.0, 25)  # N.s/m
scenes = [hc.constant_cut(b=float(b), gain=(1.0, 0.1), length=0.1, t_max=80.0) for b in dampings]
records = hc.simulate_batch(scenes, every=10)

fig, ax = plt.subplots()
fine = np.geomspace(1.0, 1000.0, 200)
ax.loglog(fine, 100.0 / (10.0 + fine), "--", color="0.3", lw=1, label="K f/(10 + K b)")
ax.loglog(dampings, [100 * r.v[-1, 0] for r in records], "o", ms=4, label="at x = 10 cm")
ax.set(xlabel="damping of the clay b [N·s/m]", ylabel="velocity x [cm/s]")
ax.legend()
plt.show()
