"""
Poles over the gain
===================

As K grows, the poles of the closed loop of y move. They leave the left half-plane at the K that
``hc.theory.gain_limit`` computes.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b, hand = 90.0, hc.Operator()
limit = hc.theory.gain_limit("y", b, hand)
gains = np.geomspace(0.01, 3.0 * limit, 300)
poles = np.array([hc.theory.closed_loop_poles("y", float(K), b, hand) for K in gains])
fig, ax = plt.subplots()
colors = np.repeat(gains, poles.shape[1])
dots = ax.scatter(poles.real, poles.imag, c=colors, s=3, cmap="viridis", norm="log")
fig.colorbar(dots, ax=ax, label="K [1/kg]")
at = hc.theory.closed_loop_poles("y", limit, b, hand)
at = at[np.abs(at.real) < 1e-6]
print(f"at K = {limit:.4f}: {at}")
ax.plot(at.real, at.imag, "o", color="#D55E00", mfc="none", ms=9, label=f"K = {limit:.3f}")
ax.axvline(0.0, color="0.3", ls="--", lw=1)
ax.set(xlim=(-60, 15), ylim=(-70, 70), xlabel="Re s [1/s]", ylabel="Im s [rad/s]")
ax.legend(loc="upper left")
plt.show()
