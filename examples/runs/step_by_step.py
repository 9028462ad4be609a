"""
Your own hand, step by step
===========================

``hc.Simulation`` advances a run step by step, with a force that you choose at each step. Here a
hand follows a moving target with a spring and a damper, through the clay and back.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

scenario = hc.constant_cut(b=30.0, length=0.2, t_max=8.0, dt=2e-3)
target = []
with hc.Simulation(scenario) as sim:
    while sim.outcome is None:
        now = sim.state
        aim = (0.06 * (1.0 - math.cos(0.25 * math.pi * now.t)), 0.0)  # m
        target.append(aim[0])
        sim.step(force=tuple(200.0 * (aim[i] - now.p[i]) - 5.0 * now.v[i] for i in range(2)))
    record = sim.record()

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.6))
above.axhspan(5, 13, color="0.9", label="clay")
above.plot(record.t[: len(target)], 100 * np.array(target), "--", color="0.3", label="target")
above.plot(record.t, 100 * record.p[:, 0], label="handle")
above.set(ylabel="position x [cm]", ylim=(-0.5, 13))
above.legend(ncols=3, loc="lower center")
below.plot(record.t, record.fh[:, 0], label="hand")
below.plot(record.t, record.fe[:, 0], label="clay")
below.set(ylabel="force x [N]", xlabel="time [s]")
below.legend(ncols=2)
plt.show()
