"""
Where the energy goes
=====================

Each run has an energy balance: work of hand and motors, energy absorbed by the clay, stored energy.
The residual is the error of the integration; it falls with the square of the step.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

steps = [4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4]  # s
records = [hc.simulate(hc.constant_cut(dt=dt, operator=hc.Operator())) for dt in steps]
energy = records[-1].energy
names = ["muscle", "motors", "clay", "hand_damper", "kinetic", "hand_stored"]

fig, (left, right) = plt.subplots(1, 2, figsize=(7.2, 3.4))
left.barh(names[::-1], [1e3 * energy[name] for name in names][::-1])
left.set(xlabel="energy over the run [mJ]")
share = [abs(r.energy["residual"]) / r.energy["throughput"] for r in records]
right.loglog([1e3 * dt for dt in steps], share, "o-", label="left over")
second = [share[0] * (dt / steps[0]) ** 2 for dt in steps]
right.loglog([1e3 * dt for dt in steps], second, "--", color="0.3", lw=1, label="second order")
right.set(xlabel="step [ms]", ylabel="share of the throughput")
right.set_xticks([0.25, 0.5, 1, 2, 4], ["0.25", "0.5", "1", "2", "4"])
right.minorticks_off()
right.legend()
plt.show()
