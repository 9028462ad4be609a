"""
Effective impedance
===================

What does a wall of 300 N/m feel like at each frequency? A multisine on the running wall measures
it, and theory computes it: a spring at low frequency, more damping than B, and the mass of the
device.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device = hc.Device(mass=0.1, damper=0.5)  # kg, N.s/m
wall = hc.VirtualWall(K=300.0, B=2.0, device=device, Ts=1e-3)
found = hc.studies.measure_impedance(wall)
print(f"measured and computed Z differ by {found.gap:.1e}, fe/fh by {found.felt_gap:.1e}")

omega = 2.0 * np.pi * np.geomspace(0.5, 30.0, 300)  # rad/s
computed, measured = hc.walls.wall_response(wall, omega), found.measured
fig, axes = plt.subplots(3, 1, sharex=True, figsize=(6.4, 6.4))
for ax, part, unit in zip(
    axes, ("stiffness", "damping", "mass"), ("N/m", "N·s/m", "kg"), strict=True
):
    ax.semilogx(measured.frequency, getattr(measured, part), "o", ms=4, label="measured")
    ax.plot(computed.frequency, getattr(computed, part), "-", label="computed")
    ax.set(ylabel=f"effective {part} [{unit}]", ylim=(0.0, {"mass": 0.12}.get(part)))
free = hc.walls.wall_impedance(hc.VirtualWall(device=device, Ts=1e-3), omega)  # motor off
axes[2].plot(omega / (2.0 * np.pi), free.imag / omega, "k:", label="device alone")
axes[0].legend()
axes[2].legend()
axes[2].set_xlabel("frequency [Hz]")
plt.show()
