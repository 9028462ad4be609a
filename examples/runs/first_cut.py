"""
A first cut
===========

A hand pushes with 1 N through a slab of clay, 10 cm long. Behind each border the speed settles at K
f/(10 + K b), because the compensator's own damper and the clay share the force.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b, K, f = 90.0, 1.0, 1.0  # N.s/m, 1/kg, N
record = hc.simulate(hc.constant_cut(b=b, gain=(K, 0.5), force=(f, 0.0)))
print(record.status)
for crossing in record.crossings:
    print(f"{crossing.border:.2f} m at {crossing.time:.4f} s, {crossing.speed:.4f} m/s")

fig, ax = plt.subplots()
ax.axvspan(5, 15, color="0.92")
ax.text(10, 9, "clay", ha="center")
ax.plot(100 * record.p[:, 0], 100 * record.v[:, 0], label="simulated")
for resistance in (10.0, 10.0 + K * b):
    label = "expected, K f/(10 + K b)" if resistance == 10.0 else None
    ax.axhline(100 * K * f / resistance, color="0.3", ls="--", lw=1, label=label)
ax.set(xlabel="position x [cm]", ylabel="velocity x [cm/s]")
ax.legend(loc="center")
plt.show()
