"""
Mass and damping of a device from data
======================================

The motors shake a device that a weak spring centres; force and position are logged. The fit gives
mass and damping with 95 % intervals, and with them the stiffest wall that the device can render.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

true = hc.Device(mass=0.1, damper=0.5)  # kg, N.s/m
spring = hc.Operator(mass=0.0, damper=0.0, spring=20.0)  # N/m, centres the device
push = hc.Multisine((0.05, 0.0), low=0.5, high=20.0, period=4.0, seed=1)  # N rms, Hz, s
rig = hc.VirtualWall(device=true, operator=spring, Ts=1e-3)
record = hc.simulate(rig.scenario(12.0, muscle=push, steps=2))

every = slice(0, None, 2)  # one row per millisecond
force = push(record.t)[every, 0]
position = 5e-6 * np.round(record.p[every, 0] / 5e-6)  # an encoder of 5 um
data = hc.studies.Measurement(record.t[every], input=force, output=position)
found = hc.studies.identify_data(data, "S", band=(0.5, 15.0))
gain, damping = found.coefficients[:2]
device = hc.Device(mass=1.0 / gain.value, damper=damping.value / gain.value)
print(f"mass {device.mass:.4f} kg, damper {device.damper:.3f} N.s/m")
limit = hc.walls.stiffness_band(hc.VirtualWall(device=device, Ts=1e-3))[1]
print(f"stiffest wall at 1 kHz without virtual damping: {limit:.0f} N/m")

fig, ax = plt.subplots()
s = 2j * np.pi * (f := np.geomspace(0.5, 15.0, 300))
fitted = 1.0 / (device.mass * s**2 + device.damper * s + found.coefficients[2].value / gain.value)
ax.loglog(found.frequency, 1e3 * np.abs(found.response), "o", ms=4, label="measured")
ax.loglog(f, 1e3 * np.abs(fitted), "--", color="0.3", lw=1, label="fitted: 1/(m s² + b s + k)")
ax.set(xlabel="frequency [Hz]", ylabel="position over force [mm/N]")
ax.legend()
plt.show()
