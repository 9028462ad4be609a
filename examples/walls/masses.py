"""
Renderable masses and dampers
=============================

A motor that pushes against the acceleration renders mass. A negative virtual mass makes the device
lighter. Theory gives the exact border at each mass; runs find the one at M = 0.05 kg.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

wall = hc.VirtualWall(device=hc.Device(mass=0.1, damper=0.5), Ts=1e-3)  # kg, N.s/m, s
low, high = hc.walls.stable_band(wall, "M")
print(f"M-width without damper: {low:.4g} to {high:.4g} kg")
region = hc.walls.renderable(wall, "mass-damper")
borders = hc.walls.wall_borders(wall, "mass-damper", 0.05)
for found in borders:
    print(f"M = {found.x:g} kg: B to {found.y:.5g} by runs, {found.exact:.5g} N.s/m by theory")

fig, ax = plt.subplots()
ax.fill_between(region.x, region.low, region.high, color="0.9")
ax.plot(region.x, region.high, label="exact")
ax.plot(region.x, region.low, color="C0")
ax.plot([x.x for x in borders], [x.y for x in borders], "o", label="runs")
ax.plot(-0.1, 0.0, "kD", ms=5, label="minus the mass of the device")
ax.set(xlabel="virtual mass M [kg]", ylabel="virtual damping B [N·s/m]")
ax.legend()
plt.show()
