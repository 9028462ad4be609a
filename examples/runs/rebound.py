"""
A rebound from a spring wall
============================

A spring wall returns the speed of the handle. During contact, mass and spring go through half a
period of an oscillation, so the contact lasts about pi/sqrt(k W) and the force peaks at v0
sqrt(k/W).
"""

import math

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

k, v0 = 1e6, 0.2  # N/m, m/s
wall = hc.Profile((0.05,), (0.0, 0.0), springs=(hc.Spring(), hc.Spring(k=k, unilateral=True)))
scenario = hc.Scenario(
    clay=hc.Clay(wall, hc.Profile((), (0.0,))),
    gain=(0.0, 0.0),
    force=(0.0, 0.0),
    start=(0.048, 0.0),
    velocity=(v0, 0.0),
    inertia_shaping=True,
    length=None,
    t_max=0.03,
)
record = hc.simulate(scenario)
there, back = record.crossings[:2]
W = scenario.servo[0].S.gain  # 1/kg
print(f"contact {1e3 * (back.time - there.time):.2f} ms")
print(f"expected {1e3 * math.pi / math.sqrt(k * W):.2f} ms")

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.4))
t = 1e3 * (record.t - there.time)
above.plot(t, 100 * record.v[:, 0])
above.set(ylabel="velocity x [cm/s]", xlim=(-4, 8))
below.plot(t, record.fe[:, 0], label="clay")
below.axhline(there.speed * math.sqrt(k / W), color="0.3", ls="--", lw=1, label="v0 sqrt(k/W)")
below.set(ylabel="force x [N]", xlabel="time after the contact [ms]")
below.legend()
plt.show()
