"""
A leader and its follower from their log
========================================

A follower with friction, behind a filtered PD law, is logged; gains, filter, inertia and friction
are found again with 95 % intervals, and the follower is simulated behind the measured leader.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

rng, Ts = np.random.default_rng(1), 5e-4
t = Ts * np.arange(8000)
leader = 0.09 * np.sin(4.4 * t) + 0.05 * np.sin(12.0 * t + 1.0) + 0.02 * np.sin(27.0 * t)
J, friction, P, D, keeps = 1.6e-3, 0.03, 12.0, 0.11, 0.6  # SI; keeps: of the filter

follower, torque = np.zeros_like(t), np.zeros_like(t)
q, v, x = leader[0], 0.0, 0.0
for i in range(len(t)):
    before, x = x, keeps * x + (1.0 - keeps) * (leader[i] - q)
    follower[i], torque[i] = q, P * x + D * (x - before) / Ts
    for h in [Ts / 20] * 20:
        pushed = v + h * torque[i] / J
        v = math.copysign(max(abs(pushed) - h * friction / J, 0.0), pushed)
        q += h * v
torque += 1e-3 * rng.standard_normal(len(t))  # N.m
follower = 2e-5 * np.round(follower / 2e-5)  # an encoder

log = hc.studies.PairLog(t, leader, follower, follower_torque=torque, leader_torque=-torque)
found = hc.studies.identify_pair(log)
for number in found.numbers:
    print(f"{number.name}: {number.value:.4g} ({number.low:.4g} to {number.high:.4g})")

fig, ax = plt.subplots()
ax.plot(t, 1e3 * found.error, lw=1.2, label="measured")
ax.plot(t, 1e3 * found.simulated, "--", lw=1.2, label="simulated behind the leader")
ax.set(xlabel="time [s]", ylabel="leader less follower [mrad]")
ax.legend()
plt.show()
