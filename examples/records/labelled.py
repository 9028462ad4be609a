"""
A record with names and units
=============================

``to_xarray`` returns the numbers with their axes, joints and units, and the whole scenario.
Needs xarray: ``pip install 'hapticclay[data]'``.
"""

import json

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

record = hc.simulate(hc.variable_cut(), every=30)
data = record.to_xarray()
print(data.status, "-", data.tau.units, "-", json.loads(data.scenario)["gain"])

fig, ax = plt.subplots()
for joint, dash in zip(data.joint.values, ("-", "--"), strict=True):
    ax.plot(data.time, data.tau.sel(joint=joint), dash, label=joint)
ax.set(xlabel="time [s]", ylabel=f"torque of the motor [{data.tau.units}]")
ax.legend()
plt.show()
