"""
A wall in many hands
====================

The largest stable stiffness of a virtual wall over its damping, as a band over published hands.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

wall = hc.VirtualWall(device=hc.Device(mass=0.1, damper=0.5), Ts=1e-3)  # kg, N.s/m, s
B = np.linspace(0.0, 100.0, 5)  # N.s/m
band = hc.walls.wall_band(wall, "published range", B.tolist(), hc.studies.Draw(hands=6))
fig, ax = plt.subplots()
ax.fill_between(B, band.quantile(0.05), band.quantile(0.95), alpha=0.3, label="5 to 95 % of hands")
ax.plot(B, band.nominal, label="hand of medians")
alone = [hc.walls.stiffness_band(hc.VirtualWall(B=x, device=wall.device, Ts=1e-3))[1] for x in B]
ax.plot(B, alone, "k--", label="no hand")
ax.set(xlabel="virtual damping B [N·s/m]", ylabel="largest stable K [N/m]", yscale="log")
ax.legend()
plt.show()
