"""
Your own muscle force
=====================

``Scenario.muscle`` can be steps, ramps, pulses, chirps, multisines, arrays, any function, and sums
of them. A chirp shakes the handle in clay; the amplitude of its speed follows the frequency
response of the loop, ``|v/uh|``.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b, K = 30.0, 1.0  # N.s/m, 1/kg
chirp = hc.Chirp((1.0, 0.0), low=0.5, high=12.0, duration=30.0)  # N, Hz, s
scenario = hc.Scenario(
    clay=hc.slab(b),
    gain=(K, 0.5),
    force=(0.0, 0.0),
    muscle=chirp,
    inertia_shaping=True,
    length=None,
    t_max=30.0,
)
record = hc.simulate(scenario)

# |v/uh| = |s Y/(1 + s Y b)|, Y = G C + Sh: Eq. 8 of the paper without a hand
frequency = 0.5 + 11.5 * record.t / 30.0
s = 2j * np.pi * frequency
G, S = (part.gain / (s**2 + part.damping * s + part.stiffness) for part in
        (scenario.servo[0].G, scenario.servo[0].S))  # fmt: skip
Y = G * K / (s**2 + 10.0 * s) + S
speed = np.abs(s * Y / (1.0 + s * Y * b))

fig, ax = plt.subplots()
ax.plot(record.t, 100 * record.v[:, 0], lw=0.8, label="simulated")
ax.plot(record.t, 100 * speed, "--", color="0.2", lw=1.2, label="|v/uh| expected")
ax.plot(record.t, -100 * speed, "--", color="0.2", lw=1.2)
ax.set(xlabel="time [s]", ylabel="velocity x [cm/s]")
above = ax.secondary_xaxis("top", functions=(lambda t: 0.5 + 11.5 * t / 30, lambda f: f))
above.set_xlabel("frequency [Hz]")
ax.legend()
plt.show()
