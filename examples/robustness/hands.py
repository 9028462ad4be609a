"""
A population of hands
=====================

Published hands, and your own population: a distribution for each of mass, damper and spring, and
their correlations.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

plt.style.use("hapticclay.views.figure")

mine = hc.studies.Hands(
    mass=hc.studies.Distribution("log-normal", 0.8, 0.2),  # kg: mean, standard deviation
    damper=hc.studies.Distribution("log-normal", 6.0, 2.0),  # N.s/m
    spring=hc.studies.Distribution("log-uniform", 50.0, 400.0),  # N/m: from, to
    correlation=(0.6, 0.0, 0.0),  # mass and damper
    source="our lab, 12 people",
)
drawn = mine.sample(300)
box = mine.box(0.9)  # for hc.theory.worst_case
print(f"90 % of the dampers: {box.damper[0]:.2f} to {box.damper[1]:.2f} N.s/m")

fig, ax = plt.subplots()
ax.plot([x.mass for x in drawn], [x.damper for x in drawn], "o", ms=3, alpha=0.5, label="mine")
low, high = box.mass, box.damper
ax.plot([low[i] for i in (0, 1, 1, 0, 0)], [high[i] for i in (0, 0, 1, 1, 0)], "k--", label="box")
for name, mark in (("paper", "D"), ("posture", "s")):
    hand = hc.studies.POPULATIONS[name].median
    ax.plot(hand.mass, hand.damper, mark, ms=8, label=name)
ax.set(xlabel="mass of the hand [kg]", ylabel="damper [N·s/m]")
ax.legend()
plt.show()
