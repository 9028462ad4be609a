"""
A virtual wall that vibrates
============================

The same hand presses on three virtual walls at 1 kHz. Below the limit of the sampled loop the wall
holds; above it the zero-order hold makes it vibrate; virtual damping brings it to rest again.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device = hc.Device(mass=0.1, damper=0.5)  # kg, N.s/m
hand = hc.Operator(mass=0.0, damper=2.0, spring=0.0)
wall = hc.VirtualWall(device=device, operator=hand, Ts=1e-3, unilateral=True)
limit = hc.walls.stiffness_band(replace(wall, unilateral=False))[1]
passive = hc.walls.colgate_schenkel_limit(replace(wall, operator=None, unilateral=False))
print(f"stable with this hand up to {limit:.0f} N/m, with any passive hand up to {passive:.0f} N/m")

walls = {
    f"{0.5 * limit:.0f} N/m: holds": replace(wall, K=0.5 * limit),
    f"{1.2 * limit:.0f} N/m: vibrates": replace(wall, K=1.2 * limit),
    f"{1.2 * limit:.0f} N/m with B = 5 N·s/m: holds": replace(wall, K=1.2 * limit, B=5.0),
}
press = hc.Constant((2.0, 0.0))  # N
fig, axes = plt.subplots(3, 1, sharex=True, sharey=True, figsize=(6.4, 5.2))
for ax, (name, tried) in zip(axes, walls.items(), strict=True):
    scenario = tried.scenario(0.6, push=0.05, start=-0.005, muscle=press)  # s, m/s, m
    record = hc.simulate(scenario)
    ax.axhspan(0.0, 4.0, color="0.92")
    late = record.p[record.t > 0.5, 0]
    print(f"{name}, {1e3 * np.ptp(late):.2f} mm from peak to peak at the end")
    ax.plot(1e3 * record.t, 1e3 * record.p[:, 0])
    ax.set_title(name, fontsize=9, loc="left")
axes[0].set(xlim=(0, 600), ylim=(-4, 3.9))
axes[1].set_ylabel("position x [mm], wall shaded")
axes[2].set_xlabel("time [ms]")
plt.show()
