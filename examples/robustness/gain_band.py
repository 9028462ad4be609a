"""
A gain limit over many hands
============================

The gain limit is exact for each hand; over a population it is a band. In hard clay the hand hardly
matters.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

hands = hc.studies.Hands.around(hc.Operator(), variation=0.5)
b = np.geomspace(10.0, 500.0, 13)  # N.s/m
band = hc.studies.gain_band(hc.theory.Loop("x"), hands, b.tolist(), hc.studies.Draw(hands=60))
fig, ax = plt.subplots()
low, high = band.quantile(0.05), np.minimum(band.quantile(0.95), 1e6)  # inf is no limit
ax.fill_between(b, low, high, alpha=0.3, label="5 to 95 % of hands")
ax.plot(b, band.nominal, label="hand of medians")
ax.plot(b, band.least, ":", color="0.2", label="least of the hands drawn")
ax.set(xlabel="clay b [N·s/m]", ylabel="gain limit of x [1/kg]", xscale="log", yscale="log")
ax.set_ylim(2.0, 200.0)
ax.legend()
plt.show()
