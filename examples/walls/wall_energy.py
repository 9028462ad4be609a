"""
Passivity of a wall, by energy
==============================

A hand moves a device back and forth at half the sampling frequency, the path that extracts the most
energy from a wall of K alone. Runs add up the energy that the device absorbs: above K = 2 b/Ts it
returns energy.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b, Ts, amplitude = 1.0, 1e-3, 1e-4  # N.s/m, s, m
wall = hc.VirtualWall(device=hc.Device(mass=0.1, damper=b), Ts=Ts)
limit = hc.walls.colgate_schenkel_limit(wall)
K = limit * np.array([0.0, 0.4, 0.8, 1.0, 1.2, 1.6])
taken = [hc.walls.taken_energy(replace(wall, K=float(x)), hc.walls.zigzag(amplitude)) for x in K]

omega = np.array([np.pi / Ts])  # rad/s
spare = [hc.walls.passivity_index(replace(wall, K=float(x)), omega)[0] for x in K]  # N.s/m
path = 8.0 * amplitude**2 / Ts  # integral of v^2 over a period, m^2/s

fig, ax = plt.subplots()
ax.plot(K, 1e6 * np.array(taken), "o", label="runs")
ax.plot(K, 1e6 * path * np.array(spare), label="damping to spare, by theory, times ∫v² dt")
ax.axvline(limit, color="0.3", ls="--", lw=1, label=f"2 b/Ts = {limit:.0f} N/m")
ax.axhline(0.0, color="0.3", lw=1)
ax.set(xlabel="virtual stiffness K [N/m]", ylabel="energy taken in a period [µJ]")
ax.legend()
plt.show()
