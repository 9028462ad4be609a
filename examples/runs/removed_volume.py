"""
The volume of a cut
===================

``hc.studies.removed`` is the volume that a tool at the handle has removed, within 0.5 %. A straight
cut through the slab removes width × depth × length. The tool is round: its front is half a width
ahead of the handle.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

width, depth = 0.02, 0.01  # m
record = hc.simulate(hc.constant_cut())
volume, rate = hc.studies.removed(record, width=width, depth=depth)
through_air, _ = hc.studies.removed(hc.simulate(hc.free()), width=width, depth=depth)
print(f"{1e6 * volume[-1]:.3f} cm3, expected {1e6 * width * depth * 0.1:.3f}")
print(f"in free space {through_air[-1]:g}")

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.6))
above.plot(record.t, 1e6 * volume, label="removed")
above.axhline(1e6 * width * depth * 0.1, color="0.3", ls="--", lw=1, label="of the whole slab")
above.set(ylabel="volume [cm³]")
above.legend()
below.semilogy(record.t, 1e6 * rate, label="rate")
speed = record.v[:, 0] * (record.b[:, 0] > 0.0)
below.plot(
    record.t, 1e6 * width * depth * speed, "--", lw=1, label="width × depth × speed, at the handle"
)
below.set(xlabel="time [s]", ylabel="rate [cm³/s]", ylim=(0.5, 50))
below.legend()
plt.show()
