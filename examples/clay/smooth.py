"""
Smooth clay from a picture
==========================

The brightness of a picture becomes damping, either of cells, with borders on which steps end, or of
a smooth spline without borders. Here the picture is a soft blob in hard clay.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

# sphinx_gallery_thumbnail_path = "thumbnails/smooth.png"
plt.style.use("hapticclay.views.figure")

y, x = np.mgrid[-1:1:31j, -1:1:41j]
blob = 1.0 - 0.9 * np.exp(-3.0 * (x**2 + y**2))
with tempfile.TemporaryDirectory() as folder:
    plt.imsave(file := Path(folder) / "blob.png", 1.0 - blob, cmap="gray", vmin=0, vmax=1)
    picture = hc.gray_image(file)

box = dict(x=(0.04, 0.16), y=(-0.04, 0.04), b=(90.0, 10.0))  # N.s/m at black and at white
laws = {"cells": hc.Grid.of_image(picture, **box), "smooth": hc.Smooth.of_image(picture, **box)}
fig, ax = plt.subplots()
for name, law in laws.items():
    record = hc.simulate(hc.with_fields(hc.constant_cut(), {"clay": hc.Clay(law, law)}))
    print(f"{name}: {record.status}, {len(record.crossings)} borders")
    ax.plot(100 * record.p[:, 0], 100 * record.v[:, 0], label=name)
    if name == "smooth":
        expected = 100 / (10.0 + record.b[:, 0])
        ax.plot(100 * record.p[:, 0], expected, "--", color="0.3", lw=1, label="K f/(10 + K b)")
ax.set(xlabel="position x [cm]", ylabel="velocity x [cm/s]", xlim=(3, 20))
ax.legend()
plt.show()
