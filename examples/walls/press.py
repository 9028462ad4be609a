"""
An encoder, and what counts as rest
===================================

With friction and an encoder the loop is not linear: a wall counts as stable if it comes to rest
after a push. ``hc.walls.Press`` defines the push and the motion that counts as rest.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device = hc.Device(mass=0.1, damper=0.5, friction=0.02)  # kg, N.s/m, N
wall = hc.VirtualWall(device=device, Ts=1e-3)
quanta = (20e-6, 80e-6)  # m
found = hc.walls.zwidth(
    wall, "quantum", quanta, B=(0.0, 10.0), press=hc.walls.Press(force=1.0, still=1e-6)
)

fig, ax = plt.subplots()
for region, quantum, mark in zip(found.regions, quanta, "os", strict=True):
    ax.semilogy(region.B, region.K, mark, ls="--", label=f"runs, Δ = {1e6 * quantum:.0f} µm")
    limit = hc.walls.abbott_okamura_limit(region.wall)
    ax.plot(0.0, limit, "kD", mfc="none", ms=9)
    print(f"{1e6 * quantum:.0f} um: rests to {region.K[0]:.4g} N/m, surely to {limit:.4g} N/m")
ax.plot([], [], "kD", mfc="none", ms=9, label="Abbott, Okamura 2005: min(2 b/Ts, 2 fc/Δ)")
B = np.linspace(0.0, 10.0, 21)
walls = [hc.VirtualWall(B=x, device=device, Ts=1e-3) for x in B]
ax.plot(B, [hc.walls.stiffness_band(x)[1] for x in walls], "0.4", label="linear loop, no encoder")
ax.set(xlabel="virtual damping B [N·s/m]", ylabel="largest K that rests [N/m]", ylim=(300, 1e5))
ax.legend()
plt.show()
