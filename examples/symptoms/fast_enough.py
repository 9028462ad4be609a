"""
Is the computer fast enough?
============================

The plot shows the stiffest virtual wall that a loop renders stably, over its rate. A fixed latency
soon makes a faster loop useless; a hand that holds the device allows a stiffer wall.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device = hc.Device(mass=0.1, damper=0.5)  # kg, N.s/m
grip = hc.Operator(mass=0.25, damper=2.0, spring=60.0)
rates = np.geomspace(50.0, 5000.0, 60)  # Hz
cases = {
    "no latency, hand": (0.0, grip, "-"),
    "no latency, no hand": (0.0, None, "--"),
    "1 ms latency, hand": (1e-3, grip, "-"),
    "1 ms latency, no hand": (1e-3, None, "--"),
    "5 ms latency, hand": (5e-3, grip, "-"),
    "5 ms latency, no hand": (5e-3, None, "--"),
}
colors = ("C0", "C0", "C1", "C1", "C2", "C2")
fig, ax = plt.subplots()
for (name, (delay, hand, dash)), color in zip(cases.items(), colors, strict=True):
    walls = [hc.VirtualWall(device=device, operator=hand, Ts=1 / f, delay=delay) for f in rates]
    limits = [hc.walls.stiffness_band(wall)[1] for wall in walls]
    ax.loglog(rates, limits, dash, color=color, label=name)
    print(f"{name}: {np.interp(1000.0, rates, limits):.0f} N/m at 1 kHz")
ax.set(xlabel="rate of the loop [Hz]", ylabel="largest stable stiffness [N/m]")
ax.legend(fontsize=8)
plt.show()
