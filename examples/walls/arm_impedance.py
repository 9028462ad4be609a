"""
Transparency of the arm
=======================

How well does the paper's arm transmit clay to the hand? Shown are the share of the hand's force
that comes from the clay, and the effective impedance over the rendered one.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

omega = 2.0 * np.pi * np.geomspace(0.1, 30.0, 300)  # rad/s
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.0))
for b, dash in ((30.0, "-"), (90.0, "--"), (300.0, ":")):  # N.s/m
    Zt = hc.theory.loop_response("x", 1.0, b, omega)
    above.loglog(Zt.frequency, abs(Zt.transparency), dash, label=f"b = {b:g} N·s/m")
    below.loglog(Zt.frequency, abs(Zt.ratio), dash)
    Z = hc.theory.loop_impedance("x", 1.0, b, omega[:1])[0]
    print(f"b = {b:g}: Re Z = {Z.real:.3g} N.s/m at 0.1 Hz, 10/K + b = {10.0 + b:g}")
above.set(ylabel="|fe/fh|")
above.legend()
below.set(xlabel="frequency [Hz]", ylabel="|Z/Ze|")
plt.show()
