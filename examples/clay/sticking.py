"""
A push that sticks
==================

Clay with a yield force holds the handle until the push exceeds it. At rest the force of the clay
equals that of the hand and the velocity is exactly 0. The handle does not chatter or creep at any
step size.
"""

import matplotlib.pyplot as plt

import hapticclay as hc

# sphinx_gallery_thumbnail_path = "thumbnails/sticking.png"
plt.style.use("hapticclay.views.figure")

Fy = 5.0  # N
push = hc.Ramp((4.0, 0.0), start=0.0, end=2.0) - hc.Ramp((4.0, 0.0), start=2.0, end=4.0)
scenario = hc.Scenario(
    clay=hc.slab(hc.Flow(Fy=Fy, b=30.0)),
    force=(0.0, 0.0),
    muscle=push,
    length=None,
    t_max=4.0,
)
record = hc.simulate(scenario)
for stop in record.stops:
    print(stop)

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(6.4, 4.8))
held = record.held()[:, 0]
above.fill_between(record.t, 0, 8, where=held, color="#56B4E9", alpha=0.35, lw=0, label="held")
above.plot(record.t, record.fh[:, 0], label="hand")
above.plot(record.t, record.fe[:, 0], label="clay")
above.axhline(Fy, color="0.3", ls="--", lw=1, label="Fy")
above.set(ylabel="force x [N]")
above.legend(ncols=4, loc="lower center")
below.plot(record.t, 100 * record.p[:, 0])
below.set(xlabel="time [s]", ylabel="position x [cm]")
plt.show()
