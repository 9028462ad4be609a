"""
Many hands at once, step by step
================================

``hc.SimulationBatch`` advances many runs in one call, each under its own force. Here 21 hands pull
with 1 to 8 N minus 30 N·s/m times their speed, which they measure every 10 ms. The clay begins at 5
cm.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

strength = np.linspace(1.0, 8.0, 21)  # N, of a hand at rest
scene = hc.constant_cut(b=90.0, length=0.1, t_max=8.0)
x, speed = [], []
with hc.SimulationBatch([scene] * len(strength)) as sims:
    while not sims.ended.all():
        push = strength - 30.0 * sims.v[:, 0]  # N
        sims.advance(28, force=np.column_stack((push, np.zeros_like(push))))
        x.append(sims.p[:, 0])
        speed.append(sims.v[:, 0])

fig, ax = plt.subplots()
ax.axvspan(5, 10, color="0.9")
ax.text(5.15, 22, "clay", color="0.3")
for k in range(0, len(strength), 5):
    ax.plot(100 * np.array(x)[:, k], 100 * np.array(speed)[:, k], label=f"{strength[k]:.1f} N")
ax.set(xlabel="position x [cm]", ylabel="speed [cm/s]", xlim=(0, 10))
ax.legend(ncols=2, title="force at rest")
plt.show()
