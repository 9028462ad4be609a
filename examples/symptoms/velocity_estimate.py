"""
Window or filter for the velocity?
==================================

An encoder makes a differentiated velocity noisy. A longer window or a low-pass filter reduces the
noise and adds lag, and lag costs stiffness. Short windows and fast filters cost about the same; for
little noise a slow first-order filter leaves far more stiffness than a long window.
"""

import math

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device, Ts, B = hc.Device(mass=0.1, damper=0.5), 1e-3, 5.0  # kg and N.s/m, s, N.s/m
count = 20e-6  # m, of the encoder
rounding = count / math.sqrt(12.0)  # rms


def stiffest(**estimate):
    return hc.walls.stiffness_band(hc.VirtualWall(B=B, device=device, Ts=Ts, **estimate))[1]


windows = (1, 2, 4, 8, 16, 32)
filters = (300.0, 150.0, 70.0, 35.0, 20.0, 10.0)  # Hz
kept = [math.exp(-math.tau * f * Ts) for f in filters]
noise = {
    "window": [math.sqrt(2.0) * rounding / (n * Ts) for n in windows],
    "filter": [(1 - a) * math.sqrt(2 / (1 + a)) * rounding / Ts for a in kept],
}
limits = {
    "window": [stiffest(velocity_window=n) for n in windows],
    "filter": [stiffest(velocity_filter=f) for f in filters],
}
fig, ax = plt.subplots()
for (kind, values), mark in zip(limits.items(), "os", strict=True):
    ax.loglog([1e3 * x for x in noise[kind]], values, mark + "-", label=kind)
    texts = [f"n = {n}" for n in windows] if kind == "window" else [f"{f:g} Hz" for f in filters]
    for x, y, text in zip(noise[kind], values, texts, strict=True):
        over = (kind == "window") == (y > 4e3)  # the curves cross there
        shift, side = ((-6, 5), "right") if over else ((6, -11), "left")
        ax.annotate(text, (1e3 * x, y), shift, textcoords="offset points", ha=side, fontsize=8)
        print(f"{text}: noise {1e3 * x:.2f} mm/s, stable to {y:.0f} N/m")
ax.set(xlabel="velocity noise of the encoder, rms [mm/s]", ylabel="largest stable stiffness [N/m]")
ax.set_xticks((0.3, 1.0, 3.0, 10.0), ("0.3", "1", "3", "10"))
ax.xaxis.set_minor_formatter("")
ax.set(xlim=(0.2, 13), ylim=(500, 20e3))
ax.legend(loc="lower right")
plt.show()
