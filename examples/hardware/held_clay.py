"""
How much clay can motors hold?
==============================

Clay that a computer renders is passive up to the physical damping of the handle, for any sample
(``hc.theory.clay_passivity``). This holds for all hands and motions. A single run is passive if the
hand never received more energy than it put in.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

damping = 5.0  # N.s/m, physical
for b in (4.0, 6.0):
    verdict = hc.theory.clay_passivity(b, Ts=1e-3, damping=damping)
    print(f"b = {b:g}: passive {verdict.verdict}, {verdict.margin:.1f} {verdict.measures}")

cut = hc.constant_cut(operator=hc.Operator(), force=(2.0, 0.0), control="sampled")
record = hc.simulate(cut)
seen = hc.observed_passivity(record)
print(f"{record.status}; passive in this run: {seen.verdict}")

energy = hc.port_energy(record)
fig, ax = plt.subplots()
for i, axis in enumerate("xy"):
    ax.plot(record.t, 1e3 * energy[:, i], label=f"{axis}, from hand to handle")
work = np.concatenate(([0.0], np.cumsum(record.fe[:-1, 0] * np.diff(record.p[:, 0]))))
ax.plot(record.t, 1e3 * work, "--", label="x, from handle to clay")
ax.set(xlabel="time [s]", ylabel="energy [mJ]")
ax.legend()
plt.show()
