"""
Force over velocity
===================

A hand perceives viscosity as force over velocity. That of the clay is its damping b at any speed;
at a steady speed that of the hand is larger by 10/K, the compensator's own damper.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b, K = 90.0, 1.0  # N.s/m, 1/kg
record = hc.simulate(hc.constant_cut(b=b, gain=(K, 0.5)))
steady = record.steady()[:, 0]

fig, ax = plt.subplots()
ax.axvspan(5, 15, color="0.92")
ax.text(10, 75, "clay", ha="center")
hand = np.where(steady, record.ratio(record.fh)[:, 0], np.nan)
ax.plot(100 * record.p[:, 0], hand, lw=3, label="hand, fh/v at a steady speed")
ax.plot(100 * record.p[:, 0], record.ratio(record.fe)[:, 0], lw=3, label="clay, fe/v")
expected = record.b[:, 0]
for more, label in ((10.0 / K, "expected"), (0.0, None)):
    ax.plot(100 * record.p[:, 0], expected + more, color="0.2", ls="--", lw=1, label=label)
ax.set(xlabel="position x [cm]", ylabel="force over velocity [N·s/m]")
ax.legend(loc="center", bbox_to_anchor=(0.5, 0.4))
plt.show()
