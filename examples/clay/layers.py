"""
Clay in layers
==============

``hc.Profile`` describes clay by layers. In each layer the speed settles at K f/(10 + K b), and a
step ends on every border.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

# sphinx_gallery_thumbnail_path = "thumbnails/layers.png"
plt.style.use("hapticclay.views.figure")

edges = (0.03, 0.06, 0.09, 0.12)  # m
values = (0.0, 40.0, 150.0, 20.0, 0.0)  # N.s/m, one more than there are edges
layers = hc.Profile(edges, values)
scenario = hc.Scenario(clay=hc.Clay(layers, layers), gain=(1.0, 0.3), length=0.16)
record = hc.simulate(scenario)
print(record.status)

fig, ax = plt.subplots()
for low, high, b in zip((0.0, *edges), (*edges, 0.16), values, strict=True):
    ax.axvspan(100 * low, 100 * high, color=str(1.0 - b / 900.0), lw=0)
    ax.text(50 * (low + high), 10.6, f"b = {b:g}", ha="center", fontsize=9)
    speed = 100.0 / (10.0 + b)
    label = "expected, K f/(10 + K b)" if low == 0.0 else None
    ax.plot((100 * low, 100 * high), (speed, speed), "--", color="0.3", lw=1, label=label)
ax.plot(100 * record.p[:, 0], 100 * record.v[:, 0], label="simulated")
ax.set(xlabel="position x [cm]", ylabel="velocity x [cm/s]", xlim=(0, 16), ylim=(-1, 11.5))
ax.legend(loc="center", bbox_to_anchor=(0.48, 0.62))
plt.show()
