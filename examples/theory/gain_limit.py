"""
The largest stable gain
=======================

``hc.theory.gain_limit`` is exact: every K below it is stable. Clay that damps can make the loop
unstable. A curve ends where sampled or late motors cannot render the clay at any K.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

Ts = 0.36e-3  # s
cases = {
    "continuous": {},
    "sampled every 0.36 ms": dict(Ts=Ts),
    "and torques 1 ms late": dict(Ts=Ts, delay=1e-3),
}
dampings = np.geomspace(3.0, 3e4, 13)  # N.s/m
fig, axes = plt.subplots(1, 2, sharey=True, figsize=(7.2, 3.6))
for axis, ax in zip("xy", axes, strict=True):
    for name, timing in cases.items():
        limits = np.array([hc.theory.gain_limit(axis, float(b), **timing) for b in dampings])
        ax.loglog(dampings, np.where(limits > 0.0, limits, np.nan), label=name)
    ax.set(xlabel="damping of the clay b [N·s/m]", title=f"{axis} axis, no hand")
axes[0].set_ylabel("largest stable K [1/kg]")
axes[1].axhline(1.0, color="0.3", ls="--", lw=1)
low, high = hc.theory.unstable_dampings(hc.theory.Loop("y", K=1.0))[0]
axes[1].plot((low, high), (1.0, 1.0), "o", color="0.3", ms=5)
axes[1].annotate(f"K = 1 is unstable\n{low:.0f} to {high:.0f} N·s/m", (low, 1.0), (6, 25),
                 textcoords="offset points", fontsize=9)  # fmt: skip
axes[0].legend()
plt.show()
