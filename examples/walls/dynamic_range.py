"""
Dynamic range
=============

How does the impedance of the stiffest stable wall of a device compare with that of its free motion?
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

wall = hc.VirtualWall(device=hc.Device(mass=0.1, damper=0.5))  # kg, N.s/m
frequency = np.geomspace(0.5, 30.0, 60)  # Hz
fig, ax = plt.subplots()
for Ts, dash in ((0.5e-3, "-"), (1e-3, "--"), (2e-3, ":")):  # s
    found = hc.walls.dynamic_range(replace(wall, Ts=Ts), 2.0 * np.pi * frequency)
    print(f"Ts = {1e3 * Ts:g} ms: {found.mean:.1f} dB; stiffest wall {found.stiffest.K:.3g} N/m")
    ax.loglog(frequency, found.most, dash, label=f"stiffest wall, Ts = {1e3 * Ts:g} ms")
ax.plot(frequency, found.free, color="0.3", label="free device")
ax.set(xlabel="frequency [Hz]", ylabel="|Z| [N·s/m]")
fig.legend(loc="outside upper center", ncols=2)
plt.show()
