"""
Your own compensator
====================

Any proper transfer function up to order 4 can replace K/(s² + 10 s). With the same stability margin
a lead transmits more of the clay to the hand: ``hc.theory.compare`` finds the gain of each and
sorts them.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b, hand = 90.0, hc.Operator()  # N.s/m
shapes = {
    "printed, 1/(s² + 10 s)": hc.Compensator(),
    "1/(s² + 40 s)": hc.Compensator((1.0,), (1.0, 40.0, 0.0)),
    "lead, (s + 20)/(s² + 40 s)": hc.Compensator((1.0, 20.0), (1.0, 40.0, 0.0)),
}
omega = np.geomspace(0.1, 300.0, 400)  # rad/s
fig, ax = plt.subplots()
for name, shape in shapes.items():
    (best,) = hc.theory.compare("x", b, [shape], hand, disk_margin=0.5, delay_margin=0.005)
    share = hc.theory.transparency("x", best.K, b, omega=omega, compensator=shape)
    ax.semilogx(omega, np.abs(share), label=f"{name}, K = {best.K:.3g}")
    print(f"{name}: K = {best.K:.4f}, error {best.error:.4f}")
ax.axvspan(0.3, 30.0, color="0.94", lw=0)
ax.axhline(1.0, color="0.3", ls="--", lw=1)
ax.set(xlabel="frequency [rad/s]", ylabel="clay's share of the hand's force, |fe/fh|")
ax.legend(loc="lower left")
plt.show()
