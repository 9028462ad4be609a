"""
A sweep, read as a table
========================

A sweep runs a space of parameters and writes a Parquet file for each chunk; the same command
resumes an interrupted sweep. pandas, or any other reader, opens the folder.
Needs pyarrow and pandas: ``pip install 'hapticclay[sweep,data]'``.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

grid = hc.studies.parse_grid("b=10:1000:7log gain.y=0.1,0.2,0.4,0.8,1.6")  # N.s/m, 1/kg
sweep = hc.studies.Sweep("constant", grid, fixed={"t_max": 4.0, "length": 0.1}, chunk=35)
with tempfile.TemporaryDirectory() as folder:
    hc.studies.run_sweep(sweep, Path(folder), workers=1)
    table = hc.studies.read_sweep(folder).to_pandas()
print(table[["b", "gain.y", "status", "end_time", "speed_x"]].head())

fig, ax = plt.subplots()
stable = ~table.status.isin(["diverged", "limit cycle"])
for some, marker, label in ((stable, "o", "goes on"), (~stable, "x", "unstable")):
    ax.loglog(table.b[some], table["gain.y"][some], marker, label=f"run {label}")
b = np.geomspace(10.0, 1000.0, 80)
ax.plot(
    b, [hc.theory.gain_limit("y", float(x)) for x in b], "--", color="0.3", lw=1, label="gain limit"
)
ax.set(xlabel="damping of the clay b [N·s/m]", ylabel="K of y [1/kg]", ylim=(0.08, 3.5))
ax.legend(ncols=3, loc="upper center")
plt.show()
