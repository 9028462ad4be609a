"""
The least mass of the arm
=========================

The compensator makes the arm feel like a mass M behind a damper B. How light may it be, for the
printed hand and for all hands of a box?
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

loop = hc.studies.PushedLoop("x", Ts=0.36e-3, b=0.0, operator=hc.Operator())  # s, without clay
box = hc.theory.Box(mass=(0.1, 1.0), damper=(1.0, 10.0), spring=(0.0, 300.0))  # kg, N.s/m, N/m
found = hc.walls.arm_mbk(loop, box, columns=1, points=7, samples=2)
M, B = hc.walls.least_mass(loop, decay=1.0)
print(f"B/M = 1/s: {1e3 * M:.3g} g and {1e3 * B:.3g} mN.s/m; runs differ by {found.gap:.1e}")

fig, ax = plt.subplots()
ax.loglog(found.nominal[1], found.nominal[0], label="printed hand")
ax.plot([x.x for x in found.found], [x.y for x in found.found], "o", label="runs, printed hand")
ax.plot(found.worst[1], found.worst[0], "--", label="all hands of the box")
ax.plot(B, M, "kD", ms=10, mfc="none", label="B/M = 1/s")
ax.set(xlabel="virtual damping B [N·s/m]", ylabel="least virtual mass M [kg]")
fig.legend(loc="outside upper center", ncols=2)
plt.show()
