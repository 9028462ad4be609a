"""
All signals
===========

These signals can be ``Scenario.muscle`` and ``Scenario.command``. Each is a function of time; sums
and multiples of signals are signals too.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

x = (1.0, 0.0)
samples = hc.Samples(np.array([0.0, 1.0, 1.5, 3.0]), [(0, 0), (1, 0), (-1, 0), (0.5, 0)])
signals: dict[str, hc.Signal] = {
    "Constant": hc.Constant(x),
    "Step": hc.Step(x, time=1.0),
    "Ramp": hc.Ramp((0.5, 0.0), start=0.5, end=2.5),
    "Pulse": hc.Pulse(x, start=0.5, width=0.3, period=1.0),
    "Chirp": hc.Chirp(x, low=0.5, high=4.0, duration=3.5),
    "Multisine": hc.Multisine(rms=(0.5, 0.0), low=0.5, high=4.0, period=4.0, seed=1),
    "Samples": samples,
    "Function": hc.Function(lambda t: (np.exp(-t) * np.sin(8.0 * t), 0.0)),
    "Sum of two": hc.Sum((hc.Step(x, time=1.0), hc.Chirp(x, 1.0, 3.0, 4.0)), (0.5, 0.4)),
}
t = np.linspace(0.0, 4.0, 2001)
fig, axes = plt.subplots(3, 3, sharex=True, sharey=True, figsize=(7.2, 5.0))
for ax, (name, signal) in zip(axes.flat, signals.items(), strict=True):
    ax.plot(t, [signal(float(s))[0] for s in t])
    ax.set_title(name, fontsize=9, loc="left")
fig.supxlabel("time [s]", fontsize=10)
fig.supylabel("along x, in the unit of what it adds to", fontsize=10)
plt.show()
