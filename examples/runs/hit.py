"""
A hit on stiff clay
===================

The handle flies into stiff clay and is stopped within milliseconds. Its first moments are those of
a free mass: v0 exp(-b W t), W being the handle's mobility. A step ends on the border at any step
size, and the impulse of the clay's force is right however stiff the clay is.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

W = hc.Scenario().servo[0].S.gain  # 1/kg
fig, ax = plt.subplots()
for b, marker in ((300.0, "o"), (1000.0, "s"), (10000.0, "^")):
    scenario = hc.Scenario(
        clay=hc.slab(b, 0.05, 0.15),  # N.s/m
        gain=(0.0, 0.0),
        force=(0.0, 0.0),
        start=(0.03, 0.0),
        velocity=(0.3, 0.0),  # m/s
        inertia_shaping=True,
        length=None,
        t_max=0.1,
    )
    record = hc.simulate(scenario)
    hit = record.crossings[0]
    t = 1e3 * (record.t - hit.time)
    (points,) = ax.plot(t, 100 * record.v[:, 0], marker, ms=4, label=f"{b:g} N·s/m")
    fine = np.linspace(0.0, 12.0, 400)
    expected = 100 * hit.speed * np.exp(-b * W * 1e-3 * fine)
    ax.plot(fine, expected, "--", color=points.get_color(), lw=1)
ax.plot([], [], "--", color="0.3", lw=1, label="v0 exp(-b W t)")
ax.set(xlim=(-2, 10), xlabel="time after the hit [ms]", ylabel="velocity x [cm/s]")
ax.legend()
plt.show()
