"""
Marble clay from a function
===========================

``Grid.of_function`` evaluates b(x, y) at the centre of each cell. Here soft and hard veins cross
the path of the tool, which is pushed along x and drifts along y.
"""

import math

import matplotlib.pyplot as plt

import hapticclay as hc

# sphinx_gallery_thumbnail_path = "thumbnails/marble.png"
plt.style.use("hapticclay.views.figure")


def veins(x, y):
    """b [N.s/m] at a place [m]."""
    bend = 0.012 * math.sin(120.0 * y)
    return 45.0 + 40.0 * math.sin(260.0 * (x + bend) + 100.0 * y)


x = [0.02 + 0.002 * i for i in range(61)]
y = [-0.03 + 0.002 * i for i in range(46)]
marble = hc.Grid.of_function(veins, x, y)
scenario = hc.Scenario(
    clay=hc.Clay(marble, marble), gain=(1.0, 0.4), force=(1.0, 0.5), length=0.15, t_max=30.0
)
record = hc.simulate(scenario)
print(record.status, len(record.crossings), "borders passed")

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 5.6), height_ratios=(3, 2))
shown = marble.damping[1:-1, 1:-1].T  # the outer cells have no end
picture = above.pcolormesh([100 * i for i in x], [100 * i for i in y], shown, cmap="YlOrBr")
fig.colorbar(picture, ax=above, label="b [N·s/m]")
above.plot(*(100 * record.p.T), color="#0072B2", lw=2)
above.set(ylabel="y [cm]", aspect="equal")
above.grid(False)
below.plot(100 * record.p[:, 0], record.b[:, 0], label="b met")
below.plot(100 * record.p[:, 0], record.ratio(record.fe)[:, 0], "--", label="fe/v")
below.set(xlabel="x [cm]", ylabel="[N·s/m]", ylim=(0, 110))
below.legend(ncols=2, loc="upper center")
plt.show()
