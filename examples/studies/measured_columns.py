"""
Identify from your own columns
==============================

``hc.studies.identify_data`` takes measured time, input and output. Here they come from a run: a
chirp as the command, the position rounded to counts.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

chirp = hc.Chirp((0.01, 0.0), low=0.2, high=12.0, duration=30.0)  # m, Hz, s
scenario = hc.Scenario(
    gain=(0.0, 0.0),
    force=(0.0, 0.0),
    command=chirp,
    inertia_shaping=True,
    length=None,
    t_max=30.996,
)
record = hc.simulate(scenario, every=3)
position = np.round(record.p[:, 0] / 1e-5) * 1e-5
data = hc.studies.Measurement(record.t, input=record.delta[:, 0], output=position)
found = hc.studies.identify_data(data, "G", "x", band=(0.3, 10.0))
for c in found.coefficients:
    print(f"{c.name}: {c.low:.2f} to {c.high:.2f} {c.unit}, true {c.printed:g}")

fig, ax = plt.subplots()
G = scenario.servo[0].G
frequency = np.geomspace(0.3, 10.0, 200)
s = 2j * np.pi * frequency
expected = np.abs(G.gain / (s**2 + G.damping * s + G.stiffness))
ax.loglog(found.frequency, np.abs(found.response), "o", ms=4, label="measured")
ax.loglog(frequency, expected, "--", color="0.3", lw=1, label="true")
ax.set(xlabel="frequency [Hz]", ylabel="|G| [m/m]")
ax.legend()
plt.show()
