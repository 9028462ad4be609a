"""
Time-domain passivity control
=============================

Where b Ts W > 2, clay that motors hold for a sample gives energy that real clay would absorb. An
observer adds up the absorbed energy, and a controller changes the force in time to keep this energy
from becoming negative.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

b, Ts = 8e3, 0.36e-3  # N.s/m, s
print(f"b Ts W = {b * Ts * hc.Scenario().servo[0].S.gain:.2f}")
base = hc.Scenario(
    clay=hc.slab(b, 0.05, 0.15),
    control="sampled",
    Ts=Ts,
    force=(0.2, 0.0),
    inertia_shaping=True,
    start=(0.049, 0.0),
    torque_limit=(1e6, 1e6),  # N.m, so that nothing but the hold matters
    length=None,
    t_max=0.15,
    stop_when_unstable=False,
)
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.8))
for name, on in (("without", False), ("with the controller", True)):
    record = hc.simulate(hc.with_fields(base, {"hardware": hc.Hardware(passivity=on)}))
    taken = np.cumsum(record.fe[:-1, 0] * np.diff(record.p[:, 0]))  # J, each force held for Ts
    print(f"{name}: {record.status}; least energy {1e3 * taken.min():.3g} mJ")
    t = 1e3 * (record.t - record.crossings[0].time)
    above.plot(t, 100 * record.v[:, 0], ".-", ms=3, lw=0.8, label=name)
    below.plot(t[1:], 1e3 * taken, ".-", ms=3, lw=0.8, label=name)
below.axhline(0.0, color="0.3", ls="--", lw=1)
above.set(ylabel="velocity x [cm/s]", xlim=(-1, 5), ylim=(-10, 10))
above.legend(ncols=2)
below.set(xlabel="time in the clay [ms]", ylabel="energy the clay took [mJ]", ylim=(-2, 0.5))
plt.show()
