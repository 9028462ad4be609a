"""
Stable in theory, buzzing in practice
=====================================

In continuous time a spring and a damper on a device are stable for any stiffness. Each part of a
real loop lowers the limit: the hold, the difference of positions, the filter, the latency.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

device = hc.Device(mass=0.1, damper=0.5)  # kg, N.s/m
common = dict(B=5.0, device=device, Ts=1e-3)
late = dict(velocity_filter=100.0, delay=1e-3)  # Hz, s
loops = {
    "hold of 1 ms, exact velocity": hc.VirtualWall(velocity="exact", **common),
    "velocity from differences": hc.VirtualWall(**common),
    "filter of 100 Hz": hc.VirtualWall(velocity_filter=100.0, **common),
    "latency of 1 ms": hc.VirtualWall(**common, **late),
    "latency of 2 ms": hc.VirtualWall(**common, **(late | {"delay": 2e-3})),
}
limits = [hc.walls.stiffness_band(wall)[1] for wall in loops.values()]
for name, limit in zip(loops, limits, strict=True):
    print(f"{name}: {limit:.0f} N/m")

fig, ax = plt.subplots(figsize=(6.4, 3.2))
bars = ax.barh(range(len(loops)), [1e-3 * K for K in limits], color="#56B4E9")
names = [("" if i == 0 else "+ ") + name for i, name in enumerate(loops)]
names[-1] = "latency of 2 ms instead"
ax.set_yticks(range(len(loops)), names)
ax.bar_label(bars, fmt="%.1f", padding=3)
ax.invert_yaxis()
ax.set(xlabel="largest stable stiffness [kN/m]; continuous time: no limit", xlim=(0, 12.5))
ax.set_axisbelow(True)
ax.grid(False, axis="y")
plt.show()
