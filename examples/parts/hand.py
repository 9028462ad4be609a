"""
Your own hand
=============

The person's arm is an impedance, mass s² + damper s + spring, on each axis. It changes which K is
stable. Compared are no hand, the paper's hand, a hand that grips, and one that leans on the handle.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

hands = {
    "no hand": None,
    "the paper's": hc.Operator(),  # 0.25 kg, 2 N.s/m, 6 N/m
    "grips": hc.Operator(mass=0.4, damper=8.0, spring=200.0),
    "leans": hc.Operator(mass=3.0, damper=2.0, spring=6.0),
}
dampings = np.geomspace(1.0, 1e4, 60)  # N.s/m
fig, ax = plt.subplots()
for name, hand in hands.items():
    limits = [hc.theory.gain_limit("y", float(b), hand) for b in dampings]
    ax.loglog(dampings, limits, label=name)
ax.axhline(0.5, color="0.3", ls="--", lw=1, label="K = 0.5, of the cut")
ax.set(xlabel="damping of the clay b [N·s/m]", ylabel="largest stable K on y [1/kg]")
ax.set_ylim(0.1, 100.0)
ax.legend(loc="upper right")
plt.show()
