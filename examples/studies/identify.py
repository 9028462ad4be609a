"""
Identify G from a noisy record
==============================

The arm is excited by a multisine, as in the paper, and the response is fitted with a second-order
transfer function. The lower plot shows the deviation of the fit from the measured lines, and their
standard deviation.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

found = hc.studies.identify("x", "G", noise=hc.studies.Noise())
for c in found.coefficients:
    print(f"{c.name}: {c.low:.2f} to {c.high:.2f} {c.unit}, printed {c.printed:g}")

G = hc.Scenario().servo[0].G  # as printed, Eq. 15
frequency = np.geomspace(0.15, 20.0, 300)  # Hz
s = 2j * np.pi * frequency
expected = G.gain / (s**2 + G.damping * s + G.stiffness)
s = 2j * np.pi * found.frequency
error = np.abs(found.response - G.gain / (s**2 + G.damping * s + G.stiffness))

fig, (above, middle, below) = plt.subplots(3, 1, sharex=True, figsize=(6.4, 6.0))
above.loglog(frequency, np.abs(expected), label="Eq. 15")
above.loglog(found.frequency, np.abs(found.response), "o", ms=4, label="measured")
above.set(ylabel="|G| [m/m]")
above.legend()
middle.semilogx(frequency, np.degrees(np.unwrap(np.angle(expected))))
middle.semilogx(found.frequency, np.degrees(np.unwrap(np.angle(found.response))), "o", ms=4)
middle.set(ylabel="phase [°]")
below.loglog(found.frequency, error, "o", ms=4, label="measured - Eq. 15")
below.loglog(found.frequency, found.deviation, "--", color="0.3", lw=1, label="deviation")
below.set(xlabel="frequency [Hz]", ylabel="error [m/m]")
below.legend(ncols=2)
plt.show()
