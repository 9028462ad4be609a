"""
Your own material
=================

The strength of a clay, from a vane test in kPa, becomes the yield force of a tool. The force scales
with the cross-section of the cut and with a bearing factor that depends on its shape.
"""

import matplotlib.pyplot as plt
import numpy as np

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

mine = hc.materials.Material(source="vane test, 12 samples", strength=(18e3, 22e3))  # Pa
depths = np.linspace(1e-3, 20e-3, 40)  # m
fig, ax = plt.subplots()
for width in (0.005, 0.010, 0.020):
    tools = [hc.Tool(width=width, depth=float(d)) for d in depths]
    middle = [mine.flow(tool).Fy for tool in tools]
    low, high = np.array([[flow.Fy for flow in mine.range(tool)] for tool in tools]).T
    (line,) = ax.plot(1e3 * depths, middle, label=f"tool of {1e3 * width:g} mm")
    ax.fill_between(1e3 * depths, low, high, color=line.get_color(), alpha=0.15, lw=0)
ax.set(xlabel="depth of the cut [mm]", ylabel="yield force [N], its range shaded")
ax.legend()

low, high = mine.range(hc.Tool(width=0.010, depth=0.005))
print(f"tool of 10 mm by 5 mm: {low.Fy:.1f} to {high.Fy:.1f} N")
plt.show()
