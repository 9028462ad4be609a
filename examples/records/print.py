"""
A figure for a paper
====================

``hc.Figure`` draws a plot again in the width and the sizes of a journal's column, as PDF with its
fonts, and writes the numbers that it shows beside it.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import hapticclay as hc
from hapticclay.views.run_plots import velocity_plot

record = hc.simulate(hc.constant_cut(b=90.0))
figure = hc.Figure(lambda: velocity_plot(record))
with tempfile.TemporaryDirectory() as folder:
    for path in figure.save(Path(folder) / "velocity.pdf", style="print", data=True):
        print(path.name, path.stat().st_size, "bytes")
figure.draw("print")
plt.show()
