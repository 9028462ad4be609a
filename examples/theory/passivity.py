"""
Passive on x, not on y
======================

A loop is stable with every passive hand if its impedance is passive: Re Z(jω) at or above 0. At b =
90 N·s/m the cut is passive on x; on y it is stable with the paper's hand, but not passive.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b = 90.0  # N.s/m
omega = np.geomspace(1.0, 300.0, 500)  # rad/s
s = 1j * omega
fig, ax = plt.subplots()
for axis, servo, K in zip("xy", hc.Scenario().servo, (1.0, 0.5), strict=True):
    G, S = (p.gain / (s**2 + p.damping * s + p.stiffness) for p in (servo.G, servo.S))
    Z = b + 1.0 / (s * (G * K / (s**2 + 10.0 * s) + S))  # fh/v
    verdict = hc.theory.passivity(axis, K, b)
    print(f"{axis}: {verdict.verdict}, {verdict.margin:.4g} {verdict.measures}")
    (line,) = ax.semilogx(omega, Z.real, label=f"{axis}, K = {K:g}")
    ax.plot(verdict.omega, verdict.margin, "o", color=line.get_color())
ax.plot([], [], "o", color="0.3", label="margin of hc.theory.passivity")
ax.axhline(0.0, color="0.3", ls="--", lw=1)
ax.set(xlabel="frequency [rad/s]", ylabel="Re Z [N·s/m]", yscale="symlog")
ax.legend()
plt.show()
