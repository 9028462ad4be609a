"""
A figure for a paper
====================

``hc.Figure`` draws a plot in the width and text sizes of a journal column, as PDF with embedded
fonts, and writes its numbers as CSV.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import hapticclay as hc
from hapticclay.views import style

record = hc.simulate(hc.constant_cut(b=90.0), every=30)


def velocity():
    """Draws in the style of now: sizes come from ``style``."""
    with style.figure_style():
        fig, ax = plt.subplots(figsize=style.figure_size(1, 2.4))
        ax.plot(100 * record.p[:, 0], 100 * record.v[:, 0], lw=style.stroke(1.5), label="x")
        ax.set(xlabel="position [cm]", ylabel="velocity [cm/s]")
        ax.legend()
    return fig


figure = hc.Figure(velocity)
with tempfile.TemporaryDirectory() as folder:
    for path in figure.save(Path(folder) / "velocity.pdf", style="print", data=True):
        print(path.name, path.stat().st_size, "bytes")
plt.close("all")
print(f"{2.54 * figure.draw('print').get_figwidth():.1f} cm wide")
plt.show()
