"""
Random hands, stored run by run
===============================

``hc.studies.run_columns`` makes one run for each row of some columns and stores the final values in
a folder. A second call makes the runs that are missing, for example after an interruption. Here
hands of random mass and damper pull into clay for 0.3 s.
Needs pyarrow: ``pip install 'hapticclay[sweep]'``.
"""

import tempfile

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

rng = np.random.default_rng(0)
hands = {
    "operator.mass": rng.lognormal(-0.7, 0.5, 120),  # kg
    "operator.damper": rng.lognormal(1.5, 0.7, 120),  # N.s/m
}
scene = hc.constant_cut(b=20.0, start=(0.05, 0.0), t_max=0.3, operator=hc.Operator())
with tempfile.TemporaryDirectory() as folder:
    hc.studies.run_columns(scene, hands, folder, chunk=40, workers=1)
    runs = hc.studies.read_sweep(folder)

fig, ax = plt.subplots()
speed = 100 * runs["v_x"].to_numpy()
dots = ax.scatter(hands["operator.damper"], speed, c=hands["operator.mass"], s=12, zorder=3)
ax.set(xscale="log", xlabel="damper of the hand [N·s/m]", ylabel="speed after 0.3 s [cm/s]")
fig.colorbar(dots, label="mass of the hand [kg]")
plt.show()
