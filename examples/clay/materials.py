"""
Materials by name
=================

``hc.materials.material`` converts the published strength of a clay into the force on a tool, and
``Material.range`` gives the uncertainty of that force.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

tool = hc.Tool(width=0.010, depth=0.005)  # m
names = [name for name in hc.materials.MATERIALS if hc.materials.material(name, tool).Fy > 0.0]
forces = [hc.materials.material(name, tool).Fy for name in names]
ranges = [hc.materials.MATERIALS[name].range(tool) for name in names]
below = [f - low.Fy for f, (low, _) in zip(forces, ranges, strict=True)]
above = [high.Fy - f for f, (_, high) in zip(forces, ranges, strict=True)]

fig, ax = plt.subplots()
ax.errorbar(forces, names, xerr=(below, above), fmt="o", capsize=4)
for name, force in zip(names, forces, strict=True):
    ax.annotate(f"{force:.3g} N", (force, name), (0, 7), textcoords="offset points", ha="center")
ax.set(xlabel="yield force of a tool of 10 mm by 5 mm [N]", ylim=(-0.5, len(names) - 0.4))
plt.show()
