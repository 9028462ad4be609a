"""
A sufficient condition, and the limit
=====================================

The paper requires ``|L| < 1`` (Eq. 11) or ``|G C| < |1/T + Sh|`` (Eq. 13). Both are sufficient,
neither is necessary. Without a hand Eq. 13 admits some of the stable gains. With the paper's hand
it admits none, because the compensator integrates against the spring of the hand.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b = 90.0  # N.s/m
gains = np.geomspace(0.02, 5.0, 60)
fig, ax = plt.subplots()
for equation in (9, 11, 13):
    margins = [hc.theory.small_gain("x", float(K), b, equation=equation).margin for K in gains]
    ax.loglog(gains, margins, label=f"Eq. {equation}, no hand")
margins = [hc.theory.small_gain("x", float(K), b, hc.Operator(), equation=13).margin for K in gains]
print(f"with the paper's hand, Eq. 13: at most {max(margins):.1g}")
limit = hc.theory.gain_limit("x", b)
ax.axvline(limit, color="0.3", lw=1, label=f"exact limit, {limit:.2f}")
ax.axhline(1.0, color="0.3", ls="--", lw=1)
error = hc.theory.transparency_error("x", 1.0, b)
print(f"at K = 1 the clay's share of the force is off by {error:.3f} rms")
ax.set(xlabel="K [1/kg]", ylabel="margin: holds above 1 (Eq. 9: above 0)", ylim=(1e-2, 1e2))
ax.legend()
plt.show()
