"""
Stiff clay
==========

How large may the stiffness k of clay with damping b be before the loop becomes unstable?
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b = np.geomspace(1.0, 1000.0, 60)  # N.s/m
fig, ax = plt.subplots()
for K, dash in ((1.0, "-"), (1.5, "--"), (2.0, ":")):
    ax.loglog(b, [hc.theory.stiffness_limit("x", K, float(x)) for x in b], dash, label=f"K = {K:g}")
ax.set(xlabel="damping of the clay b [N·s/m]", ylabel="largest stable k [N/m]")
ax.legend()
plt.show()
