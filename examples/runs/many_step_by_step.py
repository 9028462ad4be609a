"""
Many hands at once, step by step
================================

``hc.SimulationBatch`` advances many runs by one call, under a force for each. Here 24 hands of
different strength hold the speed at 3 cm/s as well as they can, through clay that begins at 5 cm.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

strength = np.linspace(1.0, 8.0, 24)  # N, the most that a hand gives
scene = hc.constant_cut(b=90.0, operator=hc.Operator(), length=0.1, t_max=8.0)
x, speed = [], []
with hc.SimulationBatch([scene] * len(strength)) as sims:
    while not sims.ended.all():
        wanted = 200.0 * (0.03 - sims.v[:, 0])  # N
        push = np.clip(wanted, 0.0, strength)
        sims.advance(55, force=np.column_stack((push, np.zeros_like(push))))
        x.append(sims.p[:, 0])
        speed.append(sims.v[:, 0])

fig, ax = plt.subplots()
ax.axvspan(5, 10, color="0.9", label="clay")
for k in range(0, len(strength), 5):
    ax.plot(100 * np.array(x)[:, k], 100 * np.array(speed)[:, k], label=f"{strength[k]:.1f} N")
ax.set(xlabel="position x [cm]", ylabel="speed [cm/s]", xlim=(0, 10))
ax.legend(ncols=2, title="most force")
plt.show()
