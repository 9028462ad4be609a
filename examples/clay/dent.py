"""
A wall that dents
=================

A wall pushes back with k times its indentation, yields at its limit and keeps a dent. The area of
the force loop is the work that the wall absorbed.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

# sphinx_gallery_thumbnail_path = "thumbnails/dent.png"
plt.style.use("hapticclay.views.figure")

k, limit = 2e3, 4.0  # N/m, N
spring = hc.Spring(k=k, limit=limit, unilateral=True)
wall = hc.Profile((0.02,), (0.0, 60.0), springs=(hc.Spring(), spring))
push = hc.Ramp((6.0, 0.0), start=0.0, end=1.0) - hc.Ramp((8.0, 0.0), start=1.0, end=2.0)
scenario = hc.Scenario(
    clay=hc.Clay(wall, hc.Profile((), (0.0,))),
    force=(0.0, 0.0),
    muscle=push,
    length=None,
    t_max=2.0,
)
record = hc.simulate(scenario)
lost = record.energy["springs_dissipated"]
print(f"{1e3 * lost:.2f} mJ lost, {1e3 * lost / limit:.2f} mm of dent")

fig, ax = plt.subplots()
depth = 1e3 * (record.p[:, 0] - 0.02)
ax.plot(depth, record.fe[:, 0] - record.b[:, 0] * record.v[:, 0], label="simulated, less b v")
dent = 1e3 * lost / limit
corners = [(0.0, 0.0), (1e3 * limit / k, limit), (dent + 1e3 * limit / k, limit), (dent, 0.0)]
ax.plot(*zip(*corners, strict=True), "--", color="0.3", lw=1, label="expected")
ax.set(xlabel="indentation [mm]", ylabel="force of the wall [N]", xlim=(-2, None))
ax.legend()
plt.show()
