"""
Z-width
=======

Which springs K with which dampers B does a device render stably? Runs find the region; theory gives
the exact border of the linear loop, a sufficient condition, and a rule.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

wall = hc.VirtualWall(device=hc.Device(mass=0.1, damper=0.5), Ts=1e-3)  # kg, N.s/m, s
found = hc.walls.zwidth(wall, B=(0.0, 10.0, 120.0))  # N.s/m
(region,) = found.regions
print(f"largest K: {region.largest_K:.4g} N/m; runs and exact line differ by {found.gap():.1%}")
print("unstable below a line that is sufficient:", found.violations() or "none")

fig, ax = plt.subplots()
ax.plot(region.B, region.K, "o", color="0.1", label="largest stable K of runs")
for limit, dash in zip(region.limits, ("-", "--", "-.", ":"), strict=False):
    mark = "D" if len(limit.B) == 1 else ""
    ax.plot(limit.B, limit.K, dash, marker=mark, mfc="none", ms=10, label=limit.name)
    print(f"{limit.name}: {limit.kind}")
ax.set(
    xlabel="virtual damping B [N·s/m]",
    ylabel="virtual stiffness K [N/m]",
    yscale="log",
    ylim=(100.0, 3e5),
)
ax.legend()
plt.show()
