"""
A groove that stays
===================

A tool removes clay from a block. A second cut along the groove meets nothing, and a cut half a
width beside it meets half the force.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

# sphinx_gallery_thumbnail_path = "thumbnails/groove.png"
plt.style.use("hapticclay.views.figure")

pressure, tool = 20e3, hc.Tool(width=0.010, depth=0.005)  # Pa, m
block = hc.Groove(x=(0.02, 0.08), y=(-0.02, 0.02), pressure=pressure, tool=tool, cells=(72, 48))
cut = dict(gain=(1.0, 0.0), force=(2.0, 0.0), length=0.1, inertia_shaping=True, dt=1e-3)
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.4), height_ratios=(2, 3))
record = None
for y, name in ((0.0, "first"), (0.0, "again"), (0.005, "half a width beside")):
    left = block if record is None else block.after(record.ground)
    scenario = hc.Scenario(clay=hc.Clay.of_groove(left), start=(0.0, y), **cut)
    record = hc.simulate(scenario)
    print(f"{name}: {1e6 * record.extra['removed'][-1]:.2f} cm3 removed")
    above.plot(100 * record.p[:, 0], record.fe[:, 0], label=name)
    below.plot(*(100 * record.p.T), lw=1)
full = pressure * tool.width * tool.depth
for share in (1.0, 0.5):
    label = "pressure × cross-section, and half of it" if share == 1.0 else None
    above.axhline(share * full, color="0.3", ls="--", lw=1, label=label)
above.set(ylabel="force of the clay [N]", ylim=(-0.05, 1.75 * full))
above.legend(ncols=2, loc="upper center", fontsize=9)
x, y = block.edges
picture = below.pcolormesh(100 * x, 100 * y, 1e3 * record.ground.T, cmap="YlOrBr", zorder=0)
fig.colorbar(picture, ax=below, label="clay left [mm]", location="bottom", shrink=0.6)
below.set(xlabel="x [cm]", ylabel="y [cm]", aspect="equal")
below.grid(False)
plt.show()
