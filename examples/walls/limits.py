"""
Published limits of a wall
==========================

How stiff may a wall be at each latency of its force? Hulin's rule is close if the latency is long;
the passive limit is lower, because it holds for every passive hand. Hulin's boundary and Jury's
closed form are exact where they apply.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

wall = hc.VirtualWall(B=0.8, device=hc.Device(mass=0.1, damper=1.0), Ts=1e-3)  # N.s/m, kg, s
box = hc.theory.Box(mass=(0.0, 1.0), damper=(0.0, 5.0), spring=(0.0, 0.0))  # hands at the wall
delays = np.linspace(0.0, 5e-3, 101)  # s: the passive limit rises between whole samples
late = [replace(wall, delay=float(x)) for x in delays]

fig, ax = plt.subplots()
ms = 1e3 * delays
ax.semilogy(ms, [hc.walls.stiffness_band(x)[1] for x in late], label="exact, no hand")
ax.plot(
    ms, [hc.walls.hulin_limit(x) for x in late], "--", label="Hulin 2006: (b + B)/(Ts/2 + delay)"
)
ax.plot(0.0, hc.walls.hand_box_limit(wall, box), "ks", mfc="none", label="worst hand tried")
ax.plot(ms, [hc.walls.colgate_schenkel_limit(x) for x in late], ":", label="passive, Colgate 1997")
for samples in (0, 1):
    one = replace(wall, delay=samples * wall.Ts)
    ax.plot(1e3 * one.delay, hc.walls.jury_limit(one), "ko", ms=5, label="Jury" if samples else "")
    B, K = hc.walls.hulin_boundary(0.1, 1.0, wall.Ts, samples)
    known = np.interp(wall.B, B[: B.argmax()], K[: B.argmax()])
    ax.plot(1e3 * one.delay, known, "k+", ms=14, label="Hulin's boundary" if samples else "")
print("stable at 1 kN/m without delay:", hc.walls.stable_wall(replace(wall, K=1e3)))
ax.set(xlabel="delay [ms]", ylabel="largest K [N/m]", ylim=(50.0, None))
fig.legend(loc="outside upper center", ncols=2)
plt.show()
