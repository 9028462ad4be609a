"""
A record as a table
===================

``to_frame`` returns a pandas DataFrame; ``export`` writes CSV, Parquet, netCDF, MAT and others.
Needs pandas: ``pip install 'hapticclay[data]'``.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

record = hc.simulate(hc.constant_cut(b=90.0), every=30)
with tempfile.TemporaryDirectory() as folder:
    path = record.export(Path(folder) / "cut.csv")
    read = pd.read_csv(path, comment="#", index_col="t")
frame = record.to_frame()
pd.testing.assert_frame_equal(read, frame, rtol=1e-15)  # before pandas 3.1, to a last digit
print(frame[["p_x", "v_x", "fe_x"]].describe().loc[["min", "max"]])

fig, ax = plt.subplots()
for column, dash in (("fh_x", "-"), ("fe_x", "--")):
    ax.plot(frame.index, frame[column], dash, label=column)
ax.set(xlabel="time [s]", ylabel=f"force [{frame.attrs['units']['fe_x']}]")
ax.legend()
plt.show()
