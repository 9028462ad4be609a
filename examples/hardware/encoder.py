"""
Encoder and filter
==================

Angles are rounded to counts, and the velocity is the difference of counts. A longer window or a
filter smooths the velocity and adds lag. The remaining ripple is one count at the handle, divided
by the window.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

counts, Ts = 65536, 0.36e-3
parts = {
    "window of 1 sample": dict(),
    "window of 16 samples": dict(velocity_window=16),
    "1 sample and a filter of 30 Hz": dict(velocity_filter=30.0),
}
fig, axes = plt.subplots(3, 1, sharex=True, sharey=True, figsize=(6.4, 5.4))
for ax, (name, part) in zip(axes, parts.items(), strict=True):
    hardware = hc.Hardware(encoder=counts, velocity="difference", **part)
    cut = hc.constant_cut(control="sampled", force=(5.0, 0.0), inertia_shaping=True, length=0.12)
    record = hc.simulate(hc.with_fields(cut, {"hardware": hardware}))
    felt = record.ratio(record.fe)[:, 0]
    inside = (record.p[:, 0] > 0.08) & (record.p[:, 0] < 0.11)
    ax.plot(100 * record.p[:, 0], felt, lw=0.8)
    ax.axhline(90.0, color="0.3", ls="--", lw=1)
    rms = np.std(felt[inside]) / 90.0
    ax.set_title(f"{name}: rms {100 * rms:.1f} %", fontsize=9, loc="left")
count = 0.24 * math.tau / counts / Ts / record.v[-1, 0]
print(f"one count of the shoulder in a sample: {100 * count:.0f} % of the speed")
axes[0].set(xlim=(7.9, 8.2), ylim=(-20, 220))
axes[-1].set_xlabel("position x [cm]")
fig.supylabel("force of the clay over velocity [N·s/m]", fontsize=10)
plt.show()
