"""
The worst hand of a box
=======================

A loop that is stable with one hand may be unstable with another. ``hc.theory.worst_case`` finds the
lowest gain limit over a whole box of hands, and the hand that causes it. No random hand of the box
has a lower limit.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b = 90.0  # N.s/m
box = hc.theory.Box(mass=(0.1, 1.0), damper=(1.0, 10.0), spring=(0.0, 300.0))
worst = hc.theory.worst_case("y", 0.5, b, box)
print(worst)

hands = box.sample(200, seed=1)
limits = np.array([hc.theory.gain_limit("y", b, hand) for hand in hands])
nominal = hc.theory.gain_limit("y", b, hc.Operator())
fig, ax = plt.subplots()
ax.scatter([h.spring for h in hands], limits, c=[h.mass for h in hands], s=14, cmap="viridis")
fig.colorbar(ax.collections[0], ax=ax, label="mass [kg]")
ax.axhline(worst.limit, color="#D55E00", label=f"worst of the box, {worst.limit:.3f}")
ax.axhline(nominal, color="0.3", ls="--", lw=1, label=f"the paper's hand, {nominal:.3f}")
ax.set(xlabel="spring of the hand [N/m]", ylabel="largest stable K on y [1/kg]")
ax.set_ylim(0.63, 1.7)
ax.legend(loc="upper left", ncols=2)
plt.show()
