"""
Clay with rotated axes
======================

Wood resists less along its grain than across it. ``Clay(x, y, angle=...)`` damps along rotated
axes, so a straight push moves the handle sideways too: in steady motion (diag(10/K) + B) v = uh.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

# sphinx_gallery_thumbnail_path = "thumbnails/rotated.png"
plt.style.use("hapticclay.views.figure")

K = (0.6, 0.6)
along, across = 10.0, 150.0  # N.s/m
grain, hard = (hc.Profile((0.04,), (0.0, b)) for b in (along, across))
fig, ax = plt.subplots(figsize=(6.4, 4.2))
ax.axvspan(4, 9, color="0.9", label="clay")
for degrees in (-30, 0, 30, 60):
    angle = np.radians(degrees)
    scenario = hc.Scenario(
        clay=hc.Clay(grain, hard, angle=float(angle)),
        gain=K,
        inertia_shaping=True,
        length=0.08,
        force=(1.0, 0.0),
    )
    record = hc.simulate(scenario)
    (line,) = ax.plot(*(100 * record.p.T), label=f"grain at {degrees}°")
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s], [s, c]])
    B = R @ np.diag([along, across]) @ R.T
    v = np.linalg.solve(np.diag([10.0 / k for k in K]) + B, scenario.force)
    end = 100 * record.p[-1]
    back = end - 4.0 * v / v[0]
    ax.plot(*zip(back, end, strict=True), "o--", color=line.get_color(), lw=1, ms=4, mfc="none")
ax.plot([], [], "o--", color="0.3", lw=1, ms=4, mfc="none", label="direction expected")
ax.set(xlabel="x [cm]", ylabel="y [cm]", aspect="equal", xlim=(0, 9))
fig.legend(loc="outside right upper")
plt.show()
