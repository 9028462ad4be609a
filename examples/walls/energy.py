"""
Passivity of a wall, by energy
==============================

A hand moves a device back and forth at half the sampling frequency, the path that draws the most
from a wall of K alone. Runs add up the energy that the device takes: from K = 2 b/Ts on it gives.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc
from hapticclay.studies.port_energy import taken_energy, zigzag

plt.style.use("hapticclay.views.figure")

b, Ts, amplitude = 1.0, 1e-3, 1e-4  # N.s/m, s, m
wall = hc.VirtualWall(device=hc.Device(mass=0.1, damper=b), Ts=Ts)
limit = hc.colgate_schenkel_limit(wall)
K = limit * np.array([0.0, 0.4, 0.8, 1.0, 1.2, 1.6])
taken = [taken_energy(replace(wall, K=float(x)), zigzag(amplitude)) for x in K]

fig, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.6))
left.plot(K, 1e6 * np.array(taken), "o", label="runs")
omega = np.array([np.pi / Ts])  # rad/s
spare = [hc.passivity_index(replace(wall, K=float(x)), omega)[0] for x in K]
left.plot(K, 1e6 * 4.0 * amplitude**2 / Ts * np.array(spare), label="theory")
left.axhline(0.0, color="0.3", ls="--", lw=1)
left.set(xlabel="virtual stiffness K [N/m]", ylabel="energy taken in a period [µJ]")
left.legend()
omega = np.geomspace(30.0, np.pi / Ts, 200)
for share, dash in ((0.5, "-"), (1.0, "--"), (1.5, ":")):
    index = hc.passivity_index(replace(wall, K=share * limit), omega)
    right.semilogx(omega / (2.0 * np.pi), index, dash, label=f"K = {share * limit:.0f} N/m")
right.axhline(0.0, color="0.3", lw=1)
right.set(xlabel="frequency [Hz]", ylabel="damping to spare [N·s/m]")
right.legend()
plt.show()
