"""
4. A sweep, and how to read it
==============================

You run a space of parameters into a folder of Parquet files, read it as a table, and find out where
the loop is stable, how fast a cut is, and which numbers to trust.
"""

# %%
# Describe the sweep
# ------------------
# On the command line this is ::
#
#     hapticclay sweep --grid "b=5:2000:7log gain.y=0.1,0.3,0.5,0.7,0.9,1.2" \\
#         --fixed "t_max=30 length=0.1" --out out/map
#
# A name is a parameter of the experiment or any field of the scenario; ``hapticclay fields`` lists
# them. In Python (``pip install 'hapticclay[sweep]' pandas``):

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

grid = hc.studies.parse_grid("b=5:2000:7log gain.y=0.1,0.3,0.5,0.7,0.9,1.2")  # N.s/m, 1/kg
sweep = hc.studies.Sweep("constant", grid, fixed={"t_max": 8.0, "length": 0.1})
folder = Path(tempfile.mkdtemp())
print(hc.studies.run_sweep(sweep, folder, workers=1), "runs made")

# %%
# You may interrupt it at any time: the same call makes only the missing runs.

print(hc.studies.run_sweep(sweep, folder, workers=1), "runs made")

# %%
# Read the results
# ----------------
# ``read_sweep`` returns an Arrow table, one row per run; any reader of Parquet opens the folder as
# well.

table = hc.studies.read_sweep(folder).to_pandas()
print(table[["b", "gain.y", "status", "axis", "end_time", "speed_x", "gain_margin_y"]].head(8))
print(table.status.value_counts())

# %%
# How a run ended
# ---------------
# A "finished" run reached the end of the path, a "time limit" run did not reach it within t_max;
# both were stable so far. "diverged" and "limit cycle" were not. ``gain_margin_y`` is the limit of
# the linear loop over the K of the run, in the stiffest clay that the handle met: below 1 the loop
# is unstable.

unstable = table.status.isin(["diverged", "limit cycle"])
fig, ax = plt.subplots()
for some, marker, label in ((~unstable, "o", "goes on"), (unstable, "x", "unstable")):
    ax.loglog(table.b[some], table["gain.y"][some], marker, label=f"run {label}")
b = np.geomspace(5.0, 2000.0, 100)
ax.plot(
    b, [hc.theory.gain_limit("y", float(i)) for i in b], "--", color="0.3", lw=1, label="gain limit"
)
ax.set(xlabel="damping of the clay b [N·s/m]", ylabel="K of y [1/kg]", ylim=(0.08, 4))
fig.legend(ncols=3, loc="outside upper center")
plt.show()

# %%
# Do run and linear loop ever disagree? A run may end before a slow oscillation has grown, or before
# the handle has met the clay. List such rows rather than trust either:

linear = table["gain_margin_y"] < 1.0
odd = table[(linear != unstable) & table["gain_margin_y"].notna()]
print(odd[["b", "gain.y", "status", "gain_margin_y", "end_time"]])

# %%
# Speed
# -----
# ``speed_x`` is the steady speed in the stiffest clay met. A speed that never became steady is NaN:
# it is missing, not zero. The expected speed is K f/(10 + K b).

steady = table[table.speed_x.notna() & ~unstable]
fig, ax = plt.subplots()
ax.loglog(b, 100 / (10 + b), "--", color="0.3", lw=1, label="expected, K f/(10 + K b)")
ax.loglog(steady.b, 100 * steady.speed_x, "o", ms=4, label="simulated")
ax.set(xlabel="damping of the clay b [N·s/m]", ylabel="steady speed in x [cm/s]")
fig.legend(ncols=2, loc="outside upper center")
plt.show()

# %%
# Which rows to trust
# -------------------
# ``energy_residual`` is the residual of the energy balance as a share of the energy put through: a
# measure of the numerical error of the run. Where it is large, use a smaller dt.

worst = table.loc[table.energy_residual.abs().idxmax()]
print(f"worst: {worst.energy_residual:.1e} at b = {worst.b:g}, K = {worst['gain.y']:g}")

# %%
# Next: :doc:`t5_own_arm`. More: :doc:`/sweep` has files, clusters and interrupted sweeps;
# :doc:`/gallery/studies/index`.
